// SPDX-License-Identifier: GPL-3.0-or-later
// The scenes on which the literature measures deformation, made in memory: a twisted
// bar, a bent cylinder and, where it is at hand, the armadillo. Written to files they
// are what the program itself reads.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "octree/material.h"

namespace cellwarp::core::bench
{

struct Scene
{
    std::string name;
    Shape shape;                      ///< a closed triangle mesh, outward faces
    std::vector<std::uint32_t> fixed; ///< samples that stay
    std::vector<std::uint32_t> moved; ///< samples that follow `motion`
    Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
    std::string handles; ///< the same as the text of a handle file
};

/// bar6k, bar50k, bar200k, bar1m, cyl5k, cyl500k, and armadillo, which needs
/// CELLWARP_TEST_DATA to name a folder with armadillo.obj.
std::vector<std::string> scene_names();

/// Throws Fault::Usage for a name that is not one of scene_names(), or for armadillo
/// without its file.
Scene make_scene(const std::string& name);

/// Writes NAME.obj, NAME.handles and NAME.json, and with the regions as lists of samples
/// NAME-lists.handles and NAME-lists.json, over what is there.
void write_scene(const Scene& scene, const std::filesystem::path& folder);

/// The diagonal of the bounding box: what errors are relative to [model unit].
double diagonal(const Shape& shape);

} // namespace cellwarp::core::bench
