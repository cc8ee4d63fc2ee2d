// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/scene/skeleton_file.h"

#include <cmath>
#include <cstdlib>
#include <numbers>

#include <Eigen/Geometry>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "io/base/base64.h"
#include "io/base/number.h"
#include "io/formats/stored_number.h"
#include "tests/support/files.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::error_of;

namespace
{

using Eigen::AngleAxisd;
using Eigen::Quaterniond;
using Eigen::Vector3d;
using Json = nlohmann::ordered_json;

constexpr double kPi = std::numbers::pi;

const std::string kArm = "1 0 0 0\n2 1 0 0\n3 1 1 0\n#\n1 2 1 0 0\n2 3 1 0 0\n";

const std::string kWalk = R"(HIERARCHY
ROOT Hips
{
  OFFSET 0 10 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Left Leg
  {
    OFFSET 1 -1 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0 -4 0
    }
  }
  JOINT RightLeg {
    OFFSET -1 -1 0
    CHANNELS 6 Xposition Yposition Zposition Yrotation Xrotation Zrotation
    End Site
    {
      OFFSET 0 -4 0
    }
  }
}
MOTION
Frames: 2
Frame Time: 0.5
0 0 0  0 0 0  0 0 0  -1 -1 0 0 0 0
1 2 3  90 0 0  10 20 30  -1 -1 0 10 20 30
)";

SkeletonValues tgf(const std::string& text, const SkeletonPlacement& placement = {})
{
    return parse_skeleton("arm.tgf", text, placement);
}

SkeletonValues bvh(const std::string& text, const SkeletonPlacement& placement = {})
{
    return parse_skeleton("walk.bvh", text, placement);
}

std::string refusal(const std::string& name, const std::string& text)
{
    return error_of(Fault::Malformed, [&] { parse_skeleton(name, text); });
}

Quaterniond turn_of(const Eigen::Vector4d& value)
{
    return Quaterniond(value);
}

Quaterniond about(int axis, double degrees)
{
    return Quaterniond(AngleAxisd(degrees * kPi / 180.0, Vector3d::Unit(axis)));
}

std::string base64(const std::string& bytes)
{
    std::string text(4 * ((bytes.size() + 2) / 3), 'A');
    for (std::size_t pad = 0; pad < (3 - bytes.size() % 3) % 3; ++pad)
        text[text.size() - 1 - pad] = '=';
    return base64_patched(text, std::string(bytes.size(), '\0'), bytes);
}

std::string floats(std::initializer_list<double> values)
{
    std::string bytes;
    for (const double value : values)
        store(value, Scalar::Float32, false, bytes);
    return bytes;
}

/// An armature node, scaled by 0.01, with two joints of a skin below it, turned at rest;
/// the second one is animated.
Json rig()
{
    // Joint 1 stands at (0, 100, 0) below the armature, turned by 90 degrees about z, and
    // joint 2 at (100, 0, 0) in its axes: (0, 1, 0) and (0, 2, 0) in the world.
    const double h = std::sqrt(0.5);
    const std::string matrices =
        floats({0, -100, 0, 0, 100, 0, 0, 0, 0, 0, 100, 0, -100, 0, 0, 1}) +
        floats({0, -100, 0, 0, 100, 0, 0, 0, 0, 0, 100, 0, -200, 0, 0, 1});
    const std::string times = floats({0, 1, 2});
    const std::string turns = floats({0, 0, 0, 1, 0, 0, h, h, 0, 0, 1, 0});
    const std::string all = matrices + times + turns;
    return {
        {"asset", {{"version", "2.0"}}},
        {"scene", 0},
        {"scenes", {{{"nodes", {0}}}}},
        {"nodes",
         {{{"name", "Armature"}, {"scale", {0.01, 0.01, 0.01}}, {"children", {1}}},
          {{"name", "one"},
           {"translation", {0, 100, 0}},
           {"rotation", {0, 0, h, h}},
           {"children", {2}}},
          {{"name", "two"}, {"translation", {100, 0, 0}}}}},
        {"skins", {{{"joints", {1, 2}}, {"inverseBindMatrices", 0}}}},
        {"animations",
         {{{"name", "bend"},
           {"samplers", {{{"input", 1}, {"output", 2}}}},
           {"channels",
            {{{"sampler", 0}, {"target", {{"node", 2}, {"path", "rotation"}}}}}}}}},
        {"accessors",
         {{{"bufferView", 0}, {"componentType", 5126}, {"count", 2}, {"type", "MAT4"}},
          {{"bufferView", 1}, {"componentType", 5126}, {"count", 3}, {"type", "SCALAR"}},
          {{"bufferView", 2}, {"componentType", 5126}, {"count", 3}, {"type", "VEC4"}}}},
        {"bufferViews",
         {{{"buffer", 0}, {"byteOffset", 0}, {"byteLength", 128}},
          {{"buffer", 0}, {"byteOffset", 128}, {"byteLength", 12}},
          {{"buffer", 0}, {"byteOffset", 140}, {"byteLength", 48}}}},
        {"buffers",
         {{{"byteLength", all.size()},
           {"uri", "data:application/octet-stream;base64," + base64(all)}}}}};
}

