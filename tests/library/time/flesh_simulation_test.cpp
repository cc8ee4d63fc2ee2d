// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/time/flesh_simulation.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "io/base/error.h"
#include "io/base/number.h"
#include "io/formats/geometry_file.h"
#include "library/session/scene_settings.h"
#include "library/session/volume.h"
#include "tests/support/files.h"
#include "tests/support/shapes.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;
using support::contains;

/// A bar 1 x 1 x 4 along z with two bones in its axis.
struct Bar
{
    support::Folder folder;
    std::string skeleton = R"("E": 2e4, "across": 8)";
    std::string keys = R"({"time": 0, "joint": "knee", "rotate": [1, 0, 0, 0]},
                          {"time": 0.5, "joint": "knee", "rotate": [1, 0, 0, 60]})";
    std::string more, model = "bar.obj";

    Bar()
    {
        folder.write("bar.obj", support::obj_text(support::box_shape({-0.5, -0.5, 0},
                                                                     {0.5, 0.5, 4}, 8)));
    }
    SceneFile scene() const
    {
        return parse_scene(folder / "s.json", R"({"cellwarp": 1, "model": ")" + model +
                                                  R"(", "skeleton": {"joints": [
                {"name": "root", "parent": null, "at": [0, 0, 0]},
                {"name": "knee", "parent": "root", "at": [0, 0, 2]},
                {"name": "foot", "parent": "knee", "at": [0, 0, 4]}], )" +
                                                  skeleton + R"(, "keys": [)" + keys +
                                                  R"(]},
                "simulate": {"duration": 0.5, "gravity": [0, 0, 0])" +
                                                  more + "}}");
    }
    std::unique_ptr<FleshSimulation> start(bool is_tight = false) const
    {
        const SceneFile of = scene();
        return std::make_unique<FleshSimulation>(
            std::make_shared<const Geometry>(read_geometry(of.model).geometry), of,
            settings_of(of).cells, is_tight);
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

/// A lattice of 2 x 2 x 4 cells around the bar, whose axis has edges; the cells of the
/// upper half have the reference 2.
std::string drawn_mesh()
{
    std::string mesh = "MeshVersionFormatted 2\nDimension 3\nVertices 45\n";
    for (int k = 0; k < 5; ++k)
        for (int j = 0; j < 3; ++j)
            for (int i = 0; i < 3; ++i)
                mesh += std::to_string(0.6 * (i - 1)) + " " +
                        std::to_string(0.6 * (j - 1)) + " " + std::to_string(k) + " 0\n";
    mesh += "Hexahedra 16\n";
    for (int k = 0; k < 4; ++k)
        for (int j = 0; j < 2; ++j)
            for (int i = 0; i < 2; ++i)
            {
                for (const int up : {0, 1})
                    for (const auto& [a, b] : {std::pair{0, 0}, {1, 0}, {1, 1}, {0, 1}})
                        mesh +=
                            std::to_string(9 * (k + up) + 3 * (j + b) + i + a + 1) + " ";
                mesh += k < 2 ? "0\n" : "2\n";
            }
    mesh += "Edges 4\n";
    for (int k = 0; k < 4; ++k)
        mesh +=
            std::to_string(9 * k + 5) + " " + std::to_string(9 * (k + 1) + 5) + " 0\n";
    return mesh;
}

/// By how much samples are away from where a joint's motion has them, at the most.
double away(const FleshSimulation& of, const DeformedSamples& now, double low,
            double high, const std::function<Vector3d(const Vector3d&)>& wanted)
{
    double most = 0.0;
    for (std::size_t i = 0; i < now.samples.size(); ++i)
        if (const Vector3d& x = of.geometry().samples[i]; x.z() >= low && x.z() <= high)
            most = std::max(most, (now.samples[i] - wanted(x)).norm());
    return most;
}

} // namespace

TEST(FleshSimulation, flesh_follows_its_bones)
{
    Bar bar;
    bar.skeleton = R"("E": 1e6, "across": 8)"; // stiff enough to keep up
    const auto simulation = bar.start();
    EXPECT_TRUE(simulation->warnings().empty());
    EXPECT_EQ(simulation->num_steps(), 60);
    EXPECT_EQ(simulation->last_frame(), 15);
    while (simulation->steps_done() < simulation->num_steps())
        simulation->next_frame();
    const SimulationReport frame = simulation->report();
    EXPECT_NEAR(frame.time, 0.5, 1e-12);
    EXPECT_TRUE(frame.is_converged);
    EXPECT_LT(frame.violation, 1e-12);
    const Eigen::AngleAxisd turn(60.0 * M_PI / 180.0, Vector3d::UnitX());
    const auto turned = [&](const Vector3d& x) -> Vector3d
    { return Vector3d(0, 0, 2) + turn * (x - Vector3d(0, 0, 2)); };
    const auto same = [](const Vector3d& x) { return x; };
    for (const DeformedSamples& now :
         {simulation->deformed(), simulation->deformed_live()})
    {
        EXPECT_LT(away(*simulation, now, 0.0, 0.5, same), 0.15);
        EXPECT_LT(away(*simulation, now, 3.5, 4.0, turned), 0.3);
    }
    const std::optional<Volume> volume =
        enclosed_volumes(simulation->geometry(), simulation->deformed().samples);
    EXPECT_NEAR(volume->after / volume->before, 1.0, 0.05);
    EXPECT_LT((simulation->joints()[2].place - turned({0, 0, 4})).norm(), 1e-12);
}

TEST(FleshSimulation, smooth_samples_are_near_those_of_the_lattice)
{
    Bar bar;
    bar.skeleton = R"("E": 2e4, "across": 16)";
    bar.more = R"(, "integrator": "implicit-euler")"; // it swings less
    const auto simulation = bar.start();
    for (int frame = 0; frame < 10; ++frame)
        simulation->next_frame();
    const DeformedSamples live = simulation->deformed_live(),
                          smooth = simulation->deformed();
    double sum = 0.0;
    for (std::size_t i = 0; i < live.samples.size(); ++i)
        sum += (live.samples[i] - smooth.samples[i]).squaredNorm();
    EXPECT_LT(std::sqrt(sum / static_cast<double>(live.samples.size())), 0.005 * 4.2);
}

