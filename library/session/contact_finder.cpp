// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/contact_finder.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>
#include <utility>

#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "octree/base/point_tree.h"

namespace cellwarp::core
{

namespace
{

/// Contact is so much stiffer than the glue of as much material: what presses as hard as
/// a strain of 1 would goes in by a sixtieth of a cell.
constexpr double kStiffness = 60.0;

/// Middles of voxels on boundaries stay so far apart: the surfaces are up to half a voxel
/// off these, and cells press a little into what holds them up [voxel].
constexpr double kClearance = 1.5;

/// Points that are no farther before that may come to it in the next solve [voxel].
constexpr double kBefore = 1.0;

/// From a cell to points that it may have contacts with [voxel].
constexpr double kReach = kClearance + kBefore;

/// Points of different parts that are nearer to each other at rest touch there [voxel].
constexpr double kBeside = 4.0;

/// The boundaries face each other where their directions out have a smaller cosine.
constexpr double kFacing = -0.7;

/// Cells that are no more steps apart are near each other.
constexpr int kNearSteps = 3;

/// From the middle of a cube to its corner, of its edge.
const double kToCorner = std::sqrt(0.75);

/// Sliding cells take part in no contact, following ones in those of their own solve.
bool takes_part(const Constraint& constraint)
{
    return constraint.hold != Hold::Sliding && constraint.hold != Hold::Following;
}

std::vector<int> cells_near(const Cells& cells, int cell)
{
    std::vector<int> near = {cell}, last = near;
    for (int step = 0; step < kNearSteps; ++step)
    {
        std::vector<int> next;
        for (const int one : last)
            for (const int other : cells.neighbours_of(one))
                next.push_back(other);
        std::sort(next.begin(), next.end());
        next.erase(std::unique(next.begin(), next.end()), next.end());
        last.clear();
        std::set_difference(next.begin(), next.end(), near.begin(), near.end(),
                            std::back_inserter(last));
        near.insert(near.end(), last.begin(), last.end());
        std::sort(near.begin(), near.end());
    }
    return near;
}

} // namespace

ContactFinder::ContactFinder(std::shared_ptr<const Body> body,
                             std::span<const double> factors,
                             std::span<const Constraint> constraints)
    : body_(std::move(body)), factors_(factors.begin(), factors.end()),
      near_(body_->cells.size()), points_(body_->cells.size())
{
    factors_.resize(body_->cells.size(), 1.0);
    for (std::size_t c = 0; c < constraints.size(); ++c)
    {
        const Constraint& constraint = constraints[c];
        leaders_.push_back(constraint.leader >= 0 ? constraint.leader
                                                  : static_cast<int>(c));
        can_move_.push_back(constraint.hold == Hold::Free ||
                            constraint.hold == Hold::Pinned ||
                            constraint.hold == Hold::Grouped);
    }
    parallel_for(near_.size(), [&](std::size_t c)
                 { near_[c] = cells_near(body_->cells, static_cast<int>(c)); });
    const VoxelGrid& grid = body_->rest->material.grid;
    // Of what has no point on the boundary the middle of its box is material.
    for (const Cell& cell : body_->cells.cells)
        material_.push_back(grid.material()[grid.index(grid.locate(cell.box_centre))]);
    const std::vector<BoundaryPoint>& points = body_->rest->boundary->all();
    for (std::size_t p = 0; p < points.size(); ++p)
        if (const int cell = body_->pieces.at(grid, points[p].voxel);
            cell >= 0 && takes_part(constraints[idx(cell)]))
        {
            points_[idx(cell)].push_back(p);
            material_[idx(cell)] = grid.material()[grid.index(points[p].voxel)];
        }
    // No boundary is of material 0.
    for (std::size_t c = 0; c < constraints.size(); ++c)
        if (!takes_part(constraints[c]))
            material_[c] = 0;
}

bool ContactFinder::is_near(int cell, int other) const
{
    const std::vector<int>& near = near_[idx(cell)];
    return std::binary_search(near.begin(), near.end(), other);
}

/// Of each cell those whose boxes may have come to its own, and that are not near it.
std::vector<std::vector<int>>
ContactFinder::cells_that_meet(std::span<const Pose> poses) const
{
    const std::vector<Cell>& cells = body_->cells.cells;
    std::vector<Eigen::Vector3d> middles;
    double largest = 0.0;
    for (std::size_t c = 0; c < cells.size(); ++c)
    {
        middles.push_back(image(poses[c], cells[c].centre, cells[c].box_centre));
        largest = std::max(largest, cells[c].edge);
    }
    const double reach = kReach * body_->rest->material.grid.shape().voxel();
    const auto may_touch = [&](int one, int other)
    {
        return (can_move_[idx(one)] || can_move_[idx(other)]) &&
               leaders_[idx(one)] != leaders_[idx(other)] && !is_near(one, other);
    };
    std::vector<std::vector<int>> meet(cells.size());
    if (cells.empty())
        return meet;
    const PointTree tree(middles);
    parallel_for(
        cells.size(),
        [&](std::size_t c)
        {
            if (points_[c].empty())
                return;
            std::vector<PointTree::Neighbour> found;
            tree.within(middles[c], kToCorner * (cells[c].edge + largest) + reach, found);
            for (const auto& [other, distance_squared] : found)
                if (distance_squared <
                        std::pow(kToCorner * (cells[c].edge + cells[other].edge) + reach,
                                 2) &&
                    may_touch(static_cast<int>(c), static_cast<int>(other)))
                    meet[c].push_back(static_cast<int>(other));
            std::sort(meet[c].begin(), meet[c].end());
        });
    return meet;
}

/// The points of a cell that are in one of the others.
void ContactFinder::find_of(int cell, std::span<const int> others,
                            std::span<const Pose> poses,
                            std::vector<FoundContact>& found) const
{
    const VoxelGrid& grid = body_->rest->material.grid;
    const BoundaryPoints& boundary = *body_->rest->boundary;
    const std::vector<Cell>& cells = body_->cells.cells;
    const Cell& from = cells[idx(cell)];
    const double voxel = grid.shape().voxel();
    for (const std::size_t p : points_[idx(cell)])
    {
        const BoundaryPoint& point = boundary.all()[p];
        const Eigen::Vector3d now = image(poses[idx(cell)], from.centre, point.place);
        std::optional<FoundContact> best;
        for (const int other : others)
        {
            const Cell& to = cells[idx(other)];
            const Pose& pose = poses[idx(other)];
            // Where the point is, and where it looks, to the cell at rest.
            const Eigen::Vector3d x = to.centre + pose.R.transpose() * (now - pose.p);
            const Eigen::Vector3d looks =
                pose.R.transpose() * (poses[idx(cell)].R * point.outward);
            if (!((x - to.box_centre).cwiseAbs().maxCoeff() <=
                  0.5 * to.edge + kReach * voxel))
                continue;
            const int holder = body_->pieces.at(grid, grid.locate(x));
            const bool is_in_part =
                holder >= 0 && material_[idx(holder)] == material_[idx(other)];
            if (is_in_part && holder != other)
                continue; // that cell tells
            const BoundaryPoint* const nearest = boundary.nearest(
                x,
                [&](const BoundaryPoint& at) {
                    return grid.material()[grid.index(at.voxel)] == material_[idx(other)];
                });
            if (!nearest ||
                (!point.outward.isZero(0) && !(looks.dot(nearest->outward) < kFacing)))
                continue;
            const int owner = body_->pieces.at(grid, nearest->voxel);
            // What is nearer at rest may stay so near.
            const double at_rest =
                nearest->outward.dot(point.place - nearest->place) / voxel;
            const bool is_beside =
                (point.place - nearest->place).norm() < kBeside * voxel;
            const double clearance =
                is_beside ? std::min(kClearance, at_rest) : kClearance;
            const Eigen::Vector3d place =
                nearest->place + clearance * voxel * nearest->outward;
            const double depth = nearest->outward.dot(place - x);
            if (is_near(cell, owner) || !(depth > -kBefore * voxel) ||
                (!is_in_part && owner != other) || (best && best->depth >= depth))
                continue;
            CellContact contact;
            contact.a = leaders_[idx(cell)];
            contact.b = leaders_[idx(other)];
            contact.point = point.place - cells[idx(contact.a)].centre;
            contact.place = place - cells[idx(contact.b)].centre;
            contact.outward = nearest->outward;
            contact.stiffness = kStiffness * boundary.area() /
                                (0.5 * (from.edge + to.edge)) *
                                std::sqrt(factors_[idx(cell)] * factors_[idx(other)]);
            best = {p, contact, depth};
        }
        if (best)
            found.push_back(*best);
    }
}

std::vector<FoundContact> ContactFinder::find(std::span<const Pose> poses) const
{
    const std::vector<std::vector<int>> meet = cells_that_meet(poses);
    std::vector<std::vector<FoundContact>> of_cell(meet.size());
    parallel_for(meet.size(),
                 [&](std::size_t c)
                 {
                     if (!meet[c].empty())
                         find_of(static_cast<int>(c), meet[c], poses, of_cell[c]);
                 });
    std::vector<FoundContact> all;
    for (const std::vector<FoundContact>& found : of_cell)
        all.insert(all.end(), found.begin(), found.end());
    std::sort(all.begin(), all.end(),
              [](const FoundContact& a, const FoundContact& b)
              { return a.point < b.point; });
    return all;
}

} // namespace cellwarp::core
