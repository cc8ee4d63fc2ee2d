// SPDX-License-Identifier: GPL-3.0-or-later
// A box meets a triangle unless one of 13 axes separates them: the triangle's normal, the
// nine cross products of its edges with the box's, and the box's own. Of boxes side by
// side in a row an axis separates all up to one, or all from one on: what is left between
// those of all axes is found once a row. A box that is a little larger than the voxel
// tells whether the triangle touches it, one a little smaller whether it reaches into it,
// and one that is a thin slab around a side of it whether part of the triangle lies
// there. A large triangle's range of voxels is cut in halves, of which those that do not
// meet it are left out. A small triangle in a row of voxels, which touches none of the
// planes beside the row, needs no such test: how far it reaches along the row tells all.
// Nothing depends on which of two neighbours is the upper one: the marks of a mirror
// image are the mirror image of the marks.
#include "octree/surface_marks.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>

#include <Eigen/Geometry>

#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "octree/shared_marks.h"

namespace cellwarp::core
{

namespace
{

using VoxelLines = std::array<std::vector<double>, 3>;

constexpr std::uint8_t kInside = SurfaceMark::kPenetrated | SurfaceMark::kTouched;

/// Where voxels begin and end [voxel], as VoxelGrid::to_voxels() counts.
VoxelLines lines_in_voxels(const VoxelGrid& grid)
{
    VoxelLines lines;
    for (int axis = 0; axis < 3; ++axis)
        for (const double line : grid.lines(axis))
            lines[idx(axis)].push_back(
                grid.to_voxels(Eigen::Vector3d::Constant(line))[axis]);
    return lines;
}

/// Marks the voxels that one triangle (corners in voxel units) touches.
class TriangleMarker
{
public:
    TriangleMarker(const VoxelGrid& grid, const VoxelLines& lines,
                   const std::array<Eigen::Vector3d, 3>& corners, SharedMarks& marks)
        : grid_(grid), lines_(lines), corners_(corners), marks_(marks)
    {
        box_low_ = corners[0].cwiseMin(corners[1]).cwiseMin(corners[2]);
        box_high_ = corners[0].cwiseMax(corners[1]).cwiseMax(corners[2]);
        VoxelRange range;
        for (int k = 0; k < 3; ++k)
        {
            const double first = grid.inside_box().first[k],
                         last = grid.inside_box().last[k];
            range.first[k] = static_cast<int>(
                std::clamp(std::floor(box_low_[k] - kTouch), first, last));
            range.last[k] = static_cast<int>(
                std::clamp(std::floor(box_high_[k] + kTouch), first, last));
        }
        (range.last - range.first).maxCoeff(&row_);
        u_ = (row_ + 1) % 3;
        v_ = (row_ + 2) % 3;
        if (!mark_within_row(range))
            visit(range);
    }

private:
    struct Box
    {
        Eigen::Vector3d low, high;
    };

    /// A part of a row [voxel]: boxes of one section across the row meet the triangle if
    /// they begin no later than \p to and end no earlier than \p from. Where the triangle
    /// is a point along the row, rounding can put \p from behind \p to.
    struct Reach
    {
        double from = INFINITY, to = -INFINITY;
        bool has(double low, double high) const { return low <= to && high >= from; }
        void cut(double first, double last)
        {
            from = std::max(from, first);
            to = std::min(to, last);
        }
    };

    /// An axis, of any length, and the range of the triangle on it.
    struct Axis
    {
        double along, u, v;        ///< its parts along the row (not negative) and across
        double length_u, length_v; ///< of the parts across
        double low, high;
    };

    /// The normal and the nine cross products, turned to where the row goes.
    void find_axes()
    {
        const Eigen::Vector3d edges[3] = {corners_[1] - corners_[0],
                                          corners_[2] - corners_[1],
                                          corners_[0] - corners_[2]};
        add_axis(edges[0].cross(edges[1]));
        for (const Eigen::Vector3d& edge : edges)
            for (int k = 0; k < 3; ++k)
                add_axis(Eigen::Vector3d::Unit(k).cross(edge));
    }

    void add_axis(Eigen::Vector3d axis)
    {
        if (axis[row_] < 0.0)
            axis = -axis;
        double low = INFINITY, high = -INFINITY;
        for (const Eigen::Vector3d& corner : corners_)
        {
            low = std::min(low, axis.dot(corner));
            high = std::max(high, axis.dot(corner));
        }
        const double u = axis[u_], v = axis[v_];
        axes_[num_axes_++] = {axis[row_], u, v, std::abs(u), std::abs(v), low, high};
    }

