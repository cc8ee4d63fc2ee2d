// SPDX-License-Identifier: GPL-3.0-or-later
// Normals that a surface is shown with, where its file has none.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "io/formats/geometry.h"

namespace cellwarp::core
{

/// Unit normals of the samples, as their faces around have them by area; none for a
/// cloud.
std::vector<Eigen::Vector3d> sample_normals(const Geometry& geometry,
                                            std::span<const Eigen::Vector3d> samples);

/// Whether a surface has next to no edges that such normals would round off. False for a
/// cloud.
bool is_smooth(const Geometry& geometry);

/// sample_normals() of a smooth surface, wherever its samples are; of others none. Keeps
/// a reference to \p geometry.
std::function<std::vector<Eigen::Vector3d>(std::span<const Eigen::Vector3d>)>
normals_of_smooth(const Geometry& geometry);

/// normals_of_smooth() where \p output is a .glb, which shows a surface without normals
/// with edges; none for other formats. Keeps a reference to \p geometry.
std::function<std::vector<Eigen::Vector3d>(std::span<const Eigen::Vector3d>)>
normals_to_write(const std::string& output, const Geometry& geometry);

} // namespace cellwarp::core
