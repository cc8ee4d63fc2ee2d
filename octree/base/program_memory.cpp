// SPDX-License-Identifier: GPL-3.0-or-later
// operator new of the programs: large arrays in large pages. Tests and sanitizers have
// one of their own.
#include <cstdlib>
#include <new>

#include "octree/base/large_block.h"

void* operator new(std::size_t bytes)
{
    for (;;)
    {
        if (void* const block = cellwarp::allocate_block(bytes))
            return block;
        const std::new_handler handler = std::get_new_handler();
        if (handler == nullptr)
            throw std::bad_alloc();
        handler();
    }
}

void operator delete(void* block) noexcept
{
    std::free(block);
}

void operator delete(void* block, std::size_t) noexcept
{
    std::free(block);
}
