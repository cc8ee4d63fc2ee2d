// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/session/flat.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

namespace cellwarp
{

namespace
{

/// The place farthest from what \p distance tells.
template <class Distance>
std::size_t farthest(std::size_t count, const Distance& distance)
{
    std::size_t best = 0;
    double most = -1.0;
    for (std::size_t i = 0; i < count; ++i)
        if (const double d = distance(i); d > most)
        {
            most = d;
            best = i;
        }
    return best;
}

/// A unit vector across \p along, in the plane of it and the axis farthest from it.
Eigen::Vector3d across(const Eigen::Vector3d& along)
{
    int axis = 0;
    along.cwiseAbs().minCoeff(&axis);
    const Eigen::Vector3d unit = Eigen::Vector3d::Unit(axis);
    return (unit - unit.dot(along) * along).normalized();
}

} // namespace

std::optional<Eigen::Vector3d> plane_normal(const std::vector<Eigen::Vector3d>& samples)
{
    const double diagonal = bounding_box(samples).size().stableNorm();
    if (!(diagonal > 0.0))
        return Eigen::Vector3d::UnitZ();
    const auto off = [&](std::size_t i) -> Eigen::Vector3d
    { return (samples[i] - samples[0]) / diagonal; };
    const Eigen::Vector3d far =
        off(farthest(samples.size(), [&](std::size_t i) { return off(i).norm(); }));
    const Eigen::Vector3d along = far.normalized();
    const auto beside = [&](std::size_t i) -> Eigen::Vector3d
    { return off(i) - along.dot(off(i)) * along; };
    const Eigen::Vector3d side =
        beside(farthest(samples.size(), [&](std::size_t i) { return beside(i).norm(); }));
    Eigen::Vector3d normal =
        side.norm() > kInPlane ? along.cross(side).normalized() : across(along);
    int axis = 0;
    if (normal.cwiseAbs().maxCoeff(&axis) >= 1.0 - 0.5 * kInPlane * kInPlane)
        normal = Eigen::Vector3d::Unit(axis);
    for (std::size_t i = 0; i < samples.size(); ++i)
        if (!(std::abs(normal.dot(off(i))) <= kInPlane))
            return std::nullopt;
    return normal;
}

WorkFrame frame_along_plane(const std::vector<Eigen::Vector3d>& samples,
                            const Eigen::Vector3d& normal)
{
    Eigen::Matrix3d axes;
    axes.row(0) = across(normal);
    axes.row(2) = normal;
    axes.row(1) = normal.cross(axes.row(0).transpose());
    std::vector<Eigen::Vector3d> turned;
    for (const Eigen::Vector3d& x : samples)
        turned.emplace_back(axes * x);
    WorkFrame frame = automatic_frame(bounding_box(turned));
    frame.axes = axes;
    frame.origin = axes.transpose() * frame.origin;
    return frame;
}

bool keeps_plane(const Motion& motion, const Eigen::Vector3d& normal,
                 const Eigen::Vector3d& place, double diagonal)
{
    return (motion.R * normal - normal).norm() <= kInPlane &&
           std::abs(normal.dot(motion(place) - place)) <= kInPlane * diagonal;
}

void keep_in_plane(const Eigen::Vector3d& normal,
                   const std::vector<Eigen::Vector3d>& rest,
                   std::vector<Eigen::Vector3d>& moved)
{
    int axis = 0;
    const bool is_axis = normal.cwiseAbs().maxCoeff(&axis) == 1.0;
    for (std::size_t i = 0; i < moved.size(); ++i)
        if (is_axis)
            moved[i][axis] = rest[i][axis];
        else
            moved[i] -= normal.dot(moved[i] - rest[i]) * normal;
}

} // namespace cellwarp
