// SPDX-License-Identifier: GPL-3.0-or-later
// Nearest neighbours among points.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

namespace cellwarp::core
{

/// A k-d tree over a copy of the points. Immutable, safe for many threads.
class PointTree
{
public:
    /// \pre \p points is not empty.
    explicit PointTree(std::span<const Eigen::Vector3d> points);
    ~PointTree();
    PointTree(PointTree&&) noexcept;
    PointTree& operator=(PointTree&&) noexcept;

    struct Neighbour
    {
        std::size_t index;
        double distance_squared;
    };

    const std::vector<Eigen::Vector3d>& points() const;
    Neighbour nearest(const Eigen::Vector3d& x) const;
    /// The \p count nearest, nearest first; fewer if there are fewer. Replaces \p out.
    void nearest(const Eigen::Vector3d& x, std::size_t count,
                 std::vector<Neighbour>& out) const;
    /// All that are nearer than \p distance, in no order. Replaces \p out.
    void within(const Eigen::Vector3d& x, double distance,
                std::vector<Neighbour>& out) const;

private:
    struct Index;
    std::unique_ptr<Index> index_;
};

} // namespace cellwarp::core
