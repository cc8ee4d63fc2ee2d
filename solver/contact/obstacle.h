// SPDX-License-Identifier: GPL-3.0-or-later
// What stands still and can be touched: planes, spheres, meshes.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include <Eigen/Core>

namespace cellwarp::core
{

/// A place of an obstacle that is nearer to a point than its surroundings are.
struct NearPlace
{
    Eigen::Vector3d place;  ///< [m]
    Eigen::Vector3d normal; ///< unit vector from there towards the point
};

class Obstacle
{
public:
    virtual ~Obstacle() = default;
    /// \p out: those within \p reach of \p point, added.
    virtual void near(const Eigen::Vector3d& point, double reach,
                      std::vector<NearPlace>& out) const = 0;
};

/// Everything with normal . x < offset. Throws std::invalid_argument for a normal without
/// length.
std::unique_ptr<Obstacle> plane_obstacle(const Eigen::Vector3d& normal, double offset);
std::unique_ptr<Obstacle> sphere_obstacle(const Eigen::Vector3d& centre, double radius);
/// Triangles that are touched from both sides: sheets, solids, boxes with something in
/// them.
std::unique_ptr<Obstacle>
mesh_obstacle(std::vector<Eigen::Vector3d> vertices,
              std::vector<std::array<std::uint32_t, 3>> triangles);

/// The place of a triangle that is nearest to a point.
Eigen::Vector3d nearest_on_triangle(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                                    const Eigen::Vector3d& c,
                                    const Eigen::Vector3d& point);

} // namespace cellwarp::core