    Box box_of(const VoxelRange& range) const
    {
        Box box;
        for (int k = 0; k < 3; ++k)
        {
            const std::vector<double>& lines = lines_[idx(k)];
            box.low[k] = lines[idx(range.first[k])];
            box.high[k] = lines[idx(range.last[k]) + 1];
        }
        return box;
    }

    /// Whether a plane across one of the box's own axes parts it, grown by so much
    /// (shrunk, if negative), from the triangle.
    bool is_off(const Box& box, int axis, double grown) const
    {
        return box_low_[axis] > box.high[axis] + grown ||
               box_high_[axis] < box.low[axis] - grown;
    }

    /// Where boxes touch the triangle and where it reaches into them.
    struct Reaches
    {
        Reach touched, penetrated;
    };

    /// Of a box's section across the row.
    Reaches find_reaches(const Box& box)
    {
        if (is_off(box, u_, kTouch) || is_off(box, v_, kTouch))
            return {};
        if (num_axes_ == 0)
            find_axes(); // few triangles of a fine mesh need them
        const double half_u = 0.5 * (box.high[u_] - box.low[u_]);
        const double half_v = 0.5 * (box.high[v_] - box.low[v_]);
        const double u = 0.5 * (box.high[u_] + box.low[u_]);
        const double v = 0.5 * (box.high[v_] + box.low[v_]);
        Reaches result;
        Reach &touched = result.touched, &penetrated = result.penetrated;
        touched = penetrated = {box_low_[row_], box_high_[row_]};
        for (const Axis& axis : axes_)
        {
            const double middle = axis.u * u + axis.v * v;
            const double half = axis.length_u * half_u + axis.length_v * half_v;
            const double grown = kTouch * (axis.length_u + axis.length_v);
            const double low = axis.low - middle - half, high = axis.high - middle + half;
            if (axis.along > 0.0)
            {
                touched.cut((low - grown) / axis.along, (high + grown) / axis.along);
                penetrated.cut((low + grown) / axis.along, (high - grown) / axis.along);
                continue;
            }
            if (low > grown || high < -grown)
                return {};
            if (low > -grown || high < grown)
                penetrated = {};
        }
        if (is_off(box, u_, -kTouch) || is_off(box, v_, -kTouch))
            penetrated = {};
        return result;
    }

    bool is_flat(int axis) const
    {
        return box_high_[axis] - box_low_[axis] <= 4.0 * kTouch;
    }

    /// Calls visit(axis, is_upper, plane) for the sides of a voxel near whose planes the
    /// triangle is.
    template <class Visit>
    void for_each_side(const Box& box, Visit&& visit) const
    {
        for (int axis = 0; axis < 3; ++axis)
        {
            if (!is_flat(axis))
                continue;
            for (const bool is_upper : {false, true})
                if (const double plane = is_upper ? box.high[axis] : box.low[axis];
                    box_low_[axis] >= plane - 2.0 * kTouch &&
                    box_high_[axis] <= plane + 2.0 * kTouch)
                    visit(axis, is_upper, plane);
        }
    }

    /// All marks that a voxel can get from the triangle.
    std::uint8_t possible_marks(const Box& box) const
    {
        std::uint8_t marks = SurfaceMark::kTouched;
        if (!is_off(box, 0, -kTouch) && !is_off(box, 1, -kTouch) &&
            !is_off(box, 2, -kTouch))
            marks |= SurfaceMark::kPenetrated;
        for_each_side(box, [&](int axis, bool is_upper, double)
                      { marks |= SurfaceMark::side(axis, is_upper); });
        return marks;
    }

    /// Whether all voxels of a row have all marks that they can get: triangles of a fine
    /// mesh tell nothing new of most.
    bool are_known(const VoxelRange& row) const
    {
        const std::uint8_t of_all = possible_marks(box_of(row));
        for (Eigen::Vector3i voxel = row.first; voxel[row_] <= row.last[row_];
             ++voxel[row_])
            if (!marks_.has(grid_.index(voxel),
                            is_flat(row_) ? possible_marks(box_of({voxel, voxel}))
                                          : of_all))
                return false;
        return true;
    }

