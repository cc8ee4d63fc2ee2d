// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/session/volume.h"

#include <algorithm>
#include <cstdint>
#include <span>
#include <utility>

#include <Eigen/Geometry>

namespace cellwarp
{

namespace
{

/// The volume that a closed mesh, its faces as fans, encloses: a sixth of the sum of
/// the triple products.
double enclosed_volume(const Geometry& geometry,
                       const std::vector<Eigen::Vector3d>& samples)
{
    const Eigen::Vector3d origin = samples.front();
    double sum = 0.0;
    for (std::size_t f = 0; f < geometry.num_faces(); ++f)
    {
        const std::span<const std::uint32_t> corners = geometry.face(f);
        const Eigen::Vector3d a = samples[corners[0]] - origin;
        for (std::size_t k = 2; k < corners.size(); ++k)
            sum += a.dot(
                (samples[corners[k - 1]] - origin).cross(samples[corners[k]] - origin));
    }
    return sum / 6.0;
}

/// Whether every edge has exactly two faces, which pass it in opposite directions.
bool is_closed(const Geometry& geometry)
{
    if (geometry.num_faces() == 0)
        return false;
    std::vector<std::pair<std::uint32_t, std::uint32_t>> edges;
    edges.reserve(geometry.corners.size());
    for (std::size_t f = 0; f < geometry.num_faces(); ++f)
    {
        const std::span<const std::uint32_t> corners = geometry.face(f);
        for (std::size_t k = 0; k < corners.size(); ++k)
            edges.emplace_back(corners[k], corners[(k + 1) % corners.size()]);
    }
    std::sort(edges.begin(), edges.end());
    if (std::adjacent_find(edges.begin(), edges.end()) != edges.end())
        return false;
    return std::all_of(edges.begin(), edges.end(),
                       [&](const auto& edge)
                       {
                           return edge.first != edge.second &&
                                  std::binary_search(edges.begin(), edges.end(),
                                                     std::pair(edge.second, edge.first));
                       });
}

} // namespace

std::optional<Volume> enclosed_volumes(const Geometry& geometry,
                                       const std::vector<Eigen::Vector3d>& samples)
{
    if (!is_closed(geometry))
        return std::nullopt;
    return Volume{enclosed_volume(geometry, geometry.samples),
                  enclosed_volume(geometry, samples)};
}

} // namespace cellwarp
