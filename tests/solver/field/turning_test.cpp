// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/field/turning.h"

#include <random>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "tests/support/random.h"

namespace cellwarp::core
{

using support::random_vector;

namespace
{

Eigen::Vector4d numbers_of_rotation(const Eigen::Quaterniond& q)
{
    return {q.w(), q.x(), q.y(), q.z()};
}

Eigen::Matrix3d matrix_of(const Eigen::Vector4d& q)
{
    return Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized().toRotationMatrix();
}

Eigen::Quaterniond random_rotation(std::mt19937& random)
{
    return Eigen::Quaterniond(Eigen::AngleAxisd(
        3.0 * random_vector(random, 1.0).x(),
        (random_vector(random, 1.0) + Eigen::Vector3d::Constant(1e-3)).normalized()));
}

} // namespace

TEST(Turning, the_identity_keeps_the_bits)
{
    const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
    const Eigen::Vector3d v(0.1, -2.0 / 3, 1e-20);
    const Eigen::Vector4d q(0.1, -2.0 / 3, 0.3, 1e-20);
    EXPECT_EQ(turned_normal(I, v), v);
    EXPECT_EQ(turned_tangent(I, v), v);
    EXPECT_EQ(turned_rotation(I, q), q);
}

TEST(Turning, a_rigid_map_turns_everything_by_itself)
{
    std::mt19937 random(1);
    for (int i = 0; i < 100; ++i)
    {
        const Eigen::Quaterniond turn = random_rotation(random);
        const Eigen::Matrix3d R = turn.toRotationMatrix();
        const Eigen::Vector3d v = 3.0 * random_vector(random, 1.0);
        EXPECT_LT((turned_normal(R, v) - R * v).norm(), 1e-12);
        EXPECT_LT((turned_tangent(R, v) - R * v).norm(), 1e-12);
        // A quaternion of the file need not have length 1.
        const Eigen::Vector4d q = 2.5 * numbers_of_rotation(random_rotation(random));
        const Eigen::Vector4d turned = turned_rotation(R, q);
        EXPECT_LT((matrix_of(turned) - R * matrix_of(q)).norm(), 1e-12);
        EXPECT_NEAR(turned.norm(), 2.5, 1e-12);
        EXPECT_GE(turned.dot(q), 0.0);
    }
}

TEST(Turning, tangents_and_normals_stay_perpendicular)
{
    std::mt19937 random(2);
    for (int i = 0; i < 100; ++i)
    {
        Eigen::Matrix3d J;
        J << random_vector(random, 1.0), random_vector(random, 1.0),
            random_vector(random, 1.0);
        const Eigen::Vector3d n = random_vector(random, 1.0);
        const Eigen::Vector3d t = n.cross(random_vector(random, 1.0));
        const Eigen::Vector3d turned_n = turned_normal(J, n),
                              turned_t = turned_tangent(J, t);
        EXPECT_NEAR(turned_n.dot(turned_t), 0.0, 1e-10);
        EXPECT_NEAR(turned_n.norm(), n.norm(), 1e-12);
        EXPECT_NEAR(turned_t.norm(), t.norm(), 1e-12);
    }
}

TEST(Turning, a_stretched_rotation_turns_by_its_rotation)
{
    std::mt19937 random(3);
    const Eigen::Matrix3d R = random_rotation(random).toRotationMatrix();
    const Eigen::Matrix3d A = random_rotation(random).toRotationMatrix();
    const Eigen::Matrix3d stretch =
        A * Eigen::Vector3d(0.4, 1.3, 2.0).asDiagonal() * A.transpose();
    const Eigen::Vector4d q = numbers_of_rotation(random_rotation(random));
    EXPECT_LT((matrix_of(turned_rotation(R * stretch, q)) - R * matrix_of(q)).norm(),
              1e-12);
}

TEST(Turning, maps_that_flatten_or_mirror_give_a_rotation)
{
    const Eigen::Vector4d q(0.5, 0.5, 0.5, 0.5);
    const Eigen::Vector3d diagonals[] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {3, 2, -1}};
    for (const Eigen::Vector3d& diagonal : diagonals)
    {
        const Eigen::Vector4d turned = turned_rotation(diagonal.asDiagonal(), q);
        ASSERT_TRUE(turned.allFinite());
        EXPECT_NEAR(turned.norm(), 1.0, 1e-12);
    }
    // What shrinks most is turned over, so the rest follows the map.
    EXPECT_LT((turned_rotation(Eigen::Vector3d(3, 2, -1).asDiagonal(), q) - q).norm(),
              1e-12);
    EXPECT_EQ(turned_tangent(Eigen::Matrix3d::Zero(), {1, 2, 3}),
              Eigen::Vector3d(1, 2, 3));
}

} // namespace cellwarp::core
