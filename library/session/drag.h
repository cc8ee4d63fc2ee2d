// SPDX-License-Identifier: GPL-3.0-or-later
// What the user sees while a handle is in the hand: a frame in milliseconds, for display
// only. What is kept is solved anew on release.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "library/session/cell_system.h"
#include "solver/field/sample_blend.h"

namespace cellwarp::core
{

struct DragSettings
{
    FieldKind field = FieldKind::Blend; ///< or Closest4
    int max_iterations = 2;             ///< of one frame
    double gradient_tolerance = 1e-2;   ///< of the frame's first gradient
    double time_budget = 0.0;           ///< [s] of one frame's solve, 0: no limit
};

struct DragReport
{
    SolveReport solve;
    double solve_ms = 0.0, blend_ms = 0.0;
};

/// Keeps everything that lasts between frames: the system with its preconditioner,
/// tabulated blend weights, buffers. A frame allocates nothing and factorises nothing.
class Drag
{
public:
    /// Starts from where \p system is. \p normals: in work axes.
    Drag(CellSystem system, const DragSettings& settings,
         std::span<const SampleNormal> normals);

    /// Moves the regions (one motion each, from rest), takes a step or two towards
    /// the minimum, and moves all samples along. Frames with the same motions go on
    /// converging.
    /// \p splines: see CellSystem::move_regions().
    DragReport frame(std::span<const Motion> motions,
                     std::span<const std::shared_ptr<const SplineState>> splines = {});

    /// Shows \p state, of a system in the same cells with the same regions.
    void start_from(const CellSystemState& state);

    const CellSystem& system() const { return *system_; }
    /// Places three numbers each [work], in an order of their own; see SampleBlend.
    const SampleBlend& samples() const { return *samples_; }

private:
    void blend();

    DragSettings settings_;
    std::unique_ptr<CellSystem> system_; ///< at a fixed address: the table points into it
    std::optional<SampleBlend> samples_;
    std::vector<std::size_t> faded_regions_;
    std::vector<Motion> faded_motions_;
};

} // namespace cellwarp::core
