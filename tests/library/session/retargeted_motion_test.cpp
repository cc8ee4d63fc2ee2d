// SPDX-License-Identifier: GPL-3.0-or-later
// Motions of one skeleton on another: matched by names, or by the shape of the trees.
#include "library/session/retargeted_motion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "library/session/matched_joints.h"
#include "library/session/skeleton_handle.h"
#include "octree/base/index.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Quaterniond;
using Eigen::Vector3d;
using support::contains;
using support::error_of;

constexpr double kDegree = std::numbers::pi / 180.0;

SkeletonJoint joint(const std::string& name, const std::string& parent,
                    const Vector3d& at)
{
    SkeletonJoint out;
    out.name = name;
    out.parent = parent;
    out.at = at;
    return out;
}

/// As a capture has it: hips at the root, spine, collar bones, hands with two fingers;
/// arms that point down by an angle. Two units high.
SkeletonValues captured(double arms)
{
    SkeletonValues out;
    out.joints = {
        joint("Hips", "", {0, 1, 0}),         joint("Spine", "Hips", {0, 1.2, 0}),
        joint("Chest", "Spine", {0, 1.5, 0}), joint("Neck", "Chest", {0, 1.65, 0}),
        joint("Head", "Neck", {0, 1.75, 0}),  joint("Head.end", "Head", {0, 2, 0})};
    for (const double side : {1.0, -1.0})
    {
        const std::string of = side > 0 ? "Left" : "Right";
        const Vector3d shoulder(0.2 * side, 1.5, 0),
            along(side * std::cos(arms * kDegree), -std::sin(arms * kDegree), 0);
        const auto add =
            [&](const std::string& name, const std::string& parent, const Vector3d& at)
        {
            out.joints.push_back(
                joint(of + name,
                      parent == "Chest" || parent == "Hips" ? parent : of + parent, at));
        };
        add("Collar", "Chest", {0.05 * side, 1.5, 0});
        add("Arm", "Collar", shoulder);
        add("ForeArm", "Arm", shoulder + 0.3 * along);
        add("Hand", "ForeArm", shoulder + 0.6 * along);
        add("Finger", "Hand", shoulder + 0.7 * along);
        add("Thumb", "Hand", shoulder + 0.65 * along + Vector3d(0, 0, 0.04));
        add("UpLeg", "Hips", {0.1 * side, 0.95, 0});
        add("Leg", "UpLeg", {0.1 * side, 0.5, 0});
        add("Foot", "Leg", {0.1 * side, 0.08, 0});
        add("Toe", "Foot", {0.1 * side, 0, 0.15});
    }
    return out;
}

/// As `cellwarp skeleton` finds it: the root in the chest, one joint a knee, no wrist;
/// arms that point down by an angle; half as high, looking along z turned by quarters
/// about y.
SkeletonValues found(double arms, int quarters)
{
    SkeletonValues out;
    out.joints = {joint("root", "", {0, 0.78, 0}), joint("pelvis", "root", {0, 0.5, 0}),
                  joint("head", "root", {0, 1, 0})};
    for (const double side : {1.0, -1.0})
    {
        const std::string of = side > 0 ? ".L" : ".R";
        const Vector3d shoulder(0.11 * side, 0.77, 0),
            along(side * std::cos(arms * kDegree), -std::sin(arms * kDegree), 0);
        out.joints.push_back(joint("arm.1" + of, "root", shoulder));
        out.joints.push_back(joint("arm.2" + of, "arm.1" + of, shoulder + 0.16 * along));
        out.joints.push_back(joint("arm.3" + of, "arm.2" + of, shoulder + 0.36 * along));
        out.joints.push_back(joint("leg.1" + of, "pelvis", {0.06 * side, 0.46, 0}));
        out.joints.push_back(joint("leg.2" + of, "leg.1" + of, {0.07 * side, 0.25, 0}));
        out.joints.push_back(joint("leg.3" + of, "leg.2" + of, {0.08 * side, 0.04, 0}));
        out.joints.push_back(joint("leg.4" + of, "leg.3" + of, {0.08 * side, 0, 0.07}));
    }
    const Eigen::AngleAxisd turn(0.5 * quarters * std::numbers::pi, Vector3d::UnitY());
    for (SkeletonJoint& one : out.joints)
        one.at = turn * one.at;
    return out;
}

