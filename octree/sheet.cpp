// SPDX-License-Identifier: GPL-3.0-or-later
// The material of a sheet of thickness t with the unit normal n is a slab. A plane with
// the unit normal e cuts it in a strip as long as the line in which it cuts the sheet and
//   t / |n x e|
// wide: with these cross-sections the areas of the faces of a cell, each times its
// normal, add up to the slab's open sides, whatever the angles, as they do for a solid.
// Counted in voxels a sheet would have up to sqrt 3 times its area, by how it lies to
// their axes.
//
// Every triangle is cut at the planes between finest leaves: half of it with the vertices
// on a plane counted as above, half as below. So of two triangles that meet in an edge
// there each has half of the crossing, and a mirror image has the same. A sheet that lies
// in a plane between leaves belongs to both sides by halves: every part is looked up a
// little to either side of the sheet.
#include "octree/sheet.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <optional>
#include <tuple>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "octree/base/parallel.h"
#include "octree/base/point_tree.h"
#include "octree/joined_samples.h"
#include "octree/winding.h"

namespace cellwarp::core
{

namespace
{

/// How far to either side of a sheet its voxels are looked up, and what counts as lying
/// in a plane [voxel].
constexpr double kAside = 1e-6;

/// A point this near to the border of two voxels lies between them [voxel]: less than
/// kAside, which parts the sides of a sheet.
constexpr double kBetween = 0.5 * kAside;

/// Rounding makes slivers where a sheet ends in a plane: no line is this short [voxel],
/// and no patch so small [voxel^2].
constexpr double kSliver = 1e-9;

/// Neighbours of a point that tell its tangent plane and how densely the points lie.
constexpr std::size_t kNeighbours = 12;

/// The sides of a point's square, over those of its share of the area. They overlap, and
/// each counts the less: so the number of squares between two cells varies little.
constexpr double kOverlap = 2.0;

/// How wide the strip is at the most in which a plane cuts a sheet [thickness], unless a
/// leaf is wider.
constexpr double kWidest = 4.0;

/// An axis that appears shorter than this in a tangent plane gives it no square.
constexpr double kLeastShare = 1e-6;

using Polygon = std::vector<Eigen::Vector3d>;

/// Cuts triangles and lines (corners in voxel units) at the planes between finest leaves.
class SheetCutter
{
public:
    SheetCutter(const Material& material, Sheets& out) : material_(material), out_(out) {}

    /// \p weight: how much of its area counts.
    void add(const std::array<Eigen::Vector3d, 3>& given, double weight)
    {
        const std::array<Eigen::Vector3d, 3> corners = {
            on_planes(given[0]), on_planes(given[1]), on_planes(given[2])};
        const Eigen::Vector3d cross =
            (corners[1] - corners[0]).cross(corners[2] - corners[0]);
        if (!(cross.norm() > 0))
            return;
        normal_ = cross.normalized();
        weight_ = weight;
        add_patches(Polygon(corners.begin(), corners.end()), 0);
        for (int axis = 0; axis < 3; ++axis)
            add_crossings(corners, axis);
    }

    /// A bar along a line, as wide as it is thick. A plane cuts it as it cuts a sheet, in
    /// a strip, which is as long as the bar is wide: so it bends alike to all sides.
    void add_bar(const Eigen::Vector3d& first, const Eigen::Vector3d& last)
    {
        const Eigen::Vector3d from = on_planes(first), to = on_planes(last);
        const Eigen::Vector3d along = to - from;
        const double length = along.norm();
        if (!(length > 0))
            return;
        normal_ = (along / length).unitOrthogonal();
        weight_ = 1.0;
        add_bar_patches(from, to);
        for (int axis = 0; axis < 3; ++axis)
            add_bar_crossings(from, to, axis);
    }

private:
    const VoxelGrid& grid() const { return material_.grid; }
    double thickness() const { return out_.thickness / grid().shape().voxel(); }
    /// Nothing that is cut at a slant is wider than this [voxel].
    double widest() const { return std::max(kWidest * thickness(), width()); }
    double width() const { return grid().shape().voxels_per_leaf; }
    double plane_below(double x) const { return std::floor(x / width()) * width(); }

