// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/allocations.h"

#include <atomic>
#include <cstdlib>
#include <new>

#include <malloc.h>

namespace
{

std::atomic<std::size_t> count{0}, in_use{0}, most{0};
constexpr std::size_t kNone = ~std::size_t(0);
std::atomic<std::size_t> failing{kNone}; ///< the one that fails, as counted

/// Counts one more; whether it is to be given.
bool may_take()
{
    return ++count != failing;
}

void* accounted(void* memory)
{
    if (!memory)
        throw std::bad_alloc();
    const std::size_t size = ::malloc_usable_size(memory);
    const std::size_t now = in_use.fetch_add(size) + size;
    std::size_t last = most;
    while (last < now && !most.compare_exchange_weak(last, now))
    {
    }
    return memory;
}

void give_back(void* memory)
{
    if (memory)
        in_use -= ::malloc_usable_size(memory);
    std::free(memory);
}

} // namespace

// The linker sends all calls of malloc and realloc in the program's own code here
// (tests/CMakeLists.txt): those of operator new below, and of Eigen's vectors.
extern "C" void* __real_malloc(std::size_t);
extern "C" void* __real_realloc(void*, std::size_t);
extern "C" void* __wrap_malloc(std::size_t size)
{
    return may_take() ? __real_malloc(size) : nullptr;
}
extern "C" void* __wrap_realloc(void* memory, std::size_t size)
{
    return may_take() ? __real_realloc(memory, size) : nullptr;
}

// The array and sized forms of the library call these; those of a sanitizer do not, of
// which only the nothrow one comes back to a delete of these.
void* operator new(std::size_t size)
{
    return accounted(std::malloc(size ? size : 1));
}
void* operator new(std::size_t size, const std::nothrow_t&) noexcept
{
    try
    {
        return ::operator new(size);
    }
    catch (const std::bad_alloc&)
    {
        return nullptr;
    }
}
void* operator new(std::size_t size, std::align_val_t alignment)
{
    const std::size_t unit = static_cast<std::size_t>(alignment);
    return accounted(
        may_take() ? std::aligned_alloc(unit, (size + unit - 1) / unit * unit) : nullptr);
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

namespace cellwarp::core::support
{

std::size_t num_allocations()
{
    return count;
}

FailingAllocation::FailingAllocation(std::size_t which)
{
    failing = count + which;
}

FailingAllocation::~FailingAllocation()
{
    failing = kNone;
}

bool FailingAllocation::has_failed() const
{
    return count >= failing;
}

MostMemory::MostMemory() : before_(in_use)
{
    most = before_;
}

std::size_t MostMemory::bytes() const
{
    return most - before_;
}

} // namespace cellwarp::core::support
