// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/time/simulation.h"

#include <cmath>

#include <gtest/gtest.h>

#include "io/base/error.h"
#include "io/formats/geometry_file.h"
#include "library/session/scene_settings.h"
#include "tests/support/files.h"
#include "tests/support/shapes.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;
using support::contains;

SimulationInput input_of(const SceneFile& scene)
{
    SimulationInput input = read_simulation(scene);
    input.is_tight = true;
    return input;
}

/// A bar 4 x 1 x 1 along x, with a bone from its left end to its middle, and what is
/// joined to it.
struct Scene
{
    support::Folder folder;
    std::string more = R"("E": 3e4, "across": 8)";
    std::string keys = "";
    std::string rods = R"("bodies": [{"name": "weight", "mass": 20, "inertia": [1, 1, 1],
                          "at": [4, -0.5, 0]}],
                          "connections": [{"a": "flesh 4 0 0", "b": "body weight 0 0.5 0"}])";
    std::string time = R"("duration": 0.5)";
    double unit = 1.0;

    Scene()
    {
        folder.write("bar.obj", support::obj_text(support::box_shape({0, -0.5, -0.5},
                                                                     {4, 0.5, 0.5}, 8)));
    }
    std::string text() const
    {
        return R"({"cellwarp": 1, "model": "bar.obj", "unit": )" + std::to_string(unit) +
               R"(, "skeleton": {"joints": [
            {"name": "root", "parent": null, "at": [0, 0, 0]},
            {"name": "end", "parent": "root", "at": [2, 0, 0]}], "keys": [)" +
               keys + "], " + more + "}, " + rods + R"(, "simulate": {)" + time + "}}";
    }
    std::unique_ptr<Simulation> start() const
    {
        const SceneFile of = parse_scene(folder / "s.json", text());
        return std::make_unique<Simulation>(input_of(of));
    }
    std::string refusal() const
    {
        try
        {
            start();
        }
        catch (const Error& error)
        {
            EXPECT_EQ(error.fault(), Fault::Malformed);
            return error.what();
        }
        return "";
    }
};

/// Where a sample near a point of the model is now.
Vector3d sample_at(const Simulation& of, const Vector3d& x)
{
    const std::vector<Vector3d>& rest = of.flesh()->geometry().samples;
    std::size_t best = 0;
    for (std::size_t i = 0; i < rest.size(); ++i)
        if ((rest[i] - x).norm() < (rest[best] - x).norm())
            best = i;
    return of.flesh()->deformed_live().samples[best];
}

void run(Simulation& simulation)
{
    while (simulation.steps_done() < simulation.num_steps())
    {
        simulation.next_frame();
        const SimulationReport report = simulation.report();
        EXPECT_TRUE(report.is_converged) << report.stop;
        EXPECT_TRUE(report.problems.empty());
        EXPECT_LT(report.violation, 1e-9);
    }
}

} // namespace

TEST(Simulation, a_weight_hangs_on_flesh_and_bends_it)
{
    Scene scene;
    scene.more += R"(, "damping": {"alpha": 8}, "settle": false)";
    scene.time = R"("duration": 2.0)";
    const auto heavy = scene.start();
    ASSERT_EQ(heavy->warnings().size(), 1u);
    EXPECT_TRUE(contains(heavy->warnings()[0], "skeleton.E: the flesh sags by"));
    EXPECT_TRUE(heavy->objects()->moves_flesh());
    run(*heavy);
    EXPECT_EQ(heavy->objects()->steps_done(), heavy->flesh()->steps_done());
    scene.rods = R"("bodies": [{"name": "weight", "mass": 20, "inertia": [1, 1, 1],
                    "at": [4, -0.5, 0]}])";
    const auto free = scene.start();
    EXPECT_FALSE(free->objects()->moves_flesh());
    run(*free);
    const double with = sample_at(*heavy, {4, 0, 0.5}).y(),
                 without = sample_at(*free, {4, 0, 0.5}).y();
    EXPECT_LT(with, without - 0.005);
    // What nothing holds falls: 1/2 g t^2.
    EXPECT_NEAR(free->objects()->bodies()[0].at.y(), -0.5 - 0.5 * 9.81 * 4.0, 0.2);
    EXPECT_GT(heavy->objects()->bodies()[0].at.y(), -6.0);
}

