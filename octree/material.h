// SPDX-License-Identifier: GPL-3.0-or-later
// Where the material of a shape is: on its surface, and inside where something
// encloses it. Any samples will do: closed meshes, soups, clouds.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/bounding_surface.h"
#include "octree/notches.h"
#include "octree/shape.h"
#include "octree/voxel_grid.h"

namespace cellwarp::core
{

enum class Fill
{
    Solid, ///< the surface and what it encloses
    Shell  ///< the surface alone: what it touches, or a cloud's spacing
};

/// How the inside was told from the outside.
enum class InsideMethod
{
    None,    ///< shell
    Winding, ///< closed surface: winding number
    Votes,   ///< nearly closed surface: most of six rays
    Flood,   ///< soup or cloud: what a flood from outside does not reach
    Hollows  ///< wide openings: hollows behind them
};

/// "winding number", "rays", "flood", "hollows" or "none".
const char* inside_name(InsideMethod method);

struct Material
{
    VoxelGrid grid;
    InsideMethod method = InsideMethod::None;
    double spacing = 0.0;     ///< of the samples of a cloud; 0 for a surface
    double seal_radius = 0.0; ///< up to which openings were closed to find the inside
    /// Parts nearer than this may be joined, because the samples leave openings as wide;
    /// 0 where the voxels alone decide.
    double joins_below = 0.0;
    /// For every voxel whether it is the material of a sheet: of a surface that bounds no
    /// inside. Empty where there is no sheet.
    VoxelFlags is_sheet = {};
    /// Of a closed surface, see find_notches(); whoever makes the material may leave them
    /// out: then both sides of a notch hold together where voxels do not tell them apart.
    Notches notches = {};
};

/// The voxels of \p shape on the grid \p grid_shape. Every voxel into which a triangle or
/// sample reaches is material, of those that it only touches what holds the surface
/// together (settle_material()), and
/// for Fill::Solid the inside; if nothing is enclosed, the result is a shell.
/// Memory: see material_bytes().
/// \p surface: of \p shape.
Material find_material(const Shape& shape, const BoundingSurface& surface,
                       const GridShape& grid_shape, Fill fill);

/// Whether so few edges of a surface are open that rays tell what is inside: openings say
/// nothing of what is near.
bool is_nearly_closed(const BoundingSurface& surface);

/// What find_material() and the cells' pieces take, about [byte].
double material_bytes(const BoundingSurface& surface, const GridShape& grid_shape,
                      Fill fill);

/// How much of a grid is so near to its material that what encloses it is looked for
/// there, where it is open [share of the voxels].
double share_near(const VoxelGrid& grid);

/// Typical distance of neighbouring points, coincident ones not counted; 0 if
/// there are fewer than two places.
double point_spacing(std::span<const Eigen::Vector3d> points);

} // namespace cellwarp::core
