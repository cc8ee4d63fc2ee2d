// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/time/object_simulation.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <numbers>
#include <sstream>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <gtest/gtest.h>

#include "io/scene/scene_file.h"
#include "tests/support/files.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::error_of;

namespace
{

RodScene scene_of(const std::string& rod, const std::string& simulate)
{
    return parse_scene("s.json", R"({"cellwarp": 1, "rods": [{"name": "r", )" + rod +
                                     R"(}], "simulate": )" + simulate + "}")
        .time;
}

/// The determinant of a knot: that of its crossings' colours, for a curve whose ends are
/// joined far away. 1 of what is not knotted, 3 of the overhand knot.
int determinant(std::vector<Eigen::Vector3d> P)
{
    const Eigen::Vector3d first = P.front(), last = P.back(),
                          out = Eigen::Vector3d(3.0 * (last.x() > first.x() ? 1 : -1), 0,
                                                0),
                          up(0, 0, 50);
    P.insert(P.end(), {last + out, last + out + up, first - out + up, first - out});
    // From a side that no two of its places share.
    const Eigen::Matrix3d R =
        Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
    for (Eigen::Vector3d& p : P)
        p = R * p;
    struct Passage
    {
        double at;
        int crossing;
        bool is_over;
    };
    std::vector<Passage> passages;
    int count = 0;
    const std::size_t n = P.size();
    for (std::size_t i = 0; i < n; ++i)
        for (std::size_t j = i + 2; j < n; ++j)
        {
            const Eigen::Vector3d &p = P[i], &r = P[j], a = P[(i + 1) % n] - p,
                                  b = P[(j + 1) % n] - r;
            Eigen::Matrix2d A;
            A << a.x(), -b.x(), a.y(), -b.y();
            if ((i == 0 && j + 1 == n) || A.determinant() == 0.0)
                continue;
            const Eigen::Vector2d at = A.inverse() * (r - p).head<2>();
            if (at.minCoeff() <= 0.0 || at.maxCoeff() >= 1.0)
                continue;
            const bool is_over = p.z() + at[0] * a.z() > r.z() + at[1] * b.z();
            passages.push_back({double(i) + at[0], count, is_over});
            passages.push_back({double(j) + at[1], count, !is_over});
            ++count;
        }
    std::sort(passages.begin(), passages.end(),
              [](const Passage& a, const Passage& b) { return a.at < b.at; });
    if (count < 2)
        return 1;
    Eigen::MatrixXd colours = Eigen::MatrixXd::Zero(count, count);
    int arc = 0;
    for (const Passage& passage : passages)
        if (passage.is_over)
            colours(passage.crossing, arc % count) += 2.0;
        else
        {
            colours(passage.crossing, arc % count) -= 1.0;
            colours(passage.crossing, ++arc % count) -= 1.0;
        }
    const Eigen::MatrixXd minor = colours.bottomRightCorner(count - 1, count - 1);
    return static_cast<int>(std::lround(std::abs(minor.determinant())));
}

const std::string kLine = R"("through": [[0,0,0],[1,0,0]])";

} // namespace

TEST(ObjectSimulation, a_heavy_cantilever_sinks_as_theory_says)
{
    // q L^3 / EI = 1.5696 of a slender rod: E = rho g A L^3 / (I beta).
    const double beta = 1.5696, r = 0.001;
    const double young = 1000.0 * 9.81 * 4.0 / (r * r * beta);
    ObjectSimulation simulation(scene_of(
        kLine + R"(, "spans": 16, "radius": 0.001, "E": )" + std::to_string(young) +
            R"(, "fixed": [{"what": ["point","tangent","twist"]}])",
        R"({"integrator": "static"})"));
    EXPECT_EQ(simulation.num_steps(), 1);
    simulation.step();
    EXPECT_TRUE(simulation.report().is_converged);
    const Eigen::Vector3d tip = simulation.rods(2)[0].curve.back();
    EXPECT_NEAR(-tip.y(), 0.19046904, 2e-5);
    EXPECT_NEAR(1.0 - tip.x(), 0.02097189, 2e-5);
}

TEST(ObjectSimulation, keys_move_what_is_held)
{
    ObjectSimulation simulation(
        scene_of(kLine + R"(, "fixed": [{"at": 0, "keys": [{"time": 0},
                 {"time": 0.02, "translate": [0, 0.3, 0]}]}, {"at": 1, "what":
                 ["point", "tangent", "twist"], "keys": [{"time": 0}, {"time": 0.02,
                 "rotate": [0, 1, 0, 40]}]}])",
                 R"({"duration": 0.02, "gravity": [0, 0, 0]})"));
    while (simulation.steps_done() < simulation.num_steps())
        simulation.step();
    const SimulatedRod rod = simulation.rods(50)[0];
    EXPECT_LT((rod.curve.front() - Eigen::Vector3d(0, 0.3, 0)).norm(), 1e-9);
    EXPECT_LT((rod.curve.back() - Eigen::Vector3d(1, 0, 0)).norm(), 1e-9);
    const Eigen::Vector3d end = (rod.curve[49] - rod.curve[48]).normalized();
    EXPECT_NEAR(std::atan2(-end.z(), end.x()), 40.0 * std::numbers::pi / 180.0, 0.15);
}

TEST(ObjectSimulation, explicit_steps_beyond_their_limit_are_refused_with_it)
{
    const std::string text = error_of(
        Fault::Malformed, []
        { ObjectSimulation(scene_of(kLine, R"({"integrator": "rk4", "dt": 0.01})")); });
    EXPECT_TRUE(contains(text, "simulate.dt: got 0.01 s, rk4 is stable up to")) << text;
}

TEST(ObjectSimulation, curves_that_cannot_be_are_named)
{
    for (const std::string curve :
         {R"("through": [[0,0,0],[0,0,0]])", R"("points": [[0,0,0],[1,0,0],[2,0,0]])",
          R"("points": [[0,0,0],[0,0,0],[0,0,0],[0,0,0],[0,0,0]])",
          R"("points": [[0,0,0],[1,0,0],[0,0,0],[1,0,0]])",
          R"("spline": "catmull-rom", "points": [[0,0,0],[1,0,0],[2,0,0]])",
          R"("spline": "bezier", "points": [[0,0,0],[1,0,0]])",
          R"("spline": "bezier", "points": [[0,0,0],[1e-7,0,0],[0.5,0,0],[1,0,0],
             [1.0000001,0,0],[1.5,0,0],[2,0,0],[2.0000001,0,0],[2.5,0,0],[3,0,0]])",
          R"("closed": true, "through": [[0,0,0],[1,0,0],[0,1,0]])"})
        EXPECT_TRUE(contains(
            error_of(Fault::Malformed, [&] { ObjectSimulation(scene_of(curve, "{}")); }),
            "s.json: rods[0]: "))
            << curve;
}

TEST(ObjectSimulation, far_from_the_origin_it_is_the_same)
{
    const auto tip_from = [](double x)
    {
        const std::string at = std::to_string(x);
        const std::string end = std::to_string(x + 1.0);
        ObjectSimulation simulation(
            scene_of(R"("through": [[)" + at + ",0,0],[" + end +
                         R"(,0,0]], "spans": 8, "fixed": [{"at": 0}],
                         "on": [{"at": 1, "plane": [0, 0, 1, 0]}])",
                     R"({"dt": 0.005, "duration": 0.2})"));
        while (simulation.steps_done() < simulation.num_steps())
            simulation.step();
        const SimulationReport report = simulation.report();
        EXPECT_TRUE(report.is_converged) << report.stop;
        EXPECT_NEAR(simulation.surface(6).samples[0].x(), x, 0.02);
        return Eigen::Vector3d(simulation.rods(2)[0].curve[1] - Eigen::Vector3d(x, 0, 0));
    };
    const Eigen::Vector3d near = tip_from(0.0), far = tip_from(1048576.0);
    EXPECT_LT(near.y(), -0.1);
    EXPECT_LT((far - near).norm(), 1e-9);
}

TEST(ObjectSimulation, equilibria_follow_holds_that_turn_far)
{
    const auto solved = [](const std::string& rotate, const std::string& more)
    {
        ObjectSimulation simulation(scene_of(
            R"("through": [[0,0,0],[1,0,0]], "spans": 12, "fixed": [
               {"at": 0, "what": ["point", "tangent", "twist"], "keys":
                [{"time": 0, "rotate": )" +
                rotate + "}]}" + more + "]",
            R"({"integrator": "static", "gravity": [0, 0, 0]})"));
        simulation.step();
        const SimulationReport report = simulation.report();
        EXPECT_TRUE(report.is_converged) << report.stop;
        return std::pair(simulation.rods(2)[0].curve[1], report.elastic);
    };
    for (const double turn : {90.0, 135.0, 180.0})
    {
        const double a = turn * std::numbers::pi / 180.0;
        const Eigen::Vector3d tip =
            solved("[0, 0, 1, " + std::to_string(turn) + "]", "").first;
        EXPECT_LT((tip - Eigen::Vector3d(std::cos(a), std::sin(a), 0)).norm(), 1e-6);
    }
    // Two turns of twist: 1/2 GJ (4 pi)^2 / L.
    const double GJ = 1e6 / 2.6 * 0.5 * std::numbers::pi * 1e-8;
    const double elastic =
        solved("[1, 0, 0, 720]", R"(, {"at": 1, "what": ["twist"]})").second;
    EXPECT_NEAR(elastic / (0.5 * GJ * std::pow(4.0 * std::numbers::pi, 2)), 1.0, 1e-6);
}

TEST(ObjectSimulation, springs_are_for_cubic_splines)
{
    for (const std::string curve :
         {R"("degree": 5, "through": [[0,0,0],[1,0,0]])",
          R"("spline": "bezier", "points": [[0,0,0],[1,0,0],[2,0,0],[3,0,0]])"})
        EXPECT_TRUE(
            contains(error_of(Fault::Malformed,
                              [&] {
                                  ObjectSimulation(scene_of(
                                      curve + R"(, "elasticity": "discrete")", "{}"));
                              }),
                     "rods[0].elasticity: springs need a cubic spline"));
}

TEST(ObjectSimulation, the_first_frame_tells_what_is_off_its_place)
{
    ObjectSimulation simulation(scene_of(
        R"("through": [[0,0,0],[1,0,0]], "on": [{"at": 0, "point": [0, 0.5, 0]}])",
        "{}"));
    EXPECT_NEAR(simulation.report().violation, 0.5, 1e-12);
}

TEST(ObjectSimulation, an_equilibrium_needs_something_to_hold_on_to)
{
    const std::string rod = R"("through": [[0,0,0],[1,0,0]])";
    EXPECT_TRUE(contains(
        error_of(Fault::Malformed,
                 [&] { ObjectSimulation(scene_of(rod, R"({"integrator": "static"})")); }),
        "rods[0]: nothing holds it against its weight and loads"));
    ObjectSimulation without(
        scene_of(rod, R"({"integrator": "static", "gravity": [0, 0, 0]})"));
    without.step();
    EXPECT_TRUE(without.report().is_converged);
}

TEST(ObjectSimulation, what_hangs_on_two_springs_sinks_by_half_its_weight_each)
{
    // Far from the origin, and longer by what the springs are at the start.
    ObjectSimulation simulation(scene_of(
        R"("through": [[100,0,0],[101,0,0]], "radius": 0.05, "E": 1e9, "springs": [
        {"at": 0, "point": [100,2,0], "stiffness": 500, "damping": 3},
        {"at": 1, "point": [101,2,0], "stiffness": 500}])",
        R"({"integrator": "static"})"));
    simulation.step();
    const SimulationReport report = simulation.report();
    EXPECT_TRUE(report.is_converged) << report.stop;
    const double weight = std::numbers::pi * 0.05 * 0.05 * 1000.0 * 9.81;
    const SimulatedRod rod = simulation.rods(3)[0];
    EXPECT_NEAR(rod.curve[0].y(), -weight / 1000.0, 1e-6);
    EXPECT_NEAR(rod.curve[2].y(), -weight / 1000.0, 1e-6);
}

