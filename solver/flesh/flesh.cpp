// SPDX-License-Identifier: GPL-3.0-or-later
// A step is linearised implicit Euler [BaraffWitkin98], at the state that is predicted
// and with the bones where they will be [theory-skeleton 6.2]: with u' = u + h v,
//   (M + h C + h^2 S) dv = h f(u', v; motions after the step),
//   v += dv,  u += h v.
// M is the mass, S the stiffness of cells in their frames at u' and that of the tubes,
// and C = alpha M + beta R K R^T. Held points are rows on dv, such that they end exactly
// where they should: J dv = (gamma - J u) / h - J v. They are eliminated: with
// dv = Z dv_free + G c, Z^T A Z dv_free = Z^T (b - A G c) has only free nodes. It is
// solved from zero: to begin with the last step's dv saves nothing (16 to 20 steps either
// way).
#include "solver/flesh/flesh.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "octree/base/parallel.h"
#include "solver/flesh/flesh_parts.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

/// More steps than this tell that a system cannot be solved to the tolerance.
constexpr int kMostCgSteps = 2000;

/// Newton ends where the residual is below this, relative to that of the first round.
constexpr double kNewtonTolerance = 1e-6;

/// What is nearer to an obstacle touches it, relative to the size.
constexpr double kTouching = 1e-6;

} // namespace

namespace
{

/// The matrix of a step, on free nodes.
template <class Parts>
class StepOperator final : public LinearOperator
{
public:
    StepOperator(const Parts& parts, double dt)
        : parts_(parts), factors_(parts.factors(dt))
    {
    }
    void multiply(const VectorXd& x, VectorXd& y) const override
    {
        parts_.expand(x, nullptr, all_);
        parts_.forces.multiply(all_, factors_, image_);
        parts_.reduce(image_, y);
    }

private:
    const Parts& parts_;
    const FleshFactors factors_;
    mutable VectorXd all_, image_;
};

} // namespace

FleshReport Flesh::Parts::step_by_rounds(const FleshState& state, double dt,
                                         std::span<const Motion> motions,
                                         const FleshSurroundings& around)
{
    FleshReport report;
    const StepOperator<Parts> A(*this, dt);
    velocity = state.v;
    double first_size = 0.0; // of the right side
    StepRows changing(free_shares, surface, around, dt, size);
    for (int round = 0; round < std::max(1, settings.newton); ++round)
    {
        impulse(state.u, state.v, velocity, dt, motions);
        // Held points are met by the first round, exactly.
        if (round == 0)
            find_rows(state, dt, motions);
        else
            rows.setZero();
        free_step = VectorXd::Zero(Eigen::Index(3 * nodes.free.size()));
        expand(free_step, &rows, change);
        forces.multiply(change, factors(dt), image);
        force -= image;
        reduce(force, free_b);
        const double now = free_b.norm();
        if (round > 0 && now <= kNewtonTolerance * first_size)
            break;
        const auto solve = [&](NodeRows& met, std::span<const NodeBrake> brakes,
                               const VectorXd& b, VectorXd& x, VectorXd& l)
        {
            const LinearReport linear =
                met.solve(BrakedOperator(A, brakes), *preconditioner, b,
                          {settings.tolerance, kMostCgSteps}, cg, x, l);
            ++report.systems;
            report.cg_steps += linear.steps;
            report.residual = linear.residual;
            expand(x, &rows, change);
        };
        report.contacts = changing.solve(state.u, velocity, rows, free_b,
                                         preconditioner->scale(), solve, change);
        report.is_converged = report.is_converged && report.contacts.is_settled &&
                              report.residual <= 1.01 * settings.tolerance;
        if (round == 0)
            first_size = now;
        if (!change.allFinite())
        {
            report.is_finite = report.is_converged = false;
            return report;
        }
        velocity += change;
    }
    return report;
}

