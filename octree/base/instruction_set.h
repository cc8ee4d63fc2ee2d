// SPDX-License-Identifier: GPL-3.0-or-later
// Which vector instructions this processor has. Inner loops are compiled for each set
// (cellwarp_lanes in cmake/parts.cmake) and chosen at run time; all of them give the same
// bits.
#pragma once

#include <span>

namespace cellwarp::core
{

enum class InstructionSet
{
    Plain, ///< what every processor of the kind has
    Avx2,
    Avx512
};

/// The ones that this processor has, the widest last.
std::span<const InstructionSet> instruction_sets();

} // namespace cellwarp::core
