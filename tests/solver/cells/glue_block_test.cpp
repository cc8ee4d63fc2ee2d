// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/cells/glue_block.h"

#include <limits>

#include <gtest/gtest.h>

#include "tests/support/random.h"
#include "tests/support/random_poses.h"

namespace cellwarp::core
{

namespace
{

Eigen::Matrix3d random_matrix(std::mt19937& rng)
{
    Eigen::Matrix3d M;
    for (int k = 0; k < 3; ++k)
        M.col(k) = support::random_vector(rng, 1.0);
    return M;
}

GlueBlock random_block(std::mt19937& rng)
{
    return {random_matrix(rng), support::random_vector(rng, 1.0),
            support::random_vector(rng, 1.0), support::random_number(rng, 0.1, 1.0)};
}

Twist random_twist(std::mt19937& rng)
{
    Twist twist;
    twist << support::random_vector(rng, 1.0), support::random_vector(rng, 1.0);
    return twist;
}

} // namespace

TEST(GlueBlock, multiplies_as_its_matrix_does)
{
    std::mt19937 rng(1);
    for (int time = 0; time < 20; ++time)
    {
        const GlueBlock block = random_block(rng);
        const Matrix6 M = block.matrix();
        const Twist x = random_twist(rng), before = random_twist(rng);
        Twist y = before, of_transposed = before;
        block.add_product(x, y);
        block.add_transposed_product(x, of_transposed);
        EXPECT_LT((y - before - M * x).norm(), 1e-14);
        EXPECT_LT((of_transposed - before - M.transpose() * x).norm(), 1e-14);
        EXPECT_EQ(block.transposed().matrix(), M.transpose());
    }
}

TEST(GlueBlock, is_scaled_and_added_as_its_matrix_is)
{
    std::mt19937 rng(2);
    const GlueBlock a = random_block(rng), b = random_block(rng);
    GlueBlock sum = a;
    sum += b;
    EXPECT_LT((sum.matrix() - a.matrix() - b.matrix()).norm(), 1e-15);
    Vector6 of_row, of_column;
    of_row << 2.0, 2.0, 2.0, 0.3, 0.3, 0.3;
    of_column << 5.0, 5.0, 5.0, 0.7, 0.7, 0.7;
    const Matrix6 expected = of_row.asDiagonal() * a.matrix() * of_column.asDiagonal();
    EXPECT_LT((a.scaled(of_row, of_column).matrix() - expected).norm(), 1e-14);
}

/// Other axes of both bodies leave the form, whatever sizes turns and shifts have.
TEST(GlueBlock, is_found_in_matrices_that_have_its_form)
{
    std::mt19937 rng(3);
    for (const double length : {1e-6, 1.0, 1e6})
        for (int time = 0; time < 20; ++time)
        {
            GlueBlock block = random_block(rng);
            if (time % 4 == 1)
                block.row_arm.setZero(); // what is left of it is rounding
            if (time % 4 == 2)
                block.column_arm = 1e-3 * block.row_arm;
            if (time % 4 == 3)
                block.shift = 0.0;
            Matrix6 turned = Matrix6::Zero();
            const Eigen::Matrix3d R = support::random_rotation(rng);
            for (const int i : {0, 3})
                for (const int j : {0, 3})
                    turned.block<3, 3>(i, j) =
                        R.transpose() * block.matrix().block<3, 3>(i, j).eval() * R;
            Vector6 scale;
            scale << length, length, length, 1.0, 1.0, 1.0;
            turned = (scale.asDiagonal() * turned * scale.asDiagonal()).eval();
            const std::optional<GlueBlock> found = as_glue(turned);
            ASSERT_TRUE(found.has_value()) << length << ", " << time;
            const Matrix6 unscaled = scale.cwiseInverse().asDiagonal() *
                                     (found->matrix() - turned) *
                                     scale.cwiseInverse().asDiagonal();
            EXPECT_LT(unscaled.norm(), 1e-14) << length << ", " << time;
        }
    ASSERT_TRUE(as_glue(Matrix6::Zero()).has_value());
    EXPECT_EQ(as_glue(Matrix6::Zero())->matrix(), Matrix6::Zero());
}

TEST(GlueBlock, is_not_found_in_others)
{
    std::mt19937 rng(4);
    const Matrix6 M = random_block(rng).matrix();
    const double nan = std::numeric_limits<double>::quiet_NaN();
    for (const double other : {1e-6, 1.0, nan})
    {
        for (const auto& [row, column] :
             {std::pair(0, 3), {1, 4}, {4, 0}, {5, 5}, {3, 4}, {1, 5}, {5, 0}})
        {
            Matrix6 changed = M;
            changed(row, column) += other;
            EXPECT_FALSE(as_glue(changed).has_value()) << row << ", " << column;
        }
    }
}

} // namespace cellwarp::core
