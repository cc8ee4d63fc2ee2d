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
#include <cassert>
#include <cmath>
#include <limits>
#include <set>
#include <tuple>

#include <unsupported/Eigen/AutoDiff>

#include "octree/base/index.h"
#include "octree/joined_samples.h"
#include "solver/cells/glue_distances.h"
#include "solver/field/influence_kernel.h"

namespace cellwarp::core
{

namespace
{

/// Width of the fade [edge of the largest cell at the region's border].
/// Misses are up to a tenth of a cell: over a cell and a half the slope that they
/// add stays below 0.15.
constexpr double kWidth = 1.5;

/// Width of the fade of slopes [width of the fade].
constexpr double kSlopeShare = 0.35;

/// A little more than half the diagonal of a box [edge].
constexpr double kHalfDiagonal = 0.87;

using Dual = Eigen::AutoDiffScalar<Eigen::Vector3d>;
const Eigen::Vector3d kNoSlope = Eigen::Vector3d::Zero();

/// Further nodes this near to another node are the same place [edge].
constexpr double kSamePlace = 1e-6;

std::vector<Eigen::Vector3d> places_of(std::span<const RegionFade::Node> nodes)
{
    std::vector<Eigen::Vector3d> places;
    for (const RegionFade::Node& node : nodes)
        places.push_back(node.place);
    return places;
}

/// The first node of every place.
std::vector<RegionFade::Node> distinct(std::span<const RegionFade::Node> nodes)
{
    const std::vector<std::uint32_t> first = joined_samples(places_of(nodes));
    std::vector<RegionFade::Node> kept;
    for (std::size_t i = 0; i < nodes.size(); ++i)
        if (first[i] == i)
            kept.push_back(nodes[i]);
    return kept;
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

void RegionFade::find_nearest(const Eigen::Vector3d& x, Nearest& out) const
{
    tree_.nearest(x, kNearest, out.found);
    out.count = out.found.size();
    for (std::size_t i = 0; i < out.count; ++i)
    {
        // The tree has equally near ones in some order.
        std::size_t place = i;
        for (; place > 0 &&
               out.nodes[place - 1].distance_squared == out.found[i].distance_squared &&
               out.nodes[place - 1].index > out.found[i].index;
             --place)
            out.nodes[place] = out.nodes[place - 1];
        out.nodes[place] = out.found[i];
    }
}

RegionFade::Weight RegionFade::weight(const Eigen::Vector3d& x, const Weight& of_cells,
                                      const NearNodes* near, Nearest& nearest) const
{
    Weight weight = of_cells;
    if (weight.value == 0.0)
        return weight;
    nearest.count = 0;
    if (!near || !near->may_tell_of(x) || !near->nearest(x, radius_, nearest))
    {
        nearest.nodes[0] = tree_.nearest(x);
        nearest.count = 1;
        if (std::sqrt(nearest.nodes[0].distance_squared) / radius_ >= 1.0)
            return {};
        // Of a node no other one counts, and most samples of a region are nodes.
        if (nearest.nodes[0].distance_squared > 0.0)
            find_nearest(x, nearest);
    }
    if (nearest.count == 0)
        return {};
    const double distance = std::sqrt(nearest.nodes[0].distance_squared),
                 u = distance / radius_;
    if (u == 0.0)
    {
        weight.is_node = true;
        return weight;
    }
    // 1 - (6 u^5 - 15 u^4 + 10 u^3): first and second derivative 0 at both ends.
    const double fade = 1.0 - u * u * u * (10.0 + u * (6.0 * u - 15.0));
    const double slope = -30.0 * u * u * (1.0 - u) * (1.0 - u);
    const Eigen::Vector3d away = (x - tree_.points()[nearest.nodes[0].index]) / distance;
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
    std::array<Number, RegionFade::kNearest> shares;

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

void RegionFade::node_shares(const Eigen::Vector3d& x, const Nearest& nearest,
                             NodeShares& out) const
{
    const std::span<const PointTree::Neighbour> near = nearest.all();
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

FieldValue RegionFade::average(const Eigen::Vector3d& x, const NodeShares& shares,
                               std::span<const FieldValue> node_values,
                               bool wants_gradient) const
{
    FieldValue result;
    for (const NodeShare& share : shares.nodes)
    {
        const FieldValue& known = node_values[share.node];
        const Eigen::Vector3d step = known.gradient * (x - nodes()[share.node]);
        const Eigen::Vector3d value = known.displacement + shares.slope * step;
        result.displacement += share.value * value;
        if (wants_gradient)
            result.gradient += value * share.gradient.transpose() +
                               share.value * (shares.slope * known.gradient +
                                              step * shares.slope_gradient.transpose());
    }
    return result;
}

Eigen::Vector3d
RegionFade::average_displacement(const Eigen::Vector3d& x, const Nearest& nearest,
                                 std::span<const FieldValue> node_values) const
{
    const std::span<const PointTree::Neighbour> near = nearest.all();
    const auto distance = [&](std::size_t i)
    { return std::sqrt(near[i].distance_squared); };
    const Shepard<double, decltype(distance)> found(near, distance, radius_ * kSlopeShare,
                                                    0.0);
    Eigen::Vector3d result = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < near.size(); ++i)
    {
        const FieldValue& known = node_values[near[i].index];
        const Eigen::Vector3d step = known.gradient * (x - nodes()[near[i].index]);
        const Eigen::Vector3d value = known.displacement + found.slope * step;
        result += found.shares[i] * value;
    }
    return result;
}

namespace
{

/// More nodes than this near a box take longer than the tree does: in any case, and for
/// each of the points that are looked for.
constexpr std::size_t kMostNearNodes = 1000, kNodesAPoint = 16;

/// Fewer points in a box than this are not worth a list of the nodes near it.
constexpr std::size_t kLeastPoints = 24;

/// Of more nodes than this those that are too far go first, before each is compared with
/// all.
constexpr std::size_t kMostRanked = 64;

/// Beyond the reach of a box by rounding [of the distance].
constexpr double kReachSlack = 1e-9;

/// Of equally near ones the first node.
bool is_nearer(const PointTree::Neighbour& a, const PointTree::Neighbour& b)
{
    return std::tie(a.distance_squared, a.index) < std::tie(b.distance_squared, b.index);
}

} // namespace

/// No point has its nearest nodes farther from the middle than the middle has its own and
/// the way to the point twice, there and back.
double NearNodes::reach_of(const Eigen::Vector3d& x) const
{
    return (last_of_middle_ + 2.0 * (x - middle_).norm()) * (1.0 + kReachSlack);
}

NearNodes::NearNodes(const RegionFade& fade, const Eigen::AlignedBox3d& box,
                     std::size_t num_points)
    : box_(box), middle_(box.center())
{
    std::vector<PointTree::Neighbour> found;
    fade.tree_.nearest(middle_, RegionFade::kNearest, found);
    const double half_diagonal = (box.max() - middle_).norm();
    if (std::sqrt(found.front().distance_squared) - half_diagonal >=
        fade.radius() * (1.0 + kReachSlack))
    {
        is_worth_it_ = true; // no point has one that is near enough to count
        return;
    }
    last_of_middle_ = std::sqrt(found.back().distance_squared);
    const double reach = reach_of(box.max());
    // Nodes on a surface: their number grows with the square.
    const std::size_t most = std::min(kMostNearNodes, kNodesAPoint * num_points);
    const double share = static_cast<double>(most) / RegionFade::kNearest;
    is_worth_it_ = reach * reach < 2.0 * share * last_of_middle_ * last_of_middle_;
    if (!is_worth_it_)
        return;
    fade.tree_.within(middle_, reach, found);
    is_worth_it_ = found.size() <= most;
    if (!is_worth_it_)
        return;
    // Those near the middle first: few of the others are among the nearest then.
    std::sort(found.begin(), found.end(), is_nearer);
    nodes_.resize(found.size());
    std::transform(found.begin(), found.end(), nodes_.begin(),
                   [](const PointTree::Neighbour& node)
                   { return static_cast<std::uint32_t>(node.index); });
    const std::size_t row = (nodes_.size() + kPlaceLanes - 1) / kPlaceLanes * kPlaceLanes;
    places_.assign(3 * row, INFINITY);
    for (std::size_t k = 0; k < nodes_.size(); ++k)
        for (std::size_t axis = 0; axis < 3; ++axis)
            places_[axis * row + k] =
                fade.nodes()[nodes_[k]][static_cast<Eigen::Index>(axis)];
    for (std::size_t k = 0; k < nodes_.size(); k += kPlaceLanes)
        away_.push_back(std::sqrt(found[k].distance_squared));
}

namespace
{

/// The nearest of the first \p num_few of the few, as many as \p out counts. False: which
/// of equally far ones is left open. \pre out.count <= num_few, and the few have room for
/// num_few rounded up to a multiple of kPlaceLanes
bool take_nearest(std::size_t num_few, RegionFade::Nearest& out)
{
    assert(out.count <= num_few && num_few <= out.few.size());
    out.ranks.resize(out.few.size());
    widest_influence_kernels().ranks(out.few.data(), num_few, out.ranks.data());
    std::array<std::size_t, RegionFade::kNearest> num_of_rank = {};
    std::size_t num_taken = 0;
    bool has_equal = false;
    for (std::size_t k = 0; k < num_few; ++k)
    {
        const std::size_t rank = idx(out.ranks[k]);
        if (rank >= out.count)
            continue;
        ++num_taken;
        has_equal = has_equal || num_of_rank[rank] > 0;
        if (const std::size_t place = rank + num_of_rank[rank]++; place < out.count)
            out.nodes[place] = {out.few_nodes[k], out.few[k]};
    }
    if (has_equal)
        std::sort(out.nodes.begin(),
                  out.nodes.begin() + static_cast<std::ptrdiff_t>(out.count), is_nearer);
    // Of several that are equally far the tree takes some, and the slope of the shares is
    // that from the one that is last.
    return num_taken == out.count;
}

} // namespace

bool NearNodes::nearest(const Eigen::Vector3d& x, double radius,
                        RegionFade::Nearest& out) const
{
    // Of the blocks behind these none has a node that is near enough.
    const std::size_t count =
        kPlaceLanes *
        idx(std::upper_bound(away_.begin(), away_.end(), reach_of(x)) - away_.begin());
    out.squares.resize(std::max(out.squares.size(), count));
    const double nearest_squared =
        widest_influence_kernels().squares({places_.data(),
                                            count,
                                            places_.size() / 3,
                                            {x.x(), x.y(), x.z()},
                                            out.squares.data()});
    out.count = 0;
    if (std::sqrt(nearest_squared) / radius >= 1.0)
        return true;
    if (nearest_squared == 0.0) // of a node no other one counts
    {
        const auto node = std::find(out.squares.begin(), out.squares.end(), 0.0);
        out.nodes[0] = {nodes_[idx(node - out.squares.begin())], 0.0};
        out.count = 1;
        return true;
    }
    const std::size_t there = std::min(count, nodes_.size());
    out.count = std::min(there, RegionFade::kNearest);
    out.few.resize(std::max(out.few.size(), there + kPlaceLanes));
    out.few_nodes.resize(out.few.size());
    const auto up_to = [there, squares = out.squares.data(), nodes = nodes_.data(),
                        few = out.few.data(),
                        few_nodes = out.few_nodes.data()](double farthest)
    {
        std::size_t found = 0;
        for (std::size_t k = 0; k < there; ++k)
        {
            few[found] = squares[k];
            few_nodes[found] = nodes[k];
            found += squares[k] <= farthest;
        }
        return found;
    };
    // The nearest are no farther than the farthest of any as many.
    const auto nth = static_cast<std::ptrdiff_t>(out.count);
    std::size_t found =
        up_to(*std::max_element(out.squares.begin(), out.squares.begin() + nth));
    if (found > kMostRanked)
    {
        const auto last = out.few.begin() + nth - 1;
        std::nth_element(out.few.begin(), last,
                         out.few.begin() + static_cast<std::ptrdiff_t>(found));
        found = up_to(*last);
        if (found > out.count)
            return false; // several are as far as the last one
    }
    return take_nearest(found, out);
}

std::size_t NearNodes::num_bytes() const
{
    return sizeof(*this) + nodes_.capacity() * sizeof(std::uint32_t) +
           (places_.capacity() + away_.capacity()) * sizeof(double);
}

void NearNodesOfRegions::enter(const Eigen::AlignedBox3d& box, std::size_t num_points)
{
    box_ = box;
    num_points_ = num_points;
    of_region_.clear();
}

void NearNodesOfRegions::make(int region, const RegionFade& fade)
{
    if (num_points_ >= kLeastPoints && !of(region))
        of_region_.emplace_back(region, NearNodes(fade, box_, num_points_));
}

const NearNodes* NearNodesOfRegions::of(int region) const
{
    for (const auto& [known, nodes] : of_region_)
        if (known == region)
            return &nodes;
    return nullptr;
}

std::size_t NearNodesOfRegions::num_bytes() const
{
    std::size_t bytes = 0;
    for (const auto& [region, nodes] : of_region_)
        bytes += nodes.num_bytes();
    return bytes;
}

RegionFades::RegionFades(std::vector<const RegionFade*> fades, std::size_t num_cells)
    : fades_(std::move(fades)), regions_of_cell_(num_cells)
{
    for (std::size_t r = 0; r < fades_.size(); ++r)
        for (const int cell : fades_[r]->near_cells())
            regions_of_cell_[idx(cell)].push_back(static_cast<int>(r));
}

namespace
{

/// Makes shares of the weights of several regions at one point, as at the top.
void share_out(std::vector<RegionFades::Share>& shares)
{
    if (shares.empty())
        return;
    if (shares.size() == 1)
    {
        // What is left of the field's own share, 1 - w, and w are 1 together, up to
        // rounding: the gradient of their sum is 0.
        RegionFades::Share& one = shares.front();
        const double total = (1.0 - one.value) + one.value;
        one.value /= total;
        one.gradient /= total;
        return;
    }
    const auto weight_of = [](const RegionFades::Share& share)
    { return Dual(share.value, share.gradient); };
    const auto product_without = [&](const RegionFades::Share* left_out)
    {
        Dual product(1.0, kNoSlope);
        for (const RegionFades::Share& other : shares)
            if (&other != left_out)
                product = product * (1.0 - weight_of(other));
        return product;
    };
    Dual total = product_without(nullptr);
    for (const RegionFades::Share& one : shares)
        total += weight_of(one) * product_without(&one);
    // So near to nodes of two regions that rounding makes both weights 1: the first.
    if (!(total.value() > 0))
    {
        shares.resize(1);
        shares.front().value = 1.0;
        shares.front().gradient.setZero();
        return;
    }
    std::vector<Dual> of_regions;
    for (const RegionFades::Share& one : shares)
        of_regions.push_back(weight_of(one) * product_without(&one) / total);
    for (std::size_t i = 0; i < shares.size(); ++i)
    {
        shares[i].value = of_regions[i].value();
        shares[i].gradient = of_regions[i].derivatives();
    }
}

} // namespace

void RegionFades::reach(const Eigen::Vector3d& x, std::span<const Influence> influences,
                        const NearNodesOfRegions& near_nodes, Reach& out) const
{
    out.node_of = -1;
    out.shares.clear(); // first the weights of the regions alone
    std::vector<Reach::Near>& near = out.near;
    near.clear();
    for (const Influence& influence : influences)
        for (const int r : regions_of_cell_[idx(influence.cell)])
        {
            auto own =
                std::find_if(near.begin(), near.end(),
                             [&](const Reach::Near& known) { return known.region == r; });
            if (own == near.end())
                own = near.insert(near.end(), {r, {}, 0});
            own->weight.value += influence.weight;
            own->weight.gradient += influence.gradient;
            ++own->num_cells;
        }
    std::sort(near.begin(), near.end(),
              [](const Reach::Near& a, const Reach::Near& b)
              { return a.region < b.region; });
    for (Reach::Near& region : near)
    {
        const int r = region.region;
        // The weights of all cells are 1 together, up to rounding.
        if (region.num_cells == influences.size())
            region.weight = {1.0, Eigen::Vector3d::Zero(), false};
        const std::size_t k = out.shares.size();
        if (k == out.nearest.size())
            out.nearest.emplace_back();
        const RegionFade::Weight weight =
            fade(r).weight(x, region.weight, near_nodes.of(r), out.nearest[k]);
        if (weight.is_node)
        {
            out.node_of = r;
            out.nearest_of_node = k;
            out.shares.clear();
            return;
        }
        if (weight.value > 0.0)
            out.shares.push_back({r, weight.value, weight.gradient, k});
    }
    share_out(out.shares);
}

FieldValue moved_by(const Motion& motion, const Eigen::Vector3d& x)
{
    const Eigen::Matrix3d turn = motion.R - Eigen::Matrix3d::Identity();
    return {turn * x + motion.t, turn};
}

MovedRegions::MovedRegions(std::span<const MovedRegion> regions, std::size_t num_cells)
    : regions_(regions), is_touched_(num_cells, false), deep_region_(num_cells, -1)
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
    std::vector<NodeTable::Node> nodes;
    for (std::size_t r = 0; r < regions_.size(); ++r)
    {
        const RegionFade& fade = *regions_[r].fade;
        // Nodes of a rod, or of a pin of one place, do not turn with one motion.
        const bool is_rigid = !regions_[r].bends && !regions_[r].may_turn;
        for (std::size_t i = 0; i < fade.nodes().size(); ++i)
            if (const int cell = fade.node_cells()[i]; deep_region_[idx(cell)] < 0)
                nodes.push_back({&fade.nodes()[i], is_rigid ? cell : NodeTable::kNotFound,
                                 static_cast<int>(r)});
    }
    nodes_ = NodeTable(std::move(nodes));
}

void MovedRegions::correct(const Eigen::Vector3d& x,
                           std::span<const Influence> influences,
                           const NearNodesOfRegions& near, bool wants_gradient,
                           Scratch& scratch, FieldValue& value) const
{
    fades_.reach(x, influences, near, scratch.reach);
    const RegionFades::Reach& reach = scratch.reach;
    if (reach.node_of >= 0)
    {
        const MovedRegion& region = regions_[idx(reach.node_of)];
        if (region.bends)
        {
            // The average of a node is its own miss.
            const FieldValue& miss =
                region.misses[reach.nearest[reach.nearest_of_node].nodes[0].index];
            value.displacement += miss.displacement;
            value.gradient += miss.gradient;
            return;
        }
        const Eigen::Matrix3d turning = value.gradient;
        value = moved_by(region.motion, x);
        if (region.may_turn)
            value.gradient = turning;
        return;
    }
    for (const RegionFades::Share& share : reach.shares)
    {
        const MovedRegion& region = regions_[idx(share.region)];
        const RegionFade::Nearest& nearest = reach.nearest[share.nearest];
        if (!wants_gradient)
        {
            value.displacement += share.value * region.fade->average_displacement(
                                                    x, nearest, region.misses);
            continue;
        }
        region.fade->node_shares(x, nearest, scratch.shares);
        const FieldValue miss = region.fade->average(x, scratch.shares, region.misses);
        value.displacement += share.value * miss.displacement;
        value.gradient +=
            share.value * miss.gradient + miss.displacement * share.gradient.transpose();
    }
}

} // namespace cellwarp::core