    /// Of a triangle that lies in one row of voxels and off its sides; else false.
    bool mark_within_row(const VoxelRange& range)
    {
        for (const int axis : {u_, v_})
        {
            const std::vector<double>& lines = lines_[idx(axis)];
            if (range.first[axis] != range.last[axis] ||
                box_low_[axis] <= lines[idx(range.first[axis])] + 2.0 * kTouch ||
                box_high_[axis] >= lines[idx(range.first[axis]) + 1] - 2.0 * kTouch)
                return false;
        }
        const std::vector<double>& lines = lines_[idx(row_)];
        const double low = box_low_[row_], high = box_high_[row_];
        const auto reaches = [&](double from, double to)
        { return low <= to && high >= from; };
        Eigen::Vector3i voxel = range.first;
        for (; voxel[row_] <= range.last[row_]; ++voxel[row_])
        {
            const double begin = lines[idx(voxel[row_])];
            const double end = lines[idx(voxel[row_]) + 1];
            if (!reaches(begin - kTouch, end + kTouch))
                continue;
            std::uint8_t mark = SurfaceMark::kTouched;
            if (reaches(begin + kTouch, end - kTouch))
                mark |= SurfaceMark::kPenetrated;
            for (const bool is_upper : {false, true})
            {
                const double plane = is_upper ? end : begin;
                if (low >= plane - 2.0 * kTouch && high <= plane + 2.0 * kTouch)
                    mark |= SurfaceMark::side(row_, is_upper);
            }
            marks_.add(grid_.index(voxel), mark);
        }
        return true;
    }

    /// The voxels of a row that the triangle meets.
    void mark_row(const VoxelRange& row)
    {
        if (are_known(row))
            return;
        const Box all = box_of(row);
        const Reaches reach = find_reaches(all);
        // Where it lies in sides along the row.
        struct Side
        {
            std::uint8_t mark;
            Reach where;
        };
        std::array<Side, 4> sides;
        std::size_t num_sides = 0;
        for_each_side(all,
                      [&](int axis, bool is_upper, double plane)
                      {
                          if (axis == row_)
                              return;
                          Box slab = all;
                          slab.low[axis] = plane - 3.0 * kTouch;
                          slab.high[axis] = plane + 3.0 * kTouch;
                          sides[num_sides++] = {SurfaceMark::side(axis, is_upper),
                                                find_reaches(slab).penetrated};
                      });
        const std::vector<double>& lines = lines_[idx(row_)];
        for (Eigen::Vector3i voxel = row.first; voxel[row_] <= row.last[row_];
             ++voxel[row_])
        {
            const double low = lines[idx(voxel[row_])],
                         high = lines[idx(voxel[row_]) + 1];
            if (!reach.touched.has(low - kTouch, high + kTouch))
                continue;
            std::uint8_t mark = SurfaceMark::kTouched;
            if (reach.penetrated.has(low + kTouch, high - kTouch))
                mark |= SurfaceMark::kPenetrated;
            for (std::size_t k = 0; k < num_sides; ++k)
                if (sides[k].where.has(low + kTouch, high - kTouch))
                    mark |= sides[k].mark;
            if (is_flat(row_))
                for_each_side(box_of({voxel, voxel}),
                              [&](int axis, bool is_upper, double plane)
                              {
                                  if (axis == row_ &&
                                      reach.penetrated.has(plane - 2.0 * kTouch,
                                                           plane + 2.0 * kTouch))
                                      mark |= SurfaceMark::side(axis, is_upper);
                              });
            marks_.add(grid_.index(voxel), mark);
        }
    }

    void visit(const VoxelRange& range)
    {
        constexpr int kFewRows = 8;
        const Eigen::Vector3i counts = range.last - range.first + Eigen::Vector3i::Ones();
        if (counts[u_] * counts[v_] <= kFewRows)
        {
            VoxelRange row = range;
            for (int j = range.first[v_]; j <= range.last[v_]; ++j)
                for (int i = range.first[u_]; i <= range.last[u_]; ++i)
                {
                    row.first[u_] = row.last[u_] = i;
                    row.first[v_] = row.last[v_] = j;
                    mark_row(row);
                }
            return;
        }
        const Box box = box_of(range);
        if (!find_reaches(box).touched.has(box.low[row_] - kTouch,
                                           box.high[row_] + kTouch))
            return;
        int axis = 0;
        counts.maxCoeff(&axis);
        const int middle = (range.first[axis] + range.last[axis]) / 2;
        VoxelRange low = range, high = range;
        low.last[axis] = middle;
        high.first[axis] = middle + 1;
        visit(low);
        visit(high);
    }

