// SPDX-License-Identifier: GPL-3.0-or-later
// Finds the poses of the free cells that minimise the glue energy: the energy, its
// preconditioner and Newton's method for one choice of constraints.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "octree/base/rigid_motion.h"
#include "octree/cells.h"
#include "solver/cells/cell_energy.h"
#include "solver/cells/constraints.h"
#include "solver/cells/rigid_multigrid.h"
#include "solver/minimize/newton.h"

namespace cellwarp::core
{

/// Norms of the gradient over the unknowns.
struct Residual
{
    double gradient = 0.0;
    double uncancelled = 0.0; ///< of the pair forces, each cell's added as lengths
};

/// Everything that lasts between solves: what the handles' motion changes is not in it.
/// Scratch lives here too, so one object serves one thread.
class CellMinimizer
{
public:
    /// Keeps copies of what it needs; \p components from find_components();
    /// \p has_rigid_steps and \p in_contact as in CellEnergy.
    CellMinimizer(const Cells& cells, const Glue& glue,
                  std::span<const Constraint> constraints,
                  std::span<const Component> components, bool has_rigid_steps = true,
                  const MakeCompanion& make_companion = {},
                  std::span<const CellContact> in_contact = {});

    ~CellMinimizer();
    CellMinimizer(CellMinimizer&&) noexcept;
    CellMinimizer& operator=(CellMinimizer&&) noexcept;

    std::size_t num_unknown_cells() const { return energy_->state.num_unknown_cells(); }
    const RigidMultigrid& multigrid() const;
    /// Memory of the factor that Method::GaussNewtonDirect needs [byte].
    double factor_bytes()
    {
        return energy_->total.num_unknowns() > 0 ? solver_->factor_bytes() : 0.0;
    }

    /// Whether a solve has made the preconditioner anew, for the poses of that moment.
    bool is_refreshed() const { return is_refreshed_; }
    /// What solves have left behind no longer counts: the preconditioner is that of
    /// \p poses if \p is_refreshed or one was made anew, and else that of the rest.
    void forget(std::span<const Pose> poses, bool is_refreshed);

    /// Where the held points of pinned cells, and the curves of sliding ones, are to be
    /// from now on.
    void set_held_points(std::span<const Constraint> constraints);
    /// Where a sliding cell has come to.
    const Constraint& constraint(int cell) const
    {
        return energy_->state.constraint(cell);
    }

    Residual residual(std::span<const Pose> poses);

    /// Lowers the energy of \p poses in place; see NewtonSolver.
    SolveReport minimize(std::vector<Pose>& poses, const SolveOptions& options);

private:
    class CellPreconditioner;

    // At fixed addresses, which the solver keeps.
    std::unique_ptr<CellEnergy> energy_;
    std::unique_ptr<CellPreconditioner> preconditioner_;
    std::unique_ptr<NewtonSolver> solver_;
    Eigen::VectorXd gradient_;
    bool is_refreshed_ = false;
};

} // namespace cellwarp::core
