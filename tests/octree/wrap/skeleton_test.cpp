// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/wrap/skeleton.h"

#include <cstdlib>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "octree/wrap/skeleton_bytes.h"
#include "tests/support/files.h"
#include "tests/support/process.h"
#include "tests/support/sanitized.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

TEST(SkeletonProgram, without_memory_tells_so_and_writes_nothing)
{
    if (support::kIsSanitized)
        GTEST_SKIP() << "its library must be loaded before all others";
    const support::Folder folder;
    const std::string surface =
        folder.write("surface", bytes_of(support::box_shape({0, 0, 0}, {1, 1, 4}, 3)));
    const auto without = [&](int which)
    {
        return support::run_program(
            CELLWARP_SKELETON_BINARY, {},
            [&]
            {
                ::dup2(::open(surface.c_str(), O_RDONLY | O_CLOEXEC), 0);
                ::setenv("LD_PRELOAD", CELLWARP_FAILING_PROCESS, 1);
                ::setenv("CELLWARP_FAILS", ("malloc " + std::to_string(which)).c_str(),
                         1);
            });
    };
    EXPECT_EQ(without(100'000'000).code, 0);
    // The first two are of the C and C++ libraries, which go on without: room for
    // exceptions, and the buffer of stdin.
    for (int which = 3; which < 5000; which += 1 + which / 4)
    {
        const support::Result result = without(which);
        EXPECT_EQ(result.code, kSkeletonWithoutMemory) << which;
        EXPECT_TRUE(result.out.empty()) << which;
    }
}

} // namespace cellwarp::core
