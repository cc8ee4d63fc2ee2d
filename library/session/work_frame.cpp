// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/work_frame.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include <fmt/format.h>

#include "io/base/error.h"
#include "io/base/number.h"
#include "octree/base/index.h"
#include "octree/base/nearest_rotation.h"
#include "octree/base/parallel.h"

namespace cellwarp::core
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
    constexpr std::size_t kSamplesOfPart = std::size_t{1} << 16; // of one thread
    const std::size_t num_parts = (samples.size() + kSamplesOfPart - 1) / kSamplesOfPart;
    std::vector<ModelBox> parts(num_parts, {samples.front(), samples.front()});
    parallel_for(num_parts, 1,
                 [&](std::size_t part)
                 {
                     ModelBox box = parts[part];
                     const std::size_t begin = part * kSamplesOfPart;
                     for (const Eigen::Vector3d& x : samples.subspan(
                              begin, std::min(kSamplesOfPart, samples.size() - begin)))
                     {
                         box.low = box.low.cwiseMin(x);
                         box.high = box.high.cwiseMax(x);
                     }
                     parts[part] = box;
                 });
    ModelBox box = parts.front();
    for (const ModelBox& part : parts)
    {
        box.low = box.low.cwiseMin(part.low);
        box.high = box.high.cwiseMax(part.high);
    }
    return box;
}

std::string place_text(const Eigen::Vector3d& x, double size)
{
    int digits_behind = 0;
    if (size > 0.0 && std::isfinite(size))
        digits_behind =
            static_cast<int>(std::clamp(3.0 - std::floor(std::log10(size)), 0.0, 15.0));
    const auto text = [&](double number)
    {
        constexpr double kLastUnit = 1e15; // larger ones are whole numbers
        if (!(std::abs(number) < kLastUnit))
            return shortest(number);
        const std::string fixed = fmt::format("{:.{}f}", number, digits_behind);
        return fixed.find_first_not_of("-0.") == std::string::npos ? "0" : fixed;
    };
    return text(x.x()) + " " + text(x.y()) + " " + text(x.z());
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

} // namespace cellwarp::core
