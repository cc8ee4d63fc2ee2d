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
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>

#include <Eigen/Eigenvalues>

#include "octree/base/index.h"
#include "octree/base/parallel.h"

namespace cellwarp
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

/// A cell whose material fills less of its box than this has no corners: they would lie
/// off the material, and hold what is beside it as in a vice. A shell's cells are such.
constexpr double kFull = 0.5;

bool is_full(const Cell& cell)
{
    return cell.volume > kFull * cell.edge * cell.edge * cell.edge;
}

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

std::vector<std::vector<Eigen::Vector3d>>
border_points(const Cells& cells, std::span<const Constraint> constraints)
{
    std::vector<std::array<bool, 6>> sides(cells.size()); // low x, high x, low y, ...
    std::vector<std::vector<Eigen::Vector3d>> points(cells.size());
    double largest = 0.0;
    for (const Cell& cell : cells.cells)
        largest = std::max(largest, cell.edge);
    for (const Face& face : cells.faces)
    {
        const bool a_is_held = constraints[idx(face.a)].is_of_rigid_region();
        const bool b_is_held = constraints[idx(face.b)].is_of_rigid_region();
        if (a_is_held == b_is_held)
            continue;
        const std::size_t held = idx(a_is_held ? face.a : face.b);
        if (is_full(cells.cells[held]))
            sides[held][idx(2 * face.axis + a_is_held)] = true;
    }
    for (std::size_t i = 0; i < cells.size(); ++i)
        for (int k = 0; k < 27; ++k)
        {
            const Eigen::Vector3i place(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
            if (cells.cells[i].edge < largest && (place.array() == 0).any())
                continue;
            bool is_on = false;
            for (int axis = 0; axis < 3; ++axis)
                is_on = is_on ||
                        (place[axis] != 0 && sides[i][idx(2 * axis + (place[axis] > 0))]);
            if (is_on)
                points[i].push_back(cells.cells[i].box_centre +
                                    0.5 * cells.cells[i].edge * place.cast<double>());
        }
    return points;
}

CentreChoice::CentreChoice(const Cells& cells, std::span<const Constraint> constraints)
    : cells_(cells), constraints_(constraints),
      finest_(std::numeric_limits<double>::infinity()), sides_(cells.size()),
      borders_(border_points(cells, constraints))
{
    for (const Cell& cell : cells.cells)
        finest_ = std::min(finest_, cell.edge);
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
                     if (!has_corners(i))
                         sides_[i] = sides_of(cells_, static_cast<int>(i), open[i]);
                 });
}

bool CentreChoice::has_corners(std::size_t cell) const
{
    return constraints_[cell].is_of_rigid_region() && is_full(cells_.cells[cell]);
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
    // They lie on the lattice of half the finest edge.
    struct KnownPoint
    {
        Eigen::Vector3d point, displacement;
        bool is_shared_by_different = false;
    };
    std::map<std::array<std::int64_t, 3>, KnownPoint> known;
    const Eigen::Vector3d origin =
        cells_.cells.empty() ? Eigen::Vector3d::Zero() : cells_.cells.front().box_centre;
    for (const int cell_index : some_cells)
    {
        const std::size_t i = idx(cell_index);
        const Cell& cell = cells_.cells[i];
        if (constraints_[i].hold == Hold::Idle)
            continue;
        add(i, cell.anchor);
        for (const Eigen::Vector3d& side : sides_[i])
            add(i, side);
        if (!constraints_[i].is_of_rigid_region())
            continue;
        // Its corners, and more where free cells meet it: there the strain is largest,
        // and what an RBF misses between corners would be left to the fade.
        std::vector<Eigen::Vector3d> points = borders_[i];
        for (int k = 0; k < 8 && has_corners(i); ++k)
            points.push_back(cell.box_centre + 0.5 * cell.edge *
                                                   Eigen::Vector3d(k & 1 ? 1 : -1,
                                                                   k & 2 ? 1 : -1,
                                                                   k & 4 ? 1 : -1));
        for (const Eigen::Vector3d& point : points)
        {
            std::array<std::int64_t, 3> key;
            for (int axis = 0; axis < 3; ++axis)
                key[idx(axis)] =
                    std::llround((point[axis] - origin[axis]) / finest_ * 2.0);
            const Eigen::Vector3d d = displacement(poses[i], cell.centre, point);
            const auto [found, is_new] = known.try_emplace(key, KnownPoint{point, d});
            // Motions that agree here to a millionth of a cell are one.
            if (!is_new && (found->second.displacement - d).norm() > 1e-6 * cell.edge)
                found->second.is_shared_by_different = true;
        }
    }
    for (const auto& [key, known_point] : known)
        if (!known_point.is_shared_by_different)
        {
            centres.points.push_back(known_point.point);
            centres.displacements.push_back(known_point.displacement);
        }
    return centres;
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

} // namespace cellwarp
