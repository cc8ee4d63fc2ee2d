// SPDX-License-Identifier: GPL-3.0-or-later
// What glue couples two rigid bodies by, or one with itself.
#pragma once

#include <optional>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "octree/base/rigid_motion.h"

namespace cellwarp::core
{

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

/// A block of second derivatives in twists, turns before shifts, of the form that glue
/// has between cells and between groups of cells that are moved rigidly; [a]x is
/// cross_matrix(a):
///   turn            [row_arm]x
///   [column_arm]x   shift I
/// Of its 36 numbers 16 differ: products take as long as it takes to read the blocks.
struct GlueBlock
{
    Eigen::Matrix3d turn;
    Eigen::Vector3d row_arm, column_arm;
    double shift;

    GlueBlock() {} ///< its numbers are not set: there are many blocks
    GlueBlock(const Eigen::Matrix3d& of_turns, const Eigen::Vector3d& of_row,
              const Eigen::Vector3d& of_column, double of_shifts)
        : turn(of_turns), row_arm(of_row), column_arm(of_column), shift(of_shifts)
    {
    }
    static GlueBlock zero()
    {
        return {Eigen::Matrix3d::Zero(), Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(),
                0.0};
    }

    Matrix6 matrix() const;
    GlueBlock transposed() const
    {
        return {turn.transpose(), -column_arm, -row_arm, shift};
    }
    /// Rows and columns times factors of their turns and of their shifts.
    GlueBlock scaled(const Vector6& of_row, const Vector6& of_column) const
    {
        return {of_row[0] * of_column[0] * turn, of_row[0] * of_column[3] * row_arm,
                of_row[3] * of_column[0] * column_arm, of_row[3] * of_column[3] * shift};
    }
    GlueBlock& operator+=(const GlueBlock& other);
    /// y += A x
    void add_product(const Twist& x, Twist& y) const
    {
        y.head<3>() += turn * x.head<3>() + row_arm.cross(x.tail<3>());
        y.tail<3>() += shift * x.tail<3>() + column_arm.cross(x.head<3>());
    }
    /// y += A^T x
    void add_transposed_product(const Twist& x, Twist& y) const
    {
        y.head<3>() += turn.transpose() * x.head<3>() + x.tail<3>().cross(column_arm);
        y.tail<3>() += shift * x.tail<3>() + x.head<3>().cross(row_arm);
    }
};

/// The glue block that \p block is, to within rounding; nullopt: it has another form.
std::optional<GlueBlock> as_glue(const Matrix6& block);

} // namespace cellwarp::core
