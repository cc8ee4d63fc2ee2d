// SPDX-License-Identifier: GPL-3.0-or-later
// Rest is approached by steps of implicit Euler that begin without velocity. With the
// forces f at u, the mass M and the stiffness S of the frames at u, one is
//   du = (M / dt^2 + S)^-1 f,  u <- u + t du.
// S knows nothing of what tension adds to it: of a limb that hangs in its weight that is
// most of the stiffness. So a long step goes many times too far there, and the next one
// from there even farther. M / dt^2 stands in for what is missing: the longest dt that
// does not overshoot is that of the slowest pendulum, sqrt(L / g), and each step halves
// the way to rest. Stiff flesh is at rest after two or three steps of the longest dt.
//   A step has gone too far where f(u + t du) . du is below -1/2 f(u) . du, and t becomes
// what the secant says; or where a cell's deformation has changed by more than frames,
// which are those at u, can follow. dt goes down with t, and up again where f . du stays
// positive. So the energy falls from step to step, and strain stays bounded.
// The one step in which held points move is not cut.
//   Measured (bar 7 x 1 x 1, 3 cells thick, density g L / E = 1): 2,000 steps of
//   conjugate
// gradients for a bar that hangs, where damped dynamics takes 4,000 to 5,000, and 8,000
// to 11,000 for one that stands and buckles. Systems are solved to a tenth only: more
// digits save few of them.
#include "solver/flesh/flesh.h"

#include <algorithm>
#include <cmath>

#include "solver/flesh/flesh_parts.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Matrix3d;
using Eigen::VectorXd;

/// The longest step, of the time that sound takes through the shape.
constexpr double kLongStep = 300.0;
constexpr int kMostRounds = 400;

/// Tolerance of the systems: a multiple of that of a step in time, and at the most.
constexpr double kLoose = 100.0, kMostTolerance = 0.1;

/// A round may change the deformation F of a cell by this; where it would change it by
/// more it is cut to the second number.
constexpr double kMostChange = 1.0, kCutChange = 0.4;
/// And it may leave this share of the slope of the energy, negative: it went too far.
constexpr double kMostOvershoot = 0.5;
constexpr int kMostCuts = 4;

/// The next dt as a share of this one: between the first two numbers after a round that
/// was cut, the third one after a round that did not go too far.
constexpr double kMostShrink = 0.1, kLeastShrink = 0.7, kGrowth = 2.0;
constexpr double kNotTooFar = -0.1, kSmallChange = 0.25;

/// Held points that are this far from where they should be are to move [size].
constexpr double kMoves = 1e-9;

double longest_step(const std::vector<FleshMaterial>& materials, double size)
{
    double slowest = INFINITY; // sound [m/s]
    for (const FleshMaterial& material : materials)
        slowest = std::min(slowest, std::sqrt(material.young / material.density));
    return kLongStep * size / slowest;
}

double largest_change(const std::vector<Matrix3d>& from, const std::vector<Matrix3d>& to)
{
    double largest = 0.0;
    for (std::size_t c = 0; c < from.size(); ++c)
        largest = std::max(largest, (to[c] - from[c]).norm());
    return largest;
}

} // namespace

/// Goes to rest with its own settings of the steps.
class Flesh::Settling
{
public:
    Settling(Flesh& flesh, std::span<const Motion> motions,
             const FleshSurroundings& around)
        : flesh_(flesh), p_(*flesh.parts_), weight_(p_.weight), loads_(p_.loads),
          settings_(p_.settings), motions_(motions), around_(around)
    {
        p_.settings.newton = 1;
        p_.settings.alpha = p_.settings.beta = 0.0;
        p_.settings.tolerance = std::min(kMostTolerance, kLoose * settings_.tolerance);
        p_.prepared_dt = -1.0;
        longest_ = dt_ = longest_step(p_.materials, p_.size);
    }
    ~Settling()
    {
        p_.weight = weight_;
        p_.loads = loads_;
        p_.settings = settings_;
        p_.prepared_dt = -1.0;
    }
    Settling(const Settling&) = delete;
    Settling& operator=(const Settling&) = delete;

