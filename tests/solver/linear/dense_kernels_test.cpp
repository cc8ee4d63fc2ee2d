// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/linear/dense_kernels.h"

#include <filesystem>
#include <iterator>
#include <optional>
#include <thread>

#include <gtest/gtest.h>

#include "solver/linear/cholesky.h"

extern "C" int openblas_get_num_threads();
extern "C" void openblas_set_num_threads(int);

namespace cellwarp::core
{

namespace
{

std::ptrdiff_t num_threads_of_process()
{
    return std::distance(std::filesystem::directory_iterator("/proc/self/task"),
                         std::filesystem::directory_iterator());
}

/// A positive definite matrix in one dense block of rows, factorised.
Eigen::VectorXd solution_of_dense_matrix()
{
    constexpr int kBlocks = 60;
    std::vector<std::pair<int, int>> pairs;
    for (int row = 1; row < kBlocks; ++row)
        for (int column = 0; column < row; ++column)
            pairs.emplace_back(row, column);
    BlockMatrix A(std::vector<int>(kBlocks, 6), pairs);
    for (const auto& [row, column] : pairs)
        A.block(A.find(row, column)).setConstant(1.0 / (1.0 + row + 3.0 * column));
    for (int b = 0; b < kBlocks; ++b)
        A.diagonal(b).diagonal().setConstant(500.0 + b);
    SparseCholesky solver(A);
    EXPECT_TRUE(solver.factorize(A));
    Eigen::VectorXd x;
    solver.solve(Eigen::VectorXd::LinSpaced(A.rows(), 1.0, 2.0), x);
    return x;
}

} // namespace

TEST(DenseKernels, have_their_threads_again_when_the_last_scope_goes)
{
    const int before = openblas_get_num_threads();
    openblas_set_num_threads(3);
    std::optional<OneDenseThread> first(std::in_place);
    std::thread(
        [&]
        {
            const OneDenseThread second;
            first.reset();
            EXPECT_EQ(openblas_get_num_threads(), 1);
        })
        .join();
    EXPECT_EQ(openblas_get_num_threads(), 3);
    openblas_set_num_threads(before);
}

TEST(DenseKernels, give_the_same_bits_whatever_the_count_of_threads_of_the_process)
{
    const int before = openblas_get_num_threads();
    openblas_set_num_threads(1);
    const Eigen::VectorXd one = solution_of_dense_matrix();
    openblas_set_num_threads(4);
    EXPECT_TRUE(solution_of_dense_matrix() == one);
    EXPECT_EQ(openblas_get_num_threads(), 4);
    openblas_set_num_threads(before);
}

TEST(DenseKernels, start_no_threads_again_once_theirs_are_ended)
{
    end_dense_threads();
    const std::ptrdiff_t num_threads = num_threads_of_process();
    end_dense_threads();
    solution_of_dense_matrix();
    EXPECT_EQ(num_threads_of_process(), num_threads);
}

} // namespace cellwarp::core
