// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/rods/point_springs.h"

#include <cmath>

#include <gtest/gtest.h>

#include "solver/rods/elasticity.h"
#include "solver/rods/rod_newton.h"
#include "solver/rods/rod_stepper.h"
#include "tests/support/rods.h"

namespace cellwarp::core
{

TEST(PointSprings, derivatives_are_those_of_differences)
{
    for (const bool is_closed : {false, true})
        for (const double length : {0.0, 0.3, 4.0})
        {
            SCOPED_TRACE(testing::Message() << is_closed << " " << length);
            const Rod rod = support::crooked_rod({is_closed, true, true, 3}, {});
            const double end = rod.basis().end();
            support::expect_derivatives(
                *point_springs(rod, {{0.3 * end, {1, 2, 3}, 20.0, length},
                                     {0.8 * end, {-1, 0, 1}, 5.0, length}}),
                rod);
        }
}

TEST(PointSprings, are_free_of_force_at_their_length_and_on_their_point)
{
    const Rod rod = support::straight_rod(1.0, 6, support::section_of(1, 1, 1));
    const RodState state(rod);
    for (const PointSpring& spring :
         {PointSpring{0.0, {0, 0, 0}, 3.0, 0.0}, PointSpring{0.0, {0, 0, 0}, 3.0, 2.0},
          PointSpring{0.0, {0, 2, 0}, 3.0, 2.0}})
    {
        Eigen::VectorXd gradient = Eigen::VectorXd::Zero(state.x().size());
        point_springs(rod, {spring})->add_gradient(state, gradient);
        EXPECT_EQ(gradient.norm(), 0.0);
    }
}

TEST(PointSprings, with_a_drag_they_swing_as_the_formula_says)
{
    const double k = 40.0, c = 3.0, mass = 1.0, down = 0.1, time = 0.5;
    const double g = c / (2.0 * mass), w = std::sqrt(k / mass - g * g);
    const double wanted =
        down * std::exp(-g * time) * (std::cos(w * time) + g / w * std::sin(w * time));
    for (const auto& [rule, tolerance] : {std::pair(Integrator::ImplicitEuler, 6e-3),
                                          {Integrator::Midpoint, 1e-4},
                                          {Integrator::RungeKutta, 1e-4}})
    {
        SCOPED_TRACE(static_cast<int>(rule));
        const Rod rod = support::straight_rod(1.0, 6, support::section_of(1e4, 100, 1));
        RodModel model(rod);
        model.terms.push_back(exact_elasticity(rod));
        const double middle = 0.5 * rod.basis().end();
        model.terms.push_back(point_springs(rod, {{middle, {0.5, down, 0}, k, 0.0}}));
        model.drags.push_back({middle, c});
        ASSERT_NEAR(model.mass().total(), mass, 1e-12);
        RodState state(rod);
        Eigen::VectorXd velocity = Eigen::VectorXd::Zero(state.x().size());
        RodStepper stepper(model, rule);
        const double step = 2e-4;
        ASSERT_LT(step, stepper.largest_step(state));
        for (int n = 0; n < static_cast<int>(time / step); ++n)
            ASSERT_EQ(stepper.step(state, velocity, step).stop, MotionStop::Converged);
        const Eigen::VectorXd x = model.mass().times(state.x()) / mass;
        double height = 0.0; // of the centre of mass
        for (int q = 0; q < rod.num_controls(); ++q)
            height += x[rod.layout().control[idx(q)] + 1];
        EXPECT_NEAR(down - height, wanted, tolerance * down + 1e-3 * down);
    }
}

TEST(PointSprings, however_stiff_end_in_an_equilibrium)
{
    for (const double stiffness : {1e3, 1e7, 1e12})
    {
        SCOPED_TRACE(stiffness);
        const Rod rod = support::straight_rod(1.0, 8, support::section_of(1e4, 1, 1));
        RodModel model(rod);
        model.terms.push_back(exact_elasticity(rod));
        model.terms.push_back(point_springs(rod, {{0.0, {0, 0.1, 0}, stiffness, 0.0}}));
        model.gravity = {0, -9.81, 0};
        model.viscosity = 1.0;
        RodState state(rod);
        Eigen::VectorXd velocity = Eigen::VectorXd::Zero(state.x().size());
        RodStepper stepper(model, Integrator::ImplicitEuler);
        int iterations = 0;
        for (int n = 0; n < 20; ++n)
        {
            const StepReport report = stepper.step(state, velocity, 1e-2);
            ASSERT_EQ(report.stop, MotionStop::Converged);
            iterations += report.iterations;
        }
        EXPECT_LT(iterations, 400);
        const MotionReport report = RodNewton(model).solve(state);
        EXPECT_EQ(report.stop, MotionStop::Converged);
        EXPECT_NEAR(state.at(0.0).place.y(), 0.1 - 9.81 / stiffness, 1e-9);
    }
}

TEST(PointSprings, a_strong_drag_lowers_the_largest_explicit_step)
{
    const Rod rod = support::straight_rod(1.0, 6, support::section_of(10, 0.1, 0.1));
    RodModel model(rod);
    model.terms.push_back(exact_elasticity(rod));
    const RodState state(rod);
    const double without = RodStepper(model, Integrator::RungeKutta).largest_step(state);
    model.drags.push_back({rod.basis().end(), 1e4});
    RodStepper stepper(model, Integrator::RungeKutta);
    const double limit = stepper.largest_step(state);
    EXPECT_LT(limit, 0.1 * without);
    for (const auto& [share, is_stable] : {std::pair(0.98, true), {1.1, false}})
    {
        RodState at(rod);
        Eigen::VectorXd velocity = Eigen::VectorXd::Zero(at.x().size());
        velocity[rod.layout().control[2] + 1] = 1.0;
        MotionStop stop = MotionStop::Converged;
        for (int n = 0; n < 2000 && stop == MotionStop::Converged; ++n)
            stop = stepper.step(at, velocity, share * limit).stop;
        EXPECT_EQ(stop == MotionStop::Converged && velocity.norm() < 10.0, is_stable);
    }
}

} // namespace cellwarp::core
