// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/region_voxels.h"

#include <algorithm>
#include <cmath>

#include "octree/base/index.h"
#include "octree/base/parallel.h"

namespace cellwarp::core
{

namespace
{

/// Range of voxels that bounds in model coordinates reach.
void voxel_range(const RegionShape& shape, const VoxelGrid& grid, const WorkFrame& frame,
                 Eigen::Vector3i& first, Eigen::Vector3i& last)
{
    first.setZero();
    last = grid.counts() - Eigen::Vector3i::Ones();
    if (!shape.low.allFinite() || !shape.high.allFinite())
        return;
    Eigen::Vector3d low = Eigen::Vector3d::Constant(INFINITY), high = -low;
    for (int k = 0; k < 8; ++k)
    {
        const Eigen::Vector3d corner(k & 1 ? shape.high.x() : shape.low.x(),
                                     k & 2 ? shape.high.y() : shape.low.y(),
                                     k & 4 ? shape.high.z() : shape.low.z());
        const Eigen::Vector3d x = frame.to_work(corner);
        low = low.cwiseMin(x);
        high = high.cwiseMax(x);
    }
    if (!low.allFinite() || !high.allFinite())
        return;
    // One voxel more on each side: the test itself decides.
    first = (grid.locate(low).array() - 1).cwiseMax(0);
    last = (grid.locate(high).array() + 1).cwiseMin(last.array());
}

/// Those of the material that a line passes through: a thin tube may miss their centres.
void add_voxels_on(const std::vector<Eigen::Vector3d>& line, const VoxelGrid& grid,
                   std::vector<VoxelRuns::Run>& runs)
{
    const double step = 0.25 * grid.shape().voxel();
    for (std::size_t k = 0; k + 1 < line.size(); ++k)
    {
        const Eigen::Vector3d along = line[k + 1] - line[k];
        const double length = along.norm();
        const int count = static_cast<int>(
            std::min(1.0 + std::ceil(length / step), 4.0 * grid.counts().sum()));
        for (int i = 0; i <= count; ++i)
        {
            const Eigen::Vector3d x = line[k] + along * (double(i) / count);
            if ((x.array() < 0.0).any() ||
                (x.array() > grid.counts().cast<double>().array() * grid.shape().voxel())
                    .any())
                continue;
            for_each_voxel(grid.touched(x),
                           [&](const Eigen::Vector3i& at)
                           {
                               const auto voxel =
                                   static_cast<std::uint32_t>(grid.index(at));
                               if (grid.material()[voxel])
                                   runs.push_back({voxel, voxel + 1});
                           });
        }
    }
}

/// Finds the voxels of material whose centres lie in a shape: blocks of them are asked
/// for together, of which most lie inside or outside as a whole.
class ShapeVoxels
{
public:
    ShapeVoxels(const RegionShape& shape, bool is_convex, const RestShape& rest)
        : shape_(shape), is_convex_(is_convex), grid_(rest.material.grid),
          frame_(rest.frame)
    {
        voxel_range(shape, grid_, frame_, first_, last_);
        for (int axis = 0; axis < 3; ++axis)
            counts_[axis] = (last_[axis] - first_[axis]) / kWidth + 1;
    }

    /// Of layers of blocks.
    std::size_t num_layers() const { return idx(counts_.z()); }

    VoxelRuns of_layer(std::size_t layer) const
    {
        const int begin = first_.z() + static_cast<int>(layer) * kWidth;
        const int end = std::min(begin + kWidth - 1, last_.z());
        std::vector<Lies> blocks;
        for (int j = 0; j < counts_.y(); ++j)
            for (int i = 0; i < counts_.x(); ++i)
            {
                VoxelRange block{first_ + kWidth * Eigen::Vector3i(i, j, 0), {}};
                block.first.z() = begin;
                block.last = (block.first.array() + kWidth - 1).min(last_.array());
                blocks.push_back(where(block));
            }
        VoxelRuns voxels;
        for (int k = begin; k <= end; ++k)
            for (int j = first_.y(); j <= last_.y(); ++j)
                for (int i = 0; i < counts_.x(); ++i)
                {
                    const int block = (j - first_.y()) / kWidth * counts_.x() + i;
                    if (blocks[idx(block)] == Lies::Outside)
                        continue;
                    const int x = first_.x() + i * kWidth;
                    add_row({x, j, k}, std::min(x + kWidth - 1, last_.x()),
                            blocks[idx(block)] == Lies::Inside, voxels);
                }
        return voxels;
    }

private:
    static constexpr int kWidth = 8;          ///< of a block [voxel]
    static constexpr double kRounding = 1e-6; ///< far more than rounding, relative