    const VoxelGrid& grid_;
    const VoxelLines& lines_;
    std::array<Eigen::Vector3d, 3> corners_;
    SharedMarks& marks_;
    int row_ = 0, u_ = 1, v_ = 2; ///< the axis of rows, and those across
    std::size_t num_axes_ = 0;
    std::array<Axis, 10> axes_;
    Eigen::Vector3d box_low_, box_high_;
};

/// In place of the number of a voxel: there are several.
constexpr std::size_t kSeveral = ~std::size_t{0};

/// Of each sample the voxel that it touches, if it is the only one.
std::vector<std::size_t> only_voxels(const std::vector<Eigen::Vector3d>& samples,
                                     const VoxelGrid& grid)
{
    constexpr std::size_t kSamplesAtOnce = 4096; // of one thread
    std::vector<std::size_t> voxels(samples.size());
    parallel_for(samples.size(), kSamplesAtOnce,
                 [&](std::size_t i)
                 {
                     const VoxelRange touched = grid.touched(samples[i]);
                     voxels[i] = touched.first == touched.last ? grid.index(touched.first)
                                                               : kSeveral;
                 });
    return voxels;
}

} // namespace

VoxelFlags surface_marks(const Shape& shape, const VoxelGrid& grid)
{
    VoxelFlags marks(grid.size());
    SharedMarks shared(marks);
    const VoxelLines lines = lines_in_voxels(grid);
    std::vector<std::size_t> voxels;
    if (!shape.triangles.empty())
        voxels = only_voxels(shape.samples, grid);
    constexpr std::size_t kTrianglesAtOnce = 1024; // of one thread
    parallel_for(shape.triangles.size(), kTrianglesAtOnce,
                 [&](std::size_t t)
                 {
                     const auto& [a, b, c] = shape.triangles[t];
                     // Most triangles of a fine mesh lie in the voxel of their corners.
                     const std::size_t voxel = voxels[a];
                     if (voxel != kSeveral && voxel == voxels[b] && voxel == voxels[c])
                         shared.add(voxel, kInside);
                     else
                         TriangleMarker(grid, lines,
                                        {grid.to_voxels(shape.samples[a]),
                                         grid.to_voxels(shape.samples[b]),
                                         grid.to_voxels(shape.samples[c])},
                                        shared);
                 });
    if (!shape.lines.empty())
    {
        // As triangles of no width. What they touch counts as reached into: a line that
        // runs along the edges of voxels would be in none of them.
        VoxelFlags of_lines(grid.size());
        SharedMarks of_all(of_lines);
        for (const auto& [a, b] : shape.lines)
            TriangleMarker(grid, lines,
                           {grid.to_voxels(shape.samples[a]),
                            grid.to_voxels(shape.samples[b]),
                            grid.to_voxels(shape.samples[b])},
                           of_all);
        for_each_set(of_lines, [&](std::size_t voxel) { marks[voxel] |= kInside; });
    }
    std::vector<char> is_used(shape.samples.size(), 0);
    parallel_for(shape.triangles.size(), kTrianglesAtOnce,
                 [&](std::size_t t)
                 {
                     for (const std::uint32_t sample : shape.triangles[t])
                         std::atomic_ref<char>(is_used[sample])
                             .store(1, std::memory_order_relaxed);
                 });
    for (const LineEnds& line : shape.lines)
        for (const std::uint32_t sample : line)
            is_used[sample] = 1;
    for (std::size_t i = 0; i < shape.samples.size(); ++i)
        if (!is_used[i])
            for_each_voxel(grid.touched(shape.samples[i]),
                           [&](const Eigen::Vector3i& voxel)
                           { marks[grid.index(voxel)] |= kInside; });
    return marks;
}

VoxelFlags beyond_marks(VoxelFlags is_inside, const VoxelFlags& marks)
{
    parallel_for_each_set(marks,
                          [&](std::size_t i)
                          {
                              if (is_inside[i])
                                  is_inside[i] = 0;
                          });
    return is_inside;
}

} // namespace cellwarp::core
