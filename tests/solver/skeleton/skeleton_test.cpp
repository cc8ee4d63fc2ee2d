// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/skeleton/skeleton.h"

#include <cmath>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

#include "octree/base/index.h"
#include "solver/skeleton/joint_keys.h"

namespace cellwarp::core
{

namespace
{

using Eigen::AngleAxisd;
using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr double kPi = std::numbers::pi;

/// Joints along x at 0, 1, 2, ...
Skeleton chain(int joints)
{
    std::vector<RestJoint> out;
    for (int j = 0; j < joints; ++j)
        out.push_back({"j" + std::to_string(j), j - 1, Vector3d(j, 0, 0)});
    return Skeleton(out);
}

Skeleton body()
{
    return Skeleton({{"hip", -1, {0, 1, 0}},
                     {"chest", 0, {0, 2, 0.1}},
                     {"left", 1, {0.5, 2, 0}},
                     {"hand", 2, {1.5, 2, 0}},
                     {"right", 1, {-0.5, 2, 0}}});
}

SkeletonPose shaken(const Skeleton& skeleton, unsigned seed)
{
    std::mt19937 random(seed);
    std::normal_distribution<double> number;
    SkeletonPose pose = skeleton.rest();
    for (std::size_t j = 0; j < skeleton.size(); ++j)
    {
        pose.turns[j] = exponential({number(random), number(random), number(random)});
        pose.shifts[j] = {number(random), number(random), number(random)};
    }
    return pose;
}

} // namespace

TEST(Skeleton, joints_at_rest_move_nothing_to_the_last_bit)
{
    const Skeleton skeleton = body();
    for (const Motion& motion : skeleton.motions(skeleton.rest()))
    {
        EXPECT_TRUE(motion.R.isIdentity(0));
        EXPECT_TRUE(motion.t.isZero(0));
    }
}

TEST(Skeleton, a_planar_chain_ends_where_the_sums_of_its_angles_say)
{
    const Skeleton skeleton = chain(4);
    SkeletonPose pose = skeleton.rest();
    const double angles[3] = {0.3, -1.1, 2.0};
    Vector3d end = Vector3d::Zero();
    double sum = 0.0;
    for (std::size_t j = 0; j < 3; ++j)
    {
        pose.turns[j] = AngleAxisd(angles[j], Vector3d::UnitZ());
        sum += angles[j];
        end += Vector3d(std::cos(sum), std::sin(sum), 0);
    }
    EXPECT_LT((skeleton.motions(pose)[3](skeleton[3].at) - end).norm(), 1e-15);
}

TEST(Skeleton, a_joint_keeps_the_places_of_its_parent_and_turns_about_itself)
{
    const Skeleton skeleton = body();
    SkeletonPose pose = shaken(skeleton, 3);
    for (Vector3d& shift : pose.shifts)
        shift.setZero();
    const std::vector<Motion> motions = skeleton.motions(pose);
    for (std::size_t j = 1; j < skeleton.size(); ++j)
        EXPECT_LT((motions[j](skeleton[j].at) -
                   motions[idx(skeleton[j].parent)](skeleton[j].at))
                      .norm(),
                  1e-14);
}

TEST(Skeleton, turns_of_a_parent_carry_those_of_its_children)
{
    const Skeleton skeleton = body();
    SkeletonPose pose = shaken(skeleton, 4), turned = pose;
    const Motion whole{
        Quaterniond(AngleAxisd(1.2, Vector3d(1, 2, 3).normalized())).toRotationMatrix(),
        Vector3d(3, -1, 2)};
    // The same motion after the pose, told by the root alone.
    turned.turns[0] = Quaterniond(whole.R) * pose.turns[0];
    turned.shifts[0] = whole(skeleton[0].at + pose.shifts[0]) - skeleton[0].at;
    const std::vector<Motion> before = skeleton.motions(pose),
                              after = skeleton.motions(turned);
    for (std::size_t j = 0; j < skeleton.size(); ++j)
    {
        const Motion both = whole * before[j];
        EXPECT_LT((after[j].R - both.R).norm(), 1e-14);
        EXPECT_LT((after[j].t - both.t).norm(), 1e-13);
    }
}

TEST(Skeleton, a_chain_of_10000_joints_is_no_deeper_than_any)
{
    const Skeleton skeleton = chain(10000);
    SkeletonPose pose = skeleton.rest();
    for (std::size_t j = 0; j < skeleton.size(); ++j)
        pose.turns[j] = AngleAxisd(2.0 * kPi / 10000.0, Vector3d::UnitZ());
    // A circle: the end comes back to where it began, but for the first link's turn.
    EXPECT_LT(skeleton.motions(pose).back()(skeleton[9999].at).norm(), 1.1);
}

TEST(Skeleton, bones_go_to_every_child_that_is_elsewhere)
{
    const Skeleton skeleton({{"a", -1, {0, 0, 0}},
                             {"b", 0, {1, 0, 0}},
                             {"c", 0, {0, 0, 0}},
                             {"d", 2, {0, 2, 0}}});
    ASSERT_EQ(skeleton.bones(0).size(), 1u);
    EXPECT_EQ(skeleton.bones(0)[0].second, Vector3d(1, 0, 0));
    EXPECT_EQ(skeleton.bones(2).size(), 1u);
    EXPECT_TRUE(skeleton.bones(3).empty());
    EXPECT_EQ(skeleton.direction(1), Vector3d(1, 0, 0));
    EXPECT_EQ(skeleton.find("d"), 3);
    EXPECT_EQ(skeleton.find("e"), -1);
}

TEST(Skeleton, the_way_between_poses_is_even_and_ends_exactly)
{
    const Skeleton skeleton = body();
    const SkeletonPose from = shaken(skeleton, 5), to = shaken(skeleton, 6);
    const SkeletonPose half = between(from, to, 0.5), end = between(from, to, 1.0);
    for (std::size_t j = 0; j < skeleton.size(); ++j)
    {
        EXPECT_EQ(end.turns[j].coeffs(), to.turns[j].coeffs());
        EXPECT_NEAR(from.turns[j].angularDistance(half.turns[j]),
                    0.5 * from.turns[j].angularDistance(to.turns[j]), 1e-14);
        EXPECT_LT((half.shifts[j] - 0.5 * (from.shifts[j] + to.shifts[j])).norm(), 1e-15);
    }
}

TEST(Skeleton, limits_are_kept_and_counted)
{
    RestJoint knee{"knee", -1, Vector3d::Zero()};
    knee.limits.hinge = Vector3d::UnitX();
    knee.limits.twist = {0.0, 2.0};
    const Skeleton skeleton({knee, {"foot", 0, {0, -1, 0}}});
    SkeletonPose pose = skeleton.rest();
    pose.turns[0] = AngleAxisd(-0.5, Vector3d::UnitX());
    EXPECT_EQ(skeleton.limit(pose), 1);
    EXPECT_LT(pose.turns[0].angularDistance(Quaterniond::Identity()), 1e-15);
    pose.turns[0] = AngleAxisd(1.0, Vector3d::UnitX());
    EXPECT_EQ(skeleton.limit(pose), 0);
}

} // namespace cellwarp::core
