// SPDX-License-Identifier: GPL-3.0-or-later
// Joints and bones: from files, from the shape itself, and their places in a frame.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include <cellwarp/control.h>
#include <cellwarp/export.h>
#include <cellwarp/points.h>

namespace cellwarp
{

class Model;

struct Joint
{
    std::string name;
    std::string parent = {};        ///< empty: it is the root
    Vec3 at{};                      ///< place at rest [unit of the edit]
    std::optional<Vec3> hinge = {}; ///< the only axis that it turns about
    std::optional<std::array<double, 2>> twist = {}; ///< least and largest [degree]
    std::optional<double> swing = {};                ///< largest, >= 0 [degree]
    std::optional<double> radius = {};               ///< of its bones, > 0
};

/// A joint in a frame.
struct PosedJoint
{
    std::string name;
    Vec3 place{}; ///< [model unit]
};

/// Joints of a .tgf, .bvh, .gltf or .glb, parents first. All lengths are multiplied by
/// \p scale, and axis \p up ('x', 'y' or 'z') becomes y. Throws Fault::Usage,
/// Fault::File, Fault::Malformed.
CELLWARP_API std::vector<Joint> read_joints(const std::string& path, double scale = 1.0,
                                            char up = 'y');

/// Joints along the centre lines of a shape's limbs, parents first. Needs "cgal". Throws
/// Fault::Unsolvable for a shape without centre lines, Fault::Stopped.
CELLWARP_API std::vector<Joint> joints_of(const Model& model,
                                          const Control& control = {});

} // namespace cellwarp
