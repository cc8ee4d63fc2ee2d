// SPDX-License-Identifier: GPL-3.0-or-later
// bench_scenes FOLDER NAME...: writes benchmark scenes to files, for the program.
// Without names it lists them.
#include <filesystem>

#include <fmt/format.h>

#include "io/base/error.h"
#include "tests/bench/scenes.h"

int main(int argc, char** argv)
{
    using namespace cellwarp::core;
    if (argc < 3)
    {
        fmt::print(stderr, "usage: bench_scenes FOLDER NAME...\nnames:");
        for (const std::string& name : bench::scene_names())
            fmt::print(stderr, " {}", name);
        fmt::print(stderr, "\n");
        return 2;
    }
    try
    {
        std::filesystem::create_directories(argv[1]);
        for (int i = 2; i < argc; ++i)
            bench::write_scene(bench::make_scene(argv[i]), argv[1]);
    }
    catch (const std::exception& error)
    {
        fmt::print(stderr, "error: {}\n", error.what());
        return 1;
    }
}
