// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/sample_normals.h"

#include <cmath>

#include <Eigen/Geometry>

#include "io/base/text.h"
#include "octree/base/parallel.h"

namespace cellwarp::core
{

namespace
{

constexpr std::size_t kNormalsAtOnce = 4096; // of one thread

/// A corner of a face whose normal is farther off the sample's than this lies at a sharp
/// edge: of a box 0.71 or 0.58.
constexpr double kSharpCosine = 0.85;
/// A surface is smooth whose sharp edges are no longer, all together, than this share of
/// the side of a square as large as it: of a cube they are 4.9 times as long.
constexpr double kShortEdges = 0.5;

/// Twice the area, along the normal: the same however the face is cut into triangles.
Eigen::Vector3d area_of(std::span<const std::uint32_t> corners,
                        std::span<const Eigen::Vector3d> samples)
{
    const Eigen::Vector3d& first = samples[corners[0]];
    Eigen::Vector3d area = Eigen::Vector3d::Zero();
    for (std::size_t k = 2; k < corners.size(); ++k)
        area += (samples[corners[k - 1]] - first).cross(samples[corners[k]] - first);
    return area;
}

} // namespace

std::vector<Eigen::Vector3d> sample_normals(const Geometry& geometry,
                                            std::span<const Eigen::Vector3d> samples)
{
    if (geometry.num_faces() == 0)
        return {};
    std::vector<Eigen::Vector3d> normals(samples.size(), Eigen::Vector3d::Zero());
    for (std::size_t f = 0; f < geometry.num_faces(); ++f)
    {
        const std::span<const std::uint32_t> corners = geometry.face(f);
        const Eigen::Vector3d area = area_of(corners, samples);
        for (const std::uint32_t corner : corners)
            normals[corner] += area;
    }
    parallel_ranges(normals.size(), kNormalsAtOnce,
                    [&](std::size_t begin, std::size_t end)
                    {
                        for (std::size_t i = begin; i < end; ++i)
                        {
                            const double length = normals[i].norm();
                            normals[i] = std::isnormal(length)
                                             ? Eigen::Vector3d(normals[i] / length)
                                             : Eigen::Vector3d::UnitZ();
                        }
                    });
    return normals;
}

bool is_smooth(const Geometry& geometry)
{
    if (geometry.num_faces() == 0 || geometry.corners.size() <= geometry.samples.size())
        return false; // a cloud, or faces that have no sample in common
    const std::vector<Eigen::Vector3d> normals =
        sample_normals(geometry, geometry.samples);
    double length = 0.0, area = 0.0;
    for (std::size_t f = 0; f < geometry.num_faces(); ++f)
    {
        const std::span<const std::uint32_t> corners = geometry.face(f);
        const Eigen::Vector3d twice = area_of(corners, geometry.samples);
        area += 0.5 * twice.norm();
        const auto is_sharp = [&](std::uint32_t corner)
        { return normals[corner].dot(twice) < kSharpCosine * twice.norm(); };
        for (std::size_t k = 0; k < corners.size(); ++k)
        {
            const std::uint32_t a = corners[k], b = corners[(k + 1) % corners.size()];
            if (is_sharp(a) && is_sharp(b)) // in this face and in the one beside it
                length += 0.5 * (geometry.samples[b] - geometry.samples[a]).norm();
        }
    }
    return length <= kShortEdges * std::sqrt(area);
}

std::function<std::vector<Eigen::Vector3d>(std::span<const Eigen::Vector3d>)>
normals_of_smooth(const Geometry& geometry)
{
    if (!is_smooth(geometry))
        return {};
    return [&geometry](std::span<const Eigen::Vector3d> samples)
    { return sample_normals(geometry, samples); };
}

std::function<std::vector<Eigen::Vector3d>(std::span<const Eigen::Vector3d>)>
normals_to_write(const std::string& output, const Geometry& geometry)
{
    if (extension_of(output) == "glb")
        return normals_of_smooth(geometry);
    return {};
}

} // namespace cellwarp::core
