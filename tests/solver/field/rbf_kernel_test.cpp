// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/field/rbf_kernel.h"

#include <cmath>
#include <cstring>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <gtest/gtest.h>

#include "octree/base/index.h"
#include "tests/support/random.h"

namespace cellwarp::core
{

namespace
{

std::vector<double> random_numbers(std::mt19937& rng, std::size_t count, double size)
{
    std::vector<double> numbers(count);
    for (double& number : numbers)
        number = support::random_number(rng, -size, size);
    return numbers;
}

bool same_bits(const std::vector<double>& a, const std::vector<double>& b)
{
    return a.size() == b.size() &&
           std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0;
}

/// A symmetric positive definite matrix, packed.
std::vector<double> packed(const Eigen::MatrixXd& A)
{
    const std::size_t n = idx(A.rows());
    std::vector<double> entries(packed_entries(n), 0.0);
    for (std::size_t k = 0; k < n; ++k)
        for (std::size_t i = k / kCentreLanes * kCentreLanes; i < n; ++i)
            entries[packed_column(n, k) + i] =
                A(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k));
    return entries;
}

Eigen::MatrixXd random_definite(std::mt19937& rng, Eigen::Index n)
{
    const std::vector<double> numbers = random_numbers(rng, idx(n * n), 1.0);
    const Eigen::Map<const Eigen::MatrixXd> B(numbers.data(), n, n);
    return B * B.transpose() + Eigen::MatrixXd::Identity(n, n);
}

} // namespace

TEST(RbfKernel, sums_at_places_are_the_plain_ones_to_the_same_bits_in_every_set)
{
    std::mt19937 rng(5);
    for (const std::size_t n : {std::size_t(1), std::size_t(40), std::size_t(327)})
    {
        const std::vector<double> centres = random_numbers(rng, 6 * n, 1.0),
                                  places = random_numbers(rng, 3 * kPlaceLanes, 2.0);
        std::vector<double> displacement(3 * kPlaceLanes), slopes(9 * kPlaceLanes);
        rbf_kernels(InstructionSet::Plain)
            .value(
                {centres.data(), n, places.data(), displacement.data(), slopes.data()});
        for (std::size_t l = 0; l < kPlaceLanes; ++l)
        {
            double sums[3] = {}, slope = 0.0;
            for (std::size_t j = 0; j < n; ++j)
            {
                double d[3], squared = 0.0;
                for (std::size_t k = 0; k < 3; ++k)
                {
                    d[k] = places[k * kPlaceLanes + l] - centres[6 * j + k];
                    squared += d[k] * d[k];
                }
                for (std::size_t k = 0; k < 3; ++k)
                    sums[k] += squared * std::sqrt(squared) * centres[6 * j + 3 + k];
                slope += 3.0 * std::sqrt(squared) * d[1] * centres[6 * j + 5];
            }
            for (std::size_t k = 0; k < 3; ++k)
                EXPECT_NEAR(displacement[k * kPlaceLanes + l], sums[k],
                            1e-11 * static_cast<double>(n));
            EXPECT_NEAR(slopes[5 * kPlaceLanes + l], slope,
                        1e-11 * static_cast<double>(n));
        }
        for (const InstructionSet set : instruction_sets())
        {
            std::vector<double> value(3 * kPlaceLanes), alone(3 * kPlaceLanes),
                along(9 * kPlaceLanes);
            rbf_kernels(set).value(
                {centres.data(), n, places.data(), value.data(), along.data()});
            rbf_kernels(set).displacement(
                {centres.data(), n, places.data(), alone.data(), nullptr});
            EXPECT_TRUE(same_bits(value, displacement));
            EXPECT_TRUE(same_bits(alone, displacement));
            EXPECT_TRUE(same_bits(along, slopes));
        }
    }
}

TEST(RbfKernel, products_and_columns_are_those_of_the_matrix_of_cubes)
{
    std::mt19937 rng(6);
    constexpr std::size_t n = 21, size = 24;
    const std::vector<double> centres = random_numbers(rng, 3 * size, 1.0),
                              weights = random_numbers(rng, kQuadraticTerms * size, 1.0),
                              others = random_numbers(rng, kQuadraticTerms * size, 1.0);
    const auto cube = [&](std::size_t i, std::size_t j)
    {
        const double d =
            std::hypot(centres[i] - centres[j], centres[size + i] - centres[size + j],
                       centres[2 * size + i] - centres[2 * size + j]);
        return d * d * d;
    };
    std::vector<double> first_products, first_columns;
    for (const InstructionSet set : instruction_sets())
    {
        for (const std::size_t count : {std::size_t(3), kQuadraticTerms})
        {
            std::vector<double> out(count * size);
            rbf_kernels(set).products(
                {centres.data(), n, size, weights.data(), out.data(), 0, size}, count);
            for (std::size_t k = 0; k < count; ++k)
                for (std::size_t i = 0; i < n; ++i)
                {
                    double sum = 0.0;
                    for (std::size_t j = 0; j < n; ++j)
                        sum += cube(i, j) * weights[k * size + j];
                    EXPECT_NEAR(out[k * size + i], sum, 1e-11);
                }
            if (first_products.size() != out.size())
                first_products = out;
            EXPECT_TRUE(set == InstructionSet::Plain || count == 3 ||
                        same_bits(out, first_products));
        }
        std::vector<double> out(8 * 16);
        rbf_kernels(set).columns(
            {centres.data(), size, weights.data(), others.data(), 8, 16, out.data(), 16});
        for (std::size_t j = 8; j < 16; ++j)
            for (std::size_t i = 8; i < size; ++i)
            {
                double entry = cube(i, j);
                for (std::size_t k = 0; k < kQuadraticTerms; ++k)
                    entry += weights[k * size + i] * others[k * size + j] +
                             others[k * size + i] * weights[k * size + j];
                EXPECT_NEAR(out[(j - 8) * 16 + i - 8], entry, 1e-12);
            }
        if (set == InstructionSet::Plain)
            first_columns = out;
        EXPECT_TRUE(same_bits(out, first_columns));
    }
}

TEST(RbfKernel, factors_solve_and_are_the_same_bits_in_every_set)
{
    std::mt19937 rng(7);
    for (const Eigen::Index n : {8, 24, 120})
    {
        const Eigen::MatrixXd A = random_definite(rng, n);
        const std::size_t size = idx(n);
        const std::vector<double> b = random_numbers(rng, 3 * size, 1.0);
        std::vector<double> first;
        for (const InstructionSet set : instruction_sets())
        {
            std::vector<double> factor = packed(A), x = b;
            ASSERT_TRUE(rbf_kernels(set).factorise(factor.data(), size));
            rbf_kernels(set).solve(factor.data(), size, x.data());
            for (Eigen::Index k = 0; k < 3; ++k)
            {
                const Eigen::Map<const Eigen::VectorXd> found(x.data() + k * n, n),
                    wanted(b.data() + k * n, n);
                EXPECT_LT((A * found - wanted).norm(), 1e-10);
            }
            if (first.empty())
                first = x;
            EXPECT_TRUE(same_bits(x, first));
        }
    }
}

TEST(RbfKernel, what_is_not_positive_definite_has_no_factor)
{
    std::mt19937 rng(8);
    Eigen::MatrixXd A = random_definite(rng, 40);
    A(29, 29) = -1.0;
    for (const InstructionSet set : instruction_sets())
    {
        std::vector<double> factor = packed(A);
        EXPECT_FALSE(rbf_kernels(set).factorise(factor.data(), 40));
    }
}

} // namespace cellwarp::core
