// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/scene/scene_file.h"

#include <gtest/gtest.h>

#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::error_of;

namespace
{

std::string scene_of(const std::string& rod, const std::string& simulate = "{}")
{
    return R"({"cellwarp": 1, "rods": [)" + rod + R"(], "simulate": )" + simulate + "}";
}

} // namespace

TEST(RodScene, says_what_stands_in_it_and_defaults_for_the_rest)
{
    const SceneFile of = parse_scene(
        "s.json",
        scene_of(R"({"name": "a", "through": [[0,0,0],[1,0,0]], "radius": [0.1, 0.2],
                     "EI": [1, 2], "normal": [0, 0, 1], "rest": "straight", "fixed": [{"at": 1,
                     "what": ["point", "twist"], "keys": [{"time": 0},
                     {"time": 2, "translate": [0,1,0], "rotate": [0,0,1,90]}]}],
                     "on": [{"at": 0.5, "plane": [0,2,0,3]}],
                     "loads": [{"at": 0.5, "force": [0,-1,0]}]})",
                 R"({"dt": 0.01, "integrator": "rk4", "gravity": [0,0,-1]})"));
    EXPECT_TRUE(of.warnings.empty());
    const RodScene& scene = of.time;
    ASSERT_EQ(scene.rods.size(), 1u);
    const RodStatement& rod = scene.rods[0];
    EXPECT_EQ(rod.name, "a");
    EXPECT_EQ(rod.line.points.size(), 2u);
    EXPECT_EQ(rod.line.spans, 4);
    EXPECT_EQ(rod.line.radii, (std::vector<double>{0.1, 0.2}));
    EXPECT_EQ(rod.young, 1e6);
    EXPECT_EQ((*rod.bending)[1], 2.0);
    EXPECT_FALSE(rod.twisting);
    EXPECT_TRUE(rod.is_straight_at_rest);
    ASSERT_EQ(rod.holds.size(), 1u);
    EXPECT_TRUE(rod.holds[0].has_point && rod.holds[0].has_twist);
    EXPECT_FALSE(rod.holds[0].has_tangent);
    EXPECT_EQ(rod.holds[0].keys[1].move.degrees, 90.0);
    EXPECT_EQ(rod.on[0].kind, RodOn::Kind::Plane);
    EXPECT_EQ(rod.on[0].offset, 3.0);
    EXPECT_EQ(rod.loads[0].force[1], -1.0);
    EXPECT_EQ(scene.dt, 0.01);
    EXPECT_EQ(scene.integrator, "rk4");
    EXPECT_EQ(scene.gravity[2], -1.0);
}

TEST(RodScene, says_what_refines_is_cut_and_touches)
{
    const RodScene scene = parse_scene("a/s.json", R"({"cellwarp": 1, "rods": [
        {"through": [[0,0,0],[1,0,0]], "refine": {"insert": 1, "remove": 0.2},
         "cut": [{"at": 0.4, "time": 2}, {"force": 3}], "radius_of_contact": 0.3,
         "skin": true}, {"through": [[0,0,0],[1,0,0]], "refine": true}],
        "obstacles": [{"plane": [0,1,0,2]}, {"sphere": [1,2,3,4]}, {"mesh": "b.obj"}]})")
                               .time;
    EXPECT_EQ(scene.rods[0].refine->insert, 1.0);
    EXPECT_EQ(scene.rods[0].refine->tolerance, 1e-3);
    EXPECT_EQ(scene.rods[1].refine->insert, 0.5);
    EXPECT_EQ(*scene.rods[0].cuts[0].at, 0.4);
    EXPECT_EQ(scene.rods[0].cuts[0].time, 2.0);
    EXPECT_EQ(*scene.rods[0].cuts[1].force, 3.0);
    EXPECT_EQ(*scene.rods[0].contact_radius, 0.3);
    EXPECT_TRUE(scene.rods[0].has_skin);
    EXPECT_EQ((*scene.obstacles[0].plane)[3], 2.0);
    EXPECT_EQ((*scene.obstacles[1].sphere)[3], 4.0);
    EXPECT_EQ(scene.obstacles[2].mesh, "a/b.obj");
    EXPECT_TRUE(scene.contact); // obstacles are there to be touched
    EXPECT_FALSE(parse_scene("s.json", R"({"cellwarp": 1, "rod_contact": false,
        "obstacles": [{"plane": [0,1,0,2]}], "rods": [{"through": [[0,0,0],[1,0,0]]}]})")
                     .time.contact);
    const RodScene touches = parse_scene("s.json", R"({"cellwarp": 1,
        "rod_contact": {"friction": 0.3, "stiffness": 9, "self": false},
        "rods": [{"through": [[0,0,0],[1,0,0]]}]})")
                                 .time;
    EXPECT_EQ(touches.contact->friction, 0.3);
    EXPECT_EQ(*touches.contact->stiffness, 9.0);
    EXPECT_FALSE(touches.contact->with_itself);
    EXPECT_TRUE(touches.contact->between_rods);
}

