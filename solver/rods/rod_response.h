// SPDX-License-Identifier: GPL-3.0-or-later
// What forces along rows of constraints do to a rod.
#pragma once

#include <memory>
#include <vector>

#include <Eigen/Core>

#include "solver/rods/rod_model.h"

namespace cellwarp
{

/// How a rod moves where forces act along rows of constraints: by a dense system of as
/// many unknowns as there are rows, and where they are many by rows in the band of the
/// mass.
class RodResponse
{
public:
    RodResponse(const RodModel& model, const RodModel::Rows& of, int most_dense = 100);

    bool is_for(const std::vector<SparseRow>& rows) const { return rows_ == rows; }
    /// Some rows say nothing new.
    bool is_redundant() const { return is_redundant_; }
    /// L v
    Eigen::VectorXd along(const Eigen::VectorXd& v) const;
    /// The least x in the mass with L x = \p wanted, or what is nearest to it.
    Eigen::VectorXd change(const Eigen::VectorXd& wanted) const;
    /// Takes off v what L v is, by the least change in the mass.
    void project(Eigen::VectorXd& v) const { v -= change(along(v)); }

private:
    std::vector<SparseRow> rows_;
    int num_unknowns_ = 0;
    bool is_redundant_ = false;
    Eigen::MatrixXd moved_;   ///< M^-1 L^T, a column a row
    Eigen::MatrixXd inverse_; ///< of L M^-1 L^T, of least norm where rows are redundant
    std::unique_ptr<SaddleSolver> band_;
};

} // namespace cellwarp
