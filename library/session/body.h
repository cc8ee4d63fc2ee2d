// SPDX-License-Identifier: GPL-3.0-or-later
// A shape as the solver sees it: its material in work space, and the cells that this is
// cut into.
#pragma once

#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "io/formats/geometry.h"
#include "library/session/work_frame.h"
#include "octree/boundary_points.h"
#include "octree/cells.h"
#include "octree/material.h"
#include "octree/nearest_sample.h"
#include "octree/octree.h"
#include "octree/parts.h"
#include "octree/pieces.h"
#include "octree/sheet.h"

namespace cellwarp::core
{

class CellSystem;

struct CellSettings
{
    Fill fill = Fill::Solid;
    bool has_lids = false; ///< openings of a mesh are closed, whatever their width
    int across = 0;        ///< coarsest cells along the longest side; 0: automatic
    int max_depth = 0;     ///< splits below them, at the most
    int min_depth = 0;     ///< splits below them, everywhere
    /// [diagonal] Cells with a larger error are split; infinity: none.
    double threshold = INFINITY;
    /// Errors of the cells [work]; empty: cell_errors(). Benchmarks compare others.
    std::function<std::vector<double>(const CellSystem&)> errors = {};
    double gap = 0.008;      ///< [diagonal] parts farther apart are never glued
    double thickness = 0.01; ///< [diagonal] of sheets: of what bounds no inside
    /// All stays in the plane that the samples lie in. Nothing: default_plane.h decides
    /// by the moves; a shape without moves is not flat.
    std::optional<bool> is_flat;
    /// Components that no region holds go with the one nearest to them; else they stay.
    bool loose_follow = true;
    bool joins_parts = false; ///< closed parts that touch or overlap are one material
    bool has_contact = false; ///< parts that come to touch do not pass through each other
    std::int64_t max_cells = 200000;
    double max_memory = 0.0;       ///< of the process [byte], 0: no limit
    std::optional<FrameBox> frame; ///< default: the model's bounding box
    std::string frame_file;        ///< the scene that gives it
};

/// What is cut into cells: lasts as long as a rest shape does. Immutable once built.
struct RestShape
{
    WorkFrame frame;
    std::vector<Eigen::Vector3d> samples; ///< rest places [work]
    Material material;
    Parts parts; ///< of the material; one where parts are joined
    Sheets sheets;
    int across = 0; ///< coarsest cells along the longest side
    /// Across the plane that the samples lie in [work]; nothing: they lie in none.
    std::optional<Eigen::Vector3d> normal;
    int flat_axis = -1; ///< that is kept across the plane; -1: none is
    bool is_flat() const { return flat_axis >= 0; }
    std::vector<std::string> warnings;
    /// Of the material, where its parts do not pass through each other; null: they may.
    std::shared_ptr<const BoundaryPoints> boundary;

    /// Made when it is first asked for, once; any thread may ask.
    const NearestSamples& nearest_samples() const;
    struct MadeOnce
    {
        std::once_flag flag;
        std::optional<NearestSamples> nearest_samples;
    };
    std::unique_ptr<MadeOnce> made_once = std::make_unique<MadeOnce>();
};

/// A rest shape in cells: made anew where other cells are wanted. Immutable once built.
struct Body
{
    std::shared_ptr<const RestShape> rest;
    Octree octree;
    Pieces pieces;
    Cells cells;
    std::vector<int> cell_of_sample;
    std::vector<std::string> warnings;
};

/// The axes and the box of the octree of samples [model unit]; \p normal: of the plane
/// that they are kept in, or nothing. Throws what given_frame() throws.
WorkFrame frame_of(const std::vector<Eigen::Vector3d>& samples,
                   const std::optional<Eigen::Vector3d>& normal,
                   const CellSettings& settings);

/// The axis of a frame that is across a plane; nothing: none is.
std::optional<int> axis_across(const WorkFrame& frame, const Eigen::Vector3d& normal);

/// The material of \p samples (rest places [model unit], in the order of \p geometry,
/// which gives the faces). Throws Fault::Budget when the process would be over
/// max_memory, Fault::Malformed where they are to be flat and are not.
std::shared_ptr<const RestShape>
build_rest_shape(const Geometry& geometry, const std::vector<Eigen::Vector3d>& samples,
                 const CellSettings& settings);

/// The parts of a mesh, as build_rest_shape() finds them by default; without faces none.
std::optional<Parts> mesh_parts(const Geometry& geometry);

/// The coarsest cells, split down to min_depth as far as max_cells allows. Throws
/// Fault::Budget when the coarsest grid alone has more.
Body build_body(std::shared_ptr<const RestShape> rest, const CellSettings& settings);

/// The cells of an octree of this shape. \p earlier cells of the shape, or null: what the
/// octrees have in common is taken over from them, to the same bits.
Body cut(std::shared_ptr<const RestShape> rest, Octree octree,
         const Body* earlier = nullptr);

} // namespace cellwarp::core
