// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/base/base64.h"

#include <algorithm>
#include <array>
#include <cstdint>

namespace cellwarp::core
{

namespace
{

constexpr std::string_view kAlphabet =
    "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

constexpr std::array<std::int8_t, 256> values_of_characters()
{
    std::array<std::int8_t, 256> values{};
    values.fill(-1);
    for (std::size_t i = 0; i < kAlphabet.size(); ++i)
        values[static_cast<unsigned char>(kAlphabet[i])] = static_cast<std::int8_t>(i);
    return values;
}

constexpr std::array<std::int8_t, 256> kValues = values_of_characters();

/// Four characters; three bytes, or what is left of them at the end.
void encode(std::string_view group, char* characters)
{
    std::uint32_t bits = 0;
    for (std::size_t k = 0; k < 3; ++k)
        bits = bits << 8 | (k < group.size() ? static_cast<unsigned char>(group[k]) : 0);
    for (std::size_t k = 0; k <= group.size(); ++k)
        characters[k] = kAlphabet[bits >> (18 - 6 * k) & 63u];
}

} // namespace

std::string base64_encoded(std::string_view bytes)
{
    std::string text((bytes.size() + 2) / 3 * 4, '=');
    for (std::size_t first = 0; first < bytes.size(); first += 3)
        encode(bytes.substr(first, 3), &text[first / 3 * 4]);
    return text;
}

std::optional<std::string> base64_decoded(std::string_view text)
{
    if (text.size() % 4 == 0)
        for (int padding = 0; padding < 2 && text.ends_with('='); ++padding)
            text.remove_suffix(1);
    if (text.size() % 4 == 1)
        return std::nullopt;
    std::string bytes;
    bytes.reserve(text.size() / 4 * 3 + 2);
    std::uint32_t bits = 0;
    for (std::size_t i = 0; i < text.size(); ++i)
    {
        const int value = kValues[static_cast<unsigned char>(text[i])];
        if (value < 0)
            return std::nullopt;
        bits = bits << 6 | static_cast<std::uint32_t>(value);
        // Each character after a group's first ends a byte.
        if (i % 4 > 0)
            bytes += static_cast<char>(bits >> (6 - 2 * (i % 4)) & 255u);
    }
    return bytes;
}

std::string base64_patched(std::string text, std::string_view before,
                           std::string_view after)
{
    for (std::size_t first = 0; first < before.size(); first += 3)
    {
        const std::string_view group = after.substr(first, 3);
        if (group == before.substr(first, 3))
            continue;
        encode(group, &text[first / 3 * 4]);
    }
    return text;
}

} // namespace cellwarp::core