TEST(RodScene, names_the_key_that_is_wrong)
{
    const std::string line = R"("through": [[0,0,0],[1,0,0]])";
    for (const auto& [rod, words] :
         {std::pair<std::string, std::string>{"{}", "rods[0]: needs through or points"},
          {"{" + line + R"(, "points": [[0,0,0]]})", "needs through or points"},
          {R"({"through": [[0,0,0],[1,0]]})", "rods[0].through[1]: need three numbers"},
          {R"({"through": 3})", "rods[0].through: need a list"},
          {R"({"through": [[0,0,0],[1e31,0,0]]})", "rods[0].through[1]: is beyond 1e30"},
          {"{" + line + R"(, "EI": [1, "x"]})", "rods[0].EI: need 2 finite numbers"},
          {"{" + line + R"(, "radius": 0})", "rods[0].radius"},
          {"{" + line + R"(, "radius": []})", "rods[0].radius"},
          {"{" + line + R"(, "EI": [1, 0]})", "rods[0].EI"},
          {"{" + line + R"(, "EI": [1]})", "rods[0].EI: need 2 numbers"},
          {"{" + line + R"(, "EI": [1, 2]})",
           "rods[0].normal: is missing: two different"},
          {"{" + line + R"(, "nu": 0.6})", "rods[0].nu"},
          {"{" + line + R"(, "closed": 1})", "rods[0].closed: got 1, need true or false"},
          {"{" + line + R"(, "link": 1})", "rods[0].link"},
          {"{" + line + R"(, "name": "a\nb"})", "rods[0].name: has characters"},
          {"{" + line + R"(, "springs": [{"point": [0,0,0], "length": 1}]})",
           "rods[0].springs[0].stiffness: is missing, or damping"},
          {"{" + line + R"(, "springs": [{"stiffness": 1}]})",
           "rods[0].springs[0].point: is missing"},
          {"{" + line + R"(, "springs": [{"point": [0,0,0], "stiffness": -1}]})",
           "rods[0].springs[0].stiffness"},
          {"{" + line + R"(, "spline": "hermite"})", "rods[0].spline"},
          {"{" + line + R"(, "elasticity": "springs"})", "rods[0].elasticity: "},
          {"{" + line + R"(, "refine": 3})", "rods[0].refine: need true, false"},
          {"{" + line + R"(, "refine": {"insert": 0.2}})",
           "rods[0].refine.remove: need a smaller turn"},
          {"{" + line + R"(, "refine": {"tolerance": -1}})", "rods[0].refine.tolerance"},
          {"{" + line + R"(, "cut": [{}]})",
           "rods[0].cut[0]: needs one of at, curvature and force"},
          {"{" + line + R"(, "cut": [{"at": 0.5, "force": 2}]})",
           "rods[0].cut[0]: needs one of at, curvature and force"},
          {"{" + line + R"(, "cut": [{"at": 1}]})", "rods[0].cut[0].at"},
          {"{" + line + R"(, "cut": [{"curvature": 0}]})", "rods[0].cut[0].curvature"},
          {"{" + line + R"(, "radius_of_contact": 0})", "rods[0].radius_of_contact"},
          {"{" + line + R"(, "skin": 1})", "rods[0].skin: got 1, need true or false"},
          {"{" + line + R"(, "carries": true})", "model: is missing: rods carry"},
          {"{" + line + R"(, "carries": true, "refine": true})",
           "rods[0].carries: cells are carried by rods that are neither"},
          {"{" + line + R"(, "fixed": [{"at": 2}]})", "rods[0].fixed[0].at"},
          {"{" + line + R"(, "fixed": [{"what": ["soul"]}]})",
           "rods[0].fixed[0].what[0]"},
          {"{" + line + R"(, "fixed": [{"keys": [{"time": 1}, {"time": 1}]}]})",
           "rods[0].fixed[0].keys[1].time: got 1, need more than 1"},
          {"{" + line + R"(, "fixed": [{"keys": [{"rotate": [0,0,0,9]}]}]})",
           "rods[0].fixed[0].keys[0].rotate: its axis has no length"},
          {"{" + line + R"(, "on": [{"at": "slides", "point": [0,0,0]}]})",
           "rods[0].on[0].at: need a share"},
          {"{" + line + R"(, "on": [{"at": "sliding", "range": [0.5, 0.2]}]})",
           "rods[0].on[0].range: need two shares"},
          {"{" + line +
               R"(, "on": [{"at": "sliding", "start": 0.9, "range": [0, 0.5]}]})",
           "rods[0].on[0].start: is not within range"},
          {"{" + line + R"(, "on": [{"at": "sliding", "end": "fall"}]})",
           "rods[0].on[0].end"},
          {"{" + line + R"(, "on": [{"at": "sliding", "friction": [0.2, 0.3]}]})",
           "rods[0].on[0].friction: need one at rest"},
          {"{" + line + R"(, "on": [{"at": 0}]})",
           "needs one of point, plane, axis and rod"},
          {"{" + line + R"(, "on": [{"plane": [0,0,0,1]}]})",
           "rods[0].on[0].plane: its direction has no length"},
          {"{" + line + R"(, "on": [{"rod": "none"}]})",
           "rods[0].on[0].rod: there is no rod called 'none'"},
          {"{" + line + R"(, "on": [{"at": 0.5, "rod": "rod1", "other": 0.5}]})",
           "rods[0].on[0].rod: a place on itself"},
          {"{" + line + R"(, "on": [{"at": 0.5, "rod": "rod1", "other": "slides"}]})",
           "rods[0].on[0].other: need a share"},
          {"{" + line + R"(, "on": [{"at": "sliding", "point": [0,0,0], "apart": -1}]})",
           "rods[0].on[0].apart"},
          {"{" + line + R"(, "on": [{"point": [0,0,0], "keys": [{"time": -1}]}]})",
           "rods[0].on[0].keys[0].time"},
          {"{" + line + "}, {" + line + R"(, "name": "rod1"})", "two are called 'rod1'"}})
    {
        SCOPED_TRACE(rod);
        const std::string text = error_of(Fault::Malformed, [&, &of = rod]
                                          { parse_scene("s.json", scene_of(of)); });
        EXPECT_TRUE(contains(text, words)) << text;
    }
    for (
        const auto& [text, words] :
        {std::pair<std::string, std::string>{R"({"rods": []})", "cellwarp: is missing"},
         {R"({"cellwarp": 1})", "model: is missing"},
         {R"({"cellwarp": 2, "rods": []})", "cellwarp"},
         {scene_of("{" + line + "}", R"({"dt": 0})"), "simulate.dt"},
         {scene_of("{" + line + "}", R"({"dt": 1e-12, "duration": 1e9})"),
          "simulate.duration: takes more than 1e9 steps"},
         {R"({"cellwarp": 1, "obstacles": [{}], "rods": [{)" + line + "}]}",
          "obstacles[0]: needs one of plane, sphere and mesh"},
         {R"({"cellwarp": 1, "obstacles": [{"plane": [0,0,0,1]}], "rods": [{)" + line +
              "}]}",
          "obstacles[0].plane: its normal has no length"},
         {R"({"cellwarp": 1, "obstacles": [{"sphere": [0,0,0,0]}], "rods": [{)" + line +
              "}]}",
          "obstacles[0].sphere: got the radius 0, need > 0"},
         {R"({"cellwarp": 1, "obstacles": [{"plane": [0,1,0,0],
             "keys": [{"translate": [0,1,0]}]}], "rods": [{)" +
              line + "}]}",
          "obstacles[0].keys: rods touch only obstacles that stay"},
         {R"({"cellwarp": 1, "obstacles": [{"mesh": "a.obj", "friction": 0.5}],
             "rods": [{)" +
              line + "}]}",
          "obstacles[0].friction: rods have one friction, rod_contact.friction"},
         {R"({"cellwarp": 1, "sheets": [{"sides": [[1,0,0]]}]})",
          "sheets[0].sides: need two"},
         {R"({"cellwarp": 1, "sheets": [{"sides": [[1,0,0],[0,1,0]], "counts": [3,5]}]})",
          "sheets[0].counts[0]: need degree + 1"},
         {R"({"cellwarp": 1, "sheets": [{"sides": [[1,0,0],[0,1,0]], "counts": [5]}]})",
          "sheets[0].counts: need one for each side"},
         {R"({"cellwarp": 1, "sheets": [{"sides": [[1,0,0],[0,1,0]], "fixed": [[0]]}]})",
          "sheets[0].fixed[0]: need a share"},
         {R"({"cellwarp": 1, "sheets": [{"sides": [[1,0,0],[0,1,0],[0,0,1]],
               "over": [[0,0,0]]}]})",
          "sheets[0].over: a point within a block"},
         {R"({"cellwarp": 1, "sheets": [{"name": "s", "sides": [[1,0,0],[0,1,0]]}],
               "rods": [{)" +
              line + R"(}], "connections": [{"a": "rod rod1 0", "b": "sheet s 0 2"}]})",
          "connections[0].b: a share is not within 0 and 1"},
         {R"({"cellwarp": 1, "sheets": [{"name": "s", "sides": [[1,0,0],[0,1,0]]}],
               "rods": [{)" +
              line +
              R"(}], "connections": [{"a": "rod rod1 0", "b": "sheet s 0 1", "what": ["frame"]}]})",
          "connections[0].what: a place of a sheet has no frame"},
         {R"({"cellwarp": 1, "rod_contact": 3, "rods": [{)" + line + "}]}",
          "rod_contact: need true, false"},
         {R"({"cellwarp": 1, "rod_contact": {"friction": -1}, "rods": [{)" + line + "}]}",
          "rod_contact.friction"},
         {R"({"cellwarp": 1, "rods": [{)" + line +
              R"(, "cut": [{"at": 0.5}]}], "simulate": {"integrator": "static"}})",
          "rods[0].cut: an equilibrium has no time"},
         {R"({"cellwarp": 1, "unit": -1, "rods": [{)" + line + "}]}", "unit: "}})
        EXPECT_TRUE(contains(
            error_of(Fault::Malformed, [&, &of = text] { parse_scene("s.json", of); }),
            words))
            << text;
    EXPECT_EQ(
        parse_scene("s.json", scene_of("{" + line + R"(, "colour": 1})")).warnings.size(),
        1u);
}