TEST(ObjectSimulation, holds_that_turn_far_within_a_step_end_where_the_keys_say)
{
    // The end is bent by 150 degrees in one step.
    ObjectSimulation simulation(
        scene_of(kLine + R"(, "fixed": [{"at": 0, "what": ["point","tangent","twist"]},
        {"at": 1, "what": ["tangent"], "keys": [{"time": 0}, {"time": 0.1, "rotate": [0,0,1,150]}]}])",
                 R"({"dt": 0.1, "duration": 0.1, "gravity": [0,0,0]})"));
    simulation.step();
    EXPECT_TRUE(simulation.report().is_converged);
    const std::vector<Eigen::Vector3d> curve = simulation.rods(2001)[0].curve;
    const Eigen::Vector3d end = (curve.back() - curve[curve.size() - 2]).normalized();
    EXPECT_NEAR(end.x(), std::cos(150.0 * std::numbers::pi / 180.0), 1e-2);
    EXPECT_NEAR(end.y(), 0.5, 1e-2);
}

TEST(ObjectSimulation, whole_turns_count_from_a_key_that_does_not_turn)
{
    const auto energy = [](const std::string& first, const std::string& rule)
    {
        ObjectSimulation simulation(scene_of(
            kLine + R"(, "fixed": [{"at": 0, "what": ["point","tangent","twist"]},
            {"at": 1, "what": ["point","tangent","twist"], "keys": [{"time": 0)" +
                first + R"(}, {"time": 0.1, "rotate": [-2,0,0,-720]}]}])",
            R"({"dt": 0.01, "duration": 0.1, "gravity": [0,0,0], "viscosity": 1,
                "integrator": ")" +
                rule + "\"}"));
        while (simulation.steps_done() < simulation.num_steps())
            simulation.step();
        return simulation.report().elastic;
    };
    const double wanted = energy("", "static");
    EXPECT_GT(wanted, 0.0);
    EXPECT_NEAR(energy("", "implicit-euler"), wanted, 0.1 * wanted);
    EXPECT_NEAR(energy(R"(, "rotate": [1,0,0,0])", "implicit-euler"), wanted,
                0.1 * wanted);
}

TEST(ObjectSimulation, a_rope_slides_through_a_hole_sticks_in_it_or_leaves_it)
{
    const auto run = [](const std::string& more, double duration)
    {
        ObjectSimulation simulation(scene_of(
            R"("through": [[-0.6,0,0],[0.6,0,0]], "spans": 44, "E": 1e6,
            "on": [{"at": "sliding", "point": [0.1,0,0])" +
                more + "}]",
            R"({"dt": 0.002, "viscosity": 0.1, "duration": )" + std::to_string(duration) +
                "}"));
        while (simulation.steps_done() < simulation.num_steps())
        {
            simulation.step();
            EXPECT_LT(simulation.report().violation, 1e-9);
        }
        return simulation.rods(3)[0];
    };
    const double start = 0.7 / 1.2;
    EXPECT_NEAR(run("", 0.002).sliding[0], start, 1e-3);
    EXPECT_NEAR(run(R"(, "friction": 5)", 0.4).sliding[0], start, 1e-3);
    EXPECT_GT(run("", 0.6).sliding[0], start + 0.05);
    // Stopped, or released and in free fall.
    const std::string range = R"(, "range": [0.5, 0.62])";
    const SimulatedRod stopped = run(range, 0.8);
    EXPECT_LE(stopped.sliding[0], 0.62 + 1e-12);
    EXPECT_GT(stopped.sliding[0], 0.6);
    const SimulatedRod gone = run(range + R"(, "end": "release")", 0.8);
    EXPECT_LT(gone.curve[1].y(), stopped.curve[1].y() - 0.2);
}

namespace
{

RodScene joined(const std::string& rods, const std::string& more,
                const std::string& simulate)
{
    return parse_scene("s.json", R"({"cellwarp": 1, "rods": [)" + rods + "], " + more +
                                     R"(, "simulate": )" + simulate + "}")
        .time;
}

const std::string kRope = R"({"name": "r", "through": [[0,0,0],[1,0,0]], "spans": 10,
                              "E": 1e7, "fixed": [{"at": 0}]})";

} // namespace

TEST(ObjectSimulation, a_body_hangs_on_its_rope_far_from_the_origin_as_well)
{
    for (const double far : {0.0, 1e4})
    {
        SCOPED_TRACE(far);
        const std::string a = std::to_string(far), b = std::to_string(far + 1.0);
        ObjectSimulation simulation(joined(
            R"({"name": "r", "through": [[)" + a + ",0,0],[" + b +
                R"(,0,0]], "spans": 10, "E": 1e7, "fixed": [{"at": 0}]})",
            R"("bodies": [{"name": "weight", "mass": 2, "at": [)" + b +
                R"(,0,0]}], "connections": [{"a": "rod r 1", "b": "body weight 0 0 0"}])",
            R"({"integrator": "static"})"));
        simulation.step();
        const SimulationReport report = simulation.report();
        EXPECT_TRUE(report.is_converged) << report.stop;
        const SimulatedBody weight = simulation.bodies()[0];
        EXPECT_NEAR(weight.at.x(), far, 1e-5);
        EXPECT_LT(weight.at.y(), -1.0);
        EXPECT_GT(weight.at.y(), -1.02);
        EXPECT_LT((weight.at - simulation.rods(2)[0].curve.back()).norm(), 1e-9);
    }
}

TEST(ObjectSimulation, rods_bodies_and_nets_that_are_joined_go_together_and_others_alone)
{
    ObjectSimulation simulation(joined(
        kRope + R"(, {"name": "alone", "through": [[0,5,0],[1,5,0]]})",
        R"("bodies": [{"name": "ring", "mass": 0.2, "at": [0.5,0,0]}, {"name": "stone",
           "at": [3,0,0], "velocity": [0,1,0]}],
           "nets": [{"name": "net", "points": [[1,0,0],[1.5,0,0]], "springs": [[0,1,100]],
                     "mass": 0.1}],
           "connections": [{"a": "rod r sliding", "b": "body ring 0 0 0"},
                      {"a": "rod r 1", "b": "net net 0"}])",
        R"({"dt": 0.002, "duration": 0.1})"));
    while (simulation.steps_done() < simulation.num_steps())
    {
        simulation.step();
        const SimulationReport report = simulation.report();
        EXPECT_TRUE(report.is_converged) << report.stop;
        EXPECT_LT(report.violation, 1e-9);
    }
    const SimulatedRod rope = simulation.rods(2)[0];
    EXPECT_LT((rope.curve.back() - simulation.nets()[0].points[0]).norm(), 1e-9);
    ASSERT_EQ(rope.sliding.size(), 1u);
    EXPECT_GT(rope.sliding[0], 0.5);
    // What flies by itself falls by g t (t + dt) / 2.
    const double fall = 0.5 * 9.81 * 0.1 * 0.102;
    EXPECT_NEAR(simulation.bodies()[1].at.y(), 0.1 - fall, 1e-9);
    EXPECT_NEAR(simulation.rods(2)[1].curve[0].y(), 5.0 - fall, 1e-9);
    const Geometry surface = simulation.surface(6);
    EXPECT_EQ(surface.groups.size(), 5u);
    EXPECT_EQ(surface.groups.back().end_face, surface.num_faces());
}

TEST(ObjectSimulation, a_ring_that_keys_move_carries_the_rope)
{
    ObjectSimulation simulation(scene_of(
        kLine + R"(, "spans": 20, "E": 1e6, "on": [{"at": "sliding", "start": 0.5,
            "point": [0.5,0,0], "keys": [{"time": 0}, {"time": 0.2,
            "translate": [0,0.4,0.1]}]}])",
        R"({"dt": 0.002, "duration": 0.2, "gravity": [0,0,0]})"));
    while (simulation.steps_done() < simulation.num_steps())
        simulation.step();
    EXPECT_TRUE(simulation.report().is_converged);
    double nearest = 1.0;
    const std::vector<SimulatedRod> rods = simulation.rods(2001);
    for (const Eigen::Vector3d& p : rods[0].curve)
        nearest = std::min(nearest, (p - Eigen::Vector3d(0.5, 0.4, 0.1)).norm());
    EXPECT_LT(nearest, 1e-3);
}

TEST(ObjectSimulation, rubs_on_a_rail_that_keys_have_turned_as_on_one_that_stood_so)
{
    const auto slid = [](const std::string& rail, double across, double friction)
    {
        ObjectSimulation simulation(scene_of(
            R"("through": [[0,-0.5,0],[0,0,0],[0,0.5,0]], "spans": 6, "E": 1e9,
               "loads": [{"at": 0.5, "force": [0,1,)" +
                std::to_string(across) +
                R"(]}], "on": [{"at": "sliding", "start": 0.5, "friction": )" +
                std::to_string(friction) + R"(, "axis": )" + rail +
                R"(}, {"at": 0.25, "plane": [0,0,1,0]},
               {"at": 0.75, "plane": [0,0,1,0]}, {"at": 0.25, "plane": [1,0,0,0]},
               {"at": 0.75, "plane": [1,0,0,0]}])",
            R"({"duration": 0.3, "gravity": [0,0,0]})"));
        while (simulation.steps_done() < simulation.num_steps())
            simulation.step();
        return simulation.rods(2)[0].sliding.at(0);
    };
    const std::string turned =
        R"([0,0,0, 1,0,0], "keys": [{"time": 0, "rotate": [0,0,1,60]}])";
    const std::string stood = "[0,0,0, 0.5,0.8660254037844386,0]";
    // Nothing presses across both the rail and the rod: no friction, whatever its number.
    for (const double friction : {0.0, 0.9, 3.0})
    {
        EXPECT_NEAR(slid(stood, 0.0, friction), 0.356283, 2e-6);
        EXPECT_NEAR(slid(turned, 0.0, friction), 0.356283, 2e-6);
    }
    const double rubbed = slid(stood, 1.0, 0.3);
    EXPECT_GT(rubbed, 0.36);
    EXPECT_LT(rubbed, 0.49);
    EXPECT_NEAR(slid(turned, 1.0, 0.3), rubbed, 1e-4);
}

