// SPDX-License-Identifier: GPL-3.0-or-later
// How stiff a face is when its two cells turn against each other by a small omega. A
// point r from the centre of the cross-section opens by omega x r.
// - In solid material M = tr S I - S, of the second moments S in the face alone: the mean
//   of both cells', weighted by their volumes. Where the surface cuts cells, the faces'
//   own moments would be now large, now small from one face to the next, and the
//   minimiser takes three times as many iterations. About the face's normal (a twist)
//   less would do: a film is twisted as easily as it is bent, and one that lies askew to
//   the cells in its own plane is too stiff by this; a block of n whole cells is by 0.4 /
//   n^2 at most. But half of it there costs the armadillo 43 iterations in place of 26.
//   No moment counts less than that of a film of a fifth of the glue's length, lest cells
//   that touch by a voxel's width dangle.
// - In a sheet with the normal n, which may lie askew, what opens along n: the next point
//   of a bent sheet is off the tangent plane there, no more. So a line of length l and
//   width t at r counts as
//     t^2 / 12 (I - n n^T) + [r]x^T (I - n n^T) [r]x + l^2 / 12 n n^T:
//   bending and twisting by its thickness alone, turning in its own plane by its length,
//   and a sheet that is curved within a face by its shape.
#include "octree/cells.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>
#include <tuple>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "octree/base/union_find.h"

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
        const std::size_t begin = idx(block.first[axis]);
        const double length = lines[begin + idx(block.width)] - lines[begin];
        if (std::abs(length - edge) > 1e-9 * edge)
            return false; // cut by the border of the grid
    }
    for (int k = 0; k < block.width; ++k)
        for (int j = 0; j < block.width; ++j)
        {
            const std::size_t row =
                grid.index(block.first.x(), block.first.y() + j, block.first.z() + k);
            for (int i = 0; i < block.width; ++i)
                if (pieces.piece_of_voxel[row + idx(i)] != piece)
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
        cells[0] = {LeafNumber(leaf_index),
                    box_centre,
                    edge,
                    box_centre,
                    box_centre,
                    edge * edge * edge,
                    edge * edge / 12.0 * Eigen::Matrix3d::Identity(),
                    box_centre};
        return;
    }
    std::vector<Eigen::Vector3d> first(cells.size(), Eigen::Vector3d::Zero());
    std::vector<Eigen::Matrix3d> second(cells.size(), Eigen::Matrix3d::Zero());
    for (int k = 0; k < block.width; ++k)
        for (int j = 0; j < block.width; ++j)
        {
            const std::size_t row =
                grid.index(block.first.x(), block.first.y() + j, block.first.z() + k);
            for (int i = 0; i < block.width; ++i)
            {
                const int piece = pieces.piece_of_voxel[row + idx(i)];
                // A crumb belongs to another leaf's piece.
                if (piece < first_piece ||
                    piece >= first_piece + static_cast<int>(cells.size()))
                    continue;
                const Eigen::Vector3i voxel = block.first + Eigen::Vector3i(i, j, k);
                const std::size_t at = idx(piece - first_piece);
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
        }
    for (std::size_t at = 0; at < cells.size(); ++at)
    {
        Cell& cell = cells[at];
        if (!(cell.volume > 0))
            throw std::logic_error("a cell has no volume");
        const Eigen::Vector3d mean = first[at] / cell.volume;
        cell.leaf = LeafNumber(leaf_index);
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
    const LeafNumber leaf = pieces.leaf_of_piece[idx(piece)];
    return is_in(voxel_block(grid.shape(), octree[leaf]), voxel);
}

/// What is added up over the pairs of voxels of one face.
struct FaceSum
{
    double contact = 0.0; ///< of all pairs
    double area = 0.0;    ///< of those that are no sheet's
    Eigen::Vector3d contact_first = Eigen::Vector3d::Zero(), first = contact_first;
};

/// Solid material turns no more easily than a film of this thickness [distance].
constexpr double kLeastFilm = 0.2;

/// M of a solid face.
Eigen::Matrix3d turning_of(const Face& face, const Cell& a, const Cell& b)
{
    const Eigen::Matrix3d S =
        (a.volume * a.second_moment + b.volume * b.second_moment) / (a.volume + b.volume);
    const int u = (face.axis + 1) % 3, v = (face.axis + 2) % 3;
    Eigen::Matrix2d in_face;
    in_face << S(u, u), S(u, v), S(v, u), S(v, v);
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(in_face);
    const double least = std::pow(kLeastFilm * face.distance, 2) / 12.0;
    const double S1 = std::max(eigen.eigenvalues()[0], least);
    const double S2 = std::max(eigen.eigenvalues()[1], least);
    Eigen::Vector3d shorter = Eigen::Vector3d::Zero();
    shorter[u] = eigen.eigenvectors()(0, 0);
    shorter[v] = eigen.eigenvectors()(1, 0);
    Eigen::Matrix3d M =
        S1 * Eigen::Matrix3d::Identity() + (S2 - S1) * shorter * shorter.transpose();
    M(face.axis, face.axis) += S2;
    return M;
}

/// Faces from the pieces of one leaf to those above it on each axis, without sheets.
/// Crumbs have none: there would be faces of leaves that do not touch.
std::vector<Face> leaf_faces(const VoxelGrid& grid, const Octree& octree,
                             const Pieces& pieces, const VoxelFlags& is_sheet,
                             std::size_t leaf_index)
{
    const VoxelBlock block = voxel_block(grid.shape(), octree.leaves()[leaf_index]);
    std::map<std::tuple<int, int, int>, FaceSum> found;
    std::tuple<int, int, int> last_key(-1, -1, -1);
    FaceSum* sum = nullptr;
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
                const std::size_t low = grid.index(below), high = grid.index(above);
                const int a = pieces.piece_of_voxel[low];
                const int b = pieces.piece_of_voxel[high];
                if (a < 0 || b < 0 || a == b ||
                    grid.material()[low] != grid.material()[high] ||
                    !is_at_home(grid, octree, pieces, below, a) ||
                    !is_at_home(grid, octree, pieces, above, b))
                    continue;
                const double area = grid.extent(u, below[u]) * grid.extent(v, below[v]);
                Eigen::Vector3d centre = grid.centre(below);
                centre[axis] = grid.lines(axis)[idx(last) + 1];
                const std::tuple<int, int, int> face_key(a, axis, b);
                if (face_key != last_key)
                    sum = &found[face_key];
                last_key = face_key;
                sum->contact += area;
                sum->contact_first += area * centre;
                if (!is_sheet.empty() && is_sheet[low] && is_sheet[high])
                    continue;
                sum->area += area;
                sum->first += area * centre;
            }
    }
    std::vector<Face> faces;
    for (const auto& [key, of_face] : found)
    {
        Face& face = faces.emplace_back();
        std::tie(face.a, face.axis, face.b) = key;
        face.contact = of_face.contact;
        face.area = of_face.area;
        face.centre = of_face.area > 0
                          ? Eigen::Vector3d(of_face.first / of_face.area)
                          : Eigen::Vector3d(of_face.contact_first / of_face.contact);
    }
    return faces;
}

