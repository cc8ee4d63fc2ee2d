// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/allocations.h"

#include <atomic>
#include <cstdlib>
#include <new>

namespace
{

std::atomic<std::size_t> count{0};

void* counted(void* memory)
{
    ++count;
    if (!memory)
        throw std::bad_alloc();
    return memory;
}

} // namespace

// The array, nothrow and sized forms of the library call these.
void* operator new(std::size_t size)
{
    return counted(std::malloc(size ? size : 1));
}
void* operator new(std::size_t size, std::align_val_t alignment)
{
    const std::size_t unit = static_cast<std::size_t>(alignment);
    return counted(std::aligned_alloc(unit, (size + unit - 1) / unit * unit));
}
void operator delete(void* memory) noexcept
{
    std::free(memory);
}
void operator delete(void* memory, std::size_t) noexcept
{
    std::free(memory);
}
void operator delete(void* memory, std::align_val_t) noexcept
{
    std::free(memory);
}
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept
{
    std::free(memory);
}

namespace cellwarp::support
{

std::size_t num_allocations()
{
    return count;
}

} // namespace cellwarp::support