TEST(ObjectSimulation, what_keys_carry_evenly_has_the_momentum_of_its_speed)
{
    for (const auto& [rule, dt] :
         {std::pair("implicit-euler", "1e-3"), std::pair("midpoint", "1e-3"),
          std::pair("rk4", "1e-5")})
        for (const std::string what : {R"(["point"])", R"(["point","tangent","twist"])"})
        {
            SCOPED_TRACE(rule + what);
            ObjectSimulation simulation(scene_of(
                kLine + R"(, "spans": 2, "radius": 0.02, "velocity": [1,0,0],
                   "fixed": [{"what": )" +
                    what + R"(, "keys": [{"time": 0},
                   {"time": 1, "translate": [1,0,0]}]}])",
                std::string(R"({"duration": 0.02, "gravity": [0,0,0], "integrator": ")") +
                    rule + R"(", "dt": )" + dt + "}"));
            const double mass = 1000.0 * std::numbers::pi * 4e-4;
            while (simulation.steps_done() < simulation.num_steps())
                simulation.step();
            const SimulationReport report = simulation.report();
            EXPECT_TRUE(report.is_converged) << report.stop;
            EXPECT_NEAR(report.momentum.x() / mass, 1.0, 1e-9);
            EXPECT_NEAR(report.kinetic / (0.5 * mass), 1.0, 1e-9);
            EXPECT_LT(report.elastic, 1e-12);
        }
}

TEST(ObjectSimulation, friction_in_a_hole_is_the_same_from_a_frame_that_moves)
{
    const auto slid = [](const std::string& rule, const Eigen::Vector3d& v)
    {
        const auto vector = [&](double scale)
        {
            return "[" + std::to_string(scale * v.x()) + "," +
                   std::to_string(scale * v.y()) + "," + std::to_string(scale * v.z()) +
                   "]";
        };
        ObjectSimulation simulation(scene_of(
            R"("through": [[-0.5,0,0],[0,0,0],[0.5,0,0]], "spans": 6, "E": 1e5,
               "loads": [{"at": 0, "force": [-1,-1,0]}, {"at": 1, "force": [1.6,-1,0]}],
               "velocity": )" +
                vector(1.0) + R"(, "on": [{"at": "sliding", "start": 0.5,
               "point": [0,0,0], "friction": 0.3, "keys": [{"time": 0},
               {"time": 10, "translate": )" +
                vector(10.0) + "}]}]",
            R"({"duration": 0.1, "gravity": [0,0,0], "integrator": ")" + rule));
        while (simulation.steps_done() < simulation.num_steps())
            simulation.step();
        return simulation.rods(2)[0].sliding.at(0);
    };
    for (const std::string rule :
         {R"(implicit-euler", "dt": 1e-3})", R"(rk4", "dt": 1e-4})"})
    {
        SCOPED_TRACE(rule);
        const double still = slid(rule, {0, 0, 0});
        EXPECT_NEAR(still, 0.4942, 5e-4);
        for (const Eigen::Vector3d& v :
             {Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(0, 1, 0),
              Eigen::Vector3d(1, 0, 0)})
            EXPECT_NEAR(slid(rule, v), still, 1e-8) << v.transpose();
    }
}

TEST(ObjectSimulation, a_rod_that_keys_lead_pushes_another_the_same_at_any_step)
{
    for (const std::string dt : {"2e-3", "5e-3", "1e-2", "2e-2"})
    {
        SCOPED_TRACE(dt);
        const std::string keys = R"("keys": [{"time": 0},
                                    {"time": 0.5, "translate": [1,0,0]}]})";
        ObjectSimulation simulation(
            parse_scene(
                "s.json",
                R"({"cellwarp": 1, "rods": [{"through": [[0,0,-0.2],[0,0,0],[0,0,0.2]],
                "E": 1e8, "fixed": [{"at": 0, "what": ["point"], )" +
                    keys + R"(, {"at": 1, "what": ["point"], )" + keys + R"(]},
               {"through": [[0.1,-0.2,0],[0.1,0,0],[0.1,0.2,0]], "E": 1e6}],
               "rod_contact": true, "simulate": {"duration": 0.2, "every": 0.1,
               "gravity": [0,0,0], "dt": )" +
                    dt + "}}")
                .time);
        while (simulation.steps_done() < simulation.num_steps())
            simulation.step();
        const SimulationReport report = simulation.report();
        EXPECT_TRUE(report.is_converged) << report.stop;
        EXPECT_NEAR(simulation.rods(33)[1].curve[16].x(), 0.4155, 1.2e-3);
    }
}

TEST(ObjectSimulation, a_body_that_keys_turn_takes_along_what_is_joined_to_it)
{
    ObjectSimulation simulation(
        joined(R"({"name": "r", "through": [[0,0,0],[1,0,0]], "spans": 8, "E": 1e6})",
               R"("bodies": [{"name": "hand", "keys": [{"time": 0}, {"time": 0.5,
                  "rotate": [0,0,1,120], "translate": [0,1,0]}]}],
                  "connections": [{"a": "rod r 0", "b": "body hand 0 0 0",
                              "what": ["point", "frame"]}])",
               R"({"dt": 0.005, "duration": 0.5, "gravity": [0,0,0]})"));
    while (simulation.steps_done() < simulation.num_steps())
        simulation.step();
    EXPECT_TRUE(simulation.report().is_converged);
    const std::vector<Eigen::Vector3d> curve = simulation.rods(1001)[0].curve;
    EXPECT_LT((curve[0] - Eigen::Vector3d(0, 1, 0)).norm(), 1e-9);
    const Eigen::Vector3d tangent = (curve[1] - curve[0]).normalized();
    EXPECT_NEAR(std::atan2(tangent.y(), tangent.x()), 2.0 * std::numbers::pi / 3.0, 0.02);
}

TEST(ObjectSimulation, beads_on_a_closed_thread_keep_their_distances_around_it)
{
    std::string points, bodies, joints;
    for (int k = 0; k < 24; ++k)
    {
        const double a = 2.0 * std::numbers::pi * k / 24;
        points += (k ? ",[" : "[") + std::to_string(0.5 * std::cos(a)) + "," +
                  std::to_string(0.5 * std::sin(a)) + ",0]";
    }
    for (int k = 0; k < 6; ++k)
    {
        const std::string name = "bead" + std::to_string(k);
        const double a = 2.0 * std::numbers::pi * (k + 0.5) / 7.0;
        bodies += (k ? "," : "") +
                  (R"({"name": ")" + name + R"(", "mass": 0.01, "at": [)") +
                  std::to_string(0.5 * std::cos(a)) + "," +
                  std::to_string(0.5 * std::sin(a)) + ",0]}";
        joints += (k ? "," : "") + (R"({"a": "rod thread sliding", "b": "body )" + name +
                                    R"( 0 0 0", "apart": 0.2})");
    }
    ObjectSimulation simulation(
        joined(R"({"name": "thread", "through": [)" + points +
                   R"(], "closed": true, "spans": 1, "radius": 0.003,
                                     "E": 1e8, "fixed": [{"at": 0.25}]})",
               R"("bodies": [)" + bodies + R"(], "connections": [)" + joints + "]",
               R"({"dt": 0.002, "duration": 0.6, "viscosity": 0.05})"));
    const double length = std::numbers::pi;
    double least = 1.0;
    while (simulation.steps_done() < simulation.num_steps())
    {
        simulation.step();
        const SimulationReport report = simulation.report();
        EXPECT_TRUE(report.is_converged) << report.stop;
        const std::vector<double> at = simulation.rods(2)[0].sliding;
        for (std::size_t k = 0; k < at.size(); ++k)
        {
            const double ahead = at[(k + 1) % at.size()] - at[k];
            least = std::min(least, (ahead - std::floor(ahead)) * length);
        }
    }
    EXPECT_GT(least, 0.2 - 1e-3);
    EXPECT_LT(least, 0.25); // they have run together below
}

TEST(ObjectSimulation, a_body_goes_to_its_first_key_in_parts_with_what_it_holds)
{
    for (const double turn : {80.0, 100.0, 170.0, -170.0})
    {
        SCOPED_TRACE(turn);
        ObjectSimulation simulation(joined(
            R"({"name": "r", "through": [[0,0,0],[1,0,0]], "spans": 8, "E": 1e8})",
            R"("bodies": [{"name": "hand", "keys": [{"time": 0, "rotate": [0,0,1,)" +
                std::to_string(turn) + R"(]}]}],
                  "connections": [{"a": "rod r 0", "b": "body hand 0 0 0",
                              "what": ["point", "frame"]}])",
            R"({"dt": 0.005, "duration": 2, "viscosity": 0.5, "gravity": [0,0,0]})"));
        while (simulation.steps_done() < simulation.num_steps())
            simulation.step();
        EXPECT_TRUE(simulation.report().is_converged);
        const double a = turn * std::numbers::pi / 180.0;
        EXPECT_LT((simulation.rods(2)[0].curve.back() -
                   Eigen::Vector3d(std::cos(a), std::sin(a), 0))
                      .norm(),
                  0.2);
    }
}

TEST(ObjectSimulation, a_bead_that_was_released_lets_the_next_one_leave)
{
    ObjectSimulation simulation(
        joined(R"({"name": "r", "through": [[0,0,0],[0,-1,0]], "spans": 10, "E": 1e8,
                   "fixed": [{"at": 0}, {"at": 0.5}, {"at": 1}]})",
               R"("bodies": [{"name": "a", "mass": 0.1, "at": [0,-0.9,0]},
                             {"name": "b", "mass": 0.1, "at": [0,-0.6,0]}],
                  "connections": [{"a": "rod r sliding", "b": "body b 0 0 0", "apart": 0.1,
                              "end": "release"},
                             {"a": "rod r sliding", "b": "body a 0 0 0", "apart": 0.1,
                              "end": "release"}])",
               R"({"dt": 0.002, "duration": 0.6})"));
    while (simulation.steps_done() < simulation.num_steps())
        simulation.step();
    EXPECT_TRUE(simulation.report().is_converged);
    for (const SimulatedBody& body : simulation.bodies())
        EXPECT_LT(body.at.y(), -1.5);
}