/// What changes is added to the blended step: by the least change that meets it.
FleshReport Flesh::Parts::step_by_regions(const FleshState& state, double dt,
                                          std::span<const Motion> motions,
                                          const FleshSurroundings& around)
{
    FleshReport report;
    velocity = state.v;
    find_rows(state, dt, motions);
    predicted = state.u + dt * state.v;
    const bool is_prepared = regions->is_prepared(dt);
    if (!regions->prepare(dt))
    {
        report.is_finite = report.is_converged = false;
        return report;
    }
    VectorXd blended;
    const VectorXd outer = loads + carried;
    regions->step(predicted, state.v, {outer, settings.gravity, motions, rows}, blended);
    report.systems = static_cast<int>(regions->size());
    if (!is_prepared)
        report.factors = static_cast<int>(regions->size() - regions->num_taken());
    if (by_mass.size() == 0)
    {
        // So that forces are what changes momentum.
        forces.multiply(VectorXd::Ones(weight.size()), {1.0, 0.0, 0.0}, image);
        reduce(image, free_b);
        by_mass.resize(Eigen::Index(nodes.free.size()));
        for (Eigen::Index n = 0; n < by_mass.size(); ++n)
            by_mass[n] = 1.0 / free_b[3 * n];
    }
    const VectorXd& scale = by_mass;
    free_b = VectorXd::Zero(blended.size());
    const auto solve = [&](NodeRows& met, std::span<const NodeBrake> brakes,
                           const VectorXd&, VectorXd& x, VectorXd& l)
    {
        x = blended;
        for (const NodeBrake& brake : brakes)
        {
            double gives = 0.0;
            for (const NodeShare& share : brake.shares)
                gives += share.share * share.share * scale[share.node];
            const Vector3d braked = brake.force(x) / (1.0 + brake.factor * gives);
            for (const NodeShare& share : brake.shares)
                x.segment<3>(3 * share.node) += scale[share.node] * share.share * braked;
        }
        l.resize(0);
        if (!met.rows().empty())
        {
            l = met.weighed(met.values() - met.times(x));
            met.correct(x);
        }
        expand(x, &rows, change);
    };
    StepRows changing(free_shares, surface, around, dt, size);
    report.contacts =
        changing.solve(state.u, velocity, rows, free_b, scale, solve, change);
    report.is_converged = report.contacts.is_settled;
    if (!change.allFinite())
        report.is_finite = report.is_converged = false;
    velocity += change;
    return report;
}

Flesh::Flesh(Lattice lattice, std::vector<FleshMaterial> materials,
             std::vector<HeldPoint> points, std::vector<TubePart> tubes,
             FleshSettings settings, std::vector<FleshRegionShares> regions)
    : parts_(std::make_unique<Parts>(std::move(lattice), std::move(materials),
                                     std::move(points), std::move(tubes), settings,
                                     std::move(regions)))
{
}

Flesh::~Flesh() = default;
Flesh::Flesh(Flesh&&) noexcept = default;

const Lattice& Flesh::lattice() const
{
    return parts_->lattice;
}

const std::vector<HeldPoint>& Flesh::points() const
{
    return parts_->points;
}

const BoundNodes& Flesh::nodes() const
{
    return parts_->nodes;
}

FleshState Flesh::rest() const
{
    return {parts_->all_nodes(), parts_->all_nodes()};
}

void Flesh::load(const VectorXd& forces)
{
    parts_->loads = forces;
}

void Flesh::carry_weight(std::vector<FleshRegionShares> bones)
{
    parts_->carrying = std::move(bones);
}

void Flesh::take_factors(Flesh& of)
{
    if (parts_->regions && of.parts_->regions)
        parts_->regions->take_factors(*of.parts_->regions);
}

void Flesh::set_surface(std::vector<FleshPoint> points)
{
    parts_->surface = FleshSurface(std::move(points), parts_->lattice.places.size());
}

FleshReport Flesh::step(FleshState& state, double dt, std::span<const Motion> motions,
                        const FleshSurroundings& around)
{
    Parts& p = *parts_;
    p.prepare(dt);
    p.find_carried(motions);
    FleshReport report = p.regions ? p.step_by_regions(state, dt, motions, around)
                                   : p.step_by_rounds(state, dt, motions, around);
    if (!report.is_finite)
        return report;
    state.v = p.velocity;
    state.u += dt * state.v;
    return report;
}

