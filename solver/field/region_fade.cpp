// SPDX-License-Identifier: GPL-3.0-or-later
// With weights w_r of the regions and e_r the misses carried to x,
//   F = f + (sum a_r e_r) / (a + sum a_r),
//   a = prod (1 - w_s),  a_r = w_r prod_{s != r} (1 - w_s).
// One region alone gives f + w e. Where one weight is 1 all other terms vanish, so
// that every region is met at its samples. What fades is the miss, a fraction of a
// cell, and not the difference to the region's motion at x: that would stiffen the
// shape around the region.
//
// A miss is carried with its slope, so that the tangent passes over the border of a
// region without a crease.
//
// The misses are carried by Shepard's weights (1/d_i - 1/d_k)^2 over the k nearest
// nodes. The farthest has weight 0, so the average stays continuous when the set
// changes.
#include "solver/field/region_fade.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>
#include <tuple>

#include <unsupported/Eigen/AutoDiff>

#include "octree/base/index.h"
#include "solver/cells/glue_distances.h"

namespace cellwarp
{

namespace
{

/// Width of the fade [edge of the largest cell at the region's border].
/// Misses are up to a tenth of a cell: over a cell and a half the slope that they
/// add stays below 0.15.
constexpr double kWidth = 1.5;

/// Nodes of an average: on a regular lattice a point has up to eight equally near
/// ones, and the weights need one farther.
constexpr std::size_t kNearest = 16;

/// Width of the fade of slopes [width of the fade].
constexpr double kSlopeShare = 0.35;

/// A little more than half the diagonal of a box [edge].
constexpr double kHalfDiagonal = 0.87;

using Dual = Eigen::AutoDiffScalar<Eigen::Vector3d>;
const Eigen::Vector3d kNoSlope = Eigen::Vector3d::Zero();

/// Further nodes this near to another node are the same place [edge].
constexpr double kSamePlace = 1e-6;

/// The first node of every place.
std::vector<RegionFade::Node> distinct(std::span<const RegionFade::Node> nodes)
{
    std::set<std::tuple<double, double, double>> places;
    std::vector<RegionFade::Node> kept;
    for (const RegionFade::Node& node : nodes)
        if (places.emplace(node.place.x(), node.place.y(), node.place.z()).second)
            kept.push_back(node);
    return kept;
}

std::vector<Eigen::Vector3d> places_of(std::span<const RegionFade::Node> nodes)
{
    std::vector<Eigen::Vector3d> places;
    for (const RegionFade::Node& node : nodes)
        places.push_back(node.place);
    return places;
}

/// Samples are told apart to the bit, because each must be met; further nodes, which
/// only inform their surroundings, are not.
std::vector<RegionFade::Node> joined(const Cells& cells,
                                     std::span<const RegionFade::Node> samples,
                                     std::span<const RegionFade::Node> further)
{
    std::vector<RegionFade::Node> nodes = distinct(samples);
    if (further.empty())
        return nodes;
    const PointTree sample_tree(places_of(nodes)), further_tree(places_of(further));
    // A corner of the lattice is a corner of eight cells, on up to three sides of each.
    constexpr std::size_t kCopies = 24;
    std::vector<PointTree::Neighbour> near;
    for (std::size_t i = 0; i < further.size(); ++i)
    {
        const RegionFade::Node& node = further[i];
        const double same = kSamePlace * cells.cells[idx(node.cell)].edge;
        bool is_new = sample_tree.nearest(node.place).distance_squared > same * same;
        further_tree.nearest(node.place, kCopies, near);
        for (const PointTree::Neighbour& other : near)
            is_new = is_new && (other.index >= i || other.distance_squared > same * same);
        if (is_new)
            nodes.push_back(node);
    }
    return nodes;
}

double largest_edge(const Cells& cells, std::span<const RegionFade::Node> nodes)
{
    double edge = 0.0;
    for (const RegionFade::Node& node : nodes)
        edge = std::max(edge, cells.cells[idx(node.cell)].edge);
    return edge;
}

} // namespace

RegionFade::RegionFade(const Cells& cells, std::span<const Node> samples,
                       std::span<const Node> further)
    : RegionFade(cells, largest_edge(cells, further.empty() ? samples : further),
                 joined(cells, samples, further))
{
}

RegionFade::RegionFade(const Cells& cells, const std::vector<Node>& nodes,
                       std::vector<int> near_cells, double radius)
    : tree_(places_of(nodes)), near_cells_(std::move(near_cells)), radius_(radius)
{
    for (const Node& node : nodes)
        node_cells_.push_back(node.cell);
    find_touched(cells);
}

RegionFade::RegionFade(const Cells& cells, double edge, const std::vector<Node>& nodes)
    : tree_(places_of(nodes)), radius_(kWidth * edge)
{
    for (const Node& node : nodes)
        node_cells_.push_back(node.cell);
    // Cells within reach through the glue. A path through faces is longer than the
    // straight line, by up to sqrt 3; two more cells carry the blend's own reach.
    const double reach = std::sqrt(3.0) * (radius_ + 2.0 * edge);
    GlueDistances distances(cells);
    distances.search(node_cells_, reach,
                     [](const Cell& from, const Cell& to)
                     { return (to.box_centre - from.box_centre).norm(); });
    near_cells_ = distances.reached();
    std::sort(near_cells_.begin(), near_cells_.end());
    find_touched(cells);
}

/// A point takes the correction by the cells that count there, so its own cell may be up
/// to two off the near ones.
void RegionFade::find_touched(const Cells& cells)
{
    std::set<int> candidates(near_cells_.begin(), near_cells_.end());
    for (int ring = 0; ring < 2; ++ring)
        for (const int cell : std::vector<int>(candidates.begin(), candidates.end()))
            for (const int other : cells.neighbours_of(cell))
                candidates.insert(other);
    for (const int cell : candidates)
    {
        const Cell& box = cells.cells[idx(cell)];
        const double half = kHalfDiagonal * box.edge;
        if (std::sqrt(tree_.nearest(box.box_centre).distance_squared) < radius_ + half)
            touched_cells_.push_back(cell);
    }
}

double RegionFade::reach_of_average(const Eigen::Vector3d& x, double away) const
{
    std::vector<PointTree::Neighbour> near;
    tree_.nearest(x, kNearest, near);
    return std::sqrt(near.back().distance_squared) + 2.0 * away;
}

RegionFade::Weight RegionFade::weight(const Eigen::Vector3d& x,
                                      std::span<const Influence> influences) const
{
    Weight weight;
    bool is_all_near = true;
    for (const Influence& influence : influences)
    {
        if (!std::binary_search(near_cells_.begin(), near_cells_.end(), influence.cell))
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

namespace
{

/// How much each of the nearest nodes counts, and how much their slopes do: as numbers,
/// or with their gradients. \p distance: of each node, by its place among the nearest.
template <class Number, class Distance>
struct Shepard
{
    Number slope = Number(0.0);
    std::array<Number, kNearest> shares;

    Shepard(std::span<const PointTree::Neighbour> near, const Distance& distance,
            double slope_radius, const Number& zero)
        : slope(zero)
    {
        // Slopes fade faster than values: they would stiffen what is around the region.
        const Number u = distance(0) / slope_radius;
        if (std::sqrt(near.front().distance_squared) / slope_radius < 1.0)
            slope = 1.0 - u * u * u * (10.0 + u * (6.0 * u - 15.0));
        const Number far = distance(near.size() - 1);
        Number sum = zero;
        for (std::size_t i = 0; i < near.size(); ++i)
        {
            const bool is_node = near[i].distance_squared == 0.0;
            const Number rest = is_node ? zero : Number(1.0 / distance(i) - 1.0 / far);
            shares[i] = rest * rest;
            sum += shares[i];
        }
        // At a node, and where all are equally far, the weights are none.
        const bool has_weights = sum > 0 && near.front().distance_squared > 0;
        for (std::size_t i = 0; i < near.size(); ++i)
        {
            const double alone = near.front().distance_squared > 0
                                     ? 1.0 / static_cast<double>(near.size())
                                     : (i == 0 ? 1.0 : 0.0);
            shares[i] = has_weights ? Number(shares[i] / sum) : Number(zero + alone);
        }
    }
};

} // namespace

void RegionFade::node_shares(const Eigen::Vector3d& x, NodeShares& out) const
{
    std::vector<PointTree::Neighbour> near;
    tree_.nearest(x, kNearest, near);
    // The distance of a node as a number with its gradient.
    const auto distance = [&](std::size_t i)
    {
        const double d = std::sqrt(near[i].distance_squared);
        return d > 0 ? Dual(d, (x - nodes()[near[i].index]) / d) : Dual(0.0, kNoSlope);
    };
    const Shepard<Dual, decltype(distance)> found(near, distance, radius_ * kSlopeShare,
                                                  Dual(0.0, kNoSlope));
    out.slope = found.slope.value();
    out.slope_gradient = found.slope.derivatives();
    out.nodes.clear();
    for (std::size_t i = 0; i < near.size(); ++i)
        out.nodes.push_back(
            {near[i].index, found.shares[i].value(), found.shares[i].derivatives()});
}

FieldValue RegionFade::average(const Eigen::Vector3d& x,
                               std::span<const FieldValue> node_values) const
{
    NodeShares shares;
    node_shares(x, shares);
    FieldValue result;
    for (const NodeShare& share : shares.nodes)
    {
        const FieldValue& known = node_values[share.node];
        const Eigen::Vector3d step = known.gradient * (x - nodes()[share.node]);
        const Eigen::Vector3d value = known.displacement + shares.slope * step;
        result.displacement += share.value * value;
        result.gradient += value * share.gradient.transpose() +
                           share.value * (shares.slope * known.gradient +
                                          step * shares.slope_gradient.transpose());
    }
    return result;
}

Eigen::Vector3d
RegionFade::average_displacement(const Eigen::Vector3d& x,
                                 std::span<const FieldValue> node_values,
                                 std::vector<PointTree::Neighbour>& scratch) const
{
    tree_.nearest(x, kNearest, scratch);
    const auto distance = [&](std::size_t i)
    { return std::sqrt(scratch[i].distance_squared); };
    const Shepard<double, decltype(distance)> found(scratch, distance,
                                                    radius_ * kSlopeShare, 0.0);
    Eigen::Vector3d result = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < scratch.size(); ++i)
    {
        const FieldValue& known = node_values[scratch[i].index];
        const Eigen::Vector3d step = known.gradient * (x - nodes()[scratch[i].index]);
        const Eigen::Vector3d value = known.displacement + found.slope * step;
        result += found.shares[i] * value;
    }
    return result;
}

RegionFades::RegionFades(std::vector<const RegionFade*> fades, std::size_t num_cells)
    : fades_(std::move(fades)), regions_of_cell_(num_cells)
{
    for (std::size_t r = 0; r < fades_.size(); ++r)
        for (const int cell : fades_[r]->near_cells())
            regions_of_cell_[idx(cell)].push_back(static_cast<int>(r));
}

void RegionFades::reach(const Eigen::Vector3d& x, std::span<const Influence> influences,
                        Reach& out) const
{
    struct Active
    {
        int region;
        Dual weight;
    };
    out.node_of = -1;
    out.shares.clear();
    std::vector<int>& near = out.near;
    near.clear();
    for (const Influence& influence : influences)
    {
        const std::vector<int>& more = regions_of_cell_[idx(influence.cell)];
        near.insert(near.end(), more.begin(), more.end());
    }
    std::sort(near.begin(), near.end());
    near.erase(std::unique(near.begin(), near.end()), near.end());
    std::vector<Active> active;
    for (const int r : near)
    {
        const RegionFade::Weight weight = fade(r).weight(x, influences);
        if (weight.is_node)
        {
            out.node_of = r;
            return;
        }
        if (weight.value > 0.0)
            active.push_back({r, Dual(weight.value, weight.gradient)});
    }
    if (active.empty())
        return;
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
    // So near to nodes of two regions that rounding makes both weights 1: the first.
    if (!(total.value() > 0))
    {
        active.resize(1);
        shares = {Dual(1.0, Eigen::Vector3d::Zero())};
        total = shares.front();
    }
    for (std::size_t i = 0; i < active.size(); ++i)
    {
        const Dual share = shares[i] / total;
        out.shares.push_back({active[i].region, share.value(), share.derivatives()});
    }
}

MovedRegions::MovedRegions(std::vector<MovedRegion> regions, std::size_t num_cells)
    : regions_(std::move(regions)), is_touched_(num_cells, false),
      deep_region_(num_cells, -1)
{
    std::vector<const RegionFade*> fades;
    for (std::size_t r = 0; r < regions_.size(); ++r)
    {
        fades.push_back(regions_[r].fade);
        for (const int cell : regions_[r].fade->touched_cells())
            is_touched_[idx(cell)] = true;
        for (const int cell : regions_[r].deep_cells)
            deep_region_[idx(cell)] = static_cast<int>(r);
    }
    fades_ = RegionFades(std::move(fades), num_cells);
}

void MovedRegions::correct(const Eigen::Vector3d& x,
                           std::span<const Influence> influences, bool wants_gradient,
                           Scratch& scratch, FieldValue& value) const
{
    fades_.reach(x, influences, scratch.reach);
    if (scratch.reach.node_of >= 0)
    {
        const MovedRegion& region = regions_[idx(scratch.reach.node_of)];
        if (region.bends)
        {
            value.displacement +=
                region.fade->average_displacement(x, region.misses, scratch.near);
            return;
        }
        const Eigen::Matrix3d turn = region.motion.R - Eigen::Matrix3d::Identity();
        value = {turn * x + region.motion.t, region.may_turn ? value.gradient : turn};
        return;
    }
    for (const RegionFades::Share& share : scratch.reach.shares)
    {
        const MovedRegion& region = regions_[idx(share.region)];
        if (!wants_gradient)
        {
            value.displacement += share.value * region.fade->average_displacement(
                                                    x, region.misses, scratch.near);
            continue;
        }
        const FieldValue miss = region.fade->average(x, region.misses);
        value.displacement += share.value * miss.displacement;
        value.gradient +=
            share.value * miss.gradient + miss.displacement * share.gradient.transpose();
    }
}

} // namespace cellwarp
