// SPDX-License-Identifier: GPL-3.0-or-later
// The quick field: every point follows the cells closest to it, blended.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/cells.h"
#include "solver/pose.h"

namespace cellwarp
{

/// A displacement and its derivative: column k is its change along axis k.
struct FieldValue
{
    Eigen::Vector3d displacement = Eigen::Vector3d::Zero();
    Eigen::Matrix3d gradient = Eigen::Matrix3d::Zero();
};

/// How much a point follows a cell. The weights of a point sum to 1.
struct Influence
{
    int cell = 0;
    double weight = 0.0;
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero(); ///< of the weight
};

/// The point of a box nearest to \p x. Its faces count as inside, also where rounding
/// puts \p x beyond them.
Eigen::Vector3d nearest_in_box(const Eigen::Vector3d& centre, double edge,
                               const Eigen::Vector3d& x);

/// Continuous weights (1 - d/s)^2+, d the distance to the centre of a cell's box
/// and s its edge, over the point's own cell and the cells reached from it through
/// glue between cells of positive weight. So parts that only lie side by side don't
/// pull at each other. On a regular grid at most eight are positive.
class ClosestCells
{
public:
    explicit ClosestCells(const Cells& cells);

    /// \p own: the cell whose material holds \p x, or is nearest to it. Outside of its
    /// box the weights are those of the nearest point of the box. Replaces \p out.
    void influences(const Eigen::Vector3d& x, int own, std::vector<Influence>& out) const;

    const Eigen::Vector3d& box_centre(int cell) const
    {
        return box_centres_[static_cast<std::size_t>(cell)];
    }
    double edge(int cell) const { return edges_[static_cast<std::size_t>(cell)]; }
    std::span<const int> neighbours_of(int cell) const
    {
        const std::size_t c = static_cast<std::size_t>(cell);
        return std::span(neighbours_)
            .subspan(
                static_cast<std::size_t>(first_neighbour_[c]),
                static_cast<std::size_t>(first_neighbour_[c + 1] - first_neighbour_[c]));
    }

private:
    std::vector<Eigen::Vector3d> box_centres_;
    std::vector<double> edges_;
    std::vector<int> first_neighbour_, neighbours_;
};

/// The four closest cells by centre, weights (1 - d_i / d_5)^2 with d_5 the
/// distance of the fifth, equal where all of these vanish. The map jumps where the
/// set changes. [Botsch07], weights of [Sumner07]
class Closest4
{
public:
    explicit Closest4(const Cells& cells);
    ~Closest4();
    Closest4(Closest4&&) noexcept;
    Closest4& operator=(Closest4&&) noexcept;

    /// Replaces \p out. The gradients are left 0: between its jumps the map is
    /// turned by the blended rotations alone.
    void influences(const Eigen::Vector3d& x, std::vector<Influence>& out) const;

private:
    struct Tree;
    std::unique_ptr<Tree> tree_;
};

/// The poses of the influences, blended at \p x.
FieldValue blended(std::span<const Influence> influences, std::span<const Pose> poses,
                   const Cells& cells, const Eigen::Vector3d& x);

} // namespace cellwarp