TEST(FleshSimulation, soups_and_clouds_ride_as_meshes_do_and_normals_turn)
{
    // The same triangles, each by itself; and the same places, with normals.
    const Shape box = support::box_shape({-0.5, -0.5, 0}, {0.5, 0.5, 4}, 8);
    std::string soup, cloud = "ply\nformat ascii 1.0\nelement vertex " +
                              std::to_string(box.samples.size()) +
                              "\nproperty double x\nproperty double y\nproperty double z"
                              "\nproperty float nx\nproperty float ny\nproperty float nz"
                              "\nend_header\n";
    const auto text = [](const Vector3d& x)
    {
        return std::to_string(x.x()) + " " + std::to_string(x.y()) + " " +
               std::to_string(x.z()) + " ";
    };
    int corner = 0;
    for (const auto& triangle : box.triangles)
    {
        for (const auto vertex : triangle)
            soup += "v " + text(box.samples[vertex]) + "\n";
        soup += "f " + std::to_string(corner + 1) + " " + std::to_string(corner + 2) +
                " " + std::to_string(corner + 3) + "\n";
        corner += 3;
    }
    for (const Vector3d& x : box.samples)
        cloud += text(x) + "0 0 1\n";
    Bar bar;
    bar.skeleton = R"("E": 2e6, "across": 8)";
    const auto end_of = [&](const std::string& name)
    {
        bar.model = name;
        const auto simulation = bar.start();
        while (simulation->steps_done() < simulation->num_steps())
            simulation->next_frame();
        return simulation->deformed();
    };
    const DeformedSamples mesh = end_of("bar.obj");
    bar.folder.write("soup.obj", soup);
    bar.folder.write("cloud.ply", cloud);
    const DeformedSamples of_soup = end_of("soup.obj"), of_cloud = end_of("cloud.ply");
    std::size_t k = 0;
    for (const auto& triangle : box.triangles)
        for (const auto vertex : triangle)
            EXPECT_LT((of_soup.samples[k++] - mesh.samples[vertex]).norm(), 1e-3);
    ASSERT_EQ(of_cloud.directions.size(), box.samples.size());
    // Along the foot's bone normals point where it points, away from the ends.
    const Vector3d along(0, -std::sin(std::numbers::pi / 3),
                         std::cos(std::numbers::pi / 3));
    for (std::size_t i = 0; i < box.samples.size(); ++i)
    {
        EXPECT_LT((of_cloud.samples[i] - mesh.samples[i]).norm(), 0.1);
        const double z = box.samples[i].z();
        EXPECT_TRUE(z < 3.2 || z > 3.8 || of_cloud.directions[i].dot(along) > 0.97) << z;
    }
}

TEST(FleshSimulation, samples_on_bones_go_with_them_exactly)
{
    Bar bar;
    bar.folder.write("bar.obj", support::obj_text(support::box_shape({-0.5, -0.5, 0},
                                                                     {0.5, 0.5, 4}, 8)) +
                                    "v 0 0 3\n");
    const auto simulation = bar.start();
    while (simulation->steps_done() < simulation->num_steps())
        simulation->next_frame();
    const Eigen::AngleAxisd turn(60.0 * M_PI / 180.0, Vector3d::UnitX());
    const Vector3d wanted = Vector3d(0, 0, 2) + turn * Vector3d(0, 0, 1);
    EXPECT_LT((simulation->deformed_live().samples.back() - wanted).norm(), 1e-12);
    EXPECT_LT((simulation->deformed().samples.back() - wanted).norm(), 1e-12);
}

TEST(FleshSimulation, begins_in_the_pose_of_its_first_keys_at_rest)
{
    Bar bar;
    bar.keys = R"({"time": 0, "joint": "knee", "rotate": [1, 0, 0, 80]})";
    const auto simulation = bar.start();
    const SimulationReport first = simulation->report();
    EXPECT_EQ(first.kinetic, 0.0);
    EXPECT_GT(first.elastic, 0.0);
    EXPECT_LT(first.violation, 1e-12);
    // It is an equilibrium: nothing moves.
    const DeformedSamples before = simulation->deformed_live();
    simulation->next_frame();
    const DeformedSamples after = simulation->deformed_live();
    for (std::size_t i = 0; i < before.samples.size(); ++i)
        EXPECT_LT((after.samples[i] - before.samples[i]).norm(), 1e-3);
}

/// The lowest height of a sample above its place at rest: negative where it sags.
double sag(const FleshSimulation& of)
{
    double lowest = 0.0;
    const DeformedSamples now = of.deformed_live();
    for (std::size_t i = 0; i < now.samples.size(); ++i)
        lowest = std::min(lowest, now.samples[i].y() - of.geometry().samples[i].y());
    return lowest;
}

TEST(FleshSimulation, settles_in_its_weight_where_the_scene_does_not_say_otherwise)
{
    Bar bar;
    bar.keys = R"({"time": 0, "joint": "knee", "rotate": [1, 0, 0, 0]})";
    bar.more = R"(, "gravity": [0, -9.81, 0])";
    const std::string plain = bar.skeleton;
    bar.skeleton += R"(, "settle": false)";
    EXPECT_EQ(sag(*bar.start()), 0.0);
    bar.skeleton = plain + R"(, "settle": true)";
    const double told = sag(*bar.start());
    bar.skeleton = plain;
    const auto hangs = bar.start();
    const double settled = sag(*hangs);
    EXPECT_EQ(settled, told);
    EXPECT_LT(settled, -1e-3);
    for (int frame = 0; frame < 5; ++frame)
        hangs->next_frame();
    EXPECT_NEAR(sag(*hangs) / settled, 1.0, 1e-2);
}

TEST(FleshSimulation, flesh_that_has_no_rest_begins_without_its_weight)
{
    Bar bar;
    bar.keys = "";
    bar.more = R"(, "gravity": [0, -9.81, 0])";
    const std::string plain = bar.skeleton;
    for (const char* more :
         {R"(, "obstacles": [{"plane": [0, 1, 0, -9]}])", R"(, "law": "regions")"})
    {
        bar.skeleton = plain + more;
        EXPECT_EQ(sag(*bar.start()), 0.0) << more;
    }
    bar.skeleton = R"("E": 1e3, "across": 8)";
    EXPECT_EQ(sag(*bar.start()), 0.0);
}

