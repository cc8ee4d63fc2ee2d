// SPDX-License-Identifier: GPL-3.0-or-later
// Finds the poses of the free cells that minimise the glue energy: Gauss-Newton or
// Newton steps, each projected to rigid motions, with a halving line search.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "octree/cells.h"
#include "solver/constraints.h"
#include "solver/glue.h"
#include "solver/linear_solver.h"
#include "solver/pose.h"

namespace cellwarp
{

enum class Method
{
    GaussNewton, ///< J^T J, as in [Botsch07]
    Newton       ///< the exact Hessian, or as much of its curvature as stays definite
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
    double gradient_scale = 0.0; ///< see Residual; 0: the first gradient
    double time_budget = 0.0;    ///< [s], 0: no limit; checked between iterations
    std::stop_token stop = {};
};

/// Starts as "not run": an unfilled report cannot look good.
struct SolveReport
{
    Stop stop = Stop::NotRun;
    int iterations = -1;
    int newton_iterations = 0; ///< of them with the exact Hessian
    double energy_before = -1.0;
    double energy_after = -1.0;
    double gradient = -1.0;      ///< norm at the end, relative to the scale
    double backward_error = 0.0; ///< worst |b - Ax| / (|A| |x| + |b|) of a linear solve
    int damped_factorisations = 0;
    bool is_saddle = false; ///< the last Newton matrix had a direction of descent
};

/// Norms of the gradient over the unknowns.
struct Residual
{
    double gradient = 0.0;
    double uncancelled = 0.0; ///< of the pair forces, each cell's added as lengths
    /// What rounding of the positions alone may leave of each unknown cell's gradient.
    std::vector<double> rounding;
};

/// The unknowns of one choice of constraints, with everything that lasts between
/// solves: the structure of the matrix and its ordering. Scratch lives here too, so
/// one object serves one thread.
class Minimizer
{
public:
    /// Keeps copies of what it needs; \p components from find_components().
    Minimizer(const Cells& cells, const Glue& glue,
              std::span<const Constraint> constraints,
              std::span<const Component> components);

    int num_unknown_cells() const { return static_cast<int>(cell_of_unknown_.size()); }

    /// Memory of the factor [bytes], known before any factorisation.
    double factor_bytes() const
    {
        return solver_ ? 8.0 * solver_->factor_numbers() : 0.0;
    }

    /// Where the held points of pinned cells are to be from now on.
    void set_held_points(std::span<const Constraint> constraints);

    Residual residual(std::span<const Pose> poses) const;

    /// Lowers the energy of \p poses in place. On any stop the poses are the best
    /// found. Never throws, never prints.
    /// \post energy_after <= energy_before, up to rounding
    SolveReport minimize(std::vector<Pose>& poses, const SolveOptions& options);

private:
    void assemble(std::span<const Pose> poses, Curvature curvature);
    Eigen::VectorXd reduced_gradient(std::span<const Pose> poses) const;
    /// Whether no cell's part of a gradient is more than its rounding: stiff cells must
    /// not hide what soft ones still ask for.
    bool is_rounding(const Eigen::VectorXd& gradient,
                     std::span<const double> rounding) const;
    /// The factor that damping would multiply: typical size of the diagonal.
    void add_damping(double factor);
    bool factorize(std::span<const Pose> poses, Method method, SolveReport& report);
    std::vector<Pose> stepped(std::span<const Pose> poses, const Eigen::VectorXd& step,
                              double length) const;

    Glue glue_;
    std::vector<Eigen::Vector3d> centres_;
    std::vector<Constraint> constraints_;
    std::vector<int> unknown_of_cell_; ///< -1 where there is none
    std::vector<int> cell_of_unknown_;
    std::vector<bool> turns_freely_; ///< unknowns that a proximal term holds
    std::vector<int> block_of_face_; ///< off-diagonal block, -1 if a side is known
    std::vector<GlueBlock> face_blocks_;
    BlockMatrix matrix_;
    std::optional<LinearSolver> solver_;
};

} // namespace cellwarp
