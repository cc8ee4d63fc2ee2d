// SPDX-License-Identifier: GPL-3.0-or-later
// The state of cells: where each one is, and how a step moves those that may move.
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/base/index.h"
#include "octree/base/rigid_motion.h"
#include "octree/cells.h"
#include "solver/cells/constraints.h"
#include "solver/cells/unknown_body.h"
#include "solver/minimize/state.h"

namespace cellwarp::core
{

/// The number of a cell among the unknown ones; its block among those of the state.
enum class UnknownCell : int
{
    None = -1 ///< its pose is given
};

/// The poses of all cells, of which the free, the pinned and the sliding ones are
/// unknown: blocks of 6, of 3 and of 4 (flat ones: of 3, of 1 and of 2), in the order of
/// the cells. Of a group the leader is, as if it were pinned; the others are not moved.
/// cell_state.cpp says what the unknowns are. Nothing is allocated after construction.
class CellState final : public State
{
public:
    /// Columns: the twists, in world axes, that the unknowns of a cell make.
    using Basis = Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, 6>;

    /// At rest. \p has_rigid_steps: see Departures; second derivatives are those of rigid
    /// steps, which at a minimum is one.
    CellState(const Cells& cells, std::span<const Constraint> constraints,
              bool has_rigid_steps = true, UnknownPlace begin = {});

    const std::vector<Pose>& poses() const { return poses_; }
    const Pose& pose(int cell) const { return poses_[idx(cell)]; }
    /// Current and base state.
    void set_poses(std::span<const Pose> poses);
    /// Moves a cell that is not unknown; the base stays.
    void place(int cell, const Pose& pose) { poses_[idx(cell)] = pose; }
    /// Where the held points of pinned cells, and the curves of sliding ones, are to be
    /// from now on.
    void set_held_points(std::span<const Constraint> constraints);
    /// What holds a cell, and where.
    const Constraint& constraint(int cell) const { return constraints_[idx(cell)]; }

    int num_cells() const { return static_cast<int>(poses_.size()); }
    std::size_t num_unknown_cells() const { return cell_of_unknown_.size(); }
    auto unknown_cells() const { return numbers_below<UnknownCell>(num_unknown_cells()); }
    int cell_of_unknown(UnknownCell unknown) const
    {
        return cell_of_unknown_[idx(unknown)];
    }
    UnknownCell unknown_of_cell(int cell) const { return unknown_of_cell_[idx(cell)]; }
    /// Among the blocks of all states.
    int block(UnknownCell unknown) const
    {
        return begin().block + static_cast<int>(unknown);
    }
    /// None for a block of another state.
    UnknownCell unknown_of_block(int block) const
    {
        const int own = block - begin().block;
        return own >= 0 && idx(own) < num_unknown_cells() ? UnknownCell{own}
                                                          : UnknownCell::None;
    }
    /// Or the leader of a group.
    bool is_pinned(UnknownCell unknown) const
    {
        const Hold hold = hold_of(unknown);
        return hold == Hold::Pinned || hold == Hold::Grouped;
    }
    bool is_sliding(UnknownCell unknown) const
    {
        return hold_of(unknown) == Hold::Sliding;
    }
    /// Across the plane that it stays in; -1: it moves in space.
    int flat_axis(UnknownCell unknown) const
    {
        return constraints_[idx(cell_of_unknown(unknown))].flat_axis;
    }
    /// Of its unknowns those that turn it, which come first.
    int num_turns(UnknownCell unknown) const { return flat_axis(unknown) < 0 ? 3 : 1; }
    /// Of a sliding cell: the direction of its curve, and the change of that along it
    /// [1 / length].
    const Eigen::Vector3d& along(UnknownCell unknown) const
    {
        return along_[idx(unknown)];
    }
    Eigen::Vector3d bend(UnknownCell unknown) const { return bend_[idx(unknown)]; }
    /// Whether a force along its curve, positive towards larger parameters, would take it
    /// over an end.
    bool is_stopped(UnknownCell unknown, double force) const;
    /// Where its numbers begin among those of all states.
    int first(UnknownCell unknown) const { return first_[idx(unknown)]; }

