// SPDX-License-Identifier: GPL-3.0-or-later
// Layout of --help.
#pragma once

#include <memory>
#include <string>

#include <CLI/CLI.hpp>

namespace cellwarp::core
{

/// Widest line of the help [columns].
inline constexpr std::size_t kHelpColumns = 80;

/// \p text in lines of kHelpColumns at the most; all but the first begin with \p indent
/// blanks, and \p first columns of the first one are taken. Lines of \p text that begin
/// with a blank are commands: what is cut of them goes on behind a backslash.
std::string wrapped(const std::string& text, std::size_t first = 0,
                    std::size_t indent = 0);

/// Wraps all that it prints.
std::shared_ptr<CLI::FormatterBase> help_formatter();

} // namespace cellwarp::core
