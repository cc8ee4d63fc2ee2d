// SPDX-License-Identifier: GPL-3.0-or-later
// How a solve for an equilibrium, or for a step in time, ended.
#pragma once

namespace cellwarp::core
{

enum class MotionStop
{
    NotRun,
    Converged,
    EnergyGrew,    ///< of the smallest part of a step
    TooFast,       ///< for the smallest part of a step: something may have been missed
    Contradiction, ///< converged; constraints that contradict are met as well as can be
    IterationLimit,
    NoDescent,
    NotFinite
};

/// "converged", "iteration limit", ...
const char* stop_name(MotionStop stop);

/// Whether a solve came to its end.
inline bool is_solved(MotionStop stop)
{
    return stop == MotionStop::Converged || stop == MotionStop::Contradiction;
}

struct MotionReport
{
    MotionStop stop = MotionStop::NotRun;
    int iterations = -1;
    double residual = -1.0;  ///< largest force that is not in balance [N, N m]
    double violation = -1.0; ///< largest, of constraints
    int num_dropped = 0;     ///< rows of constraints that say nothing new, at the end
};

struct MotionOptions
{
    int max_iterations = 100;
    double tolerance = 1e-10; ///< of the residual, of the largest force at work
};

} // namespace cellwarp::core