    /// A point that lies in planes between leaves up to rounding, exactly there.
    Eigen::Vector3d on_planes(Eigen::Vector3d x) const
    {
        for (int axis = 0; axis < 3; ++axis)
            if (const double plane = std::round(x[axis] / width()) * width();
                std::abs(x[axis] - plane) < kAside)
                x[axis] = plane;
        return x;
    }

    /// The voxel of a point, if it is a sheet's; of a point between voxels the first one
    /// that is. As in VoxelGrid::locate(), beyond the border the nearest one. \p axis:
    /// the next voxel along it must be a sheet's as well.
    std::optional<Eigen::Vector3i> sheet_voxel(const Eigen::Vector3d& x,
                                               std::optional<int> axis = {}) const
    {
        const VoxelRange& inside = grid().inside_box();
        const auto voxel_at = [&](double aside)
        {
            return Eigen::Vector3i((x.array() + aside).floor().cast<int>())
                .cwiseMax(inside.first)
                .cwiseMin(inside.last)
                .eval();
        };
        std::optional<Eigen::Vector3i> found;
        for_each_voxel({voxel_at(-kBetween), voxel_at(kBetween)},
                       [&](const Eigen::Vector3i& voxel)
                       {
                           Eigen::Vector3i next = voxel;
                           if (axis && next[*axis] < inside.last[*axis])
                               ++next[*axis];
                           if (!found && material_.is_sheet[grid().index(voxel)] &&
                               material_.is_sheet[grid().index(next)])
                               found = voxel;
                       });
        return found;
    }

    /// Calls visit(voxel, share) for the sheet's voxels on both sides of it at a point of
    /// it; the shares are halves, or 1 where only one side has one, or both the same.
    /// \p find(point) is the voxel for a point.
    template <class Find, class Visit>
    void visit_sides(const Eigen::Vector3d& x, Find&& find, Visit&& visit) const
    {
        const auto over = find(x + kAside * normal_), under = find(x - kAside * normal_);
        const bool is_one = over == under;
        const double share = over && under && !is_one ? 0.5 : 1.0;
        if (over)
            visit(*over, share);
        if (under && !is_one)
            visit(*under, share);
    }

    /// Where a line passes the planes of the axes given, from 0 at its beginning to 1 at
    /// its end, both among them.
    std::vector<double> cuts_of(const Eigen::Vector3d& from, const Eigen::Vector3d& to,
                                std::initializer_list<int> axes) const
    {
        std::vector<double> cuts = {0.0, 1.0};
        for (const int axis : axes)
        {
            const double low = std::min(from[axis], to[axis]);
            const double high = std::max(from[axis], to[axis]);
            for (double at = plane_below(low) + width(); at < high; at += width())
                cuts.push_back((at - from[axis]) / (to[axis] - from[axis]));
        }
        std::sort(cuts.begin(), cuts.end());
        return cuts;
    }

    void add_bar_patches(const Eigen::Vector3d& from, const Eigen::Vector3d& to)
    {
        const std::vector<double> cuts = cuts_of(from, to, {0, 1, 2});
        for (std::size_t k = 1; k < cuts.size(); ++k)
            add_sides(from + 0.5 * (cuts[k - 1] + cuts[k]) * (to - from),
                      (cuts[k] - cuts[k - 1]) * (to - from).norm() * thickness());
    }

