// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/flesh/lattice.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include <Eigen/LU>

#include "octree/base/union_find.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::Vector3i;

/// A lattice this small needs no coarser one [nodes].
constexpr std::size_t kCoarseEnough = 27;

/// One of the ever coarser lattices.
struct Level
{
    std::vector<LatticeBox> boxes;
    std::vector<std::pair<int, int>> glued;
    BoxNodes nodes;
};

/// The smallest boxes are put together by twos along each axis, where glue leads from one
/// to the other inside; \p group tells where each went.
Level coarsened(const Level& fine, std::vector<int>& group)
{
    int width = fine.boxes.front().width;
    for (const LatticeBox& box : fine.boxes)
        width = std::min(width, box.width);
    const auto above = [&](const LatticeBox& box)
    {
        if (box.width > width)
            return box;
        LatticeBox out{box.corner, 2 * width};
        for (int& c : out.corner)
            c = c / (2 * width) * (2 * width);
        return out;
    };
    UnionFind joined(fine.boxes.size());
    const auto is_small = [&](int b) { return fine.boxes[idx(b)].width == width; };
    for (const auto& [a, b] : fine.glued)
        if (is_small(a) && is_small(b) &&
            above(fine.boxes[idx(a)]).corner == above(fine.boxes[idx(b)]).corner)
            joined.join(a, b);
    Level out;
    group.assign(fine.boxes.size(), -1);
    for (std::size_t b = 0; b < fine.boxes.size(); ++b)
    {
        const std::size_t first = idx(joined.first_of(static_cast<int>(b)));
        if (first == b)
        {
            group[b] = static_cast<int>(out.boxes.size());
            out.boxes.push_back(above(fine.boxes[b]));
        }
        group[b] = group[first];
    }
    for (const auto& [a, b] : fine.glued)
        if (group[idx(a)] != group[idx(b)])
            out.glued.emplace_back(std::minmax(group[idx(a)], group[idx(b)]));
    std::sort(out.glued.begin(), out.glued.end());
    out.glued.erase(std::unique(out.glued.begin(), out.glued.end()), out.glued.end());
    out.nodes = box_nodes(out.boxes, out.glued);
    return out;
}

/// d/d local of the trilinear functions of the corners.
std::array<Vector3d, 8> corner_slopes(const Vector3d& local)
{
    std::array<Vector3d, 8> slopes;
    for (int k = 0; k < 8; ++k)
    {
        Vector3d value, slope;
        for (int i = 0; i < 3; ++i)
        {
            const bool is_far = k >> i & 1;
            value[i] = is_far ? local[i] : 1.0 - local[i];
            slope[i] = is_far ? 1.0 : -1.0;
        }
        slopes[idx(k)] = {slope.x() * value.y() * value.z(),
                          value.x() * slope.y() * value.z(),
                          value.x() * value.y() * slope.z()};
    }
    return slopes;
}

} // namespace

Lattice octree_lattice(const Octree& octree, const Cells& cells, double unit)
{
    Level level;
    double finest = 0.0; // edge of width 1 [unit of the cells]
    for (const Cell& cell : cells.cells)
    {
        const Leaf& leaf = octree[cell.leaf];
        level.boxes.push_back({leaf.corner, octree.width(leaf)});
        finest = cell.edge / octree.width(leaf);
    }
    for (const Face& face : cells.faces)
        level.glued.emplace_back(std::minmax(face.a, face.b));
    level.nodes = box_nodes(level.boxes, level.glued);
    Lattice out;
    for (const Vector3i& place : level.nodes.places)
        out.places.push_back(unit * (cells.corner + finest * place.cast<double>()));
    out.cells = level.nodes.of_box;
    out.boxes = level.boxes;
    out.hanging = level.nodes.hanging;
    for (std::size_t c = 0; c < cells.size(); ++c)
    {
        const Cell& cell = cells.cells[c];
        out.parts.push_back({static_cast<int>(c), 0, cell.volume * unit * unit * unit,
                             unit * cell.centre, unit * unit * cell.second_moment});
    }
    for (const Face& face : cells.faces)
        out.sides.push_back({face.a, face.b, out.edge(face.a), out.edge(face.b)});
    while (!level.boxes.empty() && level.nodes.places.size() > kCoarseEnough)
    {
        std::vector<int> group;
        Level coarse = coarsened(level, group);
        if (coarse.nodes.places.size() >= level.nodes.places.size())
            break;
        out.coarser.push_back(
            {coarse.nodes.places.size(),
             rows_between(level.nodes, coarse.boxes, coarse.nodes, group)});
        level = std::move(coarse);
    }
    return out;
}

