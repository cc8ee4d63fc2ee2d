// SPDX-License-Identifier: GPL-3.0-or-later
// cellwarp simulate with flesh and rods in one scene, from the outside.
#include <algorithm>
#include <chrono>
#include <filesystem>
#include <thread>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "editor/window/film.h"
#include "io/formats/geometry_file.h"
#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/shapes.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::Result;
using support::run;

namespace
{

using Json = nlohmann::json;

struct Files
{
    support::Folder folder;
    std::string scene;

    explicit Files(const std::string& place = "0 0 4")
    {
        folder.write("bar.obj", support::obj_text(support::box_shape({-0.5, -0.5, 0},
                                                                     {0.5, 0.5, 4}, 4)));
        scene = folder.write("s.json", R"({"cellwarp": 1, "model": "bar.obj",
              "skeleton": {"joints": [
                {"name": "root", "parent": null, "at": [0, 0, 0]},
                {"name": "knee", "parent": "root", "at": [0, 0, 2]}],
              "keys": [{"time": 0, "joint": "root", "rotate": [1, 0, 0, 0]}],
              "E": 2e4, "across": 8},
              "rods": [{"name": "rope", "radius": 0.02, "E": 1e7,
                        "through": [[0, 0, 4], [0, 1, 4], [0, 2, 4]]}],
              "connections": [{"a": "rod rope 0", "b": "flesh )" +
                                           place +
                                           R"("}],
              "simulate": {"duration": 0.2, "gravity": [0, 0, 0], "dt": 0.005,
                           "every": 0.05}})");
    }
};

} // namespace

TEST(SimulateJoined, writes_model_and_rods_and_tells_of_both)
{
    const Files files;
    const Result result = run({"simulate", files.scene, "-o", files.folder / "b.pc2",
                               "--rods", files.folder / "r-{frame}.obj", "--json"});
    ASSERT_EQ(result.code, 0) << result.err;
    const Json json = Json::parse(result.out);
    ASSERT_EQ(json["frames"].size(), 5u);
    const Json& last = json["frames"][4];
    EXPECT_EQ(last["stop"], "converged");
    EXPECT_LT(last["constraint"].get<double>(), 1e-9);
    ASSERT_EQ(last["rods"].size(), 1u);
    EXPECT_EQ(last["rods"][0]["name"], "rope");
    EXPECT_GE(last["energy"]["kinetic"].get<double>(),
              last["skeleton"]["kinetic"].get<double>());
    EXPECT_TRUE(last["momentum"].is_array());
    EXPECT_EQ(last["momentum"].size(), 3u);
    EXPECT_GT(last["iterations"].get<double>(), 0.0);
    EXPECT_NEAR(json["mass"].get<double>(), 4000.0, 1e-6);
    for (const char* part : {"rods", "skeleton"})
        EXPECT_EQ(std::count(json["unused"].begin(), json["unused"].end(), part), 0);
    EXPECT_TRUE(std::filesystem::exists(files.folder / "b.pc2"));
    EXPECT_FALSE(read_geometry(files.folder / "r-4.obj").geometry.samples.empty());
}

TEST(SimulateJoined, check_tells_of_flesh_and_faults_end_with_3)
{
    const Files files;
    const Result checked = run({"check", files.scene});
    EXPECT_EQ(checked.code, 0) << checked.err;
    EXPECT_TRUE(contains(checked.out, "flesh:"));
    const Files outside("0 0 5");
    const Result refused = run({"simulate", outside.scene, "--json"});
    EXPECT_EQ(refused.code, 3);
    EXPECT_TRUE(
        contains(refused.err, "connections[0]: the point (0, 0, 5) of the flesh"));
}

TEST(SimulateJoined, the_editor_plays_the_frames_of_simulate_to_the_bit)
{
    const Files files;
    Editing editing(Document(files.scene, ""));
    ASSERT_TRUE(Film::is_in(editing.document()));
    const Film film(editing);
    while (film.is_working())
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    EXPECT_EQ(film.error(), "");
    ASSERT_EQ(film.num_made(), 5);
    ASSERT_EQ(run({"simulate", files.scene, "-o", files.folder / "f{frame}.obj"}).code,
              0);
    for (int frame = 0; frame <= 4; ++frame)
    {
        const Geometry baked =
            read_geometry(files.folder / "f" + std::to_string(frame) + ".obj").geometry;
        EXPECT_EQ(film.shape(frame)->positions,
                  shown_at(baked, baked.samples, layout_of(baked), editing.view_frame())
                      .positions);
    }
    const auto last = film.shape(4); // each call makes another one
    EXPECT_TRUE(std::any_of(last->lines.begin(), last->lines.end(),
                            [](const ShownLine& line) { return line.name == "rope"; }));
}

} // namespace cellwarp::core
