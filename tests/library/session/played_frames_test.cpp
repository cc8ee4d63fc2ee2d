// SPDX-License-Identifier: GPL-3.0-or-later
// The motion of skeletons in time: frames of handle files, and places that joints reach.
#include "library/session/played_frames.h"

#include <cmath>

#include <gtest/gtest.h>

#include "library/session/scene_script.h"
#include "library/session/skeleton_handle.h"
#include "octree/base/index.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::error_of;

namespace
{

using Eigen::Vector3d;

/// An arm of three bones along x with a branch at its root. Parents first they are root,
/// a, leg, b, foot, hand.
SceneFile arm(const std::string& more, const std::string& limits = "")
{
    return parse_scene("s.json", R"({"cellwarp": 1, "model": "bar.obj",
        "skeleton": {"joints": [{"name": "root", "parent": null, "at": [0, 0, 0]},
            {"name": "a", "parent": "root", "at": [0.5, 0, 0]},
            {"name": "b", "parent": "a", "at": [1.5, 0, 0])" +
                                     limits + R"(},
            {"name": "hand", "parent": "b", "at": [2.5, 0, 0]},
            {"name": "leg", "parent": "root", "at": [0, -0.2, 0]},
            {"name": "foot", "parent": "leg", "at": [0, -1, 0]}])" +
                                     more + R"(}, "simulate": {"duration": 1}})");
}

Geometry box()
{
    Geometry geometry;
    geometry.samples = {{0, 0, 0}, {2.5, 0, 0}, {0, -1, 1}};
    return geometry;
}

HandleFile frames_of(const SceneFile& scene, const std::string& text)
{
    return parse_handles("a.handles", "cellwarp-handles 1\n" + text,
                         scene.skeleton->joints);
}

SkeletonValues values_of(const SceneFile& scene, const std::string& text = "")
{
    return played_skeleton(scene, text.empty() ? HandleFile() : frames_of(scene, text),
                           box());
}

/// The places of all joints after the moves of a time.
std::vector<Vector3d> places(const SkeletonValues& values, const KeyedJoints& joints,
                             double time)
{
    const Units units{WorkFrame(), false, bounding_box(box().samples), 0.0};
    const SkeletonHandle handle(values.joints, units, "");
    const std::vector<Move> moves = joints.moves_at(time);
    std::vector<const Move*> pointers;
    for (const Move& move : moves)
        pointers.push_back(&move);
    const SkeletonAim aim = handle.moved(handle.rest(), pointers, units);
    EXPECT_EQ(aim.limited, 0) << time;
    const std::vector<Motion> motions = handle.motions(aim, aim, 1.0);
    std::vector<Vector3d> out;
    for (std::size_t j = 0; j < handle.size(); ++j)
        out.push_back(motions[j](handle.place(j)));
    return out;
}

double step_of(const std::vector<Vector3d>& a, const std::vector<Vector3d>& b)
{
    double most = 0.0;
    for (std::size_t j = 0; j < a.size(); ++j)
        most = std::max(most, (a[j] - b[j]).norm());
    return most;
}

const std::string kReach = R"(, "keys": [
    {"time": 0, "joint": "hand", "to": [2.3, 0.5, 0]},
    {"time": 1, "joint": "hand", "to": [0.7, 1.2, 0.4]}])";

} // namespace

TEST(KeyedReach, a_joint_is_at_its_place_at_all_times_and_bones_keep_their_lengths)
{
    const SkeletonValues values = values_of(arm(kReach));
    const KeyedJoints joints(values);
    EXPECT_TRUE(joints.warnings("s.json").empty());
    std::vector<Vector3d> last = places(values, joints, -1.0);
    for (int k = 0; k <= 997; ++k)
    {
        const double time = k / 997.0;
        const std::vector<Vector3d> now = places(values, joints, time);
        const Vector3d wanted = Vector3d(2.3, 0.5, 0) + time * Vector3d(-1.6, 0.7, 0.4);
        EXPECT_LT((now[5] - wanted).norm(), 1e-10) << time;
        EXPECT_NEAR((now[3] - now[1]).norm(), 1.0, 1e-12);
        EXPECT_NEAR((now[5] - now[3]).norm(), 1.0, 1e-12);
        EXPECT_LT((now[1] - Vector3d(0.5, 0, 0)).norm(), 1e-15); // where limbs branch
        EXPECT_EQ(now[4], Vector3d(0, -1, 0));
        // It goes on without a jump.
        EXPECT_LT(step_of(now, last), 0.01) << time;
        last = now;
    }
    EXPECT_EQ(places(values, joints, 7.0), places(values, joints, 1.0));
}

