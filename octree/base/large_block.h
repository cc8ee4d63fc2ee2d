// SPDX-License-Identifier: GPL-3.0-or-later
// Memory for large arrays. The system hands it out in pages when they are first touched,
// and for a million vertices that takes a tenth of a run with pages of 4 kB.
#pragma once

#include <cstddef>

namespace cellwarp
{

/// As std::malloc(), to be freed by std::free(). Blocks of kLargeBlock bytes and more are
/// in pages of 2 MB where the system has such.
void* block_of(std::size_t bytes);

inline constexpr std::size_t kLargeBlock = std::size_t(16) << 20;

} // namespace cellwarp
