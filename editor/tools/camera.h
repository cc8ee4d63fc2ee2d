// SPDX-License-Identifier: GPL-3.0-or-later
// From where the user looks: view space to pixels and back.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace cellwarp::core
{

/// A ray in view space.
struct Ray
{
    Eigen::Vector3d origin = Eigen::Vector3d::Zero();
    Eigen::Vector3d direction = Eigen::Vector3d::UnitZ(); ///< unit
};

/// Pixels count from the upper left corner of the view, y downwards.
class Camera
{
public:
    enum class View
    {
        Front,
        Back,
        Right,
        Left,
        Top,
        Bottom
    };

    /// \p up: axis of view space that points up: 0, 1 or 2.
    explicit Camera(int up = 1);

    void resize(double width, double height); ///< [pixel]; 0 and 1 are allowed
    double width() const { return width_; }
    double height() const { return height_; }

    enum class Turning
    {
        Turntable, ///< the up axis stays upright
        Trackball  ///< about the axes of the screen, any side up
    };

    void orbit(const Eigen::Vector2d& pixels); ///< about the target
    Turning turning() const { return is_free_ ? Turning::Trackball : Turning::Turntable; }
    /// The view stays; a turntable sets it upright.
    void set_turning(Turning turning);
    /// Of view space: 0, 1 or 2. A trackball's view stays.
    void set_up_axis(int axis);
    void pan(const Eigen::Vector2d& pixels); ///< what is at the target's depth follows
    /// Towards what is under \p pixel, at \p depth_point where something is there.
    void zoom(double steps, const Eigen::Vector2d& pixel,
              const std::optional<Eigen::Vector3d>& depth_point);
    void look_from(View view); ///< the target stays
    void toggle_perspective() { is_perspective_ = !is_perspective_; }
    bool is_perspective() const { return is_perspective_; }
    int up_axis() const { return up_axis_; } ///< of view space: 0, 1 or 2
    /// From where it looks, and how, in a few numbers; the size of the view is not among
    /// them.
    std::string text() const;
    /// Looks so again. False: \p text is of no camera, and nothing changes.
    bool look_as(std::string_view text);
    /// Shows a box whole, from where it looks now.
    void frame(const Eigen::Vector3d& low, const Eigen::Vector3d& high);

    const Eigen::Vector3d& target() const { return target_; }
    Eigen::Vector3d eye() const;
    Eigen::Vector3d right() const, up() const, forward() const; ///< unit
    Eigen::Matrix4d view_matrix() const;
    Eigen::Matrix4d projection_matrix() const; ///< OpenGL clip space
    /// Pixel, and depth along the view direction [view]; none behind the eye. In parallel
    /// projection nothing is behind it.
    std::optional<Eigen::Vector3d> project(const Eigen::Vector3d& point) const;
    Ray ray(const Eigen::Vector2d& pixel) const;
    /// Length of a pixel at a point [view].
    double pixel_size(const Eigen::Vector3d& point) const;

private:
    double focal() const;                 ///< eye to the plane of the pixels [pixel]
    Eigen::Matrix3d upright_axes() const; ///< axes_ of the two angles
    void move_target(const Eigen::Vector3d& target);

    int up_axis_ = 1;
    double width_ = 1.0, height_ = 1.0;
    Eigen::Vector3d target_ = Eigen::Vector3d::Zero();
    double azimuth_ = 0.6, elevation_ = 0.35; ///< of the turntable [rad]
    bool is_free_ = false;
    /// Of the trackball: to the right, up, to the viewer.
    Eigen::Matrix3d axes_ = Eigen::Matrix3d::Identity();
    double distance_ = 2.5; ///< eye to target [view]
    bool is_perspective_ = true;
};

} // namespace cellwarp::core
