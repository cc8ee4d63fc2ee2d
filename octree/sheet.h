// SPDX-License-Identifier: GPL-3.0-or-later
// Sheets: the parts of a shape's surface that bound no inside. They have a thickness that
// somebody gave, not that of the voxels; what cells share of them is measured on the
// surface itself.
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "octree/material.h"
#include "octree/voxel_grid.h"

namespace cellwarp::core
{

/// A part of a sheet within one finest leaf.
struct SheetPatch
{
    std::size_t voxel = 0; ///< that holds its centre
    double area = 0.0;
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
};

/// Where a sheet passes from one finest leaf to the next: a line on the plane between
/// them, along which the material of the sheet has a cross-section.
struct SheetCrossing
{
    std::size_t below = 0; ///< the voxel under the middle of the line; the next is above
    int axis = 0;          ///< of the plane's normal
    double length = 0.0;   ///< of the line
    double area = 0.0;     ///< of the cross-section
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    Eigen::Vector3d normal = Eigen::Vector3d::UnitX(); ///< of the sheet
};

/// The sheets of a shape on the voxels of its material. Immutable once built.
struct Sheets
{
    double thickness = 0.0;
    std::vector<SheetPatch> patches;
    std::vector<SheetCrossing> crossings;
};

/// The sheets of \p material, found from \p shape. Triangles count once, however often
/// they are there; a line, however often, is a bar as wide as it is thick; a cloud is
/// what squares in the tangent planes of its points cover. Nothing where
/// material.is_sheet is empty. \p surface: of \p shape.
Sheets find_sheets(const Shape& shape, const BoundingSurface& surface,
                   const Material& material, double thickness);

} // namespace cellwarp::core