TEST(KeyedReach, what_is_asked_for_before_and_how_often_changes_nothing)
{
    const SkeletonValues values = values_of(arm(kReach));
    const KeyedJoints one(values), other(values);
    for (const double time : {0.9, 0.1, 0.5})
        places(values, other, time);
    for (const double time : {0.0, 0.3, 0.500001, 1.0})
        EXPECT_EQ(places(values, one, time), places(values, other, time));
    // Frames of deform have the same poses, whatever is between them.
    SceneFile scene = arm(kReach);
    std::vector<std::string> warnings;
    scene.skeleton->every = 0.125;
    const HandleFile script = script_of(scene, "", warnings).value();
    ASSERT_EQ(script.stages[0].frames.size(), 9u);
    const std::vector<Move> moves = one.moves_at(0.375);
    const std::vector<Move>& own = script.stages[0].frames[3].moves;
    ASSERT_EQ(own.size(), moves.size());
    for (std::size_t k = 0; k < own.size(); ++k)
        EXPECT_EQ(own[k].operations[0].move.degrees, moves[k].operations[0].move.degrees);
}

TEST(KeyedReach, a_straight_arm_that_is_pulled_in_bends_without_a_jump)
{
    const SkeletonValues values = values_of(arm(R"(, "keys": [
        {"time": 0, "joint": "hand", "to": [2.5, 0, 0]},
        {"time": 1, "joint": "hand", "to": [1.5, 0, 0]}])"));
    const KeyedJoints joints(values);
    std::vector<Vector3d> last = places(values, joints, 0.0);
    EXPECT_LT((last[3] - Vector3d(1.5, 0, 0)).norm(), 1e-9);
    Vector3d side = Vector3d::Zero();
    for (int k = 1; k <= 2000; ++k)
    {
        const std::vector<Vector3d> now = places(values, joints, k / 2000.0);
        EXPECT_LT((now[5] - Vector3d(2.5 - k / 2000.0, 0, 0)).norm(), 1e-9) << k;
        // The bend grows with the root of the way, and always to the same side.
        const Vector3d bent = now[3] - Vector3d(now[3].x(), 0, 0);
        if (k == 1)
            side = bent.normalized();
        EXPECT_LT((bent.normalized() - side).norm(), 1e-3) << k;
        EXPECT_NEAR(bent.norm(), std::sqrt(1.0 - std::pow(1.0 - k / 4000.0, 2)), 1e-9);
        last = now;
    }
}

