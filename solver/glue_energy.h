// SPDX-License-Identifier: GPL-3.0-or-later
// The glue of all cells as one energy of the cells that may move: free and pinned ones.
#pragma once

#include <span>
#include <vector>

#include "octree/cells.h"
#include "solver/constraints.h"
#include "solver/energy.h"
#include "solver/glue.h"
#include "solver/pose.h"

namespace cellwarp
{

/// The state is the poses of all cells. Keeps copies of what it needs and all scratch:
/// nothing is allocated after construction.
class GlueEnergy final : public Energy
{
public:
    /// \p components from find_components(). The state is rest. \p has_rigid_steps: see
    /// Departures; second derivatives are those of rigid steps, which at a minimum is
    /// one.
    GlueEnergy(const Cells& cells, const Glue& glue,
               std::span<const Constraint> constraints,
               std::span<const Component> components, bool has_rigid_steps = true);

    const std::vector<Pose>& poses() const { return poses_; }
    /// Those of the unknown cells, in their order.
    std::vector<Pose> unknown_poses() const;
    /// Current and base state.
    void set_poses(std::span<const Pose> poses);
    /// Where the held points of pinned cells are to be from now on.
    void set_held_points(std::span<const Constraint> constraints);

    int num_unknown_cells() const { return static_cast<int>(cell_of_unknown_.size()); }
    int cell_of_unknown(int unknown) const { return at(cell_of_unknown_, unknown); }
    /// Norm of the pair forces on the unknown cells, each cell's added as lengths.
    double uncancelled() const;

    std::span<const int> block_sizes() const override { return sizes_; }
    std::span<const std::pair<int, int>> pairs() const override { return pairs_; }
    double value() const override;
    void gradient(Eigen::VectorXd& out) const override;
    void rounding(std::span<double> out) const override;
    void linearise(Curvature curvature) override;
    void multiply(const Eigen::VectorXd& x, Eigen::VectorXd& y) const override;
    void diagonal_block(int block, Eigen::Ref<Eigen::MatrixXd> out) const override;
    void pair_block(int pair, Eigen::Ref<Eigen::MatrixXd> out) const override;
    void move(const Eigen::VectorXd& step, double length) override;
    void settle() override;

private:
    /// Columns: the twists, in world axes, that the unknowns of a cell make.
    using Basis = Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, 6>;

    static int at(const std::vector<int>& v, int i)
    {
        return v[static_cast<std::size_t>(i)];
    }
    bool is_pinned(int unknown) const { return at(sizes_, unknown) == 3; }
    /// From the held point of a pinned cell to its centre, now.
    Eigen::Vector3d arm_of_pin(int cell) const;
    Twist world(int unknown, const double* x) const;
    void add_body(int unknown, const Twist& twist, double* y) const;
    Basis basis(int unknown) const;
    std::span<const int> faces_of(int cell) const;
    void find_face_gradients() const;

    Glue glue_;
    bool has_rigid_steps_;
    std::vector<Eigen::Vector3d> centres_;
    std::vector<Constraint> constraints_;
    std::vector<int> unknown_of_cell_; ///< -1 where there is none
    std::vector<int> cell_of_unknown_;
    std::vector<int> sizes_, first_; ///< of the unknowns
    std::vector<bool> turns_freely_; ///< unknowns that a proximal term holds
    std::vector<std::pair<int, int>> pairs_;
    std::vector<int> face_of_pair_;
    std::vector<Pose> poses_, base_;
    // Of the last linearise(): world axes, one an unknown and one a face.
    std::vector<Eigen::Matrix<double, 6, 6>> diagonals_;
    std::vector<GlueCoupling> couplings_;
    std::vector<double> proximal_;
    // Scratch.
    mutable std::vector<double> face_values_;
    mutable std::vector<Eigen::Matrix<double, 12, 1>> face_gradients_;
    mutable std::vector<Twist> twists_; ///< a cell, world axes; 0 where known
};

} // namespace cellwarp
