// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/process/memory_guard.h"

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <new>
#include <string>

#include <gtest/gtest.h>

#include "io/base/bytes.h"
#include "tests/support/files.h"

namespace cellwarp::core
{

namespace
{

using testing::ExitedWithCode;
using LibraryExit = MemoryGuard::LibraryExit;

std::string output_path;

/// A process of its own that runs this.
template <class Run>
void guarded(LibraryExit library_exit, Run run)
{
    ::exit(MemoryGuard(library_exit).main(run, 0, nullptr));
}

int lacks_memory(int, char**)
{
    AtomicFile unfinished(output_path, Overwrite::No);
    unfinished.write("half");
    throw std::bad_alloc();
}

template <class Problem>
[[noreturn]] void fail(const Problem& problem)
{
    throw problem;
}

int lacks_memory_where_none_may(int, char**)
{
    const auto task = []() noexcept { fail(std::bad_alloc()); };
    task();
    return 0;
}

int exits(int, char**)
{
    ::exit(3);
}

} // namespace

TEST(MemoryGuardDeathTest, ends_a_run_without_memory_by_the_documented_code)
{
    const support::Folder folder;
    output_path = folder / "out.obj";
    EXPECT_EXIT(guarded(LibraryExit::Anything, lacks_memory), ExitedWithCode(5),
                "^error: out of memory\n$");
    EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
    EXPECT_EXIT(guarded(LibraryExit::Anything, lacks_memory_where_none_may),
                ExitedWithCode(5), "^error: out of memory\n$");
}

TEST(MemoryGuardDeathTest, takes_the_exit_of_a_library_for_what_it_means_in_the_program)
{
    EXPECT_EXIT(guarded(LibraryExit::NoMemory, exits), ExitedWithCode(5),
                "out of memory");
    EXPECT_EXIT(guarded(LibraryExit::Anything, exits), ExitedWithCode(3), "^$");
}

TEST(MemoryGuardDeathTest, leaves_every_other_end_as_it_is)
{
    for (const LibraryExit library_exit : {LibraryExit::NoMemory, LibraryExit::Anything})
    {
        EXPECT_EXIT(guarded(library_exit, [](int, char**) { return 0; }),
                    ExitedWithCode(0), "^$");
        EXPECT_EXIT(guarded(library_exit, [](int, char**) { return 7; }),
                    ExitedWithCode(7), "^$");
        EXPECT_EXIT(guarded(library_exit,
                            [](int, char**) -> int
                            {
                                const auto task = []() noexcept { fail(1); };
                                task();
                                return 0;
                            }),
                    testing::KilledBySignal(SIGABRT), "^$");
    }
}

} // namespace cellwarp::core