    void add_bar_crossings(const Eigen::Vector3d& from, const Eigen::Vector3d& to,
                           int axis)
    {
        const double slant = std::abs(to[axis] - from[axis]) / (to - from).norm();
        const double area =
            thickness() * std::min(thickness() / std::max(slant, 1e-12), widest());
        const auto [low, high] = std::minmax(from[axis], to[axis]);
        if (!(low < high))
            return;
        // An end on a plane has half of the crossing, the next line the other half.
        for (double plane = plane_below(low); plane <= high; plane += width())
            if (plane >= low)
                add_crossing(from + (plane - from[axis]) / (to[axis] - from[axis]) *
                                        (to - from),
                             axis, plane, thickness(),
                             (plane == low || plane == high ? 0.5 : 1.0) * area);
    }

    void add_patches(const Polygon& polygon, int axis)
    {
        if (axis == 3)
            return add_patch(polygon);
        double low = INFINITY, high = -INFINITY;
        for (const Eigen::Vector3d& x : polygon)
        {
            low = std::min(low, x[axis]);
            high = std::max(high, x[axis]);
        }
        double plane = plane_below(low) + width();
        if (high - low < 2 * kAside || high <= plane)
            return add_patches(polygon, axis + 1);
        Polygon rest = polygon, below;
        for (; plane < high; plane += width())
        {
            cut(rest, axis, plane, below);
            if (below.size() >= 3)
                add_patches(below, axis + 1);
        }
        if (rest.size() >= 3)
            add_patches(rest, axis + 1);
    }

    /// Parts a convex polygon at a plane: what is above stays.
    static void cut(Polygon& polygon, int axis, double plane, Polygon& below)
    {
        Polygon above;
        below.clear();
        for (std::size_t i = 0; i < polygon.size(); ++i)
        {
            const Eigen::Vector3d& p = polygon[i];
            const Eigen::Vector3d& q = polygon[(i + 1) % polygon.size()];
            const bool is_below = p[axis] < plane;
            (is_below ? below : above).push_back(p);
            if (is_below == (q[axis] < plane))
                continue;
            Eigen::Vector3d x = p + (plane - p[axis]) / (q[axis] - p[axis]) * (q - p);
            x[axis] = plane;
            below.push_back(x);
            above.push_back(x);
        }
        polygon.swap(above);
    }

    /// In a plane between leaves a patch counts by its polar moment, however the sheet is
    /// cut in patches: as a line of this length.
    static double length_of(const Polygon& polygon, const Eigen::Vector3d& centre,
                            double area)
    {
        double polar = 0.0;
        for (std::size_t k = 2; k < polygon.size(); ++k)
        {
            const Eigen::Vector3d &a = polygon[0], &b = polygon[k - 1], &c = polygon[k];
            polar +=
                0.5 * (b - a).cross(c - a).norm() *
                (((a + b + c) / 3.0 - centre).squaredNorm() +
                 ((b - a).squaredNorm() + (c - b).squaredNorm() + (a - c).squaredNorm()) /
                     36.0);
        }
        return std::sqrt(12.0 * polar / area);
    }

    void add_patch(const Polygon& polygon)
    {
        Eigen::Vector3d sum = Eigen::Vector3d::Zero();
        double area = 0.0;
        for (std::size_t k = 2; k < polygon.size(); ++k)
        {
            const double part =
                0.5 * (polygon[k - 1] - polygon[0]).cross(polygon[k] - polygon[0]).norm();
            area += part;
            sum += part / 3.0 * (polygon[0] + polygon[k - 1] + polygon[k]);
        }
        if (!(area > kSliver))
            return;
        const Eigen::Vector3d centre = sum / area;
        add_sides(centre, area);
        for (int axis = 0; axis < 3; ++axis)
        {
            const double plane = std::round(centre[axis] / width()) * width();
            if (std::all_of(polygon.begin(), polygon.end(),
                            [&](const Eigen::Vector3d& x)
                            { return std::abs(x[axis] - plane) < kAside; }))
                add_crossing(centre, axis, plane, length_of(polygon, centre, area), area);
        }
    }

