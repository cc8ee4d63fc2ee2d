// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/volume.h"

#include <cstdint>
#include <span>

#include <Eigen/Geometry>

#include "io/formats/face_triangles.h"
#include "octree/base/edges.h"

namespace cellwarp::core
{

namespace
{

/// The volume that a closed mesh encloses: a sixth of the sum of the triple products.
double enclosed_volume(const Geometry& geometry,
                       const std::vector<Eigen::Vector3d>& samples)
{
    const Eigen::Vector3d origin = samples.front();
    double sum = 0.0;
    FaceCutter cutter(geometry);
    for (std::size_t f = 0; f < geometry.num_faces(); ++f)
        for (const auto& [a, b, c] : cutter.triangles(f))
            sum += (samples[a] - origin)
                       .dot((samples[b] - origin).cross(samples[c] - origin));
    return sum / 6.0;
}

/// Whether every edge has exactly two faces, which pass it in opposite directions.
bool is_closed(const Geometry& geometry)
{
    if (geometry.num_faces() == 0)
        return false;
    const auto each_pass = [&](const auto& pass)
    {
        for (std::size_t f = 0; f < geometry.num_faces(); ++f)
        {
            const std::span<const std::uint32_t> corners = geometry.face(f);
            for (std::size_t k = 0; k < corners.size(); ++k)
                pass(corners[k], corners[(k + 1) % corners.size()]);
        }
    };
    bool all_match = true;
    for_each_edge(geometry.samples.size(), each_pass,
                  [&](const Edge& edge)
                  {
                      all_match = all_match && edge.low != edge.high &&
                                  edge.forward == 1 && edge.backward == 1;
                  });
    return all_match;
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

} // namespace cellwarp::core
