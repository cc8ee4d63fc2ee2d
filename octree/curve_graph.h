// SPDX-License-Identifier: GPL-3.0-or-later
// The curve skeleton of a shape as a graph, without spurs, and lines along its branches,
// brought back to the middle. curve_graph.cpp tells how.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "octree/material.h"
#include "octree/wrap/skeleton.h"

namespace cellwarp::core
{

struct CurveOptions
{
    /// Branches to a tip that are shorter than so many radii of where they leave are
    /// spurs: pointed ones, as those to the corners of a box, and blunt ones.
    double pointed_spur = 2.0, blunt_spur = 2.0;
    /// Surfaces of more triangles are wrapped: the flow's time grows faster than they do,
    /// and a limb shows in a few thousand as well.
    std::size_t most_triangles = 20000;
};

class CurveGraph
{
public:
    /// Graph of the first of closed_surfaces() that holds nearly all of \p shape, else
    /// the one that holds most of it. Empty where there is none, and in a build without
    /// CGAL.
    CurveGraph(const Shape& shape, const CurveOptions& options);

    bool is_empty() const { return skeleton_.edges.empty(); }
    int size() const { return static_cast<int>(is_gone_.size()); }
    bool is_there(int node) const { return !is_gone_[static_cast<std::size_t>(node)]; }
    const Eigen::Vector3d& place(int node) const
    {
        return skeleton_.points[static_cast<std::size_t>(node)];
    }
    /// Distance of the surface.
    double radius(int node) const { return radius_[static_cast<std::size_t>(node)]; }
    const std::vector<Eigen::Vector3d>& surface() const { return surface_.samples; }
    /// Whether the surface encloses a place.
    bool is_inside(const Eigen::Vector3d& x) const;

    std::vector<int> around(int node) const;
    int degree(int node) const;
    std::vector<int> tips() const;
    /// From a node, by one of those around it, to the next branching or tip.
    std::vector<int> branch(int node, int next) const;
    double length_of(const std::vector<int>& way) const;
    int farthest_from(int start, std::vector<int>* way = nullptr) const;
    /// The least radius along a way, but for its last node.
    double least_radius(const std::vector<int>& way) const;
    /// A way as a smooth line of \p count places in the middle of the shape, on to near
    /// the surface at a tip.
    std::vector<Eigen::Vector3d> line(const std::vector<int>& way, int count) const;
    /// The same where the flow has left it, smoothed a little: also near branchings,
    /// where the shape has no ring around a line.
    std::vector<Eigen::Vector3d> plain_line(const std::vector<int>& way, int count) const;

private:
    void find(const Shape& shape);
    double length(int a, int b) const;
    void cut_spurs();
    std::pair<double, int> spur_of(int tip) const;
    void extend(const std::vector<int>& way, std::vector<Eigen::Vector3d>& places) const;
    Eigen::Vector3d middle(const std::vector<int>& way, std::size_t k) const;
    std::pair<std::vector<double>, std::vector<int>> ways_from(int start) const;

    CurveOptions options_;
    Shape surface_;
    CurveSkeleton skeleton_;
    std::vector<std::vector<int>> neighbours_;
    std::vector<double> radius_;
    std::vector<bool> is_gone_;
    std::vector<std::vector<Eigen::Vector3d>> around_; ///< what came to each place
};

} // namespace cellwarp::core
