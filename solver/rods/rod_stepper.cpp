// SPDX-License-Identifier: GPL-3.0-or-later
// Implicit Euler: x minimises Phi of rod_object.cpp, v = (x - begin) / step. Midpoint:
// the same with half the step gives y and v_m; then x = 2 y - begin, v = 2 v_m - v. Its
// constraints are of x, not of y (else multipliers alternate and grow); then v is brought
// onto them.
//
// RK4: accelerations A = M^-1 (-grad U + loads - D v + L^T lambda) - viscosity v, with
// L A = -L' v - (g_t)', g_t what moves the constraints; each stage sees them at its own
// time. Places are brought onto g = 0 after the step and velocities onto L v = -g_t
// before and after it, by the mass. [Lenoir04] Nothing drifts, so there is no feedback of
// g and g' into A: stages leave a g of order step^2, and feedback makes order 1 of that.
//
// Angles count from vectors that one hop takes along from the begin of the step to a
// stage (rod.cpp). Such a vector spins by -turn_of_hop . u' / (2 l), u' the rate of P',
// so an angle changes by its velocity, which is the spin of the material, less that.
// Without it the step is of order 2 where a rod twists and bends.
//
// Slides in RK4. Their rows say L A + eta s'' = E, and the forces along them
// eta^T lambda = c s'' + tau, with inertia c and friction tau. With G = L M^-1 L^T and
// z = E - L A of the rod without them,
//   (c + eta^T G^-1 eta) s'' = eta^T G^-1 z - tau,   lambda = G^-1 (z - eta s''):
// the parameter is eliminated by what is there for rows at a fixed one. [Lenoir04]
#include "solver/rods/rod_stepper.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>

#include <Eigen/Cholesky>

