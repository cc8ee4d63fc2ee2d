// SPDX-License-Identifier: GPL-3.0-or-later
// What keeps flesh out: ground and balls, with friction; and what pulls at it. Each is an
// equation on the velocities of a step. [theory-skeleton 8]
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "solver/flesh/sparse_rows.h"

namespace cellwarp::core
{

/// Where it is at the end of a step.
struct FleshObstacle
{
    /// Of a plane, everything with normal . x < offset is kept free; of a sphere its
    /// inside.
    std::optional<Eigen::Vector3d> normal;              ///< of a plane, a unit vector
    double offset = 0.0;                                ///< [m]
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();   ///< of a sphere [m]
    double radius = 0.0;                                ///< [m]
    Eigen::Vector3d velocity = Eigen::Vector3d::Zero(); ///< in the step [m/s]
    double friction = 0.0;

    /// Distance of a point from it, negative inside, and the way out.
    struct Gap
    {
        double gap;
        Eigen::Vector3d normal;
    };
    Gap gap(const Eigen::Vector3d& point) const;
};

/// A point of the material.
struct FleshPoint
{
    NodeShares shares;                               ///< of nodes that do not hang
    Eigen::Vector3d place = Eigen::Vector3d::Zero(); ///< at rest [m]
};

/// A point that is where it is told, or as far along a direction as it is told.
struct PulledPoint
{
    FleshPoint point;
    Eigen::Vector3d goal = Eigen::Vector3d::Zero(); ///< at the end of the step [m]
    std::optional<Eigen::Vector3d> normal;          ///< along it alone; a unit vector
};

/// All of that in one step.
struct FleshSurroundings
{
    std::span<const FleshObstacle> obstacles = {};
    std::span<const PulledPoint> pulled = {};
};

/// What touched in a step.
struct FleshContacts
{
    std::size_t count = 0;                           ///< points that touch
    Eigen::Vector3d force = Eigen::Vector3d::Zero(); ///< of the obstacles on it [N]
    Eigen::Vector3d pull = Eigen::Vector3d::Zero();  ///< of what pulls [N]
    int rounds = 0;
    bool is_settled = true; ///< what touches was found
};

/// Of each node the points of the surface that are nearest to it: at most one touches.
class FleshSurface
{
public:
    FleshSurface() = default;
    FleshSurface(std::vector<FleshPoint> points, std::size_t num_nodes);

    const FleshPoint& operator[](std::size_t point) const { return points_[point]; }

    /// A point that is deeper in an obstacle than all others of its node.
    struct Candidate
    {
        std::size_t obstacle, point;
        int node;
        double gap;
        Eigen::Vector3d normal;
    };
    /// At displacements \p u, those with a gap below \p most; ascending by obstacle and
    /// node.
    std::vector<Candidate> candidates(const Eigen::VectorXd& u, double most,
                                      std::span<const FleshObstacle> obstacles) const;

private:
    std::vector<FleshPoint> points_;
    std::vector<std::size_t> first_of_node_, points_of_node_;
};

} // namespace cellwarp::core
