// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/apply/manifest.h"

#include <filesystem>

#include <gtest/gtest.h>

#include "tests/support/failing_calls.h"
#include "tests/support/shapes.h"

namespace cellwarp
{

using support::bytes_of;
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

} // namespace cellwarp