TEST(FleshSimulation, a_shape_that_is_at_rest_as_drawn_stays_as_it_was_drawn)
{
    Bar bar;
    bar.keys = "";
    bar.more = R"(, "gravity": [0, -9.81, 0])";
    for (const char* more : {"", R"(, "max_depth": 1)", R"(, "law": "regions")",
                             R"(, "law": "neo-hookean")", R"(, "settle": false)"})
    {
        bar.skeleton = R"("E": 2e3, "across": 8, "rest": "as-drawn")" + std::string(more);
        const auto simulation = bar.start();
        EXPECT_TRUE(simulation->warnings().empty()) << more;
        for (int frame = 0; frame < 5; ++frame)
            simulation->next_frame();
        const SimulationReport frame = simulation->report();
        EXPECT_LT(simulation->snapshot().state.u.cwiseAbs().maxCoeff(), 1e-9) << more;
        EXPECT_LT(frame.kinetic, 1e-9) << more;
        EXPECT_LT(std::abs(frame.gravity), 1e-9 * 4e4) << more;
    }
}

TEST(FleshSimulation, what_bears_the_weight_of_a_drawn_shape_turns_with_the_bones)
{
    // Upside down the forces that bear the weight of the drawn shape are a second weight.
    Bar bar;
    bar.skeleton = R"("E": 1e6, "across": 8, "rest": "as-drawn")";
    bar.keys = R"({"time": 0, "joint": "root", "rotate": [0, 0, 1, 180]})";
    bar.more = R"(, "gravity": [0, -9.81, 0])";
    const auto turned = [](const FleshSimulation& of)
    {
        double lowest = 0.0;
        const DeformedSamples now = of.deformed_live();
        for (std::size_t i = 0; i < now.samples.size(); ++i)
            lowest = std::min(lowest, now.samples[i].y() + of.geometry().samples[i].y());
        return lowest;
    };
    const double upside_down = turned(*bar.start(true));
    EXPECT_LT(upside_down, -1e-4);
    bar.skeleton = R"("E": 1e6, "across": 8)";
    bar.more = R"(, "gravity": [0, -19.62, 0])";
    EXPECT_NEAR(turned(*bar.start(true)) / upside_down, 1.0, 1e-6);
}

TEST(FleshSimulation,
     flesh_too_soft_for_a_rest_is_refused_with_the_stiffness_that_would_do)
{
    Bar bar;
    bar.keys = "";
    bar.more = R"(, "gravity": [0, -9.81, 0])";
    // Middles of cells are 0.25 m in each direction from points of the axis: density g
    // reach / E is 4.2, and 1 at 4,248 Pa.
    bar.skeleton = R"("E": 1e3, "across": 8, "settle": true)";
    const std::string said = bar.refusal();
    EXPECT_TRUE(contains(said, "skeleton.E: flesh that reaches 0.433 m")) << said;
    EXPECT_TRUE(contains(said, "E 4300 would do")) << said;
    bar.skeleton = R"("E": 4300, "across": 8, "settle": true)";
    EXPECT_TRUE(bar.start()->report().is_converged);
    bar.skeleton = R"("E": 1e3, "across": 8)";
    EXPECT_EQ(bar.refusal(), "");
    bar.skeleton = R"("E": 1e5, "across": 8, "settle": true,
                      "materials": [{"region": "box -1 -1 2  1 1 9", "E": 100}])";
    EXPECT_TRUE(contains(bar.refusal(), "skeleton.materials[0].E: flesh"));
}

TEST(FleshSimulation, without_a_stiffness_the_shape_holds_in_its_weight)
{
    Bar bar;
    bar.keys = "";
    bar.skeleton = R"("across": 16, "settle": true,
                      "materials": [{"region": "box -1 -1 3.9  1 1 9", "density": 900},
                                    {"region": "box -1 -1 -1  1 1 0.1", "E": 1e6}])";
    bar.more = R"(, "gravity": [0, -9.81, 0])";
    const auto hangs = bar.start();
    const std::vector<FleshMaterial>& materials = hangs->body().model->materials;
    EXPECT_TRUE(hangs->warnings().empty());
    EXPECT_GT(materials[0].young, 1e4);
    EXPECT_EQ(materials[1].young, materials[0].young);
    EXPECT_EQ(materials[2].young, 1e6);
    double most = 0.0;
    const DeformedSamples now = hangs->deformed_live();
    for (std::size_t i = 0; i < now.samples.size(); ++i)
        most = std::max(most, (now.samples[i] - hangs->geometry().samples[i]).norm());
    EXPECT_NEAR(most / std::sqrt(1.0 + 1.0 + 16.0), 0.02, 0.003);
    // It does not depend on gravity, and the same E in the scene does the same.
    bar.more = "";
    bar.skeleton.replace(bar.skeleton.find("true"), 4, "false");
    EXPECT_EQ(bar.start()->body().model->materials[0].young, materials[0].young);
    bar.more = R"(, "gravity": [0, -9.81, 0])";
    bar.skeleton = R"("E": 2e3, "across": 16)";
    const auto soft = bar.start();
    ASSERT_EQ(soft->warnings().size(), 1u);
    EXPECT_TRUE(contains(soft->warnings()[0], "skeleton.E: the flesh sags by "));
    EXPECT_TRUE(contains(soft->warnings()[0], "E " + shortest(materials[0].young) +
                                                  " sags by 2 % of the size at the most"))
        << soft->warnings()[0] << materials[0].young;
}

TEST(FleshSimulation,
     flesh_that_sags_by_a_third_of_its_thickness_over_a_bone_is_warned_of)
{
    Bar bar;
    bar.more = R"(, "gravity": [0, -9.81, 0])";
    bar.skeleton = R"("E": 2e4, "across": 16)";
    EXPECT_TRUE(bar.start()->warnings().empty());
    bar.skeleton = R"("E": 4e3, "across": 16)"; // some 5 % of the diagonal
    const auto soft = bar.start();
    ASSERT_EQ(soft->warnings().size(), 1u);
    EXPECT_TRUE(contains(soft->warnings()[0], "of its thickness in its weight"))
        << soft->warnings()[0];
}

