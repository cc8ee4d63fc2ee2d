// SPDX-License-Identifier: GPL-3.0-or-later
// Elastic glue between rigid cells: the energy that makes them behave like one
// elastic body. No octree and no linear algebra here; glue.cpp has the derivation.
#pragma once

#include <array>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/cells.h"
#include "solver/pose.h"

namespace cellwarp
{

/// What one face of glue remembers of the rest state.
struct GlueFace
{
    int a = 0, b = 0;
    double stiffness = 0.0; ///< w_ij [length], times the factor of stiff regions
    Eigen::Vector3d offset; ///< c_b - c_a
    double share_a = 0.0, share_b = 0.0; ///< V_a / (V_a + V_b), V_b / (V_a + V_b)
    /// Columns l_k with sum l_k l_k^T = the volume-weighted mean of the second moments.
    Eigen::Matrix3d moment_root;
};

/// The glue of a set of cells. Rest state: immutable.
struct Glue
{
    std::vector<GlueFace> faces;
    std::vector<int> first_face; ///< cells + 1 offsets into faces_of_cell
    std::vector<int> faces_of_cell;
};

/// \p cell_factors: stiffness of each cell relative to plain material, > 0; a face
/// takes the geometric mean of its two where both differ from 1, else 1.
/// Empty: all 1.
Glue build_glue(const Cells& cells, std::span<const double> cell_factors);

/// E_ij of one face: w_ij / (V_i + V_j) int |T_i - T_j|^2 over both cells
/// [length^3]. Zero if and only if both cells make the same rigid motion (for
/// second moments of full rank). [Botsch07]
double glue_energy(const GlueFace& face, const Pose& a, const Pose& b);

/// How much of the second derivative: J^T J, which is positive semi-definite, plus a
/// share of the curvature of the rotations, which with 1 makes it exact.
struct Curvature
{
    double share;
};
inline constexpr Curvature kGaussNewton{0.0}, kExact{1.0};

/// Second-order model of one face in the twists of its cells: rows and columns
/// 0..5 belong to a, 6..11 to b; angular before linear.
struct GlueBlock
{
    double energy = 0.0;
    Eigen::Matrix<double, 12, 1> gradient = Eigen::Matrix<double, 12, 1>::Zero();
    Eigen::Matrix<double, 12, 12> hessian = Eigen::Matrix<double, 12, 12>::Zero();
};

GlueBlock glue_block(const GlueFace& face, const Pose& a, const Pose& b,
                     Curvature curvature);

/// The gradient alone.
Eigen::Matrix<double, 12, 1> glue_gradient(const GlueFace& face, const Pose& a,
                                           const Pose& b);

/// Sum over all faces, in their order.
double glue_energy(const Glue& glue, std::span<const Pose> poses);

} // namespace cellwarp