TEST(ObjectSimulation, places_that_slide_on_each_other_start_within_their_range)
{
    const auto start = [](const std::string& range)
    {
        ObjectSimulation simulation(joined(
            R"({"name": "a", "through": [[-1,0,0],[1,0,0]], "spans": 8},
               {"name": "b", "through": [[0,0,-1],[0.4,0,1]], "spans": 8})",
            R"("connections": [{"a": "rod a sliding", "b": "rod b sliding")" + range +
                "}]",
            "{}"));
        return simulation.rods(2);
    };
    EXPECT_NEAR(start("")[0].sliding[0], 0.6, 5e-3);
    EXPECT_NEAR(start("")[1].sliding[0], 0.5, 5e-3);
    EXPECT_GE(start(R"(, "range": [0.55, 1])")[1].sliding[0], 0.55 - 1e-9);
    EXPECT_NEAR(start(R"(, "start": 0.6, "other_start": 0.5)")[0].sliding[0], 0.6, 1e-9);
    // The one that is not told follows from the other.
    EXPECT_NEAR(start(R"(, "start": 0.6)")[1].sliding[0], 0.5, 5e-3);
    EXPECT_NEAR(start(R"(, "other_start": 0.5)")[0].sliding[0], 0.6, 5e-3);
}

TEST(ObjectSimulation, two_places_of_one_rod_keep_their_frames_and_their_distance)
{
    ObjectSimulation simulation(scene_of(
        R"("through": [[0,0,0],[0.5,0.1,0],[1,0,0]], "spans": 8, "E": 1e6, "rest": "straight",
            "fixed": [{"at": 0.5}]}], "connections": [{"a": "rod r 0", "b": "rod r 1",
            "what": ["frame", "distance"])",
        R"({"dt": 0.002, "duration": 0.3})"));
    const auto seen = [&]
    {
        const std::vector<Eigen::Vector3d> curve = simulation.rods(2001)[0].curve;
        return std::pair((curve.back() - curve.front()).norm(),
                         (curve[1] - curve[0])
                             .normalized()
                             .dot((curve[2000] - curve[1999]).normalized()));
    };
    const auto [distance, angle] = seen();
    while (simulation.steps_done() < simulation.num_steps())
    {
        simulation.step();
        EXPECT_TRUE(simulation.report().is_converged);
    }
    EXPECT_NEAR(seen().first, distance, 1e-9);
    EXPECT_NEAR(seen().second, angle, 1e-4);
}

TEST(ObjectSimulation, a_noose_of_a_closed_rod_stays_off_its_own_place)
{
    std::string points;
    for (int k = 0; k < 12; ++k)
    {
        const double a = 2.0 * std::numbers::pi * k / 12;
        points += (k ? ",[" : "[") + std::to_string(std::cos(a)) + "," +
                  std::to_string(0.1 * std::sin(a)) + ",0]";
    }
    ObjectSimulation simulation(scene_of(
        R"("through": [)" + points + R"(], "closed": true, "spans": 2, "radius": 0.02,
            "E": 1e6, "on": [{"at": 0.25, "rod": "r", "other": "sliding"}])",
        R"({"dt": 0.002, "duration": 0.2, "gravity": [0,0,0], "viscosity": 1})"));
    const double begin = simulation.rods(2)[0].sliding[0];
    EXPECT_NEAR(begin, 0.75, 0.05); // across the narrow ring
    while (simulation.steps_done() < simulation.num_steps())
        simulation.step();
    EXPECT_TRUE(simulation.report().is_converged);
    EXPECT_GT(std::abs(simulation.rods(2)[0].sliding[0] - 0.25), 0.02 - 1e-6);
}

TEST(ObjectSimulation, refuses_what_cannot_be_joined)
{
    const auto refused = [](const std::string& rods, const std::string& more,
                            const std::string& simulate = "{}")
    {
        return error_of(Fault::Malformed,
                        [&] { ObjectSimulation(joined(rods, more, simulate)); });
    };
    const std::string weight =
        R"("bodies": [{"name": "b", "at": [1,0,0]}], "connections": )";
    EXPECT_TRUE(
        contains(refused(kRope, weight + R"([{"a": "rod r 1", "b": "body b 0 0 0"}])",
                         R"({"integrator": "rk4", "dt": 1e-5})"),
                 "simulate.integrator: bodies, nets and what is joined"));
    EXPECT_TRUE(contains(
        refused(kRope, R"("bodies": [{"name": "loose"}])", R"({"integrator": "static"})"),
        "simulate.integrator: nothing holds loose against its weight"));
    EXPECT_TRUE(contains(
        refused(kRope, weight + R"([{"a": "body b 0 0 0", "b": "body b 0 0 1"}])"),
        "connections[0]: joins b to itself"));
    EXPECT_TRUE(contains(refused(kRope, weight + R"([{"a": "rod r 1", "b": "body b 0 0 0",
                                 "what": ["distance"]}])"),
                         "connections[0].what: a distance of 0 has no direction"));
    EXPECT_TRUE(contains(refused(R"({"name": "r", "through": [[0,0,0],[1,0,0]],
                    "on": [{"at": "sliding", "point": [0,2,0]}]})",
                                 R"("bodies": [])"),
                         "rods[0].on[0]: its place on the rod is 2 m away"));
    EXPECT_TRUE(contains(refused(kRope, weight + R"([{"a": "rod r sliding",
                                 "b": "body b 0 0 0", "inertia": -10}])"),
                         "connections[0].inertia: got -10 kg, need more than -"));
    EXPECT_TRUE(contains(refused(R"({"name": "r", "through": [[0,0,0],[1,0,0]],
                    "on": [{"at": "sliding", "point": [0.5,0,0], "apart": 0.1},
                           {"at": "sliding", "point": [0.55,0,0], "apart": 0.1}]})",
                                 R"("bodies": [])"),
                         "rods[0].on[1].apart: it starts too near"));
    ObjectSimulation pulled(
        joined(R"({"name": "r", "through": [[0,0,0],[1,0,0]], "E": 1e6,
                                "on": [{"at": "sliding", "point": [0.5,0.1,0]}]})",
               weight + R"([{"a": "rod r 0", "b": "body b 0 0.1 0"}])", "{}"));
    EXPECT_EQ(pulled.warnings().size(), 2u);
}

TEST(ObjectSimulation, an_obstacle_without_faces_is_refused)
{
    const support::Folder folder;
    folder.write("points.obj", "v 0 0 0\nv 1 0 0\n");
    const RodScene scene =
        parse_scene(folder / "s.json", R"({"cellwarp": 1, "rods": [)" + kRope +
                                           R"(], "obstacles": [{"mesh": "points.obj"}]})")
            .time;
    EXPECT_TRUE(contains(error_of(Fault::Malformed, [&] { ObjectSimulation{scene}; }),
                         "points.obj: has no faces to touch"));
}

TEST(ObjectSimulation, what_slides_needs_a_rule_that_knows_it)
{
    const std::string text =
        error_of(Fault::Malformed,
                 []
                 {
                     ObjectSimulation(scene_of(
                         kLine + R"(, "on": [{"at": "sliding", "point": [0.5,0,0]}])",
                         R"({"integrator": "midpoint"})"));
                 });
    EXPECT_TRUE(
        contains(text, "simulate.integrator: what slides needs implicit-euler, rk4"))
        << text;
    EXPECT_TRUE(contains(
        error_of(Fault::Malformed,
                 []
                 {
                     ObjectSimulation(scene_of(kLine + R"(, "E": 1e4, "on": [
                             {"at": "sliding", "point": [0.3,0,0], "apart": 0.1},
                             {"at": "sliding", "point": [0.7,0,0], "apart": 0.1}])",
                                               R"({"integrator": "rk4", "dt": 1e-5})"));
                 }),
        "simulate.integrator: what stays apart needs implicit-euler or static"));
}

TEST(ObjectSimulation, of_springs_and_of_the_tensor_comes_near_the_exact_rod)
{
    std::map<std::string, Eigen::Vector3d> tips;
    for (const std::string energy : {"exact", "continuous", "discrete"})
    {
        ObjectSimulation simulation(scene_of(
            R"("through": [[0,0,0],[1,0,0]], "spans": 8, "radius": 0.02, "E": 1e7,
               "fixed": [{"at": 0, "what": ["point", "tangent", "twist"]}],
               "elasticity": ")" +
                energy + '"',
            R"({"dt": 0.002, "duration": 0.2})"));
        while (simulation.steps_done() < simulation.num_steps())
            simulation.step();
        const SimulationReport report = simulation.report();
        EXPECT_TRUE(report.is_converged) << energy;
        EXPECT_LT(report.iterations, 8 * simulation.num_steps()) << energy;
        tips[energy] = simulation.rods(2)[0].curve[1];
    }
    EXPECT_GT((tips["exact"] - Eigen::Vector3d(1, 0, 0)).norm(), 0.05);
    EXPECT_LT((tips["continuous"] - tips["exact"]).norm(), 2e-3);
    EXPECT_LT((tips["discrete"] - tips["exact"]).norm(), 5e-3);
}

TEST(ObjectSimulation, every_kind_of_curve_falls_without_a_stop)
{
    for (
        const std::string curve :
        {R"("points": [[0,0,0],[1,0,0],[1,1,0],[2,1,0.5],[3,1,0]])",
         R"("spline": "uniform", "points": [[0,0,0],[1,0,0],[1,1,0],[2,1,0.5],[3,1,0]])",
         R"("spline": "catmull-rom", "points": [[0,0,0],[1,0,0],[1,1,0],[2,1,0.5]])",
         R"("spline": "bezier", "points": [[0,0,0],[1,0,0],[1,1,0],[2,1,0.5],[3,1,0]])",
         R"("closed": true, "through": [[1,0,0],[0,1,0],[-1,0,0],[0,-1,0.2]])",
         R"("degree": 5, "spline": "uniform", "points": [[0,0,0],[1,0,0],[2,0,0],[3,1,0],[4,1,0],[5,1,1]])"})
    {
        SCOPED_TRACE(curve);
        ObjectSimulation simulation(scene_of(std::string(curve) + R"(, "radius": 0.05)",
                                             R"({"dt": 0.01, "duration": 0.05})"));
        while (simulation.steps_done() < simulation.num_steps())
            simulation.step();
        const SimulationReport report = simulation.report();
        EXPECT_TRUE(report.is_converged) << report.stop;
        EXPECT_GT(report.kinetic, 0.0);
        const Geometry tube = simulation.surface(6);
        EXPECT_EQ(tube.samples.size() % 6, 0u);
        EXPECT_EQ(tube.groups.size(), 1u);
        for (const Eigen::Vector3d& p : tube.samples)
            EXPECT_TRUE(p.allFinite());
    }
}

