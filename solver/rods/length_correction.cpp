// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/rods/length_correction.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "solver/rods/elasticity.h"

namespace cellwarp::core
{

LengthCorrection::LengthCorrection(const Rod& rod)
    : elasticity_(exact_elasticity(rod)),
      matrix_(rod.layout().num_unknowns, rod.layout().half_band)
{
}

void LengthCorrection::factorize(const RodState& base,
                                 std::span<const RodConstraint> holds)
{
    matrix_.set_zero();
    elasticity_->add_hessian(base, RodHessian::Definite, matrix_);
    // Unknowns that nothing holds stay.
    constexpr double kStay = 1e-9; // of the largest
    double largest = 0.0;
    for (int k = 0; k < matrix_.rows(); ++k)
        largest = std::max(largest, matrix_.lower(k, k));
    for (int k = 0; k < matrix_.rows(); ++k)
        matrix_.lower(k, k) += kStay * largest;
    std::vector<SparseRow> rows;
    std::vector<int> groups;
    for (const RodConstraint& hold : holds)
    {
        std::vector<ConstraintRow> of_hold =
            rows_of(hold, base, HeldBasis(hold, base.rod().basis()));
        groups.push_back(static_cast<int>(of_hold.size()));
        for (ConstraintRow& row : of_hold)
            rows.push_back(std::move(row.entries));
    }
    num_rows_ = static_cast<Eigen::Index>(rows.size());
    solver_.factorize(matrix_, rows, groups);
    is_of_base_ = true;
}

void LengthCorrection::correct(const RodState& base, std::span<const RodConstraint> holds,
                               const Eigen::VectorXd& step, RodState& moved)
{
    if (!is_of_base_)
        factorize(base, holds);
    Eigen::VectorXd back = Eigen::VectorXd::Zero(step.size()),
                    none = Eigen::VectorXd::Zero(num_rows_);
    elasticity_->add_correction(base, moved, step, back);
    solver_.solve(back, none);
    if (back.allFinite())
        moved.move(back);
}

} // namespace cellwarp::core
