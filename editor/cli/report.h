// SPDX-License-Identifier: GPL-3.0-or-later
// Reports as files beside their JSON: rows as CSV, and a page that draws them. The look
// and the words of pages are in report.html, which is compiled into the program.
#pragma once

#include <string>
#include <vector>

#include "library/session/json.h"

namespace cellwarp::core
{

struct CsvColumn
{
    std::string name, key; ///< \ref key: "cells", or "error_parts/cells/rms" of an object
};

/// A header, then a line for each row. Numbers have all their digits; what a row has not,
/// or has as null, is empty.
std::string csv_text(const std::vector<CsvColumn>& columns, const Json& rows);

/// One HTML file that needs no other, and no network. \p data: "kind" says which page of
/// report.html is drawn, the other keys are what it draws.
std::string report_page(const Json& data);

} // namespace cellwarp::core
