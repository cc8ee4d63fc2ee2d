// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/minimize.h"

#include <algorithm>

namespace cellwarp
{

/// The multigrid of the cells, made anew for the poses of the moment on request.
class Minimizer::CellPreconditioner final : public Preconditioner
{
public:
    /// \pre \p energy is linearised
    CellPreconditioner(const GlueEnergy& energy, const Cells& cells)
        : energy_(energy), places_(places_of(energy, cells)),
          multigrid_(energy, places_, energy.unknown_poses())
    {
    }
    void apply(const Eigen::VectorXd& r, Eigen::VectorXd& z) override
    {
        multigrid_.apply(r, z);
    }
    void refresh() override
    {
        multigrid_ = Multigrid(energy_, places_, energy_.unknown_poses());
    }
    const Multigrid& multigrid() const { return multigrid_; }

private:
    static std::vector<GridPlace> places_of(const GlueEnergy& energy, const Cells& cells)
    {
        std::vector<GridPlace> places;
        for (int u = 0; u < energy.num_unknown_cells(); ++u)
            places.push_back(grid_place(cells, energy.cell_of_unknown(u)));
        return places;
    }

    const GlueEnergy& energy_;
    std::vector<GridPlace> places_;
    Multigrid multigrid_;
};

Minimizer::Minimizer(const Cells& cells, const Glue& glue,
                     std::span<const Constraint> constraints,
                     std::span<const Component> components, bool has_rigid_steps)
    : energy_(std::make_unique<GlueEnergy>(cells, glue, constraints, components,
                                           has_rigid_steps))
{
    energy_->linearise(kGaussNewton);
    preconditioner_ = std::make_unique<CellPreconditioner>(*energy_, cells);
    solver_ = std::make_unique<NewtonSolver>(*energy_, *preconditioner_);
    energy_->set_held_points(constraints);
}

Minimizer::~Minimizer() = default;
Minimizer::Minimizer(Minimizer&&) noexcept = default;
Minimizer& Minimizer::operator=(Minimizer&&) noexcept = default;

const Multigrid& Minimizer::multigrid() const
{
    return preconditioner_->multigrid();
}

void Minimizer::forget(std::span<const Pose> poses, bool is_refreshed)
{
    solver_->forget();
    is_refreshed_ |= is_refreshed;
    if (!is_refreshed_)
        return;
    energy_->set_poses(poses);
    energy_->linearise(kGaussNewton);
    preconditioner_->refresh();
}

void Minimizer::set_held_points(std::span<const Constraint> constraints)
{
    energy_->set_held_points(constraints);
}

Residual Minimizer::residual(std::span<const Pose> poses)
{
    energy_->set_poses(poses);
    energy_->gradient(gradient_);
    return {gradient_.norm(), energy_->uncancelled()};
}

SolveReport Minimizer::minimize(std::vector<Pose>& poses, const SolveOptions& options)
{
    energy_->set_poses(poses);
    const SolveReport report = solver_->minimize(options);
    std::copy(energy_->poses().begin(), energy_->poses().end(), poses.begin());
    is_refreshed_ |= report.refreshes > 0;
    return report;
}

} // namespace cellwarp
