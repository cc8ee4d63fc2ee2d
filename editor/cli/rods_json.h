// SPDX-License-Identifier: GPL-3.0-or-later
// Rods and curves of an edit session, as --json and `check` tell them.
#pragma once

#include <string>
#include <vector>

#include "library/session/json.h"
#include "library/session/rod_report.h"

namespace cellwarp::core
{

/// Points are where the rod's frame has them, forces what holds them there.
Json rods_json(const std::vector<RodReport>& rods);

/// A few lines a rod or curve: what it carries, its points, its pins.
std::string rods_text(const std::vector<RodReport>& rods);

} // namespace cellwarp::core