TEST(FleshSimulation, bones_that_hold_the_same_place_are_warned_of_by_name)
{
    Bar bar;
    const auto warning = [&](const std::string& more) -> std::string
    {
        const SceneFile scene =
            parse_scene(bar.folder / "s.json", R"({"cellwarp": 1, "model": "bar.obj",
            "simulate": {"duration": 0.5}, "skeleton": {"E": 2e4, "joints": [
                {"name": "root", "parent": null, "at": [0, 0, 0]},
                {"name": "a", "parent": "root", "at": [0, 0, 4]}, )" +
                                                   more + "]}}");
        const FleshSimulation simulation(
            std::make_shared<const Geometry>(read_geometry(scene.model).geometry), scene,
            settings_of(scene).cells);
        for (const std::string& line : simulation.warnings())
            if (contains(line, "bones hold the same place"))
                return line;
        return "";
    };
    EXPECT_TRUE(contains(warning(R"({"name": "b", "parent": "root", "at": [0, 0, 3]},
                                    {"name": "c", "parent": "b", "at": [0, 0, 1]})"),
                         "move apart: root and b"));
    // Two bones of one joint move as one, and bones may meet at any angle.
    EXPECT_EQ(warning(R"({"name": "b", "parent": "root", "at": [0, 0, 3]})"), "");
    EXPECT_EQ(warning(R"({"name": "b", "parent": "root", "at": [0.3, 0, 3]},
                         {"name": "c", "parent": "b", "at": [0, 0.1, 1]})"),
              "");
}

TEST(FleshSimulation, where_rest_in_its_weight_is_not_found_flesh_has_none)
{
    Bar bar;
    bar.keys = "";
    bar.more = R"(, "gravity": [0, -9.81, 0])";
    // Points that touch are others in each round.
    bar.skeleton = R"("E": 6.2e3, "across": 8, "settle": true, "law": "stvk",
                      "obstacles": [{"plane": [0, 1, 0, -0.55], "friction": 0.5}])";
    const auto simulation = bar.start();
    for (Eigen::Index n = 0; n < simulation->snapshot().state.u.size(); ++n)
        ASSERT_EQ(simulation->snapshot().state.u[n], 0.0);
    EXPECT_EQ(simulation->report().stop, "no rest before frame 0");
}

TEST(FleshSimulation, a_root_far_away_carries_all_there_at_once)
{
    Bar bar, far;
    far.keys = R"({"time": 0, "joint": "root", "translate": [1e6, 2e5, 0],
                   "rotate": [0, 0, 1, 50]},
                  {"time": 0, "joint": "knee", "rotate": [1, 0, 0, 30]})";
    bar.keys = R"({"time": 0, "joint": "knee", "rotate": [1, 0, 0, 30]})";
    const auto near = bar.start(true), there = far.start(true);
    const SimulationReport one = near->report(), other = there->report();
    EXPECT_TRUE(other.is_converged);
    EXPECT_LE(other.iterations, one.iterations + 2);
    EXPECT_NEAR(other.elastic / one.elastic, 1.0, 1e-6);
    const Eigen::AngleAxisd turn(50.0 * M_PI / 180.0, Vector3d::UnitZ());
    const DeformedSamples a = near->deformed_live(), b = there->deformed_live();
    for (std::size_t i = 0; i < a.samples.size(); ++i)
        ASSERT_LT((turn * a.samples[i] + Vector3d(1e6, 2e5, 0) - b.samples[i]).norm(),
                  1e-6);
}

namespace
{

/// Nodes a quarter of a second after the weight is let go.
std::vector<Vector3d> nodes_after(const std::string& integrator, int steps)
{
    Bar bar;
    bar.skeleton = R"("E": 2e4, "across": 8, "newton": 5)";
    bar.keys = "";
    bar.more =
        integrator + R"(, "gravity": [0, -9.81, 0], "dt": )" + shortest(0.25 / steps);
    const auto simulation = bar.start(true);
    while (simulation->steps_done() < steps)
        simulation->step();
    return simulation->nodes();
}

double rms(const std::vector<Vector3d>& a, const std::vector<Vector3d>& b)
{
    double sum = 0.0;
    for (std::size_t n = 0; n < a.size(); ++n)
        sum += (a[n] - b[n]).squaredNorm();
    return std::sqrt(sum / static_cast<double>(a.size()));
}

} // namespace

TEST(FleshSimulation, the_error_of_bdf2_falls_with_the_square_of_the_step)
{
    const std::string euler = R"(, "integrator": "implicit-euler")",
                      bdf2 = R"(, "integrator": "bdf2")";
    const std::vector<Vector3d> truth = nodes_after(bdf2, 640);
    const double coarse = rms(nodes_after(bdf2, 40), truth),
                 fine = rms(nodes_after(bdf2, 80), truth),
                 of_euler = rms(nodes_after(euler, 80), truth);
    EXPECT_GT(coarse / fine, 3.3);
    EXPECT_LT(coarse / fine, 5.0);
    EXPECT_GT(of_euler / fine, 5.0);
    // It is what a scene without the word has.
    EXPECT_EQ(rms(nodes_after("", 20), nodes_after(bdf2, 20)), 0.0);
    EXPECT_GT(rms(nodes_after(euler, 20), nodes_after(bdf2, 20)), 0.0);
}

TEST(FleshSimulation, a_frame_from_a_snapshot_is_the_baked_one_to_the_bit)
{
    const Bar bar;
    const auto baked = bar.start();
    for (int frame = 0; frame < 4; ++frame)
        baked->next_frame();
    const FleshSimulation::Snapshot snapshot = baked->snapshot();
    for (int frame = 0; frame < 4; ++frame)
        baked->next_frame();
    // Another object, which has done and shown other things.
    const auto live = bar.start();
    for (int frame = 0; frame < 11; ++frame)
    {
        live->next_frame();
        live->deformed();
    }
    live->go_to(snapshot);
    for (int frame = 0; frame < 4; ++frame)
    {
        live->next_frame();
        live->report();
        live->deformed_live();
    }
    EXPECT_TRUE(live->snapshot().state == baked->snapshot().state);
    EXPECT_EQ(live->deformed().samples, baked->deformed().samples);
}

TEST(FleshSimulation, places_that_are_reached_depend_on_the_time_alone)
{
    Bar bar;
    bar.keys = R"({"time": 0, "joint": "foot", "to": [0, 0, 4]},
                  {"time": 0.5, "joint": "foot", "to": [0, 2, 3]})";
    const auto baked = bar.start();
    for (int frame = 0; frame < 6; ++frame)
        baked->next_frame();
    const FleshSimulation::Snapshot snapshot = baked->snapshot();
    for (int frame = 0; frame < 4; ++frame)
        baked->next_frame();
    EXPECT_LT((baked->joints()[2].place - Vector3d(0, 4.0 / 3.0, 4 - 2.0 / 3.0)).norm(),
              1e-9);
    const auto other = bar.start();
    other->next_frame();
    other->go_to(snapshot);
    for (int frame = 0; frame < 4; ++frame)
        other->next_frame();
    EXPECT_TRUE(other->snapshot().state == baked->snapshot().state);
}

