// SPDX-License-Identifier: GPL-3.0-or-later
// Bodies, nets and sheets as they are drawn.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "io/formats/geometry.h"
#include "io/scene/rod_scene.h"
#include "library/time/drawn_shapes.h"
#include "octree/base/rigid_motion.h"

namespace cellwarp::core
{

/// The ball or box of even density that has the body's mass and inertia.
void add_body(const BodyStatement& body, const Motion& pose, int around, Geometry& out);

/// Both sides of a sheet, or the six faces of a block, of points in a grid of \p places
/// along each side.
void add_sheet(const std::string& name, const std::vector<Eigen::Vector3d>& points,
               int places, Geometry& out);

/// Springs as thin tubes.
void add_net(const NetStatement& net, const std::vector<Eigen::Vector3d>& points,
             int around, Geometry& out);

} // namespace cellwarp::core
