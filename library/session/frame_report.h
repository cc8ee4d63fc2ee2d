// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "solver/minimize/newton.h"

namespace cellwarp::core
{

/// The way of a frame gone again in its last cells, because it might have missed a lower
/// minimum.
enum class SecondStart
{
    None,
    Dropped, ///< it led no lower
    Taken
};

/// "none", "dropped" or "taken".
const char* second_start_name(SecondStart start);

/// Where a pin of several places has gone: all of its samples by this one motion.
struct PinReport
{
    std::string name;
    Eigen::Matrix4d motion; ///< rigid, as in handle files [model unit]
    double degrees = 0.0;   ///< by which it has turned
};

/// Where parts keep each other out.
struct CellContactReport
{
    int points = 0;       ///< on boundaries that are pressed back
    double deepest = 0.0; ///< by which one of them is too near [diagonal]
};

/// What one frame took and reached. Lengths are relative to the diagonal.
struct FrameReport
{
    std::int64_t frame = 0;
    SolveReport solve; ///< of the last step; iterations of all
    int steps = 0;
    int iterations_in_larger_cells = 0; ///< of those of the solve, which cost little
    int refinements = 0;                ///< times that other cells were made
    SecondStart second_start = SecondStart::None;
    std::size_t cells = 0;
    int cells_at_limit = 0; ///< above the threshold, but at the deepest level
    double handle_residual = 0.0;
    double max_pair_gap = 0.0;
    /// Of the energy, by one step of the solver, relative to where that solve began.
    double largest_rise = 0.0;
    std::vector<PinReport> pins;
    std::optional<CellContactReport>
        contacts; ///< nothing: parts may pass through each other
    double cells_ms = 0.0, solve_ms = 0.0, fit_ms = 0.0, apply_ms = 0.0;

    /// The solve converged, and samples of regions are where their motions put them.
    bool is_converged() const;
};

/// Reasons why a frame has not converged, for people; none: it has.
std::vector<std::string> convergence_warnings(const FrameReport& report);

} // namespace cellwarp::core
