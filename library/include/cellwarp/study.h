// SPDX-License-Identifier: GPL-3.0-or-later
// Accuracy against run time: one edit with many thresholds, depths and fields, each
// compared with a reference and timed.
#pragma once

#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include <cellwarp/control.h>
#include <cellwarp/deform.h>
#include <cellwarp/export.h>

namespace cellwarp
{

struct SweepSettings
{
    /// Settings of all runs; their depth, threshold and field are not used.
    Settings settings = {};
    int max_depth = 2; ///< of the reference, 0 to 20
    std::vector<double> thresholds = {1e-1, 3e-2, 1e-2, 3e-3, 1e-3,
                                      3e-4, 1e-4, 3e-5, 1e-5}; ///< [diagonal]
    std::vector<int> depths = {}; ///< of the adaptive cells; empty: max_depth
    std::vector<FieldKind> fields = {FieldKind::Rbf, FieldKind::Blend};
    std::vector<int> iteration_limits = {};
    int runs = 3; ///< of each case, 1 to 100; times are medians
    /// A result from elsewhere that every row is compared with; empty: none.
    PointsView against = {};
};

struct SweepRow
{
    std::string kind; ///< "reference", "uniform" or "adaptive"
    int depth = 0;
    double threshold = INFINITY; ///< [diagonal]; infinity: uniform
    FieldKind field = FieldKind::Rbf;
    int max_iterations = 0; ///< 0: no limit was tried
    std::string failure;    ///< reason why there is no result; then the rest is empty
    double error_largest = 0.0, error_rms = 0.0;     ///< from the reference [diagonal]
    double against_largest = NAN, against_rms = NAN; ///< [diagonal]
    std::size_t cells = 0;
    int iterations = 0;
    Stop stop = Stop::NotRun;
    /// From the model to the last frame's samples, and parts of it [s].
    double seconds = 0.0, cells_seconds = 0.0, solve_seconds = 0.0, field_seconds = 0.0;
};

struct Sweep
{
    std::vector<SweepRow> rows; ///< the reference first
    std::vector<std::string> warnings;
};

/// Throws as deform() does if there is no reference, and Fault::Usage for an edit without
/// frames.
CELLWARP_API Sweep sweep(const Model& model, const Edit& edit,
                         const SweepSettings& settings = {}, const Control& control = {});

} // namespace cellwarp
