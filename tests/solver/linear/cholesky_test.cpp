// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/linear/cholesky.h"

#include <fstream>
#include <limits>
#include <new>
#include <random>

#include <sys/resource.h>
#include <unistd.h>

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "octree/base/index.h"
#include "tests/support/random.h"
#include "tests/support/sanitized.h"

namespace cellwarp::core
{

namespace
{

/// A random positive definite matrix with blocks of sizes 6, 3, 1 and 6.
BlockMatrix random_matrix(std::mt19937& rng, double shift)
{
    const std::vector<int> sizes = {6, 3, 1, 6};
    BlockMatrix A(sizes, {{1, 0}, {2, 1}, {3, 0}, {3, 2}});
    for (const auto& [row, column] : {std::pair(1, 0), {2, 1}, {3, 0}, {3, 2}})
    {
        BlockMatrix::Block block = A.block(A.find(row, column));
        for (Eigen::Index i = 0; i < block.size(); ++i)
            block(i % block.rows(), i / block.rows()) =
                support::random_number(rng, -1, 1);
    }
    for (int b = 0; b < 4; ++b)
        A.diagonal(b).diagonal().setConstant(shift);
    return A;
}

Eigen::MatrixXd dense(const BlockMatrix& A)
{
    Eigen::MatrixXd D(A.rows(), A.rows());
    for (int i = 0; i < A.rows(); ++i)
        D.col(i) = A.multiply(Eigen::VectorXd::Unit(A.rows(), i));
    return D;
}

} // namespace

TEST(BlockMatrix, multiplies_as_the_symmetric_whole)
{
    std::mt19937 rng(1);
    const BlockMatrix A = random_matrix(rng, 9.0);
    const Eigen::MatrixXd D = dense(A);
    EXPECT_EQ(A.rows(), 16);
    EXPECT_TRUE(D.isApprox(D.transpose()));
    EXPECT_NE(D(6, 0), 0.0);
    EXPECT_EQ(D(9, 0), 0.0);
    EXPECT_NEAR(A.norm(), D.cwiseAbs().rowwise().sum().maxCoeff(), 1e-12);
}

TEST(SparseCholesky, solves_what_eigen_solves)
{
    std::mt19937 rng(2);
    BlockMatrix A = random_matrix(rng, 9.0);
    SparseCholesky solver(A);
    for (const double shift : {9.0, 12.0})
    {
        for (int b = 0; b < 4; ++b)
            A.diagonal(b).diagonal().setConstant(shift);
        ASSERT_TRUE(solver.factorize(A));
        Eigen::VectorXd b(16);
        for (int i = 0; i < 16; ++i)
            b[i] = support::random_number(rng, -1, 1);
        Eigen::VectorXd x;
        solver.solve(b, x);
        EXPECT_LT((x - dense(A).ldlt().solve(b)).norm(), 1e-12);
    }
    EXPECT_GT(solver.factor_numbers(), 16.0);
}

TEST(SparseCholesky, reports_what_is_not_positive_definite)
{
    std::mt19937 rng(3);
    BlockMatrix A = random_matrix(rng, 9.0);
    SparseCholesky solver(A);
    A.diagonal(2)(0, 0) = -1.0;
    EXPECT_FALSE(solver.factorize(A));
    A.diagonal(2)(0, 0) = std::numeric_limits<double>::quiet_NaN();
    EXPECT_FALSE(solver.factorize(A));
    A.diagonal(2)(0, 0) = 9.0;
    EXPECT_TRUE(solver.factorize(A));
    A.set_zero();
    EXPECT_FALSE(solver.factorize(A));
}

TEST(SparseCholesky, without_memory_for_the_factor_it_throws_and_can_go_on)
{
    if (support::kIsSanitized)
        GTEST_SKIP() << "a sanitizer needs terabytes of address space";
    // A full matrix: its factor, some 18 MB, is one piece that only the system gives.
    constexpr int kBlocks = 250;
    std::vector<std::pair<int, int>> pairs;
    for (int row = 1; row < kBlocks; ++row)
        for (int column = 0; column < row; ++column)
            pairs.emplace_back(row, column);
    BlockMatrix A(std::vector<int>(kBlocks, 6), pairs);
    for (int b = 0; b < kBlocks; ++b)
        A.diagonal(b).diagonal().setConstant(2.0);
    SparseCholesky first(A), solver(A);
    EXPECT_GE(solver.factor_numbers(), 1500 * 1501 / 2);
    // The threads that the library works with are started once, with room for them.
    ASSERT_TRUE(first.factorize(A));

    struct rlimit before
    {
    };
    ASSERT_EQ(::getrlimit(RLIMIT_AS, &before), 0);
    std::size_t pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    const rlim_t room = pages * idx(::sysconf(_SC_PAGESIZE));
    const struct rlimit tight = {room + (rlim_t(1) << 20), before.rlim_max};
    ASSERT_EQ(::setrlimit(RLIMIT_AS, &tight), 0);
    bool ran_out = false;
    try
    {
        EXPECT_FALSE(solver.factorize(A));
    }
    catch (const std::bad_alloc&)
    {
        ran_out = true;
    }
    ::setrlimit(RLIMIT_AS, &before);
    EXPECT_TRUE(ran_out);
    EXPECT_TRUE(solver.factorize(A));
    Eigen::VectorXd x;
    solver.solve(Eigen::VectorXd::Ones(A.rows()), x);
    EXPECT_LT((x - Eigen::VectorXd::Constant(A.rows(), 0.5)).norm(), 1e-12);
}

} // namespace cellwarp::core
