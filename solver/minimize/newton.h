// SPDX-License-Identifier: GPL-3.0-or-later
// Lowers an energy: Gauss-Newton or Newton steps with a halving line search, and a trust
// region where Newton's were too long.
#pragma once

#include <cmath>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "solver/linear/block_matrix.h"
#include "solver/linear/cholesky.h"
#include "solver/linear/conjugate_gradients.h"
#include "solver/minimize/energy.h"

namespace cellwarp::core
{

enum class Method
{
    /// The exact Hessian, by truncated conjugate gradients; far from a minimum J^T J now
    /// and then (newton.cpp).
    Newton,
    GaussNewton,      ///< J^T J, as in [Botsch07], by conjugate gradients
    GaussNewtonDirect ///< J^T J, factorised in each iteration: the textbook way
};

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
std::string stop_name(Stop stop);

struct SolveOptions
{
    Method method = Method::Newton;
    int max_iterations = 100;
    /// Converged when the gradient is at most this times gradient_scale, or when no
    /// descent is left at the level of rounding.
    double gradient_tolerance = 1e-6;
    double gradient_scale = 0.0; ///< 0: the first gradient
    /// Converged only where whole steps show that no point of a body is farther from its
    /// end than this [length of the state]; infinite: the gradient alone decides. A
    /// gradient is a force: in soft parts a small one still means a long way.
    double place_tolerance = INFINITY;
    double time_budget = 0.0; ///< [s], 0: no limit; looked at in every step too
    /// Looks for directions of descent where the gradient has vanished: a state that is
    /// symmetric in a way that the minimum is not would pass for a minimum.
    bool checks_stability = false;
    /// Ends with no descent where the energy first curves downwards: what follows it on
    /// from there leaves the way that the state has come.
    bool stays_stable = false;
    /// Makes the preconditioner anew where it serves badly; that allocates.
    bool may_refresh = true;
    /// Called before every iteration with its number, the relative gradient, the energy.
    std::function<void(int, double, double)> watch = {};
};

/// Where the time of a solve went [ms].
struct SolveTimes
{
    double linearise = 0.0, linear = 0.0, line_search = 0.0, factorise = 0.0,
           stability = 0.0;
};

/// Starts as "not run": an unfilled report cannot look good.
struct SolveReport
{
    Stop stop = Stop::NotRun;
    int iterations = -1;
    int linear_steps = 0; ///< of conjugate gradients, in all iterations
    int refreshes = 0;    ///< of the preconditioner
    /// Of its iterations those whose exact model curves downwards in some direction:
    /// there the energy is far from any minimum.
    int downward_models = 0;
    double energy_before = -1.0;
    double energy_after = -1.0;
    double gradient = -1.0;      ///< norm at the end, relative to the scale
    double backward_error = 0.0; ///< worst |b - Ax| / (|A| |x| + |b|) of a direct solve
    int damped_factorisations = 0;
    /// How far a point of a body may still be from its end, judged by the last whole
    /// steps [length of the state]; infinite: the last step was not whole.
    double distance_left = INFINITY;
    bool is_saddle =
        false; ///< from where it converged, the energy falls in some direction
    SolveTimes ms;

    /// Counts what an earlier solve of the same frame took.
    void add_earlier(const SolveReport& earlier);
};

/// Keeps all scratch between solves: with the methods of conjugate gradients nothing is
/// allocated from the second solve on. Serves one thread.
class NewtonSolver
{
public:
    /// Both must outlive it. The preconditioner is of the energy's second derivatives.
    NewtonSolver(Energy& energy, Preconditioner& preconditioner);

    /// Lowers the energy from its current state. On any stop the state is the best
    /// found, also where a StopScope asks for the end: then it returns Stop::Stopped.
    /// Never throws but for memory, never prints.
    /// \post energy_after <= energy_before, up to rounding
    SolveReport minimize(const SolveOptions& options);

    /// What earlier solves have shown of the preconditioner no longer counts.
    void forget() { is_slow_ = false; }

    /// Memory of the direct method's factor [byte]; analyses the structure.
    double factor_bytes();

private:
    class Run;
    void analyse();

    Energy& energy_;
    Preconditioner& preconditioner_;
    ConjugateGradients conjugate_gradients_;
    Eigen::VectorXd gradient_, trial_gradient_, right_, step_;
    std::vector<double> rounding_;
    bool is_slow_ = false; ///< the preconditioner served badly at the last step
    // Of the direct method alone.
    std::optional<BlockMatrix> matrix_;
    std::optional<SparseCholesky> factor_;
};

} // namespace cellwarp::core
