// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/rods/slide.h"

#include <cmath>
#include <numbers>
#include <stdexcept>

#include <gtest/gtest.h>

#include "solver/rods/elasticity.h"
#include "solver/rods/rod_newton.h"
#include "solver/rods/rod_stepper.h"
#include "tests/support/rods.h"

namespace cellwarp::core
{

namespace
{

/// A rope along x with a hole at its middle.
struct RopeInHole
{
    Rod rod;
    RodModel model;
    RodState state;
    Eigen::VectorXd velocity;

    RopeInHole(int points, double stretch, double bending, double length = 2.0)
        : rod(support::straight_rod(length, points,
                                    support::section_of(stretch, bending, bending))),
          model(rod), state(rod),
          velocity(Eigen::VectorXd::Zero(rod.layout().num_unknowns))
    {
        model.terms.push_back(exact_elasticity(rod));
        RodSlide slide;
        slide.end = rod.basis().end();
        model.slides.push_back(slide);
        state.sliding.push_back(begun(slide, 0.5 * slide.end));
        RodConstraint hole;
        hole.point = {0.5 * length, 0, 0};
        hole.slide = 0;
        model.constraints.push_back(hole);
    }
    Sliding& hole() { return state.sliding[0]; }
    double end() const { return rod.basis().end(); }
};

} // namespace

TEST(Slide, rows_are_the_derivatives_of_what_is_violated)
{
    const Rod rod = support::crooked_rod({false, true, true, 3}, {});
    std::mt19937 rng(4);
    for (const HoldKind hold : {HoldKind::Point, HoldKind::Axis, HoldKind::Plane})
    {
        SCOPED_TRACE(static_cast<int>(hold));
        RodModel model(rod);
        RodState state(rod);
        RodConstraint constraint;
        constraint.hold = hold;
        constraint.slide = 0;
        constraint.direction = Eigen::Vector3d(1, 2, 3).normalized();
        constraint.point = {0.1, 0.2, 0.3};
        model.constraints.push_back(constraint);
        model.slides.push_back({});
        state.sliding.push_back(begun(model.slides[0], 0.41 * rod.basis().end()));
        const RodModel::Rows rows = model.rows(state);
        for (int k = 0; k < 5; ++k)
        {
            const Eigen::VectorXd step =
                support::random_step(model.num_unknowns(), 1.0, rng);
            const double h = 1e-5;
            RodState ahead = state, behind = state;
            ahead.move(step, h);
            behind.move(step, -h);
            const Eigen::VectorXd change =
                (model.violations(ahead) - model.violations(behind)) / (2.0 * h);
            for (Eigen::Index r = 0; r < change.size(); ++r)
            {
                double along = 0.0;
                for (const auto& [unknown, value] : rows.rows[idx(static_cast<int>(r))])
                    along += value * step[unknown];
                EXPECT_NEAR(change[r], along, 1e-7);
            }
        }
    }
}

TEST(Slide, second_derivatives_of_the_force_are_those_of_differences)
{
    const Rod rod = support::crooked_rod({false, true, true, 3}, {});
    std::mt19937 rng(6);
    const int n = rod.layout().num_unknowns;
    RodSlide slide;
    RodState state(rod);
    Sliding now = begun(slide, 0.41 * rod.basis().end());
    now.weight = 2.0;
    now.drive = 0.7;
    state.sliding.push_back(now);
    const Eigen::Vector3d force(1, -2, 0.5);
    const SingleUnknown one = sliding_unknown(state, now, force);
    const auto energy = [&](const RodState& at)
    {
        return sliding_energy(at.sliding[0]) -
               force.dot(at.at(sliding_values(rod.basis(), at.sliding[0].s)).place);
    };
    for (int k = 0; k < 5; ++k)
    {
        const Eigen::VectorXd step = support::random_step(n + 1, 1.0, rng);
        const double h = 1e-4;
        RodState ahead = state, behind = state;
        ahead.move(step, h);
        behind.move(step, -h);
        double bent = one.diagonal * step[n] * step[n];
        for (const auto& [unknown, value] : one.column)
            bent += 2.0 * value * step[unknown] * step[n];
        EXPECT_NEAR((energy(ahead) - 2.0 * energy(state) + energy(behind)) / (h * h),
                    bent, 1e-4 * std::abs(bent) + 1e-5);
    }
}

TEST(Slide, a_hole_without_friction_leaves_no_force_along_the_rope)
{
    // Pulled by 1 more on the right until a spring on the left balances it.
    RopeInHole rope(81, 1e6, 0.05);
    rope.model.loads.push_back({rope.end(), {0, -10, 0}, {0, 0, 0}});
    rope.model.loads.push_back({0.0, {-5, 0, 0}, {0, 0, 0}});
    RodConstraint left;
    left.hold = HoldKind::Plane;
    left.direction = {1, 0, 0};
    left.point = {-0.1, 0, 0};
    rope.model.constraints.push_back(left);
    RodNewton newton(rope.model);
    const MotionReport report = newton.solve(rope.state);
    EXPECT_EQ(report.stop, MotionStop::Converged);
    EXPECT_LT(
        (rope.state.at(rope.hole().s).place - rope.model.constraints[0].point).norm(),
        1e-10);
    EXPECT_NEAR(-newton.multipliers()[3], 5.0, 0.02); // 10 at the hole on both sides
    EXPECT_NEAR(newton.multipliers().head(3).norm(), 10.0 * std::numbers::sqrt2, 0.02);
}

TEST(Slide, a_rope_that_sticks_in_a_hole_presses_as_two_pulls_say)
{
    RopeInHole rope(81, 1e6, 0.6);
    rope.model.slides[0].sticks = rope.model.slides[0].slips = 1.0;
    rope.state.sliding[0] = begun(rope.model.slides[0], 0.5 * rope.end());
    rope.model.loads.push_back({0.0, {-100, 0, 0}, {0, 0, 0}});
    rope.model.loads.push_back({rope.end(), {0, -150, 0}, {0, 0, 0}});
    RodNewton newton(rope.model);
    const MotionReport report = newton.solve(rope.state);
    EXPECT_EQ(report.stop, MotionStop::Converged);
    EXPECT_EQ(rope.hole().mode, Sliding::Mode::Sticks);
    const Eigen::Vector3d t = rope.state.at(rope.hole().s).first.normalized();
    const Eigen::Vector3d force = newton.multipliers().head<3>();
    EXPECT_NEAR(std::abs(force.dot(t)), 50.0, 0.2);
    EXPECT_NEAR((force - force.dot(t) * t).norm(), 173.2051, 0.1);
}

TEST(Slide, slips_where_friction_at_a_single_hole_gives_way)
{
    // T2 / T1 = exp(2 asinh(mu sin(b / 2))): 1.523705 for mu 0.3 and a quarter turn.
    for (const auto& [ratio, sticks] : {std::pair(1.51, true), {1.54, false}})
    {
        SCOPED_TRACE(ratio);
        RopeInHole rope(81, 1e6, 0.6);
        rope.model.slides[0].sticks = rope.model.slides[0].slips = 0.3;
        rope.state.sliding[0] = begun(rope.model.slides[0], 0.5 * rope.end());
        rope.model.loads.push_back({0.0, {-100, 0, 0}, {0, 0, 0}});
        rope.model.loads.push_back({rope.end(), {0, -100 * ratio, 0}, {0, 0, 0}});
        rope.model.viscosity = 20.0;
        RodStepper stepper(rope.model, Integrator::ImplicitEuler);
        const double begin = rope.hole().s;
        for (int k = 0; k < 400; ++k)
        {
            ASSERT_EQ(stepper.step(rope.state, rope.velocity, 2e-3).stop,
                      MotionStop::Converged);
        }
        EXPECT_EQ(rope.hole().mode == Sliding::Mode::Sticks, sticks);
        EXPECT_EQ(std::abs(rope.hole().s - begin) > 0.1, !sticks);
    }
}

TEST(Slide, a_rope_over_a_peg_runs_off_at_the_rate_of_its_weight)
{
    // d = d0 cosh(sqrt(2 g / L) t) of a rope that hangs down on both sides.
    const double g = 9.81, L = 2.0;
    const Rod rod = support::straight_rod(L, 101, support::section_of(1e5, 0.02, 0.02));
    RodModel model(rod);
    model.terms.push_back(exact_elasticity(rod));
    model.gravity = {0, -g, 0};
    RodSlide peg;
    peg.end = rod.basis().end();
    peg.sticks = peg.slips = 1e3;
    model.slides.push_back(peg);
    RodState state(rod);
    const double at = 0.51 * peg.end;
    RodConstraint hold;
    hold.slide = 0;
    hold.point = state.at(at).place;
    model.constraints.push_back(hold);
    state.sliding.push_back(begun(peg, at));
    Eigen::VectorXd velocity = Eigen::VectorXd::Zero(state.x().size());
    RodStepper stepper(model, Integrator::ImplicitEuler);
    model.viscosity = 5.0;
    for (int k = 0; k < 600; ++k)
        ASSERT_TRUE(is_solved(stepper.step(state, velocity, 5e-3).stop));
    model.viscosity = 0.0;
    model.slides[0].sticks = model.slides[0].slips = 0.0;
    state.sliding[0] = begun(model.slides[0], at);
    velocity.setZero();
    const double rate = std::sqrt(2.0 * g / L);
    double after_600 = 0.0, after_800 = 0.0;
    for (int k = 1; k <= 800; ++k)
    {
        ASSERT_TRUE(is_solved(stepper.step(state, velocity, 1e-3).stop));
        const double d = rod.arc_length().at(state.sliding[0].s) / L - 0.5;
        (k == 600 ? after_600 : after_800) = d;
    }
    EXPECT_LT((state.at(state.sliding[0].s).place - hold.point).norm(), 1e-9);
    EXPECT_GT(after_600, 0.03);
    EXPECT_NEAR(after_800 / after_600, std::cosh(0.8 * rate) / std::cosh(0.6 * rate),
                0.01 * after_800 / after_600);
}

TEST(Slide, explicit_steps_keep_the_hole_and_the_energy_and_go_where_implicit_ones_go)
{
    double ends[2] = {};
    for (const Integrator rule : {Integrator::RungeKutta, Integrator::ImplicitEuler})
    {
        const bool is_explicit = rule == Integrator::RungeKutta;
        SCOPED_TRACE(is_explicit);
        RopeInHole rope(24, 2e3, 0.3);
        rope.model.gravity = {0, -9.81, 0};
        rope.hole().s = 0.6 * rope.end();
        rope.model.constraints[0].point = rope.state.at(rope.hole().s).place;
        RodStepper stepper(rope.model, rule);
        const double step = is_explicit ? 2e-4 : 1e-4;
        ASSERT_LT(step, stepper.largest_step(rope.state));
        const double before = stepper.energy(rope.state, rope.velocity);
        double largest = 0.0;
        for (int k = 0; k * step < 0.5; ++k)
        {
            const StepReport report = stepper.step(rope.state, rope.velocity, step);
            ASSERT_EQ(report.stop, MotionStop::Converged);
            largest = std::max(largest, report.violation);
        }
        EXPECT_LT(largest, 1e-9);
        if (is_explicit)
        {
            EXPECT_NEAR(stepper.energy(rope.state, rope.velocity), before,
                        1e-4 * rope.model.mass().kinetic_energy(rope.velocity));
        }
        ends[is_explicit] = rope.hole().s;
    }
    EXPECT_GT(std::abs(ends[0] - 0.6 * 2.0), 0.05);
    EXPECT_NEAR(ends[0], ends[1], 4e-3);
}

TEST(Slide, explicit_steps_stick_slip_and_stop_at_the_end)
{
    for (const auto& [ratio, sticks] : {std::pair(1.2, true), {2.5, false}})
    {
        SCOPED_TRACE(ratio);
        RopeInHole rope(30, 2e3, 0.05);
        rope.model.slides[0].sticks = rope.model.slides[0].slips = 0.3;
        rope.model.slides[0].begin = 0.3 * rope.end();
        rope.state.sliding[0] = begun(rope.model.slides[0], 0.5 * rope.end());
        rope.model.loads.push_back({0.0, {-20, 0, 0}, {0, 0, 0}});
        rope.model.loads.push_back({rope.end(), {0, -20 * ratio, 0}, {0, 0, 0}});
        rope.model.viscosity = 20.0;
        RodStepper stepper(rope.model, Integrator::RungeKutta);
        const double begin = rope.hole().s;
        for (int k = 0; k < 8000; ++k)
            ASSERT_EQ(stepper.step(rope.state, rope.velocity, 2e-4).stop,
                      MotionStop::Converged);
        EXPECT_EQ(rope.hole().mode,
                  sticks ? Sliding::Mode::Sticks : Sliding::Mode::AtBegin);
        EXPECT_EQ(std::abs(rope.hole().s - begin) > 0.1, !sticks);
    }
}

TEST(Slide, is_refused_by_rules_that_do_not_know_it)
{
    RopeInHole rope(10, 1e3, 0.1);
    RodStepper midpoint(rope.model, Integrator::Midpoint);
    EXPECT_THROW(midpoint.step(rope.state, rope.velocity, 1e-4), std::invalid_argument);
    rope.model.gaps.push_back({0, 0, 0.1, false});
    rope.state.touches = {0};
    RodStepper explicitly(rope.model, Integrator::RungeKutta);
    EXPECT_THROW(explicitly.step(rope.state, rope.velocity, 1e-4), std::invalid_argument);
}

} // namespace cellwarp::core
