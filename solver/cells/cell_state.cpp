// SPDX-License-Identifier: GPL-3.0-or-later
// Unknowns are twists about the current centres in the cell's own axes: 6 numbers x for a
// free cell, whose twist in world axes is (R x_angular, R x_linear). In these axes the
// second derivatives hardly change when a part of the body turns, so what was prepared at
// rest stays a good preconditioner.
// A pinned cell, whose held point is at X, has 3 unknowns omega: with q = p - X the
// centre follows,
//   p' = X + rot(R omega) q = p + (R omega) x q + ...,
// which is a twist with v = (R omega) x q: its gradient is R^T (g_omega + q x g_v).
#include "solver/cells/cell_state.h"

#include <algorithm>

#include "octree/base/index.h"
#include "octree/base/parallel.h"

namespace cellwarp
{

CellState::CellState(const Cells& cells, std::span<const Constraint> constraints,
                     bool has_rigid_steps, UnknownPlace begin)
    : State(begin), has_rigid_steps_(has_rigid_steps),
      constraints_(constraints.begin(), constraints.end())
{
    int next = begin.unknown;
    for (std::size_t i = 0; i < cells.size(); ++i)
    {
        centres_.push_back(cells.cells[i].centre);
        poses_.push_back({Eigen::Matrix3d::Identity(), centres_[i]});
        const Hold hold = constraints_[i].hold;
        const bool is_unknown = hold == Hold::Free || hold == Hold::Pinned;
        unknown_of_cell_.push_back(is_unknown ? num_unknown_cells() : -1);
        if (!is_unknown)
            continue;
        cell_of_unknown_.push_back(static_cast<int>(i));
        sizes_.push_back(hold == Hold::Free ? 6 : 3);
        first_.push_back(next);
        next += sizes_.back();
        constraints_[i].held_now = constraints_[i].held_rest;
    }
    base_ = poses_;
}

std::vector<Pose> CellState::unknown_poses() const
{
    std::vector<Pose> poses;
    for (const int cell : cell_of_unknown_)
        poses.push_back(pose(cell));
    return poses;
}

void CellState::set_poses(std::span<const Pose> poses)
{
    std::copy(poses.begin(), poses.end(), poses_.begin());
    settle();
}

void CellState::set_held_points(std::span<const Constraint> constraints)
{
    for (std::size_t i = 0; i < constraints_.size(); ++i)
        constraints_[i].held_now = constraints[i].held_now;
}

CellState::Basis CellState::basis(int unknown) const
{
    const int cell = cell_of_unknown(unknown);
    const Eigen::Matrix3d& R = pose(cell).R;
    Basis basis = Basis::Zero(6, at(sizes_, unknown));
    basis.topLeftCorner<3, 3>() = R;
    if (is_pinned(unknown))
        basis.bottomLeftCorner<3, 3>() = -cross_matrix(arm_of_pin(cell)) * R;
    else
        basis.bottomRightCorner<3, 3>() = R;
    return basis;
}

void CellState::move(const Eigen::VectorXd& step, double length)
{
    parallel_for(
        cell_of_unknown_.size(), kSmallBodies,
        [&](std::size_t u)
        {
            const std::size_t cell = idx(cell_of_unknown_[u]);
            const Eigen::Matrix3d& R = base_[cell].R;
            const double* const x = step.data() + first_[u];
            Twist twist = Twist::Zero();
            twist.head<3>() = length * (R * Eigen::Map<const Eigen::Vector3d>(x));
            if (sizes_[u] == 6)
                twist.tail<3>() = length * (R * Eigen::Map<const Eigen::Vector3d>(x + 3));
            poses_[cell] = has_rigid_steps_ ? moved(base_[cell], twist)
                                            : shape_matched(base_[cell], twist);
            if (sizes_[u] == 3)
                poses_[cell] =
                    held_at_pin(poses_[cell], constraints_[cell], centres_[cell]);
        });
}

void CellState::settle()
{
    std::copy(poses_.begin(), poses_.end(), base_.begin());
}

std::vector<GridPlace> grid_places(const CellState& state, const Cells& cells)
{
    std::vector<GridPlace> places;
    for (int u = 0; u < state.num_unknown_cells(); ++u)
        places.push_back(grid_place(cells, state.cell_of_unknown(u)));
    return places;
}

} // namespace cellwarp
