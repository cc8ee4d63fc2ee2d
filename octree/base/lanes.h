// SPDX-License-Identifier: GPL-3.0-or-later
// Numbers side by side, as many as one instruction takes. For files that are compiled
// once for each instruction set, into the namespace CELLWARP_LANES_FOR: all is local to
// the file, for the linker would keep one copy, which not every processor may understand.
#pragma once

#if defined(__AVX512F__)
#define CELLWARP_WIDTH 8
#elif defined(__AVX2__)
#define CELLWARP_WIDTH 4
#else
#define CELLWARP_WIDTH 2
#endif

namespace cellwarp::core::CELLWARP_LANES_FOR
{

namespace
{

using Lanes = double __attribute__((vector_size(8 * CELLWARP_WIDTH)));

// Not every file has a use for all of them.
[[maybe_unused]] inline Lanes load(const double* numbers)
{
    Lanes value;
    __builtin_memcpy(&value, numbers, sizeof value);
    return value;
}

[[maybe_unused]] inline void store(double* numbers, const Lanes& value)
{
    __builtin_memcpy(numbers, &value, sizeof value);
}

[[maybe_unused]] inline Lanes square_root(const Lanes& value)
{
    Lanes root = value;
    for (int l = 0; l < CELLWARP_WIDTH; ++l)
        root[l] = __builtin_sqrt(root[l]);
    return root;
}

[[maybe_unused]] inline Lanes larger(const Lanes& a, const Lanes& b)
{
    return a > b ? a : b;
}

} // namespace

} // namespace cellwarp::core::CELLWARP_LANES_FOR
