// SPDX-License-Identifier: GPL-3.0-or-later
// Shapes that are drawn beside a model: rings of corners and what is made of them, and
// what keeps a model out.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "io/formats/geometry.h"
#include "octree/base/rigid_motion.h"

namespace cellwarp::core
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

/// The same in one colour, closed at its ends.
void add_solid(const std::vector<std::vector<Eigen::Vector3d>>& rings,
               const Colour& colour, Geometry& out);

/// Rings of a ball about the origin, moved.
std::vector<std::vector<Eigen::Vector3d>> globe(const Motion& pose, double radius,
                                                int around);

/// What models may touch.
void add_ball(const Eigen::Vector3d& centre, double radius, int around, Geometry& out);
void add_mesh(const Geometry& mesh, Geometry& out);
/// A square of a plane normal . x = offset about the place nearest to \p middle.
void add_tile(const Eigen::Vector3d& normal, double offset, const Eigen::Vector3d& middle,
              double half, Geometry& out);

} // namespace cellwarp::core
