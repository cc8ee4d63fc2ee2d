// SPDX-License-Identifier: GPL-3.0-or-later
// What a session is asked for, beside its statements.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "library/session/body.h"
#include "library/session/led_rod.h"
#include "solver/cells/departures.h"
#include "solver/field/field.h"
#include "solver/minimize/newton.h"

namespace cellwarp::core
{

/// Where a session is: frames done, and how far the next one is.
struct FrameProgress
{
    std::size_t frames_done = 0;
    std::int64_t frame = 0;  ///< its number
    int step = 0, steps = 1; ///< of its way
    int iteration = 0;
    double gradient = 1.0; ///< relative; 1 where it is not known yet
    double energy = 0.0;
};

struct SessionSettings
{
    CellSettings cells;
    Method method = Method::Newton;
    int max_iterations = 200; ///< of one frame, all its steps together
    double gradient_tolerance = 1e-6;
    double time_budget = 0.0; ///< [s] of one frame's solve, 0: no limit
    FieldChoice field = FieldKind::Rbf;
    Departures departures = {};     ///< from [Botsch07]; of the cells and their solution
    bool keeps_fields = false;      ///< of commits, for field_file()
    bool keeps_checkpoints = false; ///< to go back to, for set_script()
    std::vector<LedRod> led_rods = {}; ///< see Session::lead()
    /// Called on the way, in the thread that runs the session: at every iteration.
    std::function<void(const FrameProgress&)> watch = {};
};

} // namespace cellwarp::core
