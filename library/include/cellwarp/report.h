// SPDX-License-Identifier: GPL-3.0-or-later
// Reports of a deformation: its cost and accuracy, the figures of `cellwarp deform
// --json`.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <cellwarp/export.h>
#include <cellwarp/points.h>

namespace cellwarp
{

/// Reason why a solve ended.
enum class Stop
{
    NotRun,
    Converged,
    IterationLimit,
    TimeLimit,
    Stopped,
    NoDescent,
    NotPositiveDefinite
};
/// "converged", "iteration limit", ...
CELLWARP_API std::string stop_name(Stop stop);

/// Rigid motion of a pin of several places [model unit].
struct PinReport
{
    std::string name;
    Mat4 motion = kIdentity;
    double degrees = 0.0; ///< by which it has turned
};

/// One frame. An unfilled report says "not run".
struct FrameReport
{
    std::int64_t frame = 0;
    Stop stop = Stop::NotRun;
    int iterations = -1;
    double energy_before = -1.0, energy_after = -1.0; ///< [work unit^3] of unit stiffness
    double gradient = -1.0;                           ///< relative
    int steps = 0;       ///< parts of the way, solved one after the other
    int refinements = 0; ///< times that cells were split
    std::size_t cells = 0;
    int cells_at_depth_limit = 0; ///< above the threshold, but at max_depth
    double handle_residual = 0.0; ///< largest miss of a region's sample [diagonal]
    double max_pair_gap = 0.0;    ///< largest gap between glued cells [diagonal]
    std::vector<PinReport> pins;
    int contact_points = 0;       ///< where parts press on each other
    double deepest_contact = 0.0; ///< [diagonal]
    double cells_ms = 0.0, solve_ms = 0.0, field_fit_ms = 0.0, field_apply_ms = 0.0;

    /// The solve converged, and handle_residual is at most 1e-9: then the command line
    /// ends with 0, else with 7.
    CELLWARP_API bool is_converged() const;
};

/// A rod or curve after a frame [model unit].
struct RodReport
{
    std::string name;
    bool is_rod = true;    ///< else a curve
    std::size_t cells = 0; ///< that it carries
    double length = 0.0, radius = 0.0, stiffness = 0.0, energy = 0.0;
    std::vector<Vec3> points; ///< of its statement, in place
    std::vector<Vec3> forces; ///< that hold the points
    std::vector<Vec3> line;   ///< places at equal shares of its length
};

/// Volume that a closed mesh encloses [model unit^3].
struct Volume
{
    double before = 0.0, after = 0.0;
};

/// Pairs of triangles that intersect.
struct SelfIntersections
{
    std::size_t rest = 0;  ///< at rest
    std::size_t now = 0;   ///< in the deformed shape
    std::size_t fresh = 0; ///< now, and not at rest
};

} // namespace cellwarp
