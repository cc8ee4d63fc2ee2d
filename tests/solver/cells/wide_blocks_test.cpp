// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/cells/wide_blocks.h"

#include <gtest/gtest.h>

#include "tests/support/random.h"

namespace cellwarp::core
{

namespace
{

Vector6 random_numbers(std::mt19937& rng)
{
    Vector6 x;
    x << support::random_vector(rng, 1.0), support::random_vector(rng, 1.0);
    return x;
}

/// With numbers in the lanes that mean nothing.
WideVector wide(const Vector6& x)
{
    WideVector of = WideVector::of(x);
    of.turn[3] = 1e3f;
    of.shift[3] = -1e3f;
    return of;
}

} // namespace

TEST(WideBlocks, multiply_as_their_blocks_whatever_stands_in_idle_lanes)
{
    std::mt19937 rng(1);
    WideBlocks others(4);
    std::vector<Matrix6> blocks;
    for (std::size_t k = 0; k < others.size(); ++k)
    {
        Matrix6& block = blocks.emplace_back();
        for (int column = 0; column < 6; ++column)
            block.col(column) = random_numbers(rng);
        others.set(k, block);
    }
    ASSERT_EQ(blocks.size(), 4u);
    const Vector6 x = random_numbers(rng);
    for (std::size_t k = 0; k < blocks.size(); ++k)
        EXPECT_LT((others.product(k, wide(x)).numbers() - blocks[k] * x).norm(), 2e-6);
    for (int time = 0; time < 10; ++time)
    {
        const GlueBlock glue(
            blocks[0].topLeftCorner<3, 3>(), support::random_vector(rng, 1.0),
            support::random_vector(rng, 1.0), support::random_number(rng, 0.1, 1.0));
        const Vector6 at = random_numbers(rng), before = random_numbers(rng);
        WideVector y = wide(before);
        WideGlue(glue).add_product(wide(at), y);
        EXPECT_LT((y.numbers() - before - glue.matrix() * at).norm(), 2e-6);
    }
}

TEST(WideBlocks, of_vectors_add_and_scale_as_these_do)
{
    std::mt19937 rng(2);
    const Vector6 a = random_numbers(rng), b = random_numbers(rng);
    EXPECT_LT(((wide(a) + 0.5f * wide(b) - wide(b)).numbers() - (a - 0.5 * b)).norm(),
              2e-6);
    const Eigen::Vector3d left = a.head<3>(), right = b.head<3>();
    const WideVector crossed = {cross(wide(a).turn, wide(b).turn), {}};
    EXPECT_LT((crossed.numbers().head<3>() - left.cross(right)).norm(), 2e-6);
}

} // namespace cellwarp::core