TEST(RodScene, reads_bodies_nets_and_joints)
{
    const SceneFile of = parse_scene("s.json", R"({"cellwarp": 1,
        "rods": [{"name": "long rope", "through": [[0,0,0],[1,0,0]],
                  "on": [{"at": 1, "rod": "long rope", "other": "sliding",
                          "other_start": 0.25}]}],
        "bodies": [{"name": "seat", "mass": 2, "inertia": [1,2,2.5], "at": [0,-1,0],
                    "rotate": [0,1,0,30], "velocity": [1,0,0], "spin": [0,0,3],
                    "keys": [{"time": 1, "translate": [0,1,0]}]}, {}],
        "nets": [{"name": "cloth", "points": [[0,0,0],[1,0,0],[1,1,0]],
                  "springs": [[0,1,50],[1,2,60]], "mass": 3, "fixed": [2]},
                 {"points": [[0,0,0],[1,0,0]], "mass": [1,2]}],
        "connections": [{"a": "rod long rope 0.5", "b": "body seat 0 0 0.1",
                    "what": ["point", "frame"]},
                   {"a": "rod long rope sliding", "b": "net cloth 2", "friction": [0.3, 0.2],
                    "range": [0.2, 0.8], "end": "release", "inertia": 0.5, "apart": 0.1}]})");
    const RodScene& scene = of.time;
    EXPECT_TRUE(of.warnings.empty());
    EXPECT_EQ(scene.rods[0].on[0].kind, RodOn::Kind::Rod);
    EXPECT_EQ(scene.rods[0].on[0].rod, 0u);
    EXPECT_EQ(scene.rods[0].on[0].other_slide->start, 0.25);
    EXPECT_EQ(scene.bodies[0].inertia[2], 2.5);
    EXPECT_EQ(scene.bodies[0].keys.size(), 1u);
    EXPECT_EQ(scene.bodies[0].spin[2], 3.0);
    EXPECT_EQ(scene.bodies[1].name, "body2");
    EXPECT_GT(scene.bodies[1].inertia[0], 0.0);
    EXPECT_EQ(scene.nets[0].masses, (std::vector<double>{1, 1, 1}));
    EXPECT_EQ(scene.nets[0].springs[1].node[1], 2u);
    EXPECT_EQ(scene.nets[0].fixed, (std::vector<std::size_t>{2}));
    EXPECT_EQ(scene.nets[1].masses[1], 2.0);
    const JointStatement &fast = scene.joints[0], &loose = scene.joints[1];
    EXPECT_EQ(fast.ends[0].at, 0.5);
    EXPECT_EQ(fast.ends[1].point[2], 0.1);
    EXPECT_TRUE(fast.has_point && fast.has_frame && !fast.has_distance);
    EXPECT_TRUE(loose.ends[0].slides && loose.has_point && loose.slide.leaves);
    EXPECT_EQ(loose.ends[1].node, 2u);
    EXPECT_EQ(loose.slide.friction[1], 0.2);
    EXPECT_EQ(loose.slide.inertia, 0.5);
    EXPECT_EQ(loose.slide.apart, 0.1);
}

