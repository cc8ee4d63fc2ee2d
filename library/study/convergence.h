// SPDX-License-Identifier: GPL-3.0-or-later
// What the rows of a sweep say together: how fast the error of uniform cells falls, and
// what adaptive cells save. Rows stopped early on purpose are left out of both.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "library/study/sweep.h"

namespace cellwarp::core
{

/// How fast one measure of the error falls: the power of the cell edge.
struct Orders
{
    /// From depth to depth, and by least squares, of the error against the reference.
    /// The deepest level is left out: the reference has its cells. As the reference has
    /// an error as well, the last of them is too high (a first order that is measured
    /// one level above the reference looks like 1.6).
    std::vector<std::optional<double>> steps;
    std::optional<double> fitted;
    /// From the distances between successive depths, in which the reference has no part:
    /// element k compares depths k and k + 1 with depths k + 1 and k + 2.
    std::vector<std::optional<double>> of_differences;
};

struct Convergence
{
    FieldChoice field = FieldKind::Rbf;
    Orders largest, rms;
};

/// One for each field that the sweep has.
std::vector<Convergence> convergence_of(std::span<const SweepRow> rows);

/// What adaptive cells take for an error, as shares of what uniform cells take for it;
/// below 1 is a saving.
struct Share
{
    double cells = 0.0, seconds = 0.0;
    /// The coarsest adaptive cells have a smaller error already: the shares are at most
    /// these.
    bool is_bound = false;
};

struct Saving
{
    FieldChoice field = FieldKind::Rbf;
    int adaptive_depth = 0, uniform_depth = 0;
    Deviation error; ///< of the uniform cells
    /// For the same largest and RMS error; nothing where no adaptive cells reach it.
    std::optional<Share> largest, rms;
};

/// For each field, adaptive depth and uniform depth between the coarsest grid, which is
/// where adaptive cells begin, and the reference's. Between rows the costs are
/// interpolated, log over log; not where the error falls by more than a decade from one
/// row to the next, which then counts whole.
std::vector<Saving> savings_of(std::span<const SweepRow> rows);

} // namespace cellwarp::core