    enum class Lies : char
    {
        Outside,
        Inside,
        Across ///< or it is not known
    };

    Eigen::Vector3d centre(const Eigen::Vector3i& voxel) const
    {
        return frame_.to_model(grid_.centre(voxel));
    }
    bool holds(const Eigen::Vector3i& voxel) const { return shape_.holds(centre(voxel)); }

    Lies where(const VoxelRange& block) const
    {
        if (!has_material(block))
            return Lies::Outside;
        if (!is_convex_)
            return Lies::Across;
        const Eigen::Vector3d low = centre(block.first), high = centre(block.last);
        const double radius = (0.5 + kRounding) * (high - low).norm() +
                              kRounding * frame_.length_to_model(grid_.shape().voxel());
        if (shape_.distance(0.5 * (low + high)) > radius)
            return Lies::Outside;
        for (int corner = 0; corner < 8; ++corner)
        {
            Eigen::Vector3i voxel = block.first;
            for (int axis = 0; axis < 3; ++axis)
                if (corner >> axis & 1)
                    voxel[axis] = block.last[axis];
            if (!holds(voxel))
                return Lies::Across;
        }
        return Lies::Inside; // with its corners, as the shape is convex
    }

    bool has_material(const VoxelRange& block) const
    {
        const std::size_t width = idx(block.last.x() - block.first.x() + 1);
        for (int k = block.first.z(); k <= block.last.z(); ++k)
            for (int j = block.first.y(); j <= block.last.y(); ++j)
            {
                const std::size_t row = grid_.index(block.first.x(), j, k);
                if (!grid_.material().is_zero(row, row + width))
                    return true;
            }
        return false;
    }

    /// From \p voxel to \p last along x.
    void add_row(Eigen::Vector3i voxel, int last, bool is_inside, VoxelRuns& voxels) const
    {
        std::size_t index = grid_.index(voxel);
        for (; voxel.x() <= last; ++voxel.x(), ++index)
            if (grid_.material()[index] && (is_inside || holds(voxel)))
                voxels.add(index);
    }

    const RegionShape& shape_;
    bool is_convex_;
    const VoxelGrid& grid_;
    const WorkFrame& frame_;
    Eigen::Vector3i first_, last_, counts_;
};

} // namespace

VoxelRuns voxels_in_shapes(const Region& region, const RestShape& rest)
{
    std::vector<VoxelRuns::Run> runs;
    for (const RegionShape& shape : region.shapes)
    {
        const ShapeVoxels finder(shape, !region.spline && !region.bone, rest);
        std::vector<VoxelRuns> of_layer(finder.num_layers());
        parallel_for(of_layer.size(), [&](std::size_t layer)
                     { of_layer[layer] = finder.of_layer(layer); });
        for (const VoxelRuns& layer : of_layer)
            runs.insert(runs.end(), layer.runs().begin(), layer.runs().end());
    }
    if (region.is_rod())
        add_voxels_on(region.spline->polyline(), rest.material.grid, runs);
    return VoxelRuns(std::move(runs));
}

std::vector<std::uint32_t> voxels_on_bone(const Region& region, const VoxelGrid& grid)
{
    std::vector<std::uint32_t> voxels;
    const double step = 0.25 * grid.shape().voxel();
    for (const auto& [from, to] : region.bone->lines)
    {
        const int count = static_cast<int>(std::min(
            1.0 + std::ceil((to - from).norm() / step), 4.0 * grid.counts().sum()));
        for (int i = 0; i <= count; ++i)
        {
            const Eigen::Vector3d x = from + (to - from) * (double(i) / count);
            if ((x.array() < 0.0).any() || (x.array() > grid.shape().size.array()).any())
                continue;
            for_each_voxel(grid.touched(x),
                           [&](const Eigen::Vector3i& v)
                           {
                               if (grid.material()[grid.index(v)])
                                   voxels.push_back(
                                       static_cast<std::uint32_t>(grid.index(v)));
                           });
        }
    }
    std::sort(voxels.begin(), voxels.end());
    voxels.erase(std::unique(voxels.begin(), voxels.end()), voxels.end());
    return voxels;
}

} // namespace cellwarp::core