TEST(RodScene, names_what_is_wrong_with_bodies_nets_and_joints)
{
    for (
        const auto& [more, words] :
        {std::pair<std::string, std::string>{R"("bodies": [{"inertia": [1,1,3]}])",
                                             "bodies[0].inertia: no body has it"},
         {R"("bodies": [{"mass": 0}])", "bodies[0].mass"},
         {R"("bodies": [{"rotate": [0,0,0,1]}])", "bodies[0].rotate: its axis"},
         {R"("bodies": [{"name": "a"}, {"name": "a"}])", "bodies: two are called 'a'"},
         {R"("nets": [{}])", "nets[0].points: is missing"},
         {R"("nets": [{"points": [[0,0,0]], "springs": [[0,1,5]]}])",
          "nets[0].springs[0]: need the number of a point, from 0 to 0"},
         {R"("nets": [{"points": [[0,0,0],[1,0,0]], "springs": [[0,0,5]]}])",
          "nets[0].springs[0]: need two points, not one"},
         {R"("nets": [{"points": [[0,0,0],[1,0,0]], "springs": [[0,1,-5]]}])",
          "nets[0].springs[0]: need two points and a stiffness"},
         {R"("nets": [{"points": [[0,0,0],[1,0,0]], "mass": [1]}])",
          "nets[0].mass: need"},
         {R"("nets": [{"points": [[0,0,0]], "fixed": [0.5]}])", "nets[0].fixed[0]: need"},
         {R"("connections": [{"a": "rod r 0"}])", "connections[0].b: is missing"},
         {R"("connections": [{"a": "rod r", "b": "rod r 1"}])",
          "connections[0].a: names no place"},
         {R"("connections": [{"a": "stick r 0", "b": "rod r 1"}])",
          "connections[0].a: names no place: need \"rod NAME SHARE\""},
         {R"("connections": [{"a": "rod x 0", "b": "rod r 1"}])",
          "connections[0].a: there is no rod called 'x'"},
         {R"("connections": [{"a": "rod r 2", "b": "rod r 1"}])",
          "connections[0].a: the share is not within 0 and 1"},
         {R"("connections": [{"a": "rod r x", "b": "rod r 1"}])",
          "connections[0].a: what follows the name is no number"},
         {R"("nets": [{"name": "n", "points": [[0,0,0]]}],
              "connections": [{"a": "net n 1", "b": "rod r 1"}])",
          "connections[0].a: the net has no such point"},
         {R"("nets": [{"name": "n", "points": [[0,0,0]]}],
              "connections": [{"a": "net n 0", "b": "rod r 1", "what": ["frame"]}])",
          "connections[0].what: a point of a net has no frame"},
         {R"("connections": [{"a": "rod r sliding", "b": "rod r 1", "what": ["distance"]}])",
          "connections[0].what: what slides is joined by point alone"},
         {R"("connections": [{"a": "rod r 0", "b": "rod r 1", "what": ["glue"]}])",
          "connections[0].what[0]: need one of point, frame, distance"}})
    {
        SCOPED_TRACE(more);
        const std::string text =
            error_of(Fault::Malformed,
                     [&, &of = more]
                     {
                         parse_scene("s.json", R"({"cellwarp": 1, "rods": [{"name": "r",
                             "through": [[0,0,0],[1,0,0]]}], )" +
                                                   of + "}");
                     });
        EXPECT_TRUE(contains(text, words)) << text;
    }
}

