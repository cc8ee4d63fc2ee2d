// SPDX-License-Identifier: GPL-3.0-or-later
// The thing around a region that the hand takes hold of: arrows, squares and rings of the
// same size on the screen at any distance. Lines and where they lie, no drawing.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "editor/tools/camera.h"

namespace cellwarp::core
{

/// How a gizmo's part looks now, for whoever draws it: lines in view space.
struct GizmoPart
{
    enum class Kind
    {
        Axis,   ///< an arrow
        Plane,  ///< a small square
        Screen, ///< a circle around the centre, facing the viewer
        Ring    ///< a circle about an axis
    };
    Kind kind = Kind::Axis;
    /// 0, 1, 2; of a plane the one that stands on it; 3: of a ring that faces the viewer.
    int axis = 0;
    std::vector<Eigen::Vector3d> line; ///< [view]
    bool is_closed = false;
    bool is_hot = false; ///< under the pointer, or in the hand

    bool is_same(const GizmoPart& other) const
    {
        return kind == other.kind && axis == other.axis;
    }
};

/// Radius of the rings on the screen [pixel]: what a turn by a radian feels like where
/// the pointer draws along a line.
inline constexpr double kRingRadius = 80.0;

/// Arrows along the axes, squares between them and a circle for the screen's plane. Those
/// that the viewer sees end-on or edge-on are left out.
std::vector<GizmoPart> move_gizmo(const Eigen::Vector3d& centre, const Camera& camera);
/// Rings about the axes, one that faces the viewer, and in the middle a circle to turn
/// about any axis.
std::vector<GizmoPart> turn_gizmo(const Eigen::Vector3d& centre, const Camera& camera);

/// The part under a pixel, within what a hand can aim at.
std::optional<std::size_t> gizmo_part_at(std::span<const GizmoPart> parts,
                                         const Camera& camera,
                                         const Eigen::Vector2d& pixel);

/// Whether a closed line on the screen goes round a pixel, an odd number of times.
bool is_inside(std::span<const Eigen::Vector2d> line, const Eigen::Vector2d& pixel);

} // namespace cellwarp::core
