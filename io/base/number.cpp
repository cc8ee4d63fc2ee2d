// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/base/number.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>

namespace cellwarp::core
{

namespace
{

/// from_chars reports overflow and underflow alike. The power of ten of the first digit
/// that is not 0 tells them apart.
bool is_underflow(std::string_view token)
{
    const std::size_t e = std::min(token.find_first_of("eE"), token.size());
    const std::string_view digits = token.substr(0, e);
    const auto point =
        static_cast<std::int64_t>(std::min(digits.find('.'), digits.size()));
    const auto first =
        static_cast<std::int64_t>(std::min(digits.find_first_of("123456789"), e));
    const std::int64_t power = first < point ? point - 1 - first : point - first;
    std::int64_t exponent = 0;
    if (e < token.size())
    {
        const char* begin = token.data() + e + 1;
        const bool is_negative = *begin == '-';
        begin += *begin == '+';
        if (std::from_chars(begin, token.data() + token.size(), exponent).ec !=
            std::errc())
            return is_negative; // far more digits than the token has
    }
    // Beyond these bounds its sign decides; so the sum cannot overflow.
    constexpr std::int64_t kMost = std::int64_t(1) << 60;
    return power + std::clamp(exponent, -kMost, kMost) < 0;
}

/// Parses non-finite numbers of older C libraries: 1.#INF, -1.#IND, 1.#QNAN00.
std::optional<double> parse_not_finite(std::string_view token)
{
    const bool is_negative = token.starts_with('-');
    token.remove_prefix(is_negative || token.starts_with('+') ? 1 : 0);
    if (!token.starts_with("1.#"))
        return std::nullopt;
    token.remove_prefix(3);
    for (const std::string_view word : {"INF", "IND", "QNAN", "SNAN"})
        if (token.starts_with(word) &&
            token.find_first_not_of('0', word.size()) == std::string_view::npos)
        {
            const double value = word == "INF" ? std::numeric_limits<double>::infinity()
                                               : std::numeric_limits<double>::quiet_NaN();
            return is_negative ? -value : value;
        }
    return std::nullopt;
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
        return parse_not_finite(token);
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

} // namespace cellwarp::core
