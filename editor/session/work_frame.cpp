// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/session/work_frame.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdlib>

#include <fmt/format.h>

#include "io/error.h"
#include "io/number.h"
#include "octree/base/index.h"
#include "octree/base/nearest_rotation.h"

namespace cellwarp
{

namespace
{

Eigen::Vector3d scaled(const Eigen::Vector3d& v, int exponent)
{
    // A factor that is an ordinary number gives the same bits, sooner.
    if (std::abs(exponent) <= 1000)
        return v *
               std::bit_cast<double>(static_cast<std::uint64_t>(1023 + exponent) << 52);
    return {std::ldexp(v.x(), exponent), std::ldexp(v.y(), exponent),
            std::ldexp(v.z(), exponent)};
}

bool is_identity(const Eigen::Matrix3d& axes)
{
    return axes == Eigen::Matrix3d::Identity();
}

/// The exponent that brings a length into [1/2, 1).
int normalising_exponent(const Eigen::Vector3d& size)
{
    const double longest = size.maxCoeff();
    int exponent = 0;
    if (longest > 0)
        std::frexp(longest, &exponent);
    return -exponent;
}

} // namespace

Eigen::Vector3d WorkFrame::to_work(const Eigen::Vector3d& point) const
{
    return vector_to_work(point - origin);
}
Eigen::Vector3d WorkFrame::to_model(const Eigen::Vector3d& point) const
{
    return origin + vector_to_model(point);
}
Eigen::Vector3d WorkFrame::vector_to_work(const Eigen::Vector3d& vector) const
{
    return is_identity(axes) ? scaled(vector, exponent)
                             : Eigen::Vector3d(axes * scaled(vector, exponent));
}
Eigen::Vector3d WorkFrame::vector_to_model(const Eigen::Vector3d& vector) const
{
    return is_identity(axes) ? scaled(vector, -exponent)
                             : scaled(axes.transpose() * vector, -exponent);
}
double WorkFrame::length_to_model(double length) const
{
    return std::ldexp(length, -exponent);
}
Eigen::Matrix3d WorkFrame::rotation_to_work(const Eigen::Matrix3d& R) const
{
    if (is_identity(axes) || is_identity(R))
        return R;
    return axes * R * axes.transpose();
}

Motion WorkFrame::motion_to_model(const Motion& motion) const
{
    const Eigen::Matrix3d R = is_identity(axes)
                                  ? motion.R
                                  : Eigen::Matrix3d(axes.transpose() * motion.R * axes);
    return {R, origin - R * origin + vector_to_model(motion.t)};
}

ModelBox bounding_box(std::span<const Eigen::Vector3d> samples)
{
    ModelBox box{samples.front(), samples.front()};
    for (const Eigen::Vector3d& x : samples)
    {
        box.low = box.low.cwiseMin(x);
        box.high = box.high.cwiseMax(x);
    }
    return box;
}

WorkFrame automatic_frame(const ModelBox& box)
{
    WorkFrame frame;
    frame.origin = box.low;
    frame.exponent = normalising_exponent(box.size());
    frame.size = scaled(box.size(), frame.exponent);
    return frame;
}

WorkFrame given_frame(const FrameBox& box, const std::string& file)
{
    WorkFrame frame;
    frame.origin = Eigen::Vector3d(box.origin[0], box.origin[1], box.origin[2]);
    for (int k = 0; k < 3; ++k)
        for (int c = 0; c < 3; ++c)
            frame.axes(k, c) = box.axes[idx(k)][idx(c)];
    const Eigen::Matrix3d nearest = nearest_rotation(frame.axes);
    const double distance = (frame.axes - nearest).norm();
    if (!(distance <= 1e-4))
        throw malformed({file, 0, "cells.frame.axes"},
                        fmt::format("are no right-handed unit vectors at right angles "
                                    "(off by {:.4g})",
                                    distance));
    if (distance > 1e-15)
        frame.axes = nearest;
    const Eigen::Vector3d size(box.size[0], box.size[1], box.size[2]);
    frame.exponent = normalising_exponent(size);
    frame.size = scaled(size, frame.exponent);
    return frame;
}

} // namespace cellwarp
