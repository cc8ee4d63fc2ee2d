// SPDX-License-Identifier: GPL-3.0-or-later
// Parts of a mesh that are closed by themselves: each is material of its own, also where
// it touches another one or overlaps it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "octree/bounding_surface.h"
#include "octree/material.h"
#include "octree/shape.h"
#include "octree/voxel_grid.h"

namespace cellwarp::core
{

struct Parts
{
    struct Part
    {
        std::uint32_t first_sample = 0; ///< the lowest number of one
        std::size_t num_samples = 0;
    };
    /// By their first samples. What is in no closed part (soups, points, open surfaces,
    /// and all that is near these) is one of them.
    std::vector<Part> parts;
    /// Which of them have voxels side by side, ascending; the first is the lower one.
    std::vector<std::pair<int, int>> touching;
    /// Of every sample the voxel, of its own part, that it goes with; empty where it is
    /// the one that holds it.
    std::vector<std::size_t> voxel_of_sample;

    std::size_t count() const { return parts.size(); }
    /// Those that touch another one.
    std::size_t num_touching() const;
};

/// Whether there is more than one: whether to look for them is worth its time.
bool may_have_parts(const Shape& shape, const BoundingSurface& surface);

/// As find_material(), but closed parts of a mesh hold together only by themselves: they
/// have other numbers than those beside them. Parts that have a sample at one place
/// (kCoincident) are one, a surface that bounds a void belongs to the part around it, and
/// so does what lies wholly in its material. Where two overlap the smaller one has what
/// they share. Fills \p parts.
Material material_of_parts(const Shape& shape, const BoundingSurface& surface,
                           const GridShape& grid_shape, Fill fill, Parts& parts);

} // namespace cellwarp::core
