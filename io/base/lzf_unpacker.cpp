// SPDX-License-Identifier: GPL-3.0-or-later
// A control byte below 32 begins a run of that many literals and one. Any other begins
// a reference: its upper three bits are the length less 2 (7: a byte with more of it
// follows), its lower five bits and the last byte the distance less 1.
#include "io/base/lzf_unpacker.h"

#include <utility>

namespace cellwarp::core
{

namespace
{

constexpr std::size_t kMaxDistance = std::size_t(1) << 13;

/// Bytes of the instruction that begins with \p control.
std::size_t instruction_bytes(unsigned char control)
{
    return control < 32 ? std::size_t(control) + 2 : (control >> 5) == 7 ? 3 : 2;
}

} // namespace

bool LzfUnpacker::take(std::string_view packed, std::string& out)
{
    std::string joined;
    if (!rest_.empty())
    {
        joined = std::exchange(rest_, {});
        joined += packed;
        packed = joined;
    }
    out = before_;
    const std::size_t old = before_.size();
    while (!packed.empty())
    {
        const auto byte = [&](std::size_t i)
        { return static_cast<unsigned char>(packed[i]); };
        const std::size_t count = instruction_bytes(byte(0));
        if (packed.size() < count)
        {
            rest_ = packed;
            break;
        }
        const bool is_run = byte(0) < 32;
        const std::size_t length = is_run       ? count - 1
                                   : count == 3 ? std::size_t(byte(1)) + 9
                                                : std::size_t(byte(0) >> 5) + 2;
        if (length > size_ - num_made_)
            return false;
        if (is_run)
            out += packed.substr(1, length);
        else
        {
            const std::size_t distance =
                (std::size_t(byte(0) & 31) << 8 | byte(count - 1)) + 1;
            if (distance > out.size())
                return false;
            // Byte by byte: what is copied may reach into what it makes.
            for (std::size_t i = 0; i < length; ++i)
                out += out[out.size() - distance];
        }
        num_made_ += length;
        packed.remove_prefix(count);
    }
    before_ = out.size() > kMaxDistance ? out.substr(out.size() - kMaxDistance) : out;
    out.erase(0, old);
    return true;
}

} // namespace cellwarp::core
