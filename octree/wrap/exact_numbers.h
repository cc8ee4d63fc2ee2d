// SPDX-License-Identifier: GPL-3.0-or-later
// CGAL's exact numbers are those of GMP, which ends the process where memory ends. Where
// this is included it throws std::bad_alloc instead, as all else does. The exception
// passes through GMP's functions, which are C: they have tables to be unwound by, as all
// has on the machines that this is built for, and what they held is not given back.
#pragma once

#include <cstdlib>
#include <new>

#include <gmp.h>

namespace cellwarp::core
{

namespace exact_numbers
{

inline void* allocated(void* memory)
{
    if (memory == nullptr)
        throw std::bad_alloc();
    return memory;
}

inline void* allocate(std::size_t bytes)
{
    return allocated(std::malloc(bytes));
}

inline void* reallocate(void* memory, std::size_t, std::size_t bytes)
{
    return allocated(std::realloc(memory, bytes));
}

inline void release(void* memory, std::size_t)
{
    std::free(memory);
}

inline bool throw_without_memory()
{
    ::mp_set_memory_functions(allocate, reallocate, release);
    return true;
}

/// Before main(), so before the first number.
inline const bool do_throw = throw_without_memory();

} // namespace exact_numbers

} // namespace cellwarp::core
