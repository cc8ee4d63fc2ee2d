// SPDX-License-Identifier: GPL-3.0-or-later
// A triangle's range of voxels is cut in halves, and each half is tested for an axis
// that separates it from the triangle: its normal, the nine cross products of its edges
// with the box's, and the box's own. A box that is a little larger than the voxel tells
// whether the triangle touches it, one a little smaller whether it reaches into it, and
// one that is a thin slab around a side of it whether part of the triangle lies there.
// A small triangle in a row of voxels, which touches none of the planes beside the row,
// needs no such test: how far it reaches along the row tells all.
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

namespace cellwarp
{

namespace
{

using VoxelLines = std::array<std::vector<double>, 3>;

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

/// Whether a voxel has all of a mark. Another thread may give it the rest meanwhile.
bool has_mark(std::uint8_t& voxel, std::uint8_t mark)
{
    return (std::atomic_ref<std::uint8_t>(voxel).load(std::memory_order_relaxed) &
            mark) == mark;
}

void add_mark(std::uint8_t& voxel, std::uint8_t mark)
{
    if (!has_mark(voxel, mark)) // writing takes far longer
        std::atomic_ref<std::uint8_t>(voxel).fetch_or(mark, std::memory_order_relaxed);
}

/// Marks the voxels that one triangle (corners in voxel units) touches.
class TriangleMarker
{
public:
    TriangleMarker(const VoxelGrid& grid, const VoxelLines& lines,
                   const std::array<Eigen::Vector3d, 3>& corners, VoxelFlags& marks)
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
        if (!mark_row(range))
            visit(range);
    }

private:
    struct Box
    {
        Eigen::Vector3d low, high;
    };

