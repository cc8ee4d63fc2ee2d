// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/time/carried_model.h"

#include <cmath>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "io/scene/scene_file.h"
#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "tests/support/sessions.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::error_of;
using support::handles;
using support::long_bar;
using support::model;
using support::settings;

namespace
{

using Eigen::Vector3d;

RodScene scene_of(const std::string& rod, const std::string& simulate,
                  const std::string& more = "")
{
    return parse_scene("s.json", R"({"cellwarp": 1, "model": "bar.obj", "rods": [{)"
                                 R"("name": "spine", "carries": true, )" +
                                     rod + "}], " + more + R"("simulate": )" + simulate +
                                     "}")
        .time;
}

/// In the bar's axis, clamped at its foot, which turns by 70 degrees in 0.2 s.
const std::string kAxis = R"("through": [[0,0,0.2],[0,0,2],[0,0,3.8]], "radius": 0.1,
    "E": 1e6, "fixed": [{"at": 0, "what": ["point", "tangent", "twist"],
    "keys": [{"time": 0}, {"time": 0.2, "rotate": [1,0,0,70], "translate": [0,0.3,0]}]}])";
const std::string kSwings = R"({"dt": 0.01, "duration": 0.4, "every": 0.1})";

std::vector<Vector3d> run(const Shape& shape, const RodScene& scene,
                          const std::string& text = "")
{
    ObjectSimulation simulation(scene);
    CarriedModel carried(std::make_shared<const Geometry>(model(shape)), handles(text),
                         settings(12), scene.unit, simulation);
    const std::int64_t frames = simulation.is_static() ? 1 : simulation.last_frame();
    for (std::int64_t frame = 1; frame <= frames; ++frame)
    {
        simulation.next_frame();
        carried.follow(simulation, true);
        EXPECT_EQ(carried.session().frames().back().solve.stop, Stop::Converged);
    }
    return carried.session().deformed().samples;
}

Shape scaled(Shape shape, double by)
{
    for (Vector3d& x : shape.samples)
        x *= by;
    return shape;
}

} // namespace

TEST(CarriedModel, goes_along_rigidly_with_a_rod_that_does)
{
    // Nothing bends the rod: no weight, in equilibrium.
    const Shape shape = long_bar();
    const std::vector<Vector3d> samples =
        run(shape, scene_of(kAxis, R"({"integrator": "static", "gravity": [0,0,0]})"));
    const Eigen::Matrix3d R = rotation_about(Vector3d::UnitX(), 70 * M_PI / 180);
    const Vector3d foot(0, 0, 0.2);
    for (std::size_t i = 0; i < samples.size(); ++i)
        EXPECT_LT(
            (samples[i] - (R * (shape.samples[i] - foot) + foot + Vector3d(0, 0.3, 0)))
                .norm(),
            1e-6);
}

TEST(CarriedModel, has_its_cells_where_the_rod_is_in_time)
{
    const RodScene scene = scene_of(kAxis, kSwings);
    ObjectSimulation simulation(scene);
    const Shape shape = long_bar();
    CarriedModel carried(std::make_shared<const Geometry>(model(shape)), handles(""),
                         settings(12), 1.0, simulation);
    for (int frame = 1; frame <= 4; ++frame)
    {
        simulation.next_frame();
        carried.follow(simulation, true);
        const CellSystem& system = *carried.session().system();
        const SplineHandle& rod = *system.regions()[0].spline;
        const std::vector<Vector3d> curve = simulation.rods(129)[0].curve;
        int count = 0;
        for (std::size_t c = 0; c < system.poses().size(); ++c)
        {
            if (system.region_of_cell()[c] != 0)
                continue;
            ++count;
            // The place of the rod that is nearest to the cell moves with the cell.
            const Vector3d& centre = system.body().cells.cells[c].centre;
            const double share = rod.share_of_parameter(rod.nearest(centre));
            const Vector3d on_rod = system.rest().frame.to_model(image(
                system.poses()[c], centre, rod.rest()->at(rod.nearest(centre)).place));
            const double at = 128 * share;
            const std::size_t k = std::min<std::size_t>(127, std::size_t(at));
            EXPECT_LT((on_rod - (curve[k] + (at - double(k)) * (curve[k + 1] - curve[k])))
                          .norm(),
                      2e-4);
        }
        EXPECT_GT(count, 8);
        EXPECT_EQ(carried.session().frames().back().frame, frame);
    }
}

TEST(CarriedModel, is_the_same_to_the_bit_whatever_the_number_of_threads)
{
    std::vector<std::vector<Vector3d>> results;
    for (const int threads : {1, 2})
    {
        const ThreadLimit limit(threads);
        results.push_back(run(long_bar(), scene_of(kAxis, kSwings)));
    }
    EXPECT_EQ(results[0], results[1]);
}

TEST(CarriedModel, is_in_its_own_unit)
{
    const std::vector<Vector3d> metres = run(long_bar(), scene_of(kAxis, kSwings)),
                                centimetres =
                                    run(scaled(long_bar(), 100),
                                        scene_of(kAxis, kSwings, R"("unit": 0.01, )"));
    ASSERT_EQ(metres.size(), centimetres.size());
    for (std::size_t i = 0; i < metres.size(); ++i)
        EXPECT_LT((metres[i] - 0.01 * centimetres[i]).norm(), 1e-4);
}

TEST(CarriedModel, is_held_and_moved_by_handles_in_frames_of_the_same_number)
{
    const std::string fixed = "fixed tip box -1 -1 3.9 1 1 5\n";
    const RodScene scene = scene_of(R"("through": [[0,0,0.2],[0,0,1.2]], "radius": 0.1,
        "fixed": [{"at": 0, "what": ["point","tangent","twist"], "keys": [{"time": 0},
        {"time": 0.2, "translate": [0.4,0,0]}]}])",
                                    R"({"dt": 0.02, "duration": 0.2, "every": 0.1})");
    const Shape shape = long_bar();
    const std::vector<Vector3d> held = run(shape, scene, fixed),
                                led = run(shape, scene,
                                          "handle tip box -1 -1 3.9 1 1 5\nframe 2\n"
                                          "move tip translate 0 0 0.3\n");
    for (std::size_t i = 0; i < shape.samples.size(); ++i)
    {
        if (shape.samples[i].z() < 3.95)
            continue;
        EXPECT_LT((held[i] - shape.samples[i]).norm(), 1e-9);
        EXPECT_LT((led[i] - shape.samples[i] - Vector3d(0, 0, 0.3)).norm(), 1e-9);
    }
    for (const auto& [text, what] : std::vector<std::pair<std::string, std::string>>{
             {fixed + "frame 3\n",
              "h.handles:3: frame: got 3, this simulation moves things "
              "in frames 1 to 2"},
             {fixed + "frame 1\ncommit\n" + fixed + "frame 2\n", "commit: rods carry"},
             {"fixed spine box -1 -1 3.9 1 1 5\n", "spine: a rod of the scene has this"}})
    {
        const std::string error =
            error_of(Fault::Malformed, [&, &of = text] { run(shape, scene, of); });
        EXPECT_TRUE(contains(error, what)) << error;
    }
}

TEST(CarriedModel, needs_a_rod_that_passes_through_it)
{
    const RodScene scene = scene_of(R"("through": [[5,0,0],[5,0,1]])", kSwings);
    EXPECT_TRUE(contains(error_of(Fault::Unsolvable, [&] { run(long_bar(), scene); }),
                         "spine: "));
}

} // namespace cellwarp::core
