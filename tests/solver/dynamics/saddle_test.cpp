// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/dynamics/saddle.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <gtest/gtest.h>

namespace cellwarp::core
{

namespace
{

/// A chain of springs between neighbours, held by nothing.
BandMatrix chain(int count)
{
    BandMatrix A(count, 1);
    for (int i = 0; i + 1 < count; ++i)
    {
        A.add(i, i, 1.0);
        A.add(i + 1, i + 1, 1.0);
        A.add(i, i + 1, -1.0);
    }
    return A;
}

Eigen::MatrixXd whole(const BandMatrix& A, const std::vector<SparseRow>& rows)
{
    const int n = A.rows(), k = static_cast<int>(rows.size());
    Eigen::MatrixXd M = Eigen::MatrixXd::Zero(n + k, n + k);
    for (int j = 0; j < n; ++j)
        for (int i = j; i <= std::min(j + A.half_band(), n - 1); ++i)
            M(i, j) = M(j, i) = A.lower(i, j);
    for (int r = 0; r < k; ++r)
        for (const auto& [unknown, value] : rows[idx(r)])
            M(n + r, unknown) = M(unknown, n + r) = -value;
    return M;
}

Eigen::VectorXd solved(const Eigen::MatrixXd& M, const Eigen::VectorXd& r,
                       const Eigen::VectorXd& g)
{
    Eigen::VectorXd both = Eigen::VectorXd::Zero(M.rows());
    both.head(r.size()) = r;
    both.tail(g.size()) = g;
    return M.fullPivLu().solve(both);
}

} // namespace

TEST(Saddle, near_rows_hold_a_matrix_that_alone_is_singular)
{
    const BandMatrix A = chain(12);
    const std::vector<SparseRow> rows = {{{3, 1.0}, {4, 0.5}}, {{9, 2.0}}};
    SaddleSolver solver;
    const SaddleSolver::Report report = solver.factorize(A, rows, std::vector{1, 1});
    EXPECT_EQ(report.num_negative, 0);
    EXPECT_EQ(report.num_dropped, 0);
    Eigen::VectorXd r = Eigen::VectorXd::LinSpaced(12, 1.0, 3.0), g(2);
    g << 0.3, -0.2;
    const Eigen::VectorXd exact = solved(whole(A, rows), r, g);
    solver.solve(r, g);
    EXPECT_LT((r - exact.head(12)).norm(), 1e-12);
    EXPECT_LT((g - exact.tail(2)).norm(), 1e-12);
}

TEST(Saddle, rows_behind_a_singular_block_lose_nothing)
{
    // Before the last row is met the chain may go anywhere: its last pivot is 0.
    const BandMatrix A = chain(12);
    const std::vector<SparseRow> rows = {{{11, 1.0}}};
    SaddleSolver solver;
    EXPECT_EQ(solver.factorize(A, rows, std::vector{1}).num_negative, 0);
    Eigen::VectorXd r = Eigen::VectorXd::LinSpaced(12, 1.0, 3.0), g(1);
    g << 0.3;
    const Eigen::VectorXd exact = solved(whole(A, rows), r, g);
    solver.solve(r, g);
    EXPECT_LT((r - exact.head(12)).norm(), 1e-11);
    EXPECT_NEAR(g[0], exact[12], 1e-11);
}

TEST(Saddle, tells_of_directions_that_the_rows_leave_free_alone)
{
    // Bends downwards at one unknown: held there it does not.
    BandMatrix A = chain(12);
    A.add(11, 11, -3.0);
    SaddleSolver solver;
    const std::vector<SparseRow> there = {{{11, 1.0}}}, elsewhere = {{{2, 1.0}}};
    EXPECT_EQ(solver.factorize(A, there, std::vector{1}).num_negative, 0);
    EXPECT_EQ(solver.factorize(A, elsewhere, std::vector{1}).num_negative, 1);
    EXPECT_EQ(solver.factorize(A, {}, {}).num_negative, 1);
}

TEST(Saddle, rows_from_end_to_end_are_met_too)
{
    const BandMatrix A = chain(40);
    const std::vector<SparseRow> rows = {
        {{0, 1.0}}, {{1, 1.0}, {38, -1.0}}, {{2, 1.0}, {39, 1.0}}};
    SaddleSolver solver;
    solver.factorize(A, rows, std::vector{1, 1, 1});
    Eigen::VectorXd r = Eigen::VectorXd::LinSpaced(40, 1.0, 3.0), g(3);
    g << 0.0, -0.2, 0.1;
    const Eigen::VectorXd exact = solved(whole(A, rows), r, g);
    solver.solve(r, g);
    EXPECT_LT((r - exact.head(40)).norm(), 1e-10);
    EXPECT_LT((g - exact.tail(3)).norm(), 1e-10);
}

TEST(Saddle, rows_that_say_the_same_twice_are_dropped)
{
    const BandMatrix A = chain(12);
    const std::vector<SparseRow> rows = {{{3, 1.0}}, {{3, 2.0}}, {{8, 1.0}}};
    SaddleSolver solver;
    EXPECT_EQ(solver.factorize(A, rows, std::vector{2, 1}).num_dropped, 1);
    Eigen::VectorXd r = Eigen::VectorXd::Ones(12), g = Eigen::VectorXd::Zero(3);
    solver.solve(r, g);
    EXPECT_TRUE(r.allFinite());
    EXPECT_NEAR(r[3], 0.0, 1e-13);
    EXPECT_NEAR(r[8], 0.0, 1e-13);
}

} // namespace cellwarp::core
