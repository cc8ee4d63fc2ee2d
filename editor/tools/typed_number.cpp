// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/tools/typed_number.h"

#include <charconv>

namespace cellwarp::core
{

namespace
{

constexpr std::size_t kLongest = 15; ///< digits that a double tells apart

} // namespace

bool TypedNumber::put(char character)
{
    if (character == '-')
    {
        is_negative_ = !is_negative_;
        return true;
    }
    if (character == ',')
        character = '.';
    const bool is_digit = character >= '0' && character <= '9';
    if (!is_digit && (character != '.' || digits_.find('.') != std::string::npos))
        return false;
    if (digits_.size() < kLongest)
        digits_ += character;
    return true;
}

void TypedNumber::backspace()
{
    if (!digits_.empty())
        digits_.pop_back();
    else
        is_negative_ = false;
}

std::optional<double> TypedNumber::value() const
{
    if (digits_.find_first_of("0123456789") == std::string::npos)
        return std::nullopt;
    const std::string number = "0" + digits_; // ".5" is one too
    double value = 0.0;
    std::from_chars(number.data(), number.data() + number.size(), value);
    return is_negative_ ? -value : value;
}

} // namespace cellwarp::core
