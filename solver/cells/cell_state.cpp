// SPDX-License-Identifier: GPL-3.0-or-later
// Unknowns are twists about the current centres in the cell's own axes: 6 numbers x for a
// free cell, whose twist in world axes is (R x_angular, R x_linear). In these axes the
// second derivatives hardly change when a part of the body turns, so what was prepared at
// rest stays a good preconditioner.
// A pinned cell, whose held point is at X, has 3 unknowns omega: with q = p - X the
// centre follows,
//   p' = X + rot(R omega) q = p + (R omega) x q + ...,
// which is a twist with v = (R omega) x q: its gradient is R^T (g_omega + q x g_v).
// A sliding cell, whose held point X = P(s) stays on a curve, has one unknown more, the
// way d along the curve: v = (R omega) x q + tau d, tau = P' / |P'|, and s changes by
// d / |P'|. No multiplier is needed: the curve's force is what is left of the gradient.
// A twist of these is made as
//   p' = p + v + 1/2 omega x v + ...,    but    p' = P(s + ds) + rot(omega) q
//      = p + v + 1/2 omega x (omega x q) + 1/2 kappa d^2 + ...,  kappa = P'' / |P'|^2,
// so the second derivatives have, beside those of twists, f . kappa of (d, d) and
// -1/2 tau x f of (omega, d), f the derivative by p. [theory-rods (38)]
// A flat cell turns about one axis n of its own, which is also the world's, and shifts
// across it: of omega only the part along n is unknown, of v only what is across it.
#include "solver/cells/cell_state.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Geometry>

#include "octree/base/index.h"
#include "octree/base/parallel.h"

namespace cellwarp::core
{

namespace
{

/// Takes away what rounding has turned or shifted out of the plane.
void flatten(Pose& pose, int axis, double height)
{
    pose.R.row(axis) = Eigen::RowVector3d::Unit(axis);
    pose.R.col(axis) = Eigen::Vector3d::Unit(axis);
    pose.p[axis] = height;
}

} // namespace

CellState::CellState(const Cells& cells, std::span<const Constraint> constraints,
                     bool has_rigid_steps, UnknownPlace begin)
    : State(begin), has_rigid_steps_(has_rigid_steps),
      constraints_(constraints.begin(), constraints.end())
{
    int next = begin.unknown;
    for (std::size_t i = 0; i < cells.size(); ++i)
    {
        centres_.push_back(cells.cells[i].centre);
        edges_.push_back(cells.cells[i].edge);
        poses_.push_back({Eigen::Matrix3d::Identity(), centres_[i]});
        const Hold hold = constraints_[i].hold;
        const bool is_unknown =
            hold == Hold::Free || hold == Hold::Pinned || hold == Hold::Sliding ||
            (hold == Hold::Grouped && constraints_[i].leader == static_cast<int>(i));
        unknown_of_cell_.push_back(is_unknown
                                       ? static_cast<UnknownCell>(num_unknown_cells())
                                       : UnknownCell::None);
        if (!is_unknown)
            continue;
        cell_of_unknown_.push_back(static_cast<int>(i));
        const bool is_flat = constraints_[i].flat_axis >= 0;
        const int turns = is_flat ? 1 : 3;
        sizes_.push_back(hold == Hold::Free      ? turns + (is_flat ? 2 : 3)
                         : hold == Hold::Sliding ? turns + 1
                                                 : turns);
        first_.push_back(next);
        next += sizes_.back();
        constraints_[i].held_now = constraints_[i].held_rest;
    }
    base_ = poses_;
    if (std::any_of(constraints_.begin(), constraints_.end(),
                    [](const Constraint& c) { return c.hold == Hold::Sliding; }))
    {
        along_.assign(sizes_.size(), Eigen::Vector3d::UnitX());
        bend_.assign(sizes_.size(), Eigen::Vector3d::Zero());
        speed_.assign(sizes_.size(), 1.0);
        base_s_.assign(sizes_.size(), 0.0);
        base_speed_ = speed_;
    }
}

/// The curve of a sliding cell where it is now.
void CellState::find_rail(UnknownCell unknown)
{
    Constraint& constraint = constraints_[idx(cell_of_unknown(unknown))];
    if (!constraint.rail)
        return;
    const RailPlace rail = constraint.rail->at(constraint.s);
    constraint.held_now = rail.place;
    const double speed = rail.first.norm();
    // A cusp has no direction: there it only turns.
    const std::size_t u = idx(unknown);
    speed_[u] = speed > 0.0 ? speed : INFINITY;
    along_[u] = rail.first / speed_[u];
    bend_[u] = rail.second / (speed_[u] * speed_[u]);
}

bool CellState::is_stopped(UnknownCell unknown, double force) const
{
    const Constraint& now = constraint(cell_of_unknown(unknown));
    if (!now.rail || now.rail->is_closed())
        return false;
    return (now.s <= now.rail->begin() && force < 0.0) ||
           (now.s >= now.rail->end() && force > 0.0);
}

void CellState::set_poses(std::span<const Pose> poses)
{
    std::copy(poses.begin(), poses.end(), poses_.begin());
    settle();
}

void CellState::set_held_points(std::span<const Constraint> constraints)
{
    for (std::size_t i = 0; i < constraints_.size(); ++i)
    {
        constraints_[i].held_now = constraints[i].held_now;
        constraints_[i].rail = constraints[i].rail;
        constraints_[i].s = constraints[i].s;
    }
    for (std::size_t u = 0; u < along_.size(); ++u)
        if (is_sliding(UnknownCell(u)))
        {
            find_rail(UnknownCell(u));
            base_s_[u] = constraints_[idx(cell_of_unknown_[u])].s;
            base_speed_[u] = speed_[u];
        }
}

CellState::Basis CellState::basis(UnknownCell unknown) const
{
    const int cell = cell_of_unknown(unknown);
    const Eigen::Matrix3d& R = pose(cell).R;
    const int axis = flat_axis(unknown), turns = num_turns(unknown);
    Basis basis = Basis::Zero(6, sizes_[idx(unknown)]);
    for (int k = 0; k < turns; ++k)
        basis.col(k).head<3>() = R.col(axis < 0 ? k : axis);
    if (is_pinned(unknown) || is_sliding(unknown))
    {
        const Eigen::Vector3d arm = arm_of_pin(cell);
        for (int k = 0; k < turns; ++k)
            basis.col(k).tail<3>() = basis.col(k).head<3>().cross(arm);
        if (is_sliding(unknown))
            basis.col(turns).tail<3>() = along(unknown);
    }
    else
        for (int k = turns; k < basis.cols(); ++k)
            basis.col(k).tail<3>() = R.col(axis < 0 ? k - 3 : (axis + k) % 3);
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
            const Hold hold = constraints_[cell].hold;
            const int axis = constraints_[cell].flat_axis;
            Twist twist = Twist::Zero();
            if (axis < 0)
            {
                twist.head<3>() = length * (R * Eigen::Map<const Eigen::Vector3d>(x));
                if (hold == Hold::Free)
                    twist.tail<3>() =
                        length * (R * Eigen::Map<const Eigen::Vector3d>(x + 3));
            }
            else
            {
                twist[axis] = length * x[0];
                if (hold == Hold::Free)
                    twist.tail<3>() = length * (x[1] * R.col((axis + 1) % 3) +
                                                x[2] * R.col((axis + 2) % 3));
            }
            poses_[cell] = has_rigid_steps_ ? moved(base_[cell], twist)
                                            : shape_matched(base_[cell], twist);
            if (axis >= 0)
                flatten(poses_[cell], axis, base_[cell].p[axis]);
            if (hold == Hold::Sliding && constraints_[cell].rail)
            {
                const Rail& rail = *constraints_[cell].rail;
                const double s =
                    base_s_[u] + length * x[axis < 0 ? 3 : 1] / base_speed_[u];
                constraints_[cell].s =
                    rail.is_closed() ? s : std::clamp(s, rail.begin(), rail.end());
                find_rail(UnknownCell(u));
            }
            if (hold != Hold::Free)
                poses_[cell] =
                    held_at_pin(poses_[cell], constraints_[cell], centres_[cell]);
        });
}

