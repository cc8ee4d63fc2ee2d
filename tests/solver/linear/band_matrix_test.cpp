// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/linear/band_matrix.h"

#include <random>

#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

namespace cellwarp::core
{

namespace
{

/// Random in the band, its diagonal as large as \p weight says.
BandMatrix random_band(int rows, int half_band, double weight, Eigen::MatrixXd& dense)
{
    std::mt19937 rng(static_cast<unsigned>(rows + 100 * half_band));
    std::normal_distribution<double> normal;
    BandMatrix A(rows, half_band);
    dense.setZero(rows, rows);
    for (int j = 0; j < rows; ++j)
        for (int i = j; i <= std::min(j + half_band, rows - 1); ++i)
        {
            const double value = normal(rng) + (i == j ? weight : 0.0);
            A.add(j, i, value);
            dense(i, j) = dense(j, i) = value;
        }
    return A;
}

} // namespace

TEST(BandMatrix, multiplies_and_solves_as_a_dense_one)
{
    for (const int half_band : {0, 1, 3, 15})
    {
        Eigen::MatrixXd dense;
        const BandMatrix A = random_band(40, half_band, 12.0, dense);
        const Eigen::VectorXd x = Eigen::VectorXd::LinSpaced(40, -1.0, 2.0);
        Eigen::VectorXd y;
        A.multiply(x, y);
        EXPECT_LT((y - dense * x).norm(), 1e-13 * y.norm());
        BandFactor factor;
        const BandFactor::Report report = factor.factorize(A);
        EXPECT_TRUE(report.is_finite);
        EXPECT_EQ(report.num_negative, 0);
        factor.solve(y);
        EXPECT_LT((y - x).norm(), 1e-12 * x.norm());
    }
}

TEST(BandMatrix, counts_the_directions_that_curve_downwards)
{
    Eigen::MatrixXd dense;
    const BandMatrix A = random_band(30, 4, 0.0, dense);
    const Eigen::VectorXd eigenvalues =
        dense.selfadjointView<Eigen::Lower>().eigenvalues();
    BandFactor factor;
    EXPECT_EQ(factor.factorize(A).num_negative, (eigenvalues.array() < 0.0).count());
}

TEST(BandMatrix, what_is_not_finite_is_told)
{
    BandMatrix A(3, 1);
    A.add(0, 0, 1.0);
    A.add(1, 1, std::nan(""));
    BandFactor factor;
    EXPECT_FALSE(factor.factorize(A).is_finite);
}

} // namespace cellwarp::core
