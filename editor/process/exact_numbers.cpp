// SPDX-License-Identifier: GPL-3.0-or-later
// The exception passes through GMP's functions, which are C: they have tables to be
// unwound by, as all has on the machines that this is built for, and what they held is
// not given back.
#include "editor/process/exact_numbers.h"

#include <cstdlib>
#include <new>

#include <gmp.h>

namespace cellwarp::core
{

namespace
{

void* allocated(void* memory)
{
    if (memory == nullptr)
        throw std::bad_alloc();
    return memory;
}

void* allocate(std::size_t bytes)
{
    return allocated(std::malloc(bytes));
}

void* reallocate(void* memory, std::size_t, std::size_t bytes)
{
    return allocated(std::realloc(memory, bytes));
}

void release(void* memory, std::size_t)
{
    std::free(memory);
}

} // namespace

void let_exact_numbers_throw()
{
    ::mp_set_memory_functions(allocate, reallocate, release);
}

} // namespace cellwarp::core
