// SPDX-License-Identifier: GPL-3.0-or-later
// Shapes and their cells made by functions, so that a test can be read alone.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "octree/cells.h"
#include "octree/material.h"
#include "octree/octree.h"
#include "octree/shape.h"

namespace cellwarp::core::support
{

/// A triangulated closed box of \p n quads along its unit edge, low to high corner.
Shape box_shape(const Eigen::Vector3d& low, const Eigen::Vector3d& high, int n = 4);

/// The closed surface of blocks: those between the lines along the axes (ascending) that
/// \p holds(i, j, k) takes. Two triangles a side of a block.
Shape blocks_shape(const std::array<std::vector<double>, 3>& lines,
                   const std::function<bool(int, int, int)>& holds);

/// An L-prism 4 x 2 x 1, as blocks of half a unit.
Shape l_prism();
/// A comb of two teeth 4 x 1 x 1, slit from x = 1.98 on between y = 0.45 and 0.55.
Shape comb();
/// A trunk 1 x 1 x 10 along z; with arms 1 thick from x = -5 to 5, from z = 7 to 8.
Shape cross(bool has_arms);
/// Four steps 1 x 1 x 1 each, one above the other.
Shape steps();
/// An open sheet in the plane z = 0, from the origin along x and y; \p n quads along its
/// shorter side.
Shape sheet_shape(double length, double width, int n = 4);

/// Two shapes in one.
Shape joined(const Shape& a, const Shape& b);

/// The text of an OBJ file of the shape.
std::string obj_text(const Shape& shape);

/// Points spread evenly, by a seeded generator, on the triangles of a shape.
std::vector<Eigen::Vector3d> random_points(const Shape& shape, int count, unsigned seed);

/// Everything from a shape to its cells, \p across leaves along the longest side.
struct Built
{
    Material material;
    Octree octree;
    Pieces pieces;
    Cells cells;
};
Built built(const Shape& shape, int across, int depth = 0, Fill fill = Fill::Solid,
            double max_voxel = 0.0);

/// The same in cells of all sizes down to \p depth: \p depth times one leaf in three,
/// chosen by a seeded generator, is divided.
Built built_mixed(const Shape& shape, int across, int depth, unsigned seed,
                  double max_voxel = 0.0);

/// A bar of cells, counts along the axes, by itself.
Built bar(int nx, int ny, int nz);

} // namespace cellwarp::core::support
