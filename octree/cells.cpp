// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/cells.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <stdexcept>
#include <tuple>

#include "octree/parallel.h"

namespace cellwarp
{

namespace
{

/// Whether a leaf is a cube, all of one piece.
bool is_whole(const VoxelGrid& grid, const VoxelBlock& block, const Pieces& pieces,
              int piece)
{
    const double edge = grid.shape().voxel() * block.width;
    for (int axis = 0; axis < 3; ++axis)
    {
        const std::vector<double>& lines = grid.lines(axis);
        const std::size_t begin = static_cast<std::size_t>(block.first[axis]);
        const double length =
            lines[begin + static_cast<std::size_t>(block.width)] - lines[begin];
        if (std::abs(length - edge) > 1e-9 * edge)
            return false; // cut by the border of the grid
    }
    for (int k = 0; k < block.width; ++k)
        for (int j = 0; j < block.width; ++j)
        {
            const std::int32_t* row = &pieces.piece_of_voxel[grid.index(
                block.first.x(), block.first.y() + j, block.first.z() + k)];
            if (std::any_of(row, row + block.width,
                            [&](std::int32_t other) { return other != piece; }))
                return false;
        }
    return true;
}

/// Mass properties of the pieces of one leaf; sums run about the leaf's box centre
/// to keep their digits.
void measure_leaf(const VoxelGrid& grid, const Octree& octree, const Pieces& pieces,
                  std::size_t leaf_index, std::span<Cell> cells, int first_piece)
{
    const Leaf& leaf = octree.leaves()[leaf_index];
    const VoxelBlock block = voxel_block(grid.shape(), leaf);
    const double edge = grid.shape().voxel() * block.width;
    const Eigen::Vector3d box_centre =
        grid.corner() +
        grid.shape().voxel() *
            (block.first.cast<double>().array() + 0.5 * block.width).matrix();
    if (cells.size() == 1 && is_whole(grid, block, pieces, first_piece))
    {
        cells[0] = {static_cast<int>(leaf_index),
                    box_centre,
                    edge,
                    box_centre,
                    box_centre,
                    edge * edge * edge,
                    edge * edge / 12.0 * Eigen::Matrix3d::Identity()};
        return;
    }
    std::vector<Eigen::Vector3d> first(cells.size(), Eigen::Vector3d::Zero());
    std::vector<Eigen::Matrix3d> second(cells.size(), Eigen::Matrix3d::Zero());
    for (int k = 0; k < block.width; ++k)
        for (int j = 0; j < block.width; ++j)
            for (int i = 0; i < block.width; ++i)
            {
                const Eigen::Vector3i voxel = block.first + Eigen::Vector3i(i, j, k);
                const int piece = pieces.piece_of_voxel[grid.index(voxel)];
                // A crumb belongs to another leaf's piece.
                if (piece < first_piece ||
                    piece >= first_piece + static_cast<int>(cells.size()))
                    continue;
                const std::size_t at = static_cast<std::size_t>(piece - first_piece);
                const Eigen::Vector3d size(grid.extent(0, voxel.x()),
                                           grid.extent(1, voxel.y()),
                                           grid.extent(2, voxel.z()));
                const double volume = size.prod();
                const Eigen::Vector3d x = grid.centre(voxel) - box_centre;
                cells[at].volume += volume;
                first[at] += volume * x;
                second[at] += volume * (x * x.transpose());
                second[at].diagonal() += volume / 12.0 * size.cwiseAbs2();
            }
    for (std::size_t at = 0; at < cells.size(); ++at)
    {
        Cell& cell = cells[at];
        if (!(cell.volume > 0))
            throw std::logic_error("a cell has no volume");
        const Eigen::Vector3d mean = first[at] / cell.volume;
        cell.leaf = static_cast<int>(leaf_index);
        cell.box_centre = box_centre;
        cell.edge = edge;
        cell.centre = box_centre + mean;
        cell.anchor = cells.size() > 1 ? cell.centre : box_centre;
        cell.second_moment = second[at] / cell.volume - mean * mean.transpose();
    }
}

/// Whether a voxel lies in the leaf of the piece that it belongs to: it does unless it is
/// of a crumb.
bool is_at_home(const VoxelGrid& grid, const Octree& octree, const Pieces& pieces,
                const Eigen::Vector3i& voxel, int piece)
{
    const VoxelBlock block = voxel_block(
        grid.shape(), octree.leaves()[static_cast<std::size_t>(
                          pieces.leaf_of_piece[static_cast<std::size_t>(piece)])]);
    return (voxel.array() >= block.first.array()).all() &&
           (voxel.array() < block.first.array() + block.width).all();
}

/// Faces from the pieces of one leaf to those above it on each axis. Crumbs have none:
/// there would be faces of leaves that do not touch.
std::vector<Face> leaf_faces(const VoxelGrid& grid, const Octree& octree,
                             const Pieces& pieces, std::size_t leaf_index)
{
    const VoxelBlock block = voxel_block(grid.shape(), octree.leaves()[leaf_index]);
    std::map<std::tuple<int, int, int>, Face> found;
    std::tuple<int, int, int> last_key(-1, -1, -1);
    Face* last_face = nullptr;
    for (int axis = 0; axis < 3; ++axis)
    {
        const int u = (axis + 1) % 3, v = (axis + 2) % 3;
        const int last = block.first[axis] + block.width - 1;
        if (last + 1 >= grid.counts()[axis])
            continue;
        for (int j = 0; j < block.width; ++j)
            for (int i = 0; i < block.width; ++i)
            {
                Eigen::Vector3i below;
                below[axis] = last;
                below[u] = block.first[u] + i;
                below[v] = block.first[v] + j;
                Eigen::Vector3i above = below;
                above[axis] += 1;
                const int a = pieces.piece_of_voxel[grid.index(below)];
                const int b = pieces.piece_of_voxel[grid.index(above)];
                if (a < 0 || b < 0 || a == b ||
                    !is_at_home(grid, octree, pieces, below, a) ||
                    !is_at_home(grid, octree, pieces, above, b))
                    continue;
                const double area = grid.extent(u, below[u]) * grid.extent(v, below[v]);
                Eigen::Vector3d centre = grid.centre(below);
                centre[axis] = grid.lines(axis)[static_cast<std::size_t>(last) + 1];
                const std::tuple<int, int, int> face_key(a, axis, b);
                if (face_key != last_key)
                    last_face = &found[face_key];
                last_key = face_key;
                last_face->area += area;
                last_face->centre += area * centre;
            }
    }
    std::vector<Face> faces;
    for (auto& [key, face] : found)
    {
        std::tie(face.a, face.axis, face.b) = key;
        face.centre /= face.area;
        faces.push_back(face);
    }
    return faces;
}

} // namespace

Cells build_cells(const VoxelGrid& grid, const Octree& octree, const Pieces& pieces)
{
    const std::size_t num_leaves = octree.leaves().size();
    Cells result;
    result.corner = grid.corner();
    result.cells.resize(pieces.size());
    std::vector<std::size_t> first(num_leaves + 1, 0);
    for (const int leaf : pieces.leaf_of_piece)
        ++first[static_cast<std::size_t>(leaf) + 1];
    std::partial_sum(first.begin(), first.end(), first.begin());
    std::vector<std::vector<Face>> faces(num_leaves);
    parallel_for(
        num_leaves,
        [&](std::size_t i)
        {
            measure_leaf(
                grid, octree, pieces, i,
                std::span(result.cells).subspan(first[i], first[i + 1] - first[i]),
                static_cast<int>(first[i]));
            faces[i] = leaf_faces(grid, octree, pieces, i);
        });
    std::vector<std::vector<int>> neighbours(result.size());
    for (std::vector<Face>& of_leaf : faces)
        for (Face& face : of_leaf)
        {
            const std::size_t a = static_cast<std::size_t>(face.a);
            const std::size_t b = static_cast<std::size_t>(face.b);
            face.distance = 0.5 * (result.cells[a].edge + result.cells[b].edge);
            neighbours[a].push_back(face.b);
            neighbours[b].push_back(face.a);
            result.faces.push_back(face);
        }
    result.first_neighbour.push_back(0);
    for (std::vector<int>& of_cell : neighbours)
    {
        std::sort(of_cell.begin(), of_cell.end());
        result.neighbours.insert(result.neighbours.end(), of_cell.begin(), of_cell.end());
        result.first_neighbour.push_back(static_cast<int>(result.neighbours.size()));
    }
    return result;
}

std::vector<int> connected_components(const Cells& cells)
{
    std::vector<int> root(cells.size());
    std::iota(root.begin(), root.end(), 0);
    const auto find = [&](int cell)
    {
        while (root[static_cast<std::size_t>(cell)] != cell)
        {
            int& up = root[static_cast<std::size_t>(cell)];
            up = root[static_cast<std::size_t>(up)];
            cell = up;
        }
        return cell;
    };
    for (const Face& face : cells.faces)
    {
        const int a = find(face.a), b = find(face.b);
        root[static_cast<std::size_t>(std::max(a, b))] = std::min(a, b);
    }
    std::vector<int> number(cells.size(), -1);
    int count = 0;
    for (std::size_t i = 0; i < cells.size(); ++i)
    {
        const std::size_t first = static_cast<std::size_t>(find(static_cast<int>(i)));
        if (number[first] < 0)
            number[first] = count++;
        number[i] = number[first];
    }
    return number;
}

} // namespace cellwarp