TEST(KeyedReach, joints_with_keys_do_as_these_say_and_limits_hold)
{
    // The hand is pulled while the root rises, and the joint above the elbow has keys.
    const SkeletonValues values =
        values_of(arm(R"(, "keys": [
        {"time": 0, "joint": "root", "translate": [0, 0, 0]},
        {"time": 1, "joint": "root", "translate": [0, 0.5, 0]},
        {"time": 0, "joint": "a", "rotate": [0, 0, 1, 0]},
        {"time": 1, "joint": "a", "rotate": [0, 0, 1, 30]},
        {"time": 0, "joint": "foot", "to": [0.1, -0.9, 0]},
        {"time": 0, "joint": "hand", "to": [2, 1, 0], "from": "root"}])",
                      R"(, "limits": {"hinge": [0, 0, 1], "twist": [0, 20]})"));
    const KeyedJoints joints(values);
    // All chains have an end at a joint with keys, so places are missed, and pointed at.
    const std::vector<std::string> warnings = joints.warnings("s.json");
    ASSERT_FALSE(warnings.empty());
    EXPECT_TRUE(contains(warnings[0], "s.json: skeleton.keys[")) << warnings[0];
    EXPECT_TRUE(contains(warnings[0], "of the skeleton's size from its place"));
    for (const double time : {0.0, 0.25, 1.0})
    {
        const std::vector<JointMotion> motions = joints.motions_at(time);
        EXPECT_NEAR(2.0 * std::atan2(motions[1].turn.z(), motions[1].turn.w()),
                    time * 30.0 * M_PI / 180.0, 1e-12);
        const double bend =
            2.0 * std::atan2(motions[3].turn.z(), motions[3].turn.w()) * 180.0 / M_PI;
        EXPECT_GE(bend, -1e-9);
        EXPECT_LE(bend, 20.0 + 1e-9);
        EXPECT_EQ(motions[0].shift, Vector3d(0, 0.5 * time, 0));
    }
}

TEST(KeyedReach, several_joints_reach_their_places_together)
{
    const SkeletonValues values = values_of(arm(R"(, "keys": [
        {"time": 0, "joint": "root", "translate": [0, 0, 0]},
        {"time": 1, "joint": "root", "translate": [0.05, 0.05, 0]},
        {"time": 0, "joint": "foot", "to": [0.2, -0.85, 0], "from": "root"},
        {"time": 0, "joint": "hand", "to": [1.5, 1.1, 0]},
        {"time": 1, "joint": "hand", "to": [1.4, 1.2, 0.2]}])"));
    const KeyedJoints joints(values);
    EXPECT_TRUE(joints.warnings("s.json").empty());
    for (const double time : {0.0, 0.21, 0.63, 1.0})
    {
        const std::vector<Vector3d> now = places(values, joints, time);
        EXPECT_LT((now[4] - Vector3d(0.2, -0.85, 0)).norm(), 1e-9);
        EXPECT_LT(
            (now[5] - (Vector3d(1.5, 1.1, 0) + time * Vector3d(-0.1, 0.1, 0.2))).norm(),
            1e-9);
    }
}

TEST(PlayedFrames, frames_are_the_poses_of_deform_at_their_times)
{
    const SceneFile scene = arm(R"(, "every": 0.1)");
    const std::string text = "frame 1\nmove hand to 1.2 1 0\nframe 3\n"
                             "move a rotate 0 0 1 50\nmove root translate 0 0 0.3\n"
                             "frame 6\nmove hand to 1.3 1.1 0\nframe 7\nrelease hand\n"
                             "move b rotate 0 1 0 10\n";
    const SkeletonValues values = values_of(scene, text);
    const KeyedJoints joints(values);
    const Units units{WorkFrame(), false, bounding_box(box().samples), 0.0};
    const SkeletonHandle handle(values.joints, units, "");
    SkeletonAim aim = handle.rest();
    EXPECT_EQ(places(values, joints, 0.0)[5], Vector3d(2.5, 0, 0)); // rest
    const HandleFile handles = frames_of(scene, text);
    for (const FrameStatement& frame : handles.stages[0].frames)
    {
        std::vector<const Move*> moves;
        for (const Move& move : frame.moves)
            moves.push_back(&move);
        aim = handle.moved(aim, moves, units);
        const std::vector<Motion> motions = handle.motions(aim, aim, 1.0);
        const std::vector<Vector3d> now =
            places(values, joints, 0.1 * static_cast<double>(frame.number));
        for (std::size_t j = 0; j < now.size(); ++j)
            EXPECT_LT((now[j] - motions[j](handle.place(j))).norm(), 1e-12)
                << frame.number << " " << j;
    }
    EXPECT_LT(step_of(places(values, joints, 0.7), places(values, joints, 2.0)), 1e-12);
    // Between frames joints turn: bones keep their lengths, nothing jumps.
    std::vector<Vector3d> last = places(values, joints, 0.0);
    for (double time = 0.0; time < 0.8; time += 1e-3)
    {
        const std::vector<Vector3d> now = places(values, joints, time);
        EXPECT_NEAR((now[5] - now[3]).norm(), 1.0, 1e-12);
        EXPECT_LT(step_of(now, last), 0.05) << time;
        last = now;
    }
}

