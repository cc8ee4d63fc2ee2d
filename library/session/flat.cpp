// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/flat.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Geometry>

namespace cellwarp::core
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
    // Of axes as far from it the last: of a line along x its plane is that of x and y.
    constexpr double kAlike = 1e-12;
    int axis = 2;
    for (const int other : {1, 0})
        if (std::abs(along[other]) < std::abs(along[axis]) - kAlike)
            axis = other;
    const Eigen::Vector3d unit = Eigen::Vector3d::Unit(axis);
    return (unit - unit.dot(along) * along).normalized();
}

/// Three places of many that span a plane well: from the first one the way to the
/// farthest, and across it that to the one farthest off the line between them.
struct Span
{
    Eigen::Vector3d along, side;
};

/// \p off(i): the way to place i from the first.
template <class Off>
Span span_of(std::size_t count, const Off& off)
{
    const Eigen::Vector3d along =
        off(farthest(count, [&](std::size_t i) { return off(i).norm(); }));
    const Eigen::Vector3d direction = along.normalized();
    const auto beside = [&](std::size_t i) -> Eigen::Vector3d
    { return off(i) - direction.dot(off(i)) * direction; };
    return {along,
            beside(farthest(count, [&](std::size_t i) { return beside(i).norm(); }))};
}

/// Whether a few of many samples tell that all of them lie in no plane. Three of them,
/// apart by a hundredth of the diagonal, span a plane, which roundings of the samples
/// make lean a hundred times as much; where another one is off it by a thousandth, and by
/// ten times that lean, they lie in none.
bool are_surely_solid(const std::vector<Eigen::Vector3d>& samples, double diagonal)
{
    constexpr std::size_t kFew = 64;
    constexpr double kApart = 1e-2, kOff = 1e-3;
    if (samples.size() < 16 * kFew)
        return false;
    const auto off = [&](std::size_t k) -> Eigen::Vector3d
    { return (samples[k * (samples.size() / kFew)] - samples[0]) / diagonal; };
    const Span span = span_of(kFew, off);
    if (!(span.along.norm() > kApart && span.side.norm() > kApart))
        return false;
    // As if they were floats.
    const double rounding = 2.0 * std::numeric_limits<float>::epsilon() *
                            (samples[0].cwiseAbs().maxCoeff() / diagonal + 1.0);
    const double surely_off = std::max(kOff, 10.0 * rounding / kApart);
    const Eigen::Vector3d normal = span.along.cross(span.side).normalized();
    for (std::size_t k = 0; k < kFew; ++k)
        if (std::abs(normal.dot(off(k))) > surely_off)
            return true;
    return false;
}

/// A plane that holds samples, and how far across their longest line they reach in it
/// [diagonal].
struct FoundPlane
{
    Eigen::Vector3d normal;
    double width;
};

std::optional<FoundPlane> plane_of(const std::vector<Eigen::Vector3d>& samples)
{
    const double diagonal = bounding_box(samples).size().stableNorm();
    if (!(diagonal > 0.0))
        return FoundPlane{Eigen::Vector3d::UnitZ(), 0.0};
    if (are_surely_solid(samples, diagonal))
        return std::nullopt;
    const auto off = [&](std::size_t i) -> Eigen::Vector3d
    { return (samples[i] - samples[0]) / diagonal; };
    const Span span = span_of(samples.size(), off);
    const Eigen::Vector3d along = span.along.normalized(), side = span.side;
    // Half a unit of each coordinate's last place, if files hold them so.
    const bool are_floats = std::all_of(samples.begin(), samples.end(),
                                        [](const Eigen::Vector3d& x)
                                        { return x == x.cast<float>().cast<double>(); });
    double largest = 0.0;
    for (const Eigen::Vector3d& x : samples)
        largest = std::max(largest, x.cwiseAbs().maxCoeff());
    const double tolerance =
        std::max(kInPlane, 2.0 *
                               (are_floats ? std::numeric_limits<float>::epsilon()
                                           : std::numeric_limits<double>::epsilon()) *
                               largest / diagonal);
    const auto has_all = [&](const Eigen::Vector3d& normal)
    {
        for (std::size_t i = 0; i < samples.size(); ++i)
            if (!(std::abs(normal.dot(off(i))) <= tolerance))
                return false;
        return true;
    };
    const Eigen::Vector3d normal =
        side.norm() > tolerance ? along.cross(side).normalized() : across(along);
    int axis = 0;
    normal.cwiseAbs().maxCoeff(&axis);
    if (const Eigen::Vector3d unit = Eigen::Vector3d::Unit(axis); has_all(unit))
        return FoundPlane{unit, side.norm()};
    return has_all(normal) ? std::optional(FoundPlane{normal, side.norm()})
                           : std::nullopt;
}

} // namespace

std::optional<Eigen::Vector3d> plane_normal(const std::vector<Eigen::Vector3d>& samples)
{
    const std::optional<FoundPlane> plane = plane_of(samples);
    return plane ? std::optional(plane->normal) : std::nullopt;
}

std::optional<Eigen::Vector3d> spanned_plane(const std::vector<Eigen::Vector3d>& samples)
{
    // Samples in a narrower strip are a line: rounding alone would choose their plane.
    constexpr double kLine = 1e-6; // [diagonal]
    const std::optional<FoundPlane> plane = plane_of(samples);
    return plane && plane->width > kLine ? std::optional(plane->normal) : std::nullopt;
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
                 const Eigen::Vector3d& place, double diagonal, double kept)
{
    return (motion.R * normal - normal).norm() <= kept &&
           std::abs(normal.dot(motion(place) - place)) <= kept * diagonal;
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

} // namespace cellwarp::core
