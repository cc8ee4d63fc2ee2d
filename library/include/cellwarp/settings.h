// SPDX-License-Identifier: GPL-3.0-or-later
// Settings of a deformation, beside its statements. Defaults are those of the command
// line; every name is a key of a scene file, and docs/scenes.md has their ranges.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

#include <cellwarp/export.h>
#include <cellwarp/points.h>

namespace cellwarp
{

enum class Fill
{
    Solid, ///< material wherever the samples enclose it; else a shell
    Shell, ///< a sheet along the samples
    Closed ///< solid, with a lid over each loop of open edges
};

enum class Loose
{
    Follow, ///< a part that no region holds goes with the part nearest to it
    Stay
};

enum class FieldKind
{
    Rbf,       ///< smooth: local triharmonic fits
    RbfGlobal, ///< smooth: one dense triharmonic fit of all cells
    Blend,     ///< a continuous blend of the closest cells, as drags show
    Closest4   ///< the average of the four closest cells of [Botsch07]
};

/// Cells, and how fine they become: accuracy against run time. Lengths are shares of the
/// model's diagonal.
struct CellSettings
{
    Fill fill = Fill::Solid;
    int across = 0;    ///< coarsest cells along the longest side; 0: 1,000 to 2,500 cells
    int max_depth = 2; ///< splits below the coarsest cells, at the most
    /// Cells with a larger error are split. 0: all are, down to max_depth; infinity:
    /// none; not set: 0.002, and 0.01 with is_botsch07.
    std::optional<double> threshold = {};
    double gap = 0.008;      ///< parts farther apart are never glued
    double thickness = 0.01; ///< of shells and open sheets; solids ignore it
    /// Not set: Follow, and Stay with is_botsch07.
    std::optional<Loose> loose = {};
    bool join = false; ///< closed parts that touch are one material
    /// All stays in the plane that the samples lie in. Not set: it does if the first
    /// frame that moves something keeps the plane.
    std::optional<bool> flat = {};
    bool contact = false;            ///< parts that come to touch keep out of each other
    std::int64_t max_cells = 200000; ///< the worst are split first
};

/// Axes and box of the octree: x has the coordinates axes * (x - origin).
struct Frame
{
    Vec3 origin{};
    std::array<Vec3, 3> axes{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}; ///< rows, right-handed
    Vec3 size{}; ///< [model unit]; >= 0, not all of them 0
};

struct Settings
{
    CellSettings cells = {};
    std::optional<Frame> frame = {}; ///< not set: the model's box
    /// Field of results; drags always blend. Not set: Rbf, and the paper's own with
    /// is_botsch07.
    std::optional<FieldKind> field = {};
    bool is_botsch07 = false; ///< the method of [Botsch07] as a whole, for comparison
    int max_iterations = 200; ///< of one frame, 1 and more
    double gradient_tolerance = 1e-6; ///< relative
    double time_budget = 0.0;         ///< of one frame's solve [s]; 0: no limit
    /// Memory of the process [byte]; 0: 70 % of what is free now; infinity: no limit.
    /// Work that would need more throws Fault::Budget before it begins.
    double max_memory = 0.0;
    int threads = 0; ///< of this call; 0: all. It changes no bit of a result

    /// Settings of a scene file's text. Throws Fault::Malformed with the key.
    CELLWARP_API static Settings parse(std::string_view scene);
    /// Throws Fault::Usage with the key of the first value that is out of range. Every
    /// call that takes settings does so.
    CELLWARP_API void check() const;
};

} // namespace cellwarp