    FleshReport run(FleshState& state, Weighs weighs, double at_rest)
    {
        state.v.setZero();
        report_.is_converged = false;
        if (flesh_.largest_miss(state, motions_) > kMoves * p_.size)
            follow_bones(state);
        if (weighs == Weighs::No)
            leave_out_weight();
        for (int round = 0; round < kMostRounds && report_.is_finite; ++round)
            if (const double way = go(state); way <= at_rest * p_.size && is_solved_)
            {
                report_.is_converged = report_.is_finite;
                break;
            }
        return report_;
    }

private:
    FleshReport step(FleshState& state)
    {
        const FleshReport step = flesh_.step(state, dt_, motions_, around_);
        report_.systems += step.systems;
        report_.cg_steps += step.cg_steps;
        report_.factors += step.factors;
        report_.residual = step.residual;
        report_.is_finite = step.is_finite;
        is_solved_ = step.is_converged;
        return step;
    }

    /// Held points go where they should be, and nothing else pushes: what follows is as
    /// far as they go.
    void follow_bones(FleshState& state)
    {
        leave_out_weight();
        p_.loads.setZero();
        step(state);
        state.v.setZero();
        p_.weight = weight_;
        p_.settings.gravity = settings_.gravity;
        p_.loads = loads_;
    }

    void leave_out_weight()
    {
        p_.weight.setZero();
        p_.settings.gravity.setZero();
    }

    void forces_at(const VectorXd& u, VectorXd& free)
    {
        p_.forces.follow(u);
        p_.forces.forces(u, motions_, p_.force);
        p_.force += p_.outer_forces();
        p_.reduce(p_.force, free);
    }

    /// One round. Returns the way that it would go without a cut [m].
    double go(FleshState& state)
    {
        FleshState next = state;
        step(next);
        if (!report_.is_finite)
            return INFINITY;
        const VectorXd way = next.u - state.u;
        const double most = way.cwiseAbs().maxCoeff();
        if (p_.regions || p_.settings.law == FleshLaw::Linear)
        {
            // The forces are linear: no frame of a cell turns.
            state.u = next.u;
            return most;
        }
        VectorXd free_way(Eigen::Index(3 * p_.nodes.free.size()));
        for (std::size_t k = 0; k < p_.nodes.free.size(); ++k)
            free_way.segment<3>(Eigen::Index(3 * k)) =
                way.segment<3>(3 * p_.nodes.free[k]);
        forces_at(state.u, free_force_);
        const double before = free_force_.dot(free_way);
        p_.forces.mean_deformations(state.u, from_);
        double t = 1.0;
        for (int cut = 0;; ++cut)
        {
            next.u = state.u + t * way;
            forces_at(next.u, free_force_);
            p_.forces.mean_deformations(next.u, to_);
            const double change = largest_change(from_, to_),
                         after = free_force_.dot(free_way);
            if (!std::isfinite(change) || !std::isfinite(after))
            {
                report_.is_finite = false;
                return INFINITY;
            }
            // Rows may push against the forces: then there is no slope to go by.
            const double slope = before > 0.0 ? after / before : 1.0;
            if (cut < kMostCuts && change > kMostChange)
                t *= kCutChange / change;
            else if (cut < kMostCuts && slope < -kMostOvershoot)
                t *= std::max(kMostShrink, 1.0 / (1.0 - slope));
            else
            {
                if (cut > 0)
                    dt_ *= std::clamp(std::sqrt(t), kMostShrink, kLeastShrink);
                else if (slope > kNotTooFar && change < kSmallChange)
                    dt_ = std::min(longest_, kGrowth * dt_);
                break;
            }
        }
        state.u = next.u;
        return most;
    }

    Flesh& flesh_;
    Parts& p_;
    const VectorXd weight_, loads_;
    const FleshSettings settings_;
    const std::span<const Motion> motions_;
    const FleshSurroundings around_;
    double longest_ = 0.0, dt_ = 0.0; ///< [s]
    FleshReport report_;
    bool is_solved_ = true; ///< the last step
    VectorXd free_force_;
    std::vector<Matrix3d> from_, to_;
};

VectorXd Flesh::sag(const Eigen::Vector3d& gravity, std::span<const Motion> at_rest)
{
    Parts& p = *parts_;
    VectorXd weight = p.weight_in(gravity);
    std::vector<FleshRegionShares> carrying;
    std::swap(p.weight, weight);
    std::swap(p.carrying, carrying);
    FleshState state = rest();
    step(state, longest_step(p.materials, p.size), at_rest);
    std::swap(p.weight, weight);
    std::swap(p.carrying, carrying);
    return state.u;
}

FleshReport Flesh::settle(FleshState& state, std::span<const Motion> motions,
                          Weighs weighs, const FleshSurroundings& around, double at_rest)
{
    return Settling(*this, motions, around).run(state, weighs, at_rest);
}

} // namespace cellwarp::core