    /// A patch, or half of one on either side. In voxels.
    void add_sides(const Eigen::Vector3d& centre, double area)
    {
        const double voxel = grid().shape().voxel();
        visit_sides(
            centre, [&](const Eigen::Vector3d& x) { return sheet_voxel(x); },
            [&](const Eigen::Vector3i& at, double share)
            {
                out_.patches.push_back({grid().index(at),
                                        share * weight_ * area * voxel * voxel,
                                        grid().from_voxels(centre)});
            });
    }

    /// The lines in which the triangle crosses the planes of one axis.
    void add_crossings(const std::array<Eigen::Vector3d, 3>& corners, int axis)
    {
        const auto [low, high] = std::minmax_element(corners.begin(), corners.end(),
                                                     [&](const auto& p, const auto& q)
                                                     { return p[axis] < q[axis]; });
        for (double plane = plane_below((*low)[axis]); plane <= (*high)[axis];
             plane += width())
        {
            const bool has_corner_on_it =
                std::any_of(corners.begin(), corners.end(),
                            [&](const auto& p) { return p[axis] == plane; });
            if (!has_corner_on_it)
            {
                add_line(corners, axis, plane, false, 1.0);
                continue;
            }
            for (const bool is_on_above : {false, true})
                add_line(corners, axis, plane, is_on_above, 0.5);
        }
    }

    /// The line in which a plane crosses the triangle, if it does; corners on the plane
    /// are above it, or below. \p share: how much of the line counts.
    void add_line(const std::array<Eigen::Vector3d, 3>& corners, int axis, double plane,
                  bool is_on_above, double share)
    {
        const auto is_above = [&](const Eigen::Vector3d& p)
        { return is_on_above ? p[axis] >= plane : p[axis] > plane; };
        std::array<Eigen::Vector3d, 3> ends;
        std::size_t count = 0;
        for (std::size_t k = 0; k < 3; ++k)
        {
            const Eigen::Vector3d& p = corners[k];
            const Eigen::Vector3d& q = corners[(k + 1) % 3];
            if (is_above(p) != is_above(q))
                ends[count++] = p + (plane - p[axis]) / (q[axis] - p[axis]) * (q - p);
        }
        if (count == 2)
            add_parts(ends[0], ends[1], axis, plane, share);
    }

    /// Of a line, cut at the planes of the other axes. \p share: how much of it counts.
    void add_parts(const Eigen::Vector3d& from, const Eigen::Vector3d& to, int axis,
                   double plane, double share)
    {
        const std::vector<double> cuts =
            cuts_of(from, to, {(axis + 1) % 3, (axis + 2) % 3});
        const double length = (to - from).norm();
        // Of a sheet that nearly lies in the plane the strip ends somewhere.
        const double slant =
            std::sqrt(std::max(0.0, 1.0 - normal_[axis] * normal_[axis]));
        const double across = std::min(thickness() / std::max(slant, 1e-12), widest());
        for (std::size_t k = 1; k < cuts.size(); ++k)
        {
            const double part = (cuts[k] - cuts[k - 1]) * length;
            if (part > kSliver)
                add_crossing(from + 0.5 * (cuts[k - 1] + cuts[k]) * (to - from), axis,
                             plane, part, share * part * across);
        }
    }

    /// Lengths in voxels.
    void add_crossing(const Eigen::Vector3d& centre, int axis, double plane,
                      double length, double area)
    {
        const int above = static_cast<int>(std::lround(plane));
        if (above <= 0 || above >= grid().counts()[axis])
            return; // the border of the grid
        const auto find = [&](const Eigen::Vector3d& x) -> std::optional<Eigen::Vector3i>
        {
            Eigen::Vector3d below = x;
            below[axis] = above - 0.5;
            return sheet_voxel(below, axis);
        };
        const double voxel = grid().shape().voxel();
        visit_sides(centre, find,
                    [&](const Eigen::Vector3i& below, double share)
                    {
                        out_.crossings.push_back({grid().index(below), axis,
                                                  length * voxel,
                                                  share * weight_ * area * voxel * voxel,
                                                  grid().from_voxels(centre), normal_});
                    });
    }

