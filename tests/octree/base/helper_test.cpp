// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/base/helper.h"

#include <cstdlib>
#include <filesystem>
#include <system_error>

#include <gtest/gtest.h>

#include "tests/support/files.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;

namespace
{

/// A folder of helpers that the environment names while it lives.
struct Helpers
{
    support::Folder folder;

    Helpers() { ::setenv("CELLWARP_HELPERS", folder.path().c_str(), 1); }
    ~Helpers() { ::unsetenv("CELLWARP_HELPERS"); }
    void add(const std::string& name, const std::string& script) const
    {
        std::filesystem::permissions(folder.write(name, "#!/bin/sh\n" + script),
                                     std::filesystem::perms::owner_all);
    }
};

std::string error_without(const std::string& name)
{
    try
    {
        run_helper(name, {}, "");
    }
    catch (const std::system_error& error)
    {
        EXPECT_EQ(error.code(), std::errc::no_such_file_or_directory);
        return error.what();
    }
    return "";
}

} // namespace

TEST(Helper, gets_its_input_and_arguments_and_nothing_of_the_environment)
{
    const Helpers helpers;
    helpers.add("cellwarp-echo", "cat; echo \"$1 $2 $CELLWARP_HELPERS\"; exit 7\n");
    const HelperEnd end = run_helper("cellwarp-echo", {"a b", "c"}, "input\n");
    EXPECT_EQ(end.code, 7);
    EXPECT_EQ(end.signal, 0);
    EXPECT_EQ(end.out, "input\na b c \n");
}

TEST(Helper, that_a_signal_ends_is_told_with_it)
{
    const Helpers helpers;
    helpers.add("cellwarp-crash", "kill -SEGV $$\n");
    const HelperEnd end = run_helper("cellwarp-crash", {}, "");
    EXPECT_EQ(end.code, -1);
    EXPECT_EQ(end.signal, SIGSEGV);
}

TEST(Helper, that_is_nowhere_is_told_with_the_folders_looked_at)
{
    const std::string error = error_without("cellwarp-none");
    EXPECT_TRUE(contains(error, "cannot start cellwarp-none, looked for in " +
                                    program_folder() + ", "))
        << error;
    EXPECT_TRUE(contains(error, "/libexec/cellwarp")) << error;
    EXPECT_TRUE(contains(error, "CELLWARP_HELPERS")) << error;
    const Helpers helpers;
    const std::string named = error_without("cellwarp-none");
    EXPECT_TRUE(contains(named, "looked for in " + helpers.folder.path().string() + " ("))
        << named;
}

} // namespace cellwarp::core
