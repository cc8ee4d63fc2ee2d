// SPDX-License-Identifier: GPL-3.0-or-later
// A number as it is typed while a region is in the hand.
#pragma once

#include <optional>
#include <string>

namespace cellwarp::core
{

class TypedNumber
{
public:
    /// Digits, the first point or comma; a minus anywhere changes the sign. False: that
    /// is no part of a number, and nothing changed.
    bool put(char character);
    void backspace();
    void clear() { *this = TypedNumber(); }

    bool empty() const { return digits_.empty() && !is_negative_; }
    /// None before there is a digit.
    std::optional<double> value() const;
    std::string text() const { return (is_negative_ ? "-" : "") + digits_; }

private:
    std::string digits_;
    bool is_negative_ = false;
};

} // namespace cellwarp::core
