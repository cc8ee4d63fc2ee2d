// SPDX-License-Identifier: GPL-3.0-or-later
// A matrix tells where a region goes, not how: of half a turn both ways round are equal.
// Then the frame is solved both ways, and the state of lower energy is kept.
#pragma once

#include <string>
#include <vector>

#include "library/session/cell_refiner.h"
#include "library/session/cell_system.h"
#include "library/session/frame_plan.h"
#include "library/session/frame_report.h"
#include "library/session/session_settings.h"

namespace cellwarp::core
{

struct SolvedWays
{
    bool is_left_wound = false; ///< see FrameSolver
    std::vector<std::string> warnings;
};

/// Solves a frame, see FrameSolver. Regions that turn by half a turn go first as
/// rotation_vector() says; then those that turn alike go the other way round, one such
/// group after the other, and stay there where this lowers the energy. \p report counts
/// the iterations of all ways.
SolvedWays solve_half_turns(CellSystem& system, CellRefiner& refiner,
                            const FramePlan& plan, const SessionSettings& settings,
                            std::size_t frames_done, FrameReport& report);

} // namespace cellwarp::core
