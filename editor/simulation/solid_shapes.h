// SPDX-License-Identifier: GPL-3.0-or-later
// What moves as it is drawn: rings of corners and what is made of them.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "io/geometry.h"
#include "io/rod_scene.h"
#include "octree/base/rigid_motion.h"

namespace cellwarp
{

using Colour = std::array<std::uint8_t, 3>;

/// Corners of an ellipse about \p middle with the half axes a and b.
std::vector<Eigen::Vector3d> ring(const Eigen::Vector3d& middle, const Eigen::Vector3d& a,
                                  const Eigen::Vector3d& b, int around,
                                  double phase = 0.0);

/// Rings of equally many corners, a colour each, joined one by one to a tube: around, or
/// closed by a face at both ends.
void add_rings(const std::vector<std::vector<Eigen::Vector3d>>& rings,
               std::span<const Colour> colours, bool is_closed, Geometry& out);

/// The ball or box of even density that has the body's mass and inertia.
void add_body(const BodyStatement& body, const Motion& pose, int around, Geometry& out);

/// What rods may touch.
void add_ball(const Eigen::Vector3d& centre, double radius, int around, Geometry& out);
void add_mesh(const Geometry& mesh, Geometry& out);
/// A square of a plane normal . x = offset about the place nearest to \p middle.
void add_tile(const Eigen::Vector3d& normal, double offset, const Eigen::Vector3d& middle,
              double half, Geometry& out);

/// Both sides of a sheet, or the six faces of a block, of points in a grid of \p places
/// along each side.
void add_sheet(const std::string& name, const std::vector<Eigen::Vector3d>& points,
               int places, Geometry& out);

/// Springs as thin tubes.
void add_net(const NetStatement& net, const std::vector<Eigen::Vector3d>& points,
             int around, Geometry& out);

} // namespace cellwarp
