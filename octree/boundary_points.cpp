// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/boundary_points.h"

#include "octree/base/index.h"
#include "octree/base/parallel.h"

namespace cellwarp::core
{

namespace
{

/// Voxels of a block that has one point, along an edge.
constexpr int kBlock = 2;

/// How far around a voxel what is outside tells the direction out [voxel].
constexpr int kAround = 2;

/// Where what is outside leads out in all directions, their sum is below this share of
/// what they add up to one by one.
constexpr double kLeastShare = 0.2;

/// Points among which the nearest of a material is looked for.
constexpr std::size_t kFew = 32;

Eigen::Vector3d outward_at(const VoxelGrid& grid, const Eigen::Vector3i& voxel,
                           std::uint8_t own, int flat_axis)
{
    Eigen::Vector3i around = Eigen::Vector3i::Constant(kAround);
    if (flat_axis >= 0)
        around[flat_axis] = 0;
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double lengths = 0.0;
    for_each_voxel({voxel - around, voxel + around},
                   [&](const Eigen::Vector3i& other)
                   {
                       if (grid.contains(other) &&
                           grid.material()[grid.index(other)] == own)
                           return;
                       const Eigen::Vector3d step = (other - voxel).cast<double>();
                       sum += step / step.squaredNorm();
                       lengths += 1.0 / step.norm();
                   });
    const double length = sum.norm();
    return length > kLeastShare * lengths ? Eigen::Vector3d(sum / length)
                                          : Eigen::Vector3d::Zero();
}

bool is_on_boundary(const VoxelGrid& grid, const Eigen::Vector3i& voxel, std::uint8_t own,
                    int flat_axis)
{
    bool is_on = false;
    for_each_beside(voxel,
                    [&](const Eigen::Vector3i& other)
                    {
                        if (flat_axis >= 0 && other[flat_axis] != voxel[flat_axis])
                            return;
                        is_on = is_on || !grid.contains(other) ||
                                grid.material()[grid.index(other)] != own;
                    });
    return is_on;
}

/// Of a layer of blocks.
std::vector<BoundaryPoint> points_of_layer(const VoxelGrid& grid, int z, int flat_axis)
{
    std::vector<BoundaryPoint> points;
    const Eigen::Vector3i last = grid.counts() - Eigen::Vector3i::Ones();
    for (int y = 0; y <= last.y(); y += kBlock)
        for (int x = 0; x <= last.x(); x += kBlock)
        {
            const Eigen::Vector3i first(x, y, z);
            bool is_found = false;
            for_each_voxel(
                {first, last.cwiseMin(first + Eigen::Vector3i::Constant(kBlock - 1))},
                [&](const Eigen::Vector3i& voxel)
                {
                    const std::uint8_t own = grid.material()[grid.index(voxel)];
                    if (is_found || own == 0 ||
                        !is_on_boundary(grid, voxel, own, flat_axis))
                        return;
                    points.push_back({voxel, grid.centre(voxel),
                                      outward_at(grid, voxel, own, flat_axis)});
                    is_found = true;
                });
        }
    return points;
}

} // namespace

BoundaryPoints::BoundaryPoints(const VoxelGrid& grid, int flat_axis)
    : area_(kBlock * kBlock * grid.shape().voxel() * grid.shape().voxel())
{
    std::vector<std::vector<BoundaryPoint>> layers(
        idx((grid.counts().z() + kBlock - 1) / kBlock));
    parallel_for(layers.size(),
                 [&](std::size_t layer) {
                     layers[layer] = points_of_layer(
                         grid, kBlock * static_cast<int>(layer), flat_axis);
                 });
    std::vector<Eigen::Vector3d> places;
    for (const std::vector<BoundaryPoint>& layer : layers)
        for (const BoundaryPoint& point : layer)
        {
            if (!point.outward.isZero(0))
            {
                with_direction_.push_back(all_.size());
                places.push_back(point.place);
            }
            all_.push_back(point);
        }
    if (!places.empty())
        tree_.emplace(places);
}

const BoundaryPoint*
BoundaryPoints::nearest(const Eigen::Vector3d& x,
                        const std::function<bool(const BoundaryPoint&)>& accepts) const
{
    if (!tree_)
        return nullptr;
    std::vector<PointTree::Neighbour> few;
    tree_->nearest(x, kFew, few);
    for (const PointTree::Neighbour& near : few)
        if (const BoundaryPoint& point = all_[with_direction_[near.index]];
            accepts(point))
            return &point;
    return nullptr;
}

} // namespace cellwarp::core
