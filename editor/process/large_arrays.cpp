// SPDX-License-Identifier: GPL-3.0-or-later
// operator new of a program: large arrays come from large_heap, all else from the C
// library. A sanitizer has its own.
#include <algorithm>
#include <cstdlib>
#include <new>

#include "library/session/large_heap.h"

#ifndef CELLWARP_SANITIZED

namespace
{

using cellwarp::core::large_heap;
using cellwarp::core::LargeHeap;

void* taken(std::size_t bytes, std::size_t alignment)
{
    for (;;)
    {
        void* memory = nullptr;
        if (bytes >= LargeHeap::kSmallest)
            memory = large_heap.take(bytes);
        if (!memory && alignment <= __STDCPP_DEFAULT_NEW_ALIGNMENT__)
            memory = std::malloc(std::max<std::size_t>(bytes, 1));
        else if (!memory && ::posix_memalign(&memory, alignment, bytes) != 0)
            memory = nullptr;
        if (memory)
            return memory;
        const std::new_handler handler = std::get_new_handler();
        if (!handler)
            throw std::bad_alloc();
        handler();
    }
}

void give_back(void* memory) noexcept
{
    if (!large_heap.give_back(memory))
        std::free(memory);
}

} // namespace

void* operator new(std::size_t bytes)
{
    return taken(bytes, 0);
}

void* operator new(std::size_t bytes, std::align_val_t alignment)
{
    return taken(bytes, static_cast<std::size_t>(alignment));
}

void operator delete(void* memory) noexcept
{
    give_back(memory);
}

void operator delete(void* memory, std::size_t) noexcept
{
    give_back(memory);
}

void operator delete(void* memory, std::align_val_t) noexcept
{
    give_back(memory);
}

void operator delete(void* memory, std::size_t, std::align_val_t) noexcept
{
    give_back(memory);
}

#endif
