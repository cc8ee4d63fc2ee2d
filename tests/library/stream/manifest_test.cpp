// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/stream/manifest.h"

#include <filesystem>
#include <tuple>

#include <sys/stat.h>

#include <gtest/gtest.h>

#include "io/base/bytes.h"
#include "tests/support/failing_calls.h"
#include "tests/support/files.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::bytes_of;
using support::contains;
using support::error_of;
using support::Folder;
using support::with_each_call_failing;

TEST(Manifest, on_a_disk_that_fails_keeps_the_lines_that_it_has)
{
    const Folder folder;
    const std::string path = folder / "manifest.tsv";
    std::string old;
    {
        Manifest manifest(path);
        manifest.add({"one", "done", 1, 0.0, 2, {3, 4, "f"}, ""});
        old = bytes_of(path);
    }
    const int errors = with_each_call_failing(
        [&] { folder.write("manifest.tsv", old + "a torn li"); },
        [&]
        {
            Manifest manifest(path);
            manifest.add({"two", "done", 1, 0.0, 2, {3, 4, "f"}, ""});
        },
        [&](bool is_done)
        {
            EXPECT_TRUE(bytes_of(path).starts_with(old));
            const Manifest again(path);
            EXPECT_TRUE(again.find("one"));
            if (is_done)
            {
                EXPECT_TRUE(again.find("two"));
            }
        });
    EXPECT_GE(errors, 8);
    const int without =
        with_each_call_failing([&] { std::filesystem::remove(path); },
                               [&] { Manifest manifest(path); }, [](bool) {});
    EXPECT_GE(without, 3);
}

TEST(Manifest, writes_into_nothing_that_is_no_manifest)
{
    const Folder folder;
    const std::string path = folder / "cellwarp-manifest.tsv";
    const std::string precious = "precious line 1\nprecious unfinished line";
    const auto refused = [&](const std::string& why)
    {
        const std::string said = error_of(Fault::File, [&] { Manifest manifest(path); });
        EXPECT_TRUE(contains(said, why)) << said;
    };
    for (const std::string& text :
         {precious, std::string("#"), std::string("# my notes"),
          std::string("#cellwarp-manifesto\n"), std::string("#cellwarp-manifest"),
          std::string("#cellwarp-manifest 1 notes\nx"),
          std::string("#cellwarp-manifest 1\nx"), std::string("\n"),
          std::string(1, '\0')})
    {
        folder.write("cellwarp-manifest.tsv", text);
        // The beginning of the first line, left by a kill, is a manifest.
        if (text == "#" || text == "#cellwarp-manifest")
            EXPECT_NO_THROW(Manifest{path});
        else
        {
            refused("does not begin with #cellwarp-manifest 1");
            EXPECT_EQ(bytes_of(path), text);
        }
    }
    // Only the beginning of a large file is read if it is no manifest; a sparse one takes
    // no room.
    for (const auto& [beginning, size, why] :
         {std::tuple("my notes", std::uintmax_t(1) << 40, "does not begin with"),
          {"#cellwarp-manifest 1\tstatus", kMaxFileBytes + 1, "is larger than 4 GiB"}})
    {
        folder.write("cellwarp-manifest.tsv", beginning);
        std::filesystem::resize_file(path, size);
        refused(why);
        EXPECT_EQ(std::filesystem::file_size(path), size);
    }
    std::filesystem::remove(path);
    const std::string victim = folder.write("victim.txt", precious);
    std::filesystem::create_symlink("victim.txt", path);
    refused("is a symbolic link");
    EXPECT_EQ(bytes_of(victim), precious);
    std::filesystem::remove(path);
    std::filesystem::create_symlink("nowhere.txt", path);
    refused("is a symbolic link");
    EXPECT_FALSE(std::filesystem::exists(folder / "nowhere.txt"));
    std::filesystem::remove(path);
    ASSERT_EQ(::mkfifo(path.c_str(), 0600), 0);
    refused("is no regular file");
    std::filesystem::remove(path);
    std::filesystem::create_directory(path);
    refused("Is a directory");
}

} // namespace cellwarp::core