SkeletonValues gltf(const Json& json, const SkeletonPlacement& placement = {})
{
    return parse_skeleton("rig.gltf", json.dump(), placement);
}

std::string gltf_refusal(const Json& json)
{
    return error_of(Fault::Malformed, [&] { gltf(json); });
}

} // namespace

TEST(SkeletonFile, a_tgf_is_a_tree_of_bones_from_its_first_joint)
{
    const SkeletonValues arm = tgf(kArm);
    ASSERT_EQ(arm.joints.size(), 3u);
    EXPECT_EQ(arm.joints[0].name, "1");
    EXPECT_EQ(arm.joints[0].parent, "");
    EXPECT_EQ(arm.joints[2].parent, "2");
    EXPECT_EQ(arm.joints[2].at, Vector3d(1, 1, 0));
    EXPECT_TRUE(arm.turns.empty());
}

TEST(SkeletonFile, the_root_of_a_tgf_may_be_named)
{
    SkeletonPlacement placement;
    placement.root = "3";
    const SkeletonValues arm = tgf(kArm, placement);
    EXPECT_EQ(arm.joints[0].name, "3");
    EXPECT_EQ(arm.joints[1].name, "2");
    EXPECT_EQ(arm.joints[2].parent, "2");
    placement.root = "9";
    EXPECT_TRUE(contains(error_of(Fault::Malformed, [&] { tgf(kArm, placement); }),
                         "no joint '9'"));
}

TEST(SkeletonFile, only_edges_of_a_tgf_that_are_bones_count)
{
    // A cage edge would close a ring.
    EXPECT_EQ(tgf(kArm + "3 1 0 0 1\n").joints.size(), 3u);
    EXPECT_TRUE(contains(refusal("a.tgf", kArm + "3 1 1 0 0\n"), "is on a ring"));
    // Without flags all are.
    EXPECT_EQ(tgf("1 0 0 0\n2 1 0 0\n#\n1 2\n").joints.size(), 2u);
}

TEST(SkeletonFile, numbers_behind_the_place_of_a_tgf_joint_tell_nothing)
{
    EXPECT_EQ(tgf("1 0 0 0 3.9e-323 nan -inf garbage\n2 1 0 0\n#\n1 2\n").joints.size(),
              2u);
    const char* const folder = std::getenv("CELLWARP_TEST_DATA");
    if (!folder)
        GTEST_SKIP() << "CELLWARP_TEST_DATA names no folder of models";
    const SkeletonValues arm = read_skeleton(std::string(folder) + "/arm.tgf");
    ASSERT_EQ(arm.joints.size(), 5u);
    EXPECT_EQ(arm.joints[4].parent, "4");
    EXPECT_NEAR(arm.joints[3].at.x(), 0.5987815, 1e-12);
}

TEST(SkeletonFile, what_is_wrong_with_a_tgf_is_told_with_its_line)
{
    EXPECT_TRUE(contains(refusal("a.tgf", "1 0 0\n"), "a.tgf:1: place"));
    EXPECT_TRUE(contains(refusal("a.tgf", "1 0 0 x\n"), "got 'x'"));
    EXPECT_TRUE(contains(refusal("a.tgf", "1 0 0 inf\n"), "need a finite number"));
    EXPECT_TRUE(contains(refusal("a.tgf", "1 0 0 0\n1 1 0 0\n"), "a.tgf:2: joint: 1 is"));
    EXPECT_TRUE(contains(refusal("a.tgf", "1 0 0 0\n#\n1 7\n"), "no joint 7"));
    EXPECT_TRUE(contains(refusal("a.tgf", "1 0 0 0\n2 1 0 0\n#\n"), "no bone joins it"));
    EXPECT_TRUE(contains(refusal("a.tgf", "1 0 0 0\n2 0 0 0\n#\n1 2\n"), "no length"));
    EXPECT_TRUE(contains(refusal("a.tgf", "# \n"), "holds no joint"));
    EXPECT_TRUE(contains(refusal("a.tgf", ""), "holds no joint"));
}

