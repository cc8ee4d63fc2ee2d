// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/base/rigid_fit.h"

#include <numbers>
#include <vector>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <gtest/gtest.h>

#include "tests/support/random.h"
#include "tests/support/random_poses.h"

namespace cellwarp::core
{

using support::random_rotation;
using support::random_vector;

namespace
{

std::vector<Eigen::Vector3d> images(const Motion& motion,
                                    const std::vector<Eigen::Vector3d>& places)
{
    std::vector<Eigen::Vector3d> moved;
    for (const Eigen::Vector3d& x : places)
        moved.push_back(motion(x));
    return moved;
}

double misfit(const Motion& motion, const std::vector<Eigen::Vector3d>& from,
              const std::vector<Eigen::Vector3d>& to)
{
    double sum = 0.0;
    for (std::size_t i = 0; i < from.size(); ++i)
        sum += (motion(from[i]) - to[i]).squaredNorm();
    return sum;
}

} // namespace

TEST(RigidFit, finds_the_motion_of_places_that_move_rigidly_to_rounding)
{
    std::mt19937 rng(5);
    for (const int count : {3, 4, 8, 50})
        for (int trial = 0; trial < 20; ++trial)
        {
            const Motion motion{random_rotation(rng), random_vector(rng, 3.0)};
            std::vector<Eigen::Vector3d> from;
            for (int i = 0; i < count; ++i)
                from.push_back(random_vector(rng, 1.0));
            const Motion found = rigid_fit(from, images(motion, from));
            EXPECT_LT((found.R - motion.R).norm(), 1e-11);
            EXPECT_LT((found.t - motion.t).norm(), 1e-11);
            EXPECT_NEAR(found.R.determinant(), 1.0, 1e-13);
        }
}

TEST(RigidFit, is_the_best_among_motions_nearby_and_never_mirrors)
{
    std::mt19937 rng(6);
    for (int trial = 0; trial < 20; ++trial)
    {
        std::vector<Eigen::Vector3d> from, to;
        for (int i = 0; i < 5; ++i)
        {
            from.push_back(random_vector(rng, 1.0));
            to.push_back(trial % 2 == 0
                             ? Eigen::Vector3d(Eigen::Vector3d(-1, 1, 1).asDiagonal() *
                                               from.back())
                             : random_vector(rng, 1.0));
        }
        const Motion found = rigid_fit(from, to);
        EXPECT_NEAR(found.R.determinant(), 1.0, 1e-13);
        const double least = misfit(found, from, to);
        for (int k = 0; k < 50; ++k)
        {
            const Motion near{closest_rotation(random_vector(rng, 1e-3)),
                              random_vector(rng, 1e-3)};
            EXPECT_LE(least, misfit(near * found, from, to) + 1e-14);
        }
    }
}

TEST(RigidFit, turns_the_least_where_places_are_one_two_or_in_a_line)
{
    const std::vector<Eigen::Vector3d> one = {{1, 2, 3}}, moved = {{2, 2, 5}};
    const Motion shift = rigid_fit(one, moved);
    EXPECT_EQ(shift.R, Eigen::Matrix3d::Identity());
    EXPECT_EQ(shift.t, Eigen::Vector3d(1, 0, 2));
    const Motion together =
        rigid_fit(std::vector{one[0], one[0]}, std::vector{moved[0], moved[0]});
    EXPECT_EQ(together.R, Eigen::Matrix3d::Identity());

    const Eigen::Matrix3d R = rotation_about(Eigen::Vector3d::UnitZ(), 0.7);
    std::vector<Eigen::Vector3d> line = {{0, 0, 0}, {1, 0, 0}};
    for (int count = 2; count < 5; ++count)
    {
        std::vector<Eigen::Vector3d> turned;
        for (const Eigen::Vector3d& x : line)
            turned.push_back(R * x + Eigen::Vector3d(0.1, 0.2, 0.3));
        const Motion found = rigid_fit(line, turned);
        EXPECT_LT((found.R - R).norm(), 1e-12);
        EXPECT_LT(misfit(found, line, turned), 1e-24);
        line.emplace_back(0.3 * count, 0, 0);
    }
}

TEST(RigidFit, is_the_identity_where_nothing_moves_and_a_shift_where_all_shift)
{
    std::mt19937 rng(7);
    std::vector<Eigen::Vector3d> from;
    for (int i = 0; i < 6; ++i)
        from.push_back(random_vector(rng, 1.0));
    EXPECT_EQ(rigid_fit(from, from).R, Eigen::Matrix3d::Identity());
    EXPECT_EQ(rigid_fit(from, from).t, Eigen::Vector3d::Zero());
    const Motion shift{Eigen::Matrix3d::Identity(), {0.3, -0.2, 0.1}};
    EXPECT_EQ(rigid_fit(from, images(shift, from)).R, Eigen::Matrix3d::Identity());
    EXPECT_EQ(rigid_fit({}, {}).R, Eigen::Matrix3d::Identity());
}

TEST(RigidFit, about_an_axis_keeps_the_plane_even_of_a_mirror_image)
{
    std::mt19937 rng(8);
    const Eigen::Vector3d axis = random_vector(rng, 1.0).normalized();
    const Eigen::Vector3d u = axis.unitOrthogonal(), v = axis.cross(u);
    std::vector<Eigen::Vector3d> from, mirrored;
    for (int i = 0; i < 6; ++i)
    {
        const Eigen::Vector3d x = random_vector(rng, 1.0);
        from.push_back(x.x() * u + x.y() * v);
        mirrored.push_back(x.y() * u + x.x() * v);
    }
    EXPECT_LT((rigid_fit_about(axis, from, mirrored).R * axis - axis).norm(), 1e-14);
    const Motion turn{rotation_about(axis, 2.9), 0.4 * u - 0.1 * v};
    const Motion found = rigid_fit_about(axis, from, images(turn, from));
    EXPECT_LT((found.R - turn.R).norm() + (found.t - turn.t).norm(), 1e-12);
}

} // namespace cellwarp::core