TEST(FleshSimulation, joints_are_led_by_hand_while_time_runs)
{
    const Bar bar;
    const auto simulation = bar.start();
    Move move;
    move.region = "knee";
    for (int k = 1; k <= 60; ++k)
    {
        Operation& turn = move.operations.emplace_back();
        turn.kind = Operation::Kind::Rotate;
        turn.move.axis = Vector3d::UnitY();
        turn.move.degrees = 0.5 * k;
        simulation->lead({move});
        simulation->step();
        move.operations.clear();
    }
    const Eigen::AngleAxisd now(30.0 * M_PI / 180.0, Vector3d::UnitY());
    EXPECT_LT(
        (simulation->joints()[2].place - (Vector3d(0, 0, 2) + now * Vector3d(0, 0, 2)))
            .norm(),
        1e-12);
    EXPECT_LT(simulation->report().violation, 1e-12);
    // Let go, it is where its keys have it.
    simulation->lead({});
    simulation->step();
    EXPECT_LT(simulation->report().violation, 1e-12);
}

namespace
{

/// The sample at a place at rest.
std::size_t sample_at(const FleshSimulation& of, const Vector3d& place)
{
    const std::vector<Vector3d>& samples = of.geometry().samples;
    return static_cast<std::size_t>(
        std::min_element(samples.begin(), samples.end(),
                         [&](const Vector3d& a, const Vector3d& b)
                         { return (a - place).norm() < (b - place).norm(); }) -
        samples.begin());
}

void to_the_end(FleshSimulation& of)
{
    while (of.steps_done() < of.num_steps())
        of.next_frame();
}

const std::string kStill = R"({"time": 0, "joint": "knee", "rotate": [1, 0, 0, 0]})";

} // namespace

TEST(FleshSimulation, a_ball_that_comes_keeps_the_flesh_out)
{
    Bar bar;
    bar.keys = kStill;
    bar.skeleton = R"("E": 2e4, "across": 8, "damping": {"alpha": 5},
        "obstacles": [{"sphere": [1.3, 0, 3, 0.5], "friction": 0.3,
                     "keys": [{"time": 0, "translate": [0, 0, 0]},
                              {"time": 0.3, "translate": [-0.5, 0, 0]}]}])";
    const auto simulation = bar.start(true);
    EXPECT_EQ(simulation->warnings(), std::vector<std::string>());
    simulation->next_frame();
    EXPECT_EQ(simulation->report().flesh->contacts, 0u);
    to_the_end(*simulation);
    const SimulationReport frame = simulation->report();
    EXPECT_TRUE(frame.is_converged) << frame.stop;
    EXPECT_GT(frame.flesh->contacts, 0u);
    EXPECT_LT(frame.flesh->support.x(), -100.0);
    EXPECT_LT(std::abs(frame.flesh->support.y()),
              0.15 * std::abs(frame.flesh->support.x()));
    double deepest = 0.0;
    for (const Vector3d& x : simulation->deformed_live().samples)
        deepest = std::max(deepest, 0.5 - (x - Vector3d(0.8, 0, 3)).norm());
    EXPECT_LT(deepest, 0.03); // between the points that touch
    const Geometry seen = simulation->obstacles();
    const ModelBox box = bounding_box(seen.samples);
    EXPECT_LT((box.centre() - Vector3d(0.8, 0, 3)).norm(), 1e-2);
    EXPECT_NEAR(box.size().x(), 1.0, 1e-2);
    // From a snapshot it goes on to the bit.
    const FleshSimulation::Snapshot end = simulation->snapshot();
    simulation->step();
    const FleshState once = simulation->snapshot().state;
    simulation->go_to(end);
    simulation->step();
    EXPECT_EQ(once, simulation->snapshot().state);
}

TEST(FleshSimulation, flesh_that_falls_lies_on_the_ground)
{
    Bar bar;
    // Bones above it hold nothing: it is free.
    bar.skeleton = R"("E": 2e5, "across": 8, "damping": {"alpha": 8},
        "obstacles": [{"plane": [0, 0, 2, -0.2], "friction": 0.2}])";
    bar.keys = kStill;
    bar.more = R"(, "gravity": [0, 0, -9.81], "duration": 2)";
    const SceneFile scene =
        parse_scene(bar.folder / "s.json",
                    R"({"cellwarp": 1, "model": "bar.obj", "skeleton": {"joints": [
            {"name": "root", "parent": null, "at": [9, 0, 0]},
            {"name": "tip", "parent": "root", "at": [9, 0, 2]}], )" +
                        bar.skeleton +
                        R"(}, "simulate": {"duration": 2, "gravity": [0, 0, -9.81]}})");
    FleshSimulation simulation(
        std::make_shared<const Geometry>(read_geometry(scene.model).geometry), scene,
        settings_of(scene).cells, true);
    // It trembles, and a last bit decides how: means over the second half are looked at.
    double support = 0.0, lowest = 0.0, frames = 0.0;
    while (simulation.steps_done() < simulation.num_steps())
    {
        simulation.next_frame();
        if (2 * simulation.steps_done() <= simulation.num_steps())
            continue;
        support += simulation.report().flesh->support.z();
        double low = 0.0;
        for (const Vector3d& x : simulation.deformed_live().samples)
            low = std::min(low, x.z());
        lowest += low;
        ++frames;
    }
    EXPECT_NEAR(support / frames, 4000.0 * 9.81, 0.03 * 4000.0 * 9.81);
    // It sags a little between the points that touch.
    EXPECT_NEAR(lowest / frames, -0.1, 0.02);
}

