// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/minimize.h"

#include <algorithm>

namespace cellwarp
{

Minimizer::Minimizer(const Cells& cells, const Glue& glue,
                     std::span<const Constraint> constraints,
                     std::span<const Component> components)
    : energy_(std::make_unique<GlueEnergy>(cells, glue, constraints, components))
{
    std::vector<GridPlace> places;
    for (int u = 0; u < energy_->num_unknown_cells(); ++u)
    {
        const Cell& cell =
            cells.cells[static_cast<std::size_t>(energy_->cell_of_unknown(u))];
        places.push_back({cell.centre, cell.box_centre, cell.edge});
    }
    energy_->linearise(kGaussNewton);
    multigrid_ = std::make_unique<Multigrid>(*energy_, places);
    solver_ = std::make_unique<NewtonSolver>(*energy_, *multigrid_);
    energy_->set_held_points(constraints);
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
    return report;
}

} // namespace cellwarp