TEST(ObjectSimulation, a_rod_that_is_cut_falls_in_two_with_mass_and_momentum_kept)
{
    ObjectSimulation simulation(scene_of(
        R"("through": [[0,0,0],[0.5,0.05,0],[1,0,0]], "spans": 6, "rest": "straight",
           "velocity": [0, 0, 1], "cut": [{"at": 0.4, "time": 0.05}])",
        R"({"dt": 0.005, "duration": 0.2, "gravity": [0, 0, 0]})"));
    const SimulationReport before = simulation.report();
    EXPECT_EQ(simulation.rods(5).size(), 1u);
    while (simulation.steps_done() < simulation.num_steps())
        simulation.step();
    const SimulationReport after = simulation.report();
    EXPECT_TRUE(after.is_converged);
    EXPECT_LT((after.momentum - before.momentum).norm(), 1e-11 * before.momentum.norm());
    const std::vector<SimulatedRod> rods = simulation.rods(5);
    ASSERT_EQ(rods.size(), 2u);
    EXPECT_EQ(rods[0].name, "r.1");
    EXPECT_EQ(rods[1].name, "r.2");
    EXPECT_NEAR(rods[0].length / (rods[0].length + rods[1].length), 0.4, 0.01);
    EXPECT_EQ(simulation.surface(6).groups.size(), 2u);
}

TEST(ObjectSimulation, a_rod_breaks_where_a_limit_is_passed)
{
    // A pull of 10 N that comes at once: 20 N at the most.
    for (const int limit : {9, 25})
    {
        ObjectSimulation pulled(scene_of(
            R"("through": [[0,0,0],[0,-1,0]], "density": 1, "E": 1e7, "fixed": [{}],
               "loads": [{"force": [0, -10, 0]}], "cut": [{"force": )" +
                std::to_string(limit) + "}]",
            R"({"dt": 0.01, "duration": 0.3, "viscosity": 50, "gravity": [0, 0, 0]})"));
        for (int k = 0; k < 5; ++k)
            pulled.step();
        EXPECT_EQ(pulled.rods(2).size(), limit < 10 ? 2u : 1u) << limit;
    }
}

TEST(ObjectSimulation, an_equilibrium_refines_until_it_need_not)
{
    const std::string hairpin =
        R"("through": [[0,0,0],[0.5,0.4,0],[1,0,0]], "spans": 2, "rest": "straight",
           "E": 1e6, "fixed": [{"at": 0}, {"at": 1, "keys": [{"time": 0,
           "translate": [-0.85, 0, 0]}]}])";
    const auto knots = [&](const std::string& more)
    {
        ObjectSimulation simulation(
            scene_of(hairpin + more, R"({"integrator": "static"})"));
        simulation.step();
        EXPECT_TRUE(simulation.report().is_converged);
        return simulation.rods(2)[0].knots;
    };
    EXPECT_EQ(knots(""), 5);
    EXPECT_GT(knots(R"(, "refine": true)"), 7);
    EXPECT_GT(knots(R"(, "refine": {"insert": 0.2, "remove": 0.1, "shortest": 0.001})"),
              knots(R"(, "refine": true)"));
}

TEST(ObjectSimulation, rods_lie_on_what_is_there_and_on_each_other)
{
    for (const std::string rule :
         {R"("implicit-euler", "dt": 0.002)", R"("rk4", "dt": 0.0002)"})
    {
        const RodScene scene = parse_scene("s.json", R"({"cellwarp": 1, "rods": [
            {"through": [[-0.3,0.02,0],[0.3,0.02,0]], "radius": 0.02, "E": 1e6},
            {"through": [[0,0.07,-0.3],[0,0.07,0.3]], "radius": 0.02, "E": 1e6}],
            "obstacles": [{"plane": [0,1,0,0]}], "rod_contact": {"friction": 0.5},
            "simulate": {"duration": 0.6, "viscosity": 2, "integrator": )" +
                                                         rule + "}}")
                                   .time;
        ObjectSimulation simulation(scene);
        EXPECT_TRUE(simulation.warnings().empty());
        while (simulation.steps_done() < simulation.num_steps())
            simulation.step();
        const SimulationReport report = simulation.report();
        EXPECT_TRUE(report.has_contacts);
        EXPECT_GT(report.contacts, 10);
        EXPECT_GT(*report.nearest, 0.9);
        EXPECT_LT(report.kinetic, 2e-3);
        const std::vector<SimulatedRod> rods = simulation.rods(3);
        EXPECT_NEAR(rods[0].curve[1].y(), 0.02, 0.002);
        EXPECT_NEAR(rods[1].curve[1].y(), 0.06, 0.004);
        EXPECT_GT(simulation.stage(6).num_faces(), simulation.surface(6).num_faces());
    }
    EXPECT_TRUE(contains(error_of(Fault::Malformed,
                                  []
                                  {
                                      ObjectSimulation(
                                          parse_scene("s.json",
                                                      R"({"cellwarp": 1, "rods": [
                         {"through": [[0,0,0],[1,0,0]]}], "rod_contact": true,
                         "simulate": {"integrator": "midpoint"}})")
                                              .time);
                                  }),
                         "what touches needs implicit-euler"));
}

TEST(ObjectSimulation, sheets_and_blocks_hang_and_are_sewn)
{
    ObjectSimulation simulation(parse_scene("s.json", R"({"cellwarp": 1, "sheets": [
        {"name": "cloth", "corner": [-0.5,0,0], "sides": [[1,0,0],[0,0,0.5]],
         "viscosity": 2, "fixed": [[0,0],[1,0]], "over": [[0.1,0,0.3]]},
        {"name": "pad", "corner": [2,0,0], "sides": [[0.2,0,0],[0,0.2,0],[0,0,0.4]],
         "counts": [4,4,5], "viscosity": 2, "fixed": [[0,0,0],[1,0,0],[0,1,0],[1,1,0]]}],
        "rods": [{"name": "r", "through": [[-0.3,0,0.5],[-0.3,-0.5,0.5]]}],
        "connections": [{"a": "rod r 0", "b": "sheet cloth 0.2 1"}],
        "simulate": {"dt": 0.01, "duration": 0.3}})")
                                    .time);
    const double before = simulation.report().gravity;
    while (simulation.steps_done() < simulation.num_steps())
    {
        simulation.step();
        const SimulationReport report = simulation.report();
        EXPECT_TRUE(report.is_converged) << report.stop;
        EXPECT_LT(report.violation, 1e-8);
    }
    const std::vector<SimulatedSheet> sheets = simulation.sheets(3);
    ASSERT_EQ(sheets.size(), 2u);
    EXPECT_EQ(sheets[0].points.size(), 9u);
    EXPECT_EQ(sheets[1].points.size(), 27u);
    EXPECT_LT((sheets[0].points[2] - Eigen::Vector3d(0.5, 0, 0)).norm(), 1e-9);
    EXPECT_LT(sheets[0].points[7].y(), -0.01);
    EXPECT_EQ(sheets[0].sliding.size(), 1u);
    EXPECT_LT(sheets[1].points[26].y(), 0.195);
    EXPECT_LT(simulation.report().gravity, before);
    EXPECT_GE(simulation.surface(8).groups.size(), 3u);
    for (const auto& [text, words] :
         {std::pair<std::string, std::string>{R"("sides": [[1,0,0],[2,0,0]])",
                                              "sheets[0].sides: its sides span nothing"},
          {R"("sides": [[1,0,0],[0,0,1]], "over": [[5,5,5]])",
           "sheets[0].over[0]: the sheet is not there"}})
        EXPECT_TRUE(contains(
            error_of(Fault::Malformed,
                     [&, &of = text]
                     {
                         ObjectSimulation(
                             parse_scene("s.json",
                                         R"({"cellwarp": 1, "sheets": [{)" + of + "}]}")
                                 .time);
                     }),
            words));
}

TEST(ObjectSimulation, tells_what_touches_while_knots_come_and_go)
{
    ObjectSimulation simulation(parse_scene("s.json", R"({"cellwarp": 1, "rods": [
        {"through": [[-0.4,0.1,0],[0.4,0.1,0]], "radius": 0.02, "E": 3e5,
         "refine": {"insert": 0.2, "remove": 0.15}},
        {"through": [[0,0,-0.3],[0,0,0.3]], "radius": 0.02, "E": 1e6, "spans": 6,
         "fixed": [{"at": 0}, {"at": 0.5}, {"at": 1}]}],
        "rod_contact": true, "simulate": {"dt": 0.002, "duration": 0.5}})")
                                    .time);
    int changes = 0, touching = 0, knots = 5;
    while (simulation.steps_done() < simulation.num_steps())
    {
        simulation.step();
        const SimulationReport report = simulation.report();
        EXPECT_TRUE(report.is_converged) << report.stop;
        const std::vector<SimulatedRod> rods = simulation.rods(201);
        double least = 1e9;
        for (const Eigen::Vector3d& a : rods[0].curve)
            for (const Eigen::Vector3d& b : rods[1].curve)
                least = std::min(least, (a - b).norm() / 0.04);
        if (least < 1.0)
        {
            EXPECT_NEAR(report.nearest.value_or(9.0), least, 0.04);
            ++touching;
            changes += rods[0].knots != knots;
        }
        knots = rods[0].knots;
    }
    EXPECT_GT(touching, 30);
    EXPECT_GT(changes, 1);
}

TEST(ObjectSimulation, a_knot_is_that_knot_while_it_is_pulled_tight_and_loosened)
{
    for (const std::string name : {"knot", "knot_fixed"})
    {
        ObjectSimulation simulation(
            read_scene(support::samples_folder() + "/rods/" + name + ".json").time);
        double least = 1.0;
        int most = 0;
        while (simulation.steps_done() < simulation.num_steps())
        {
            const std::int64_t done = simulation.steps_done();
            const int told =
                done % 100 == 0 ? determinant(simulation.rods(401)[0].curve) : 3;
            EXPECT_EQ(told, 3) << done;
            simulation.step();
            const SimulationReport report = simulation.report();
            EXPECT_TRUE(report.is_converged) << report.stop;
            least = std::min(least, report.nearest.value_or(1.0));
            most = std::max(most, simulation.rods(2)[0].knots);
        }
        EXPECT_GE(least, 0.9);
        if (name == "knot")
        {
            EXPECT_GE(most, 16);
            EXPECT_LE(simulation.rods(2)[0].knots, 14);
        }
    }
    // The same measure tells a rope that is not knotted.
    ObjectSimulation straight(scene_of(kLine, R"({"duration": 0.01})"));
    EXPECT_EQ(determinant(straight.rods(401)[0].curve), 1);
}

