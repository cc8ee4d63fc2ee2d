// SPDX-License-Identifier: GPL-3.0-or-later
// What there is to see: plain arrays that a view can draw as they are, made by the
// threads behind the document and never changed afterwards.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "io/formats/geometry.h"
#include "library/session/cell_system.h"
#include "library/session/work_frame.h"
#include "octree/base/rigid_motion.h"

namespace cellwarp::core
{

/// In which order the samples stand, and what joins them there. Lasts while the cells do.
struct ShapeLayout
{
    std::vector<std::uint32_t> order;    ///< sample at each place
    std::vector<std::uint32_t> place_of; ///< place of each sample
    /// Triangles as places, three each; empty for a cloud.
    std::vector<std::uint32_t> triangles;
    /// The same surface from far away: fewer triangles of the same samples, for moments
    /// when drawing all of them would take too long. Empty for a cloud, and where there
    /// are few anyway.
    std::vector<std::uint32_t> coarse_triangles;
    /// Lines that the file draws from sample to sample, as places, two each.
    std::vector<std::uint32_t> lines;
};

/// A rod or curve where it is, in view space.
struct ShownLine
{
    std::string name;
    bool is_rod = true, is_bone = false;
    std::vector<Eigen::Vector3d> places; ///< along it
    std::vector<Eigen::Vector3d> points; ///< those that it is written by
    /// Unit, at the points; zero at control points off the line.
    std::vector<Eigen::Vector3d> tangents;
    std::vector<double> turns; ///< of the material there, about the tangent [degree]
};

/// The samples at one moment, three numbers each, in the order of the layout.
struct ShownShape
{
    std::shared_ptr<const ShapeLayout> layout;
    std::vector<float> positions; ///< [work]
    std::vector<float> normals;   ///< unit or zero; empty for a cloud
    std::vector<ShownLine> lines; ///< rods, curves, joints with the bones to them
    Eigen::Matrix4d to_view = Eigen::Matrix4d::Identity(); ///< from work to view space
    /// Rises whenever anything of it changes.
    std::uint64_t version = 0;
};

/// A cell's box at rest, and what it is.
struct ShownCell
{
    std::array<Eigen::Vector3f, 8> corners; ///< [work], where the cell is now
    int depth = 0;                          ///< below the coarsest
    int region = -1;                        ///< which one moves it; -1: none
    float gap = 0.0f; ///< largest to a neighbour, through the glue [diagonal]
};

struct ShownCells
{
    std::vector<ShownCell> cells;
    Eigen::Matrix4d to_view = Eigen::Matrix4d::Identity();
    std::uint64_t version = 0;
};

/// Samples in this order; empty: in that of the file.
std::shared_ptr<const ShapeLayout> layout_of(const Geometry& geometry,
                                             std::span<const std::uint32_t> order = {});

/// Samples [model unit] as a view shows them. \p view: the frame of view space.
ShownShape shown_at(const Geometry& geometry, std::span<const Eigen::Vector3d> samples,
                    std::shared_ptr<const ShapeLayout> layout, const WorkFrame& view);

/// From one frame's work space to another's.
Eigen::Matrix4d view_of_work(const WorkFrame& work, const WorkFrame& view);

/// Each joint, and the bone that leads to it. Places in model units.
std::vector<ShownLine> shown_joints(std::span<const PosedJoint> joints,
                                    const WorkFrame& view);

/// The rods, curves and joints of a system where they are.
std::vector<ShownLine> shown_lines(const CellSystem& system, const WorkFrame& view);

/// The cells of a system at other poses.
ShownCells shown_cells(const CellSystem& system, std::span<const Pose> poses,
                       const WorkFrame& view);

} // namespace cellwarp::core
