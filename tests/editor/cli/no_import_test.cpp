// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/import/import.h"

#include <gtest/gtest.h>

#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

TEST(NoImport, says_that_this_build_reads_no_such_file)
{
    const support::Folder folder;
    const support::Result result =
        support::run({"info", folder.write("x.fbx", "Kaydara")});
    EXPECT_EQ(result.code, 2);
    EXPECT_TRUE(support::contains(result.err, "this build reads no .fbx"));
    EXPECT_EQ(support::run({"info", folder.write("x.unheard", "x")}).code, 2);
}

} // namespace cellwarp::core
