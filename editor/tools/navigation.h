// SPDX-License-Identifier: GPL-3.0-or-later
// Which buttons look around, and how.
#pragma once

#include <optional>

#include <Eigen/Core>

#include "editor/tools/camera.h"
#include "editor/tools/events.h"

namespace cellwarp::core
{

enum class CameraMotion
{
    Orbit,
    Pan,
    Zoom
};

/// What a drag with this button does to the view; none: it is for something else.
std::optional<CameraMotion> camera_motion(Navigation navigation, Button button,
                                          const Modifiers& modifiers);

/// \p start: where the drag began; zooming goes towards it.
void move_camera(Camera& camera, CameraMotion motion, const Eigen::Vector2d& from,
                 const Eigen::Vector2d& to, const Eigen::Vector2d& start,
                 const std::optional<Eigen::Vector3d>& depth_point);

} // namespace cellwarp::core