TEST(Simulation, joints_hold_in_the_models_units_and_turned_frames)
{
    // The same scene in centimetres, in a frame of cells that is turned.
    Scene scene;
    const auto metres = scene.start();
    run(*metres);
    scene.unit = 0.01;
    scene.folder.write("bar.obj", support::obj_text(support::box_shape(
                                      {0, -50, -50}, {400, 50, 50}, 8)));
    std::string text = scene.text();
    for (const auto& [a, b] :
         {std::pair{"\"at\": [2, 0, 0]", "\"at\": [200, 0, 0]"},
          {"\"model\"", R"("cells": {"frame": {"origin": [0, -50, 50],
                                "axes": [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
                                "size": [400, 100, 100]}}, "model")"}})
        text.replace(text.find(a), std::string(a).size(), b);
    const SceneFile of = parse_scene(scene.folder / "s.json", text);
    Simulation centimetres(input_of(of));
    run(centimetres);
    EXPECT_LT(
        (sample_at(centimetres, {400, 0, 50}) / 100.0 - sample_at(*metres, {4, 0, 0.5}))
            .norm(),
        1e-5);
    EXPECT_LT((centimetres.objects()->bodies()[0].at - metres->objects()->bodies()[0].at)
                  .norm(),
              1e-5);
}

TEST(Simulation, a_rod_slides_through_flesh_and_draws_it_together)
{
    Scene scene;
    scene.rods = R"("rods": [{"name": "thread", "radius": 0.01, "E": 1e7,
        "through": [[2.6, 0.4, 0], [3, 0.4, 0.2], [3.6, 0.4, 0], [4.4, 0.4, 0]],
        "fixed": [{"at": 1, "keys": [{"time": 0, "translate": [0, 0, 0]},
                                     {"time": 0.4, "translate": [0.4, 0, 0]}]}]}],
        "connections": [{"a": "rod thread 0", "b": "flesh 2.6 0.4 0"},
                   {"a": "rod thread sliding", "b": "flesh 3.6 0.4 0"}])";
    scene.time = R"("duration": 0.5, "gravity": [0, 0, 0])";
    scene.more += R"(, "damping": {"alpha": 5})";
    const auto simulation = scene.start();
    const double before =
        (sample_at(*simulation, {3.6, 0.5, 0}) - sample_at(*simulation, {2.6, 0.5, 0}))
            .norm();
    run(*simulation);
    const double after =
        (sample_at(*simulation, {3.6, 0.5, 0}) - sample_at(*simulation, {2.6, 0.5, 0}))
            .norm();
    EXPECT_LT(after, before - 0.02);
    const SimulatedRod rod = simulation->objects()->rods(9)[0];
    ASSERT_EQ(rod.sliding.size(), 1u);
    EXPECT_LT(rod.sliding[0], 0.5);
}

TEST(Simulation, bones_lead_what_hangs_on_the_flesh)
{
    // A net's point at a joint of the bone goes where the bone does, exactly.
    Scene scene;
    scene.keys = R"({"time": 0, "joint": "root", "rotate": [0, 0, 1, 0]},
                    {"time": 0.25, "joint": "root", "rotate": [0, 0, 1, 40]})";
    scene.rods = R"("nets": [{"name": "net", "points": [[2, 0, 0], [2, -1, 0]],
                    "springs": [[0, 1, 50]], "mass": 0.5}],
                    "connections": [{"a": "net net 0", "b": "flesh 2 0 0"}])";
    const auto simulation = scene.start();
    run(*simulation);
    const double a = 40.0 * M_PI / 180.0;
    EXPECT_LT((simulation->objects()->nets()[0].points[0] -
               Vector3d(2 * std::cos(a), 2 * std::sin(a), 0))
                  .norm(),
              1e-9);
}

