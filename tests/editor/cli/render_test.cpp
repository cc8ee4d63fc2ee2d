// SPDX-License-Identifier: GPL-3.0-or-later
// What the subcommand render refuses. The pictures have their own tests.
#include <filesystem>

#include <gtest/gtest.h>

#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::BarFiles;
using support::contains;
using support::Result;
using support::run;

namespace
{

/// Renders the bar with these flags; expects a usage error and no picture.
std::string refused(const BarFiles& files, const std::vector<std::string>& flags,
                    const std::string& picture = "out.png")
{
    std::vector<std::string> arguments = {"render", files.model, "-o",
                                          files.folder / picture};
    arguments.insert(arguments.end(), flags.begin(), flags.end());
    const Result result = run(arguments);
    EXPECT_EQ(result.code, 2) << result.err;
    EXPECT_EQ(support::num_files(files.folder), 2u);
    return result.err;
}

} // namespace

TEST(Render, a_size_is_width_and_height_up_to_8192)
{
    const BarFiles files;
    for (const std::string size :
         {"100", "x", "100x", "x100", "0x100", "100x-1", "8193x1", "1x8193", "1.5x2"})
        EXPECT_TRUE(contains(refused(files, {"--size", size}),
                             "error: --size: got '" + size +
                                 "', need WIDTHxHEIGHT up to 8192x8192"))
            << size;
}

TEST(Render, the_focus_is_a_region)
{
    const BarFiles files;
    EXPECT_TRUE(contains(
        refused(files, {"--handles", files.handles, "--across", "8", "--focus", "nose"}),
        "error: --focus: there is no region 'nose'"));
    EXPECT_TRUE(contains(refused(files, {"--focus", "nose"}),
                         "error: --focus needs a region: of a scene, --handles, --fix or "
                         "--handle"));
}

TEST(Render, a_frame_is_one_of_the_handle_files)
{
    const BarFiles files;
    const auto at_frame = [&](const std::string& frame)
    {
        return refused(files,
                       {"--handles", files.handles, "--across", "8", "--frame", frame});
    };
    EXPECT_TRUE(contains(at_frame("first"),
                         "error: --frame: got 'first', need rest, last or a number"));
    EXPECT_TRUE(
        contains(at_frame("5"), "error: --frame: the handle file has no frame 5"));
    EXPECT_TRUE(contains(refused(files, {"--frame", "last"}),
                         "error: --frame needs a scene or --handles"));
}

TEST(Render, a_strip_has_every_frame_that_it_is_asked_for)
{
    const BarFiles files;
    const std::vector<std::string> session = {"render",      files.model, "--handles",
                                              files.handles, "--across",  "8",
                                              "--size",      "40x30"};
    const auto width_of =
        [&](std::vector<std::string> arguments, const std::vector<std::string>& flags)
    {
        const std::string png = files.folder / "strip.png";
        arguments.insert(arguments.end(), {"-o", png, "--overwrite"});
        arguments.insert(arguments.end(), flags.begin(), flags.end());
        const Result result = run(arguments);
        EXPECT_EQ(result.code, 0) << result.err;
        const std::string bytes = support::bytes_of(png);
        return bytes.size() < 20 ? 0
                                 : static_cast<unsigned char>(bytes[18]) * 256 +
                                       static_cast<unsigned char>(bytes[19]);
    };
    // At rest, and the frames of the handle file.
    const int one = width_of(session, {}), all = width_of(session, {"--strip"});
    EXPECT_EQ(one, 40);
    EXPECT_GT(all, one);
    EXPECT_EQ(all % 40, 0);
    EXPECT_EQ(width_of(session, {"--strip=2"}), 80);
    EXPECT_EQ(width_of(session, {"--strip=1"}), 40);
    std::filesystem::remove(files.folder / "strip.png");
    EXPECT_TRUE(contains(refused(files, {"--strip"}), "--strip needs a scene"));
    EXPECT_TRUE(contains(refused(files, {"--strip", "--frame", "last"}),
                         "--strip and --frame: one of them"));
    EXPECT_EQ(
        run({"render", files.model, "--strip=0", "-o", files.folder / "x.png"}).code, 2);
}

TEST(Render, a_picture_is_a_png)
{
    const BarFiles files;
    EXPECT_TRUE(contains(refused(files, {}, "out.jpg"), "out.jpg: a picture is a .png"));
}

TEST(Render, a_path_that_leads_nowhere_is_a_file_error)
{
    const BarFiles files;
    const std::string loop = files.folder / "loop.obj", png = files.folder / "loop.png";
    std::filesystem::create_symlink("loop.obj", loop);
    std::filesystem::create_symlink("loop.png", png);
    const std::string out = files.folder / "out.png";
    const std::string far = files.folder / (std::string(300, 'n') + ".obj");
    for (const std::vector<std::string>& arguments :
         std::vector<std::vector<std::string>>{
             {"render", loop, "-o", out},
             {"render", far, "-o", out},
             {"render", files.model, "-o", png},
             {"render", files.model, "-o", far},
             {"render", files.model, "--compare", loop, "-o", out}})
    {
        const Result result = run(arguments);
        EXPECT_EQ(result.code, 4) << result.err;
        EXPECT_TRUE(contains(result.err, "Too many levels") ||
                    contains(result.err, "too long"))
            << result.err;
    }
    EXPECT_FALSE(std::filesystem::exists(out));
}

} // namespace cellwarp::core
