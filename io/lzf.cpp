// SPDX-License-Identifier: GPL-3.0-or-later
// A control byte below 32 begins a run of that many literals and one. Any other begins
// a reference: its upper three bits are the length less 2 (7: a byte with more of it
// follows), its lower five bits and the last byte the distance less 1.
#include "io/lzf.h"

#include <algorithm>
#include <cstdint>
#include <vector>

namespace cellwarp
{

namespace
{

constexpr std::size_t kMaxLiterals = 32;
constexpr std::size_t kMaxDistance = std::size_t(1) << 13;
constexpr std::size_t kMinLength = 3, kMaxLength = 264;
constexpr int kHashBits = 16;

std::size_t hash_of(const unsigned char* at)
{
    const std::uint32_t three = static_cast<std::uint32_t>(at[0]) << 16 |
                                static_cast<std::uint32_t>(at[1]) << 8 | at[2];
    return (three * 2654435761u) >> (32 - kHashBits);
}

void append_literals(std::string_view run, std::string& out)
{
    while (!run.empty())
    {
        const std::size_t count = std::min(run.size(), kMaxLiterals);
        out += static_cast<char>(count - 1);
        out += run.substr(0, count);
        run.remove_prefix(count);
    }
}

void append_reference(std::size_t length, std::size_t distance, std::string& out)
{
    const std::size_t high = (distance - 1) >> 8;
    if (length < 9)
        out += static_cast<char>((length - 2) << 5 | high);
    else
    {
        out += static_cast<char>(7 << 5 | high);
        out += static_cast<char>(length - 9);
    }
    out += static_cast<char>((distance - 1) & 255);
}

} // namespace

std::optional<std::string> lzf_unpacked(std::string_view packed, std::size_t size)
{
    std::string out;
    out.reserve(size);
    std::size_t at = 0;
    const auto byte = [&] { return static_cast<unsigned char>(packed[at++]); };
    while (at < packed.size())
    {
        const std::size_t control = byte();
        if (control < kMaxLiterals)
        {
            const std::size_t count = control + 1;
            if (count > packed.size() - at || count > size - out.size())
                return std::nullopt;
            out += packed.substr(at, count);
            at += count;
            continue;
        }
        std::size_t length = (control >> 5) + 2;
        if (packed.size() - at < (length == 9 ? 2 : 1))
            return std::nullopt;
        if (length == 9)
            length += byte();
        const std::size_t distance = ((control & 31) << 8 | byte()) + 1;
        if (distance > out.size() || length > size - out.size())
            return std::nullopt;
        // Byte by byte: what is copied may reach into what it makes.
        for (std::size_t i = 0; i < length; ++i)
            out += out[out.size() - distance];
    }
    if (out.size() != size)
        return std::nullopt;
    return out;
}

std::string lzf_packed(std::string_view bytes)
{
    const unsigned char* data = reinterpret_cast<const unsigned char*>(bytes.data());
    // Where three bytes of this hash stood last, counted from 1; 0: nowhere yet.
    std::vector<std::size_t> last(std::size_t(1) << kHashBits, 0);
    std::string out;
    std::size_t literal = 0; // first byte that is not packed yet
    std::size_t at = 0;
    while (at + kMinLength <= bytes.size())
    {
        std::size_t& slot = last[hash_of(data + at)];
        const std::size_t before = slot;
        slot = at + 1;
        const std::size_t distance = at + 1 - before;
        std::size_t length = 0;
        if (before > 0 && distance <= kMaxDistance)
        {
            const std::size_t most = std::min(kMaxLength, bytes.size() - at);
            while (length < most && data[at + length] == data[at - distance + length])
                ++length;
        }
        if (length < kMinLength)
        {
            ++at;
            continue;
        }
        append_literals(bytes.substr(literal, at - literal), out);
        append_reference(length, distance, out);
        at += length;
        literal = at;
    }
    append_literals(bytes.substr(literal), out);
    return out;
}

} // namespace cellwarp
