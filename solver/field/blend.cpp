// SPDX-License-Identifier: GPL-3.0-or-later
// A cell counts at a place x by u = (1 - d/s)^2, if x is nearer to its centre than its
// edge. Cells that count are reached from the one that holds x through others that count.
// Were that all, the weights would jump: where two fingers pass through one leaf, the
// second is reached from the first through the cell that joins them, and when x leaves
// the support of that cell, the second finger's weight would fall from as much as the
// first one's to nothing at once.
//
// So the glue is a network of resistors. A cell k resists by
//   rho_k(x) = 0.4 / (1 - d_k/s_k)^2 * e_k^2 / (e_k^2 + (s_k/10)^2),
// e_k the distance of x to its box: not at all in its own box, infinitely where its
// support ends; between, smoothly. Two glued cells are joined by (rho_a + rho_b) / 2, and
// R_j is the resistance of the whole network between the own cell and cell j. Its weight
// is
//   w_j = u_j h(1 / (R_j u_j)),   h(t) = t (2 - t) for t < 1, else 1,
// before all weights are divided by their sum. This is
// - continuous where x moves in one cell: R_j is a smooth function of the rho, and its
//   inverse falls to 0 where the last way through the network ends;
// - continuous where x crosses a face: both cells hold x, so neither of them resists, and
//   the glue of the face makes one node of the two;
// - of a continuous gradient: rho begins with slope 0 at the box, 1 / rho with slope 0
//   where the support does, and h ends with slope 0 at 1. Only u itself has a tip, at the
//   centre of its box;
// - the plain u_j wherever a short way leads to the cell: one way of several joints
//   resists no less than the network, and R_j u_j <= 1 by it is enough. On a regular grid
//   the cells between the own one and another are nearer than that one, and u_j rho_m is
//   at most 0.4 for each of them. Over all places of a box the largest R_j u_j of a way
//   is 0.56 over an edge and 0.81 over a corner: nothing is changed there.
#include "solver/field/blend.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "octree/base/index.h"
#include "octree/base/point_tree.h"
#include "solver/field/glue_network.h"