    void find_axes()
    {
        const Eigen::Vector3d edges[3] = {corners_[1] - corners_[0],
                                          corners_[2] - corners_[1],
                                          corners_[0] - corners_[2]};
        has_axes_ = true;
        std::array<Eigen::Vector3d, kAxes> axes;
        axes.fill(Eigen::Vector3d::Zero());
        axes[0] = edges[0].cross(edges[1]);
        for (std::size_t e = 0; e < 3; ++e)
            for (std::size_t k = 0; k < 3; ++k)
                axes[1 + 3 * e + k] =
                    Eigen::Vector3d::Unit(static_cast<Eigen::Index>(k)).cross(edges[e]);
        for (std::size_t s = 0; s < kAxes; ++s)
        {
            low_[s] = INFINITY;
            high_[s] = -INFINITY;
            for (const Eigen::Vector3d& corner : corners_)
            {
                low_[s] = std::min(low_[s], axes[s].dot(corner));
                high_[s] = std::max(high_[s], axes[s].dot(corner));
            }
            for (std::size_t k = 0; k < 3; ++k)
            {
                axes_[k][s] = axes[s][static_cast<Eigen::Index>(k)];
                lengths_[k][s] = std::abs(axes_[k][s]);
            }
        }
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

    bool meets(const Box& box)
    {
        if ((box_low_.array() > box.high.array()).any() ||
            (box_high_.array() < box.low.array()).any())
            return false;
        if (!has_axes_)
            find_axes(); // few triangles of a fine mesh need them
        const Eigen::Vector3d half = 0.5 * (box.high - box.low);
        const Eigen::Vector3d middle = 0.5 * (box.high + box.low);
        int num_apart = 0; // counted to the end: several axes at once
        for (std::size_t s = 0; s < kAxes; ++s)
        {
            const double centre = axes_[0][s] * middle.x() + axes_[1][s] * middle.y() +
                                  axes_[2][s] * middle.z();
            const double reach = lengths_[0][s] * half.x() + lengths_[1][s] * half.y() +
                                 lengths_[2][s] * half.z();
            num_apart += static_cast<int>(centre - reach > high_[s]) |
                         static_cast<int>(centre + reach < low_[s]);
        }
        return num_apart == 0;
    }

    /// Calls visit(axis, is_upper, plane) for the sides of a voxel near whose planes the
    /// triangle is.
    template <class Visit>
    void for_each_side(const Box& box, Visit&& visit) const
    {
        for (int axis = 0; axis < 3; ++axis)
        {
            if (box_high_[axis] - box_low_[axis] > 4.0 * kTouch)
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
        std::uint8_t marks = SurfaceMark::kTouched | SurfaceMark::kPenetrated;
        for_each_side(box, [&](int axis, bool is_upper, double)
                      { marks |= SurfaceMark::side(axis, is_upper); });
        return marks;
    }

    /// The sides of a voxel in which part of the triangle lies.
    std::uint8_t sides_in(const Box& box)
    {
        std::uint8_t sides = 0;
        for_each_side(box,
                      [&](int axis, bool is_upper, double plane)
                      {
                          Box slab{box.low.array() + kTouch, box.high.array() - kTouch};
                          slab.low[axis] = plane - 2.0 * kTouch;
                          slab.high[axis] = plane + 2.0 * kTouch;
                          if (meets(slab))
                              sides |= SurfaceMark::side(axis, is_upper);
                      });
        return sides;
    }

    /// Of a triangle that lies in one row of voxels and off its sides; else false.
    bool mark_row(const VoxelRange& range)
    {
        int along = 0;
        (range.last - range.first).maxCoeff(&along);
        for (int axis = 0; axis < 3; ++axis)
        {
            if (axis == along)
                continue;
            const std::vector<double>& lines = lines_[idx(axis)];
            if (range.first[axis] != range.last[axis] ||
                box_low_[axis] <= lines[idx(range.first[axis])] + 2.0 * kTouch ||
                box_high_[axis] >= lines[idx(range.first[axis]) + 1] - 2.0 * kTouch)
                return false;
        }
        const std::vector<double>& lines = lines_[idx(along)];
        const double low = box_low_[along], high = box_high_[along];
        const auto reaches = [&](double from, double to)
        { return low <= to && high >= from; };
        Eigen::Vector3i voxel = range.first;
        for (; voxel[along] <= range.last[along]; ++voxel[along])
        {
            const double begin = lines[idx(voxel[along])];
            const double end = lines[idx(voxel[along]) + 1];
            if (!reaches(begin - kTouch, end + kTouch))
                continue;
            std::uint8_t mark = SurfaceMark::kTouched;
            if (reaches(begin + kTouch, end - kTouch))
                mark |= SurfaceMark::kPenetrated;
            for (const bool is_upper : {false, true})
            {
                const double plane = is_upper ? end : begin;
                if (low >= plane - 2.0 * kTouch && high <= plane + 2.0 * kTouch)
                    mark |= SurfaceMark::side(along, is_upper);
            }
            add_mark(marks_[grid_.index(voxel)], mark);
        }
        return true;
    }

    bool touches(const Box& box)
    {
        return meets({box.low.array() - kTouch, box.high.array() + kTouch});
    }

    void mark_voxel(const Eigen::Vector3i& voxel)
    {
        const Box box = box_of({voxel, voxel});
        std::uint8_t& marks = marks_[grid_.index(voxel)];
        // Triangles of a fine mesh tell nothing new of most voxels.
        if (has_mark(marks, possible_marks(box)) || !touches(box))
            return;
        std::uint8_t mark = SurfaceMark::kTouched;
        if (meets({box.low.array() + kTouch, box.high.array() - kTouch}))
            mark |= SurfaceMark::kPenetrated;
        add_mark(marks, static_cast<std::uint8_t>(mark | sides_in(box)));
    }

    void visit(const VoxelRange& range)
    {
        constexpr double kFew = 8.0;
        const Eigen::Vector3d extents = (range.last - range.first).cast<double>();
        if ((extents.array() + 1.0).prod() <= kFew)
            return for_each_voxel(range, [&](const Eigen::Vector3i& voxel)
                                  { mark_voxel(voxel); });
        if (!touches(box_of(range)))
            return;
        int axis = 0;
        extents.maxCoeff(&axis);
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
    VoxelFlags& marks_;
    bool has_axes_ = false;
    /// The normal and the nine cross products, an even number with zeros; by their parts.
    static constexpr std::size_t kAxes = 12;
    std::array<std::array<double, kAxes>, 3> axes_, lengths_;
    std::array<double, kAxes> low_, high_; ///< of the triangle, along each
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
    constexpr std::uint8_t kInside = SurfaceMark::kPenetrated | SurfaceMark::kTouched;
    VoxelFlags marks(grid.size());
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
                         add_mark(marks[voxel], kInside);
                     else
                         TriangleMarker(grid, lines,
                                        {grid.to_voxels(shape.samples[a]),
                                         grid.to_voxels(shape.samples[b]),
                                         grid.to_voxels(shape.samples[c])},
                                        marks);
                 });
    if (!shape.lines.empty())
    {
        // As triangles of no width. What they touch counts as reached into: a line that
        // runs along the edges of voxels would be in none of them.
        VoxelFlags of_lines(grid.size());
        for (const auto& [a, b] : shape.lines)
            TriangleMarker(grid, lines,
                           {grid.to_voxels(shape.samples[a]),
                            grid.to_voxels(shape.samples[b]),
                            grid.to_voxels(shape.samples[b])},
                           of_lines);
        for_each_set(of_lines, [&](std::size_t voxel) { marks[voxel] |= kInside; });
    }
    std::vector<bool> is_used(shape.samples.size(), false);
    for (const Triangle& triangle : shape.triangles)
        for (const std::uint32_t sample : triangle)
            is_used[sample] = true;
    for (const LineEnds& line : shape.lines)
        for (const std::uint32_t sample : line)
            is_used[sample] = true;
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

} // namespace cellwarp
