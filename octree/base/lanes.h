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

namespace cellwarp::CELLWARP_LANES_FOR
{

namespace
{

using Lanes = double __attribute__((vector_size(8 * CELLWARP_WIDTH)));

} // namespace

} // namespace cellwarp::CELLWARP_LANES_FOR