void CellState::settle()
{
    std::copy(poses_.begin(), poses_.end(), base_.begin());
    for (std::size_t u = 0; u < base_s_.size(); ++u)
    {
        base_s_[u] = constraints_[idx(cell_of_unknown_[u])].s;
        base_speed_[u] = speed_[u];
    }
}

/// A corner of a cell is sqrt(3)/2 edges away from its centre, and a turn by a moves it
/// by 2 sin(a/2) times that at most; |R - R'| is sqrt(8) sin(a/2).
double CellState::largest_move() const
{
    constexpr double kCorner = 0.61237243569579447; // sqrt(3) / sqrt(8)
    constexpr std::size_t kParts = 64;
    std::array<double, kParts> largest{};
    parallel_for(kParts,
                 [&](std::size_t part)
                 {
                     const std::size_t end = poses_.size() * (part + 1) / kParts;
                     for (std::size_t c = poses_.size() * part / kParts; c < end; ++c)
                         largest[part] = std::max(
                             largest[part],
                             (poses_[c].p - base_[c].p).norm() +
                                 kCorner * edges_[c] * (poses_[c].R - base_[c].R).norm());
                 });
    return *std::max_element(largest.begin(), largest.end());
}

std::vector<UnknownBody> unknown_bodies(const CellState& state,
                                        std::span<const GridPlace> places)
{
    std::vector<UnknownBody> bodies;
    for (const UnknownCell u : state.unknown_cells())
    {
        const int cell = state.cell_of_unknown(u);
        const Pose& pose = state.pose(cell);
        UnknownBody& body = bodies.emplace_back();
        body.block = state.block(u);
        const int axis = state.flat_axis(u);
        body.turns = state.num_turns(u);
        if (axis < 0)
            body.turn = pose.R;
        else
            body.turn.col(0) = pose.R.col(axis);
        body.centre = pose.p;
        body.grid = places[idx(cell)];
        if (state.is_sliding(u))
        {
            body.shifts = 1;
            body.shift.col(0) = state.along(u);
            body.centre = state.constraint(cell).held_now;
        }
        else if (state.constraint(cell).hold == Hold::Grouped)
            body.centre = state.constraint(cell).held_now;
        else if (!state.is_pinned(u) && axis < 0)
        {
            body.shifts = 3;
            body.shift = pose.R;
        }
        else if (!state.is_pinned(u))
        {
            body.shifts = 2;
            for (int k = 0; k < 2; ++k)
                body.shift.col(k) = pose.R.col((axis + k + 1) % 3);
        }
    }
    return bodies;
}

} // namespace cellwarp::core
