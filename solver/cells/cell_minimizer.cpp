// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/cells/cell_minimizer.h"

#include <algorithm>

namespace cellwarp::core
{

/// The multigrid of the cells, made anew for the poses of the moment on request.
class CellMinimizer::CellPreconditioner final : public Preconditioner
{
public:
    /// \pre \p energy is linearised
    CellPreconditioner(const CellEnergy& energy, const Cells& cells)
        : energy_(energy), places_(grid_places(cells)),
          multigrid_(energy.total, energy.bodies(places_))
    {
    }
    void apply(const Eigen::VectorXd& r, Eigen::VectorXd& z) override
    {
        multigrid_.apply(r, z);
    }
    void refresh() override
    {
        multigrid_ = RigidMultigrid(energy_.total, {}); // so that there are never two
        multigrid_ = RigidMultigrid(energy_.total, energy_.bodies(places_));
    }
    const RigidMultigrid& multigrid() const { return multigrid_; }

private:
    const CellEnergy& energy_;
    std::vector<GridPlace> places_;
    RigidMultigrid multigrid_;
};

CellMinimizer::CellMinimizer(const Cells& cells, const Glue& glue,
                             std::span<const Constraint> constraints,
                             std::span<const Component> components, bool has_rigid_steps,
                             const MakeCompanion& make_companion,
                             std::span<const CellContact> in_contact)
    : energy_(std::make_unique<CellEnergy>(cells, glue, constraints, components,
                                           has_rigid_steps, make_companion, in_contact))
{
    energy_->state.set_held_points(constraints);
    energy_->total.linearise(kGaussNewton);
    preconditioner_ = std::make_unique<CellPreconditioner>(*energy_, cells);
    solver_ = std::make_unique<NewtonSolver>(energy_->total, *preconditioner_);
}

CellMinimizer::~CellMinimizer() = default;
CellMinimizer::CellMinimizer(CellMinimizer&&) noexcept = default;
CellMinimizer& CellMinimizer::operator=(CellMinimizer&&) noexcept = default;

const RigidMultigrid& CellMinimizer::multigrid() const
{
    return preconditioner_->multigrid();
}

void CellMinimizer::forget(std::span<const Pose> poses, bool is_refreshed)
{
    solver_->forget();
    is_refreshed_ |= is_refreshed;
    if (!is_refreshed_)
        return;
    energy_->state.set_poses(poses);
    energy_->total.linearise(kGaussNewton);
    preconditioner_->refresh();
}

void CellMinimizer::set_held_points(std::span<const Constraint> constraints)
{
    energy_->state.set_held_points(constraints);
}

Residual CellMinimizer::residual(std::span<const Pose> poses)
{
    energy_->state.set_poses(poses);
    energy_->total.gradient(gradient_);
    return {gradient_.norm(), energy_->glue.uncancelled()};
}

SolveReport CellMinimizer::minimize(std::vector<Pose>& poses, const SolveOptions& options)
{
    energy_->state.set_poses(poses);
    if (energy_->companion && energy_->companion->has_other_bodies())
    {
        energy_->total.linearise(kGaussNewton);
        preconditioner_->refresh();
        is_refreshed_ = true;
    }
    const SolveReport report = solver_->minimize(options);
    std::copy(energy_->state.poses().begin(), energy_->state.poses().end(),
              poses.begin());
    is_refreshed_ |= report.refreshes > 0;
    return report;
}

} // namespace cellwarp::core