TEST(FleshSimulation, points_that_are_held_go_as_they_are_told)
{
    Bar bar;
    bar.keys = kStill;
    const std::string usual = R"("E": 2e4, "across": 8, "held": [{"at": [0.5, 0, 3.5], )";
    const std::string keys = R"("keys": [{"time": 0.1, "translate": [0, 0, 0]},
        {"time": 0.4, "translate": [0.3, 0.2, 0.1]}]}])";
    bar.skeleton = usual + keys;
    auto simulation = bar.start();
    const std::size_t sample = sample_at(*simulation, {0.5, 0, 3.5});
    to_the_end(*simulation);
    EXPECT_LT(
        (simulation->deformed_live().samples[sample] - Vector3d(0.8, 0.2, 3.6)).norm(),
        1e-9);
    EXPECT_LT(simulation->report().violation, 1e-12);
    EXPECT_EQ(simulation->joints().size(), 3u); // it is no joint
    // Written samples are exact there, too.
    EXPECT_LT((simulation->deformed().samples[sample] - Vector3d(0.8, 0.2, 3.6)).norm(),
              1e-3);
    bar.skeleton = usual + R"("normal": [0, 2, 0], )" + keys;
    simulation = bar.start();
    to_the_end(*simulation);
    const Vector3d now = simulation->deformed_live().samples[sample];
    EXPECT_NEAR(now.y(), 0.2, 1e-9);
    EXPECT_GT(std::abs(now.x() - 0.8), 0.1); // free to go there or not
    EXPECT_GT(simulation->report().flesh->pull.y(), 1.0);
}

TEST(FleshSimulation, held_points_that_bones_have_are_told_and_ignored)
{
    Bar bar;
    bar.keys = kStill;
    const std::string usual = R"("E": 2e4, "across": 8, "held": [{"at": [0, 0, 1.25], )";
    const std::string keys = R"("keys": [{"time": 0, "translate": [0, 0, 0]},
        {"time": 0.3, "translate": [0, 0.1, 0]}]}])";
    for (const char* const way : {"", R"("normal": [0, 1, 0], )"})
    {
        bar.skeleton = usual + way + keys;
        const auto simulation = bar.start();
        ASSERT_EQ(simulation->warnings().size(), 1u);
        EXPECT_TRUE(contains(simulation->warnings()[0], "skeleton.held[0]: lies where"));
        to_the_end(*simulation);
        EXPECT_LT(simulation->report().flesh->largest_strain, 1e-6);
    }
}

TEST(FleshSimulation, points_in_the_middle_of_a_cell_are_held_as_well)
{
    Bar bar;
    bar.keys = kStill;
    // No node of the cell has a share that could be solved for.
    bar.skeleton = R"("E": 2e4, "across": 8, "held": [{"at": [0.25, 0.25, 3.25],
        "keys": [{"time": 0, "translate": [0, 0, 0]},
                 {"time": 0.3, "translate": [0, 0.2, 0.1]}]}])";
    const auto simulation = bar.start();
    EXPECT_TRUE(simulation->warnings().empty());
    to_the_end(*simulation);
    EXPECT_GT(simulation->report().flesh->pull.y(), 10.0);
    // The samples around it have gone along.
    const std::size_t sample = sample_at(*simulation, {0.5, 0.25, 3.25});
    EXPECT_NEAR(simulation->deformed_live().samples[sample].y() - 0.25, 0.2, 0.2);
}

TEST(FleshSimulation, what_begins_inside_an_obstacle_comes_out_slowly)
{
    Bar bar;
    bar.keys = kStill;
    bar.skeleton = R"("E": 2e4, "across": 8, "damping": {"alpha": 5},
        "obstacles": [{"sphere": [0.9, 0, 3.5, 0.8]}])";
    const auto simulation = bar.start();
    double fastest = 0.0;
    while (simulation->steps_done() < simulation->num_steps())
    {
        simulation->step();
        fastest = std::max(fastest, simulation->snapshot().state.v.cwiseAbs().maxCoeff());
    }
    EXPECT_LT(fastest, 4.0); // at once would be 48 m/s
    EXPECT_TRUE(simulation->report().is_converged);
}

TEST(FleshSimulation, a_hand_pulls_a_sample_and_lets_it_go)
{
    Bar bar;
    bar.keys = kStill;
    bar.skeleton += R"(, "damping": {"alpha": 1})";
    const auto simulation = bar.start();
    const std::size_t sample = sample_at(*simulation, {0.5, 0, 3.5});
    const auto off = [&](const Vector3d& place)
    { return (simulation->deformed_live().samples[sample] - place).norm(); };
    simulation->pull(FleshPull{sample, {1.0, 0.3, 3.5}});
    for (int k = 0; k < 40; ++k)
        simulation->step();
    EXPECT_LT(off({1.0, 0.3, 3.5}), 1e-3);
    EXPECT_GT(simulation->report().flesh->pull.x(), 10.0);
    simulation->pull(std::nullopt);
    for (int k = 0; k < 600; ++k)
        simulation->step();
    EXPECT_LT(off({0.5, 0, 3.5}), 0.05);
}

TEST(FleshSimulation, blended_regions_follow_their_bones)
{
    Bar bar;
    bar.skeleton = R"("E": 1e6, "across": 8, "law": "regions")";
    const auto simulation = bar.start();
    to_the_end(*simulation);
    const SimulationReport frame = simulation->report();
    EXPECT_TRUE(frame.is_converged);
    EXPECT_LT(frame.violation, 1e-12);
    const Eigen::AngleAxisd turn(60.0 * M_PI / 180.0, Vector3d::UnitX());
    const DeformedSamples now = simulation->deformed_live();
    EXPECT_LT(away(*simulation, now, 0.0, 0.5, [](const Vector3d& x) { return x; }),
              0.15);
    EXPECT_LT(away(*simulation, now, 3.5, 4.0,
                   [&](const Vector3d& x) -> Vector3d
                   { return Vector3d(0, 0, 2) + turn * (x - Vector3d(0, 0, 2)); }),
              0.3);
}

TEST(FleshSimulation, painted_weights_replace_those_by_distance)
{
    Bar bar;
    bar.skeleton = R"("E": 1e5, "across": 8, "law": "regions")";
    auto by_distance = bar.start();
    std::string weights = "cellwarp-weights 1\nroot knee\n";
    for (const Vector3d& x : by_distance->geometry().samples)
        weights += x.z() < 3.0 ? "1 0\n" : "0 2\n";
    bar.folder.write("w.txt", weights);
    bar.skeleton += R"(, "weights": "w.txt")";
    auto painted = bar.start();
    to_the_end(*by_distance);
    to_the_end(*painted);
    EXPECT_TRUE(painted->report().is_converged);
    double most = 0.0;
    for (std::size_t i = 0; i < painted->geometry().samples.size(); ++i)
        most = std::max(most, (painted->deformed_live().samples[i] -
                               by_distance->deformed_live().samples[i])
                                  .norm());
    EXPECT_GT(most, 0.02);
    EXPECT_LT(most, 1.0);
    bar.folder.write("w.txt", "cellwarp-weights 1\nroot\n1\n");
    EXPECT_TRUE(contains(bar.refusal(), "has 1 lines of numbers, the model"));
    bar.folder.write("w.txt", weights.replace(weights.find("knee"), 4, "knie"));
    EXPECT_TRUE(contains(bar.refusal(), "knie: is no joint"));
}

