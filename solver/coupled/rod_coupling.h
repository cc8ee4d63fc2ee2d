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

namespace cellwarp
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
    int rod_of(int block) const { return block - rods_.begin().block; }
    SparseMatrix elastic(RodHessian how) const;

    const CellState& cells_;
    const GlueTerm& glue_;
    const RodUnknowns& rods_;
    std::vector<int> carried_; ///< of the cells: number among those carried, or -1
    std::vector<const GlueFace*> faces_; ///< of carried cells
    std::vector<std::unique_ptr<RodModel>> models_;
    std::vector<std::pair<int, int>> pairs_;
    // Of the last linearise().
    SparseMatrix among_rods_; ///< unknowns of all rods
    SparseMatrix with_cells_; ///< rows: unknowns of all rods; columns: of the cells
};

} // namespace cellwarp
