// SPDX-License-Identifier: GPL-3.0-or-later
// LZF, the compression of PCD files, by liblzf: runs of literal bytes, and references to
// what stands at most 8 KB before.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

namespace cellwarp::core
{

/// The most that one compressed byte can stand for [bytes]: a reference of 3 bytes
/// repeats at most 264.
inline constexpr std::size_t kMaxLzfRatio = 88;

/// \p packed as the \p size bytes that it must make; nothing where it does not.
/// \pre both below 4 GB
std::optional<std::string> lzf_unpacked(std::string_view packed, std::size_t size);

/// \p bytes compressed: the same for the same bytes, always. Nothing where that takes
/// 4 GB or more. \pre below 4 GB
std::optional<std::string> lzf_packed(std::string_view bytes);

} // namespace cellwarp::core