TEST(SkeletonFile, a_tgf_comes_back_as_it_was_written)
{
    const SkeletonValues arm = tgf(kArm);
    EXPECT_EQ(tgf(tgf_text(arm.joints)).joints.size(), 3u);
    for (std::size_t k = 0; k < 3; ++k)
        EXPECT_EQ(tgf(tgf_text(arm.joints)).joints[k].at, arm.joints[k].at);
}

TEST(SkeletonFile, a_bvh_has_joints_where_its_offsets_add_up)
{
    const SkeletonValues walk = bvh(kWalk);
    ASSERT_EQ(walk.joints.size(), 5u);
    EXPECT_EQ(walk.joints[0].name, "Hips");
    EXPECT_EQ(walk.joints[1].name, "Left Leg");
    EXPECT_EQ(walk.joints[2].name, "Left Leg.end");
    EXPECT_EQ(walk.joints[2].at, Vector3d(1, 5, 0));
    EXPECT_EQ(walk.joints[4].parent, "RightLeg");
}

TEST(SkeletonFile, channels_of_a_bvh_turn_in_their_order)
{
    const SkeletonValues walk = bvh(kWalk);
    ASSERT_EQ(walk.turns.size(), 3u);
    const auto turn = [&](std::size_t track)
    { return turn_of(walk.turns[track].values[1]); };
    EXPECT_EQ(walk.turns[0].times, (std::vector<double>{0.0, 0.5}));
    EXPECT_LT(turn(0).angularDistance(about(2, 90)), 1e-7);
    EXPECT_LT(turn(1).angularDistance(about(2, 10) * about(0, 20) * about(1, 30)), 1e-7);
    EXPECT_LT(turn(2).angularDistance(about(1, 10) * about(0, 20) * about(2, 30)), 1e-7);
}

TEST(SkeletonFile, positions_of_the_root_shift_it_and_repeated_offsets_tell_nothing)
{
    const SkeletonValues walk = bvh(kWalk);
    ASSERT_EQ(walk.shifts.size(), 1u);
    EXPECT_EQ(walk.shifts[0].joint, 0u);
    EXPECT_EQ(walk.shifts[0].values[1], Vector3d(1, 2, 3));
    std::string moved = kWalk;
    moved.replace(moved.rfind("-1 -1 0 10"), 7, "-1 -2 0");
    EXPECT_EQ(bvh(moved).shifts.size(), 2u);
}

TEST(SkeletonFile, scale_and_up_axis_turn_places_and_turns_alike)
{
    SkeletonPlacement placement;
    placement.scale = 0.5;
    placement.up = 'z';
    placement.shift = {100, 0, 0};
    const SkeletonValues walk = bvh(kWalk, placement);
    // z becomes y, y becomes -z.
    EXPECT_EQ(walk.joints[2].at, Vector3d(100.5, 0, -2.5));
    EXPECT_EQ(walk.shifts[0].values[1], Vector3d(0.5, 1.5, -1));
    EXPECT_LT(turn_of(walk.turns[0].values[1]).angularDistance(about(1, 90)), 1e-7);
    placement.up = 'x';
    EXPECT_EQ(bvh(kWalk, placement).joints[2].at, Vector3d(97.5, 0.5, 0));
}

TEST(SkeletonFile, what_is_wrong_with_a_bvh_is_told_with_its_line)
{
    const auto with = [](const std::string& old, const std::string& text)
    {
        std::string changed = kWalk;
        changed.replace(changed.find(old), old.size(), text);
        return refusal("walk.bvh", changed);
    };
    EXPECT_TRUE(contains(refusal("a.bvh", ""), "ends too early"));
    EXPECT_TRUE(contains(refusal("a.bvh", "SOMETHING\n"), "HIERARCHY"));
    EXPECT_TRUE(contains(with("OFFSET 0 10 0", "OFFSET 0 10"), "walk.bvh:4: OFFSET"));
    EXPECT_TRUE(contains(with("CHANNELS 6", "CHANNELS 5"), "walk.bvh:5: CHANNELS"));
    EXPECT_TRUE(contains(with("Zrotation", "Wrotation"), "got 'Wrotation'"));
    EXPECT_TRUE(contains(with("Zrotation", "Xposition"), "each once"));
    EXPECT_TRUE(contains(with("RightLeg", "Left Leg"), "is the name of two joints"));
    EXPECT_TRUE(contains(with("Frames: 2", "Frames: 4"), "promises 4 (got 2)"));
    EXPECT_TRUE(contains(with("Frames: 2", "Frames: 0"), "more follow"));
    EXPECT_TRUE(contains(with("Time: 0.5", "Time: 0"), "need > 0"));
    EXPECT_TRUE(contains(with("1 2 3  90", "1 2 3"), "need 15 numbers (got 14)"));
    EXPECT_TRUE(contains(with("1 2 3  90", "1 2 nan 90"), "got 'nan'"));
    EXPECT_TRUE(contains(with("MOTION", "ROOT Other"), "is a second root"));
}

