// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/base/relative_name.h"

#include <filesystem>

#include <gtest/gtest.h>

#include "tests/support/files.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

TEST(RelativeName, a_name_leads_from_the_folder_of_the_file)
{
    EXPECT_EQ(resolved_name("dir/s.json", "a.obj"), "dir/a.obj");
    EXPECT_EQ(resolved_name("s.json", "a.obj"), "a.obj");
    EXPECT_EQ(resolved_name("dir/s.json", "/a.obj"), "/a.obj");
}

TEST(RelativeName, a_name_is_found_again_as_it_was_spelled)
{
    for (const std::string file : {"s.json", "dir/s.json", "/a/b/s.json", "/s.json"})
        for (const std::string name :
             {"a.obj", "deep/a.obj", "../a.obj", "a b#\"c.obj", "..", ""})
            EXPECT_EQ(relative_name(file, resolved_name(file, name)), name) << file;
}

TEST(RelativeName, other_folders_are_named_from_where_they_part)
{
    const support::Folder folder;
    std::filesystem::create_directories(folder / "scenes/mine");
    std::filesystem::create_directories(folder / "models");
    const std::string model = folder.write("models/a.obj", "model");
    const std::string scene = folder / "scenes/mine/s.json";
    EXPECT_EQ(relative_name(scene, model), "../../models/a.obj");
    EXPECT_EQ(relative_name(folder / "models/s.json", model), "a.obj");
    EXPECT_EQ(relative_name(folder / "s.json", model), "models/a.obj");
    // Nothing in common: absolute.
    EXPECT_EQ(relative_name("/x/y/s.json", "/z/a.obj"), "/z/a.obj");
    // From the working folder.
    const std::string here = std::filesystem::current_path().string();
    EXPECT_EQ(relative_name("s.json", here + "/a.obj"), "a.obj");
    EXPECT_EQ(relative_name(here + "/s.json", "a.obj"), "a.obj");
}

TEST(RelativeName, links_of_folders_are_followed_and_links_of_files_kept)
{
    const support::Folder folder;
    std::filesystem::create_directories(folder / "store/deep/scenes");
    std::filesystem::create_directories(folder / "models");
    folder.write("models/v3.obj", "model");
    std::filesystem::create_symlink("v3.obj", folder / "models/a.obj");
    std::filesystem::create_symlink(folder / "store/deep/scenes", folder / "scenes");
    const std::string scene = folder / "scenes/s.json";
    const std::string name = relative_name(scene, folder / "models/a.obj");
    EXPECT_EQ(name, "../../../models/a.obj");
    EXPECT_EQ(support::bytes_of(resolved_name(scene, name)), "model");
}

TEST(RelativeName, a_working_folder_that_has_gone_is_told)
{
    const std::filesystem::path before = std::filesystem::current_path();
    {
        const support::Folder folder;
        std::filesystem::current_path(folder.path());
    }
    const std::string text =
        support::error_of(Fault::File, [] { relative_name("s.json", "/a.obj"); });
    std::filesystem::current_path(before);
    EXPECT_TRUE(support::contains(text, "cannot find its folder"));
}

} // namespace cellwarp::core