std::vector<LatticePart> parts_by_material(const VoxelGrid& grid, const Octree& octree,
                                           const Pieces& pieces,
                                           std::span<const int> material, double unit)
{
    // Sums run about the first voxel of each part, to keep their digits.
    struct Sums
    {
        LatticePart part;
        Vector3d from = Vector3d::Zero(), first = Vector3d::Zero();
        Matrix3d second = Matrix3d::Zero();
    };
    std::map<std::pair<int, int>, Sums> all;
    const auto add = [&](std::size_t voxel, int cell)
    {
        const Vector3i v = grid.coordinates(voxel);
        const Vector3d size =
            unit *
            Vector3d(grid.extent(0, v.x()), grid.extent(1, v.y()), grid.extent(2, v.z()));
        const double volume = size.prod();
        if (!(volume > 0.0))
            return;
        const Leaf& leaf = octree[pieces.leaf(cell)];
        if (!is_in(voxel_block(grid.shape(), leaf), v))
            return; // a crumb belongs to a cell elsewhere
        const Vector3d x = unit * grid.centre(v);
        const auto [found, is_new] = all.try_emplace({cell, material[voxel]});
        Sums& sums = found->second;
        if (is_new)
            sums.from = x;
        sums.part.volume += volume;
        sums.first += volume * (x - sums.from);
        sums.second += volume * (x - sums.from) * (x - sums.from).transpose();
        sums.second.diagonal() += volume / 12.0 * size.cwiseAbs2();
    };
    pieces.for_each(grid, add);
    std::vector<LatticePart> parts;
    for (auto& [key, sums] : all)
    {
        const Vector3d mean = sums.first / sums.part.volume;
        sums.part.cell = key.first;
        sums.part.material = key.second;
        sums.part.centre = sums.from + mean;
        sums.part.second_moment =
            sums.second / sums.part.volume - mean * mean.transpose();
        parts.push_back(sums.part);
    }
    return parts;
}

InvertedHexahedron::InvertedHexahedron(std::size_t which)
    : std::invalid_argument("hexahedron " + std::to_string(which) +
                            " is turned inside out"),
      number(which)
{
}

Lattice drawn_lattice(std::vector<Vector3d> places, std::vector<CornerNodes> cells,
                      std::span<const int> material)
{
    Lattice out;
    out.places = std::move(places);
    out.cells = std::move(cells);
    out.hanging.resize(out.places.size());
    out.has_boxes = false;
    const double near = 0.5 - 0.5 / std::sqrt(3.0);
    for (std::size_t c = 0; c < out.cells.size(); ++c)
    {
        LatticePart part;
        part.cell = static_cast<int>(c);
        part.material = material[c];
        for (int k = 0; k < 8; ++k)
        {
            const Vector3d local(k & 1 ? 1.0 - near : near, k & 2 ? 1.0 - near : near,
                                 k & 4 ? 1.0 - near : near);
            const double weight = cell_slopes(out, part.cell, local).determinant() / 8.0;
            if (!(weight > 0))
                throw InvertedHexahedron(c);
            part.volume += weight;
            part.centre += weight * cell_point(out, part.cell, local);
        }
        part.centre /= part.volume;
        out.parts.push_back(part);
    }
    return out;
}

Vector3d cell_point(const Lattice& lattice, int cell, const Vector3d& local)
{
    const std::array<double, 8> shares = corner_shares(local);
    Vector3d x = Vector3d::Zero();
    for (std::size_t k = 0; k < 8; ++k)
        x += shares[k] * lattice.places[idx(lattice.cells[idx(cell)][k])];
    return x;
}

Matrix3d cell_slopes(const Lattice& lattice, int cell, const Vector3d& local)
{
    const std::array<Vector3d, 8> slopes = corner_slopes(local);
    Matrix3d J = Matrix3d::Zero();
    for (std::size_t k = 0; k < 8; ++k)
        J += lattice.places[idx(lattice.cells[idx(cell)][k])] * slopes[k].transpose();
    return J;
}

std::optional<Vector3d> local_place(const Lattice& lattice, int cell, const Vector3d& x)
{
    if (lattice.has_boxes)
        return (x - lattice.places[idx(lattice.cells[idx(cell)][0])]) /
               lattice.edge(cell);
    constexpr int kSteps = 50;
    constexpr double kClose = 1e-13;
    Vector3d local = Vector3d::Constant(0.5);
    for (int step = 0; step < kSteps; ++step)
    {
        const Matrix3d J = cell_slopes(lattice, cell, local);
        if (!(std::abs(J.determinant()) > 0))
            return std::nullopt;
        const Vector3d move =
            J.partialPivLu().solve(x - cell_point(lattice, cell, local));
        local += move;
        if (!(local.cwiseAbs().maxCoeff() < 1e3))
            return std::nullopt;
        if (move.cwiseAbs().maxCoeff() < kClose)
            return local;
    }
    return std::nullopt;
}

NodeShares shares_at(const Lattice& lattice, int cell, const Vector3d& local)
{
    return shares_of(lattice.cells[idx(cell)], lattice.hanging, local);
}

} // namespace cellwarp::core
