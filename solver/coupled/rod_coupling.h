// SPDX-License-Identifier: GPL-3.0-or-later
// Rods and the glue of the cells that they carry, as a term of an energy.
#pragma once

#include <memory>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "solver/cells/glue_term.h"
#include "solver/coupled/rod_unknowns.h"
#include "solver/linear/band_matrix.h"
#include "solver/minimize/term.h"
#include "solver/rods/rod_model.h"

namespace cellwarp::core
{

/// The energy of the rods' stretch, bending and twist; and what the term of the glue,
/// which takes the poses of carried cells for given, leaves out: the derivatives of its
/// energy by the unknowns of the rods. Second derivatives are J^T H J, H those of the
/// glue by the twists of carried cells. [theory-rods (37)]
class RodCoupling final : public Term
{
public:
    /// All must outlive it.
    RodCoupling(const CellState& cells, const GlueTerm& glue, const RodUnknowns& rods);

    /// Of control points and angles of all rods, before the holds.
    Eigen::VectorXd gradient_by_steps() const;

    std::span<const std::pair<int, int>> pairs() const override { return pairs_; }
    double value() const override;
    void add_gradient(Eigen::VectorXd& out) const override;
    void add_rounding(std::span<double> out) const override;
    void linearise(Curvature curvature) override;
    void add_product(const Eigen::VectorXd& x, Eigen::VectorXd& y) const override;
    void add_diagonal_block(int block, Eigen::Ref<Eigen::MatrixXd> out) const override;
    void add_pair_block(int pair, Eigen::Ref<Eigen::MatrixXd> out) const override;

private:
    /// The glue between a carried cell and another, which may be carried as well.
    struct Face
    {
        const GlueFace* glue = nullptr;
        int a = -1, b = -1;                      ///< number among the carried ones, or -1
        UnknownCell unknown = UnknownCell::None; ///< of the other one, if that is unknown
        Eigen::Matrix<double, 6, 6> coupling =
            Eigen::Matrix<double, 6, 6>::Zero(); ///< rows of a, columns of b
        CellState::Basis basis;                  ///< of the unknown cell
    };

    using Entries = std::vector<Eigen::Triplet<double>>;

    int rod_of(int block) const { return block - rods_.begin().block; }
    const CarriedTwist& twist(int carried) const { return rods_.twists()[idx(carried)]; }
    void add_back(Eigen::VectorXd& by_steps) const;
    void add_between(const CarriedTwist& row, const Eigen::Matrix<double, 6, 6>& H,
                     const CarriedTwist& column, int first, int first_column,
                     Entries& out) const;
    Eigen::SparseMatrix<double> steps_of(std::size_t rod) const;

    const CellState& cells_;
    const GlueTerm& glue_;
    const RodUnknowns& rods_;
    std::vector<std::unique_ptr<RodModel>> models_;
    std::vector<std::size_t> rod_of_carried_;
    std::vector<Face> faces_;
    std::vector<std::pair<int, int>> pairs_;
    std::vector<std::vector<int>> faces_of_pair_;
    // Of the last linearise().
    std::vector<Eigen::Matrix<double, 6, 6>> diagonals_; ///< a carried cell, its twist
    std::vector<BandMatrix> elastic_;                    ///< a rod, its stiffness in it
    double idle_ = 1.0; ///< of what holds have taken, which does nothing
    // Scratch.
    mutable std::vector<Twist> twists_, forces_; ///< a carried cell
    mutable Eigen::VectorXd steps_, own_steps_, by_steps_, part_;
};

} // namespace cellwarp::core
