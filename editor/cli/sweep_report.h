// SPDX-License-Identifier: GPL-3.0-or-later
// A sweep as data: JSON with every detail, CSV with a line a row, and sentences that say
// what came out. Its page is in report.html.
#pragma once

#include <string>
#include <vector>

#include "editor/cli/machine.h"
#include "library/session/json.h"
#include "library/study/convergence.h"
#include "library/study/sweep.h"

namespace cellwarp::core
{

/// All that a report is made of.
struct SweepReport
{
    std::string scene; ///< as the user named it
    std::string model;
    std::string against; ///< file of the result from elsewhere; empty: none
    SweepSettings settings;
    SweepResult result;
    Machine machine;
    int threads = 0; ///< 0: all cores
};

/// Keys that hold times or memory are `peak_mb` or have `seconds` in their name; all
/// others are the same in every run, on every machine but for `machine`.
Json sweep_json(const SweepReport& report);

/// A line for each row of \p json, which is sweep_json(). The columns against_max and
/// against_rms are there where there is a result from elsewhere, and without where
/// departures are taken back.
std::string sweep_csv(const Json& json);

/// How far the reference is from a result from elsewhere, the orders of convergence, what
/// the fields add to the cells' own error, and what adaptive cells save, one a sentence.
std::vector<std::string> sweep_sentences(const SweepReport& report);

} // namespace cellwarp::core