Flesh::Energies Flesh::energies(const FleshState& state, std::span<const Motion> motions,
                                const Vector3d& origin) const
{
    Parts& p = *parts_;
    Energies out;
    if (p.settings.law == FleshLaw::Cells || p.settings.law == FleshLaw::Regions)
        p.forces.follow(state.u);
    out.elastic = p.forces.elastic_energy(state.u);
    out.tube = p.forces.tube_energy(state.u, motions);
    p.forces.multiply(state.v, {1.0, 0.0, 0.0}, p.image);
    out.kinetic = 0.5 * state.v.dot(p.image);
    p.find_carried(motions);
    const VectorXd weight = p.weight + p.carried;
    for (std::size_t n = 0; n < p.lattice.places.size(); ++n)
    {
        const auto k = Eigen::Index(3 * n);
        out.gravity -= weight.segment<3>(k).dot(p.lattice.places[n] +
                                                state.u.segment<3>(k) - origin);
    }
    return out;
}

Vector3d Flesh::momentum(const FleshState& state) const
{
    parts_->forces.multiply(state.v, {1.0, 0.0, 0.0}, parts_->image);
    Vector3d sum = Vector3d::Zero();
    for (Eigen::Index n = 0; n < parts_->image.size(); n += 3)
        sum += parts_->image.segment<3>(n);
    return sum;
}

Vector3d Flesh::angular_momentum(const FleshState& state) const
{
    parts_->forces.multiply(state.v, {1.0, 0.0, 0.0}, parts_->image);
    Vector3d sum = Vector3d::Zero();
    for (std::size_t n = 0; n < parts_->lattice.places.size(); ++n)
    {
        const Vector3d x =
            parts_->lattice.places[n] + state.u.segment<3>(Eigen::Index(3 * n));
        sum += x.cross(Vector3d(parts_->image.segment<3>(Eigen::Index(3 * n))));
    }
    return sum;
}

double Flesh::largest_strain(const FleshState& state) const
{
    double largest = 0.0;
    for (const Matrix3d& F : deformations(state))
        largest =
            std::max(largest, 0.5 * (F.transpose() * F - Matrix3d::Identity()).norm());
    return largest;
}

double Flesh::largest_miss(const FleshState& state, std::span<const Motion> motions) const
{
    double largest = 0.0;
    const std::vector<int>& dropped = parts_->nodes.dropped;
    for (std::size_t k = 0; k < parts_->points.size(); ++k)
        if (!std::binary_search(dropped.begin(), dropped.end(), static_cast<int>(k)))
            largest =
                std::max(largest, (at_point(parts_->points[k].shares, state.u) -
                                   Parts::displacement_of(parts_->points[k], motions))
                                      .norm());
    return largest;
}

std::size_t Flesh::num_inverted(const FleshState& state) const
{
    if (parts_->is_of_large_strain())
        return parts_->forces.num_inverted(state.u);
    const std::vector<Matrix3d> F = deformations(state);
    return static_cast<std::size_t>(std::count_if(F.begin(), F.end(),
                                                  [](const Matrix3d& of)
                                                  { return !(of.determinant() > 0.0); }));
}

std::vector<std::size_t> Flesh::touching(const FleshState& state,
                                         std::span<const FleshObstacle> obstacles) const
{
    std::vector<std::size_t> points;
    if (!obstacles.empty())
        for (const FleshSurface::Candidate& candidate :
             parts_->surface.candidates(state.u, kTouching * parts_->size, obstacles))
            points.push_back(candidate.point);
    return points;
}

std::vector<Matrix3d> Flesh::deformations(const FleshState& state) const
{
    std::vector<Matrix3d> F;
    parts_->forces.mean_deformations(state.u, F);
    return F;
}

Eigen::MatrixXd Flesh::dense_matrix(double mass, double stiffness, double tube) const
{
    Parts& p = *parts_;
    p.forces.stand_still();
    if (p.is_of_large_strain())
        p.forces.follow(p.all_nodes());
    const Eigen::Index size = p.weight.size();
    Eigen::MatrixXd out(size, size);
    for (Eigen::Index k = 0; k < size; ++k)
    {
        VectorXd unit = VectorXd::Zero(size);
        unit[k] = 1.0;
        p.forces.multiply(unit, {mass, stiffness, tube}, p.image);
        out.col(k) = p.image;
    }
    return out;
}

} // namespace cellwarp::core