/// Three keys of seeded turns of all joints with bones, and a way of the root.
void move(SkeletonValues& skeleton, unsigned seed)
{
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> share(-1.0, 1.0);
    const std::vector<double> times = {0.0, 0.5, 1.0};
    for (std::size_t j = 0; j < skeleton.joints.size(); ++j)
    {
        TurnTrack track{j, KeyStep::Linear, times, {}};
        for (std::size_t k = 0; k < times.size(); ++k)
            track.values.push_back(
                Quaterniond(Eigen::AngleAxisd(
                                0.6 * share(random),
                                Vector3d(share(random), share(random), share(random))
                                    .normalized()))
                    .coeffs());
        skeleton.turns.push_back(track);
    }
    skeleton.shifts.push_back(
        {0, KeyStep::Linear, times, {{3, 1, 0}, {3, 1.1, 0.4}, {3.2, 1, 0.8}}});
}

std::vector<Vector3d> places(const SkeletonValues& skeleton, double time)
{
    const std::vector<int> parents = parents_of(skeleton.joints);
    const std::vector<JointMotion> motions = KeyedJoints(skeleton).motions_at(time);
    std::vector<Vector3d> out;
    std::vector<Quaterniond> turns;
    for (std::size_t j = 0; j < parents.size(); ++j)
    {
        const bool is_root = parents[j] < 0;
        const Vector3d& at = skeleton.joints[j].at;
        const Quaterniond before =
            is_root ? Quaterniond::Identity() : turns[idx(parents[j])];
        out.push_back(is_root
                          ? Vector3d(at + motions[j].shift)
                          : Vector3d(out[idx(parents[j])] +
                                     before * (at - skeleton.joints[idx(parents[j])].at +
                                               motions[j].shift)));
        turns.push_back(before * motions[j].turn);
    }
    return out;
}

std::size_t number(const SkeletonValues& skeleton, const std::string& name)
{
    for (std::size_t j = 0; j < skeleton.joints.size(); ++j)
        if (skeleton.joints[j].name == name)
            return j;
    ADD_FAILURE() << name;
    return 0;
}

Vector3d direction(const SkeletonValues& skeleton, double time, const std::string& from,
                   const std::string& to)
{
    const std::vector<Vector3d> at = places(skeleton, time);
    return (at[number(skeleton, to)] - at[number(skeleton, from)]).normalized();
}

std::string counterpart(const SkeletonValues& skeleton, const SkeletonValues& source,
                        const std::string& name)
{
    const int other =
        matched_joints(skeleton.joints, source.joints).of_other[number(skeleton, name)];
    return other < 0 ? "" : source.joints[idx(other)].name;
}

} // namespace

TEST(RetargetedMotion, trees_are_matched_by_their_shape_whatever_they_do_at_rest)
{
    for (const double arms : {0.0, 45.0})
        for (const double other : {0.0, 30.0})
        {
            const SkeletonValues own = found(arms, 0), source = captured(other);
            EXPECT_EQ(counterpart(own, source, "root"), "Chest");
            EXPECT_EQ(counterpart(own, source, "pelvis"), "Hips");
            EXPECT_EQ(counterpart(own, source, "arm.1.L"), "LeftArm");
            EXPECT_EQ(counterpart(own, source, "arm.2.R"), "RightForeArm");
            EXPECT_EQ(counterpart(own, source, "arm.3.R"), "RightFinger");
            EXPECT_EQ(counterpart(own, source, "leg.1.L"), "LeftUpLeg");
            EXPECT_EQ(counterpart(own, source, "leg.2.L"), "LeftLeg");
            EXPECT_EQ(counterpart(own, source, "leg.3.L"), "LeftFoot");
            EXPECT_EQ(counterpart(own, source, "head"), "Head.end");
        }
}

