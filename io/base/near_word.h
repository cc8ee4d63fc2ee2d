// SPDX-License-Identifier: GPL-3.0-or-later
// What was probably meant by a word that is not known.
#pragma once

#include <span>
#include <string>

namespace cellwarp::core
{

/// Of the words the one that \p given differs from by the fewest letters, put in, left
/// out or changed; empty where more than 3, or half of \p given, would have to be.
std::string nearest_word(const std::string& given, std::span<const std::string> words);

} // namespace cellwarp::core
