// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <string>

#include <fmt/format.h>

#include "io/base/error.h"
#include "io/base/near_word.h"
#include "io/base/number.h"

namespace cellwarp::core
{

/// "out-{frame:04}.ply": a name for each frame, or one name for the last.
class OutputName
{
public:
    explicit OutputName(const std::string& pattern) : pattern_(pattern)
    {
        const std::size_t open = pattern.find("{frame");
        if (open == std::string::npos)
        {
            refuse_mistyped(pattern);
            return;
        }
        const std::size_t close = pattern.find('}', open);
        const std::string inside =
            close == std::string::npos ? "?" : pattern.substr(open + 6, close - open - 6);
        const bool is_padded = inside.size() == 3 && inside.starts_with(":0") &&
                               inside[2] >= '1' && inside[2] <= '9';
        if (!inside.empty() && !is_padded)
            throw wrong_flag("-o", "got " + in_quotes(pattern) +
                                       ", need {frame} or {frame:04} in it");
        before_ = pattern.substr(0, open);
        after_ = pattern.substr(close + 1);
        width_ = is_padded ? inside[2] - '0' : 1;
        has_frame_ = true;
    }
    bool has_frame() const { return has_frame_; }
    std::string of(std::int64_t frame) const
    {
        return has_frame_ ? fmt::format("{}{:0{}}{}", before_, frame, width_, after_)
                          : pattern_;
    }

private:
    /// Other names with braces are names.
    static void refuse_mistyped(const std::string& pattern)
    {
        const std::size_t open = pattern.find('{'), close = pattern.find('}', open);
        if (close == std::string::npos)
            return;
        const std::string inside = pattern.substr(open + 1, close - open - 1);
        const std::string known[] = {"frame"};
        if (!nearest_word(inside.substr(0, inside.find(':')), known).empty())
            throw wrong_flag("-o", "got " + in_quotes(pattern) +
                                       ": did you mean {frame} by {" + inside + "}?");
    }

    std::string pattern_, before_, after_;
    int width_ = 1;
    bool has_frame_ = false;
};

} // namespace cellwarp::core
