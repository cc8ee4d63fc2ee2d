// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/cells/glue_block.h"

#include <cmath>

namespace cellwarp::core
{

namespace
{

/// What rounding leaves of numbers that cancel, relative to the block.
constexpr double kRounding = 1e-10;

/// The a of A = [a]x, where it has that form.
Eigen::Vector3d arm_of(const Eigen::Matrix3d& A)
{
    return 0.5 * Eigen::Vector3d(A(2, 1) - A(1, 2), A(0, 2) - A(2, 0), A(1, 0) - A(0, 1));
}

} // namespace

Matrix6 GlueBlock::matrix() const
{
    Matrix6 M;
    M.topLeftCorner<3, 3>() = turn;
    M.topRightCorner<3, 3>() = cross_matrix(row_arm);
    M.bottomLeftCorner<3, 3>() = cross_matrix(column_arm);
    M.bottomRightCorner<3, 3>() = shift * Eigen::Matrix3d::Identity();
    return M;
}

GlueBlock& GlueBlock::operator+=(const GlueBlock& other)
{
    turn += other.turn;
    row_arm += other.row_arm;
    column_arm += other.column_arm;
    shift += other.shift;
    return *this;
}

std::optional<GlueBlock> as_glue(const Matrix6& block)
{
    GlueBlock glue;
    glue.turn = block.topLeftCorner<3, 3>();
    const Eigen::Matrix3d of_row = block.topRightCorner<3, 3>();
    const Eigen::Matrix3d of_column = block.bottomLeftCorner<3, 3>();
    const Eigen::Matrix3d shift = block.bottomRightCorner<3, 3>();
    glue.row_arm = arm_of(of_row);
    glue.column_arm = arm_of(of_column);
    glue.shift = shift.trace() / 3.0;
    // Arms may cancel: the block's other numbers tell what is little.
    const double mixed = std::sqrt(glue.turn.norm() * shift.norm());
    const auto is_rounding = [](const Eigen::Matrix3d& difference, double of)
    { return difference.norm() <= kRounding * of; };
    if (is_rounding(of_row - cross_matrix(glue.row_arm), mixed + of_row.norm()) &&
        is_rounding(of_column - cross_matrix(glue.column_arm),
                    mixed + of_column.norm()) &&
        is_rounding(shift - glue.shift * Eigen::Matrix3d::Identity(), shift.norm()))
        return glue;
    return std::nullopt;
}

} // namespace cellwarp::core
