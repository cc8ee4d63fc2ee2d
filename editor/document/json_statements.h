// SPDX-License-Identifier: GPL-3.0-or-later
// Statements of a handle file as the records of older journals tell them, in JSON; newer
// records hold the statements' own lines. They are only read.
#pragma once

#include <vector>

#include <nlohmann/json.hpp>

#include "editor/document/selection.h"
#include "io/scene/handle_file.h"

namespace cellwarp::core
{

// Each throws what nlohmann::json throws, std::invalid_argument, or Fault::Malformed.
std::vector<RegionStatement> regions_of(const nlohmann::ordered_json& json);
std::vector<FrameStatement> frames_of(const nlohmann::ordered_json& json);
std::vector<OnStatement> ons_of(const nlohmann::ordered_json& json);

/// First and last of every run, one after the other.
std::vector<SampleRun> runs_of(const nlohmann::ordered_json& json);

} // namespace cellwarp::core
