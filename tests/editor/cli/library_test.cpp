// SPDX-License-Identifier: GPL-3.0-or-later
// The rooms as libraries: samples/library/bend.cpp, which docs/library.md explains.
#include <gtest/gtest.h>

#include "io/base/error.h"
#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;

TEST(Library, a_program_of_ten_lines_bends_as_the_command_line_does)
{
    const support::Folder folder;
    const std::string model = support::samples_folder() + "/bar.obj";
    const support::Result own =
        support::run_program(CELLWARP_BEND_BINARY, {model, folder / "own.obj"});
    ASSERT_EQ(own.code, 0) << own.err;
    EXPECT_EQ(own.out + own.err, "");
    ASSERT_EQ(
        support::run({"deform", model, "--relative", "--fix", "box 0 0 0 1 1 0.1",
                      "--handle", "head box 0 0 0.9 1 1 1", "--move",
                      "head rotate 1 0 0 45 about border", "-o", folder / "told.obj"})
            .code,
        0);
    EXPECT_TRUE(support::bytes_of(folder / "own.obj") ==
                support::bytes_of(folder / "told.obj"));
    const support::Result missing =
        support::run_program(CELLWARP_BEND_BINARY, {folder / "none.obj", "o.obj"});
    EXPECT_EQ(missing.code, static_cast<int>(Fault::File));
    EXPECT_TRUE(contains(missing.err, "none.obj")) << missing.err;
}

TEST(Library, leaves_what_a_program_has_set_for_its_process_and_gives_the_same_bits)
{
    const support::Folder folder;
    const std::string model = support::samples_folder() + "/bar.obj";
    const support::Result host =
        support::run_program(CELLWARP_HOST_BINARY, {model, folder / "host.obj"});
    EXPECT_EQ(host.code, 0) << host.err;
    ASSERT_EQ(
        support::run_program(CELLWARP_BEND_BINARY, {model, folder / "bend.obj"}).code, 0);
    EXPECT_TRUE(support::bytes_of(folder / "host.obj") ==
                support::bytes_of(folder / "bend.obj"));
}

} // namespace cellwarp::core
