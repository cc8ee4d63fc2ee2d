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
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <stdexcept>
#include <tuple>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "octree/base/union_find.h"

namespace cellwarp::core
{

namespace
{

/// Whether the outermost voxels, which end at the box, take nothing off a leaf.
bool is_cube(const VoxelGrid& grid, const VoxelBlock& block)
{
    const double edge = grid.shape().voxel() * block.width;
    for (int axis = 0; axis < 3; ++axis)
    {
        const std::vector<double>& lines = grid.lines(axis);
        const std::size_t begin = idx(block.first[axis]);
        const double length = lines[begin + idx(block.width)] - lines[begin];
        if (std::abs(length - edge) > 1e-9 * edge)
            return false;
    }
    return true;
}

/// Moments along one axis of the first voxels of a leaf, about a place: of what lies
/// before each of its lines.
struct LineSums
{
    double length = 0.0, first = 0.0, second = 0.0;

    LineSums operator-(const LineSums& other) const
    {
        return {length - other.length, first - other.first, second - other.second};
    }
};

std::vector<LineSums> line_sums(const VoxelGrid& grid, const VoxelBlock& block, int axis,
                                double about)
{
    std::vector<LineSums> sums(1);
    const std::vector<double>& lines = grid.lines(axis);
    for (int i = block.first[axis]; i < block.first[axis] + block.width; ++i)
    {
        const double length = grid.extent(axis, i);
        const double x = 0.5 * (lines[idx(i)] + lines[idx(i) + 1]) - about;
        const LineSums& last = sums.back();
        sums.push_back({last.length + length, last.first + length * x,
                        last.second + length * (x * x + length * length / 12.0)});
    }
    return sums;
}

/// Mass properties of the pieces of one leaf; sums run about the leaf's box centre
/// to keep their digits.
void measure_leaf(const VoxelGrid& grid, const Octree& octree, const Pieces& pieces,
                  LeafNumber leaf, std::span<Cell> cells)
{
    const VoxelBlock block = voxel_block(grid.shape(), octree[leaf]);
    const double edge = grid.shape().voxel() * block.width;
    const Eigen::Vector3d box_centre =
        grid.corner() +
        grid.shape().voxel() *
            (block.first.cast<double>().array() + 0.5 * block.width).matrix();
    if (pieces.is_full(leaf) && is_cube(grid, block))
    {
        cells[0] = {leaf,
                    box_centre,
                    edge,
                    box_centre,
                    box_centre,
                    edge * edge * edge,
                    edge * edge / 12.0 * Eigen::Matrix3d::Identity(),
                    box_centre};
        return;
    }
    std::array<std::vector<LineSums>, 3> sums;
    for (int axis = 0; axis < 3; ++axis)
        sums[idx(axis)] = line_sums(grid, block, axis, box_centre[axis]);
    std::vector<Eigen::Vector3d> first(cells.size(), Eigen::Vector3d::Zero());
    std::vector<Eigen::Matrix3d> second(cells.size(), Eigen::Matrix3d::Zero());
    const int first_piece = pieces.first(leaf);
    pieces.for_each_run(grid, block, leaf,
                        [&](int j, int k, int begin, int end, int piece)
                        {
                            const std::size_t at = idx(piece - first_piece);
                            if (piece < first_piece || at >= cells.size())
                                return; // a crumb belongs to another leaf's piece
                            const LineSums x = sums[0][idx(end)] - sums[0][idx(begin)];
                            const LineSums y = sums[1][idx(j) + 1] - sums[1][idx(j)];
                            const LineSums z = sums[2][idx(k) + 1] - sums[2][idx(k)];
                            cells[at].volume += x.length * y.length * z.length;
                            first[at] += Eigen::Vector3d(x.first * y.length * z.length,
                                                         x.length * y.first * z.length,
                                                         x.length * y.length * z.first);
                            const double xy = x.first * y.first * z.length;
                            const double xz = x.first * y.length * z.first;
                            const double yz = x.length * y.first * z.first;
                            second[at] +=
                                (Eigen::Matrix3d() << x.second * y.length * z.length, xy,
                                 xz, xy, x.length * y.second * z.length, yz, xz, yz,
                                 x.length * y.length * z.second)
                                    .finished();
                        });
    for (std::size_t at = 0; at < cells.size(); ++at)
    {
        Cell& cell = cells[at];
        if (!(cell.volume > 0))
            throw std::logic_error("a cell has no volume");
        const Eigen::Vector3d mean = first[at] / cell.volume;
        cell.leaf = leaf;
        cell.box_centre = box_centre;
        cell.edge = edge;
        cell.centre = box_centre + mean;
        cell.anchor = cells.size() > 1 ? cell.centre : box_centre;
        cell.second_moment = second[at] / cell.volume - mean * mean.transpose();
    }
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

/// Calls visit(first voxel) for the finest boxes above the upper face of a leaf, none at
/// the end of the grid.
template <class Visit>
void for_each_box_above(const VoxelGrid& grid, const VoxelBlock& block, int axis,
                        Visit&& visit)
{
    const int step = grid.shape().voxels_per_leaf;
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    Eigen::Vector3i above = block.first;
    above[axis] += block.width;
    if (above[axis] >= grid.counts()[axis])
        return;
    for (int j = 0; j < block.width; j += step)
        for (int i = 0; i < block.width; i += step)
        {
            above[u] = block.first[u] + i;
            above[v] = block.first[v] + j;
            visit(above);
        }
}

/// Faces from the pieces of one leaf to those above it on each axis, without sheets.
/// Crumbs have none: there would be faces of leaves that do not touch.
std::vector<Face> leaf_faces(const VoxelGrid& grid, const Octree& octree,
                             const Pieces& pieces, const VoxelFlags& is_sheet,
                             const Notches& notches, LeafNumber leaf)
{
    const VoxelBlock block = voxel_block(grid.shape(), octree[leaf]);
    std::map<std::tuple<int, int, int>, FaceSum> found;
    std::tuple<int, int, int> last_key(-1, -1, -1);
    FaceSum* sum = nullptr;
    const auto sum_of = [&](int a, int axis, int b) -> FaceSum&
    {
        const std::tuple<int, int, int> face_key(a, axis, b);
        if (face_key != last_key)
            sum = &found[face_key];
        last_key = face_key;
        return *sum;
    };
    const int step = grid.shape().voxels_per_leaf;
    const int only = pieces.only(leaf);
    const auto add_box = [&](int axis, LeafNumber other, const Eigen::Vector3i& first)
    {
        const int u = (axis + 1) % 3, v = (axis + 2) % 3;
        const int other_only = pieces.only(other);
        Eigen::Vector3i above = first;
        if (is_sheet.empty() && pieces.is_full(leaf) && pieces.is_full(other))
        {
            Eigen::Vector3i below = first;
            --below[axis];
            if (grid.material()[grid.index(below)] != grid.material()[grid.index(above)])
                return;
            const auto line = [&](int of, int i) { return grid.lines(of)[idx(i)]; };
            const double area = (line(u, first[u] + step) - line(u, first[u])) *
                                (line(v, first[v] + step) - line(v, first[v]));
            Eigen::Vector3d centre;
            centre[axis] = line(axis, first[axis]);
            for (const int of : {u, v})
                centre[of] = 0.5 * (line(of, first[of]) + line(of, first[of] + step));
            FaceSum& whole = sum_of(only, axis, other_only);
            whole.contact += area;
            whole.contact_first += area * centre;
            whole.area += area;
            whole.first += area * centre;
            return;
        }
        Eigen::Vector3i under = first;
        --under[axis];
        const bool may_be_open = notches.are_in(grid.box(under));
        for (int j = 0; j < step; ++j)
            for (int i = 0; i < step; ++i)
            {
                above[u] = first[u] + i;
                above[v] = first[v] + j;
                Eigen::Vector3i below = above;
                --below[axis];
                const std::size_t low = grid.index(below), high = grid.index(above);
                const std::uint8_t material = grid.material()[low];
                if (material == 0 || material != grid.material()[high] ||
                    (may_be_open && notches.is_open(low, axis)))
                    continue;
                const int a = only >= 0 ? only : pieces.at(grid, below);
                const int b = other_only >= 0 ? other_only : pieces.at(grid, above);
                if (a == b || pieces.leaf(a) != leaf || pieces.leaf(b) != other)
                    continue; // a crumb of elsewhere
                const double area = grid.extent(u, below[u]) * grid.extent(v, below[v]);
                Eigen::Vector3d centre = grid.centre(below);
                centre[axis] = grid.lines(axis)[idx(above[axis])];
                FaceSum& part = sum_of(a, axis, b);
                part.contact += area;
                part.contact_first += area * centre;
                if (!is_sheet.empty() && is_sheet[low] && is_sheet[high])
                    continue;
                part.area += area;
                part.first += area * centre;
            }
    };
    for (int axis = 0; axis < 3; ++axis)
        for_each_box_above(grid, block, axis,
                           [&](const Eigen::Vector3i& above)
                           {
                               const LeafNumber other =
                                   pieces.leaf_of_box(grid.box(above));
                               if (other != LeafNumber::None)
                                   add_box(axis, other, above);
                           });
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

/// Of every face that is not \p is_known. Those are sorted by (a, axis, b).
std::vector<SheetSection> sheet_sections(const VoxelGrid& grid, const Pieces& pieces,
                                         const Sheets& sheets,
                                         const std::vector<Face>& faces,
                                         const std::vector<char>& is_known)
{
    const auto key = [](const Face& face)
    { return std::tuple(face.a, face.axis, face.b); };
    std::vector<std::pair<std::size_t, const SheetCrossing*>> crossings;
    std::vector<SheetSection> sections(faces.size());
    for (const SheetCrossing& crossing : sheets.crossings)
    {
        const Eigen::Vector3i below = grid.coordinates(crossing.below);
        Eigen::Vector3i above = below;
        ++above[crossing.axis];
        const std::tuple wanted(pieces.at(grid, below), crossing.axis,
                                pieces.at(grid, above));
        if (std::get<0>(wanted) == std::get<2>(wanted))
            continue; // within one cell
        const auto found = std::lower_bound(faces.begin(), faces.end(), wanted,
                                            [&](const Face& face, const auto& of)
                                            { return key(face) < of; });
        if (found == faces.end() || key(*found) != wanted)
            continue; // of a crumb
        const std::size_t f = idx(found - faces.begin());
        if (is_known[f])
            continue;
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

/// Of the cells in leaves that are not \p is_known.
void place_middles(const VoxelGrid& grid, const Pieces& pieces, const Sheets& sheets,
                   const std::vector<char>& is_known, std::vector<Cell>& cells)
{
    std::vector<double> areas(cells.size(), 0.0);
    std::vector<Eigen::Vector3d> sums(cells.size(), Eigen::Vector3d::Zero());
    for (const SheetPatch& patch : sheets.patches)
    {
        const std::size_t piece = idx(pieces.at(grid, patch.voxel));
        areas[piece] += patch.area;
        sums[piece] += patch.area * patch.centre;
    }
    for (std::size_t c = 0; c < cells.size(); ++c)
        if (!is_known[idx(cells[c].leaf)])
            cells[c].middle =
                areas[c] > 0 ? Eigen::Vector3d(sums[c] / areas[c]) : cells[c].centre;
}

/// What is taken over from earlier cells: the pieces of leaves that were there as they
/// are now, and what they share with each other.
class TakenOver
{
public:
    TakenOver(const Octree& octree, const Pieces& pieces, const EarlierCells* earlier)
        : pieces_(pieces), earlier_(earlier),
          from_(octree.leaves().size(), LeafNumber::None)
    {
        if (!earlier)
            return;
        from_ = octree.numbers_in(earlier->octree);
        now_.assign(earlier->pieces.size(), -1);
        for (const LeafNumber leaf : octree.numbers())
        {
            LeafNumber& from = from_[idx(leaf)];
            if (from == LeafNumber::None)
                continue;
            // What crumbs do depends on the leaves around.
            if (pieces.shares_crumbs(leaf) || earlier->pieces.shares_crumbs(from))
                from = LeafNumber::None;
            else
                std::iota(now_.begin() + earlier->pieces.first(from),
                          now_.begin() + earlier->pieces.end(from), pieces.first(leaf));
        }
    }

    bool has(LeafNumber leaf) const { return from_[idx(leaf)] != LeafNumber::None; }

    void copy_cells(LeafNumber leaf, std::span<Cell> cells) const
    {
        const LeafNumber from = from_[idx(leaf)];
        for (std::size_t k = 0; k < cells.size(); ++k)
        {
            cells[k] = earlier_->cells.cells[idx(earlier_->pieces.first(from)) + k];
            cells[k].leaf = leaf;
        }
    }

    /// Whether all that a leaf shares with those above it is known.
    bool has_faces(const VoxelGrid& grid, const Octree& octree, LeafNumber leaf) const
    {
        if (!has(leaf))
            return false;
        bool has_all = true;
        for (int axis = 0; axis < 3; ++axis)
            for_each_box_above(grid, voxel_block(grid.shape(), octree[leaf]), axis,
                               [&](const Eigen::Vector3i& above)
                               {
                                   const LeafNumber other =
                                       pieces_.leaf_of_box(grid.box(above));
                                   has_all &= other == LeafNumber::None || has(other);
                               });
        return has_all;
    }

    std::vector<Face> faces(LeafNumber leaf) const
    {
        const LeafNumber from = from_[idx(leaf)];
        const std::vector<Face>& all = earlier_->cells.faces;
        const auto after = [&](int piece)
        {
            return std::lower_bound(all.begin(), all.end(), piece,
                                    [](const Face& face, int a) { return face.a < a; });
        };
        std::vector<Face> faces(after(earlier_->pieces.first(from)),
                                after(earlier_->pieces.end(from)));
        for (Face& face : faces)
        {
            face.a = now_[idx(face.a)];
            face.b = now_[idx(face.b)];
        }
        return faces;
    }

private:
    const Pieces& pieces_;
    const EarlierCells* earlier_;
    std::vector<LeafNumber> from_; ///< the earlier number of each leaf; None: it is new
    std::vector<int> now_;         ///< the number of each earlier piece
};

} // namespace

Cells build_cells(const VoxelGrid& grid, const Octree& octree, const Pieces& pieces,
                  const VoxelFlags& is_sheet, const Sheets& sheets,
                  const Notches& notches, const EarlierCells* earlier)
{
    const std::size_t num_leaves = octree.leaves().size();
    const TakenOver taken_over(octree, pieces, earlier);
    Cells result;
    result.corner = grid.corner();
    result.cells.resize(pieces.size());
    std::vector<std::vector<Face>> faces(num_leaves);
    std::vector<char> has_cells(num_leaves), has_faces(num_leaves);
    parallel_for(num_leaves,
                 [&](std::size_t i)
                 {
                     const auto leaf = LeafNumber(i);
                     const std::span<Cell> cells =
                         std::span(result.cells)
                             .subspan(idx(pieces.first(leaf)),
                                      idx(pieces.end(leaf) - pieces.first(leaf)));
                     has_cells[i] = taken_over.has(leaf);
                     has_faces[i] = taken_over.has_faces(grid, octree, leaf);
                     if (has_cells[i])
                         taken_over.copy_cells(leaf, cells);
                     else
                         measure_leaf(grid, octree, pieces, leaf, cells);
                     faces[i] = has_faces[i] ? taken_over.faces(leaf)
                                             : leaf_faces(grid, octree, pieces, is_sheet,
                                                          notches, leaf);
                 });
    std::vector<std::vector<int>> neighbours(result.size());
    std::vector<char> is_known; // of the faces
    for (std::size_t i = 0; i < num_leaves; ++i)
        for (Face& face : faces[i])
        {
            const std::size_t a = idx(face.a);
            const std::size_t b = idx(face.b);
            face.distance = 0.5 * (result.cells[a].edge + result.cells[b].edge);
            if (!has_faces[i] && face.area > 0)
                face.turning = turning_of(face, result.cells[a], result.cells[b]);
            neighbours[a].push_back(face.b);
            neighbours[b].push_back(face.a);
            result.faces.push_back(face);
            is_known.push_back(has_faces[i]);
        }
    place_middles(grid, pieces, sheets, has_cells, result.cells);
    if (!is_sheet.empty())
    {
        const std::vector<SheetSection> sections =
            sheet_sections(grid, pieces, sheets, result.faces, is_known);
        for (std::size_t f = 0; f < sections.size(); ++f)
            if (!is_known[f] && (sections[f].area > 0 || result.faces[f].area == 0.0))
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

} // namespace cellwarp::core
