// SPDX-License-Identifier: GPL-3.0-or-later
// The quick field: every point follows the cells closest to it, blended.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/base/index.h"
#include "octree/base/rigid_motion.h"
#include "octree/cells.h"

namespace cellwarp::core
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

/// So far beyond its faces a box still counts as holding a point [edge]: rounding.
inline constexpr double kBoxSlack = 1e-9;

/// The point of a box nearest to \p x; of one that it holds, that one.
Eigen::Vector3d nearest_in_box(const Eigen::Vector3d& centre, double edge,
                               const Eigen::Vector3d& x);

/// How far from its box a cell resists as it does farther off, but for a half [edge].
inline constexpr double kShell = 0.1;

/// How much a cell resists at a place to whatever is reached through it (blend.cpp);
/// \p rest = 1 - d/s > 0. Of one place, or of several.
template <class Number>
Number passing_resistance(const Number& squared_distance_to_box, double edge,
                          const Number& rest)
{
    const double shell = kShell * edge;
    return 0.4 * squared_distance_to_box /
           ((squared_distance_to_box + shell * shell) * rest * rest);
}

/// Weights (1 - d/s)^2+, d the distance to the centre of a cell's box and s its edge,
/// over the point's own cell and the cells reached from it through glue between cells of
/// positive weight: parts that only lie side by side don't pull at each other. A cell
/// that is reached but narrowly, through cells that hardly count themselves, counts less
/// (blend.cpp says how much). So the weights are continuous through all material, and
/// their gradients but at the boxes' centres. On a regular grid at most eight are
/// positive.
class ClosestCells
{
public:
    explicit ClosestCells(const Cells& cells);

    /// \p own: the cell whose material holds \p x, or is nearest to it. Outside of its
    /// box the weights are those of the nearest point of the box. Replaces \p out.
    void influences(const Eigen::Vector3d& x, int own, std::vector<Influence>& out) const;

    const Eigen::Vector3d& box_centre(int cell) const { return box_centres_[idx(cell)]; }
    double edge(int cell) const { return edges_[idx(cell)]; }
    std::span<const int> neighbours_of(int cell) const
    {
        const std::size_t c = idx(cell);
        return std::span(neighbours_)
            .subspan(idx(first_neighbour_[c]),
                     idx(first_neighbour_[c + 1] - first_neighbour_[c]));
    }

private:
    struct Resistance
    {
        double value = 0.0;
        Eigen::Vector3d slope = Eigen::Vector3d::Zero();
    };
    void reach(const Eigen::Vector3d& place, int own, std::vector<Influence>& out,
               bool& is_narrow) const;
    Resistance resistance_at(const Eigen::Vector3d& place, int cell) const;
    void narrow(const Eigen::Vector3d& place, int own, std::vector<Influence>& out) const;

    std::vector<Eigen::Vector3d> box_centres_;
    std::vector<double> edges_;
    std::vector<int> first_neighbour_, neighbours_;
};

/// The four closest cells by centre, all with the same weight. The map jumps where the
/// set changes. [Botsch07]
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

} // namespace cellwarp::core
