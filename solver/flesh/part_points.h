// SPDX-License-Identifier: GPL-3.0-or-later
// Where integrals over a part of the lattice take their values: eight points. And the
// matrices of one part in full, from which nothing is computed in a hurry: solvers use
// part_kernel.h.
#pragma once

#include <array>

#include <Eigen/Core>

#include "solver/flesh/lattice.h"

namespace cellwarp::core
{

/// Point k stands for a corner: sign_of(k, axis) tells the side.
inline double sign_of(int k, int axis)
{
    return (k >> axis & 1) ? 1.0 : -1.0;
}

/// Of a box, points whose volume, centre and second moment are those of the part: exact
/// for functions of degree 2, and Gauss's where the part fills its box
/// [theory-skeleton 3.1]. Of a hexahedron that was drawn, Gauss's.
struct PartPoints
{
    std::array<Eigen::Vector3d, 8> local;   ///< in the cell, see local_place()
    std::array<Eigen::Matrix3d, 8> inverse; ///< d local / d x [1/m]
    std::array<double, 8> weight;           ///< [m^3]
    /// The displacement gradient at point k gains sum_i a_i modes[k].col(i)^T, with a_i
    /// such that it costs least: cells bend without shear. [Taylor76] part_points.cpp
    /// tells which modes these are.
    std::array<Eigen::Matrix3d, 8> modes;

    /// Slopes of the corners' functions at point k, a column each [1/m].
    Eigen::Matrix<double, 3, 8> slopes(int k) const;
};

PartPoints points_of(const Lattice& lattice, const LatticePart& part);

using PartMatrix = Eigen::Matrix<double, 24, 24>;

/// The inverse (9 x 9) of what the modes cost among themselves, mode i in rows 3 i to
/// 3 i + 2 [1 / (Pa m^3)].
Eigen::Matrix<double, 9, 9> mode_solve(const PartPoints& points,
                                       const FleshMaterial& material);

/// Stiffness for small displacements of the corners, corner a in rows 3 a to 3 a + 2
/// [N/m]. \p has_modes: with the modes of PartPoints, else plain trilinear.
PartMatrix stiffness_of(const PartPoints& points, const FleshMaterial& material,
                        bool has_modes = true);

/// M_ab = density int phi_a phi_b [kg].
Eigen::Matrix<double, 8, 8> mass_of(const PartPoints& points, double density);

} // namespace cellwarp::core
