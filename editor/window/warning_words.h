// SPDX-License-Identifier: GPL-3.0-or-later
// Warnings of the command line in the window's own words.
#pragma once

#include <string>

namespace cellwarp::core
{

class Document;

/// A warning without the file and line that it concerns, which the window does not show,
/// and with the window's own ways instead of words of files and flags.
std::string in_window_words(const std::string& warning, const Document& document);

} // namespace cellwarp::core
