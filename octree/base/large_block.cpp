// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/base/large_block.h"

#include <cstdlib>

#include <sys/mman.h>

namespace cellwarp
{

void* allocate_block(std::size_t bytes)
{
    constexpr std::size_t kPage = std::size_t(2) << 20;
    if (bytes < kLargeBlock)
        return std::malloc(bytes > 0 ? bytes : 1);
    const std::size_t whole_pages = bytes / kPage * kPage;
    const std::size_t room = whole_pages == bytes ? bytes : whole_pages + kPage;
    if (room < bytes)
        return nullptr;
    void* const block = std::aligned_alloc(kPage, room);
    // What is not touched takes no memory: the last, partly used page stays small. The
    // system may refuse, and the block is as good in small pages.
    if (block != nullptr)
        (void)::madvise(block, whole_pages, MADV_HUGEPAGE);
    return block;
}

} // namespace cellwarp