TEST(SkeletonFile, no_part_of_a_bvh_may_be_missing)
{
    const auto tells =
        [](const std::string& part, const std::string& instead, const std::string& what)
    {
        std::string text = kWalk;
        text.replace(text.find(part), part.size(), instead);
        const std::string said = refusal("walk.bvh", text);
        EXPECT_TRUE(contains(said, what)) << part << ": " << said;
    };
    tells("ROOT Hips", "Hips", "ROOT: is missing");
    tells("    }\n  }\n  JOINT", "    } x\n  }\n  JOINT", "}: one word too many");
    tells("End Site", "Last Site", "got 'Last', need JOINT, End Site or }");
    tells("JOINT Left Leg", "JOINT", "JOINT: has no name");
    tells("Frames: 2", "Frames 2", "Frames: is missing");
    tells("Frames: 2", "Frames: -2", "Frames: got '-2', need a count");
    tells("Frame Time: 0.5", "Frame 0.5", "Frame Time: is missing");
    SkeletonPlacement far;
    far.scale = 1e100;
    EXPECT_TRUE(contains(error_of(Fault::Malformed, [&] { bvh(kWalk, far); }),
                         "is beyond 1e100"));
}

TEST(SkeletonFile, has_ten_thousand_joints_at_the_most)
{
    std::string points, bones, tree = "HIERARCHY\nROOT r\n{\nOFFSET 0 0 0\n", ends;
    for (int k = 1; k <= 10001; ++k)
    {
        points += std::to_string(k) + " " + std::to_string(k) + " 0 0\n";
        tree += "JOINT j" + std::to_string(k) + "\n{\nOFFSET 1 0 0\n";
    }
    EXPECT_TRUE(contains(refusal("a.tgf", points + "#\n"), "more than 10000 joints"));
    EXPECT_TRUE(contains(refusal("a.bvh", tree), "more than 10000 joints"));
    EXPECT_TRUE(contains(refusal("a.tgf", "1 0 0 0\n2 1 0 0\n#\n1\n"), "is missing"));
    EXPECT_TRUE(contains(refusal("a.tgf", "1 0 0 0\n2 1 0 0\n#\n1 x\n"),
                         "got 'x', need an integer"));
    EXPECT_TRUE(contains(refusal("a.tgf", "PK\x03\x04"),
                         "looks like a ZIP archive, need a skeleton"));
}

TEST(SkeletonFile, a_bvh_may_miscount_its_frames_by_one)
{
    const SkeletonValues two = bvh(kWalk);
    for (const char* count : {"Frames: 1", "Frames: 3"})
    {
        std::string changed = kWalk;
        changed.replace(changed.find("Frames: 2"), 9, count);
        const SkeletonValues walk = bvh(changed);
        ASSERT_EQ(walk.turns.size(), two.turns.size());
        for (std::size_t i = 0; i < two.turns.size(); ++i)
            EXPECT_EQ(walk.turns[i].times, two.turns[i].times) << count;
        ASSERT_EQ(walk.warnings.size(), two.warnings.size() + 1);
        EXPECT_TRUE(
            contains(walk.warnings.back(), "the file has 2: all of these are read"));
    }
}

TEST(SkeletonFile, a_bvh_without_frames_is_a_skeleton_at_rest)
{
    std::string still = kWalk.substr(0, kWalk.find("Frames:"));
    const SkeletonValues walk = bvh(still + "Frames: 0\nFrame Time: 0.1\n");
    EXPECT_EQ(walk.joints.size(), 5u);
    EXPECT_TRUE(walk.turns.empty());
    EXPECT_TRUE(walk.shifts.empty());
}

TEST(SkeletonFile, a_gltf_rests_where_its_bind_matrices_say_in_the_axes_of_the_world)
{
    const SkeletonValues values = gltf(rig());
    ASSERT_EQ(values.joints.size(), 3u);
    EXPECT_EQ(values.joints[1].name, "two");
    EXPECT_EQ(values.joints[1].parent, "one");
    EXPECT_LT((values.joints[0].at - Vector3d(0, 1, 0)).norm(), 1e-6);
    EXPECT_LT((values.joints[1].at - Vector3d(0, 2, 0)).norm(), 1e-6);
}

