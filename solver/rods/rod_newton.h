// SPDX-License-Identifier: GPL-3.0-or-later
// Newton's method for one rod: its equilibrium, or one implicit step in time.
#pragma once

#include <Eigen/Core>

#include "solver/dynamics/saddle.h"
#include "solver/rods/rod_model.h"

namespace cellwarp
{

enum class RodStop
{
    NotRun,
    Converged,
    EnergyGrew,    ///< of the smallest part of a step
    Contradiction, ///< converged; constraints that contradict are met as well as can be
    IterationLimit,
    NoDescent,
    NotFinite
};

/// "converged", "iteration limit", ...
const char* stop_name(RodStop stop);

/// Whether a solve came to its end.
inline bool is_solved(RodStop stop)
{
    return stop == RodStop::Converged || stop == RodStop::Contradiction;
}

/// What holds a rod back in a step of time: M (x - begin - step * velocity) / step^2, and
/// (gamma M + D) (x - begin) / step for the viscosity and the drags of the model.
struct RodInertia
{
    Eigen::VectorXd begin, velocity; ///< at the begin of the step
    double step = 0.0;               ///< [s]
};

struct RodNewtonReport
{
    RodStop stop = RodStop::NotRun;
    int iterations = -1;
    double residual = -1.0;  ///< largest force that is not in balance [N, N m]
    double violation = -1.0; ///< largest, of constraints
    int num_dropped = 0;     ///< rows of constraints that say nothing new, at the end
};

struct RodNewtonOptions
{
    int max_iterations = 100;
    double tolerance = 1e-10; ///< of the residual, of the largest force at work
};

class RodNewton
{
public:
    /// The model must outlive it.
    explicit RodNewton(RodModel& model);

    /// From \p state on, which is the best found at the end. \p inertia null: statics.
    /// \p midpoint: the state is half a step ahead of \p midpoint, which constraints are
    /// of a whole step from; null: constraints are of the state.
    RodNewtonReport solve(RodState& state, const RodInertia* inertia,
                          const RodNewtonOptions& options,
                          const RodState* midpoint = nullptr);

    /// Multipliers of the last solve, a row; as forces on the rod, L^T lambda.
    const Eigen::VectorXd& multipliers() const { return lambda_; }
    /// What rounding makes of energies, as in the last solve [J].
    double rounding() const { return rounding_; }

private:
    class Run;

    RodModel& model_;
    BandMatrix matrix_;
    SaddleSolver saddle_;
    Eigen::VectorXd lambda_;
    double stiffness_ = 0.0; ///< YA / L + YI / L^3 of the stiffest [N/m]
    double heaviest_ = 0.0;  ///< entry of the mass [kg]
    double rounding_ = 0.0;
};

} // namespace cellwarp
