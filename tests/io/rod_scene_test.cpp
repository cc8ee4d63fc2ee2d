// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/rod_scene.h"

#include <gtest/gtest.h>

#include "tests/support/throws.h"

namespace cellwarp
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
    const RodScene scene = parse_rod_scene(
        "s.json",
        scene_of(R"({"name": "a", "through": [[0,0,0],[1,0,0]], "radius": [0.1, 0.2],
                     "EI": [1, 2], "rest": "straight", "fixed": [{"at": 1,
                     "what": ["point", "twist"], "keys": [{"time": 0},
                     {"time": 2, "translate": [0,1,0], "rotate": [0,0,1,90]}]}],
                     "on": [{"at": 0.5, "plane": [0,2,0,3]}],
                     "loads": [{"at": 0.5, "force": [0,-1,0]}]})",
                 R"({"dt": 0.01, "integrator": "rk4", "gravity": [0,0,-1]})"));
    ASSERT_EQ(scene.rods.size(), 1u);
    const RodStatement& rod = scene.rods[0];
    EXPECT_EQ(rod.name, "a");
    EXPECT_EQ(rod.through.size(), 2u);
    EXPECT_EQ(rod.spans, 4);
    EXPECT_EQ(rod.radius, (std::vector<double>{0.1, 0.2}));
    EXPECT_EQ(rod.young, 1e6);
    EXPECT_EQ((*rod.bending)[1], 2.0);
    EXPECT_FALSE(rod.twisting);
    EXPECT_TRUE(rod.is_straight_at_rest);
    ASSERT_EQ(rod.holds.size(), 1u);
    EXPECT_TRUE(rod.holds[0].has_point && rod.holds[0].has_twist);
    EXPECT_FALSE(rod.holds[0].has_tangent);
    EXPECT_EQ(rod.holds[0].keys[1].rotate[3], 90.0);
    EXPECT_EQ(rod.on[0].kind, RodOn::Kind::Plane);
    EXPECT_EQ(rod.on[0].offset, 3.0);
    EXPECT_EQ(rod.loads[0].force[1], -1.0);
    EXPECT_EQ(scene.dt, 0.01);
    EXPECT_EQ(scene.integrator, "rk4");
    EXPECT_EQ(scene.gravity[2], -1.0);
    EXPECT_TRUE(scene.warnings.empty());
}

TEST(RodScene, names_the_key_that_is_wrong)
{
    const std::string line = R"("through": [[0,0,0],[1,0,0]])";
    for (const auto& [rod, words] :
         {std::pair<std::string, std::string>{"{}", "rods[0].: needs through or points"},
          {"{" + line + R"(, "points": [[0,0,0]]})", "needs through or points"},
          {R"({"through": [[0,0,0],[1,0]]})", "rods[0].through[1]: need three numbers"},
          {R"({"through": 3})", "rods[0].through: need a list"},
          {R"({"through": [[0,0,0],[1e31,0,0]]})", "rods[0].through[1]: is beyond 1e30"},
          {"{" + line + R"(, "EI": [1, "x"]})", "rods[0].EI: need 2 finite numbers"},
          {"{" + line + R"(, "radius": 0})", "rods[0].radius"},
          {"{" + line + R"(, "radius": []})", "rods[0].radius"},
          {"{" + line + R"(, "EI": [1, 0]})", "rods[0].EI"},
          {"{" + line + R"(, "EI": [1]})", "rods[0].EI: need 2 numbers"},
          {"{" + line + R"(, "nu": 0.6})", "rods[0].nu"},
          {"{" + line + R"(, "closed": 1})", "rods[0].closed: need true or false"},
          {"{" + line + R"(, "link": 1})", "rods[0].link"},
          {"{" + line + R"(, "name": "a\nb"})", "rods[0].name: has characters"},
          {"{" + line + R"(, "springs": [{"point": [0,0,0], "length": 1}]})",
           "rods[0].springs[0].stiffness: is missing, or damping"},
          {"{" + line + R"(, "springs": [{"stiffness": 1}]})",
           "rods[0].springs[0].point: is missing"},
          {"{" + line + R"(, "springs": [{"point": [0,0,0], "stiffness": -1}]})",
           "rods[0].springs[0].stiffness"},
          {"{" + line + R"(, "spline": "hermite"})", "rods[0].spline"},
          {"{" + line + R"(, "energy": "springs"})", "rods[0].energy: "},
          {"{" + line + R"(, "refine": true})", "rods[0].refine: is not supported"},
          {"{" + line + R"(, "fixed": [{"at": 2}]})", "rods[0].fixed[0].at"},
          {"{" + line + R"(, "fixed": [{"what": ["soul"]}]})",
           "rods[0].fixed[0].what[0]"},
          {"{" + line + R"(, "fixed": [{"keys": [{"time": 1}, {"time": 1}]}]})",
           "rods[0].fixed[0].keys[1].time: need times that rise"},
          {"{" + line + R"(, "fixed": [{"keys": [{"rotate": [0,0,0,9]}]}]})",
           "rods[0].fixed[0].keys[0].rotate: its axis has no length"},
          {"{" + line + R"(, "on": [{"at": "sliding", "point": [0,0,0]}]})",
           "rods[0].on[0].at: sliding is not supported"},
          {"{" + line + R"(, "on": [{"at": 0}]})", "needs one of point, plane and axis"},
          {"{" + line + R"(, "on": [{"plane": [0,0,0,1]}]})",
           "rods[0].on[0].plane: its direction has no length"},
          {"{" + line + "}, {" + line + R"(, "name": "rod1"})", "two are called 'rod1'"}})
    {
        SCOPED_TRACE(rod);
        const std::string text = error_of(Fault::Malformed, [&, &of = rod]
                                          { parse_rod_scene("s.json", scene_of(of)); });
        EXPECT_TRUE(contains(text, words)) << text;
    }
    for (const auto& [text, words] :
         {std::pair<std::string, std::string>{R"({"rods": []})", "cellwarp: is missing"},
          {R"({"cellwarp": 1})", "rods: is missing"},
          {R"({"cellwarp": 2, "rods": []})", "cellwarp"},
          {scene_of("{" + line + "}", R"({"dt": 0})"), "simulate.dt"},
          {scene_of("{" + line + "}", R"({"dt": 1e-12, "duration": 1e9})"),
           "simulate.duration: takes more than 1e9 steps"},
          {R"({"cellwarp": 1, "bodies": [{}], "rods": [{)" + line + "}]}",
           "bodies: is not supported"}})
        EXPECT_TRUE(contains(error_of(Fault::Malformed,
                                      [&, &of = text] { parse_rod_scene("s.json", of); }),
                             words))
            << text;
    EXPECT_EQ(parse_rod_scene("s.json", scene_of("{" + line + R"(, "colour": 1})"))
                  .warnings.size(),
              1u);
}

TEST(RodScene, warns_of_what_a_curve_has_no_use_for)
{
    const auto warnings = [](const std::string& rod)
    { return parse_rod_scene("x.json", scene_of("{" + rod + "}")).warnings; };
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

} // namespace cellwarp
