// SPDX-License-Identifier: GPL-3.0-or-later
// The glue of all cells as one term of an energy.
#pragma once

#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "solver/cells/cell_state.h"
#include "solver/cells/constraints.h"
#include "solver/cells/glue.h"
#include "solver/minimize/term.h"

namespace cellwarp::core
{

/// A function of the poses of the cells. Keeps a copy of the glue and all scratch:
/// nothing is allocated after construction. One object serves one thread.
class GlueTerm final : public Term
{
public:
    /// \p state must outlive it; \p components from find_components().
    GlueTerm(const CellState& state, const Glue& glue,
             std::span<const Component> components);

    const Glue& glue() const { return glue_; }
    /// The twists that the unknowns of a cell make, as far as its curve lets them; as
    /// linearised.
    CellState::Basis basis(UnknownCell unknown) const;
    /// Norm of the pair forces on the unknown cells, each cell's added as lengths.
    double uncancelled() const;

    std::span<const std::pair<int, int>> pairs() const override { return pairs_; }
    double value() const override;
    void add_gradient(Eigen::VectorXd& out) const override;
    void add_rounding(std::span<double> out) const override;
    void linearise(Curvature curvature) override;
    void add_product(const Eigen::VectorXd& x, Eigen::VectorXd& y) const override;
    void add_diagonal_block(int block, Eigen::Ref<Eigen::MatrixXd> out) const override;
    void add_pair_block(int pair, Eigen::Ref<Eigen::MatrixXd> out) const override;

private:
    /// One of a cell's faces.
    struct Side
    {
        int face = 0, other = 0; ///< the cell beyond it
        bool is_a = false;       ///< the cell is, of the face
    };
    std::span<const Side> sides_of(int cell) const;
    void find_face_gradients() const;
    bool is_stopped(UnknownCell unknown, const Twist& gradient) const;
    void find_sliding(UnknownCell unknown, Curvature curvature);

    const CellState& state_;
    Glue glue_;
    std::vector<Side> sides_;        ///< as glue_.faces_of_cell
    std::vector<bool> turns_freely_; ///< unknown cells that a proximal term holds
    std::vector<std::pair<int, int>> pairs_;
    /// Faces of the k-th pair are those from first_of_pair_[k] on.
    std::vector<int> first_of_pair_, faces_of_pair_;
    // Of the last linearise(): world axes, one an unknown cell and one a face.
    std::vector<GlueBlock> diagonals_, couplings_;
    std::vector<double> proximal_;
    /// What the curve of a sliding cell adds.
    struct Sliding
    {
        bool is_stopped = false;                        ///< at an end: it only turns
        double stiffness = 0.0;                         ///< of its way along the curve
        Eigen::Vector3d turn = Eigen::Vector3d::Zero(); ///< of its way and its turn
    };
    std::vector<Sliding> sliding_; ///< a cell that is unknown; empty: none slides
    /// Its turn's part in the k-th of the unknowns that turn the cell.
    double turn_of_slide(UnknownCell unknown, int k) const
    {
        const int axis = state_.flat_axis(unknown);
        return sliding_[idx(unknown)].turn[axis < 0 ? k : axis];
    }
    // Scratch.
    mutable std::vector<double> face_values_;
    mutable std::vector<Eigen::Matrix<double, 12, 1>> face_gradients_;
    mutable std::vector<Twist> twists_; ///< a cell, world axes; 0 where known
};

} // namespace cellwarp::core
