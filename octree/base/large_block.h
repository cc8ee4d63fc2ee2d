// SPDX-License-Identifier: GPL-3.0-or-later
// Memory for large arrays. The system hands it out in pages when they are first touched,
// and for a million vertices that takes a tenth of a run with pages of 4 kB.
#pragma once

#include <cstddef>

namespace cellwarp
{

/// From so many bytes on pages of 2 MB are worth what is lost at the ends of a block.
inline constexpr std::size_t kLargeBlock = std::size_t(16) << 20;

/// As std::malloc(), to be freed by std::free(). Large blocks are in pages of 2 MB where
/// the system has such.
void* allocate_block(std::size_t bytes);

} // namespace cellwarp
