// SPDX-License-Identifier: GPL-3.0-or-later
// A triangle's range of voxels is cut in halves, and each half is tested for an axis
// that separates it from the triangle: its normal, and the nine cross products of its
// edges with the box's. The box's own axes are the range itself.
#include "octree/surface_marks.h"

#include <algorithm>
#include <atomic>
#include <cmath>

#include <Eigen/Geometry>

#include "octree/parallel.h"

namespace cellwarp
{

namespace
{

void mark(std::uint8_t& voxel)
{
    std::atomic_ref<std::uint8_t>(voxel).store(1, std::memory_order_relaxed);
}

/// Marks the voxels that one triangle (corners in voxel units) touches.
class TriangleMarker
{
public:
    TriangleMarker(VoxelGrid& grid, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                   const Eigen::Vector3d& c)
        : grid_(grid), corners_{a, b, c}
    {
        const Eigen::Vector3d edges[3] = {b - a, c - b, a - c};
        axes_[0] = edges[0].cross(edges[1]);
        for (int e = 0; e < 3; ++e)
            for (int k = 0; k < 3; ++k)
                axes_[1 + 3 * e + k] = Eigen::Vector3d::Unit(k).cross(edges[e]);
        for (int s = 0; s < 10; ++s)
        {
            double low = INFINITY, high = -INFINITY;
            for (const Eigen::Vector3d& corner : corners_)
            {
                low = std::min(low, axes_[s].dot(corner));
                high = std::max(high, axes_[s].dot(corner));
            }
            // Touching counts, also when rounding says otherwise.
            const double slack =
                1e-9 * (axes_[s].norm() + std::abs(low) + std::abs(high));
            low_[s] = low - slack;
            high_[s] = high + slack;
        }
        Eigen::Vector3i first, last;
        for (int k = 0; k < 3; ++k)
        {
            const double low = std::min({a[k], b[k], c[k]}),
                         high = std::max({a[k], b[k], c[k]});
            const double end = grid.counts()[k] - 1.0;
            first[k] = static_cast<int>(std::clamp(std::floor(low), 0.0, end));
            last[k] = static_cast<int>(std::clamp(std::floor(high), 0.0, end));
        }
        visit(first, last);
    }

private:
    bool is_separate(const Eigen::Vector3i& first, const Eigen::Vector3i& last) const
    {
        const Eigen::Vector3d half =
            0.5 * (last - first + Eigen::Vector3i::Ones()).cast<double>();
        const Eigen::Vector3d middle = first.cast<double>() + half;
        for (int s = 0; s < 10; ++s)
        {
            const double centre = axes_[s].dot(middle),
                         reach = axes_[s].cwiseAbs().dot(half);
            if (centre - reach > high_[s] || centre + reach < low_[s])
                return true;
        }
        return false;
    }

    void visit(const Eigen::Vector3i& first, const Eigen::Vector3i& last)
    {
        int axis = 0;
        const int extent = (last - first).maxCoeff(&axis);
        if (extent > 0 && is_separate(first, last))
            return;
        if (extent == 0)
        {
            if (!is_separate(first, last))
                mark(grid_.material()[grid_.index(first)]);
            return;
        }
        const int middle = (first[axis] + last[axis]) / 2;
        Eigen::Vector3i low_last = last, high_first = first;
        low_last[axis] = middle;
        high_first[axis] = middle + 1;
        visit(first, low_last);
        visit(high_first, last);
    }

    VoxelGrid& grid_;
    Eigen::Vector3d corners_[3];
    Eigen::Vector3d axes_[10];
    double low_[10], high_[10];
};

} // namespace

void mark_surface(const Shape& shape, VoxelGrid& grid)
{
    parallel_ranges(
        shape.samples.size(), 4096,
        [&](std::size_t begin, std::size_t end)
        {
            for (std::size_t i = begin; i < end; ++i)
                mark(grid.material()[grid.index(grid.locate(shape.samples[i]))]);
        });
    parallel_ranges(
        shape.triangles.size(), 1024,
        [&](std::size_t begin, std::size_t end)
        {
            for (std::size_t t = begin; t < end; ++t)
            {
                const Triangle& triangle = shape.triangles[t];
                const Eigen::Vector3d a = grid.to_voxels(shape.samples[triangle[0]]);
                const Eigen::Vector3d b = grid.to_voxels(shape.samples[triangle[1]]);
                const Eigen::Vector3d c = grid.to_voxels(shape.samples[triangle[2]]);
                // Most triangles of a fine mesh lie in the voxel of their corners.
                const Eigen::Vector3i va = a.array().floor().cast<int>();
                if (va == b.array().floor().cast<int>().matrix() &&
                    va == c.array().floor().cast<int>().matrix())
                    continue;
                TriangleMarker(grid, a, b, c);
            }
        });
}

} // namespace cellwarp
