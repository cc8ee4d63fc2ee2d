// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/rods/elasticity.h"

#include <numbers>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "tests/support/rods.h"

namespace cellwarp::core
{

namespace
{

using support::crooked_rod;
using support::dense;
using support::RodCase;

std::vector<RodCase> cases()
{
    std::vector<RodCase> all;
    for (const int degree : {2, 3, 4, 5})
        for (const bool is_closed : {false, true})
        {
            all.push_back({is_closed, true, false, degree});
            all.push_back({is_closed, false, true, degree});
        }
    return all;
}

} // namespace

TEST(Elasticity, is_zero_at_rest_and_after_rigid_motions)
{
    for (const RodCase& of : cases())
    {
        if (!of.is_given)
            continue;
        const Rod rod = crooked_rod(of, {});
        const std::unique_ptr<RodTerm> term = exact_elasticity(rod);
        RodState state(rod);
        EXPECT_EQ(term->value(state), 0.0);
        const Eigen::Matrix3d R =
            Eigen::AngleAxisd(0.01, Eigen::Vector3d(1, 2, 3).normalized())
                .toRotationMatrix();
        const RodState rest = state;
        Eigen::Matrix3d whole = Eigen::Matrix3d::Identity();
        for (int turn = 0; turn < 150; ++turn)
        {
            whole = R * whole;
            Eigen::VectorXd to = state.x();
            for (const int first : rod.layout().control)
                to.segment<3>(first) =
                    R * state.x().segment<3>(first) + Eigen::Vector3d(0.01, 0, 0.02);
            state.move_to(to);
        }
        // Vectors of the stations do not spin: the angles say how the material does.
        Eigen::VectorXd to = state.x();
        for (std::size_t e = 0; e < rod.spans().size(); ++e)
            for (const int end : {0, 1})
            {
                const RodSpan& span = rod.spans()[e];
                const int station = span.station[idx(end)];
                const Eigen::Vector3d t =
                    state.velocity(e, end == 0 ? 0 : rod.num_places() - 1).tangent;
                const Eigen::Vector3d a = state.reference(station),
                                      m = whole * rest.reference(station);
                to[rod.layout().angle[idx(station)]] =
                    std::atan2(t.cross(a).dot(m), a.dot(m));
            }
        state.move_to(to);
        // Angles may come out whole turns apart: twist is what counts.
        double worst = 0.0;
        for (std::size_t e = 0; e < rod.spans().size(); ++e)
            worst =
                std::max(worst, std::abs(std::remainder(state.twist(e) - rest.twist(e),
                                                        2.0 * std::numbers::pi)));
        EXPECT_LT(worst, 1e-11);
        for (std::size_t e = 0; e < rod.spans().size(); ++e)
            if (std::abs(state.twist(e) - rest.twist(e)) > 1.0)
                worst = 1.0;
        if (worst < 1.0)
        {
            EXPECT_LT(term->value(state), 1e-18);
        }
    }
}

TEST(Elasticity, derivatives_are_those_of_differences)
{
    for (const RodCase& of : cases())
    {
        SCOPED_TRACE(testing::Message() << of.is_closed << of.is_round << of.degree);
        RodSettings settings;
        settings.rest = of.is_given ? RodRest::Given : RodRest::Straight;
        settings.rest_twist = 0.2;
        settings.link = 0.3;
        const Rod rod = crooked_rod(of, settings);
        const std::unique_ptr<RodTerm> term = exact_elasticity(rod);
        support::expect_derivatives(*term, rod);
    }
}

TEST(Elasticity, forces_of_a_damped_step_are_those_of_what_it_loses)
{
    for (const RodCase& of : cases())
        for (const bool has_energy : {true, false})
        {
            SCOPED_TRACE(testing::Message()
                         << of.is_closed << of.is_round << of.degree << has_energy);
            const Rod rod = crooked_rod(of, {.link = of.is_closed ? 0.3 : 0.0});
            const std::unique_ptr<RodTerm> term =
                exact_elasticity(rod, {.has_energy = has_energy});
            std::mt19937 rng(3);
            RodState begin(rod);
            begin.move(support::random_step(rod.layout().num_unknowns, 0.02, rng));
            RodState state = begin;
            state.move(support::random_step(rod.layout().num_unknowns, 0.02, rng));
            const double elastic = term->value(state);
            term->damp(begin, 3.0);
            EXPECT_EQ(term->value(state), elastic);
            const Eigen::VectorXd step =
                support::random_step(rod.layout().num_unknowns, 1.0, rng);
            Eigen::VectorXd force = Eigen::VectorXd::Zero(step.size());
            term->add_gradient(state, force);
            constexpr double h = 1e-6;
            RodState ahead = state, behind = state;
            ahead.move(step, h);
            behind.move(step, -h);
            const double slope =
                (term->step_value(ahead) - term->step_value(behind)) / (2.0 * h);
            EXPECT_NEAR(force.dot(step), slope, 1e-6 * force.norm() * step.norm());

            // At the begin of a step nothing has been lost yet.
            Eigen::VectorXd damped = Eigen::VectorXd::Zero(step.size()), plain = damped;
            term->add_gradient(begin, damped);
            term->damp(begin, 0.0);
            term->add_gradient(begin, plain);
            EXPECT_LT((damped - plain).norm(), 1e-9 * force.norm());
            EXPECT_EQ(term->step_value(begin), term->value(begin));
        }
}

TEST(Elasticity, damping_forces_are_those_of_a_short_damped_step)
{
    for (const RodCase& of : cases())
    {
        SCOPED_TRACE(testing::Message() << of.is_closed << of.is_round << of.degree);
        const Rod rod = crooked_rod(of, {});
        const std::unique_ptr<RodTerm> term = exact_elasticity(rod);
        std::mt19937 rng(4);
        RodState begin(rod);
        begin.move(support::random_step(rod.layout().num_unknowns, 0.02, rng));
        const Eigen::VectorXd velocity =
            support::random_step(rod.layout().num_unknowns, 1.0, rng);
        const auto lost = [&](double step)
        {
            RodState end = begin;
            end.move(velocity, step);
            term->damp(begin, 1.0 / step);
            Eigen::VectorXd force = Eigen::VectorXd::Zero(velocity.size()), plain = force;
            term->add_gradient(end, force);
            term->damp(begin, 0.0);
            term->add_gradient(end, plain);
            return Eigen::VectorXd(force - plain);
        };
        Eigen::VectorXd force = Eigen::VectorXd::Zero(velocity.size());
        term->add_damping_forces(begin, velocity, 1.0, force);
        constexpr double h = 1e-5;
        EXPECT_LT((force - (2.0 * lost(h) - lost(2.0 * h))).norm(), 1e-6 * force.norm());
        EXPECT_GT(force.dot(velocity), 0.0);
    }
}

TEST(Elasticity, leaves_six_rigid_motions_free_and_no_more)
{
    for (const int degree : {2, 3, 4, 5})
        for (const int spans : {1, 2, 3, 8})
        {
            SCOPED_TRACE(testing::Message() << degree << " " << spans);
            const int n = spans + degree;
            std::vector<Eigen::Vector3d> q;
            const std::vector<double> knots = SplineBasis::clamped_knots(degree, n);
            for (int k = 0; k < n; ++k) // at their means, so that P = s x
            {
                double sum = 0.0;
                for (int i = 1; i <= degree; ++i)
                    sum += knots[idx(k + i)];
                q.emplace_back(sum / degree, 0, 0);
            }
            const Rod rod({SplineBasis::open(degree, knots), q},
                          [](double) { return support::section_of(1e4, 1.0, 0.8); }, {});
            const std::unique_ptr<RodTerm> term = exact_elasticity(rod);
            BandMatrix H(rod.layout().num_unknowns, rod.layout().half_band);
            term->add_hessian(RodState(rod), RodHessian::Exact, H);
            const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(dense(H));
            const Eigen::VectorXd& values = eigen.eigenvalues();
            EXPECT_LT(values[5], 1e-8);
            EXPECT_GT(values[6], 1e-4);
            EXPECT_EQ((values.array() < 1e-6).count(), 6);
        }
}

TEST(Elasticity, needs_a_curve_that_bends_and_moves_on)
{
    const auto section = [](double) { return support::section_of(1.0, 1.0, 1.0); };
    const SplineBasis lines = SplineBasis::open(1, SplineBasis::clamped_knots(1, 3));
    const Rod polyline({lines, {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}}, section, {});
    EXPECT_THROW(exact_elasticity(polyline), std::invalid_argument);
    const SplineBasis basis = SplineBasis::open(3, SplineBasis::clamped_knots(3, 4));
    EXPECT_THROW(Rod({basis, std::vector<Eigen::Vector3d>(4, Eigen::Vector3d::Zero())},
                     section, {}),
                 std::invalid_argument);
    EXPECT_THROW(Rod({basis, {{0, 0, 0}, {0, 0, 0}, {1, 0, 0}, {2, 0, 0}}}, section, {}),
                 std::invalid_argument);
}

TEST(Elasticity, of_an_arc_is_that_of_its_curvature)
{
    const double R = 2.0;
    const Rod rod(support::circle(R, 48),
                  [](double) { return support::section_of(1e4, 3.0, 1.0); },
                  {.rest = RodRest::Straight});
    const std::unique_ptr<RodTerm> term = exact_elasticity(rod);
    EXPECT_NEAR(term->value(RodState(rod)), std::numbers::pi * 3.0 / R, 1e-4);
}

TEST(Elasticity, of_turns_put_into_a_ring_is_that_of_even_twist)
{
    const double R = 1.0, turns = 0.7;
    const Rod rod(support::circle(R, 24),
                  [](double) { return support::section_of(1e4, 0.0, 2.0); },
                  {.link = turns});
    const std::unique_ptr<RodTerm> term = exact_elasticity(rod);
    const RodState state(rod);
    // 1/2 GJ (2 pi turns)^2 / (2 pi R)
    EXPECT_NEAR(term->value(state), 2.0 * std::numbers::pi * turns * turns / R, 1e-3);
}

} // namespace cellwarp::core
