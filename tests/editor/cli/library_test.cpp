// SPDX-License-Identifier: GPL-3.0-or-later
// The library in other programs, beside the command line: those of samples/library, which
// docs/library.md explains, and of tests/support.
#include <algorithm>

#include <gtest/gtest.h>

#include "io/base/error.h"
#include "io/base/text.h"
#include "io/formats/geometry_file.h"
#include "io/scene/scene_file.h"
#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;

namespace
{

support::Result run_with_library(const std::string& program,
                                 const std::vector<std::string>& arguments)
{
    return support::run_program(CELLWARP_LIBRARY_PROGRAMS + program, arguments);
}

/// What the sample programs do, as flags.
std::vector<std::string> bend_arguments(const std::string& model)
{
    return {"deform",
            model,
            "--relative",
            "--fix",
            "box 0 0 0 1 1 0.1",
            "--handle",
            "head box 0 0 0.9 1 1 1",
            "--move",
            "head rotate 1 0 0 45 about border"};
}

const std::string bar = support::samples_folder() + "/bar.obj";

} // namespace

TEST(Library, a_program_of_ten_lines_bends_as_the_command_line_does)
{
    const support::Folder folder;
    const support::Result own = run_with_library("bend", {bar, folder / "own.obj"});
    ASSERT_EQ(own.code, 0) << own.err;
    EXPECT_EQ(own.out + own.err, "");
    std::vector<std::string> arguments = bend_arguments(bar);
    arguments.insert(arguments.end(), {"-o", folder / "told.obj"});
    ASSERT_EQ(support::run(arguments).code, 0);
    EXPECT_TRUE(support::bytes_of(folder / "own.obj") ==
                support::bytes_of(folder / "told.obj"));
    const support::Result missing =
        run_with_library("bend", {folder / "none.obj", "o.obj"});
    EXPECT_EQ(missing.code, static_cast<int>(Fault::File));
    EXPECT_TRUE(contains(missing.err, "none.obj")) << missing.err;
}

TEST(Library, a_program_drags_and_solves_where_the_hand_lets_go)
{
    const support::Folder folder;
    const support::Result own = run_with_library("drag", {bar, folder / "own.obj"});
    ASSERT_EQ(own.code, 0) << own.err;
    EXPECT_TRUE(contains(own.out, "60 frames"));
    const Geometry rest = read_geometry(bar).geometry,
                   lifted = read_geometry(folder / "own.obj").geometry;
    double highest = 0.0;
    for (std::size_t i = 0; i < rest.samples.size(); ++i)
        highest = std::max(highest, lifted.samples[i].z() - rest.samples[i].z());
    EXPECT_GT(highest, 1.0);
}

TEST(Library, a_program_takes_a_cloud_along_as_the_command_line_does)
{
    const support::Folder folder;
    std::string text;
    for (int i = 0; i < 25000; ++i)
        text += std::to_string(0.001 * (i % 1000)) + " 0.25 " +
                std::to_string(0.0002 * i) + "\n";
    const std::string points = folder.write("points.xyz", text);
    const support::Result own =
        run_with_library("cloud", {bar, points, folder / "own.xyz"});
    ASSERT_EQ(own.code, 0) << own.err;
    std::vector<std::string> arguments = bend_arguments(bar);
    arguments.insert(arguments.end(),
                     {"-o", folder / "bar.obj", "--save-field", folder / "bar.cwf"});
    ASSERT_EQ(support::run(arguments).code, 0);
    ASSERT_EQ(
        support::run({"apply", folder / "bar.cwf", points, "-o", folder / "told.xyz"})
            .code,
        0);
    const Geometry moved = read_geometry(folder / "own.xyz").geometry,
                   told = read_geometry(folder / "told.xyz").geometry;
    ASSERT_EQ(moved.samples.size(), 25000u);
    EXPECT_TRUE(moved.samples == told.samples);
}

TEST(Library, a_program_lets_a_rope_fall)
{
    const support::Folder folder;
    const support::Result own = run_with_library("rope", {folder / "rope.obj"});
    ASSERT_EQ(own.code, 0) << own.err;
    EXPECT_TRUE(contains(own.out, "1.00 s: its end is at"));
    // It has swung to the other side of its hold.
    double farthest = 0.0;
    for (const Eigen::Vector3d& x : read_geometry(folder / "rope.obj").geometry.samples)
        farthest = std::min(farthest, x.x());
    EXPECT_LT(farthest, -0.5);
}

TEST(Library, leaves_what_a_program_has_set_for_its_process_and_gives_the_same_bits)
{
    const support::Folder folder;
    const support::Result host = run_with_library("host", {bar, folder / "host.obj"});
    EXPECT_EQ(host.code, 0) << host.err;
    ASSERT_EQ(run_with_library("bend", {bar, folder / "bend.obj"}).code, 0);
    EXPECT_TRUE(support::bytes_of(folder / "host.obj") ==
                support::bytes_of(folder / "bend.obj"));
}

class ScenesOfLibrary : public testing::TestWithParam<std::string>
{
};

TEST_P(ScenesOfLibrary, have_the_bits_of_the_command_line)
{
    const support::Folder folder;
    const std::string scene = support::samples_folder() + "/" + GetParam() + ".json";
    const std::string model = read_scene(scene).model;
    const std::string extension = "." + extension_of(model);
    const support::Result told =
        support::run({"deform", scene, "-o", folder / "told" + extension});
    const support::Result own =
        run_with_library("play", {scene, model, folder / "own" + extension});
    EXPECT_EQ(own.code, told.code) << own.err << told.err;
    EXPECT_TRUE(support::bytes_of(folder / "own" + extension) ==
                support::bytes_of(folder / "told" + extension));
}

INSTANTIATE_TEST_SUITE_P(All, ScenesOfLibrary,
                         testing::Values("bar", "arm", "block", "chain", "cloud",
                                         "drawing", "hose", "pull", "reach", "scan",
                                         "soup", "spine", "touch", "tower"),
                         [](const auto& each) { return each.param; });

class TimesOfLibrary : public testing::TestWithParam<std::string>
{
};

TEST_P(TimesOfLibrary, have_the_bits_of_the_command_line)
{
    const support::Folder folder;
    const std::string scene = support::samples_folder() + "/" + GetParam() + ".json";
    const support::Result told =
        support::run({"simulate", scene, "-o", folder / "told.obj"});
    const support::Result own = run_with_library("play", {scene, folder / "own.obj"});
    EXPECT_EQ(own.code, told.code) << own.err << told.err;
    EXPECT_TRUE(support::bytes_of(folder / "own.obj") ==
                support::bytes_of(folder / "told.obj"));
}

INSTANTIATE_TEST_SUITE_P(All, TimesOfLibrary,
                         testing::Values("rods/pendulum", "rods/cantilever", "rods/net",
                                         "rods/hung", "flesh/limb"),
                         [](const auto& each)
                         { return each.param.substr(each.param.find('/') + 1); });

} // namespace cellwarp::core
