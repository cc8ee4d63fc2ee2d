// SPDX-License-Identifier: GPL-3.0-or-later
// Vibrations and stability of whole rods, against exact theory.
#include "solver/rods/rod_model.h"

#include <numbers>

#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include "solver/rods/rod_newton.h"
#include "tests/support/rods.h"

namespace cellwarp::core
{

namespace
{

/// Rows and columns \p kept of a band.
Eigen::MatrixXd dense(const BandMatrix& H, const std::vector<int>& kept)
{
    const Eigen::Index n = static_cast<Eigen::Index>(kept.size());
    Eigen::MatrixXd out = Eigen::MatrixXd::Zero(n, n);
    for (Eigen::Index i = 0; i < n; ++i)
        for (Eigen::Index j = 0; j < n; ++j)
        {
            const int row = std::max(kept[idx(i)], kept[idx(j)]),
                      column = std::min(kept[idx(i)], kept[idx(j)]);
            if (row - column <= H.half_band())
                out(i, j) = H.lower(row, column);
        }
    return out;
}

/// k of the bending modes across y: omega = k^2 sqrt(YI / rho A L^4), all 1.
Eigen::VectorXd wave_numbers(int points, bool is_clamped)
{
    const Rod rod =
        support::straight_rod(1.0, points - 3, support::section_of(1e8, 1.0, 0.77));
    RodModel model(rod);
    model.terms.push_back(exact_elasticity(rod));
    BandMatrix H;
    model.hessian(RodState(rod), RodHessian::Exact, H);
    BandMatrix M(H.rows(), H.half_band());
    model.mass().add_to(M, 1.0);
    std::vector<int> kept;
    for (int k = is_clamped ? 2 : 0; k < rod.num_controls(); ++k)
        kept.push_back(rod.layout().control[idx(k)] + 1);
    const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> modes(dense(H, kept),
                                                                          dense(M, kept));
    return modes.eigenvalues().cwiseMax(0.0).cwiseSqrt().cwiseSqrt();
}

/// Whether a ring that is straight at rest, with turns put in, is stable where it lies.
bool is_stable(int points, double turns)
{
    const Rod rod(support::circle(1.0, points),
                  [](double) { return support::section_of(1e6, 1.3, 1.0); },
                  {.rest = RodRest::Straight, .link = turns});
    RodModel model(rod);
    model.terms.push_back(exact_elasticity(rod));
    RodState state(rod);
    RodNewton newton(model);
    newton.solve(state);
    BandMatrix H;
    model.hessian(state, RodHessian::Exact, H);
    std::vector<int> all(idx(H.rows()));
    for (int k = 0; k < H.rows(); ++k)
        all[idx(k)] = k;
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(dense(H, all),
                                                               Eigen::EigenvaluesOnly);
    return eigen.eigenvalues()[0] > -1e-5;
}

} // namespace

TEST(RodModel, vibrates_as_beams_do)
{
    const double clamped[] = {1.8751040687, 4.6940911330, 7.8547574382, 10.9955407349};
    const double free[] = {4.7300407449, 7.8532046241, 10.9956078380};
    const Eigen::VectorXd of_clamped = wave_numbers(24, true),
                          of_free = wave_numbers(24, false);
    for (int k = 0; k < 4; ++k)
        EXPECT_NEAR(of_clamped[k], clamped[k], 3e-5 * clamped[k]);
    for (int k = 0; k < 3; ++k)
        EXPECT_NEAR(of_free[k + 2], free[k], 3e-5 * free[k]);
    EXPECT_LT(of_free[1], 1e-2); // shifts and turns
    // Coarser: fourth order.
    EXPECT_NEAR(wave_numbers(12, true)[2], clamped[2], 5e-4 * clamped[2]);
}

TEST(RodModel, a_twisted_ring_jumps_where_michell_says)
{
    // 2 pi sqrt(3) YI / GJ; errors that the theory's prototype measured.
    const double exact = 2.0 * std::numbers::pi * std::sqrt(3.0) * 1.3;
    for (const auto& [points, error] :
         {std::pair(12, 3.7e-3), {16, 8.2e-4}, {24, 1.3e-4}})
    {
        double low = 2.0, high = 2.5;
        for (int k = 0; k < 18; ++k)
        {
            const double turns = 0.5 * (low + high);
            (is_stable(points, turns) ? low : high) = turns;
        }
        const double off = low * 2.0 * std::numbers::pi / exact - 1.0;
        EXPECT_GT(off, 0.0) << points;
        EXPECT_LT(off, 1.05 * error) << points;
    }
}

TEST(RodModel, hangs_as_a_catenary_without_stiffness)
{
    struct Row
    {
        double length, sag, pull; // of the span; of the weight
    };
    for (const Row& row : {Row{1.1, 0.20030079, 0.65496395},
                           {1.5, 0.50263326, 0.30823647},
                           {2.0, 0.79638836, 0.22964022}})
    {
        // From a parabola of the same length.
        double low = 0.0, high = 3.0;
        const auto spline_of = [](double sag)
        {
            std::vector<Eigen::Vector3d> points;
            for (int k = 0; k <= 40; ++k)
                points.emplace_back(k / 40.0, -4.0 * sag * k / 40.0 * (1.0 - k / 40.0),
                                    0.0);
            return spline_through(points, false, 1);
        };
        for (int k = 0; k < 50; ++k)
        {
            const double sag = 0.5 * (low + high);
            (ArcLength(spline_of(sag)).total() < row.length ? low : high) = sag;
        }
        const Rod rod(spline_of(low),
                      [](double) { return support::section_of(1e7, 1e-6, 1e-6); },
                      {.rest = RodRest::Straight});
        RodModel model(rod);
        model.terms.push_back(exact_elasticity(rod));
        model.gravity = {0, -1, 0};
        RodConstraint end;
        model.constraints.push_back(end);
        end.s = rod.basis().end();
        end.point = {1, 0, 0};
        model.constraints.push_back(end);
        RodState state(rod);
        RodNewton newton(model);
        EXPECT_EQ(newton.solve(state).stop, MotionStop::Converged);
        EXPECT_NEAR(-state.at(0.5 * end.s).place.y(), row.sag, 1e-5);
        EXPECT_NEAR(-newton.multipliers()[0], row.pull, 2e-5);
        EXPECT_NEAR(newton.multipliers()[1], 0.5 * row.length, 1e-5);
    }
}

} // namespace cellwarp::core