    /// The twist in world axes that the unknowns at \p x make.
    Twist world(UnknownCell unknown, const double* x) const;
    /// To the derivatives in the unknowns at \p y: those in the twist.
    void add_body(UnknownCell unknown, const Twist& twist, double* y) const;
    Basis basis(UnknownCell unknown) const;

    std::span<const int> block_sizes() const override { return sizes_; }
    void move(const Eigen::VectorXd& step, double length) override;
    void settle() override;
    double largest_move() const override;

private:
    Hold hold_of(UnknownCell unknown) const
    {
        return constraints_[idx(cell_of_unknown(unknown))].hold;
    }
    void find_rail(UnknownCell unknown);

    /// From the held point of a pinned or sliding cell to its centre, now.
    Eigen::Vector3d arm_of_pin(int cell) const
    {
        const std::size_t c = idx(cell);
        return poses_[c].p - constraints_[c].held_now;
    }

    bool has_rigid_steps_;
    std::vector<Eigen::Vector3d> centres_;
    std::vector<double> edges_; ///< of the cells
    std::vector<Constraint> constraints_;
    std::vector<UnknownCell> unknown_of_cell_;
    std::vector<int> cell_of_unknown_;
    std::vector<int> sizes_, first_; ///< of the unknowns
    std::vector<Pose> poses_, base_;
    // Of the unknowns, where some slide; else empty.
    std::vector<Eigen::Vector3d> along_, bend_;
    std::vector<double> speed_;               ///< |dP/ds|
    std::vector<double> base_s_, base_speed_; ///< of the base
};

inline Twist CellState::world(UnknownCell unknown, const double* x) const
{
    const int cell = cell_of_unknown(unknown);
    const Eigen::Matrix3d& R = pose(cell).R;
    const int axis = flat_axis(unknown);
    Twist twist;
    if (axis < 0)
        twist.head<3>() = R * Eigen::Map<const Eigen::Vector3d>(x);
    else
        twist.head<3>() = x[0] * R.col(axis);
    if (is_pinned(unknown))
        twist.tail<3>() = twist.head<3>().cross(arm_of_pin(cell));
    else if (is_sliding(unknown))
        twist.tail<3>() = twist.head<3>().cross(arm_of_pin(cell)) +
                          x[num_turns(unknown)] * along(unknown);
    else if (axis < 0)
        twist.tail<3>() = R * Eigen::Map<const Eigen::Vector3d>(x + 3);
    else
        twist.tail<3>() = x[1] * R.col((axis + 1) % 3) + x[2] * R.col((axis + 2) % 3);
    return twist;
}

inline void CellState::add_body(UnknownCell unknown, const Twist& twist, double* y) const
{
    const int cell = cell_of_unknown(unknown);
    const Eigen::Matrix3d& R = pose(cell).R;
    const int axis = flat_axis(unknown);
    if (is_pinned(unknown) || is_sliding(unknown))
    {
        const Eigen::Vector3d turn =
            twist.head<3>() + arm_of_pin(cell).cross(twist.tail<3>());
        if (axis < 0)
            Eigen::Map<Eigen::Vector3d>(y) += R.transpose() * turn;
        else
            y[0] += R.col(axis).dot(turn);
        if (is_sliding(unknown))
            y[num_turns(unknown)] += along(unknown).dot(twist.tail<3>());
    }
    else if (axis < 0)
    {
        Eigen::Map<Eigen::Vector3d>(y).noalias() += R.transpose() * twist.head<3>();
        Eigen::Map<Eigen::Vector3d>(y + 3).noalias() += R.transpose() * twist.tail<3>();
    }
    else
    {
        y[0] += R.col(axis).dot(twist.head<3>());
        y[1] += R.col((axis + 1) % 3).dot(twist.tail<3>());
        y[2] += R.col((axis + 2) % 3).dot(twist.tail<3>());
    }
}

/// The unknown cells as they are now, each the body of a block; what slides is where it
/// is held. \p places: of all cells.
std::vector<UnknownBody> unknown_bodies(const CellState& state,
                                        std::span<const GridPlace> places);

} // namespace cellwarp::core
