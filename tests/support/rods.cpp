// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/rods.h"

#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

namespace cellwarp::core::support
{

Rod crooked_rod(const RodCase& of, const RodSettings& settings)
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

void expect_derivatives(const RodTerm& term, const Rod& rod)
{
    const int n = rod.layout().num_unknowns;
    std::mt19937 rng(7);
    RodState state(rod);
    state.move(random_step(n, 0.1, rng));
    Eigen::VectorXd gradient = Eigen::VectorXd::Zero(n);
    term.add_gradient(state, gradient);
    const auto moved = [&](const Eigen::VectorXd& step, double length)
    {
        RodState to = state;
        to.move(step, length);
        return term.value(to);
    };
    for (int i = 0; i < n; ++i)
    {
        const Eigen::VectorXd unit = Eigen::VectorXd::Unit(n, i);
        EXPECT_NEAR((moved(unit, 1e-6) - moved(unit, -1e-6)) / 2e-6, gradient[i],
                    1e-8 * gradient.norm());
    }
    BandMatrix H(n, rod.layout().half_band);
    term.add_hessian(state, RodHessian::Exact, H);
    const Eigen::MatrixXd exact = dense(H);
    for (int k = 0; k < 20; ++k)
    {
        const Eigen::VectorXd along = random_step(n, 1.0, rng).normalized();
        const double h = 2e-4;
        const double second =
            (moved(along, h) - 2.0 * term.value(state) + moved(along, -h)) / (h * h);
        EXPECT_NEAR(second, along.dot(exact * along), 3e-6 * exact.norm());
    }
    BandMatrix definite(n, rod.layout().half_band);
    term.add_hessian(state, RodHessian::Definite, definite);
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(dense(definite));
    EXPECT_GT(eigen.eigenvalues().minCoeff(), -1e-10 * eigen.eigenvalues().maxCoeff());
}

} // namespace cellwarp::core::support