TEST(ObjectSimulation, an_impact_rubs_by_coulombs_law_at_any_step)
{
    // A fall by (1, -1) m/s loses all of its second part, and 0.3 of that of its first.
    for (const std::string dt : {"4e-3", "1e-3", "1e-4"})
    {
        SCOPED_TRACE(dt);
        ObjectSimulation simulation(
            parse_scene(
                "s.json",
                R"({"cellwarp": 1, "rods": [{"through": [[0,0.012,-0.1],[0,0.012,0],
                [0,0.012,0.1]], "velocity": [1,-1,0]}], "rod_contact": {"friction": 0.3},
                "obstacles": [{"plane": [0,1,0,0]}], "simulate": {"gravity": [0,0,0],
                "duration": 0.04, "every": 0.04, "dt": )" +
                    dt + "}}")
                .time);
        const double mass = 1000.0 * std::numbers::pi * 1e-4 * 0.2;
        while (simulation.steps_done() < simulation.num_steps())
            simulation.step();
        const SimulationReport report = simulation.report();
        EXPECT_TRUE(report.is_converged) << report.stop;
        EXPECT_NEAR((1.0 - report.momentum.x() / mass) /
                        (1.0 + report.momentum.y() / mass),
                    0.3, 1e-3);
    }
}

TEST(ObjectSimulation, a_rope_over_a_ball_holds_and_slips_as_the_capstan_says)
{
    // Two weights on half a turn, friction 0.3: it holds up to a ratio of e^(0.3 pi) =
    // 2.566; beyond the weights go by (m_2 - 2.566 m_1) g / (m_2 + 2.566 m_1).
    const auto sunk = [](double heavy)
    {
        const auto number = [](double x) { return std::to_string(x); };
        std::string points;
        const auto add = [&](double x, double y)
        {
            points += points.empty() ? "" : ",";
            points += "[" + number(x) + "," + number(y) + ",0]";
        };
        add(-0.052, -0.1);
        add(-0.052, -0.05);
        for (int k = 0; k <= 12; ++k)
            add(-0.052 * std::cos(std::numbers::pi * k / 12.0),
                0.052 * std::sin(std::numbers::pi * k / 12.0));
        add(0.052, -0.05);
        add(0.052, -0.1);
        ObjectSimulation simulation(
            parse_scene(
                "s.json",
                R"({"cellwarp": 1, "rods": [{"name": "r", "through": [)" + points +
                    R"(], "spans": 3, "radius": 0.002, "E": 1e8, "EI": [1e-6, 1e-6],
                "GJ": 1e-6}], "bodies": [{"at": [-0.052,-0.11,0], "mass": 0.1},
                {"at": [0.052,-0.11,0], "mass": )" +
                    number(heavy) + R"(}], "connections": [
                {"a": "rod r 0", "b": "body body1 0 0.01 0"},
                {"a": "rod r 1", "b": "body body2 0 0.01 0"}],
                "obstacles": [{"sphere": [0,0,0,0.05]}],
                "rod_contact": {"friction": 0.3, "self": false},
                "simulate": {"dt": 1e-3, "duration": 0.6, "every": 0.6}})")
                .time);
        while (simulation.steps_done() < simulation.num_steps())
            simulation.step();
        EXPECT_TRUE(simulation.report().is_converged);
        return -0.11 - simulation.bodies()[1].at.y();
    };
    EXPECT_LT(sunk(0.24), 2e-3);
    EXPECT_NEAR(sunk(0.27), 0.5 * 0.24899 * 0.36, 2.5e-3);
}

TEST(ObjectSimulation, friction_holds_in_statics_as_in_time)
{
    // A rod along z in a groove of 20 and 60 degrees, 0.1 m up the gentle side.
    const double a = 20.0 * std::numbers::pi / 180.0, b = 60.0 * std::numbers::pi / 180.0;
    const Eigen::Vector2d n(std::sin(a), std::cos(a)), m(-std::sin(b), std::cos(b));
    const Eigen::Vector2d begin = 0.1 * Eigen::Vector2d(-n.y(), n.x()) + 0.0099 * n;
    const auto settled = [&](double friction, bool has_other_side)
    {
        const auto number = [](double x) { return std::to_string(x); };
        const auto point = [&](double z) {
            return "[" + number(begin.x()) + "," + number(begin.y()) + "," + number(z) +
                   "]";
        };
        const auto plane = [&](const Eigen::Vector2d& normal) {
            return R"({"plane": [)" + number(normal.x()) + "," + number(normal.y()) +
                   ",0,0]}";
        };
        ObjectSimulation simulation(
            parse_scene("s.json", R"({"cellwarp": 1, "rods": [{"through": [)" +
                                      point(-0.2) + "," + point(0.0) + "," + point(0.2) +
                                      R"(]}], "rod_contact": {"friction": )" +
                                      number(friction) + R"(}, "obstacles": [)" +
                                      plane(n) + (has_other_side ? "," + plane(m) : "") +
                                      R"(], "simulate": {"integrator": "static"}})")
                .time);
        simulation.step();
        const SimulationReport report = simulation.report();
        EXPECT_TRUE(report.is_converged) << report.stop;
        return Eigen::Vector2d(simulation.rods(33)[0].curve[16].head<2>());
    };
    for (const double friction : {0.5, 1.0})
    {
        SCOPED_TRACE(friction);
        EXPECT_LT((settled(friction, false) - begin).norm(), 2e-4);
        EXPECT_LT((settled(friction, true) - begin).norm(), 2e-4);
    }
    Eigen::Matrix2d both;
    both << n.transpose(), m.transpose();
    const Eigen::Vector2d bottom = both.inverse() * Eigen::Vector2d(0.01, 0.01);
    EXPECT_LT((settled(0.0, true) - bottom).norm(), 1e-4);
}

TEST(ObjectSimulation, two_stiffnesses_follow_the_normal_however_the_scene_is_turned)
{
    const auto sinks = [](const Eigen::Matrix3d& R, double off)
    {
        const auto text = [](const Eigen::Vector3d& v)
        {
            std::ostringstream out;
            out.precision(17);
            out << "[" << v.x() << "," << v.y() << "," << v.z() << "]";
            return out.str();
        };
        ObjectSimulation simulation(
            scene_of(R"("through": [[0,0,0],)" + text(R * Eigen::Vector3d(1, off, 0)) +
                         R"(], "EI": [1,100], "GJ": 1, "E": 1e9, "normal": )" +
                         text(R * Eigen::Vector3d(0, 1, 0)) +
                         R"(, "fixed": [{"what": ["point","tangent","twist"]}],
                   "loads": [{"force": )" +
                         text(R * Eigen::Vector3d(0, 0, -1)) + "}]",
                     R"({"integrator": "static", "gravity": [0,0,0]})"));
        simulation.step();
        EXPECT_TRUE(simulation.report().is_converged);
        return (R.transpose() * simulation.rods(2)[0].curve[1]).z();
    };
    const double flat = sinks(Eigen::Matrix3d::Identity(), 0.0);
    EXPECT_NEAR(flat, -0.30172077, 1e-4); // of EI 1
    EXPECT_NEAR(sinks(Eigen::Matrix3d::Identity(), 1e-9), flat, 1e-8);
    for (const Eigen::Vector3d& axis :
         {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(1, 2, 3), Eigen::Vector3d(0, 0, 1)})
        for (const double angle : {0.3, 0.5 * std::numbers::pi, 2.5})
            EXPECT_NEAR(
                sinks(Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix(),
                      0.0),
                flat, 1e-6);
    EXPECT_TRUE(contains(
        error_of(Fault::Malformed, []
                 { ObjectSimulation(scene_of(kLine + R"(, "normal": [2,0,0])", "{}")); }),
        "s.json: rods[0]: the normal is along the begin of the rod"));
}

TEST(ObjectSimulation, two_stiffnesses_keep_their_directions_behind_a_kink)
{
    // A piece along x, a kink, a piece along y, which is held in its middle.
    const auto tip_of = [](const Eigen::Matrix3d& R)
    {
        std::ostringstream points;
        points.precision(17);
        const char* separator = "[";
        for (const Eigen::Vector3d& x :
             {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0.2, 0, 0),
              Eigen::Vector3d(0.4, 0, 0), Eigen::Vector3d(0.6, 0, 0),
              Eigen::Vector3d(0.6, 0.2, 0), Eigen::Vector3d(0.6, 0.4, 0),
              Eigen::Vector3d(0.6, 0.6, 0)})
        {
            const Eigen::Vector3d y = R * x;
            points << separator << "[" << y.x() << "," << y.y() << "," << y.z() << "]";
            separator = ",";
        }
        const auto vector = [&](const Eigen::Vector3d& x)
        {
            const Eigen::Vector3d y = R * x;
            std::ostringstream out;
            out.precision(17);
            out << "[" << y.x() << "," << y.y() << "," << y.z() << "]";
            return out.str();
        };
        ObjectSimulation simulation(
            scene_of(R"("spline": "bezier", "points": )" + points.str() +
                         R"(], "EI": [1e-3, 1e-1], "GJ": 1e-3, "E": 1e6, "normal": )" +
                         vector({0, 0, 1}) +
                         R"(, "fixed": [{"at": 0, "what": ["point","tangent","twist"]},
                               {"at": 0.75, "what": ["point","tangent","twist"]}],
                   "loads": [{"at": 1, "force": )" +
                         vector({0, 0, -1e-3}) + "}]",
                     R"({"integrator": "static", "gravity": [0,0,0]})"));
        simulation.step();
        EXPECT_TRUE(simulation.report().is_converged);
        return (R.transpose() * simulation.rods(2)[0].curve.back()).z();
    };
    const double tip = tip_of(Eigen::Matrix3d::Identity());
    EXPECT_LT(tip, -1e-5);
    for (const Eigen::Vector3d& axis :
         {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(1, 2, 3), Eigen::Vector3d(0, 0, 1)})
        for (const double angle : {0.4, 1.3, 2.5})
            EXPECT_NEAR(
                tip_of(Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix()),
                tip, 1e-6 * std::abs(tip));
}

TEST(ObjectSimulation, a_rope_whose_twist_is_held_swings_past_that_direction)
{
    for (const std::string rule : {"implicit-euler", "midpoint"})
    {
        SCOPED_TRACE(rule);
        const auto tip = [&](const std::string& what)
        {
            ObjectSimulation simulation(scene_of(
                R"("through": [[0,0,0],[0.25,0,0],[0.5,0,0],[1,0,0]], "fixed": [{"what": )" +
                    what + "}]",
                R"({"dt": 0.002, "duration": 0.7, "every": 0.1, "integrator": ")" + rule +
                    R"("})"));
            while (simulation.steps_done() < simulation.num_steps())
                simulation.step();
            const SimulationReport report = simulation.report();
            EXPECT_TRUE(report.is_converged) << report.stop;
            EXPECT_LT(report.violation, 1e-9);
            return simulation.rods(2)[0].curve[1];
        };
        const Eigen::Vector3d held = tip(R"(["point","twist"])"),
                              free = tip(R"(["point"])");
        EXPECT_LT((held - free).norm(), 1e-6);
        if (rule == "implicit-euler")
        {
            EXPECT_NEAR(held.x(), -0.859, 1e-3);
            EXPECT_NEAR(held.y(), -0.536, 1e-3);
        }
    }
}

