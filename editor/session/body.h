// SPDX-License-Identifier: GPL-3.0-or-later
// A shape as the solver sees it: material, octree, pieces and cells in work space.
#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "editor/session/work_frame.h"
#include "io/geometry.h"
#include "octree/cells.h"
#include "octree/material.h"
#include "octree/octree.h"
#include "octree/pieces.h"

namespace cellwarp
{

struct CellSettings
{
    Fill fill = Fill::Solid;
    int across = 0;    ///< coarsest cells along the longest side; 0: automatic
    int max_depth = 0; ///< splits below them, at the most
    int min_depth = 0; ///< splits below them, everywhere
    /// [diagonal] Cells with a larger error are split; infinity: none.
    double threshold = INFINITY;
    double gap = 0.008; ///< [diagonal] parts farther apart are never glued
    std::int64_t max_cells = 200000;
    double max_memory = 0.0;       ///< [byte], 0: no limit
    std::optional<FrameBox> frame; ///< default: the model's bounding box
    std::string frame_file;        ///< the scene that gives it
};

/// Immutable once built.
struct Body
{
    WorkFrame frame;
    std::vector<Eigen::Vector3d> samples; ///< rest places [work]
    Material material;
    Octree octree;
    Pieces pieces;
    Cells cells;
    std::vector<int> cell_of_sample;
    int across = 0;
    std::vector<std::string> warnings;
};

/// Builds the cells of \p samples (rest places [model unit], in the order of
/// \p geometry, which gives the faces). Throws Fault::Budget when the coarsest grid
/// alone is over max_cells or the voxels are over max_memory.
Body build_body(const Geometry& geometry, const std::vector<Eigen::Vector3d>& samples,
                const CellSettings& settings);

/// The faces of \p geometry as fans.
std::vector<Triangle> triangles_of(const Geometry& geometry);

} // namespace cellwarp