TEST(SkeletonFile, the_last_joint_of_a_skin_has_a_bone_as_well)
{
    const SkeletonValues values = gltf(rig());
    EXPECT_EQ(values.joints[2].name, "two.end");
    EXPECT_EQ(values.joints[2].parent, "two");
    EXPECT_LT((values.joints[2].at - Vector3d(0, 2.5, 0)).norm(), 1e-6);
    // Where a node tells where it ends, that does.
    Json json = rig();
    json["nodes"][2]["children"] = {3};
    json["nodes"].push_back({{"name", "tip"}, {"translation", {300, 0, 0}}});
    const SkeletonValues told = gltf(json);
    ASSERT_EQ(told.joints.size(), 3u);
    EXPECT_EQ(told.joints[2].name, "tip");
    EXPECT_LT((told.joints[2].at - Vector3d(0, 5, 0)).norm(), 1e-5);
}

TEST(SkeletonFile, turns_of_a_gltf_are_told_from_rest_in_the_axes_of_the_world)
{
    const SkeletonValues values = gltf(rig());
    ASSERT_EQ(values.turns.size(), 1u); // "one" stands at rest
    EXPECT_EQ(values.turns[0].joint, 1u);
    EXPECT_EQ(values.turns[0].times, (std::vector<double>{0, 1, 2}));
    EXPECT_LT(turn_of(values.turns[0].values[0]).angularDistance(Quaterniond::Identity()),
              1e-3);
    // About z, which the armature and the joint above leave where it is.
    EXPECT_LT(turn_of(values.turns[0].values[1]).angularDistance(about(2, 90)), 1e-3);
    EXPECT_TRUE(values.shifts.empty());
}