TEST(ObjectSimulation, keys_twist_what_is_free_to_turn_by_the_part_about_it)
{
    // Held at both ends, one turned by 90 degrees about the rod: as much twist.
    const auto energy = [](const std::string& what, const std::string& rotate)
    {
        ObjectSimulation simulation(scene_of(
            kLine + R"(, "fixed": [{"at": 0, "what": ["point","tangent","twist"]},
               {"at": 1, "what": )" +
                what + R"(, "keys": [{"time": 0}, {"time": 0.1, "rotate": )" + rotate +
                "}]}]",
            R"({"dt": 0.01, "duration": 0.1, "gravity": [0,0,0], "every": 0.1})"));
        while (simulation.steps_done() < simulation.num_steps())
            simulation.step();
        EXPECT_TRUE(simulation.report().is_converged);
        return simulation.report().elastic;
    };
    const double with_tangent = energy(R"(["point","tangent","twist"])", "[1,0,0,90]");
    EXPECT_GT(with_tangent, 0.0);
    EXPECT_NEAR(energy(R"(["point","twist"])", "[1,0,0,90]"), with_tangent,
                1e-6 * with_tangent);
    EXPECT_LT(energy(R"(["point","twist"])", "[0,1,0,90]"), 1e-6 * with_tangent);
}

TEST(ObjectSimulation, cantilevers_of_every_spline_bend_as_theory_says)
{
    // P L^2 / EI = 1 of slender rods, 7 to 31 points: the tip is at 0.30172077 L.
    const auto off = [](const std::string& kind, int count, double slender)
    {
        const double radius = 2.0 / std::sqrt(slender),
                     young = slender / (std::numbers::pi * radius * radius);
        std::string points;
        for (int k = 0; k < count; ++k)
            points +=
                (k ? ",[" : "[") + std::to_string(double(k) / (count - 1)) + ",0,0]";
        std::ostringstream text;
        text << R"("points": [)" << points << R"(], "spline": ")" << kind
             << R"(", "radius": )" << radius << R"(, "E": )" << young
             << R"(, "fixed": [{"what": ["point","tangent","twist"]}],
                    "loads": [{"force": [0,-1,0]}])";
        ObjectSimulation simulation(
            scene_of(text.str(), R"({"integrator": "static", "gravity": [0,0,0]})"));
        EXPECT_TRUE(simulation.warnings().empty());
        simulation.step();
        EXPECT_TRUE(simulation.report().is_converged);
        return std::abs(-simulation.rods(2)[0].curve[1].y() / 0.30172077 - 1.0);
    };
    for (const std::string kind : {"catmull-rom", "bezier", "nonuniform"})
        for (const double slender : {4e2, 4e4, 1e9})
        {
            SCOPED_TRACE(testing::Message() << kind << " " << slender);
            EXPECT_LT(off(kind, 7, slender), 0.05);
            EXPECT_LT(off(kind, 16, slender), 0.01);
            EXPECT_LT(off(kind, 31, slender), 0.005);
        }
}

TEST(ObjectSimulation, a_kink_of_bezier_pieces_is_named_and_a_corner_that_goes_as_well)
{
    const auto warnings = [](const std::string& curve)
    { return ObjectSimulation(scene_of(curve, "{}")).warnings(); };
    const std::vector<std::string> kinks = warnings(
        R"("spline": "bezier", "points": [[0,0,0],[1,0,0],[2,0,0],[3,0,0],[3,1,0],
           [3,2,0],[3,3,0]])");
    ASSERT_EQ(kinks.size(), 1u);
    EXPECT_TRUE(contains(kinks[0], "rods[0].points: a kink at (3, 0, 0) is a hinge"));
    const std::vector<std::string> merged = warnings(
        R"("points": [[0,0,0],[1,0,0],[2,0,0],[2,0,0],[2,0,0],[2,1,0],[2,2,0]])");
    ASSERT_EQ(merged.size(), 1u);
    EXPECT_TRUE(contains(merged[0],
                         "rods[0].points: neighbours at the same place are one "
                         "point: 5 of 7 are left"));
}

TEST(ObjectSimulation, steps_that_fail_again_and_again_are_not_cut_for_ever)
{
    // Two holds that keys drive through each other's rod, which nothing can follow.
    ObjectSimulation simulation(parse_scene("s.json",
                                            R"({"cellwarp": 1, "rods": [
            {"through": [[0,0,-0.2],[0,0,0.2]], "E": 1e9, "fixed": [
              {"at": 0, "keys": [{"time": 0}, {"time": 0.02, "translate": [100,0,0]}]},
              {"at": 1, "keys": [{"time": 0}, {"time": 0.02, "translate": [100,0,0]}]}]},
            {"through": [[0.05,-0.2,0],[0.05,0.2,0]], "E": 1e9,
              "fixed": [{"at": 0}, {"at": 1}]}],
            "rod_contact": true,
            "simulate": {"dt": 1e-3, "duration": 0.02, "every": 1e-3,
                         "gravity": [0,0,0]}})")
                                    .time);
    std::int64_t at_once = 0, most_after = 0;
    for (int step = 0; step < 20; ++step)
    {
        simulation.step();
        const SimulationReport report = simulation.report();
        at_once += report.at_once;
        if (report.at_once > 0)
            most_after = std::max(most_after, report.iterations);
    }
    EXPECT_GT(at_once, 0);
    EXPECT_LE(most_after, 40);
}

TEST(ObjectSimulation, tells_what_a_hold_acts_with_in_statics_and_by_every_integrator)
{
    const auto last_force = [](ObjectSimulation& simulation)
    {
        EXPECT_TRUE(simulation.forces().empty()); // nothing was solved for
        while (simulation.steps_done() < simulation.num_steps())
            simulation.step();
        EXPECT_TRUE(simulation.report().is_converged);
        const std::vector<SimulatedForce> forces = simulation.forces();
        EXPECT_EQ(forces.size(), 1u);
        return forces.at(0);
    };
    ObjectSimulation bent(scene_of(
        kLine + R"(, "spans": 8, "E": 1e8, "loads": [{"force": [1,-2,0.5]}],
           "fixed": [{"what": ["point","tangent","twist"]}])",
        R"({"integrator": "static", "gravity": [0,0,0], "report": ["forces"]})"));
    const SimulatedForce clamp = last_force(bent);
    EXPECT_EQ(clamp.key, "rods[0].fixed[0]");
    const Eigen::Vector3d load(1, -2, 0.5), tip = bent.rods(2)[0].curve[1];
    EXPECT_LT(clamp.at.norm(), 1e-12);
    EXPECT_LT((clamp.force + load).norm(), 1e-8);
    EXPECT_LT((clamp.couple + tip.cross(load)).norm(), 1e-8);
    for (const std::string rule : {R"(implicit-euler", "dt": 1e-3)",
                                   R"(midpoint", "dt": 1e-3)", R"(rk4", "dt": 1e-4)"})
    {
        SCOPED_TRACE(rule);
        // The load pulls at the held place: nothing moves.
        ObjectSimulation held(scene_of(
            kLine + R"(, "fixed": [{"at": 0.3}], "loads": [{"at": 0.3,
               "force": [1,-2,0.5]}])",
            R"({"duration": 0.01, "every": 0.01, "gravity": [0,0,0], "integrator": ")" +
                rule + "}"));
        EXPECT_LT((last_force(held).force + load).norm(), 1e-8);
    }
}

TEST(ObjectSimulation, tells_what_joints_and_contacts_act_with)
{
    ObjectSimulation hung(joined(
        R"({"name": "r", "through": [[0,0,0],[0,-1,0]], "E": 1e7, "fixed": [{"at": 0}]})",
        R"("bodies": [{"mass": 2, "at": [0,-1,0]}],
           "connections": [{"a": "rod r 1", "b": "body body1 0 0 0"}])",
        R"({"integrator": "static"})"));
    hung.step();
    const std::vector<SimulatedForce> forces = hung.forces();
    ASSERT_EQ(forces.size(), 2u);
    const double rope = 1000.0 * std::numbers::pi * 1e-4 * 9.81;
    EXPECT_EQ(forces[0].key, "rods[0].fixed[0]");
    EXPECT_NEAR(forces[0].force.y(), 2.0 * 9.81 + rope, 1e-6);
    EXPECT_EQ(forces[1].key, "connections[0]");
    EXPECT_NEAR(forces[1].force.y(), -2.0 * 9.81, 1e-6);
    EXPECT_NEAR(forces[1].at.y(), hung.bodies()[0].at.y(), 1e-9);

    ObjectSimulation lies(
        parse_scene("s.json",
                    R"({"cellwarp": 1, "rods": [{"through": [[0,0.01,0],[0.3,0.01,0]]}],
            "obstacles": [{"plane": [0,1,0,0]}], "simulate": {"integrator": "static"}})")
            .time);
    lies.step();
    double sum = 0.0;
    for (const SimulatedForce& one : lies.forces())
    {
        EXPECT_EQ(one.rod, "rod1");
        EXPECT_TRUE(one.other.empty() && one.key.empty());
        EXPECT_NEAR(one.at.y(), 0.0, 1e-4);
        sum += one.force.y();
    }
    EXPECT_NEAR(sum, 0.3 * rope, 1e-6 * rope);
}

TEST(ObjectSimulation, bodies_and_nets_go_without_rods)
{
    ObjectSimulation simulation(
        parse_scene("s.json",
                    R"({"cellwarp": 1, "bodies": [{"at": [5,0,0]}], "nets": [{"points":
            [[0,0,0],[1,0,0]], "springs": [[0,1,100]], "fixed": [0]}],
            "obstacles": [{"plane": [0,1,0,-9]}],
            "simulate": {"dt": 0.01, "duration": 0.1, "every": 0.1}})")
            .time);
    while (simulation.steps_done() < simulation.num_steps())
        simulation.step();
    EXPECT_TRUE(simulation.report().is_converged);
    EXPECT_NEAR(simulation.bodies()[0].at.y(), -9.81 * 1e-4 * 10 * 11 / 2, 1e-9);
    EXPECT_LT(simulation.nets()[0].points[1].y(), 0.0);
    for (const Eigen::Vector3d& p : simulation.stage(6).samples)
        EXPECT_TRUE(p.allFinite());
}