TEST(RodScene, warns_of_what_a_curve_has_no_use_for)
{
    const auto warnings = [](const std::string& rod)
    { return parse_scene("x.json", scene_of("{" + rod + "}")).warnings; };
    const std::string through = R"("through": [[0,0,0],[1,0,0]])",
                      points = R"("points": [[0,0,0],[1,0,0],[2,0,0],[3,0,0]])";
    const auto one = [&](const std::string& rod, const std::string& words)
    {
        const std::vector<std::string> told = warnings(rod);
        ASSERT_EQ(told.size(), 1u) << rod;
        EXPECT_TRUE(contains(told[0], words)) << told[0];
    };
    one(through + R"(, "spline": "uniform")",
        "rods[0].spline: is for points, not for through, ignored");
    one(points + R"(, "spans": 3)", "rods[0].spans: is for through");
    one(points + R"(, "spline": "bezier", "degree": 4)", "rods[0].degree: follows");
    EXPECT_TRUE(warnings(through + R"(, "spline": "nonuniform", "spans": 3)").empty());
    EXPECT_TRUE(warnings(points + R"(, "spline": "uniform", "degree": 3)").empty());
}

TEST(RodScene, old_names_of_keys_are_read_with_a_warning)
{
    const auto scene = [](const std::string& energy, const std::string& joints,
                          const std::string& contact)
    {
        return parse_scene("s.json", R"({"cellwarp": 1, "rods": [{"name": "r", ")" +
                                         energy + R"(": "discrete",
            "through": [[0,0,0],[1,0,0]]}], "bodies": [{"name": "b"}],
            ")" + joints + R"(": [{"a": "rod r 1", "b": "body b 0 0 0"}],
            ")" + contact + R"(": {"friction": 0.5}})");
    };
    const SceneFile old = scene("energy", "joints", "contact"),
                    now = scene("elasticity", "connections", "rod_contact");
    EXPECT_EQ(old.warnings,
              (std::vector<std::string>{"s.json:1: rods[0].energy: is called "
                                        "rods[0].elasticity now",
                                        "s.json:3: joints: is called connections now",
                                        "s.json:4: contact: is called rod_contact now"}));
    EXPECT_TRUE(now.warnings.empty());
    for (const SceneFile& one : {old, now})
    {
        EXPECT_TRUE(one.unknown_keys.empty());
        EXPECT_EQ(one.time.rods[0].elasticity, "discrete");
        ASSERT_EQ(one.time.joints.size(), 1u);
        EXPECT_EQ(one.time.contact->friction, 0.5);
    }
    EXPECT_EQ(old.time.joints[0].field, "joints[0]");
    EXPECT_EQ(now.time.joints[0].field, "connections[0]");
    EXPECT_TRUE(contains(
        error_of(Fault::Malformed,
                 []
                 {
                     parse_scene("s.json", R"({"cellwarp": 1, "contact": true,
                         "rod_contact": true, "bodies": [{}]})");
                 }),
        "s.json:1: contact: is the old name of rod_contact, which is there as well"));
}

