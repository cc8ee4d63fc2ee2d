// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/base/rigid_motion.h"

#include <cmath>
#include <numbers>

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <gtest/gtest.h>

#include "octree/base/half_turn.h"
#include "tests/support/random.h"
#include "tests/support/random_poses.h"

namespace cellwarp::core
{

using support::random_number;
using support::random_pose;
using support::random_rotation;
using support::random_vector;

TEST(RigidMotion, the_closest_rotation_is_the_polar_one)
{
    std::mt19937 rng(1);
    for (int trial = 0; trial < 50; ++trial)
    {
        const Eigen::Vector3d omega = random_vector(rng, 3.0);
        const Eigen::Matrix3d A = Eigen::Matrix3d::Identity() + cross_matrix(omega);
        const Eigen::JacobiSVD<Eigen::Matrix3d> svd(A, Eigen::ComputeFullU |
                                                           Eigen::ComputeFullV);
        EXPECT_LT(
            (closest_rotation(omega) - svd.matrixU() * svd.matrixV().transpose()).norm(),
            1e-13);
    }
    EXPECT_TRUE(closest_rotation(Eigen::Vector3d::Zero()).isIdentity(0));
}

TEST(RigidMotion, a_small_twist_moves_as_its_linearisation)
{
    std::mt19937 rng(2);
    const Pose pose = random_pose(rng, 1.0);
    const Eigen::Vector3d centre = random_vector(rng, 1.0), x = random_vector(rng, 1.0);
    Twist twist;
    twist << 1e-6 * random_vector(rng, 1.0), 1e-6 * random_vector(rng, 1.0);
    const Eigen::Vector3d before = image(pose, centre, x);
    const Eigen::Vector3d linear =
        before + twist.head<3>().cross(before - pose.p) + twist.tail<3>();
    EXPECT_LT((image(moved(pose, twist), centre, x) - linear).norm(), 1e-11);
}

TEST(RigidMotion, twists_of_one_body_keep_it_rigid_however_large_they_are)
{
    std::mt19937 rng(21);
    for (const double size : {1e-3, 1.0, 30.0})
    {
        const Pose a = random_pose(rng, 2.0), b = random_pose(rng, 2.0);
        const Eigen::Vector3d omega = random_vector(rng, size),
                              v = random_vector(rng, size);
        Twist of_a, of_b;
        of_a << omega, v + omega.cross(a.p);
        of_b << omega, v + omega.cross(b.p);
        const Pose x = moved(a, of_a), y = moved(b, of_b);
        const Eigen::Vector3d before = a.R.transpose() * (b.p - a.p);
        EXPECT_LT((x.R.transpose() * (y.p - x.p) - before).norm(), 1e-12 * (1 + size));
        EXPECT_LT((x.R.transpose() * y.R - a.R.transpose() * b.R).norm(), 1e-13);
    }
}

TEST(RigidMotion, many_twists_stay_orthonormal)
{
    std::mt19937 rng(3);
    Pose pose;
    for (int i = 0; i < 10000; ++i)
    {
        Twist twist;
        twist << random_vector(rng, 0.5), random_vector(rng, 0.5);
        pose = moved(pose, twist);
    }
    EXPECT_LT((pose.R.transpose() * pose.R - Eigen::Matrix3d::Identity()).norm(), 1e-14);
    EXPECT_NEAR(pose.R.determinant(), 1.0, 1e-14);
}

TEST(RigidMotion, rest_displaces_nothing_to_the_bit)
{
    std::mt19937 rng(4);
    const Eigen::Vector3d centre = random_vector(rng, 1.0), x = random_vector(rng, 1.0);
    const Pose rest{Eigen::Matrix3d::Identity(), centre};
    EXPECT_TRUE(displacement(rest, centre, x).isZero(0));
    EXPECT_TRUE(displacement(carried(Motion(), centre), centre, x).isZero(0));
}

TEST(RigidMotion, motions_compose_and_invert)
{
    std::mt19937 rng(5);
    const Motion a{random_rotation(rng), random_vector(rng, 1.0)};
    const Motion b{random_rotation(rng), random_vector(rng, 1.0)};
    const Eigen::Vector3d x = random_vector(rng, 1.0);
    EXPECT_LT(((a * b)(x)-a(b(x))).norm(), 1e-14);
    EXPECT_LT((inverse(a)(a(x)) - x).norm(), 1e-14);
}

TEST(RigidMotion, rotation_vectors_reach_pi_with_one_sign)
{
    std::mt19937 rng(6);
    for (int trial = 0; trial < 100; ++trial)
    {
        const Eigen::Vector3d axis = random_vector(rng, 1.0).normalized();
        const double angle = random_number(rng, 0.0, std::numbers::pi - 1e-6);
        EXPECT_LT((rotation_vector(rotation_about(axis, angle)) - angle * axis).norm(),
                  1e-9);
    }
    for (const double sign : {1.0, -1.0})
        for (int k = 0; k < 3; ++k)
        {
            const Eigen::Vector3d axis = sign * Eigen::Vector3d::Unit(k);
            EXPECT_LT((rotation_vector(rotation_about(axis, std::numbers::pi)) -
                       std::numbers::pi * Eigen::Vector3d::Unit(k))
                          .norm(),
                      1e-9);
        }
    EXPECT_TRUE(rotation_vector(Eigen::Matrix3d::Identity()).isZero(0));
}

TEST(RigidMotion, half_turns_go_one_way_whatever_their_rounding)
{
    std::mt19937 rng(7);
    const auto check = [](const Eigen::Vector3d& axis)
    {
        const Eigen::Vector3d told =
            rotation_vector(rotation_about(axis, std::numbers::pi));
        for (const double off : {-9e-7, -1e-9, -1e-16, 1e-16, 1e-9, 9e-7})
        {
            const Eigen::Matrix3d R = rotation_about(axis, std::numbers::pi + off);
            EXPECT_TRUE(is_half_turn(R));
            const Eigen::Vector3d vector = rotation_vector(R);
            EXPECT_LT((vector - told).norm(), 1e-6);
            EXPECT_LT((rotation_about(vector.normalized(), vector.norm()) - R).norm(),
                      1e-12);
        }
        for (const double off : {-2e-6, 2e-6})
            EXPECT_FALSE(is_half_turn(rotation_about(axis, std::numbers::pi + off)));
    };
    for (int trial = 0; trial < 100; ++trial)
        check(random_vector(rng, 1.0).normalized());
    // Components of one size, and none, decide nothing by their rounding either.
    for (const Eigen::Vector3d& axis :
         {Eigen::Vector3d(1, -1, 0), Eigen::Vector3d(0, -1, 1),
          Eigen::Vector3d(-1, 1, 1)})
    {
        check(axis.normalized());
        for (const double tilt : {-1e-15, 1e-15})
            EXPECT_LT(
                (rotation_vector(
                     rotation_about((axis + tilt * Eigen::Vector3d(1, 1, 1)).normalized(),
                                    std::numbers::pi)) -
                 rotation_vector(rotation_about(axis.normalized(), std::numbers::pi)))
                    .norm(),
                1e-9);
    }
}

} // namespace cellwarp::core
