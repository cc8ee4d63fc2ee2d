// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/linear/band_lu.h"

#include <cmath>
#include <random>

#include <Eigen/LU>
#include <gtest/gtest.h>

namespace cellwarp::core
{

TEST(BandLu, solves_what_dense_elimination_solves)
{
    std::mt19937 rng(1);
    std::normal_distribution<double> normal;
    for (const int below : {0, 1, 3})
        for (const int above : {0, 2, 5})
            for (const int n : {1, 2, 7, 30})
            {
                SCOPED_TRACE(testing::Message() << below << above << n);
                BandLu band(n, below, above);
                Eigen::MatrixXd A = Eigen::MatrixXd::Zero(n, n);
                for (int i = 0; i < n; ++i)
                    for (int j = std::max(0, i - below); j <= std::min(n - 1, i + above);
                         ++j)
                        // Rows of different units, and diagonals that need exchanges.
                        A(i, j) = band.entry(i, j) =
                            std::pow(10.0, i % 5) * (i == j ? 1e-3 : 1.0) * normal(rng);
                for (int i = 0; below * above == 0 && i < n; ++i)
                    A(i, i) = band.entry(i, i) = std::pow(10.0, i % 5);
                const Eigen::VectorXd wanted =
                    Eigen::VectorXd::NullaryExpr(n, [&] { return normal(rng); });
                Eigen::VectorXd x = A * wanted;
                ASSERT_TRUE(band.factorize());
                band.solve(x);
                const double error = (x - wanted).norm(),
                             dense = (A.partialPivLu().solve(A * wanted) - wanted).norm();
                EXPECT_LE(error, 1e3 * dense + 1e-12);
            }
}

TEST(BandLu, says_that_a_matrix_is_singular)
{
    BandLu none(3, 1, 1);
    for (int i = 0; i < 3; ++i)
        none.entry(i, i) = i == 1 ? 0.0 : 1.0;
    EXPECT_FALSE(none.factorize());
    // The second row is the first one, in other units.
    BandLu twice(2, 1, 1);
    twice.entry(0, 0) = 1.0;
    twice.entry(0, 1) = 0.1;
    twice.entry(1, 0) = 1e9;
    twice.entry(1, 1) = 1e8;
    EXPECT_FALSE(twice.factorize());
}

} // namespace cellwarp::core
