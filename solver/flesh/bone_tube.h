// SPDX-License-Identifier: GPL-3.0-or-later
// The tube around a bone: material near it is held to the bone's motion by an even
// spring, so that flesh does not spin about its bone. [Capell02]
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/voxel_grid.h"
#include "solver/flesh/bone_points.h"
#include "solver/flesh/lattice.h"

namespace cellwarp::core
{

/// A bit of material, where integrals take their values.
struct MaterialPoint
{
    int cell = 0;
    Eigen::Vector3d local = Eigen::Vector3d::Zero(); ///< in the cell
    double volume = 0.0;                             ///< [m^3]
};

/// What of a bone's tube lies in one cell:
/// 1/2 stiffness (u - gamma)^T overlap (u - gamma), gamma_a = T x_a - x_a.
struct TubePart
{
    int part = 0; ///< of the lattice: the largest one of the cell
    int motion = 0;
    Eigen::Matrix<double, 8, 8> overlap; ///< int phi_a phi_b [m^3]
    double stiffness = 0.0;              ///< kappa [Pa/m^2]
};

struct TubeBone
{
    BoneLine line;
    double radius = 0.0; ///< [m]
};

/// Voxels of the material that lie in the tube of a bone, and are joined to it inside the
/// tube; of several bones the nearest one has them, of two as near the first. Of each
/// bone those that it has. \p unit: of the grid [m].
std::vector<std::vector<std::size_t>> voxels_in_tubes(const VoxelGrid& grid, double unit,
                                                      std::span<const TubeBone> bones);

/// The same as points of the cells that hold them: one for each of \p pieces.
std::vector<std::vector<MaterialPoint>>
points_in_tubes(const VoxelGrid& grid, const Pieces& pieces, const Lattice& lattice,
                double unit, std::span<const std::vector<std::size_t>> voxels);

/// The same for a lattice that was drawn, whose cells are cut into small ones.
std::vector<std::vector<MaterialPoint>> points_in_tubes(const Lattice& lattice,
                                                        std::span<const TubeBone> bones);

/// \p chi: of the stiffness, chi shear / radius^2 [theory-skeleton 5.4].
/// \p materials: of the lattice's parts.
std::vector<TubePart> tube_parts(const Lattice& lattice,
                                 std::span<const FleshMaterial> materials,
                                 std::span<const TubeBone> bones,
                                 std::span<const std::vector<MaterialPoint>> points,
                                 double chi);

} // namespace cellwarp::core
