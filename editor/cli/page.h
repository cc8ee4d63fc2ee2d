// SPDX-License-Identifier: GPL-3.0-or-later
// The frame of a report: one HTML file that needs no script and no network, right on dark
// screens and on paper.
#pragma once

#include <string>

namespace cellwarp::core
{

/// A whole page. \p title: plain text; \p body: markup.
std::string html_page(const std::string& title, const std::string& body);

} // namespace cellwarp::core
