// SPDX-License-Identifier: GPL-3.0-or-later
// Models of formats that are only read, on the command line.
#include "io/import/import.h"

#include <filesystem>

#include <Eigen/Core>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "io/formats/geometry_file.h"
#include "tests/support/collada.h"
#include "tests/support/files.h"
#include "tests/support/process.h"
#include "tests/support/program.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::collada;
using support::contains;
using support::Result;
using support::run;

TEST(ImportCli, runs_the_program_beside_this_one_and_says_where_there_is_none)
{
    const support::Folder folder;
    const std::string program = folder / "cellwarp";
    std::filesystem::copy_file(CELLWARP_BINARY, program);
    const std::string model = folder.write("x.dae", collada());
    const Result without = support::run_program(program, {"info", model});
    EXPECT_EQ(without.code, 4);
    EXPECT_TRUE(contains(without.err, model +
                                          ": cannot start cellwarp-import, looked for "
                                          "in " +
                                          folder.path().string()))
        << without.err;
    EXPECT_EQ(support::run_program(program, {"info", model},
                                   []
                                   {
                                       const std::filesystem::path built(CELLWARP_BINARY);
                                       ::setenv("CELLWARP_HELPERS",
                                                built.parent_path().c_str(), 1);
                                   })
                  .code,
              0);
    const auto importer = [&](const std::string& script)
    {
        std::filesystem::permissions(
            folder.write("cellwarp-import", "#!/bin/sh\n" + script),
            std::filesystem::perms::owner_all);
        return support::run_program(program, {"info", model});
    };
    const Result crashed = importer("kill -SEGV $$\n");
    EXPECT_EQ(crashed.code, 3);
    EXPECT_TRUE(contains(crashed.err, "ended with signal 11")) << crashed.err;
    const Result cut = importer("printf 'short'\n");
    EXPECT_EQ(cut.code, 3);
    EXPECT_TRUE(contains(cut.err, "ended early")) << cut.err;
}

TEST(ImportCli, a_deformation_of_it_becomes_a_plain_mesh)
{
    const support::Folder folder;
    const std::string model = folder.write("x.dae", collada());
    const nlohmann::json info = nlohmann::json::parse(run({"info", "--json", model}).out);
    EXPECT_EQ(info["format"], "dae");
    EXPECT_EQ(info["triangles"], 8);
    EXPECT_EQ(info["writable"], false);
    const std::string handles =
        folder.write("x.handles", "cellwarp-handles 1\nhandle all all\nframe 1\n"
                                  "move all translate 1 2 3\n");
    for (const char* out : {"y.obj", "y.ply"})
    {
        const Result result =
            run({"deform", model, "--handles", handles, "-o", folder / out});
        EXPECT_EQ(result.code, 0) << result.err;
        EXPECT_TRUE(contains(result.err, "vertices may be split"));
        const Geometry geometry = read_geometry(folder / out).geometry;
        EXPECT_EQ(geometry.samples.size(), 8u);
        const Geometry before = import_geometry("x.dae", collada());
        for (std::size_t i = 0; i < 8; ++i)
            EXPECT_LT((geometry.samples[i] - before.samples[i] - Eigen::Vector3d(1, 2, 3))
                          .norm(),
                      1e-12);
    }
    EXPECT_EQ(run({"deform", model, "-o", folder / "y.dae"}).code, 2);
    EXPECT_EQ(run({"deform", model, "-o", folder / "y.stl"}).code, 2);
    EXPECT_EQ(run({"deform", model, "-o", "-"}).code, 2);
    EXPECT_EQ(run({"info", folder.write("bad.fbx", "Kaydara FBX")}).code, 3);
    EXPECT_EQ(run({"info", folder / "none.fbx"}).code, 4);
}

} // namespace cellwarp::core