TEST(Simulation, detail_changes_under_joints)
{
    Scene scene;
    scene.more += R"(, "max_depth": 1, "detail": 0.004)";
    const auto simulation = scene.start();
    const std::size_t first = simulation->flesh()->body().flesh->lattice().cells.size();
    run(*simulation);
    EXPECT_GT(simulation->flesh()->body().flesh->lattice().cells.size(), first);
    const SimulatedBody& weight = simulation->objects()->bodies()[0];
    const FleshSimulation& flesh = *simulation->flesh();
    EXPECT_LT((weight.at + weight.R * Vector3d(0, 0.5, 0) -
               0.5 * (sample_at(*simulation, {4, 0, 0.5}) +
                      sample_at(*simulation, {4, 0, -0.5})))
                  .norm(),
              0.02);
    EXPECT_TRUE(flesh.is_finite());
}

TEST(Simulation, the_same_steps_whatever_is_watched)
{
    const Scene scene;
    const auto one = scene.start(), other = scene.start();
    run(*one);
    while (other->flesh()->steps_done() < other->flesh()->num_steps())
    {
        other->step();
        other->flesh()->deformed();
        other->objects()->rods(5);
    }
    EXPECT_EQ(one->flesh()->snapshot().state, other->flesh()->snapshot().state);
    EXPECT_EQ(one->objects()->bodies()[0].at, other->objects()->bodies()[0].at);
}

TEST(Simulation, what_joints_cannot_hold_is_refused_by_its_key)
{
    const auto told =
        [](const std::string& more, const std::string& joint, const std::string& what)
    {
        Scene scene;
        scene.more += more;
        if (!joint.empty())
            scene.rods.replace(scene.rods.find("flesh 4 0 0"), 11, joint);
        EXPECT_TRUE(contains(scene.refusal(), what)) << scene.refusal();
    };
    told(R"(, "law": "regions")", "", "skeleton.law: regions are blended");
    told(R"(, "obstacles": [{"plane": [0, 1, 0, -3]}])", "",
         "skeleton.obstacles: flesh that");
    told(R"(, "held": [{"at": [3, 0.1, 0.1], "normal": [0, 1, 0]}])", "",
         "skeleton.held: flesh that is joined");
    told(R"(, "detail": 0.01, "held": [{"at": [3, 0, 0]}])", "",
         "skeleton.held: points of flesh that is joined");
    told(R"(, "settle": true)", "", "skeleton.settle: what is joined to the flesh");
    told("", "flesh 4 3 0", "connections[0]: the point (4, 3, 0) of the flesh");
    told("", "flesh 4 3", "connections[0].a: names no place");
    told("", "flesh 4 3 x", "connections[0].a: what follows");
    Scene frame;
    frame.rods.replace(frame.rods.find("\"a\":"), 4, R"("what": ["frame"], "a":)");
    EXPECT_TRUE(contains(frame.refusal(), "a point of flesh has no frame"));
    Scene still;
    still.time = R"("integrator": "static")";
    EXPECT_TRUE(contains(still.refusal(), "simulate.integrator"));
    still.time = R"("integrator": "bdf2")";
    EXPECT_TRUE(contains(still.refusal(), "simulate.integrator: bdf2 is for flesh"));
    Scene carries;
    carries.rods = R"("rods": [{"name": "r", "through": [[0, 0, 0], [1, 0, 0]],
                       "carries": true}])";
    EXPECT_TRUE(contains(carries.refusal(), "rods[0].carries: the model is flesh"));
    EXPECT_THROW(parse_scene("s.json", R"({"cellwarp": 1, "bodies": [{"name": "b",
        "mass": 1, "inertia": [1, 1, 1], "at": [0, 0, 0]}], "rods": [{"name": "r",
        "through": [[0, 0, 0], [1, 0, 0]]}],
        "connections": [{"a": "flesh 0 0 0", "b": "body b 0 0 0"}], "simulate": {}})"),
                 Error);
}

} // namespace cellwarp::core