namespace cellwarp::core
{

Eigen::Vector3d nearest_in_box(const Eigen::Vector3d& centre, double edge,
                               const Eigen::Vector3d& x)
{
    const Eigen::Array3d half = Eigen::Array3d::Constant((0.5 + kBoxSlack) * edge);
    const Eigen::Array3d from_centre = (x - centre).array();
    const Eigen::Array3d clamped = from_centre.max(-half).min(half);
    // What is not clamped stays itself to the bit.
    return (clamped == from_centre).select(x.array(), centre.array() + clamped).matrix();
}

ClosestCells::ClosestCells(const Cells& cells)
    : first_neighbour_(cells.first_neighbour), neighbours_(cells.neighbours)
{
    for (const Cell& cell : cells.cells)
    {
        box_centres_.push_back(cell.box_centre);
        edges_.push_back(cell.edge);
    }
}

namespace
{

/// Cells of which a number is kept on the stack.
constexpr std::size_t kFew = 64;

/// A cell farther than this does not count, whatever rounding says [edge^2]: most are,
/// and need no root.
constexpr double kNotNear = 1.0 + 1e-12;

/// How \p arm, from the centre of a box to a place, ends outside of the box.
Eigen::Vector3d beyond_box(const Eigen::Vector3d& arm, double edge)
{
    return arm - arm.cwiseMax(-0.5 * edge).cwiseMin(0.5 * edge);
}

} // namespace

/// The plain weights and their gradients. \p is_narrow: whether some may be less.
void ClosestCells::reach(const Eigen::Vector3d& place, int own,
                         std::vector<Influence>& out, bool& is_narrow) const
{
    // The resistance of the way on which a cell is found, to behind it.
    double few[kFew];
    std::vector<double> more;
    const auto behind = [&](std::size_t i) -> double&
    { return i < kFew ? few[i] : more[i - kFew]; };
    is_narrow = false;
    out.clear();
    // With u = (1 - d/s)^2: grad u = -2 (1 - d/s) / s * (x - c) / d.
    const auto weigh = [&](int cell, std::size_t before)
    {
        const std::size_t c = idx(cell);
        const Eigen::Vector3d arm = place - box_centres_[c];
        const double squared = arm.squaredNorm();
        if (squared > kNotNear * edges_[c] * edges_[c])
            return;
        const double d = std::sqrt(squared), rest = 1.0 - d / edges_[c];
        if (rest <= 0)
            return;
        const double u = rest * rest;
        Influence influence{cell, u, Eigen::Vector3d::Zero()};
        if (d > 0)
            influence.gradient = (-2.0 * rest / (edges_[c] * d) * arm.array()).matrix();
        const double resistance =
            passing_resistance(beyond_box(arm, edges_[c]).squaredNorm(), edges_[c], rest);
        const double to = out.empty() ? 0.0 : behind(before);
        if (out.size() >= kFew)
            more.push_back(0.0);
        behind(out.size()) = to + resistance;
        is_narrow = is_narrow || (to + 0.5 * resistance) * u > 1.0;
        out.push_back(influence);
    };
    weigh(own, 0);
    for (std::size_t next = 0; next < out.size(); ++next)
        for (const int other : neighbours_of(out[next].cell))
        {
            const bool is_known =
                std::any_of(out.begin(), out.end(),
                            [&](const Influence& i) { return i.cell == other; });
            if (!is_known)
                weigh(other, next);
        }
}

ClosestCells::Resistance ClosestCells::resistance_at(const Eigen::Vector3d& place,
                                                     int cell) const
{
    const std::size_t c = idx(cell);
    const double edge = edges_[c];
    const Eigen::Vector3d arm = place - box_centres_[c], beyond = beyond_box(arm, edge);
    const double d = arm.norm(), rest = 1.0 - d / edge;
    const double squared = beyond.squaredNorm(), shell = kShell * edge;
    Resistance result{passing_resistance(squared, edge, rest), Eigen::Vector3d::Zero()};
    // grad e^2 = 2 beyond, grad (1 - d/s) = -arm / (s d).
    if (squared > 0)
        result.slope = 2.0 * result.value *
                       (beyond * (1.0 / squared - 1.0 / (squared + shell * shell)) +
                        arm / (edge * d * rest));
    return result;
}

/// Replaces the plain weights by those of the network. \p out: ascending by cell.
void ClosestCells::narrow(const Eigen::Vector3d& place, int own,
                          std::vector<Influence>& out) const
{
    const auto number_of = [&](int cell)
    {
        return std::lower_bound(out.begin(), out.end(), cell,
                                [](const Influence& influence, int wanted)
                                { return influence.cell < wanted; }) -
               out.begin();
    };
    std::vector<double> resistances;
    std::vector<Eigen::Vector3d> slopes;
    for (const Influence& influence : out)
    {
        const Resistance found = resistance_at(place, influence.cell);
        resistances.push_back(found.value);
        slopes.push_back(found.slope);
    }
    GlueNetwork network(resistances);
    for (std::size_t i = 0; i < out.size(); ++i)
        for (const int other : neighbours_of(out[i].cell))
        {
            const std::size_t k = idx(number_of(other));
            if (k > i && k < out.size() && out[k].cell == other)
                network.join(i, k);
        }
    network.solve_for(idx(number_of(own)));
    for (std::size_t i = 0; i < out.size(); ++i)
    {
        const double u = out[i].weight, R = network.resistance_to(i);
        if (R * u <= 1.0)
            continue;
        // With t = 1 / (R u): grad (u h) = t^2 grad u - 2 t (1 - t) u grad R / R.
        const double t = 1.0 / (R * u);
        Eigen::Vector3d slope = Eigen::Vector3d::Zero();
        for (std::size_t k = 0; k < out.size(); ++k)
            slope += network.slopes()[k] * slopes[k];
        out[i].weight = u * t * (2.0 - t);
        out[i].gradient = t * t * out[i].gradient - 2.0 * t * (1.0 - t) * u / R * slope;
    }
}

void ClosestCells::influences(const Eigen::Vector3d& x, int own,
                              std::vector<Influence>& out) const
{
    const Eigen::Vector3d place =
        nearest_in_box(box_centres_[idx(own)], edges_[idx(own)], x);
    const Eigen::Array3d is_within = (place.array() == x.array()).cast<double>();
    bool is_narrow = false;
    reach(place, own, out, is_narrow);
    // The order of the sum must not depend on the cell the search began in.
    std::sort(out.begin(), out.end(),
              [](const Influence& a, const Influence& b) { return a.cell < b.cell; });
    if (is_narrow)
        narrow(place, own, out);
    double sum = 0.0;
    Eigen::Vector3d sum_gradient = Eigen::Vector3d::Zero();
    for (Influence& influence : out)
    {
        influence.gradient.array() *= is_within;
        sum += influence.weight;
        sum_gradient += influence.gradient;
    }
    for (Influence& influence : out)
    {
        influence.weight /= sum;
        influence.gradient = (influence.gradient - influence.weight * sum_gradient) / sum;
    }
}

struct Closest4::Tree
{
    PointTree points;
};

namespace
{

std::vector<Eigen::Vector3d> centres_of(const Cells& cells)
{
    std::vector<Eigen::Vector3d> centres;
    for (const Cell& cell : cells.cells)
        centres.push_back(cell.centre);
    return centres;
}

} // namespace

Closest4::Closest4(const Cells& cells)
    : tree_(std::make_unique<Tree>(Tree{PointTree(centres_of(cells))}))
{
}
Closest4::~Closest4() = default;
Closest4::Closest4(Closest4&&) noexcept = default;
Closest4& Closest4::operator=(Closest4&&) noexcept = default;

void Closest4::influences(const Eigen::Vector3d& x, std::vector<Influence>& out) const
{
    std::vector<PointTree::Neighbour> near;
    tree_->points.nearest(x, 4, near);
    out.clear();
    for (const PointTree::Neighbour& one : near)
        out.push_back({static_cast<int>(one.index),
                       1.0 / static_cast<double>(near.size()), Eigen::Vector3d::Zero()});
}

FieldValue blended(std::span<const Influence> influences, std::span<const Pose> poses,
                   const Cells& cells, const Eigen::Vector3d& x)
{
    FieldValue value;
    for (const Influence& influence : influences)
    {
        const std::size_t c = idx(influence.cell);
        const Eigen::Vector3d d = displacement(poses[c], cells.cells[c].centre, x);
        value.displacement += influence.weight * d;
        value.gradient += influence.weight * (poses[c].R - Eigen::Matrix3d::Identity()) +
                          d * influence.gradient.transpose();
    }
    return value;
}

} // namespace cellwarp::core
