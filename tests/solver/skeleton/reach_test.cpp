// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/skeleton/reach.h"

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
std::vector<RestJoint> joints_in_line(int joints)
{
    std::vector<RestJoint> out;
    for (int j = 0; j < joints; ++j)
        out.push_back({"j" + std::to_string(j), j - 1, Vector3d(j, 0, 0)});
    return out;
}

Vector3d place_of(const Skeleton& skeleton, const SkeletonPose& pose, int joint)
{
    return skeleton.motions(pose)[idx(joint)](skeleton[idx(joint)].at);
}

ReachReport reach_one(const Skeleton& skeleton, int joint, const Vector3d& place,
                      SkeletonPose& pose)
{
    const std::vector<ReachTarget> targets = {
        {joint, place, usual_chain(skeleton, joint)}};
    return reach(skeleton, targets, pose);
}

} // namespace

TEST(Reach, a_place_within_reach_is_reached_to_rounding)
{
    const Skeleton skeleton(joints_in_line(5));
    std::mt19937 random(1);
    std::normal_distribution<double> number;
    for (int k = 0; k < 200; ++k)
    {
        Vector3d place(number(random), number(random), number(random));
        place *= 3.9 * std::cbrt(0.001 * (k * 5 % 1000)) / place.norm();
        SkeletonPose pose = skeleton.rest();
        pose.turns[1] = AngleAxisd(0.2, Vector3d::UnitY());
        const ReachReport report = reach_one(skeleton, 4, place, pose);
        EXPECT_LT((place_of(skeleton, pose, 4) - place).norm(), 1e-10) << place;
        EXPECT_LE(report.misses[0], 1e-10);
        EXPECT_LE(report.iterations, 60);
    }
}

TEST(Reach, the_bones_keep_their_lengths)
{
    const Skeleton skeleton(joints_in_line(5));
    SkeletonPose pose = skeleton.rest();
    reach_one(skeleton, 4, {1, 2, 0.5}, pose);
    for (int j = 0; j < 4; ++j)
        EXPECT_NEAR(
            (place_of(skeleton, pose, j + 1) - place_of(skeleton, pose, j)).norm(), 1.0,
            1e-14);
}

TEST(Reach, what_is_there_stays_to_the_bit)
{
    const Skeleton skeleton(joints_in_line(4));
    SkeletonPose pose = skeleton.rest();
    const ReachReport report = reach_one(skeleton, 3, {3, 0, 0}, pose);
    EXPECT_EQ(report.iterations, 0);
    for (const Quaterniond& turn : pose.turns)
        EXPECT_EQ(turn.coeffs(), Quaterniond::Identity().coeffs());
}

TEST(Reach, two_links_make_the_triangle_that_the_law_of_cosines_says)
{
    const Skeleton skeleton(joints_in_line(3));
    for (const double distance : {0.3, 1.0, 1.9})
    {
        SkeletonPose pose = skeleton.rest();
        reach_one(skeleton, 2, {0, distance, 0}, pose);
        EXPECT_NEAR(pose.turns[1].angularDistance(Quaterniond::Identity()),
                    kPi - 2.0 * std::asin(distance / 2.0), 1e-9);
    }
}

TEST(Reach, a_straight_arm_bends_to_a_place_on_its_own_line)
{
    const Skeleton skeleton(joints_in_line(4));
    SkeletonPose pose = skeleton.rest();
    const ReachReport report = reach_one(skeleton, 3, {2, 0, 0}, pose);
    EXPECT_LT(report.misses[0], 1e-10);
}

TEST(Reach, what_is_too_far_is_pointed_at_with_a_straight_arm)
{
    const Skeleton skeleton(joints_in_line(4));
    SkeletonPose pose = skeleton.rest();
    const Vector3d place(3, 4, 12);
    const ReachReport report = reach_one(skeleton, 3, place, pose);
    EXPECT_NEAR(report.misses[0], 10.0, 1e-6);
    EXPECT_LT((place_of(skeleton, pose, 3) - 3.0 / 13.0 * place).norm(), 1e-3);
}

TEST(Reach, what_is_however_far_away_is_pointed_at)
{
    const Skeleton skeleton(joints_in_line(4));
    for (const double far : {1e3, 1e8, 1e17, 1e90})
    {
        SkeletonPose pose = skeleton.rest();
        const ReachReport report = reach_one(skeleton, 3, {0, far, 0}, pose);
        EXPECT_LT((place_of(skeleton, pose, 3) - Vector3d(0, 3, 0)).norm(), 1e-3) << far;
        EXPECT_NEAR(report.misses[0] / (far - 3.0), 1.0, 1e-9);
    }
}