    const Material& material_;
    Sheets& out_;
    Eigen::Vector3d normal_ = Eigen::Vector3d::UnitX();
    double weight_ = 1.0;
};

/// What stands for one point of a cloud: squares in its tangent plane, with a side along
/// each of the grid's axes as it appears there. One square would have to have some
/// direction, and neighbours that lie evenly around tell none.
struct PointSquare
{
    Eigen::Vector3d centre, normal;
    double half = 0.0; ///< of a side
};
std::optional<PointSquare> square_of(const PointTree& tree, std::size_t point)
{
    const Eigen::Vector3d& x = tree.points()[point];
    std::vector<PointTree::Neighbour> near;
    tree.nearest(x, kNeighbours + 2, near);
    if (near.size() < 4)
        return std::nullopt;
    if (near.size() == kNeighbours + 2)
    {
        // Equally near samples all count: the tree returns them in some order.
        const double farthest = std::sqrt(near[kNeighbours].distance_squared);
        if (std::sqrt(near.back().distance_squared) < farthest * (1.0 + kAside))
            tree.within(x, farthest * (1.0 + kAside), near);
        else
            near.pop_back();
    }
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const PointTree::Neighbour& one : near)
        mean += tree.points()[one.index] / static_cast<double>(near.size());
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    for (const PointTree::Neighbour& one : near)
        spread += (tree.points()[one.index] - mean) *
                  (tree.points()[one.index] - mean).transpose();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(spread);
    // A circle that holds k neighbours has, on average, the area of k points.
    constexpr double kPi = 3.14159265358979323846;
    const double area =
        kPi *
        std::max_element(near.begin(), near.end(),
                         [](const auto& a, const auto& b)
                         { return a.distance_squared < b.distance_squared; })
            ->distance_squared /
        static_cast<double>(near.size() - 1);
    const double half = 0.5 * kOverlap * std::sqrt(area);
    return PointSquare{x, eigen.eigenvectors().col(0), half};
}

std::vector<Eigen::Vector3d> places_of(std::vector<Eigen::Vector3d> points)
{
    const auto key = [](const Eigen::Vector3d& p)
    { return std::tuple(p.x(), p.y(), p.z()); };
    std::sort(points.begin(), points.end(),
              [&](const auto& a, const auto& b) { return key(a) < key(b); });
    points.erase(std::unique(points.begin(), points.end()), points.end());
    return points;
}

/// Of each place of a cloud whether it has a square, and which.
std::vector<std::optional<PointSquare>> squares_of(const Shape& shape,
                                                   const Material& material)
{
    const VoxelGrid& grid = material.grid;
    const std::vector<Eigen::Vector3d> places = places_of(shape.samples);
    std::vector<std::optional<PointSquare>> squares(places.size());
    if (places.empty())
        return squares;
    const PointTree tree(places);
    parallel_for(places.size(),
                 [&](std::size_t i)
                 {
                     bool is_sheet = false;
                     for_each_voxel(grid.touched(places[i]),
                                    [&](const Eigen::Vector3i& voxel) {
                                        is_sheet = is_sheet ||
                                                   material.is_sheet[grid.index(voxel)];
                                    });
                     if (is_sheet)
                         squares[i] = square_of(tree, i);
                 });
    return squares;
}

void add_square(const PointSquare& square, const VoxelGrid& grid, SheetCutter& cutter)
{
    for (int axis = 0; axis < 3; ++axis)
    {
        const Eigen::Vector3d along =
            Eigen::Vector3d::Unit(axis) - square.normal[axis] * square.normal;
        // The squares of these lengths add up to 2.
        const double share = 0.5 * along.squaredNorm();
        if (!(share > kLeastShare))
            continue;
        const Eigen::Vector3d u = square.half * along.normalized();
        const Eigen::Vector3d v = square.normal.cross(u);
        const auto corner = [&](double a, double b)
        { return grid.to_voxels(square.centre + a * u + b * v); };
        const double weight = share / (kOverlap * kOverlap);
        cutter.add({corner(-1, -1), corner(1, -1), corner(1, 1)}, weight);
        cutter.add({corner(-1, -1), corner(1, 1), corner(-1, 1)}, weight);
    }
}

/// Each once, from whichever end it was drawn.
std::vector<LineEnds> distinct_lines(const Shape& shape)
{
    std::vector<LineEnds> lines;
    if (shape.lines.empty())
        return lines;
    const std::vector<std::uint32_t> joined = joined_samples(shape.samples);
    for (const auto& [a, b] : shape.lines)
        lines.push_back({std::min(joined[a], joined[b]), std::max(joined[a], joined[b])});
    std::sort(lines.begin(), lines.end());
    lines.erase(std::unique(lines.begin(), lines.end()), lines.end());
    return lines;
}

/// Calls add(cutter, i) for all of \p count, on all threads: some at once, each with
/// sheets of their own, which follow each other in the end.
template <class Add>
void add_all(const Material& material, std::size_t count, Add&& add, Sheets& sheets)
{
    constexpr std::size_t kAtOnce = 128;
    std::vector<Sheets> parts((count + kAtOnce - 1) / kAtOnce);
    parallel_for(parts.size(), 1,
                 [&](std::size_t part)
                 {
                     parts[part].thickness = sheets.thickness;
                     SheetCutter cutter(material, parts[part]);
                     const std::size_t end = std::min(count, (part + 1) * kAtOnce);
                     for (std::size_t i = part * kAtOnce; i < end; ++i)
                         add(cutter, i);
                 });
    std::size_t num_patches = 0, num_crossings = 0;
    for (const Sheets& part : parts)
    {
        num_patches += part.patches.size();
        num_crossings += part.crossings.size();
    }
    sheets.patches.reserve(num_patches);
    sheets.crossings.reserve(num_crossings);
    for (Sheets& part : parts)
    {
        sheets.patches.insert(sheets.patches.end(), part.patches.begin(),
                              part.patches.end());
        sheets.crossings.insert(sheets.crossings.end(), part.crossings.begin(),
                                part.crossings.end());
        part = Sheets();
    }
}

} // namespace

