// SPDX-License-Identifier: GPL-3.0-or-later
// Where values stand in JSON text, so that some can be replaced and all others keep
// their bytes. The text must have been parsed before: nothing is checked again.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

namespace cellwarp::core
{

/// A value in the text [byte].
struct TextRange
{
    std::size_t begin = 0, end = 0;
};

/// How deep brackets are nested, of any text: counted outside of quotes.
std::size_t json_depth(std::string_view text);

/// The whole text's value.
TextRange json_root(std::string_view text);

/// The value of a member of an object; of several with that name the last, as parsers
/// have it.
std::optional<TextRange> json_member(std::string_view text, TextRange object,
                                     std::string_view name);

/// The values of an array.
std::vector<TextRange> json_items(std::string_view text, TextRange array);

} // namespace cellwarp::core
