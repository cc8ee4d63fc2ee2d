// SPDX-License-Identifier: GPL-3.0-or-later
// Bytes as text: three bytes are four characters. [RFC4648]
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace cellwarp::core
{

/// The bytes of \p text, with or without padding at its end; nothing if a character is
/// none of the alphabet or the text is cut.
std::optional<std::string> base64_decoded(std::string_view text);

std::string base64_encoded(std::string_view bytes);

/// \p text, which stands for \p before, made to stand for \p after, of the same size.
/// Characters of bytes that do not change stay.
std::string base64_patched(std::string text, std::string_view before,
                           std::string_view after);

} // namespace cellwarp::core
