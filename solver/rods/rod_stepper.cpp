// SPDX-License-Identifier: GPL-3.0-or-later
// Implicit Euler: x minimises Phi of rod_newton.cpp, v = (x - begin) / step. Midpoint:
// the same with half the step gives y and v_m; then x = 2 y - begin, v = 2 v_m - v. Its
// constraints are of x, not of y (else multipliers alternate and grow); then v is brought
// onto them.
//
// RK4: accelerations A = M^-1 (-grad U + loads - D v + L^T lambda) - viscosity v, with
// L A = -L' v - (2 / D) g' - g / D^2 (Baumgarte), D = 4 steps; after the step places and
// velocities are brought onto the constraints by the mass. [Lenoir04]
#include "solver/rods/rod_stepper.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>

namespace cellwarp
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

} // namespace

RodStepper::RodStepper(RodModel& model, Integrator integrator)
    : model_(model), integrator_(integrator), object_(model),
      implicit_({&object_}, {},
                integrator == Integrator::Midpoint ? kMidpointNoise : kNoise)
{
    if (integrator == Integrator::Midpoint)
        object_.step_by_midpoint();
}

/// Rows of places do not change from step to step, and the response with them.
const RodResponse& RodStepper::response(const RodModel::Rows& rows) const
{
    if (!response_ || !response_->is_for(rows.rows))
        response_.emplace(model_, rows);
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
    constexpr double kLimit = 2.785;
    double step = omega > 0.0 ? kLimit / omega : 1e300;
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
    if (!model_.slides.empty() && integrator_ != Integrator::ImplicitEuler)
        throw std::invalid_argument("what slides needs implicit Euler");
    StepReport report;
    report.stop = MotionStop::Converged;
    if (integrator_ == Integrator::RungeKutta)
    {
        step_explicit(state, velocity, step, report);
        return report;
    }
    object_.bind(state, velocity);
    return implicit_.step(step);
}

bool RodStepper::keeps_constraints(const RodState& state) const
{
    constexpr double kKept = 1e-9;
    const Eigen::VectorXd violation = model_.violations(state);
    return violation.size() == 0 ||
           violation.cwiseAbs().maxCoeff() <=
               kKept * std::max(1.0, model_.rod().arc_length().total());
}

Eigen::VectorXd RodStepper::acceleration(const RodState& state,
                                         const Eigen::VectorXd& velocity,
                                         double step) const
{
    Eigen::VectorXd force;
    model_.gradient(state, force);
    model_.add_drag_forces(velocity, force);
    Eigen::VectorXd A = model_.mass().solved(-force) - model_.viscosity * velocity;
    if (model_.constraints.empty())
        return A;
    const RodModel::Rows rows = model_.rows(state);
    const RodResponse& holds = response(rows);
    const double D = 4.0 * step;
    Eigen::VectorXd wanted =
        -2.0 / D * holds.along(velocity) - rows.violation / (D * D) - holds.along(A);
    Eigen::Index r = 0;
    for (const RodConstraint& constraint : model_.constraints)
        for (const double turning : convective(constraint, state, velocity))
            wanted[r++] -= turning;
    return A + holds.change(wanted);
}

void RodStepper::project(RodState& state, Eigen::VectorXd& velocity,
                         StepReport& report) const
{
    if (model_.constraints.empty())
        return;
    RodModel::Rows rows = model_.rows(state);
    const RodResponse& holds = response(rows);
    state.move(holds.change(rows.violation), -1.0);
    rows = model_.rows(state);
    report.violation = rows.violation.cwiseAbs().maxCoeff();
    // What one projection leaves is of second order.
    if (report.violation > kLeft * std::max(1.0, model_.rod().arc_length().total()))
        report.stop =
            holds.is_redundant() ? MotionStop::Contradiction : MotionStop::NoDescent;
    response(rows).project(velocity);
}

void RodStepper::step_explicit(RodState& state, Eigen::VectorXd& velocity, double step,
                               StepReport& report)
{
    const RodState begin = state;
    const Eigen::VectorXd v1 = velocity;
    // The limit of the step is that of the rod as it was at first: what is squeezed has a
    // lower one. What is unstable grows in every step; now and then is enough.
    const bool is_watched = num_explicit_++ % kWatched == 0 && !model_.has_couples() &&
                            keeps_constraints(begin);
    const double before = is_watched ? energy(begin, v1) : 0.0;
    const auto at = [&](const Eigen::VectorXd& way)
    {
        RodState moved = begin;
        moved.move(way);
        return moved;
    };
    const Eigen::VectorXd a1 = acceleration(begin, v1, step);
    const Eigen::VectorXd v2 = v1 + 0.5 * step * a1;
    const Eigen::VectorXd a2 = acceleration(at(0.5 * step * v1), v2, step);
    const Eigen::VectorXd v3 = v1 + 0.5 * step * a2;
    const Eigen::VectorXd a3 = acceleration(at(0.5 * step * v2), v3, step);
    const Eigen::VectorXd v4 = v1 + step * a3;
    const Eigen::VectorXd a4 = acceleration(at(step * v3), v4, step);
    state.move(step / 6.0 * (v1 + 2.0 * v2 + 2.0 * v3 + v4));
    velocity += step / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4);
    report.parts = 1;
    if (!state.x().allFinite() || !velocity.allFinite())
    {
        report.stop = MotionStop::NotFinite;
        return;
    }
    project(state, velocity, report);
    if (!is_watched)
        return;
    const double kinetic = model_.mass().kinetic_energy(velocity);
    const double potential = model_.potential(state);
    const double size = kinetic + std::abs(potential) + std::abs(before);
    if (kinetic + potential > before + kExplicitNoise * size)
        report.stop = MotionStop::EnergyGrew;
}

} // namespace cellwarp
