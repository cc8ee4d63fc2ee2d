// SPDX-License-Identifier: GPL-3.0-or-later
// On a turntable the up axis stays upright on the screen, and at the poles the azimuth
// still says where the right hand is, so nothing ever flips. The opening angle is that
// of the shorter side of the view; parallel projection shows the target's depth as large
// as perspective does.
#include "editor/tools/camera.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "io/base/number.h"

namespace cellwarp::core
{

namespace
{

constexpr double kOpening =
    40.0 * std::numbers::pi / 180.0; ///< of the shorter side [rad]
constexpr double kOrbitRate = 0.007; ///< [rad/pixel]
constexpr double kZoomStep = 1.15;   ///< a notch of the wheel
/// The model has a longest side of 1 at the most.
constexpr double kNearest = 1e-5, kFarthest = 100.0; ///< eye to target [view]
/// How far from the origin a shape that was dragged about may be [view].
constexpr double kReach = 20.0;
constexpr double kMargin = 0.85; ///< of the view, that a framed box fills
/// A single sample is framed with something of what is around it.
constexpr double kFramedNearest = 0.05; ///< [view]
/// Before this there is nothing to see, relative to the target's distance.
constexpr double kNearPlane = 0.01;
/// From here on up, or down, a view is one along the up axis [rad].
constexpr double kSteep = 1.57;
/// What is closer to the eye counts as behind it [view].
constexpr double kBehind = 1e-9;

/// Where a viewer from the front stands.
Eigen::Vector3d front_of(int up)
{
    if (up == 2)
        return -Eigen::Vector3d::UnitY();
    return Eigen::Vector3d::Unit((up + 1) % 3);
}

/// No view is smaller than a pixel.
double at_least_one(double pixels)
{
    return std::max(1.0, pixels);
}

} // namespace

Camera::Camera(int up) : up_axis_(up) {}

void Camera::resize(double width, double height)
{
    if (!(width >= 0) || !(height >= 0) || !std::isfinite(width + height))
        return;
    width_ = width;
    height_ = height;
}

double Camera::focal() const
{
    return 0.5 * at_least_one(std::min(width_, height_)) / std::tan(0.5 * kOpening);
}

Eigen::Matrix3d Camera::upright_axes() const
{
    const Eigen::Vector3d axis = Eigen::Vector3d::Unit(up_axis_);
    const Eigen::Vector3d front = front_of(up_axis_), side = axis.cross(front);
    const Eigen::Vector3d right = std::cos(azimuth_) * side - std::sin(azimuth_) * front;
    const Eigen::Vector3d level = right.cross(axis); // towards the viewer
    const Eigen::Vector3d back =
        std::cos(elevation_) * level + std::sin(elevation_) * axis;
    Eigen::Matrix3d axes;
    axes << right, back.cross(right), back;
    return axes;
}

Eigen::Vector3d Camera::right() const
{
    return is_free_ ? Eigen::Vector3d(axes_.col(0)) : upright_axes().col(0);
}

Eigen::Vector3d Camera::forward() const
{
    return is_free_ ? Eigen::Vector3d(-axes_.col(2)) : -upright_axes().col(2);
}

Eigen::Vector3d Camera::up() const
{
    return right().cross(forward());
}

void Camera::set_turning(Turning turning)
{
    if (turning == this->turning())
        return;
    is_free_ = turning == Turning::Trackball;
    if (is_free_)
    {
        axes_ = upright_axes();
        return;
    }
    const Eigen::Vector3d axis = Eigen::Vector3d::Unit(up_axis_);
    const Eigen::Vector3d front = front_of(up_axis_), side = axis.cross(front);
    const Eigen::Vector3d back = axes_.col(2);
    elevation_ = std::asin(std::clamp(back.dot(axis), -1.0, 1.0));
    // Seen along the axis the right hand tells the azimuth.
    const Eigen::Vector3d level =
        std::abs(elevation_) < kSteep ? back : Eigen::Vector3d(axes_.col(0).cross(axis));
    azimuth_ = std::atan2(level.dot(side), level.dot(front));
}

void Camera::set_up_axis(int axis)
{
    up_axis_ = std::clamp(axis, 0, 2);
}

Eigen::Vector3d Camera::eye() const
{
    return target_ - distance_ * forward();
}

void Camera::orbit(const Eigen::Vector2d& pixels)
{
    if (!pixels.allFinite())
        return;
    if (is_free_)
    {
        const Eigen::Quaterniond turned =
            Eigen::AngleAxisd(-kOrbitRate * pixels.x(), up()) *
            Eigen::AngleAxisd(-kOrbitRate * pixels.y(), right()) *
            Eigen::Quaterniond(axes_);
        axes_ = turned.normalized().toRotationMatrix();
        return;
    }
    azimuth_ = std::remainder(azimuth_ - kOrbitRate * pixels.x(), 2.0 * std::numbers::pi);
    elevation_ = std::clamp(elevation_ + kOrbitRate * pixels.y(), -0.5 * std::numbers::pi,
                            0.5 * std::numbers::pi);
}

void Camera::pan(const Eigen::Vector2d& pixels)
{
    if (!pixels.allFinite())
        return;
    const double unit = distance_ / focal();
    move_target(target_ + unit * (pixels.y() * up() - pixels.x() * right()));
}

void Camera::zoom(double steps, const Eigen::Vector2d& pixel,
                  const std::optional<Eigen::Vector3d>& depth_point)
{
    if (!std::isfinite(steps) || !pixel.allFinite())
        return;
    const double old = distance_;
    distance_ = std::clamp(old * std::pow(kZoomStep, -steps), kNearest, kFarthest);
    // Everything shrinks towards one point, so that this one stays where it is seen.
    Eigen::Vector3d fixed;
    if (depth_point && depth_point->allFinite())
        fixed = *depth_point;
    else
    {
        const double unit = old / focal();
        fixed = target_ + unit * ((pixel.x() - 0.5 * width_) * right() -
                                  (pixel.y() - 0.5 * height_) * up());
    }
    move_target(fixed + distance_ / old * (target_ - fixed));
}

void Camera::look_from(View view)
{
    azimuth_ = elevation_ = 0.0;
    switch (view)
    {
    case View::Front:
        break;
    case View::Back:
        azimuth_ = std::numbers::pi;
        break;
    case View::Right:
        azimuth_ = 0.5 * std::numbers::pi;
        break;
    case View::Left:
        azimuth_ = -0.5 * std::numbers::pi;
        break;
    case View::Top:
        elevation_ = 0.5 * std::numbers::pi;
        break;
    case View::Bottom:
        elevation_ = -0.5 * std::numbers::pi;
        break;
    }
    axes_ = upright_axes();
}

void Camera::frame(const Eigen::Vector3d& low, const Eigen::Vector3d& high)
{
    if (!low.allFinite() || !high.allFinite())
        return;
    move_target(0.5 * (low + high));
    const Eigen::Vector3d across = right(), upwards = up(), ahead = forward();
    // What of the distance a corner may be off the axis [view/view].
    const double x_reach = kMargin * 0.5 * at_least_one(width_) / focal();
    const double y_reach = kMargin * 0.5 * at_least_one(height_) / focal();
    double distance = kFramedNearest;
    for (int corner = 0; corner < 8; ++corner)
    {
        Eigen::Vector3d x = low;
        for (int k = 0; k < 3; ++k)
            if (corner >> k & 1)
                x[k] = high[k];
        x -= target_;
        const double nearer = is_perspective_ ? -ahead.dot(x) : 0.0;
        distance = std::max({distance, nearer + std::abs(across.dot(x)) / x_reach,
                             nearer + std::abs(upwards.dot(x)) / y_reach});
    }
    distance_ = std::min(distance, kFarthest);
}

void Camera::move_target(const Eigen::Vector3d& target)
{
    target_ = target.cwiseMax(-kFarthest).cwiseMin(kFarthest);
}

std::string Camera::text() const
{
    const double flags[] = {double(up_axis_), double(is_free_), double(is_perspective_),
                            azimuth_,         elevation_,       distance_};
    std::string text;
    const auto add = [&](double value)
    {
        append_shortest(value, text);
        text += ' ';
    };
    for (const double value : flags)
        add(value);
    for (const double value : target_)
        add(value);
    for (const double value : axes_.reshaped())
        add(value);
    text.pop_back();
    return text;
}

bool Camera::look_as(std::string_view text)
{
    constexpr std::size_t kNumbers = 18;
    std::vector<double> numbers;
    while (!text.empty() && numbers.size() <= kNumbers)
    {
        const std::size_t end = std::min(text.find(' '), text.size());
        const std::optional<double> number = parse_double(text.substr(0, end));
        if (!number || !std::isfinite(*number))
            return false;
        numbers.push_back(*number);
        text.remove_prefix(std::min(end + 1, text.size()));
    }
    if (numbers.size() != kNumbers)
        return false;
    const auto is_in = [&](std::size_t k, double low, double high)
    { return low <= numbers[k] && numbers[k] <= high; };
    const Eigen::Matrix3d axes = Eigen::Map<const Eigen::Matrix3d>(numbers.data() + 9);
    const bool is_rotation =
        (axes.transpose() * axes - Eigen::Matrix3d::Identity()).norm() < 1e-6 &&
        axes.determinant() > 0.0;
    const bool has_axis = numbers[0] == 0 || numbers[0] == 1 || numbers[0] == 2;
    if (!has_axis || !is_in(1, 0, 1) || !is_in(2, 0, 1) || !is_in(4, -2, 2) ||
        !is_in(5, kNearest, kFarthest) || !is_rotation)
        return false;
    up_axis_ = static_cast<int>(numbers[0]);
    is_free_ = numbers[1] != 0;
    is_perspective_ = numbers[2] != 0;
    azimuth_ = numbers[3];
    elevation_ = numbers[4];
    distance_ = numbers[5];
    move_target(Eigen::Map<const Eigen::Vector3d>(numbers.data() + 6));
    axes_ = axes;
    return true;
}

Eigen::Matrix4d Camera::view_matrix() const
{
    Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
    matrix.block<1, 3>(0, 0) = right().transpose();
    matrix.block<1, 3>(1, 0) = up().transpose();
    matrix.block<1, 3>(2, 0) = -forward().transpose();
    matrix.block<3, 1>(0, 3) = -matrix.block<3, 3>(0, 0) * eye();
    return matrix;
}

Eigen::Matrix4d Camera::projection_matrix() const
{
    const double scale = is_perspective_ ? focal() : focal() / distance_;
    const double far = distance_ + target_.norm() + kReach;
    const double near = is_perspective_ ? kNearPlane * distance_ : -far;
    Eigen::Matrix4d matrix = Eigen::Matrix4d::Zero();
    matrix(0, 0) = 2.0 * scale / at_least_one(width_);
    matrix(1, 1) = 2.0 * scale / at_least_one(height_);
    if (is_perspective_)
    {
        matrix(2, 2) = -(far + near) / (far - near);
        matrix(2, 3) = -2.0 * far * near / (far - near);
        matrix(3, 2) = -1.0;
    }
    else
    {
        matrix(2, 2) = -2.0 / (far - near);
        matrix(2, 3) = -(far + near) / (far - near);
        matrix(3, 3) = 1.0;
    }
    return matrix;
}

std::optional<Eigen::Vector3d> Camera::project(const Eigen::Vector3d& point) const
{
    const Eigen::Vector3d x = point - eye();
    const double depth = forward().dot(x);
    if (!std::isfinite(depth) || (is_perspective_ && !(depth > kBehind)))
        return std::nullopt;
    const double scale = focal() / (is_perspective_ ? depth : distance_);
    return Eigen::Vector3d(0.5 * width_ + scale * right().dot(x),
                           0.5 * height_ - scale * up().dot(x), depth);
}

Ray Camera::ray(const Eigen::Vector2d& pixel) const
{
    const double x = (pixel.x() - 0.5 * width_) / focal();
    const double y = (0.5 * height_ - pixel.y()) / focal();
    if (is_perspective_)
        return {eye(), (forward() + x * right() + y * up()).normalized()};
    // From before anything that may be there.
    return {eye() + distance_ * (x * right() + y * up()) -
                (kReach + target_.norm()) * forward(),
            forward()};
}

double Camera::pixel_size(const Eigen::Vector3d& point) const
{
    const double depth = is_perspective_ ? forward().dot(point - eye()) : distance_;
    return std::max(depth, kNearPlane * distance_) / focal();
}

} // namespace cellwarp::core
