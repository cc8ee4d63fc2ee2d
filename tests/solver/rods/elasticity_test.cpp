// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/rods/elasticity.h"

#include <numbers>
#include <random>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "tests/support/rods.h"

namespace cellwarp
{

namespace
{

using support::random_step;

struct Case
{
    bool is_closed, is_round, is_given;
    int degree;
};

std::vector<Case> cases()
{
    std::vector<Case> all;
    for (const int degree : {2, 3, 4, 5})
        for (const bool is_closed : {false, true})
        {
            all.push_back({is_closed, true, false, degree});
            all.push_back({is_closed, false, true, degree});
        }
    return all;
}

Rod crooked_rod(const Case& of, const RodSettings& settings)
{
    std::mt19937 rng(3);
    std::normal_distribution<double> normal(0.0, 0.05);
    std::vector<Eigen::Vector3d> q;
    constexpr int n = 9;
    for (int i = 0; i < n; ++i)
    {
        const double a = of.is_closed ? 2.0 * std::numbers::pi * i / n : 0.3 * i;
        q.emplace_back(std::cos(a) + normal(rng), std::sin(a) + normal(rng),
                       of.is_closed ? normal(rng) : 0.2 * i);
    }
    std::vector<double> turn = {0.0, 1.0, 1.7, 3.1, 4.0, 5.0, 6.0, 6.7, 8.0, 9.0};
    SplineBasis basis =
        of.is_closed
            ? SplineBasis::closed(of.degree, turn)
            : SplineBasis::open(of.degree, SplineBasis::clamped_knots(of.degree, n));
    const Section section{50.0, {1.0, of.is_round ? 1.0 : 2.0}, 0.7, 1.0, 1.0, 0.1};
    return Rod(
        {std::move(basis), std::move(q)}, [section](double) { return section; },
        settings);
}

Eigen::MatrixXd dense(const BandMatrix& H)
{
    Eigen::MatrixXd out = Eigen::MatrixXd::Zero(H.rows(), H.rows());
    for (int j = 0; j < H.rows(); ++j)
        for (int i = j; i <= std::min(j + H.half_band(), H.rows() - 1); ++i)
            out(i, j) = out(j, i) = H.lower(i, j);
    return out;
}

} // namespace

TEST(Elasticity, is_zero_at_rest_and_after_rigid_motions)
{
    for (const Case& of : cases())
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
                    state.first(e, end == 0 ? 0 : rod.num_places() - 1).normalized();
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
    for (const Case& of : cases())
    {
        SCOPED_TRACE(testing::Message() << of.is_closed << of.is_round << of.degree);
        RodSettings settings;
        settings.rest = of.is_given ? RestShape1D::Given : RestShape1D::Straight;
        settings.rest_twist = 0.2;
        settings.link = 0.3;
        const Rod rod = crooked_rod(of, settings);
        const std::unique_ptr<RodTerm> term = exact_elasticity(rod);
        const int n = rod.layout().num_unknowns;
        std::mt19937 rng(7);
        RodState state(rod);
        state.move(random_step(n, 0.1, rng));
        Eigen::VectorXd gradient = Eigen::VectorXd::Zero(n);
        term->add_gradient(state, gradient);
        const auto moved = [&](const Eigen::VectorXd& step, double length)
        {
            RodState to = state;
            to.move(step, length);
            return term->value(to);
        };
        for (int i = 0; i < n; ++i)
        {
            const Eigen::VectorXd unit = Eigen::VectorXd::Unit(n, i);
            EXPECT_NEAR((moved(unit, 1e-6) - moved(unit, -1e-6)) / 2e-6, gradient[i],
                        1e-8 * gradient.norm());
        }
        BandMatrix H(n, rod.layout().half_band);
        term->add_hessian(state, RodHessian::Exact, H);
        const Eigen::MatrixXd exact = dense(H);
        for (int k = 0; k < 20; ++k)
        {
            const Eigen::VectorXd along = random_step(n, 1.0, rng).normalized();
            const double h = 2e-4;
            const double second =
                (moved(along, h) - 2.0 * term->value(state) + moved(along, -h)) / (h * h);
            EXPECT_NEAR(second, along.dot(exact * along), 3e-6 * exact.norm());
        }
        BandMatrix definite(n, rod.layout().half_band);
        term->add_hessian(state, RodHessian::Definite, definite);
        const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(dense(definite));
        EXPECT_GT(eigen.eigenvalues().minCoeff(),
                  -1e-10 * eigen.eigenvalues().maxCoeff());
    }
}

TEST(Elasticity, leaves_six_rigid_motions_free_and_no_more)
{
    const Rod rod = support::straight_rod(1.0, 8, support::section_of(1e4, 1.0, 0.8));
    const std::unique_ptr<RodTerm> term = exact_elasticity(rod);
    BandMatrix H(rod.layout().num_unknowns, rod.layout().half_band);
    term->add_hessian(RodState(rod), RodHessian::Exact, H);
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(dense(H));
    const Eigen::VectorXd& values = eigen.eigenvalues();
    EXPECT_LT(values[5], 1e-8);
    EXPECT_GT(values[6], 1e-4);
    EXPECT_EQ((values.array() < 1e-6).count(), 6);
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
                  {.rest = RestShape1D::Straight});
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

} // namespace cellwarp