namespace cellwarp::core
{

namespace
{

/// Explicit steps of which the energy of one is watched.
constexpr int kWatched = 8;
/// A step may not add energy; this share of it is rounding, or what the midpoint rule
/// lets it swing by.
constexpr double kNoise = 1e-9, kMidpointNoise = 1e-3, kExplicitNoise = 1e-2;

/// Of constraints after the projection of an explicit step, of the rod's length.
constexpr double kLeft = 1e-4;

/// How fast x changes at a stage of a step: \p velocity, but for angles.
Eigen::VectorXd way_of(const RodState& begin, const RodState& stage,
                       const Eigen::VectorXd& velocity)
{
    const Rod& rod = stage.rod();
    const RodLayout& layout = rod.layout();
    Eigen::VectorXd out = velocity;
    for (std::size_t e = 0; e < rod.spans().size(); ++e)
        for (const int end : {0, 1})
        {
            const int place = end == 0 ? 0 : rod.num_places() - 1;
            const RodState::Velocity& now = stage.velocity(e, place);
            Eigen::Vector3d rate = Eigen::Vector3d::Zero();
            for (int j = 0; j < rod.order(); ++j)
                rate += rod.first(e, place)[j] *
                        velocity.segment<3>(layout.control[idx(rod.controls(e)[j])]);
            const int angle = layout.angle[idx(rod.spans()[e].station[idx(end)])];
            out[angle] =
                velocity[angle] +
                turn_of_hop(begin.velocity(e, place).tangent, now.tangent).dot(rate) /
                    (2.0 * now.length);
        }
    return out;
}

} // namespace

RodStepper::RodStepper(RodModel& model, Integrator integrator)
    : model_(model), integrator_(integrator), object_(std::make_unique<RodObject>(model)),
      implicit_({object_.get()}, {},
                integrator == Integrator::Midpoint ? kMidpointNoise : kNoise)
{
    if (integrator == Integrator::Midpoint)
        object_->step_by_midpoint();
}

/// Rows of places do not change from step to step, and the response with them.
const RodResponse& RodStepper::response(const RodModel::Rows& rows) const
{
    if (!response_ || revision_ != model_.revision() || !response_->is_for(rows.rows))
        response_.emplace(model_, rows);
    revision_ = model_.revision();
    return *response_;
}

double RodStepper::energy(const RodState& state, const Eigen::VectorXd& velocity) const
{
    double sum = model_.mass().kinetic_energy(velocity) + model_.potential(state);
    for (std::size_t k = 0; k < model_.slides.size(); ++k)
        sum += 0.5 * model_.slides[k].inertia * state.sliding[k].speed *
               state.sliding[k].speed;
    return sum;
}

double RodStepper::largest_step(const RodState& state) const
{
    BandMatrix H;
    model_.hessian(state, RodHessian::Exact, H);
    // The largest eigenvalue of M^-1 H, by power iteration from a fixed start.
    std::mt19937 rng(1);
    std::normal_distribution<double> normal;
    Eigen::VectorXd v(H.rows()), y;
    for (double& x : v)
        x = normal(rng);
    double largest = 0.0;
    for (int k = 0; k < 200; ++k)
    {
        H.multiply(v, y);
        y = model_.mass().solved(y);
        const double now = y.norm() / v.norm();
        v = y / y.norm();
        if (k > 20 && std::abs(now - largest) <= 1e-6 * now)
            break;
        largest = now;
    }
    const double omega = std::sqrt(std::max(largest, 0.0));
    // A mode that is damped by zeta leaves the stable region by the least radius of that
    // to the left, or along the real axis.
    constexpr double kLimit = 2.785, kLeast = 2.62;
    const double zeta = 0.5 * model_.damping * omega;
    double step = 1e300;
    if (omega > 0.0)
        step = (zeta == 0.0   ? kLimit
                : zeta <= 1.0 ? kLeast
                              : kLimit / (zeta + std::sqrt(zeta * zeta - 1.0))) /
               omega;
    // How fast what is slowed comes to rest: of the drags no faster than by their sum.
    double rate = model_.viscosity;
    for (const RodDrag& drag : model_.drags)
    {
        v.setZero();
        const BasisValues values = model_.rod().basis().values(drag.s);
        for (int j = 0; j < values.count; ++j)
            v[model_.rod().layout().control[idx(values.control[idx(j)])]] =
                values.value[0][idx(j)];
        rate += drag.damping * v.dot(model_.mass().solved(v));
    }
    return rate > 0.0 ? std::min(step, kLimit / rate) : step;
}

StepReport RodStepper::step(RodState& state, Eigen::VectorXd& velocity, double step)
{
    if (!model_.slides.empty() && integrator_ == Integrator::Midpoint)
        throw std::invalid_argument("what slides needs implicit Euler or RK4");
    if (!model_.gaps.empty() && integrator_ == Integrator::RungeKutta)
        throw std::invalid_argument("what stays apart needs implicit Euler");
    StepReport report;
    report.stop = MotionStop::Converged;
    if (integrator_ == Integrator::RungeKutta)
    {
        step_explicit(state, velocity, step, report);
        return report;
    }
    object_->bind(state, velocity);
    return implicit_.step(step);
}

Eigen::VectorXd RodStepper::multipliers(const RodState& state,
                                        const Eigen::VectorXd& velocity) const
{
    if (integrator_ != Integrator::RungeKutta)
        return implicit_.solved().multipliers(0);
    const int of_rod = model_.rod().layout().num_unknowns;
    Eigen::VectorXd all = Eigen::VectorXd::Zero(model_.num_unknowns()), out;
    all.head(of_rod) = velocity;
    for (std::size_t k = 0; k < model_.slides.size(); ++k)
        all[of_rod + static_cast<int>(k)] = state.sliding[k].speed;
    acceleration(state, all, &out);
    return out;
}

bool RodStepper::keeps_constraints(const RodState& state) const
{
    constexpr double kKept = 1e-9;
    const Eigen::VectorXd violation = model_.violations(state);
    return violation.size() == 0 ||
           violation.cwiseAbs().maxCoeff() <=
               kKept * std::max(1.0, model_.rod().arc_length().total());
}

RodStepper::Held RodStepper::held(const RodState& state) const
{
    Held out;
    out.rows = model_.rows(state);
    const int of_rod = model_.rod().layout().num_unknowns;
    for (std::size_t k = 0; k < model_.slides.size(); ++k)
        if (state.sliding[k].is_free())
            out.slides.push_back(static_cast<int>(k));
    out.eta.setZero(out.rows.violation.size(),
                    static_cast<Eigen::Index>(out.slides.size()));
    for (std::size_t r = 0; r < out.rows.rows.size(); ++r)
        while (!out.rows.rows[r].empty() && out.rows.rows[r].back().first >= of_rod)
        {
            const auto [unknown, value] = out.rows.rows[r].back();
            const auto slide =
                std::find(out.slides.begin(), out.slides.end(), unknown - of_rod);
            out.eta(static_cast<Eigen::Index>(r), slide - out.slides.begin()) = value;
            out.rows.rows[r].pop_back();
        }
    return out;
}

/// eta^T (L M^-1 L^T)^-1 eta and what inertia the slides have: their mass.
Eigen::MatrixXd RodStepper::mass_of_slides(const Held& held,
                                           const RodResponse& holds) const
{
    const Eigen::Index k = held.eta.cols();
    Eigen::MatrixXd mass(k, k);
    for (Eigen::Index c = 0; c < k; ++c)
        mass.col(c) = held.eta.transpose() * holds.forces(held.eta.col(c));
    for (Eigen::Index c = 0; c < k; ++c)
        mass(c, c) +=
            model_.slides[idx(held.slides[static_cast<std::size_t>(c)])].inertia;
    return mass;
}

Eigen::VectorXd RodStepper::acceleration(const RodState& state,
                                         const Eigen::VectorXd& velocity,
                                         Eigen::VectorXd* multipliers) const
{
    const int of_rod = model_.rod().layout().num_unknowns;
    const Eigen::VectorXd v = velocity.head(of_rod);
    Eigen::VectorXd force;
    model_.gradient(state, force);
    model_.add_damping_forces(state, v, force);
    model_.add_drag_forces(v, force);
    Eigen::VectorXd A = Eigen::VectorXd::Zero(velocity.size());
    A.head(of_rod) = model_.mass().solved(-force) - model_.viscosity * v;
    if (model_.constraints.empty())
        return A;
    const Held held = this->held(state);
    const RodResponse& holds = response(held.rows);
    Eigen::VectorXd wanted = -holds.along(A.head(of_rod));
    Eigen::Index r = 0;
    for (const RodConstraint& constraint : model_.constraints)
        for (const double turning : convective(constraint, state, v))
            wanted[r++] -= turning;
    if (held.eta.cols() > 0)
    {
        const Eigen::LDLT<Eigen::MatrixXd> mass(mass_of_slides(held, holds));
        const Eigen::VectorXd pushed = held.eta.transpose() * holds.forces(wanted);
        // Friction depends on what presses across the rod, which it changes but little.
        constexpr int kSweeps = 3;
        Eigen::VectorXd rubs = Eigen::VectorXd::Zero(held.eta.cols()), of_slides;
        for (int sweep = 0; sweep < kSweeps; ++sweep)
        {
            of_slides = mass.solve(pushed - rubs);
            const std::vector<SlidePress> pressed =
                model_.pressed(state, holds.forces(wanted - held.eta * of_slides));
            bool rubs_at_all = false;
            for (Eigen::Index c = 0; c < rubs.size(); ++c)
            {
                const int k = held.slides[static_cast<std::size_t>(c)];
                rubs[c] = friction(model_.slides[idx(k)], state, state.sliding[idx(k)],
                                   pressed[idx(k)]);
                rubs_at_all = rubs_at_all || rubs[c] != 0.0;
            }
            if (!rubs_at_all)
                break;
        }
        for (Eigen::Index c = 0; c < of_slides.size(); ++c)
            A[of_rod + held.slides[static_cast<std::size_t>(c)]] = of_slides[c];
        wanted -= held.eta * of_slides;
    }
    if (multipliers)
        *multipliers = holds.forces(wanted);
    A.head(of_rod) += holds.change(wanted);
    return A;
}

/// A change of the rod and of what slides that takes off \p violation of the rows, the
/// least in the mass: slides have none but their inertia.
Eigen::VectorXd RodStepper::least_change(const Held& held,
                                         const Eigen::VectorXd& violation) const
{
    const int of_rod = model_.rod().layout().num_unknowns;
    const RodResponse& holds = response(held.rows);
    Eigen::VectorXd out = Eigen::VectorXd::Zero(model_.num_unknowns());
    Eigen::VectorXd wanted = -violation;
    if (held.eta.cols() > 0)
    {
        const Eigen::VectorXd of_slides =
            mass_of_slides(held, holds)
                .ldlt()
                .solve(held.eta.transpose() * holds.forces(wanted));
        for (Eigen::Index c = 0; c < of_slides.size(); ++c)
            out[of_rod + held.slides[static_cast<std::size_t>(c)]] = of_slides[c];
        wanted -= held.eta * of_slides;
    }
    out.head(of_rod) = holds.change(wanted);
    return out;
}

void RodStepper::project(RodState& state, Eigen::VectorXd& velocity,
                         StepReport& report) const
{
    if (model_.constraints.empty())
        return;
    const Held before = held(state);
    const bool is_redundant = response(before.rows).is_redundant();
    state.move(least_change(before, before.rows.violation));
    const Held after = held(state);
    report.violation = after.rows.violation.size() > 0
                           ? after.rows.violation.cwiseAbs().maxCoeff()
                           : 0.0;
    // What one projection leaves is of second order.
    if (report.violation > kLeft * std::max(1.0, model_.rod().arc_length().total()))
        report.stop = is_redundant ? MotionStop::Contradiction : MotionStop::NoDescent;
    project_velocity(state, velocity);
}

void RodStepper::project_velocity(const RodState& state, Eigen::VectorXd& velocity) const
{
    constexpr double kKept = 1e-14; // of the velocity
    const int of_rod = model_.rod().layout().num_unknowns;
    const Held held = this->held(state);
    Eigen::VectorXd off =
        held.rows.rate + response(held.rows).along(velocity.head(of_rod));
    for (Eigen::Index c = 0; c < held.eta.cols(); ++c)
        off +=
            held.eta.col(c) * velocity[of_rod + held.slides[static_cast<std::size_t>(c)]];
    if (off.size() > 0 &&
        off.cwiseAbs().maxCoeff() > kKept * velocity.cwiseAbs().maxCoeff())
        velocity += least_change(held, off);
}

/// What sticks may slip, and what has stopped at an end may leave it.
void RodStepper::loosen(RodState& state, const Eigen::VectorXd& velocity) const
{
    const bool has_friction =
        std::any_of(model_.slides.begin(), model_.slides.end(),
                    [](const RodSlide& slide) { return slide.sticks > 0.0; });
    const bool is_stopped =
        std::any_of(state.sliding.begin(), state.sliding.end(),
                    [](const Sliding& now)
                    { return !now.is_free() && now.mode != Sliding::Mode::Gone; });
    if (!has_friction && !is_stopped)
        return;
    Eigen::VectorXd multipliers;
    acceleration(state, velocity, &multipliers);
    const std::vector<SlidePress> pressed = model_.pressed(state, multipliers);
    for (std::size_t k = 0; k < model_.slides.size(); ++k)
    {
        Sliding& now = state.sliding[k];
        Sliding begin = now;
        check_slide(model_.slides[k], state, pressed[k], false, begin, now);
        now = begin;
    }
}

/// What has passed the end of its range stops there or is released, and what would slip
/// back sticks.
void RodStepper::stop_slides(RodState& state, Eigen::VectorXd& velocity) const
{
    const int of_rod = model_.rod().layout().num_unknowns;
    for (std::size_t k = 0; k < model_.slides.size(); ++k)
    {
        const RodSlide& slide = model_.slides[k];
        Sliding& now = state.sliding[k];
        double& speed = velocity[of_rod + static_cast<int>(k)];
        if (!stop_at_end(slide, now) && now.is_free() && slide.sticks > 0.0 &&
            now.drive * speed < 0.0)
            now.mode = Sliding::Mode::Sticks;
        if (!now.is_free())
            speed = 0.0;
    }
}

void RodStepper::step_explicit(RodState& state, Eigen::VectorXd& rod_velocity,
                               double step, StepReport& report)
{
    const int of_rod = model_.rod().layout().num_unknowns;
    Eigen::VectorXd velocity = Eigen::VectorXd::Zero(model_.num_unknowns());
    velocity.head(of_rod) = rod_velocity;
    for (std::size_t k = 0; k < model_.slides.size(); ++k)
        velocity[of_rod + static_cast<int>(k)] = state.sliding[k].speed;
    const double time = model_.time_led();
    model_.carry(state);
    if (!model_.constraints.empty())
        project_velocity(state, velocity);
    loosen(state, velocity);
    const RodState begin = state;
    const Eigen::VectorXd v1 = velocity;
    // The limit of the step is that of the rod as it was at first: what is squeezed has a
    // lower one. What is unstable grows in every step; now and then is enough.
    const bool is_watched = num_explicit_++ % kWatched == 0 && !model_.has_couples() &&
                            model_.pushed.size() == 0 && !model_.is_led() &&
                            !model_.changes_loads() && keeps_constraints(begin);
    const double before = is_watched ? energy(begin, velocity.head(of_rod)) : 0.0;
    struct Stage
    {
        Eigen::VectorXd way, change; ///< of x and of the velocity by time
    };
    const auto at =
        [&](double share, const Eigen::VectorXd& way, const Eigen::VectorXd& v)
    {
        model_.lead_to(time + share * step);
        RodState moved = begin;
        moved.move(way, share * step);
        for (std::size_t k = 0; k < model_.slides.size(); ++k)
            moved.sliding[k].speed = v[of_rod + static_cast<int>(k)];
        return Stage{way_of(begin, moved, v), acceleration(moved, v, nullptr)};
    };
    const Stage one{v1, acceleration(begin, v1, nullptr)},
        two = at(0.5, one.way, v1 + 0.5 * step * one.change),
        three = at(0.5, two.way, v1 + 0.5 * step * two.change),
        four = at(1.0, three.way, v1 + step * three.change);
    state.move(step / 6.0 * (one.way + 2.0 * two.way + 2.0 * three.way + four.way));
    velocity +=
        step / 6.0 * (one.change + 2.0 * two.change + 2.0 * three.change + four.change);
    report.parts = 1;
    if (!state.x().allFinite() || !velocity.allFinite())
    {
        rod_velocity = velocity.head(of_rod);
        report.stop = MotionStop::NotFinite;
        return;
    }
    stop_slides(state, velocity);
    project(state, velocity, report);
    rod_velocity = velocity.head(of_rod);
    for (std::size_t k = 0; k < model_.slides.size(); ++k)
        state.sliding[k].speed = velocity[of_rod + static_cast<int>(k)];
    if (!is_watched)
        return;
    const double kinetic = model_.mass().kinetic_energy(rod_velocity);
    const double potential = model_.potential(state);
    const double size = kinetic + std::abs(potential) + std::abs(before);
    if (kinetic + potential > before + kExplicitNoise * size)
        report.stop = MotionStop::EnergyGrew;
}

} // namespace cellwarp::core
