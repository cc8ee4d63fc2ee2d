// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/rods/springs.h"

#include <numbers>

#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include "solver/rods/rod_newton.h"
#include "tests/support/rods.h"

namespace cellwarp::core
{

TEST(Springs, derivatives_are_those_of_differences)
{
    for (const int degree : {2, 3, 5})
        for (const bool is_closed : {false, true})
            for (const bool is_given : {false, true})
            {
                SCOPED_TRACE(testing::Message() << degree << is_closed << is_given);
                RodSettings settings;
                settings.rest = is_given ? RodRest::Given : RodRest::Straight;
                settings.coupled_spans = 2;
                const Rod rod =
                    support::crooked_rod({is_closed, true, is_given, degree}, settings);
                support::expect_derivatives(*spring_elasticity(rod), rod);
            }
}

TEST(Springs, are_free_of_force_at_rest)
{
    for (const bool is_closed : {false, true})
    {
        const Rod rod =
            support::crooked_rod({is_closed, true, true, 3}, {.coupled_spans = 2});
        const std::unique_ptr<RodTerm> term = spring_elasticity(rod);
        const RodState state(rod);
        EXPECT_NEAR(term->value(state), 0.0, 1e-25);
        Eigen::VectorXd gradient = Eigen::VectorXd::Zero(state.x().size());
        term->add_gradient(state, gradient);
        EXPECT_LT(gradient.norm(), 1e-11);
    }
}

TEST(Springs, of_a_stretched_and_of_a_bent_rod_store_what_the_rod_stores)
{
    const double YA = 1e3, YI = 2.0, L = 1.0;
    const std::vector<Eigen::Vector3d> ends = {{0, 0, 0}, {L, 0, 0}};
    const Rod rod(spline_through(ends, false, 16),
                  [&](double) { return support::section_of(YA, YI, 1.0); },
                  {.coupled_spans = 2});
    RodState state(rod);
    state.move_to(1.1 * state.x());
    EXPECT_NEAR(spring_elasticity(rod)->value(state), 0.5 * YA * L * 0.01, 1e-10);
    // A ring that is straight at rest: 1/2 YI / R^2 on 2 pi R.
    const Rod ring(support::circle(1.0, 24),
                   [&](double) { return support::section_of(YA, YI, 1.0); },
                   {.rest = RodRest::Straight, .coupled_spans = 2});
    EXPECT_NEAR(spring_elasticity(ring)->value(RodState(ring)), std::numbers::pi * YI,
                1e-2 * std::numbers::pi * YI);
}

TEST(Springs, bend_what_is_straight_and_round_alone)
{
    const RodSettings straight{.rest = RodRest::Straight, .coupled_spans = 2};
    EXPECT_TRUE(springs_bend(support::crooked_rod({false, true, false, 3}, straight)));
    EXPECT_FALSE(springs_bend(support::crooked_rod({false, false, false, 3}, straight)));
    EXPECT_FALSE(
        springs_bend(support::crooked_rod({false, true, true, 3}, {.coupled_spans = 2})));
    const Rod bent = support::crooked_rod({false, true, true, 3}, {.coupled_spans = 2});
    // Turned about a point of the middle, corner by corner: no spring resists.
    EXPECT_NEAR(spring_elasticity(bent)->value(RodState(bent)), 0.0, 1e-20);
}

TEST(Springs, of_a_cantilever_come_near_its_deflection)
{
    // Dead tip load, alpha = 1: w / L = 0.30172077.
    double last = 1.0;
    for (const int spans : {8, 16, 32})
    {
        const std::vector<Eigen::Vector3d> ends = {{0, 0, 0}, {1, 0, 0}};
        const Rod rod(spline_through(ends, false, spans),
                      [](double) { return support::section_of(1e5, 1.0, 1.0); },
                      {.coupled_spans = 2});
        RodModel model(rod);
        model.terms.push_back(spring_elasticity(rod));
        model.terms.push_back(
            exact_elasticity(rod, {.has_stretch = false, .has_bending = false}));
        support::clamp(model, rod.basis().begin());
        model.loads = {{rod.basis().end(), {0, -1, 0}, {0, 0, 0}}};
        RodState state(rod);
        RodNewton newton(model);
        ASSERT_EQ(newton.solve(state).stop, MotionStop::Converged);
        const double error =
            std::abs(-state.at(rod.basis().end()).place.y() / 0.30172077 - 1.0);
        EXPECT_LT(error, 0.5 * last);
        last = error;
    }
    EXPECT_LT(last, 5e-3);
}

TEST(Springs, leave_six_rigid_motions_free_beside_the_spin)
{
    const std::vector<Eigen::Vector3d> ends = {{0, 0, 0}, {1, 0, 0}};
    const Rod rod(spline_through(ends, false, 8),
                  [](double) { return support::section_of(1e2, 1.0, 1.0); },
                  {.coupled_spans = 2});
    const std::unique_ptr<RodTerm> term = spring_elasticity(rod);
    BandMatrix H(rod.layout().num_unknowns, rod.layout().half_band);
    term->add_hessian(RodState(rod), RodHessian::Exact, H);
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(support::dense(H));
    // Six, of which the turn about the straight line moves no point, and the angles.
    EXPECT_EQ((eigen.eigenvalues().array() < 1e-8).count(), 5 + rod.num_stations());
}

TEST(Springs, say_what_they_cannot_do)
{
    const Rod narrow = support::crooked_rod({false, true, true, 3}, {});
    EXPECT_THROW(spring_elasticity(narrow), std::invalid_argument);
}

} // namespace cellwarp::core