TEST(RodScene, frames_are_whole_steps)
{
    const auto scene = [](const std::string& simulate)
    {
        return parse_scene("s.json", R"({"cellwarp": 1, "rods": [{"through":
            [[0,0,0],[1,0,0]]}], "simulate": )" +
                                         simulate + "}");
    };
    EXPECT_TRUE(contains(
        error_of(Fault::Malformed, [&] { scene(R"({"dt": 0.02, "every": 0.03})"); }),
        "simulate.every: got 0.03 s, which is no whole number of steps of 0.02 s: the "
        "nearest is 0.04 s"));
    EXPECT_TRUE(contains(
        error_of(Fault::Malformed, [&] { scene(R"({"dt": 0.02, "every": 0.001})"); }),
        "the nearest is 0.02 s"));
    EXPECT_EQ(scene(R"({"dt": 0.004, "every": 0.06})").time.steps_a_frame(), 15);
    // The default is the whole number of steps that is nearest to 1/30 s.
    EXPECT_DOUBLE_EQ(scene(R"({"dt": 0.02})").time.every, 0.04);
    EXPECT_DOUBLE_EQ(scene("{}").time.every, 0.033);
    EXPECT_TRUE(scene(R"({"dt": 0.02, "duration": 0.011})").warnings.empty());
    const SceneFile still = scene(R"({"dt": 0.02, "duration": 0.009})");
    ASSERT_EQ(still.warnings.size(), 1u);
    EXPECT_TRUE(
        contains(still.warnings[0],
                 "simulate.duration: 0.009 s is less than half a step of 0.02 s"));
}

} // namespace cellwarp::core
