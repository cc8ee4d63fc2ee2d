// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/scene/skeleton_scene.h"

#include <numbers>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "io/scene/scene_file.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::error_of;

namespace
{

const std::string kJoints = R"("joints": [
    {"name": "hand", "parent": "elbow", "at": [2, 0, 0]},
    {"name": "elbow", "parent": "shoulder", "at": [1, 0, 0],
     "limits": {"hinge": [0, 0, 2], "twist": [0, 150]}},
    {"name": "shoulder", "parent": null, "at": [0, 0, 0], "limits": {"swing": 90}}])";

SceneFile scene_of(const std::string& skeleton)
{
    return parse_scene("s.json", R"({"cellwarp": 1, "model": "arm.obj", "skeleton": {)" +
                                     skeleton + "}}");
}

SkeletonValues values_of(const std::string& skeleton)
{
    return skeleton_of(*scene_of(skeleton).skeleton, "s.json");
}

std::string refusal(const std::string& skeleton)
{
    return error_of(Fault::Malformed, [&] { values_of(skeleton); });
}

} // namespace

TEST(SkeletonScene, joints_come_parents_first_with_their_limits)
{
    const SkeletonValues values = values_of(kJoints);
    ASSERT_EQ(values.joints.size(), 3u);
    EXPECT_EQ(values.joints[0].name, "shoulder");
    EXPECT_EQ(values.joints[0].swing, 90.0);
    EXPECT_EQ(values.joints[1].hinge, Eigen::Vector3d(0, 0, 2));
    EXPECT_EQ((*values.joints[1].twist)[1], 150.0);
    EXPECT_TRUE(values.turns.empty());
}

TEST(SkeletonScene, keys_of_a_joint_are_one_track_in_the_order_of_their_times)
{
    const SkeletonValues values =
        values_of(kJoints + R"(, "interpolation": "squad", "keys": [
        {"time": 2, "joint": "elbow", "rotate": [0, 0, 3, 90]},
        {"time": 1, "joint": "elbow", "rotate": [0, 0, 1, 0]},
        {"time": 1, "joint": "shoulder", "translate": [0, 1, 0]}])");
    ASSERT_EQ(values.turns.size(), 1u);
    EXPECT_EQ(values.turns[0].joint, 1u);
    EXPECT_EQ(values.turns[0].step, KeyStep::Smooth);
    EXPECT_EQ(values.turns[0].times, (std::vector<double>{1, 2}));
    EXPECT_NEAR(values.turns[0].values[1][2], std::sin(std::numbers::pi / 4), 1e-15);
    ASSERT_EQ(values.shifts.size(), 1u);
    EXPECT_EQ(values.shifts[0].values[0], Eigen::Vector3d(0, 1, 0));
}

TEST(SkeletonScene, places_of_keys_are_tracks_with_the_chain_that_turns_for_them)
{
    const SkeletonValues values = values_of(kJoints + R"(, "keys": [
        {"time": 1, "joint": "elbow", "to": [1, 1, 0], "from": "shoulder"},
        {"time": 0, "joint": "elbow", "to": [1, 0, 0], "rotate": [0, 0, 1, 20]}])");
    ASSERT_EQ(values.reaches.size(), 1u);
    EXPECT_EQ(values.reaches[0].joint, 1u);
    EXPECT_EQ(values.reaches[0].step, KeyStep::Linear);
    EXPECT_EQ(values.reaches[0].times, (std::vector<double>{0, 1}));
    EXPECT_EQ(values.reaches[0].values[1], Eigen::Vector3d(1, 1, 0));
    EXPECT_EQ(values.reaches[0].chain, std::vector<std::size_t>{0});
    EXPECT_FALSE(values.reaches[0].is_hold);
    EXPECT_EQ(values.turns.size(), 1u); // its own
    const std::string with_keys = kJoints + R"(, "keys": [{"time": 1, "joint": )";
    EXPECT_TRUE(contains(refusal(with_keys + R"("shoulder", "to": [1, 0, 0]}])"),
                         "skeleton.keys[0].to: joint shoulder is a root"));
    EXPECT_TRUE(
        contains(refusal(with_keys + R"("elbow", "to": [1, 0, 0], "from": "elbow"}])"),
                 "skeleton.keys[0].from: 'elbow' is no joint above elbow"));
    EXPECT_TRUE(contains(refusal(with_keys + R"("elbow", "to": [1, 0]}])"),
                         "skeleton.keys[0].to: "));
    EXPECT_TRUE(contains(
        refusal(with_keys + R"("elbow", "rotate": [1, 0, 0, 1], "from": "shoulder"}])"),
        "skeleton.keys[0].from: is for a key with to"));
    EXPECT_TRUE(contains(refusal(with_keys + R"("elbow", "to": [1, 0, 0]},
                                 {"time": 1, "joint": "elbow", "to": [1, 1, 0]}])"),
                         "has a key at 1 already"));
}

