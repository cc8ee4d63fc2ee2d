// SPDX-License-Identifier: GPL-3.0-or-later
// What forces along rows of constraints do to a rod.
#pragma once

#include <memory>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "solver/rods/rod_model.h"

namespace cellwarp::core
{

/// How a rod moves where forces act along rows of constraints: by a dense system of as
/// many unknowns as there are rows, and where they are many by rows in the band of the
/// mass. [Lenoir04]
class RodResponse
{
public:
    /// \p of: rows of the rod's own unknowns; what slides in them is left out.
    RodResponse(const RodModel& model, const RodModel::Rows& of, int most_dense = 100);

    bool is_for(const std::vector<SparseRow>& rows) const { return rows_ == rows; }
    /// Some rows say nothing new.
    bool is_redundant() const { return is_redundant_; }
    /// L v
    Eigen::VectorXd along(const Eigen::VectorXd& v) const;
    /// The least x in the mass with L x = \p wanted, or what is nearest to it.
    Eigen::VectorXd change(const Eigen::VectorXd& wanted) const;
    /// The forces along the rows that make it: (L M^-1 L^T)^-1 wanted.
    Eigen::VectorXd forces(const Eigen::VectorXd& wanted) const;

private:
    void find_moved(const RodModel& model);

    std::vector<SparseRow> rows_;
    int num_unknowns_ = 0;
    bool is_redundant_ = false;
    Eigen::MatrixXd moved_;               ///< M^-1 L^T, a column a row
    Eigen::LDLT<Eigen::MatrixXd> factor_; ///< of L M^-1 L^T
    Eigen::MatrixXd inverse_;             ///< of least norm, where rows are redundant
    std::unique_ptr<SaddleSolver> band_;
};

} // namespace cellwarp::core