namespace
{

/// \p pushed(rule, times): the momentum that a force of 2 N, in its times, leaves after
/// 0.1 s.
template <class Pushed>
void expect_impulses(const Pushed& pushed, double near)
{
    const std::string ramp =
                          R"("keys": [{"time": 0, "size": 0}, {"time": 0.1, "size": 1}])",
                      window = R"("from": 0.02, "until": 0.06)";
    EXPECT_NEAR(pushed(R"(rk4", "dt": 1e-4)", ramp), 0.1, near);
    EXPECT_NEAR(pushed(R"(midpoint", "dt": 1e-3)", ramp), 0.1, near);
    EXPECT_NEAR(pushed(R"(implicit-euler", "dt": 1e-3)", ramp), 0.1 * 1.01, near);
    EXPECT_NEAR(pushed(R"(rk4", "dt": 1e-4)", window), 0.08, 3e-4);
    EXPECT_NEAR(pushed(R"(implicit-euler", "dt": 1e-3)", window), 0.08, 3e-3);
}

} // namespace

TEST(ObjectSimulation, loads_begin_grow_and_end)
{
    // The momentum of a free rod is the impulse of its load.
    const auto pushed = [](const std::string& rule, const std::string& times)
    {
        ObjectSimulation simulation(scene_of(
            kLine + R"(, "loads": [{"at": 0.5, "force": [0,2,0], )" + times + "}]",
            R"({"duration": 0.1, "every": 0.1, "gravity": [0,0,0], "integrator": ")" +
                rule + "}"));
        while (simulation.steps_done() < simulation.num_steps())
            simulation.step();
        const SimulationReport report = simulation.report();
        EXPECT_TRUE(report.is_converged) << report.stop;
        return report.momentum.y();
    };
    expect_impulses(pushed, 1e-9);
    // In statics they are what they are at the end.
    ObjectSimulation still(scene_of(
        kLine + R"(, "fixed": [{"what": ["point","tangent","twist"]}], "loads": [{
           "force": [0,-1,0], "until": 0.5}])",
        R"({"integrator": "static", "gravity": [0,0,0]})"));
    still.step();
    EXPECT_EQ(still.rods(2)[0].curve[1].y(), 0.0);
}

TEST(ObjectSimulation, a_damped_material_takes_the_energy_of_its_modes)
{
    // Kinetic and elastic energy at whole half-swings of a mode go by exp(-beta omega^2).
    const auto rate = [](const std::string& what, double half, int first, int last,
                         const std::string& rule)
    {
        ObjectSimulation simulation(
            parse_scene("s.json", R"({"cellwarp": 1, )" + what +
                                      R"(, "simulate": {"gravity": [0,0,0], "dt": )" +
                                      std::to_string(half / 128) + R"(, "every": )" +
                                      std::to_string(half / 128) + R"(, "duration": )" +
                                      std::to_string(half * last) +
                                      R"(, "integrator": ")" + rule + "\"}}")
                .time);
        const auto energy = [&]
        {
            const SimulationReport report = simulation.report();
            EXPECT_TRUE(report.is_converged) << report.stop;
            return report.kinetic + report.elastic;
        };
        double begin = 0.0;
        for (int k = 0; k < 128 * last; ++k)
        {
            if (k == 128 * first)
                begin = energy();
            simulation.step();
        }
        return std::log(begin / energy()) / (half * (last - first));
    };
    const std::string clamped =
        R"("rods": [{"through": [[0,0,0],[1,0,0]], "spans": 10, "radius": 0.05,
            "fixed": [{"what": ["point","tangent","twist"]}], )";
    for (const std::string energy : {"exact", "continuous", "discrete"})
        for (const std::string rule : {"implicit-euler", "midpoint"})
        {
            SCOPED_TRACE(energy + " " + rule);
            const std::string of = clamped + R"("elasticity": ")" + energy + "\", ";
            // Stretch: a quarter of a wave.
            const double wave = 0.5 * std::numbers::pi * std::sqrt(1e6 / 1e3);
            EXPECT_NEAR(rate(of + R"("damping": 1.6e-3, "velocity": [1e-3,0,0]}])",
                             std::numbers::pi / wave, 4, 10, rule) /
                            (1.6e-3 * wave * wave),
                        1.0, 0.01);
            // Bending: the first mode of a cantilever.
            const double bend = 3.516015 * std::sqrt(1e6 * 0.05 * 0.05 / 4.0 / 1e3);
            EXPECT_NEAR(rate(of + R"("damping": 0.03, "velocity": [0,1e-3,0]}])",
                             std::numbers::pi / bend, 4, 8, rule) /
                            (0.03 * bend * bend),
                        1.0, energy == "discrete" ? 0.03 : 0.01);
        }
}

TEST(ObjectSimulation, damping_where_it_cannot_act_is_refused)
{
    const auto told = [](const std::string& scene)
    {
        return error_of(Fault::Malformed, [&]
                        { parse_scene("s.json", R"({"cellwarp": 1, )" + scene).time; });
    };
    EXPECT_TRUE(contains(told(R"("bodies": [{"damping": 0.1}]})"),
                         "bodies[0].damping: a rigid body has no strains"));
    for (const std::string& of :
         {R"("rods": [{)" + kLine, std::string(R"("nets": [{"points": [[0,0,0]])"),
          std::string(R"("sheets": [{"sides": [[1,0,0],[0,1,0]])")})
        EXPECT_TRUE(contains(told(of + R"(, "damping": 0.1}],
                                  "simulate": {"integrator": "static"}})"),
                             "[0].damping: an equilibrium has no rates"));
}

TEST(ObjectSimulation, springs_begin_grow_and_end)
{
    // A spring to a far place pulls as evenly as a load: 2 N.
    const auto pushed = [](const std::string& rule, const std::string& times)
    {
        ObjectSimulation simulation(scene_of(
            kLine +
                R"(, "springs": [{"at": 0.5, "point": [0.5,1e6,0], "stiffness": 2e-6,
                    "length": 0, )" +
                times + "}]",
            R"({"duration": 0.1, "every": 0.1, "gravity": [0,0,0], "integrator": ")" +
                rule + "}"));
        while (simulation.steps_done() < simulation.num_steps())
            simulation.step();
        EXPECT_TRUE(simulation.report().is_converged) << simulation.report().stop;
        return simulation.report().momentum.y();
    };
    expect_impulses(pushed, 1e-6);
    // So does its damping, which takes the speed of a light rod within its window alone.
    ObjectSimulation slowed(scene_of(
        kLine + R"(, "velocity": [0,1,0], "springs": [{"at": 0.5, "point": [0,0,0],
                   "damping": 100, "from": 0.5}])",
        R"({"dt": 0.01, "duration": 1, "gravity": [0,0,0]})"));
    while (slowed.steps_done() + 1 < slowed.num_steps() / 2)
        slowed.step();
    const double before = slowed.report().momentum.y();
    EXPECT_NEAR(before, 0.01 * 0.01 * std::numbers::pi * 1000, 1e-9);
    while (slowed.steps_done() < slowed.num_steps())
        slowed.step();
    EXPECT_LT(slowed.report().momentum.y(), 0.5 * before);
}

TEST(ObjectSimulation, holds_begin_where_the_rod_is_then_and_end)
{
    const double weight = 0.01 * 0.01 * std::numbers::pi * 1000 * 9.81;
    for (const std::string rule : {R"(implicit-euler", "dt": 1e-3)",
                                   R"(midpoint", "dt": 1e-3)", R"(rk4", "dt": 1e-4)"})
    {
        SCOPED_TRACE(rule);
        const auto run = [&](const std::string& hold)
        {
            auto out = std::make_unique<ObjectSimulation>(scene_of(
                kLine + R"(, "fixed": [{"at": 0, "what": ["point","tangent","twist"], )" +
                    hold + "}]",
                R"({"duration": 0.1, "every": 0.05, "report": ["forces"],
                    "integrator": ")" +
                    rule + "}"));
            return out;
        };
        const auto go_on = [](ObjectSimulation& simulation, std::int64_t to)
        {
            while (simulation.steps_done() < to)
                simulation.step();
            EXPECT_TRUE(simulation.report().is_converged) << simulation.report().stop;
        };
        // Let go half way, it gains the momentum of its weight from then on.
        const auto falls = run(R"("until": 0.05)");
        const std::int64_t half = falls->num_steps() / 2;
        go_on(*falls, half);
        EXPECT_EQ(falls->forces().size(), 1u);
        const double before = falls->report().momentum.y();
        go_on(*falls, 2 * half);
        EXPECT_TRUE(falls->forces().empty());
        EXPECT_NEAR(falls->report().momentum.y() - before, -0.05 * weight, 1e-6 * weight);
        // Caught half way, it stays where it has come to, then goes as keys say.
        const auto caught = run(R"("from": 0.05, "keys": [{"time": 0.05},
            {"time": 0.08, "translate": [0,0,0.01]}])");
        go_on(*caught, half);
        EXPECT_TRUE(caught->forces().empty());
        const Eigen::Vector3d place = caught->rods(2)[0].curve.front();
        EXPECT_NEAR(place.y(), -0.5 * 9.81 * 0.05 * 0.05, 3e-4);
        go_on(*caught, 2 * half);
        EXPECT_EQ(caught->forces().size(), 1u);
        EXPECT_LT(
            (caught->rods(2)[0].curve.front() - (place + Eigen::Vector3d(0, 0, 0.01)))
                .norm(),
            1e-9);
        // Keys that began before move it by what is left of them, without a jump.
        const auto late = run(R"("from": 0.05, "keys": [{"time": 0},
            {"time": 0.1, "translate": [0,0,0.02], "rotate": [0,0,1,60]}])");
        go_on(*late, half);
        const Eigen::Vector3d then = late->rods(2)[0].curve.front();
        go_on(*late, half + 1);
        EXPECT_LT((late->rods(2)[0].curve.front() - then).norm(), 2e-3);
        go_on(*late, 2 * half);
        EXPECT_LT((late->rods(2)[0].curve.front() - (then + Eigen::Vector3d(0, 0, 0.01)))
                      .norm(),
                  1e-9);
    }
    // In statics they are what they are at the end.
    EXPECT_TRUE(contains(error_of(Fault::Malformed,
                                  []
                                  {
                                      ObjectSimulation still(scene_of(
                                          kLine + R"(, "fixed": [{"until": 0.5}])",
                                          R"({"integrator": "static"})"));
                                  }),
                         "rods"));
}

TEST(ObjectSimulation, a_place_whose_bend_is_held_stays_as_curved_as_it_was)
{
    const auto curvature = [](const std::string& what)
    {
        ObjectSimulation simulation(scene_of(
            kLine + R"(, "spans": 32, "radius": 0.02, "loads": [{"force": [0,-0.02,0]}],
                "fixed": [{"what": ["point","tangent","twist"]})" +
                what + "]",
            R"({"integrator": "static", "gravity": [0,0,0]})"));
        simulation.step();
        EXPECT_TRUE(simulation.report().is_converged);
        const std::vector<Eigen::Vector3d> p = simulation.rods(129)[0].curve;
        return (p[65] - 2.0 * p[64] + p[63]).norm() / (p[65] - p[64]).squaredNorm();
    };
    const double free = curvature(""),
                 held = curvature(R"(, {"at": 0.5, "what": ["bend"]})");
    EXPECT_GT(free, 0.05);
    EXPECT_LT(held, 0.2 * free);
}

} // namespace cellwarp::core
