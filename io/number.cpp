// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/number.h"

#include <charconv>
#include <cmath>
#include <limits>

namespace cellwarp
{

namespace
{

/// from_chars reports overflow and underflow alike. A number below the smallest
/// double has a negative exponent or, without one, starts with zeros.
bool is_underflow(std::string_view token)
{
    const std::size_t e = token.find_first_of("eE");
    if (e != std::string_view::npos)
        return e + 1 < token.size() && token[e + 1] == '-';
    const std::size_t digit = token.find_first_not_of("+-");
    return digit != std::string_view::npos &&
           (token[digit] == '0' || token[digit] == '.');
}

} // namespace

std::optional<double> parse_double(std::string_view token)
{
    if (token.size() > 1 && token[0] == '+' && token[1] != '-' && token[1] != '+')
        token.remove_prefix(1);
    double value = 0.0;
    const char* end = token.data() + token.size();
    const std::from_chars_result result = std::from_chars(token.data(), end, value);
    if (result.ptr != end || token.empty())
        return std::nullopt;
    if (result.ec == std::errc::result_out_of_range)
    {
        const double sign = token[0] == '-' ? -1.0 : 1.0;
        return is_underflow(token) ? sign * 0.0
                                   : sign * std::numeric_limits<double>::infinity();
    }
    if (result.ec != std::errc())
        return std::nullopt;
    return value;
}

std::optional<std::int64_t> parse_integer(std::string_view token)
{
    constexpr std::size_t kSurelyFits = 18; // digits
    std::int64_t value = 0;
    if (!token.empty() && token.size() <= kSurelyFits)
    {
        // Most are short and plain: the library's way takes three times as long.
        std::size_t i = 0;
        for (; i < token.size() && token[i] >= '0' && token[i] <= '9'; ++i)
            value = 10 * value + (token[i] - '0');
        if (i == token.size())
            return value;
        value = 0;
    }
    if (token.size() > 1 && token[0] == '+' && token[1] != '-')
        token.remove_prefix(1);
    const char* end = token.data() + token.size();
    const std::from_chars_result result = std::from_chars(token.data(), end, value);
    if (result.ec != std::errc() || result.ptr != end)
        return std::nullopt;
    return value;
}

std::string shortest(double value)
{
    std::string text;
    append_shortest(value, text);
    return text;
}

void append_shortest(double value, std::string& out)
{
    char buffer[64];
    const std::to_chars_result end = std::to_chars(buffer, buffer + sizeof buffer, value);
    out.append(buffer, end.ptr);
}

std::string in_quotes(std::string_view token)
{
    std::string text = "'";
    for (const char c : token.substr(0, 40))
        text += static_cast<unsigned char>(c) < 32 || c == 127 ? '?' : c;
    return text + (token.size() > 40 ? "...'" : "'");
}

std::string in_bytes(double bytes)
{
    const bool is_giga = bytes >= 1e9;
    const double tenths = std::round(bytes / (is_giga ? 1e8 : 1e5));
    return shortest(is_giga || tenths < 100 ? tenths / 10 : std::round(tenths / 10)) +
           (is_giga ? " GB" : " MB");
}

} // namespace cellwarp
