// SPDX-License-Identifier: GPL-3.0-or-later
// Why points on the free surface. The energy of the glue tends to int |grad phi - R|^2
// (theory of [Botsch07]); where nothing holds the surface its natural condition is
// (grad phi - R) n = 0: across a free surface the map is that of the cell's own rigid
// motion. A point at the surface that moves with its cell states just that. Without it
// the RBF extrapolates by half a cell, and what it finds there depends on the whole
// shape: measured on a bar turned by 135 degrees (2,048 cells) RBFs of clusters and of
// all cells then differ by 8e-4 of the diagonal, with these points by 6e-5; and the
// RMS distance from the result of 6,912 cells falls from 6e-4 to 4e-4. Next to prescribed
// cells, where the strain is largest, such points do harm.
#include "solver/field/centres.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include <Eigen/Eigenvalues>

#include "octree/base/index.h"
#include "octree/base/parallel.h"

namespace cellwarp::core
{

namespace
{

/// A neighbourhood of centroids is flat in a direction in which their spread (standard
/// deviation) is below this share of a cell: two layers have a half, one has none.
constexpr double kFlat = 0.25;

/// Open area that counts as a free surface [edge^2].
constexpr double kLeastOpen = 0.3;

/// How far from the centroid the points at the surface are [edge]: where the piece ends,
/// within these bounds.
constexpr double kNearestSide = 0.1, kFarthestSide = 0.5;

/// A coordinate axis that lies in the flat directions by less than this is no side.
constexpr double kLeastAxis = 0.3;

/// The cell, its neighbours and theirs.
std::vector<int> neighbourhood(const Cells& cells, int cell)
{
    std::vector<int> near = {cell};
    std::size_t begin = 0;
    for (int ring = 0; ring < 2; ++ring)
    {
        const std::size_t end = near.size();
        for (; begin < end; ++begin)
            for (const int other : cells.neighbours_of(near[begin]))
                if (std::find(near.begin(), near.end(), other) == near.end())
                    near.push_back(other);
    }
    return near;
}

/// Directions in which the neighbourhood is flat. Where these span a plane or all of
/// space, any choice would do; the coordinate axes' parts in it turn with the axes.
std::vector<Eigen::Vector3d> flat_directions(const Cells& cells, int cell)
{
    const Cell& own = cells.cells[idx(cell)];
    const std::vector<int> near = neighbourhood(cells, cell);
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    const double share = 1.0 / static_cast<double>(near.size());
    for (const int other : near)
    {
        const Eigen::Vector3d x =
            (cells.cells[idx(other)].centre - own.centre) / own.edge;
        mean += share * x;
        spread += share * x * x.transpose();
    }
    spread -= mean * mean.transpose();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(spread);
    const int num_flat =
        static_cast<int>((axes.eigenvalues().array() < kFlat * kFlat).count());
    std::vector<Eigen::Vector3d> directions;
    if (num_flat == 1)
        directions.push_back(axes.eigenvectors().col(0));
    for (int axis = 0; axis < 3 && num_flat > 1; ++axis)
    {
        const Eigen::Matrix<double, 3, Eigen::Dynamic> flat =
            axes.eigenvectors().leftCols(num_flat);
        const Eigen::Vector3d part = flat * flat.row(axis).transpose();
        if (part.norm() > kLeastAxis)
            directions.push_back(part.normalized());
    }
    return directions;
}

/// Further points of the cell, beside its anchor: on both sides where the material is one
/// cell thick, else outwards where it ends. \p open: the sum of the outward normals,
/// times area, of what is not glued.
std::vector<Eigen::Vector3d> sides_of(const Cells& cells, int cell,
                                      const Eigen::Vector3d& open)
{
    const Cell& own = cells.cells[idx(cell)];
    std::vector<Eigen::Vector3d> sides;
    const auto add = [&](const Eigen::Vector3d& direction)
    {
        const double half_thickness =
            std::sqrt(3.0 * std::max(0.0, direction.dot(own.second_moment * direction)));
        const double side =
            std::clamp(half_thickness, kNearestSide * own.edge, kFarthestSide * own.edge);
        sides.push_back(own.anchor +
                        direction * (direction.dot(own.centre - own.anchor) + side));
    };
    for (const Eigen::Vector3d& direction : flat_directions(cells, cell))
    {
        add(direction);
        add(-direction);
    }
    if (sides.empty() && open.norm() > kLeastOpen * own.edge * own.edge)
        add(open.normalized());
    return sides;
}

} // namespace

CentreChoice::CentreChoice(const Cells& cells, std::span<const Constraint> constraints)
    : cells_(cells), constraints_(constraints), sides_(cells.size()),
      of_regions_(cells, constraints)
{
    // All around a cell the normals of its box add up to nothing: what is not glued is
    // the opposite of what is.
    std::vector<Eigen::Vector3d> open(cells.size(), Eigen::Vector3d::Zero());
    for (const Face& face : cells.faces)
    {
        open[idx(face.a)][face.axis] -= face.contact;
        open[idx(face.b)][face.axis] += face.contact;
    }
    // Next to prescribed cells the surface is not free.
    for (const Face& face : cells.faces)
        for (const auto& [one, other] : {std::pair(face.a, face.b), {face.b, face.a}})
            if (constraints[idx(other)].is_of_rigid_region())
                open[idx(one)].setZero();
    parallel_for(cells.size(),
                 [&](std::size_t i)
                 {
                     if (of_regions_.of(i).empty())
                         sides_[i] = sides_of(cells_, static_cast<int>(i), open[i]);
                 });
}

RbfCentres CentreChoice::centres_of(std::span<const int> some_cells,
                                    std::span<const Pose> poses) const
{
    RbfCentres centres;
    const auto add = [&](std::size_t i, const Eigen::Vector3d& point)
    {
        centres.points.push_back(point);
        centres.displacements.push_back(
            displacement(poses[i], cells_.cells[i].centre, point));
    };
    struct KnownPoint
    {
        Eigen::Vector3d at, displacement;
        bool is_shared_by_different = false;
    };
    std::map<RegionPoints::LatticePoint, KnownPoint> known;
    for (const int cell_index : some_cells)
    {
        const std::size_t i = idx(cell_index);
        const Cell& cell = cells_.cells[i];
        if (constraints_[i].hold == Hold::Idle)
            continue;
        add(i, cell.anchor);
        for (const Eigen::Vector3d& side : sides_[i])
            add(i, side);
        // Of a region more points where free cells meet it: there the strain is largest,
        // and what an RBF misses between corners would be left to the fade.
        for (const RegionPoints::Point& point : of_regions_.of(i))
        {
            const Eigen::Vector3d d = displacement(poses[i], cell.centre, point.at);
            const auto [found, is_new] =
                known.try_emplace(point.lattice, KnownPoint{point.at, d});
            // Motions that agree here to a millionth of a cell are one.
            if (!is_new && (found->second.displacement - d).norm() > 1e-6 * cell.edge)
                found->second.is_shared_by_different = true;
        }
    }
    for (const auto& [lattice, point] : known)
        if (!point.is_shared_by_different)
        {
            centres.points.push_back(point.at);
            centres.displacements.push_back(point.displacement);
        }
    return centres;
}

RbfCentres CentreChoice::centres_of_all(std::span<const Pose> poses) const
{
    std::vector<int> all(cells_.size());
    std::iota(all.begin(), all.end(), 0);
    return centres_of(all, poses);
}

RbfCentres cell_centres(const Cells& cells, std::span<const Constraint> constraints,
                        std::span<const Pose> poses)
{
    RbfCentres centres;
    for (std::size_t i = 0; i < cells.size(); ++i)
    {
        if (constraints[i].hold == Hold::Idle)
            continue;
        const Cell& cell = cells.cells[i];
        centres.points.push_back(cell.anchor);
        centres.displacements.push_back(displacement(poses[i], cell.centre, cell.anchor));
    }
    return centres;
}

} // namespace cellwarp::core
