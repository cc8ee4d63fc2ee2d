// SPDX-License-Identifier: GPL-3.0-or-later
// LZF unpacked piece by piece. A decoder that wants both sides whole in memory, as the
// libraries' do, is no use for a scan that is larger than the memory; only the last 8 KB
// of what was made can be referred to.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace cellwarp::core
{

class LzfUnpacker
{
public:
    /// \p size: what all pieces together must make [bytes].
    explicit LzfUnpacker(std::uint64_t size) : size_(size) {}

    /// Puts what the next piece of the packed data makes in place of \p out. False if no
    /// data that make this size go on like that.
    bool take(std::string_view packed, std::string& out);
    /// Whether the pieces made all of it and none is cut.
    bool is_complete() const { return num_made_ == size_ && rest_.empty(); }

private:
    std::uint64_t size_, num_made_ = 0;
    std::string rest_;   ///< begins an instruction whose end has not come yet
    std::string before_; ///< the last bytes that were made
};

} // namespace cellwarp::core