/// Where sheets touch through their voxels alone, as much of a line holds them together
/// [voxel]: no more than keeps a cell from being loose.
constexpr double kSheetTouch = 0.01;

/// [r]x^T (I - n n^T) [r]x
Eigen::Matrix3d opening_in_sheet(const Eigen::Vector3d& r, const Eigen::Vector3d& n)
{
    const Eigen::Vector3d off = n.cross(r);
    return r.squaredNorm() * Eigen::Matrix3d::Identity() - r * r.transpose() -
           off * off.transpose();
}

/// The sheets' part in one face.
struct SheetSection
{
    double area = 0.0;
    Eigen::Vector3d first = Eigen::Vector3d::Zero();
    Eigen::Matrix3d turning = Eigen::Matrix3d::Zero();
};

/// Of every face. Those are sorted by (a, axis, b).
std::vector<SheetSection> sheet_sections(const VoxelGrid& grid, const Pieces& pieces,
                                         const Sheets& sheets,
                                         const std::vector<Face>& faces)
{
    const std::size_t step[3] = {1, idx(grid.counts().x()),
                                 idx(grid.counts().x()) * idx(grid.counts().y())};
    const auto key = [](const Face& face)
    { return std::tuple(face.a, face.axis, face.b); };
    std::vector<std::pair<std::size_t, const SheetCrossing*>> crossings;
    std::vector<SheetSection> sections(faces.size());
    for (const SheetCrossing& crossing : sheets.crossings)
    {
        const std::size_t above = crossing.below + step[crossing.axis];
        const std::tuple wanted(pieces.piece_of_voxel[crossing.below], crossing.axis,
                                pieces.piece_of_voxel[above]);
        const auto found = std::lower_bound(faces.begin(), faces.end(), wanted,
                                            [&](const Face& face, const auto& of)
                                            { return key(face) < of; });
        if (found == faces.end() || key(*found) != wanted)
            continue; // within one cell
        const std::size_t f = idx(found - faces.begin());
        crossings.emplace_back(f, &crossing);
        sections[f].area += crossing.area;
        sections[f].first += crossing.area * crossing.centre;
    }
    const double bending = sheets.thickness * sheets.thickness / 12.0;
    for (const auto& [f, crossing] : crossings)
    {
        SheetSection& section = sections[f];
        const Eigen::Vector3d& n = crossing->normal;
        const Eigen::Matrix3d across = n * n.transpose();
        section.turning +=
            crossing->area / section.area *
            (bending * (Eigen::Matrix3d::Identity() - across) +
             opening_in_sheet(crossing->centre - section.first / section.area, n) +
             crossing->length * crossing->length / 12.0 * across);
    }
    return sections;
}

