// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/spline_region.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <system_error>

#include "io/base/error.h"
#include "io/formats/face_triangles.h"
#include "library/session/body.h"
#include "octree/base/segment.h"
#include "octree/centre_line.h"

namespace cellwarp::core
{

namespace
{

/// Pieces of a tube in one shape: few shapes, and boxes that leave out most of space.
constexpr std::size_t kPiecesOfTube = 16;

/// What part of the diagonal a cell is taken for where there are none yet.
constexpr double kUsualEdge = 1.0 / 32.0;

std::vector<RegionShape> tube_of(const SplineHandle& spline, const Units& units)
{
    std::vector<RegionShape> shapes;
    std::vector<Eigen::Vector3d> line;
    for (const Eigen::Vector3d& x : spline.polyline())
        line.push_back(units.frame.to_model(x));
    const double r = units.frame.length_to_model(spline.radius());
    for (std::size_t first = 0; first + 1 < line.size(); first += kPiecesOfTube)
    {
        const std::vector<Eigen::Vector3d> part(
            line.begin() + std::ptrdiff_t(first),
            line.begin() +
                std::ptrdiff_t(std::min(first + kPiecesOfTube + 1, line.size())));
        Eigen::Vector3d low = part[0], high = part[0];
        for (const Eigen::Vector3d& x : part)
        {
            low = low.cwiseMin(x);
            high = high.cwiseMax(x);
        }
        low.array() -= r;
        high.array() += r;
        const auto from_line = [=](const Eigen::Vector3d& x)
        {
            double least = INFINITY;
            for (std::size_t k = 0; k + 1 < part.size(); ++k)
            {
                const double t = nearest_share(part[k], part[k + 1], x);
                least = std::min(
                    least, (x - part[k] - t * (part[k + 1] - part[k])).squaredNorm());
            }
            return std::sqrt(least);
        };
        shapes.push_back(
            {[=](const Eigen::Vector3d& x)
             {
                 return (x.array() >= low.array()).all() &&
                        (x.array() <= high.array()).all() && from_line(x) <= r;
             },
             [=](const Eigen::Vector3d& x) { return from_line(x) - r; }, low, high});
    }
    return shapes;
}

/// The edge of a coarsest cell [work].
double edge_of(const Units& units)
{
    return units.cell_edge > 0 ? units.cell_edge : kUsualEdge * units.frame.diagonal();
}

/// Half a coarsest cell, unless the statement tells.
double radius_of(const SplineStatement& statement, const Units& units)
{
    if (!statement.radii.empty())
    {
        const double unit = units.is_relative ? units.box.size().norm() : 1.0;
        return std::ldexp(statement.radii.front() * unit, units.frame.exponent);
    }
    return 0.5 * edge_of(units);
}

/// Spans in each gap: those of the statement, but of a rod that pushes back so few that
/// they are no shorter than a cell on average. Cells act on such a rod at their centres
/// alone. Shorter spans would resolve its way from a held place to the next centre, on
/// which a rod that bends but does not shear kinks under the cells' forces.
std::int64_t spans_of(const SplineStatement& statement,
                      std::span<const Eigen::Vector3d> points, const Units& units)
{
    if (!statement.stiffness || points.size() < 2)
        return statement.spans;
    double length = statement.is_closed ? (points.front() - points.back()).norm() : 0.0;
    for (std::size_t k = 1; k < points.size(); ++k)
        length += (points[k] - points[k - 1]).norm();
    const std::size_t gaps = points.size() - (statement.is_closed ? 0 : 1);
    const double cells = length / static_cast<double>(gaps) / edge_of(units);
    return static_cast<std::int64_t>(
        std::clamp(cells, 1.0, static_cast<double>(statement.spans)));
}

/// A rod stays nearer to the centre line than this, of the limb's radius and of its
/// length.
constexpr double kOffCentre = 0.15, kOffLength = 0.004;

} // namespace

std::vector<Eigen::Vector3d> centre_points(const RegionStatement& statement,
                                           const Geometry& geometry,
                                           const std::vector<Eigen::Vector3d>& samples,
                                           const std::vector<std::uint32_t>& near,
                                           const Units& units, const std::string& file)
{
    Shape shape;
    shape.triangles = triangles_of(geometry);
    for (const Eigen::Vector3d& x : samples)
        shape.samples.push_back(units.frame.to_work(x));
    CentreLine line;
    try
    {
        line = centre_line(shape, near);
    }
    catch (const std::system_error& error)
    {
        if (error.code() == std::errc::resource_unavailable_try_again)
            throw; // no thread, and no file
        throw Error(Fault::File,
                    at({file, statement.line, statement.name}, error.what()));
    }
    if (line.places.empty())
        throw Error(Fault::Unsolvable,
                    at({file, statement.line, statement.name},
                       "the shape has no centre line there (this needs a closed surface, "
                       "or samples that one can be wrapped around, and a build with "
                       "CGAL)"));
    double length = 0.0;
    for (std::size_t k = 1; k < line.places.size(); ++k)
        length += (line.places[k] - line.places[k - 1]).norm();
    return few_points(line.places,
                      std::max(kOffCentre * line.radius, kOffLength * length));
}

void put_led_rod(const LedRod& rod, const Units& units, Region& region)
{
    region.spline = rod.at_rest(units.frame);
    region.shapes = tube_of(*region.spline, units);
}

void put_spline(const RegionStatement& statement, std::span<const Eigen::Vector3d> points,
                const Units& units, const std::string& file, Region& region)
{
    const bool is_rod = statement.role == Role::Rod;
    SplineStatement spline = *statement.spline;
    if (spline.form == SplineStatement::Form::Skeleton)
        spline.form = SplineStatement::Form::Through;
    spline.spans = region.spans = spans_of(spline, points, units);
    try
    {
        region.spline = std::make_shared<const SplineHandle>(spline, points, is_rod,
                                                             radius_of(spline, units));
    }
    catch (const std::invalid_argument& error)
    {
        throw malformed({file, statement.line, statement.name}, error.what());
    }
    region.told = statement.spline;
    region.is_exact = statement.spline->is_exact;
    if (is_rod)
        region.shapes = tube_of(*region.spline, units);
}

} // namespace cellwarp::core