TEST(FleshSimulation, materials_of_regions_are_softer_and_heavier)
{
    Bar bar;
    const double mass = bar.start()->body().mass;
    EXPECT_NEAR(mass, 4000.0, 1e-6);
    bar.skeleton +=
        R"(, "materials": [{"region": "box -1 -1 2  1 1 9", "density": 500}])";
    EXPECT_NEAR(bar.start()->body().mass, 3000.0, 1e-6);
    bar.skeleton += R"(, "settle": true)";
    bar.skeleton.replace(bar.skeleton.find("500"), 3, "1000, \"E\": 1e30");
    bar.more = R"(, "gravity": [0, -9.81, 0])";
    bar.keys = R"({"time": 0, "joint": "knee", "rotate": [1, 0, 0, 0]})";
    const auto simulation = bar.start(true);
    const DeformedSamples now = simulation->deformed_live();
    EXPECT_LT(away(*simulation, now, 2.5, 4.0, [](const Vector3d& x) { return x; }),
              1e-6);
    EXPECT_GT(away(*simulation, now, 0.0, 1.5, [](const Vector3d& x) { return x; }),
              1e-3);
}

TEST(FleshSimulation, cells_that_bones_pass_are_finer_where_it_is_asked_for)
{
    Bar bar;
    const std::size_t cells = bar.start()->body().flesh->lattice().cells.size();
    bar.skeleton += R"(, "max_depth": 1)";
    const auto finer = bar.start();
    EXPECT_GT(finer->body().flesh->lattice().cells.size(), 2 * cells);
    for (int frame = 0; frame < 5; ++frame)
        finer->next_frame();
    EXPECT_LT(finer->report().violation, 1e-12);
}

TEST(FleshSimulation, a_drawn_lattice_has_bones_on_its_edges)
{
    Bar bar;
    const std::string mesh = drawn_mesh();
    bar.folder.write("bar.mesh", mesh);
    bar.skeleton = R"("E": 2e4, "lattice": "bar.mesh")";
    const auto simulation = bar.start();
    EXPECT_TRUE(simulation->warnings().empty()) << simulation->warnings().front();
    EXPECT_EQ(simulation->body().held, 5u);
    EXPECT_EQ(simulation->body().dropped, 0u);
    EXPECT_EQ(simulation->body().flesh->nodes().bound.size(), 5u);
    for (int frame = 0; frame < 15; ++frame)
        simulation->next_frame();
    EXPECT_LT(simulation->report().violation, 1e-12);
    const std::optional<Volume> volume =
        enclosed_volumes(simulation->geometry(), simulation->deformed().samples);
    EXPECT_NEAR(volume->after / volume->before, 1.0, 0.1);
    // Edges away from the bones.
    bar.folder.write("bar.mesh", mesh + "Edges 1\n1 2 0\n");
    EXPECT_TRUE(contains(bar.refusal(), "bar.mesh:72: Edges: the edge of vertices 1 and "
                                        "2 lies on no bone of the skeleton (1 of 5"));
    // Twins, and cells that are turned inside out, by the line of what was drawn.
    bar.folder.write("bar.mesh", mesh + "Tetrahedra 2\n1 2 4 10 0\n10 4 2 1 0\n");
    EXPECT_TRUE(contains(bar.refusal(),
                         "bar.mesh:73: tetrahedron 2 has the corners of tetrahedron 1"));
    bar.folder.write("bar.mesh", mesh + "Hexahedra 1\n1 2 5 4 5 14 11 10 0\n");
    EXPECT_TRUE(
        contains(bar.refusal(), "bar.mesh:72: hexahedron 17 is turned inside out"))
        << bar.refusal();
}

TEST(FleshSimulation, cells_of_a_drawn_lattice_are_halved_to_the_level_that_is_asked_for)
{
    Bar bar;
    bar.folder.write("bar.mesh", drawn_mesh());
    for (const int level : {0, 1, 2})
    {
        bar.skeleton =
            R"("E": 2e4, "lattice": "bar.mesh", "max_depth": )" + std::to_string(level);
        const auto simulation = bar.start();
        const Lattice& lattice = simulation->body().flesh->lattice();
        const std::size_t n = 1u << level;
        EXPECT_EQ(lattice.cells.size(), 16 * n * n * n);
        EXPECT_EQ(lattice.places.size(), (2 * n + 1) * (2 * n + 1) * (4 * n + 1));
        EXPECT_EQ(lattice.coarser.size(), idx(level));
        EXPECT_EQ(simulation->body().held, 4 * n + 1); // along all of the edges
        EXPECT_EQ(simulation->body().dropped, 0u);
        EXPECT_NEAR(simulation->body().mass, 1000 * 1.2 * 1.2 * 4, 1e-6);
        for (int frame = 0; frame < 3; ++frame)
            simulation->next_frame();
        EXPECT_TRUE(simulation->report().is_converged);
        EXPECT_LT(simulation->report().violation, 1e-12);
    }
    bar.skeleton = R"("E": 2e4, "lattice": "bar.mesh", "max_depth": 20)";
    try
    {
        bar.start();
        ADD_FAILURE() << "so many cells are refused";
    }
    catch (const Error& error)
    {
        EXPECT_EQ(error.fault(), Fault::Budget);
        EXPECT_TRUE(contains(error.what(), "skeleton.max_depth: at depth "))
            << error.what();
    }
}

TEST(FleshSimulation, cells_of_a_drawn_lattice_have_materials_by_region_or_reference)
{
    Bar bar;
    bar.folder.write("bar.mesh", drawn_mesh());
    for (const char* const told :
         {R"("region": "box -1 -1 2  1 1 9")", R"("reference": 2)"})
    {
        bar.skeleton =
            R"("E": 2e4, "lattice": "bar.mesh", "max_depth": 1, "materials": [{)" +
            std::string(told) + R"(, "density": 500}])";
        const auto simulation = bar.start();
        EXPECT_NEAR(simulation->body().mass, 750 * 1.2 * 1.2 * 4, 1e-6);
        for (const LatticePart& part : simulation->body().flesh->lattice().parts)
            EXPECT_EQ(part.material,
                      simulation->body().model->to_model(part.centre).z() > 2.0 ? 1 : 0);
    }
}