Sheets find_sheets(const Shape& shape, const BoundingSurface& surface,
                   const Material& material, double thickness)
{
    Sheets sheets;
    sheets.thickness = thickness;
    if (material.is_sheet.empty())
        return sheets;
    const VoxelGrid& grid = material.grid;
    if (shape.is_cloud())
    {
        const std::vector<std::optional<PointSquare>> squares =
            squares_of(shape, material);
        add_all(
            material, squares.size(),
            [&](SheetCutter& cutter, std::size_t i)
            {
                if (squares[i])
                    add_square(*squares[i], grid, cutter);
            },
            sheets);
        return sheets;
    }
    add_all(
        material, surface.triangles.size(),
        [&](SheetCutter& cutter, std::size_t i)
        {
            const Triangle& t = surface.triangles[i];
            cutter.add({grid.to_voxels(shape.samples[t[0]]),
                        grid.to_voxels(shape.samples[t[1]]),
                        grid.to_voxels(shape.samples[t[2]])},
                       1.0);
        },
        sheets);
    const std::vector<LineEnds> lines = distinct_lines(shape);
    add_all(
        material, lines.size(),
        [&](SheetCutter& cutter, std::size_t i)
        {
            const LineEnds& line = lines[i];
            cutter.add_bar(grid.to_voxels(shape.samples[line[0]]),
                           grid.to_voxels(shape.samples[line[1]]));
        },
        sheets);
    return sheets;
}

} // namespace cellwarp::core
