// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

namespace cellwarp::core::support
{

/// Whether this is a sanitizer's build: it takes terabytes of address space, keeps memory
/// that was given back, and is several times slower.
#ifdef CELLWARP_SANITIZED
inline constexpr bool kIsSanitized = true;
#else
inline constexpr bool kIsSanitized = false;
#endif

} // namespace cellwarp::core::support