TEST(FleshSimulation, weights_of_a_drawn_lattice_are_of_its_vertices_or_of_samples)
{
    Bar bar;
    bar.folder.write("bar.mesh", drawn_mesh());
    const auto with_rows =
        [&](std::size_t rows, const std::function<bool(std::size_t)>& root)
    {
        std::string weights = "cellwarp-weights 1\nroot knee\n";
        for (std::size_t i = 0; i < rows; ++i)
            weights += root(i) ? "1 0\n" : "0 1\n";
        bar.folder.write("w.txt", weights);
        bar.skeleton = R"("E": 2e4, "lattice": "bar.mesh", "max_depth": 1,
                          "law": "regions", "weights": "w.txt")";
        const auto simulation = bar.start();
        for (int frame = 0; frame < 3; ++frame)
            simulation->next_frame();
        EXPECT_LT(simulation->report().violation, 1e-12);
        return simulation->deformed().samples;
    };
    // The region of the root has the lower half, or all: rows that differ count.
    const auto halves = with_rows(45, [](std::size_t i) { return i < 27; });
    EXPECT_NE(halves, with_rows(45, [](std::size_t) { return true; }));
    const std::size_t samples = halves.size();
    ASSERT_NE(samples, 45u);
    with_rows(samples, [](std::size_t i) { return i % 2 == 0; });
    bar.folder.write("w.txt", "cellwarp-weights 1\nroot\n1\n");
    EXPECT_TRUE(contains(bar.refusal(), "w.txt: has 1 lines of numbers, the model " +
                                            std::to_string(samples) +
                                            " samples, the lattice 45 vertices"));
}

TEST(FleshSimulation, what_cannot_be_is_refused_by_its_key)
{
    Bar bar;
    const std::string usual = bar.skeleton;
    bar.folder.write("bar.mesh", drawn_mesh());
    bar.folder.write("w.txt", "cellwarp-weights 1\nroot\n1\n");
    for (const auto& [more, what] :
         {std::pair{R"(, "weights": "w.txt")",
                    "skeleton.weights: are of the law regions, the law is cells"},
          {R"(, "law": "regions", "newton": 2)", "skeleton.newton: is for other laws"},
          {R"(, "materials": [{"reference": 1}])",
           "skeleton.materials[0].reference: is of the cells of a lattice of a file"},
          {R"(, "lattice": "bar.mesh", "materials": [{"reference": 1}])",
           "skeleton.materials[0].reference: no cell of the lattice has it"},
          {R"(, "lattice": "bar.mesh", "materials": [{"region": "box 9 9 9 10 10 10"}])",
           "skeleton.materials[0].region: no cell of the lattice has it"},
          {R"(, "lattice": "bar.mesh", "law": "regions", "weights": "w.txt")",
           "has 1 lines of numbers, the model "},
          {R"(, "detail_regions": ["all"])", "skeleton.detail_regions: need detail"},
          {R"(, "detail": 0.1, "detail_regions": ["bocks 1"])",
           "skeleton.detail_regions"},
          {R"(, "held": [{"at": [0, 0, 9]}])", "skeleton.held[0].at: lies outside"},
          {R"(, "obstacles": [{"plane": [0, 0, 0, 0]}])",
           "skeleton.obstacles[0].plane: its normal"},
          {R"(, "materials": [{"region": "bocks 1"}])", "skeleton.materials[0].region"}})
    {
        bar.skeleton = usual + more;
        EXPECT_TRUE(contains(bar.refusal(), what)) << bar.refusal();
    }
    bar.skeleton = usual;
    for (const bool of_cells : {true, false})
    {
        const SceneFile scene = bar.scene();
        CellSettings cells = settings_of(scene).cells;
        if (of_cells)
            cells.max_cells = 10;
        else
            cells.max_memory = 1e6;
        const std::string said = support::error_of(
            Fault::Budget,
            [&]
            {
                FleshSimulation(
                    std::make_shared<const Geometry>(read_geometry(scene.model).geometry),
                    scene, cells, false);
            });
        EXPECT_TRUE(contains(said, "skeleton.across: ")) << said;
    }
    bar.more = R"(, "integrator": "midpoint")";
    EXPECT_TRUE(contains(bar.refusal(), "simulate.integrator: got 'midpoint', flesh has "
                                        "implicit-euler and bdf2"));
}

TEST(FleshSimulation, the_unit_scales_the_model_and_gravity_acts_in_metres)
{
    // A model in centimetres falls as fast as one in metres: 1/2 g t^2.
    Bar bar;
    bar.keys = "";
    bar.folder.write("bar.obj", support::obj_text(support::joined(
                                    support::box_shape({-0.5, -0.5, 0}, {0.5, 0.5, 4}, 4),
                                    support::box_shape({2, -0.5, 0}, {3, 0.5, 4}, 4))));
    bar.more = R"(, "gravity": [0, -9.81, 0]}, "unit": 0.01, "x": {"y": 1)";
    // The weight of a drawn shape is borne by forces that turn with bones: none is here.
    for (const char* rest : {"unloaded", "as-drawn"})
    {
        bar.skeleton = R"("E": 1e8, "across": 8, "rest": ")" + std::string(rest) + '"';
        const auto simulation = bar.start();
        ASSERT_FALSE(simulation->warnings().empty());
        EXPECT_TRUE(contains(simulation->warnings().back(), "have no bone"));
        for (int frame = 0; frame < 3; ++frame)
            simulation->next_frame();
        const DeformedSamples now = simulation->deformed_live();
        // BDF2 has speeds without an error, and of heights that of its first step,
        // Euler's.
        const double dt = 1.0 / 120.0;
        double before = 0.0, fall = 9.81 * dt * dt / 0.01;
        for (std::int64_t step = 2; step <= simulation->steps_done(); ++step)
            before = std::exchange(
                fall, (4.0 * fall - before +
                       2.0 * 9.81 * dt * dt * static_cast<double>(step) / 0.01) /
                          3.0);
        EXPECT_NEAR(fall * 0.01,
                    0.5 * 9.81 * std::pow(dt * double(simulation->steps_done()), 2),
                    9.81 * dt * dt);
        EXPECT_NEAR(now.samples.back().y() - simulation->geometry().samples.back().y(),
                    -fall, 1e-6 * fall);
    }
}

} // namespace cellwarp::core
