// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/base/large_pages.h"

#include <cstdint>

#include <sys/mman.h>
#include <unistd.h>

namespace cellwarp::core
{

void prefer_large_pages(void* begin, std::size_t bytes)
{
    constexpr std::size_t kLeast = std::size_t(8) << 20;
    if (bytes < kLeast)
        return;
    const auto page = static_cast<std::uintptr_t>(::sysconf(_SC_PAGESIZE));
    const auto first = reinterpret_cast<std::uintptr_t>(begin);
    const std::uintptr_t start = (first + page - 1) / page * page;
    // Without large pages it fails, and all is as before.
    ::madvise(reinterpret_cast<void*>(start), first + bytes - start, MADV_HUGEPAGE);
}

} // namespace cellwarp::core
