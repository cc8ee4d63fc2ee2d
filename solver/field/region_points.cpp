// SPDX-License-Identifier: GPL-3.0-or-later
// A cell of which a region holds a part is rigid as a whole, though free material may
// fill up to half of it. With points at the side of its box that material would not move
// at all. The glue knows where the region ends (border_glue), so the points go there.
// Measured on `block` (2,240 cells, against 175,616): the largest error falls from 3.8e-3
// of the diagonal to 1.6e-3, the RMS error from 8.0e-4 to 5.1e-4.
//   Points are not moved outwards where a region ends beyond its cells. Often only a part
// of it does, as the middle of a sphere does, and what is beside that is free: the
// largest error would be 4e-2.
#include "solver/field/region_points.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

/// A region that ends less than the least within its cells counts as ending at their
/// side, where points of several cells are one. No point is farther within than the
/// largest: near the middle is the cell's anchor [edge].
constexpr double kLeastInset = 0.05, kLargestInset = 0.4;

/// A point of a region this near to an anchor tells nothing new, and makes the system
/// ill-conditioned [edge].
constexpr double kTooNear = 0.05;

/// A cell whose material fills less of its box than this has no corners: they would lie
/// off the material, and hold what is beside it as in a vice. A shell's cells are such.
constexpr double kFull = 0.5 + 1e-6;

bool is_full(const Cell& cell)
{
    return cell.volume > kFull * cell.edge * cell.edge * cell.edge;
}

using Sides = std::array<bool, 6>; // of a box, by side_of()
using LatticePoint = RegionPoints::LatticePoint;

/// Of each cell of a region that has points: on which sides free cells are glued to it.
std::vector<Sides> free_sides(const Cells& cells, std::span<const Constraint> constraints)
{
    std::vector<Sides> sides(cells.size(), Sides{});
    for (const Face& face : cells.faces)
    {
        const bool a_is_held = constraints[idx(face.a)].is_of_rigid_region();
        const bool b_is_held = constraints[idx(face.b)].is_of_rigid_region();
        if (a_is_held == b_is_held)
            continue;
        const std::size_t held = idx(a_is_held ? face.a : face.b);
        sides[held][side_of(face.axis, a_is_held)] = is_full(cells.cells[held]);
    }
    return sides;
}

/// A corner of a box, or the middle of one of its edges or sides: -1, 0 or 1 an axis.
using Place = Eigen::Vector3i;

bool is_corner(const Place& place)
{
    return (place.array() != 0).all();
}

/// Those of the sides that a place is on.
Sides sides_at(const Sides& sides, const Place& place)
{
    Sides here = {};
    for (int axis = 0; axis < 3; ++axis)
        if (const std::size_t side = side_of(axis, place[axis] > 0); place[axis] != 0)
            here[side] = sides[side];
    return here;
}

/// How far the points of a region are within the boxes of all cells that share a point of
/// the lattice.
class Inset
{
public:
    /// What one of the cells says of one of its sides.
    void add(std::size_t side, double inset, double edge)
    {
        sums_[side] += inset;
        ++counts_[side];
        edge_ = std::min(edge_, edge);
    }
    Eigen::Vector3d shift() const
    {
        Eigen::Vector3d shift = Eigen::Vector3d::Zero();
        for (int axis = 0; axis < 3; ++axis)
            shift[axis] = mean(side_of(axis, false)) - mean(side_of(axis, true));
        return shift;
    }
    /// Of the smallest of the cells.
    double edge() const { return edge_; }

private:
    double mean(std::size_t side) const
    {
        const double mean = counts_[side] > 0 ? sums_[side] / counts_[side] : 0.0;
        return mean < kLeastInset * edge_ ? 0.0 : std::min(mean, kLargestInset * edge_);
    }

    std::array<double, 6> sums_ = {};
    std::array<int, 6> counts_ = {};
    double edge_ = std::numeric_limits<double>::infinity();
};

} // namespace

RegionPoints::RegionPoints(const Cells& cells, std::span<const Constraint> constraints)
    : points_(cells.size())
{
    double largest = 0.0, finest = std::numeric_limits<double>::infinity();
    for (const Cell& cell : cells.cells)
    {
        largest = std::max(largest, cell.edge);
        finest = std::min(finest, cell.edge);
    }
    const std::vector<Sides> sides = free_sides(cells, constraints);
    // All points lie on a lattice of half the finest edge, whose numbers tell them apart.
    // Calls visit(cell, point of its box, free sides there, lattice point) for all.
    const auto for_each_point = [&](const auto& visit)
    {
        for (std::size_t i = 0; i < cells.size(); ++i)
        {
            const Cell& cell = cells.cells[i];
            if (!constraints[i].is_of_rigid_region() || !is_full(cell))
                continue;
            for (int k = 0; k < 27; ++k)
            {
                const Place place(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
                const Sides here = sides_at(sides[i], place);
                const bool is_at_border = here != Sides{};
                if (!is_corner(place) && (!is_at_border || cell.edge < largest))
                    continue;
                const Eigen::Vector3d at =
                    cell.box_centre + 0.5 * cell.edge * place.cast<double>();
                LatticePoint key;
                for (int axis = 0; axis < 3; ++axis)
                    key[idx(axis)] = std::llround(
                        (at[axis] - cells.cells.front().box_centre[axis]) / finest * 2.0);
                visit(i, at, here, key);
            }
        }
    };
    std::map<LatticePoint, Inset> insets;
    for_each_point(
        [&](std::size_t i, const Eigen::Vector3d&, const Sides& here,
            const LatticePoint& key)
        {
            for (std::size_t side = 0; side < here.size(); ++side)
                if (here[side])
                    insets[key].add(side, constraints[i].insets[side],
                                    cells.cells[i].edge);
        });
    std::set<LatticePoint> too_near;
    for_each_point(
        [&](std::size_t i, const Eigen::Vector3d& at, const Sides& here,
            const LatticePoint& key)
        {
            Point point{key, at, here != Sides{}};
            if (const auto inset = insets.find(key); inset != insets.end())
            {
                point.at += inset->second.shift();
                if ((point.at - cells.cells[i].anchor).norm() <
                    kTooNear * inset->second.edge())
                    too_near.insert(key);
            }
            points_[i].push_back(point);
        });
    for (std::vector<Point>& points : points_)
        std::erase_if(points, [&](const Point& point)
                      { return too_near.contains(point.lattice); });
}

} // namespace cellwarp::core