TEST(SkeletonFile, a_turn_about_an_axis_of_the_joint_comes_out_about_that_of_the_world)
{
    Json json = rig();
    const double h = std::sqrt(0.5);
    std::string all = floats({0, -100, 0, 0, 100, 0, 0, 0, 0, 0, 100, 0, -100, 0, 0, 1}) +
                      floats({0, -100, 0, 0, 100, 0, 0, 0, 0, 0, 100, 0, -200, 0, 0, 1}) +
                      floats({0, 1, 2}) +
                      floats({0, 0, 0, 1, h, 0, 0, h, 0, 0, 0, 1}); // about its own x
    json["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64(all);
    const SkeletonValues values = gltf(json);
    // Its x is the world's y.
    EXPECT_LT(turn_of(values.turns[0].values[1]).angularDistance(about(1, 90)), 1e-3);
}

TEST(SkeletonFile, a_joint_that_does_not_stand_at_rest_has_one_key)
{
    Json json = rig();
    json["nodes"][1]["translation"] = {50, 100, 0};
    const SkeletonValues values = gltf(json);
    ASSERT_EQ(values.shifts.size(), 1u);
    EXPECT_EQ(values.shifts[0].times, std::vector<double>{0.0});
    EXPECT_LT((values.shifts[0].values[0] - Vector3d(0.5, 0, 0)).norm(), 1e-6);
}

TEST(SkeletonFile, one_scale_of_all_joints_is_that_of_other_units)
{
    // The skin is bound in centimetres, its armature takes it to metres.
    const SkeletonValues metres = gltf(rig());
    for (const double scale : {1e-4, 0.02, 3.0})
    {
        Json json = rig();
        json["nodes"][0]["scale"] = {scale, scale, scale};
        const SkeletonValues values = gltf(json);
        ASSERT_EQ(values.joints.size(), metres.joints.size());
        for (std::size_t k = 0; k < values.joints.size(); ++k)
        {
            EXPECT_EQ(values.joints[k].at, metres.joints[k].at);
            EXPECT_EQ(values.joints[k].name, metres.joints[k].name);
        }
        ASSERT_EQ(values.turns.size(), metres.turns.size());
        for (std::size_t k = 0; k < values.turns[0].values.size(); ++k)
            EXPECT_LT((values.turns[0].values[k] - metres.turns[0].values[k]).norm(),
                      1e-6);
        EXPECT_TRUE(values.shifts.empty());
        ASSERT_EQ(values.warnings.size(), 1u);
        EXPECT_TRUE(contains(values.warnings[0], "nodes[1]: the skeleton is scaled by " +
                                                     shortest(100 * scale) +
                                                     " against its skin"))
            << values.warnings[0];
    }
    EXPECT_TRUE(metres.warnings.empty());
    // An animated node above the skin is a joint, in the same units.
    Json json = rig();
    json["nodes"][0]["scale"] = {1, 1, 1};
    json["animations"][0]["channels"].push_back(
        {{"sampler", 0}, {"target", {{"node", 0}, {"path", "rotation"}}}});
    const SkeletonValues values = gltf(json);
    EXPECT_EQ(values.joints[0].name, "Armature");
    EXPECT_LT((values.joints[1].at - Vector3d(0, 1, 0)).norm(), 1e-6);
    EXPECT_TRUE(values.shifts.empty());
}

TEST(SkeletonFile, scales_within_one_percent_are_left_out_with_a_warning)
{
    Json json = rig();
    json["nodes"][2]["scale"] = {1.008, 1.006, 1.006};
    const SkeletonValues values = gltf(json);
    EXPECT_EQ(values.joints.size(), gltf(rig()).joints.size());
    ASSERT_EQ(values.warnings.size(), 1u);
    EXPECT_TRUE(contains(values.warnings[0], "scales joints by up to 0.666667 %"))
        << values.warnings[0];
    json["nodes"][2]["scale"] = {1.02, 1.02, 1.02};
    EXPECT_TRUE(contains(gltf_refusal(json), "scales joint 'two'"));
    json["nodes"][2]["scale"] = {1.02, 1.0, 1.0};
    EXPECT_TRUE(contains(gltf_refusal(json), "differently along its axes"));
}

TEST(SkeletonFile, an_animation_of_another_file_moves_joints_by_their_names)
{
    const support::Folder folder;
    // The model's bones are longer, and it has no animation.
    Json model = rig();
    model.erase("animations");
    const SkeletonValues own = gltf(rig());
    Json other = rig();
    other["nodes"][2]["translation"] = {60, 0, 0};
    other["nodes"].push_back({{"name", "tail"}});
    const auto add = [&](int node, const char* path, const std::vector<double>& values)
    {
        std::string bytes;
        for (const double value : values)
            store(value, Scalar::Float32, false, bytes);
        const std::size_t buffer = other["buffers"].size();
        other["buffers"].push_back(
            {{"byteLength", bytes.size()},
             {"uri", "data:application/octet-stream;base64," + base64(bytes)}});
        other["bufferViews"].push_back(
            {{"buffer", buffer}, {"byteLength", bytes.size()}});
        other["accessors"].push_back({{"bufferView", buffer + 2},
                                      {"componentType", 5126},
                                      {"count", 3},
                                      {"type", "VEC3"}});
        Json& animation = other["animations"][0];
        animation["samplers"].push_back({{"input", 1}, {"output", buffer + 2}});
        animation["channels"].push_back({{"sampler", animation["samplers"].size() - 1},
                                         {"target", {{"node", node}, {"path", path}}}});
    };
    // Lengths that stay what they are there, and a scale of one, tell nothing.
    add(2, "translation", {60, 0, 0, 60, 0, 0, 60, 0, 0});
    add(2, "scale", {1, 1, 1, 1, 1, 1, 1, 1, 1});
    add(3, "translation", {0, 0, 0, 1, 0, 0, 2, 0, 0});
    SkeletonPlacement placement;
    placement.animation_file = folder.write("walk.gltf", other.dump());
    const SkeletonValues values = gltf(model, placement);
    ASSERT_EQ(values.joints.size(), own.joints.size());
    for (std::size_t k = 0; k < values.joints.size(); ++k)
        EXPECT_EQ(values.joints[k].at, own.joints[k].at);
    ASSERT_EQ(values.turns.size(), 1u);
    EXPECT_EQ(values.turns[0].times, own.turns[0].times);
    EXPECT_EQ(values.turns[0].values, own.turns[0].values);
    EXPECT_TRUE(values.shifts.empty());
    ASSERT_EQ(values.warnings.size(), 1u);
    EXPECT_TRUE(contains(values.warnings[0], "nodes[3] 'tail': moves nothing"));
    // A joint that moves in the other file moves in this one.
    add(1, "translation", {0, 100, 0, 0, 100, 0, 0, 150, 0});
    folder.write("walk.gltf", other.dump());
    ASSERT_EQ(gltf(model, placement).shifts.size(), 1u);
    EXPECT_LT((gltf(model, placement).shifts[0].values[2] - Vector3d(0, 0.5, 0)).norm(),
              1e-6);
    for (Json& node : other["nodes"])
        node["name"] = "x " + node["name"].get<std::string>();
    folder.write("walk.gltf", other.dump());
    EXPECT_TRUE(contains(error_of(Fault::Malformed, [&] { gltf(model, placement); }),
                         "walk.gltf: animations: moves no node that rig.gltf has"));
    other.erase("animations");
    folder.write("walk.gltf", other.dump());
    EXPECT_TRUE(contains(error_of(Fault::Malformed, [&] { gltf(model, placement); }),
                         "there is none that moves a node"));
    placement.animation_file = folder / "none.gltf";
    error_of(Fault::File, [&] { gltf(model, placement); });
    EXPECT_TRUE(contains(error_of(Fault::Malformed, [&] { tgf(kArm, placement); }),
                         "animation_file: is for a glTF"));
}

TEST(SkeletonFile, what_scales_a_bone_is_refused)
{
    Json json = rig();
    json["nodes"][2]["scale"] = {2, 2, 2};
    EXPECT_TRUE(contains(gltf_refusal(json), "scales joint 'two'"));
    json = rig();
    json["nodes"][1]["scale"] = {1, 1, 2};
    EXPECT_TRUE(contains(gltf_refusal(json), "differently along its axes"));
    json = rig();
    json["nodes"][1]["scale"] = {1, -1, 1};
    EXPECT_TRUE(contains(gltf_refusal(json), "mirrored"));
}

TEST(SkeletonFile, what_a_gltf_lacks_or_has_twice_is_told_by_its_place)
{
    const auto tells = [](const std::string& what, auto&& change)
    {
        Json json = rig();
        change(json);
        const std::string said = gltf_refusal(json);
        EXPECT_TRUE(contains(said, what)) << what << ": " << said;
    };
    const auto animation = [](Json& json) -> Json& { return json["animations"][0]; };
    tells("channels[0].target: is missing",
          [&](Json& json) { animation(json)["channels"][0].erase("target"); });
    tells("channels[1]: moves what another channel moves", [&](Json& json)
          { animation(json)["channels"].push_back(animation(json)["channels"][0]); });
    tells("moves nodes[2], which stands by a matrix",
          [](Json& json)
          {
              json["nodes"][2] = {
                  {"name", "two"},
                  {"matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 100, 0, 0, 1}}};
          });
    tells("channels[0].input: is missing",
          [&](Json& json) { animation(json)["samplers"][0].erase("input"); });
    tells("channels[0].sampler: is missing",
          [&](Json& json) { animation(json)["channels"][0].erase("sampler"); });
    // Of the first joint's bind matrix its linear part, of the second's animation its
    // turns.
    const auto set_numbers = [](Json& json, std::initializer_list<double> linear,
                                std::initializer_list<double> turns)
    {
        const std::string all =
            floats(linear) + floats({-100, 0, 0, 1}) +
            floats({0, -100, 0, 0, 100, 0, 0, 0, 0, 0, 100, 0, -200, 0, 0, 1}) +
            floats({0, 1, 2}) + floats(turns);
        json["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64(all);
    };
    const auto usual = {0.0, -100.0, 0.0, 0.0, 100.0, 0.0,
                        0.0, 0.0,    0.0, 0.0, 100.0, 0.0};
    tells("accessors[2] holds what is not finite",
          [&](Json& json) {
              set_numbers(json, usual, {0, 0, 0, 1e31, 0, 0, 1, 1, 0, 0, 1, 0});
          });
    tells("key 1 is no rotation",
          [&](Json& json) {
              set_numbers(json, usual, {0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 1, 0});
          });
    tells("its bind pose is flat",
          [&](Json& json)
          {
              set_numbers(json, {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 100, 0},
                          {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0});
          });
    tells("there is no skeleton",
          [](Json& json)
          {
              json.erase("skins");
              json.erase("animations");
              json["scenes"][0]["nodes"] = Json::array();
          });
    tells("more than 10000 joints",
          [](Json& json)
          {
              json.erase("skins");
              json.erase("animations");
              for (int k = 3; k < 10010; ++k)
              {
                  json["nodes"].push_back({{"name", "n" + std::to_string(k)}});
                  json["nodes"][2]["children"].push_back(k);
              }
          });
}

TEST(SkeletonFile, an_animation_is_taken_by_its_name_or_number)
{
    Json json = rig();
    SkeletonPlacement placement;
    placement.animation = "bend";
    EXPECT_EQ(gltf(json, placement).turns.size(), 1u);
    placement.animation = "0";
    EXPECT_EQ(gltf(json, placement).turns.size(), 1u);
    placement.animation = "walk";
    EXPECT_TRUE(contains(error_of(Fault::Malformed, [&] { gltf(json, placement); }),
                         "none of the name 'walk'"));
    json["animations"].push_back(json["animations"][0]);
    EXPECT_EQ(gltf(json).warnings.size(), 1u);
}

TEST(SkeletonFile, what_is_wrong_with_an_animation_is_told_by_its_place)
{
    const auto with = [](const char* pointer, const Json& value)
    {
        Json json = rig();
        json[Json::json_pointer(pointer)] = value;
        return gltf_refusal(json);
    };
    EXPECT_TRUE(
        contains(with("/animations/0/channels/0/target/node", 9), "out of range"));
    EXPECT_TRUE(
        contains(with("/animations/0/channels/0/target/path", "twist"), "got 'twist'"));
    EXPECT_TRUE(contains(with("/animations/0/samplers/0/output", 1), "need 4"));
    EXPECT_TRUE(contains(with("/animations/0/samplers/0/input", 7), "out of range"));
    EXPECT_TRUE(
        contains(with("/animations/0/samplers/0/interpolation", "SQUAD"), "need LINEAR"));
    EXPECT_TRUE(contains(with("/animations/0/samplers/0/interpolation", "CUBICSPLINE"),
                         "need 9"));
    EXPECT_TRUE(contains(with("/accessors/1/bufferView", 2), "is not later"));
    EXPECT_TRUE(contains(with("/skins/0/joints", Json::array()), "need a list of nodes"));
    EXPECT_TRUE(contains(with("/accessors/0/count", 1), "has 1, need 2"));
    EXPECT_TRUE(contains(with("/animations/0/channels", 3), "need a list of objects"));
}

TEST(SkeletonFile, names_that_cannot_be_said_become_others_that_still_differ)
{
    Json json = rig();
    json["nodes"][1]["name"] = "a\nb";
    json["nodes"][2]["name"] = "a_b";
    const SkeletonValues values = gltf(json);
    EXPECT_EQ(values.joints[0].name, "a_b");
    EXPECT_EQ(values.joints[1].name, "a_b.2");
    EXPECT_EQ(values.joints[1].parent, "a_b");
}

TEST(SkeletonFile, what_is_for_other_files_is_refused)
{
    SkeletonPlacement placement;
    placement.root = "Hips";
    EXPECT_TRUE(contains(error_of(Fault::Malformed, [&] { bvh(kWalk, placement); }),
                         "root: is for a .tgf"));
    placement.root.clear();
    placement.animation = "0";
    EXPECT_TRUE(contains(error_of(Fault::Malformed, [&] { tgf(kArm, placement); }),
                         "animation: is for a glTF"));
}

TEST(SkeletonFile, parents_come_first_whatever_the_order_and_what_cannot_be_is_named)
{
    const auto joint = [](const char* name, const char* parent, const Vector3d& at)
    {
        SkeletonJoint out;
        out.name = name;
        out.parent = parent;
        out.at = at;
        return out;
    };
    const SkeletonJoint root = joint("root", "", {0, 0, 0}),
                        arm = joint("arm", "root", {1, 0, 0}),
                        hand = joint("hand", "arm", {2, 0, 0});
    const auto sorted = in_order({hand, arm, root}, "s.json", "skeleton.joints");
    EXPECT_EQ(sorted[0].name, "root");
    EXPECT_EQ(sorted[2].name, "hand");
    const auto wrong = [](std::vector<SkeletonJoint> joints)
    {
        return error_of(Fault::Malformed,
                        [&] { in_order(joints, "s.json", "skeleton.joints"); });
    };
    EXPECT_TRUE(contains(wrong({root, arm, joint("arm", "root", {0, 1, 0})}),
                         "skeleton.joints[2]: 'arm' is the name of two"));
    EXPECT_TRUE(contains(wrong({root, joint("other", "", {0, 1, 0})}),
                         "other is a second root; the first one is root"));
    EXPECT_TRUE(contains(wrong({root, joint("arm", "rot", {0, 1, 0})}), "'rot'"));
    EXPECT_TRUE(contains(wrong({root, joint("arm", "root", {0, 0, 0})}), "no length"));
    EXPECT_TRUE(
        contains(wrong({root, joint("a", "b", {1, 0, 0}), joint("b", "a", {2, 0, 0})}),
                 "is on a ring"));
    EXPECT_TRUE(contains(wrong({joint("a", "b", {1, 0, 0}), joint("b", "a", {2, 0, 0})}),
                         "is on a ring"));
    SkeletonJoint limited = arm;
    limited.twist = {10.0, -10.0};
    EXPECT_TRUE(contains(wrong({root, limited}), "twist of arm"));
}

TEST(SkeletonFile, other_files_are_a_usage_error)
{
    error_of(Fault::Usage, [] { read_skeleton("walk.fbx"); });
    error_of(Fault::File, [] { read_skeleton("nowhere.bvh"); });
}

} // namespace cellwarp::core
