// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/process/memory_guard.h"

#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <new>

#include <unistd.h>

#ifdef __GLIBC__
#include <malloc.h>
#endif

#include "editor/process/exact_numbers.h"
#include "io/base/bytes.h"
#include "io/base/error.h"
#include "solver/linear/dense_kernels.h"

namespace cellwarp::core
{

namespace
{

/// At first the C library takes every block of more than 128 kB from the system and gives
/// it back as soon as it is freed. The system clears its pages anew each time, which is a
/// thirtieth of a small edit. Larger blocks still begin as pages that nobody has written,
/// which arrays of voxels count on (voxel_values.h).
constexpr int kReusedBlock = 8 << 20; ///< smaller blocks come from what was freed [byte]
constexpr int kKeptFree = 64 << 20;   ///< of what is freed at the end of the heap [byte]
constexpr int kTakenAtOnce = 1 << 20; ///< more than asked for, when it grows [byte]

void reuse_freed_memory()
{
#ifdef __GLIBC__
    ::mallopt(M_MMAP_THRESHOLD, kReusedBlock);
    ::mallopt(M_TRIM_THRESHOLD, kKeptFree);
    ::mallopt(M_TOP_PAD, kTakenAtOnce);
#endif
}

/// Takes no memory.
[[noreturn]] void end_without_memory() noexcept
{
    write_all(2, "error: out of memory\n");
    remove_unfinished_outputs();
    ::_exit(static_cast<int>(Fault::Budget));
}

/// Our own threads and tasks carry what they throw home. Libraries may lack the memory
/// even for that.
[[noreturn]] void end_at_terminate() noexcept
{
    try
    {
        if (const std::exception_ptr error = std::current_exception())
            std::rethrow_exception(error);
    }
    catch (const std::bad_alloc&)
    {
        end_without_memory();
    }
    catch (...)
    {
    }
    std::abort();
}

/// Between the beginning and the end of main().
std::atomic<bool> is_running{false};

void end_at_exit() noexcept
{
    if (is_running)
        end_without_memory();
}

} // namespace

MemoryGuard::MemoryGuard(LibraryExit library_exit)
{
    reuse_freed_memory();
    let_exact_numbers_throw();
    std::set_terminate(end_at_terminate);
    if (library_exit == LibraryExit::NoMemory)
        std::atexit(end_at_exit);
}

int MemoryGuard::main(int (*run)(int, char**), int argc, char** argv) const
{
    is_running = true;
    end_dense_threads();
    try
    {
        const int exit_code = run(argc, argv);
        is_running = false;
        if (exit_code != static_cast<int>(Fault::Budget))
            return exit_code;
        // Where there is no memory a regular end hangs: the dense kernels wait for their
        // threads, and these wait for memory for ever.
        std::fflush(nullptr);
        ::_exit(exit_code);
    }
    catch (const std::bad_alloc&)
    {
        end_without_memory();
    }
}

} // namespace cellwarp::core
