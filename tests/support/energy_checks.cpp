// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/energy_checks.h"

#include <algorithm>
#include <numeric>
#include <vector>

#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include "octree/base/index.h"
#include "tests/support/random.h"

namespace cellwarp::core::support
{

namespace
{

/// Of the steps in which values are taken: with fourth order, 1e-12 of truncation and
/// 1e-10 of rounding in second derivatives of about 1.
constexpr double kStep = 1e-3;

constexpr double kGradientError = 1e-7, kCurvatureError = 1e-6, kRounding = 1e-12;

int num_unknowns(const Energy& energy)
{
    return std::accumulate(energy.block_sizes().begin(), energy.block_sizes().end(), 0);
}

std::vector<int> first_unknowns(const Energy& energy)
{
    std::vector<int> first = {0};
    for (const int size : energy.block_sizes())
        first.push_back(first.back() + size);
    return first;
}

double value_at(Energy& energy, const Eigen::VectorXd& step)
{
    energy.move(step, 1.0);
    return energy.value();
}

Eigen::VectorXd random_step(const Energy& energy, std::mt19937& rng)
{
    Eigen::VectorXd step(num_unknowns(energy));
    for (Eigen::Index i = 0; i < step.size(); ++i)
        step[i] = random_number(rng, -1.0, 1.0);
    return step;
}

/// The estimate from steps of h and of 2h without its error of second order.
template <class Estimate>
double extrapolated(Estimate&& estimate)
{
    return (4.0 * estimate(kStep) - estimate(2.0 * kStep)) / 3.0;
}

double slope(Energy& energy, const Eigen::VectorXd& x)
{
    return extrapolated(
        [&](double h)
        { return (value_at(energy, h * x) - value_at(energy, -h * x)) / (2.0 * h); });
}

double mixed(Energy& energy, const Eigen::VectorXd& x, const Eigen::VectorXd& y)
{
    return extrapolated(
        [&](double h)
        {
            return (value_at(energy, h * (x + y)) + value_at(energy, -h * (x + y)) -
                    value_at(energy, h * (x - y)) - value_at(energy, h * (y - x))) /
                   (4.0 * h * h);
        });
}

void move_back(Energy& energy)
{
    energy.move(Eigen::VectorXd::Zero(num_unknowns(energy)), 0.0);
}

} // namespace

Eigen::MatrixXd dense_hessian(const Energy& energy)
{
    const int n = num_unknowns(energy);
    Eigen::MatrixXd H(n, n);
    Eigen::VectorXd column;
    for (int i = 0; i < n; ++i)
    {
        energy.multiply(Eigen::VectorXd::Unit(n, i), column);
        H.col(i) = column;
    }
    return H;
}

Eigen::VectorXd gradient_by_values(Energy& energy)
{
    energy.settle();
    const int n = num_unknowns(energy);
    Eigen::VectorXd gradient(n);
    for (int i = 0; i < n; ++i)
        gradient[i] = slope(energy, Eigen::VectorXd::Unit(n, i));
    move_back(energy);
    return gradient;
}

double curvature_by_values(Energy& energy, const Eigen::VectorXd& x,
                           const Eigen::VectorXd& y)
{
    energy.settle();
    const double curvature = mixed(energy, x, y);
    move_back(energy);
    return curvature;
}

Eigen::MatrixXd hessian_by_values(Energy& energy)
{
    energy.settle();
    const int n = num_unknowns(energy);
    Eigen::MatrixXd H(n, n);
    for (int i = 0; i < n; ++i)
        for (int j = 0; j <= i; ++j)
            H(i, j) = H(j, i) =
                mixed(energy, Eigen::VectorXd::Unit(n, i), Eigen::VectorXd::Unit(n, j));
    move_back(energy);
    return H;
}

void check_structure(const Energy& energy)
{
    const std::span<const int> sizes = energy.block_sizes();
    const std::span<const std::pair<int, int>> pairs = energy.pairs();
    EXPECT_TRUE(std::all_of(sizes.begin(), sizes.end(), [](int n) { return n > 0; }));
    EXPECT_TRUE(std::is_sorted(pairs.begin(), pairs.end()));
    EXPECT_EQ(std::adjacent_find(pairs.begin(), pairs.end()), pairs.end());
    for (const auto& [row, column] : pairs)
    {
        EXPECT_GT(row, column);
        EXPECT_GE(column, 0);
        EXPECT_LT(row, static_cast<int>(sizes.size()));
    }
    Eigen::VectorXd gradient;
    energy.gradient(gradient);
    EXPECT_EQ(gradient.size(), num_unknowns(energy));
    std::vector<double> rounding(sizes.size(), -1.0);
    energy.rounding(rounding);
    // Far below anything that could pass for a gradient.
    for (const double error : rounding)
    {
        EXPECT_GE(error, 0.0);
        EXPECT_LT(error, 1e-9 * (1.0 + gradient.norm()));
    }
}

void check_gradient(Energy& energy)
{
    Eigen::VectorXd gradient;
    energy.gradient(gradient);
    EXPECT_GT(gradient.norm(), 1e-3);
    EXPECT_LT((gradient - gradient_by_values(energy)).norm(),
              kGradientError * gradient.norm());
}

void check_curvature(Energy& energy, std::mt19937& rng)
{
    energy.linearise(kExact);
    Eigen::VectorXd image;
    for (int trial = 0; trial < 10; ++trial)
    {
        const Eigen::VectorXd x = random_step(energy, rng).normalized();
        const Eigen::VectorXd y = random_step(energy, rng).normalized();
        energy.multiply(x, image);
        const double size = image.norm();
        const double along = x.dot(image), across = y.dot(image);
        EXPECT_NEAR(along, curvature_by_values(energy, x, x), kCurvatureError * size);
        EXPECT_NEAR(across, curvature_by_values(energy, y, x), kCurvatureError * size);
    }
}

void check_blocks(Energy& energy, Curvature curvature)
{
    energy.linearise(curvature);
    const Eigen::MatrixXd H = dense_hessian(energy);
    const std::vector<int> first = first_unknowns(energy);
    const std::span<const int> sizes = energy.block_sizes();
    const std::span<const std::pair<int, int>> pairs = energy.pairs();
    Eigen::MatrixXd blocks = Eigen::MatrixXd::Zero(H.rows(), H.cols());
    const auto at = [&](int row, int column)
    {
        const std::size_t r = idx(row);
        const std::size_t c = idx(column);
        return blocks.block(first[r], first[c], sizes[r], sizes[c]);
    };
    for (int b = 0; b < static_cast<int>(sizes.size()); ++b)
        energy.diagonal_block(b, at(b, b));
    for (std::size_t p = 0; p < pairs.size(); ++p)
    {
        energy.pair_block(static_cast<int>(p), at(pairs[p].first, pairs[p].second));
        at(pairs[p].second, pairs[p].first) =
            at(pairs[p].first, pairs[p].second).transpose().eval();
    }
    const double rounding = kRounding * H.norm();
    EXPECT_GT(H.norm(), 0.0);
    EXPECT_LT((H - H.transpose()).norm(), rounding);
    EXPECT_LT((H - blocks).norm(), rounding);
    std::mt19937 rng(7);
    const Eigen::VectorXd x = random_step(energy, rng);
    Eigen::VectorXd image;
    energy.multiply(x, image);
    EXPECT_LT((H * x - image).norm(), rounding * x.norm());
}

void check_gauss_newton(Energy& energy)
{
    energy.linearise(kGaussNewton);
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(dense_hessian(energy));
    EXPECT_GT(eigen.eigenvalues().minCoeff(),
              -kRounding * eigen.eigenvalues().maxCoeff());
}

void check_zero_residuals(Energy& energy)
{
    EXPECT_LT(energy.value(), 1e-20);
    energy.linearise(kGaussNewton);
    const Eigen::MatrixXd gauss_newton = dense_hessian(energy);
    energy.linearise(kExact);
    EXPECT_LT((dense_hessian(energy) - gauss_newton).norm(), 1e-10 * gauss_newton.norm());
}

void check_energy(Energy& energy, std::mt19937& rng)
{
    check_structure(energy);
    check_gradient(energy);
    check_curvature(energy, rng);
    check_blocks(energy, kExact);
    check_blocks(energy, kGaussNewton);
    check_gauss_newton(energy);
}

} // namespace cellwarp::core::support
