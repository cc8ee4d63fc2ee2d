// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/tools/navigation.h"

namespace cellwarp::core
{

namespace
{

constexpr double kZoomRate = 0.02; ///< [step/pixel]

} // namespace

std::optional<CameraMotion> camera_motion(Navigation navigation, Button button,
                                          const Modifiers& modifiers)
{
    if (navigation == Navigation::Maya)
    {
        if (!modifiers.alt)
            return std::nullopt;
        switch (button)
        {
        case Button::Left:
            return CameraMotion::Orbit;
        case Button::Middle:
            return CameraMotion::Pan;
        case Button::Right:
            return CameraMotion::Zoom;
        }
    }
    // The left button needs Alt: it has work to do. That serves trackpads too.
    if (button == Button::Left && !modifiers.alt)
        return std::nullopt;
    return modifiers.shift     ? CameraMotion::Pan
           : modifiers.control ? CameraMotion::Zoom
                               : CameraMotion::Orbit;
}

void move_camera(Camera& camera, CameraMotion motion, const Eigen::Vector2d& from,
                 const Eigen::Vector2d& to, const Eigen::Vector2d& start,
                 const std::optional<Eigen::Vector3d>& depth_point)
{
    const Eigen::Vector2d way = to - from;
    switch (motion)
    {
    case CameraMotion::Orbit:
        camera.orbit(way);
        break;
    case CameraMotion::Pan:
        camera.pan(way);
        break;
    case CameraMotion::Zoom: // upwards and to the right: nearer
        camera.zoom(kZoomRate * (way.x() - way.y()), start, depth_point);
        break;
    }
}

} // namespace cellwarp::core
