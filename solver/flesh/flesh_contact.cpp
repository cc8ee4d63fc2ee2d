// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/flesh/flesh_contact.h"

#include <algorithm>
#include <utility>

#include "octree/base/index.h"
#include "octree/base/parallel.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr std::size_t kNodesAtOnce = 256;

} // namespace

FleshObstacle::Gap FleshObstacle::gap(const Vector3d& point) const
{
    if (normal)
        return {normal->dot(point) - offset, *normal};
    const Vector3d way = point - centre;
    const double length = way.norm();
    return {length - radius, length > 0.0 ? Vector3d(way / length) : Vector3d::UnitY()};
}

FleshSurface::FleshSurface(std::vector<FleshPoint> points, std::size_t num_nodes)
    : points_(std::move(points))
{
    std::vector<int> node_of_point;
    std::vector<std::size_t> counts(num_nodes + 1, 0);
    for (const FleshPoint& point : points_)
    {
        const auto nearest = std::max_element(point.shares.begin(), point.shares.end(),
                                              [](const NodeShare& a, const NodeShare& b)
                                              { return a.share < b.share; });
        node_of_point.push_back(nearest->node);
        ++counts[idx(nearest->node) + 1];
    }
    first_of_node_.resize(num_nodes + 1, 0);
    for (std::size_t n = 0; n < num_nodes; ++n)
        first_of_node_[n + 1] = first_of_node_[n] + counts[n + 1];
    points_of_node_.resize(points_.size());
    std::vector<std::size_t> next(first_of_node_.begin(), first_of_node_.end() - 1);
    for (std::size_t p = 0; p < points_.size(); ++p)
        points_of_node_[next[idx(node_of_point[p])]++] = p;
}

std::vector<FleshSurface::Candidate>
FleshSurface::candidates(const VectorXd& u, double most,
                         std::span<const FleshObstacle> obstacles) const
{
    const std::size_t num_nodes = first_of_node_.empty() ? 0 : first_of_node_.size() - 1;
    std::vector<std::optional<Candidate>> deepest(num_nodes * obstacles.size());
    parallel_for(num_nodes, kNodesAtOnce,
                 [&](std::size_t n)
                 {
                     for (std::size_t k = first_of_node_[n]; k < first_of_node_[n + 1];
                          ++k)
                     {
                         const FleshPoint& point = points_[points_of_node_[k]];
                         const Vector3d now = point.place + at_point(point.shares, u);
                         for (std::size_t o = 0; o < obstacles.size(); ++o)
                         {
                             const FleshObstacle::Gap gap = obstacles[o].gap(now);
                             std::optional<Candidate>& best = deepest[o * num_nodes + n];
                             if (gap.gap < (best ? best->gap : most))
                                 best = {o, points_of_node_[k], static_cast<int>(n),
                                         gap.gap, gap.normal};
                         }
                     }
                 });
    std::vector<Candidate> out;
    for (const std::optional<Candidate>& one : deepest)
        if (one)
            out.push_back(*one);
    return out;
}

} // namespace cellwarp::core