TEST(RetargetedMotion, bones_point_where_those_of_the_source_point)
{
    for (const int quarters : {0, 1, 2, 3})
        for (const unsigned seed : {1u, 2u})
        {
            SkeletonValues own = found(20.0, quarters), source = captured(50.0);
            move(source, seed);
            retarget(source, {}, "s.json", own);
            const Eigen::AngleAxisd turn(0.5 * quarters * std::numbers::pi,
                                         Vector3d::UnitY());
            for (const double time : {0.0, 0.5, 1.0})
                for (const auto& [from, to, its, end] :
                     {std::array{"arm.1.L", "arm.2.L", "LeftArm", "LeftForeArm"},
                      {"arm.2.R", "arm.3.R", "RightForeArm", "RightHand"},
                      {"leg.1.L", "leg.2.L", "LeftUpLeg", "LeftLeg"},
                      {"leg.2.R", "leg.3.R", "RightLeg", "RightFoot"},
                      {"leg.3.R", "leg.4.R", "RightFoot", "RightToe"}})
                    EXPECT_LT((direction(own, time, from, to) -
                               turn * direction(source, time, its, end))
                                  .norm(),
                              1e-9)
                        << quarters << " " << time << " " << from;
        }
}

TEST(RetargetedMotion, the_way_is_scaled_by_the_legs_and_begins_above_the_own_place)
{
    SkeletonValues own = found(0.0, 0), source = captured(0.0);
    source.shifts.push_back(
        {0, KeyStep::Linear, {0.0, 1.0}, {{7, 0, 3}, {7.4, 0.2, 3.8}}});
    retarget(source, {}, "s.json", own);
    const std::size_t pelvis = number(own, "pelvis");
    const Vector3d first = places(own, 0.0)[pelvis], last = places(own, 1.0)[pelvis];
    EXPECT_LT((first - own.joints[pelvis].at).norm(), 1e-9);
    EXPECT_LT((last - first - 0.5 * Vector3d(0.4, 0.2, 0.8)).norm(), 1e-9);
    // The same capture whose rest pose has its hips at 0.
    SkeletonValues low = captured(0.0), other = found(0.0, 0);
    for (SkeletonJoint& one : low.joints)
        one.at.y() -= 1.0;
    low.shifts.push_back({0, KeyStep::Linear, {0.0, 1.0}, {{7, 1, 3}, {7.4, 1.2, 3.8}}});
    retarget(low, {}, "s.json", other);
    EXPECT_LT((places(other, 1.0)[pelvis] - last).norm(), 1e-9);
}

TEST(RetargetedMotion, joints_of_the_same_names_move_as_they_did)
{
    SkeletonValues source = captured(10.0);
    move(source, 3);
    SkeletonValues own = captured(10.0);
    for (SkeletonJoint& one : own.joints)
    {
        one.name = "rig:" + one.name;
        if (!one.parent.empty())
            one.parent = "rig:" + one.parent;
    }
    retarget(source, {}, "s.json", own);
    for (const double time : {0.0, 0.5, 1.0})
    {
        const std::vector<Vector3d> one = places(own, time), other = places(source, time);
        for (std::size_t j = 1; j < one.size(); ++j)
            EXPECT_LT(((one[j] - one[0]) - (other[j] - other[0])).norm(), 1e-9)
                << own.joints[j].name;
    }
}

TEST(RetargetedMotion, a_map_counts_before_what_is_found)
{
    SkeletonValues own = found(0.0, 0), source = captured(0.0);
    move(source, 4);
    MotionStatement motion;
    motion.file = "walk.bvh";
    motion.map = {{"arm.1.L", "LeftUpLeg"}, {"arm.2.L", "LeftLeg"}, {"leg.1.L", ""}};
    motion.map.push_back({"arm.3.L", "LeftFoot"});
    retarget(source, motion, "s.json", own);
    EXPECT_LT((direction(own, 0.5, "arm.1.L", "arm.2.L") -
               direction(source, 0.5, "LeftUpLeg", "LeftLeg"))
                  .norm(),
              1e-9);
    for (const TurnTrack& track : own.turns)
        EXPECT_NE(own.joints[track.joint].name, "leg.1.L");
    ASSERT_EQ(own.warnings.size(), 1u);
    EXPECT_TRUE(contains(own.warnings[0], "nothing moves the joints leg.1.L,"))
        << own.warnings[0];
    motion.map = {{"arm", "LeftUpLeg"}};
    EXPECT_TRUE(contains(
        error_of(Fault::Malformed, [&] { retarget(source, motion, "s.json", own); }),
        "'arm' is no joint of the skeleton"));
    motion.map = {{"arm.1.L", "Wing"}};
    EXPECT_TRUE(contains(
        error_of(Fault::Malformed, [&] { retarget(source, motion, "s.json", own); }),
        "'Wing' is no joint of 'walk.bvh'"));
}

} // namespace cellwarp::core
