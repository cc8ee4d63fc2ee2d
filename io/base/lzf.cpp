// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/base/lzf.h"

#include <algorithm>
#include <limits>

#include <lzf.h>

namespace cellwarp::core
{

namespace
{

constexpr std::size_t kMaxBytes = std::numeric_limits<unsigned int>::max();

/// Literals that one control byte can stand before.
constexpr std::size_t kMaxLiterals = 32;
/// What lzf_compress wants to be left, at the most, before it writes.
constexpr std::size_t kSpareBytes = 8;

} // namespace

std::optional<std::string> lzf_unpacked(std::string_view packed, std::size_t size)
{
    // lzf_decompress reads a first byte in any case, and returns 0 for failures.
    if (packed.empty() || size == 0)
        return packed.empty() && size == 0 ? std::optional(std::string()) : std::nullopt;
    std::string out(size, '\0');
    if (lzf_decompress(packed.data(), static_cast<unsigned int>(packed.size()),
                       out.data(), static_cast<unsigned int>(size)) != size)
        return std::nullopt;
    return out;
}

/// lzf_compress leaves its table of places as it finds it on the stack. No output tells:
/// three bytes that came before are in the table, so what was there is never a match.
std::optional<std::string> lzf_packed(std::string_view bytes)
{
    if (bytes.empty())
        return std::string();
    // Literals alone always fit.
    const std::size_t room = bytes.size() + bytes.size() / kMaxLiterals + kSpareBytes;
    std::string out(std::min(room, kMaxBytes), '\0');
    out.resize(lzf_compress(bytes.data(), static_cast<unsigned int>(bytes.size()),
                            out.data(), static_cast<unsigned int>(out.size())));
    if (out.empty())
        return std::nullopt;
    return out;
}

} // namespace cellwarp::core