TEST(SkeletonScene, one_radius_is_that_of_all_bones)
{
    for (const SkeletonJoint& joint :
         values_of(kJoints + R"(, "tube_radius": 0.25)").joints)
        EXPECT_EQ(joint.radius, 0.25);
}

TEST(SkeletonScene, what_is_wrong_is_told_by_its_key)
{
    const std::string with_keys = kJoints + R"(, "keys": [)";
    EXPECT_TRUE(contains(refusal(""), "needs either a file or joints"));
    EXPECT_TRUE(contains(refusal(R"("file": "a.tgf", )" + kJoints), "needs either"));
    EXPECT_TRUE(contains(refusal(kJoints + R"(, "up": "z")"), "are for a file"));
    EXPECT_TRUE(
        contains(refusal(R"("file": "arm.obj")"), "skeleton.file: got 'arm.obj'"));
    EXPECT_TRUE(contains(refusal(R"("joints": [{"name": "a"}])"),
                         "skeleton.joints[0].at: is missing"));
    EXPECT_TRUE(contains(refusal(with_keys + R"({"time": 1, "joint": "knee",
                                                 "rotate": [1, 0, 0, 5]}])"),
                         "skeleton.keys[0].joint: 'knee' is no joint"));
    EXPECT_TRUE(contains(
        refusal(with_keys + R"({"time": 1, "joint": "elbow", "translate": [1, 0, 0]}])"),
        "only a root is moved"));
    EXPECT_TRUE(contains(
        refusal(with_keys + R"({"time": 1, "joint": "elbow", "rotate": [0, 0, 0, 5]}])"),
        "skeleton.keys[0].rotate: its axis has no length"));
    EXPECT_TRUE(contains(
        refusal(with_keys + R"({"time": 1, "joint": "elbow", "rotate": [1, 0, 0, 5]},
                               {"time": 1, "joint": "elbow", "rotate": [1, 0, 0, 6]}])"),
        "skeleton.keys[1]: joint elbow has a key at 1 already"));
    EXPECT_TRUE(contains(refusal(with_keys + R"({"time": 1, "joint": "elbow"}])"),
                         "needs rotate, translate or to"));
    EXPECT_TRUE(contains(refusal(kJoints + R"(, "interpolation": "linear")"),
                         "need one of slerp, squad"));
}