TEST(Reach, hinges_turn_about_their_axes_alone_and_within_their_limits)
{
    std::vector<RestJoint> joints = joints_in_line(4);
    joints[1].limits.hinge = Vector3d::UnitZ();
    joints[1].limits.twist = {0.0, 2.4};
    std::mt19937 random(2);
    std::normal_distribution<double> number;
    const Skeleton skeleton(joints);
    for (int k = 0; k < 100; ++k)
    {
        Vector3d place(number(random), number(random), number(random));
        place *= 2.5 / place.norm();
        SkeletonPose pose = skeleton.rest();
        const ReachReport report = reach_one(skeleton, 3, place, pose);
        EXPECT_LT(pose.turns[1].vec().head<2>().norm(), 1e-12);
        const double angle = twist_angle(pose.turns[1], Vector3d::UnitZ());
        EXPECT_GE(angle, -1e-9);
        EXPECT_LE(angle, 2.4 + 1e-9);
        EXPECT_LT(report.misses[0], 1e-9) << place;
    }
}

TEST(Reach, an_elbow_does_not_bend_the_wrong_way)
{
    std::vector<RestJoint> joints = joints_in_line(3);
    joints[1].limits.hinge = Vector3d::UnitZ();
    joints[1].limits.twist = {0.0, 2.5};
    const Skeleton skeleton(joints);
    SkeletonPose pose = skeleton.rest();
    const ReachReport report = reach_one(skeleton, 2, {1.2, 0.0, 0.0}, pose);
    EXPECT_LT(report.misses[0], 1e-10);
    EXPECT_GT(twist_angle(pose.turns[1], Vector3d::UnitZ()), 0.5);
    // The other way round.
    joints[1].limits.twist = {-2.5, 0.0};
    const Skeleton other(joints);
    pose = other.rest();
    EXPECT_LT(reach_one(other, 2, {1.2, 0.0, 0.0}, pose).misses[0], 1e-10);
    EXPECT_LT(twist_angle(pose.turns[1], Vector3d::UnitZ()), -0.5);
}

TEST(Reach, limits_that_forbid_a_place_leave_the_arm_as_near_as_it_gets)
{
    std::vector<RestJoint> joints = joints_in_line(3);
    for (std::size_t j = 0; j < 2; ++j)
    {
        joints[j].limits.hinge = Vector3d::UnitZ();
        joints[j].limits.twist = {0.0, 0.5};
    }
    const Skeleton skeleton(joints);
    SkeletonPose pose = skeleton.rest();
    reach_one(skeleton, 2, {-1, 1, 0}, pose);
    // Both at their ends.
    EXPECT_NEAR(twist_angle(pose.turns[0], Vector3d::UnitZ()), 0.5, 1e-6);
    EXPECT_NEAR(twist_angle(pose.turns[1], Vector3d::UnitZ()), 0.5, 1e-6);
}

TEST(Reach, several_places_are_reached_together)
{
    const Skeleton skeleton({{"root", -1, {0, 0, 0}},
                             {"chest", 0, {0, 1, 0}},
                             {"left", 1, {0.3, 1.2, 0}},
                             {"elbow", 2, {1.0, 1.2, 0}},
                             {"hand", 3, {1.7, 1.2, 0}},
                             {"right", 1, {-0.3, 1.2, 0}},
                             {"elbow2", 5, {-1.0, 1.2, 0}},
                             {"hand2", 6, {-1.7, 1.2, 0}}});
    SkeletonPose pose = skeleton.rest();
    const std::vector<ReachTarget> targets = {{4, {1.2, 1.7, 0.4}, {0, 1, 2, 3}},
                                              {7, {0.1, 1.9, 0.6}, {0, 1, 5, 6}}};
    const ReachReport report = reach(skeleton, targets, pose);
    EXPECT_LT(report.misses[0], 1e-10);
    EXPECT_LT(report.misses[1], 1e-10);
}

TEST(Reach, the_usual_chain_ends_below_the_next_branch)
{
    const Skeleton skeleton({{"root", -1, {0, 0, 0}},
                             {"chest", 0, {0, 1, 0}},
                             {"left", 1, {0.3, 1.2, 0}},
                             {"elbow", 2, {1.0, 1.2, 0}},
                             {"hand", 3, {1.7, 1.2, 0}},
                             {"right", 1, {-0.3, 1.2, 0}}});
    EXPECT_EQ(usual_chain(skeleton, 4), (std::vector<int>{2, 3}));
    EXPECT_EQ(usual_chain(skeleton, 1), (std::vector<int>{0}));
    EXPECT_EQ(usual_chain(skeleton, 2), (std::vector<int>{1}));
    EXPECT_TRUE(usual_chain(skeleton, 0).empty());
}

TEST(Reach, the_same_question_has_the_same_answer_to_the_bit)
{
    const Skeleton skeleton(joints_in_line(6));
    SkeletonPose a = skeleton.rest(), b = a;
    reach_one(skeleton, 5, {1, 2, 3}, a);
    reach_one(skeleton, 5, {1, 2, 3}, b);
    for (std::size_t j = 0; j < skeleton.size(); ++j)
        EXPECT_EQ(a.turns[j].coeffs(), b.turns[j].coeffs());
}

} // namespace cellwarp::core
