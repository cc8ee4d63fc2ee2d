// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/flesh/bone_tube.h"

#include <algorithm>
#include <cmath>
#include <compare>
#include <limits>
#include <map>

#include <Eigen/LU>

#include "octree/base/segment.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;
using Eigen::Vector3i;

/// A line passes within this of the centres of the voxels that it goes through [voxel].
constexpr double kHalfDiagonal = 0.87;

/// Parts of a drawn cell along each axis.
constexpr int kCuts = 6;

double distance(const BoneLine& bone, const Vector3d& x)
{
    const double t = nearest_share(bone.from, bone.to, x);
    return (bone.from + t * (bone.to - bone.from) - x).norm();
}

/// A voxel of the material in a bone's tube.
struct TubeVoxel
{
    std::size_t voxel = 0;
    double distance = 0.0; ///< from the bone
    int bone = -1;

    auto operator<=>(const TubeVoxel&) const = default;
};

/// Adds the voxels of the tube of bone \p number that are joined to the bone.
void add_joined_voxels(const VoxelGrid& grid, double unit, const TubeBone& bone,
                       int number, std::vector<TubeVoxel>& out)
{
    const Vector3d reach = Vector3d::Constant(bone.radius / unit);
    const Vector3d a = bone.line.from / unit, b = bone.line.to / unit;
    const BoneLine line{a, b, bone.line.motion};
    const double radius = bone.radius / unit,
                 through = kHalfDiagonal * grid.shape().voxel();
    const VoxelRange range{grid.locate(a.cwiseMin(b) - reach),
                           grid.locate(a.cwiseMax(b) + reach)};
    const auto away = [&](const Vector3i& v)
    {
        return grid.material()[grid.index(v)] == 0
                   ? std::numeric_limits<double>::infinity()
                   : distance(line, grid.centre(v));
    };
    const Vector3i size = range.last - range.first + Vector3i::Ones();
    std::vector<bool> is_found(idx(size.x()) * idx(size.y()) * idx(size.z()), false);
    std::vector<Vector3i> queue;
    const auto visit = [&](const Vector3i& v)
    {
        const Vector3i at = v - range.first;
        auto is_here =
            is_found[(idx(at.z()) * idx(size.y()) + idx(at.y())) * idx(size.x()) +
                     idx(at.x())];
        if (is_here)
            return;
        const double d = away(v);
        if (d > radius)
            return;
        is_here = true;
        out.push_back({grid.index(v), d, number});
        queue.push_back(v);
    };
    for_each_voxel(range,
                   [&](const Vector3i& v)
                   {
                       if (away(v) <= std::min(through, radius))
                           visit(v);
                   });
    for (std::size_t next = 0; next < queue.size(); ++next)
    {
        const Vector3i at = queue[next];
        for (int axis = 0; axis < 3; ++axis)
            for (const int step : {-1, 1})
            {
                Vector3i v = at;
                v[axis] += step;
                if (range.contains(v))
                    visit(v);
            }
    }
}

} // namespace

std::vector<std::vector<std::size_t>> voxels_in_tubes(const VoxelGrid& grid, double unit,
                                                      std::span<const TubeBone> bones)
{
    std::vector<TubeVoxel> in_tubes;
    for (std::size_t b = 0; b < bones.size(); ++b)
        add_joined_voxels(grid, unit, bones[b], static_cast<int>(b), in_tubes);
    std::sort(in_tubes.begin(), in_tubes.end());
    std::vector<std::vector<std::size_t>> voxels(bones.size());
    for (std::size_t k = 0; k < in_tubes.size(); ++k)
        if (k == 0 || in_tubes[k].voxel != in_tubes[k - 1].voxel)
            voxels[idx(in_tubes[k].bone)].push_back(in_tubes[k].voxel);
    return voxels;
}

std::vector<std::vector<MaterialPoint>>
points_in_tubes(const VoxelGrid& grid, const Pieces& pieces, const Lattice& lattice,
                double unit, std::span<const std::vector<std::size_t>> voxels)
{
    std::vector<std::vector<MaterialPoint>> out(voxels.size());
    for (std::size_t b = 0; b < voxels.size(); ++b)
        for (const std::size_t voxel : voxels[b])
        {
            const Vector3i v = grid.coordinates(voxel);
            const int cell = pieces.at(grid, v);
            const std::optional<Vector3d> local =
                local_place(lattice, cell, unit * grid.centre(v));
            out[b].push_back({cell, local.value_or(Vector3d::Constant(0.5)),
                              unit * unit * unit * grid.extent(0, v.x()) *
                                  grid.extent(1, v.y()) * grid.extent(2, v.z())});
        }
    return out;
}

std::vector<std::vector<MaterialPoint>> points_in_tubes(const Lattice& lattice,
                                                        std::span<const TubeBone> bones)
{
    std::vector<std::vector<MaterialPoint>> out(bones.size());
    for (std::size_t c = 0; c < lattice.cells.size(); ++c)
        for_each_voxel(
            {Vector3i::Zero(), Vector3i::Constant(kCuts - 1)},
            [&](const Vector3i& v)
            {
                const int cell = static_cast<int>(c);
                const Vector3d local = (v.cast<double>().array() + 0.5) / kCuts;
                const Vector3d x = cell_point(lattice, cell, local);
                double near = std::numeric_limits<double>::infinity();
                std::size_t bone = bones.size();
                for (std::size_t b = 0; b < bones.size(); ++b)
                    if (const double d = distance(bones[b].line, x);
                        d <= bones[b].radius && d < near)
                    {
                        near = d;
                        bone = b;
                    }
                if (bone < bones.size())
                    out[bone].push_back({cell, local,
                                         cell_slopes(lattice, cell, local).determinant() /
                                             (kCuts * kCuts * kCuts)});
            });
    return out;
}

std::vector<TubePart> tube_parts(const Lattice& lattice,
                                 std::span<const FleshMaterial> materials,
                                 std::span<const TubeBone> bones,
                                 std::span<const std::vector<MaterialPoint>> points,
                                 double chi)
{
    // Where a cell is of several materials that of the largest part counts.
    std::vector<int> largest(lattice.cells.size(), 0);
    std::vector<double> volume(lattice.cells.size(), 0.0);
    for (std::size_t p = 0; p < lattice.parts.size(); ++p)
        if (const LatticePart& part = lattice.parts[p];
            part.volume > volume[idx(part.cell)])
        {
            volume[idx(part.cell)] = part.volume;
            largest[idx(part.cell)] = static_cast<int>(p);
        }
    std::vector<TubePart> out;
    for (std::size_t b = 0; b < bones.size(); ++b)
    {
        std::map<int, std::size_t> tube_of_part;
        for (const MaterialPoint& point : points[b])
        {
            const int part = largest[idx(point.cell)];
            const auto [found, is_new] = tube_of_part.try_emplace(part, out.size());
            if (is_new)
                out.push_back(
                    {part, bones[b].line.motion, Eigen::Matrix<double, 8, 8>::Zero(),
                     chi * materials[idx(lattice.parts[idx(part)].material)].shear() /
                         (bones[b].radius * bones[b].radius)});
            const std::array<double, 8> shares = corner_shares(point.local);
            const Eigen::Map<const Eigen::Matrix<double, 8, 1>> phi(shares.data());
            out[found->second].overlap += point.volume * phi * phi.transpose();
        }
    }
    return out;
}

} // namespace cellwarp::core