TEST(SkeletonScene, what_a_part_of_it_lacks_is_told_by_its_place)
{
    const auto tells = [](const std::string& text, const std::string& what)
    {
        const std::string said = refusal(text);
        EXPECT_TRUE(contains(said, what)) << text << "\n" << said;
    };
    const auto joint = [](const std::string& of)
    { return R"("joints": [{)" + of + "}]"; };
    tells(R"("joints": 3)", "joints: need a list");
    tells(joint(R"("at": [0, 0, 0])"), "joints[0].name: is missing");
    tells(joint(R"("name": "a")"), "joints[0].at: is missing");
    tells(joint(R"("name": "", "at": [0, 0, 0])"), "need a name");
    tells(joint(R"("name": "a", "parent": 3, "at": [0, 0, 0])"),
          "parent: need the name of a joint, or null");
    tells(joint(R"("name": "a", "at": [0, 0, 1e31])"), "at: is beyond 1e30");
    tells(joint(R"("name": "a", "at": [0, 0, 0], "limits": {"hinge": [0, 0, 0]})"),
          "hinge: got 0 0 0, need a direction");
    tells(joint(R"("name": "a", "at": [0, 0, 0], "limits": {"twist": [1]})"),
          "twist: need 2 numbers");
    tells(joint(R"("name": "a", "at": [0, 0, 0], "limits": {"twist": [1, "x"]})"),
          "twist: need 2 finite numbers");
    const auto more = [](const std::string& of) { return kJoints + ", " + of; };
    tells(more(R"("keys": [{"joint": "elbow", "rotate": [0, 0, 1, 9]}])"),
          "keys[0].time: is missing");
    tells(more(R"("keys": [{"time": 0, "rotate": [0, 0, 1, 9]}])"),
          "keys[0].joint: is missing");
    tells(R"("file": "")", "file: need the name of a file");
    tells(more(R"("lattice": "")"), "lattice: need octree, or the name of a file");
    tells(more(R"("detail_regions": ["all"])"), "detail_regions: need detail");
    tells(more(R"("detail": 0.1, "detail_regions": [3])"), "need a list of selectors");
    tells(more(R"("weights": "")"), "weights: need the name of a file");
    tells(more(R"("obstacles": [{"sphere": [0, 0, 0, 0]}])"),
          "got the radius 0, need > 0");
    tells(more(R"("obstacles": [{}])"),
          "obstacles[0]: needs one of plane, sphere and mesh");
    tells(more(R"("obstacles": [{"mesh": "wall.obj"}])"),
          "obstacles[0].mesh: flesh is kept out of planes and spheres alone");
    tells(more(R"("obstacles": [{"plane": [0, 1, 0, 0],
                                 "keys": [{"rotate": [0, 0, 1, 90]}]}])"),
          "obstacles[0].keys[0].rotate: need translate");
    tells(more(R"("held": [{}])"), "held[0].at: is missing");
    tells(more(R"("held": [{"at": [0, 0, 0], "normal": [0, 0, 0]}])"),
          "normal: got 0 0 0, need a direction");
    const auto keys = [&](const std::string& of)
    { return more(R"("held": [{"at": [0, 0, 0], "keys": [)" + of + "]}]"); };
    tells(keys(R"({"time": "late"})"), "held[0].keys[0].time");
    tells(keys(R"({}, {"time": 1, "rotate": [0, 0, 1, 90]})"),
          "keys[1].rotate: need translate");
    tells(
        keys(
            R"({"time": 1, "translate": [0, 0, 0]}, {"time": 1, "translate": [0, 0, 0]})"),
        "keys[1].time: got 1, need more than 1");
    std::string many = R"({"name": "j0", "at": [0, 0, 0]})";
    for (int k = 1; k <= 10000; ++k)
        many += R"(, {"name": "j)" + std::to_string(k) + R"(", "at": [0, 0, 0]})";
    tells(R"("joints": [)" + many + "]", "more than 10000 joints");
}

TEST(SkeletonScene, unknown_keys_and_those_of_flesh_in_time_are_warnings)
{
    const SceneFile scene = scene_of(kJoints + R"(, "bones": 3, "E": 1e4)");
    ASSERT_EQ(scene.warnings.size(), 1u);
    EXPECT_TRUE(contains(scene.warnings[0], "skeleton.bones: unknown key"));
    ASSERT_EQ(scene.left_out.size(), 1u);
    EXPECT_TRUE(contains(scene.left_out[0], "skeleton.E"));
}

TEST(SkeletonScene, keys_of_flesh_are_at_rest_and_at_0_unless_they_say_more)
{
    const SceneFile scene = scene_of(kJoints + R"(, "held": [{"at": [0, 0, 0],
        "keys": [{}, {"time": 1, "translate": [0, 2, 0]}]}])");
    const MoveKeys& keys = scene.skeleton->flesh.held.front().keys;
    ASSERT_EQ(keys.size(), 2u);
    EXPECT_EQ(keys[0].time, 0.0);
    EXPECT_EQ(keys[0].move, RigidMove());
    EXPECT_EQ(keys[1].time, 1.0);
    EXPECT_EQ(keys[1].move.translation, Eigen::Vector3d(0, 2, 0));
}