/// Adds a sheet's section to what a face has of solid material.
void add_section(Face& face, const SheetSection& section, double thickness, double voxel)
{
    const double sheet = std::max(section.area, kSheetTouch * thickness * voxel);
    const Eigen::Matrix3d turning =
        section.area > 0
            ? section.turning
            : Eigen::Matrix3d(face.contact / 12.0 * Eigen::Matrix3d::Identity());
    const Eigen::Vector3d centre =
        section.area > 0 ? Eigen::Vector3d(section.first / section.area) : face.centre;
    const double whole = face.area + sheet;
    face.sheet_share = sheet / whole;
    const double solid_share = face.area / whole;
    const Eigen::Vector3d apart = centre - face.centre;
    face.turning = solid_share * face.turning + face.sheet_share * turning +
                   solid_share * face.sheet_share *
                       (apart.squaredNorm() * Eigen::Matrix3d::Identity() -
                        apart * apart.transpose());
    if (face.area == 0.0)
        face.centre = centre;
    face.area = whole;
}

void place_middles(const Pieces& pieces, const Sheets& sheets, std::vector<Cell>& cells)
{
    std::vector<double> areas(cells.size(), 0.0);
    std::vector<Eigen::Vector3d> sums(cells.size(), Eigen::Vector3d::Zero());
    for (const SheetPatch& patch : sheets.patches)
    {
        const std::size_t piece = idx(pieces.piece_of_voxel[patch.voxel]);
        areas[piece] += patch.area;
        sums[piece] += patch.area * patch.centre;
    }
    for (std::size_t c = 0; c < cells.size(); ++c)
        cells[c].middle =
            areas[c] > 0 ? Eigen::Vector3d(sums[c] / areas[c]) : cells[c].centre;
}

} // namespace

Cells build_cells(const VoxelGrid& grid, const Octree& octree, const Pieces& pieces,
                  const VoxelFlags& is_sheet, const Sheets& sheets)
{
    const std::size_t num_leaves = octree.leaves().size();
    Cells result;
    result.corner = grid.corner();
    result.cells.resize(pieces.size());
    std::vector<std::size_t> first(num_leaves + 1, 0);
    for (const LeafNumber leaf : pieces.leaf_of_piece)
        ++first[idx(leaf) + 1];
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
            faces[i] = leaf_faces(grid, octree, pieces, is_sheet, i);
        });
    std::vector<std::vector<int>> neighbours(result.size());
    for (std::vector<Face>& of_leaf : faces)
        for (Face& face : of_leaf)
        {
            const std::size_t a = idx(face.a);
            const std::size_t b = idx(face.b);
            face.distance = 0.5 * (result.cells[a].edge + result.cells[b].edge);
            if (face.area > 0)
                face.turning = turning_of(face, result.cells[a], result.cells[b]);
            neighbours[a].push_back(face.b);
            neighbours[b].push_back(face.a);
            result.faces.push_back(face);
        }
    place_middles(pieces, sheets, result.cells);
    if (!is_sheet.empty())
    {
        const std::vector<SheetSection> sections =
            sheet_sections(grid, pieces, sheets, result.faces);
        for (std::size_t f = 0; f < sections.size(); ++f)
            if (sections[f].area > 0 || result.faces[f].area == 0.0)
                add_section(result.faces[f], sections[f], sheets.thickness,
                            grid.shape().voxel());
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
    UnionFind components(cells.size());
    for (const Face& face : cells.faces)
        components.join(face.a, face.b);
    std::vector<int> number(cells.size(), -1);
    int count = 0;
    for (std::size_t i = 0; i < cells.size(); ++i)
    {
        const std::size_t first = idx(components.first_of(static_cast<int>(i)));
        if (number[first] < 0)
            number[first] = count++;
        number[i] = number[first];
    }
    return number;
}

} // namespace cellwarp
