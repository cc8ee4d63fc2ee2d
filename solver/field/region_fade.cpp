// SPDX-License-Identifier: GPL-3.0-or-later
// With weights w_r of the regions and e_r the misses carried to x,
//   F = f + (sum a_r e_r) / (a + sum a_r),
//   a = prod (1 - w_s),  a_r = w_r prod_{s != r} (1 - w_s).
// One region alone gives f + w e. Where one weight is 1 all other terms vanish, so
// that every region is met at its samples. What fades is the miss, a fraction of a
// cell, and not the difference to the region's motion at x: that would stiffen the
// shape around the region.
//
// The misses are carried by Shepard's weights (1/d_i - 1/d_k)^2 over the k nearest
// nodes. The farthest has weight 0, so the average stays continuous when the set
// changes.
#include "solver/field/region_fade.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <queue>
#include <tuple>

#include <unsupported/Eigen/AutoDiff>

namespace cellwarp
{

namespace
{

/// Width of the fade [edge of the largest cell that holds a sample of the region].
/// Misses are up to a tenth of a cell: over a cell and a half the slope that they
/// add stays below 0.15.
constexpr double kWidth = 1.5;

/// Nodes of an average: on a regular lattice a point has up to eight equally near
/// ones, and the weights need one farther.
constexpr std::size_t kNearest = 16;

using Dual = Eigen::AutoDiffScalar<Eigen::Vector3d>;

std::vector<std::size_t> distinct(std::span<const Eigen::Vector3d> points)
{
    std::map<std::tuple<double, double, double>, std::size_t> first;
    for (std::size_t i = 0; i < points.size(); ++i)
        first.try_emplace({points[i].x(), points[i].y(), points[i].z()}, i);
    std::vector<std::size_t> kept;
    for (const auto& [place, i] : first)
        kept.push_back(i);
    std::sort(kept.begin(), kept.end());
    return kept;
}

template <class Value>
std::vector<Value> picked(std::span<const Value> values,
                          const std::vector<std::size_t>& kept)
{
    std::vector<Value> result;
    for (const std::size_t i : kept)
        result.push_back(values[i]);
    return result;
}

} // namespace

RegionFade::RegionFade(const Cells& cells, std::span<const Eigen::Vector3d> samples,
                       std::span<const int> sample_cells)
    : tree_(picked(samples, distinct(samples))),
      node_cells_(picked(sample_cells, distinct(samples)))
{
    double edge = 0.0;
    for (const int cell : node_cells_)
        edge = std::max(edge, cells.cells[static_cast<std::size_t>(cell)].edge);
    radius_ = kWidth * edge;
    // Cells within reach through the glue. A path through faces is longer than the
    // straight line, by up to sqrt 3; two more cells carry the blend's own reach.
    const double reach = std::sqrt(3.0) * (radius_ + 2.0 * edge);
    std::vector<double> distance(cells.size(), std::numeric_limits<double>::infinity());
    using Entry = std::pair<double, int>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> queue;
    for (const int cell : node_cells_)
        if (distance[static_cast<std::size_t>(cell)] > 0)
        {
            distance[static_cast<std::size_t>(cell)] = 0.0;
            queue.emplace(0.0, cell);
        }
    while (!queue.empty())
    {
        const auto [d, cell] = queue.top();
        queue.pop();
        const std::size_t c = static_cast<std::size_t>(cell);
        if (d > distance[c])
            continue;
        for (const int other : cells.neighbours_of(cell))
        {
            const std::size_t o = static_cast<std::size_t>(other);
            const double length =
                d + (cells.cells[o].box_centre - cells.cells[c].box_centre).norm();
            if (length <= reach && length < distance[o])
            {
                distance[o] = length;
                queue.emplace(length, other);
            }
        }
    }
    is_near_.resize(cells.size());
    for (std::size_t i = 0; i < cells.size(); ++i)
        is_near_[i] = distance[i] <= reach;
}

RegionFade::Weight RegionFade::weight(const Eigen::Vector3d& x,
                                      std::span<const Influence> influences) const
{
    Weight weight;
    bool is_all_near = true;
    for (const Influence& influence : influences)
    {
        if (!is_near_[static_cast<std::size_t>(influence.cell)])
        {
            is_all_near = false;
            continue;
        }
        weight.value += influence.weight;
        weight.gradient += influence.gradient;
    }
    if (is_all_near)
        weight = {1.0, Eigen::Vector3d::Zero(), false};
    if (weight.value == 0.0)
        return weight;
    const PointTree::Neighbour nearest = tree_.nearest(x);
    const double distance = std::sqrt(nearest.distance_squared), u = distance / radius_;
    if (u >= 1.0)
        return {};
    if (u == 0.0)
    {
        weight.is_node = true;
        return weight;
    }
    // 1 - (6 u^5 - 15 u^4 + 10 u^3): first and second derivative 0 at both ends.
    const double fade = 1.0 - u * u * u * (10.0 + u * (6.0 * u - 15.0));
    const double slope = -30.0 * u * u * (1.0 - u) * (1.0 - u);
    const Eigen::Vector3d away = (x - tree_.points()[nearest.index]) / distance;
    weight.gradient = fade * weight.gradient + weight.value * slope / radius_ * away;
    weight.value *= fade;
    return weight;
}

FieldValue RegionFade::average(const Eigen::Vector3d& x,
                               std::span<const Eigen::Vector3d> node_values) const
{
    std::vector<PointTree::Neighbour> near;
    tree_.nearest(x, kNearest, near);
    FieldValue result;
    if (near.front().distance_squared == 0.0 || near.size() == 1)
    {
        result.displacement = node_values[near.front().index];
        return result;
    }
    // The distance of a node as a number with its gradient.
    const auto distance = [&](const PointTree::Neighbour& node)
    {
        const double d = std::sqrt(node.distance_squared);
        return Dual(d, (x - nodes()[node.index]) / d);
    };
    const Dual far = distance(near.back());
    std::vector<Dual> weights;
    Dual sum(0.0, Eigen::Vector3d::Zero());
    for (const PointTree::Neighbour& node : near)
    {
        const Dual rest = 1.0 / distance(node) - 1.0 / far;
        weights.push_back(rest * rest);
        sum += weights.back();
    }
    for (std::size_t i = 0; i < near.size(); ++i)
    {
        const Dual share = sum.value() > 0 ? Dual(weights[i] / sum)
                                           : Dual(1.0 / static_cast<double>(near.size()),
                                                  Eigen::Vector3d::Zero());
        const Eigen::Vector3d& value = node_values[near[i].index];
        result.displacement += share.value() * value;
        result.gradient += value * share.derivatives().transpose();
    }
    return result;
}

FieldValue with_regions(const FieldValue& value, const Eigen::Vector3d& x,
                        std::span<const Influence> influences,
                        std::span<const MovedRegion> regions)
{
    struct Active
    {
        const MovedRegion* region;
        Dual weight;
    };
    std::vector<Active> active;
    for (const MovedRegion& region : regions)
    {
        const RegionFade::Weight weight = region.fade->weight(x, influences);
        if (weight.is_node)
        {
            const Eigen::Matrix3d turn = region.motion.R - Eigen::Matrix3d::Identity();
            return {turn * x + region.motion.t, region.may_turn ? value.gradient : turn};
        }
        if (weight.value > 0.0)
            active.push_back({&region, Dual(weight.value, weight.gradient)});
    }
    if (active.empty())
        return value;
    const auto product_without = [&](const Active* left_out)
    {
        Dual product(1.0, Eigen::Vector3d::Zero());
        for (const Active& other : active)
            if (&other != left_out)
                product = product * (1.0 - other.weight);
        return product;
    };
    Dual total = product_without(nullptr);
    std::vector<Dual> shares;
    for (const Active& one : active)
    {
        shares.push_back(one.weight * product_without(&one));
        total += shares.back();
    }
    FieldValue result = value;
    // So near to nodes of two regions that rounding makes both weights 1: the first.
    if (!(total.value() > 0))
    {
        active.resize(1);
        shares = {Dual(1.0, Eigen::Vector3d::Zero())};
        total = shares.front();
    }
    for (std::size_t r = 0; r < active.size(); ++r)
    {
        const FieldValue miss =
            active[r].region->fade->average(x, active[r].region->misses);
        const Dual share = shares[r] / total;
        result.displacement += share.value() * miss.displacement;
        result.gradient += share.value() * miss.gradient +
                           miss.displacement * share.derivatives().transpose();
    }
    return result;
}

} // namespace cellwarp