TEST(PlayedFrames, what_two_frames_hold_at_one_place_stays_there_between_them)
{
    const SkeletonValues values = values_of(
        arm(R"(, "every": 0.5)"),
        "frame 0\nmove hand to 1.8 1 0\nframe 1\nmove root translate 0 0.4 0\n"
        "frame 2\nmove root translate 0.2 0 0\nframe 3\nmove hand to 2 0.5 0\n");
    const KeyedJoints joints(values);
    for (int k = 0; k <= 100; ++k)
    {
        const std::vector<Vector3d> now = places(values, joints, 0.01 * k);
        EXPECT_LT((now[5] - Vector3d(1.8, 1, 0)).norm(), 1e-10) << k;
    }
    EXPECT_GT((places(values, joints, 1.25)[5] - Vector3d(1.8, 1, 0)).norm(), 0.01);
    EXPECT_LT((places(values, joints, 1.5)[5] - Vector3d(2, 0.5, 0)).norm(), 1e-10);
}

TEST(PlayedFrames, without_a_time_of_its_own_a_frame_is_one_of_the_film)
{
    const std::string text = "frame 5\nmove a rotate 0 0 1 50\n";
    const SkeletonValues film = values_of(arm(""), text);
    ASSERT_EQ(film.turns.size(), 1u);
    EXPECT_EQ(film.turns[0].step, KeyStep::Smooth);
    EXPECT_EQ(film.turns[0].times[0], 0.0);
    EXPECT_NEAR(film.turns[0].times[1], 5.0 / 30.0, 1e-12);
    EXPECT_EQ(values_of(arm(R"(, "interpolation": "slerp")"), text).turns[0].step,
              KeyStep::Linear);
}

TEST(PlayedFrames, what_cannot_be_played_is_refused_with_its_line)
{
    const auto refusal = [](const std::string& text)
    { return error_of(Fault::Malformed, [&] { values_of(arm(""), text); }); };
    EXPECT_TRUE(contains(refusal("fixed base all\nframe 1\n"),
                         "a.handles:2: base: a region (fixed) cannot be played"));
    EXPECT_TRUE(contains(
        refusal("\nrod r through 0 0 0 1 0 0\nframe 1\nmove r translate 0 1 0\n"),
        "a.handles:3: r: a region (rod) cannot be played"));
    EXPECT_TRUE(contains(refusal("stiff s box 0 0 0 1 1 1 20\n"),
                         "a.handles:2: s: a region (stiff) cannot be played"));
    EXPECT_TRUE(contains(refusal("joint more at 3 0 0 parent hand\nframe 1\n"),
                         "a.handles:2: more: is no joint of the scene's skeleton"));
    EXPECT_TRUE(
        contains(refusal("frame 1\nmove a rotate 0 0 1 5\ncommit\n"
                         "joint z at 0 0 0\njoint y at 0 0 1 parent z\nframe 2\n"),
                 "a.handles:5: commit: cannot be played"));
}

TEST(PlayedFrames, places_out_of_reach_and_cut_turns_are_warnings)
{
    const SkeletonValues values =
        values_of(arm("", R"(, "limits": {"hinge": [0, 0, 1], "twist": [0, 20]})"),
                  "frame 1\nmove b rotate 0 0 1 50\nframe 2\nmove hand to 9 0 0\n");
    ASSERT_EQ(values.warnings.size(), 2u);
    EXPECT_TRUE(
        contains(values.warnings[0], "a.handles:2: frame 1: 1 turns of joints are cut"));
    EXPECT_TRUE(contains(values.warnings[1], "a.handles:4: hand: frame 2: ends"));
}

} // namespace cellwarp::core
