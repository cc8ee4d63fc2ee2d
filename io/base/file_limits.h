// SPDX-License-Identifier: GPL-3.0-or-later
// Most that a file may claim before it is taken for malformed.
#pragma once

#include <cstddef>
#include <cstdint>

namespace cellwarp::core
{

inline constexpr std::int64_t kMaxSamples = (std::int64_t(1) << 31) - 1;
inline constexpr std::int64_t kMaxCorners = 1000000; ///< of one face
inline constexpr std::size_t kMaxHeaderBytes = std::size_t(1) << 20;
inline constexpr int kMaxNesting = 128; ///< of JSON

/// Of lengths, times, moduli and the like in scenes.
inline constexpr double kTiny = 1e-30, kHuge = 1e30;

} // namespace cellwarp::core