TEST(SkeletonScene, says_what_its_flesh_is_like)
{
    const SceneFile scene = scene_of(
        kJoints +
        R"(, "E": 2e4, "nu": 0.45, "density": 900, "damping": {"alpha": 1, "beta": 0.01},
        "materials": [{"region": "sphere 0 0 0 1", "E": 5e3}], "law": "linear", "newton": 3,
        "lattice": "body.mesh", "across": 30, "max_depth": 1, "tube": false,
        "tube_stiffness": 30, "settle": true)");
    const FleshStatement& flesh = scene.skeleton->flesh;
    EXPECT_EQ(flesh.young, 2e4);
    EXPECT_EQ(flesh.poisson, 0.45);
    EXPECT_EQ(flesh.density, 900);
    EXPECT_EQ(flesh.alpha, 1);
    EXPECT_EQ(flesh.beta, 0.01);
    ASSERT_EQ(flesh.materials.size(), 1u);
    EXPECT_EQ(flesh.materials[0].region, "sphere 0 0 0 1");
    EXPECT_EQ(flesh.materials[0].young, 5e3);
    EXPECT_FALSE(flesh.materials[0].poisson);
    EXPECT_EQ(flesh.law, "linear");
    EXPECT_EQ(flesh.newton, 3);
    EXPECT_TRUE(flesh.lattice.ends_with("body.mesh"));
    EXPECT_EQ(flesh.across, 30);
    EXPECT_EQ(flesh.max_depth, 1);
    EXPECT_FALSE(flesh.has_tube);
    EXPECT_EQ(flesh.tube_stiffness, 30);
    EXPECT_TRUE(flesh.settles);
    const FleshStatement usual = scene_of(kJoints).skeleton->flesh;
    EXPECT_FALSE(usual.young);
    EXPECT_EQ(usual.law, "cells");
    EXPECT_TRUE(usual.lattice.empty());
    EXPECT_TRUE(usual.has_tube);
    for (const auto& [more, what] :
         {std::pair{R"("E": 0)", "skeleton.E: got 0"},
          {R"("nu": 0.5)", "skeleton.nu: got 0.5"},
          {R"("damping": {"alpha": -1})", "skeleton.damping.alpha: got -1"},
          {R"("materials": [{"E": 1}])", "skeleton.materials[0].region: need a selector"},
          {R"("law": "rubber")", "skeleton.law: got 'rubber'"},
          {R"("newton": 9)", "skeleton.newton: got 9"},
          {R"("lattice": "body.obj")", "skeleton.lattice: got 'body.obj'"},
          {R"("tube": 1)", "skeleton.tube: got 1, need true or false"}})
        EXPECT_TRUE(contains(refusal(kJoints + ", " + more), what)) << more;
}

TEST(SkeletonScene, obstacles_have_an_old_name)
{
    const SceneFile scene =
        scene_of(kJoints + R"(, "contact": [{"plane": [0, 1, 0, 2]}])");
    ASSERT_EQ(scene.warnings.size(), 1u);
    EXPECT_TRUE(contains(scene.warnings[0],
                         "skeleton.contact: is called skeleton.obstacles now"));
    ASSERT_EQ(scene.skeleton->flesh.obstacles.size(), 1u);
    EXPECT_EQ(scene.skeleton->flesh.obstacles[0].field, "skeleton.contact[0]");
}

TEST(SkeletonScene, with_simulate_it_has_a_time_of_its_own)
{
    const std::string scene = R"({"cellwarp": 1, "model": "m.obj", "unit": 0.01,
        "skeleton": {"joints": [{"name": "a", "parent": null, "at": [0, 0, 0]}]},
        "simulate": {"duration": 3, "gravity": [0, 0, -9.81]})";
    const SceneFile flesh = parse_scene("s.json", scene + "}");
    ASSERT_TRUE(flesh.has_flesh());
    EXPECT_EQ(flesh.time.dt, 1.0 / 120.0);
    EXPECT_EQ(flesh.time.duration, 3.0);
    EXPECT_EQ(flesh.time.unit, 0.01);
    EXPECT_EQ(flesh.time.gravity[2], -9.81);
    EXPECT_FALSE(flesh.has_moving_objects());
    // Rods and nets of the scene share it.
    for (const char* more : {R"(, "rods": [{"points": [[0,0,0],[1,0,0]]}]})",
                             R"(, "nets": [{"points": [[0,0,0]]}]})"})
    {
        const SceneFile both = parse_scene("s.json", scene + more);
        EXPECT_TRUE(both.has_flesh());
        EXPECT_TRUE(both.has_moving_objects());
    }
    EXPECT_FALSE(scene_of(kJoints).has_flesh());
}

TEST(SkeletonScene, a_scene_keeps_it_when_it_is_written)
{
    SceneFile scene = scene_of(kJoints);
    const SceneFile again = parse_scene("s.json", scene_text(scene));
    ASSERT_TRUE(again.skeleton);
    EXPECT_EQ(again.skeleton->joints, scene.skeleton->joints);
}

} // namespace cellwarp::core
