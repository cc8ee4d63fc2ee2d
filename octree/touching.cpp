// SPDX-License-Identifier: GPL-3.0-or-later
// A face of a solid that lies in the plane between two layers of voxels has its material
// on one side. To take both would make the solid thicker by a layer, to take always the
// upper one would give a shape and its mirror image different material. So:
// - a voxel one side of which holds part of the surface is material unless the voxel
//   across that side is so already (it is inside, or the surface reaches into it);
// - a voxel that is touched in an edge or corner alone is material if two parts of the
//   material meet there that are not connected around it: a sheet that runs diagonally
//   through the edges of voxels would fall apart without.
// Each rule looks only at what the one before it has left, so that the order of the
// voxels does not matter.
#include "octree/touching.h"

#include <algorithm>
#include <array>

#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "octree/surface_marks.h"

namespace cellwarp::core
{

namespace
{

constexpr std::size_t kRowsAtOnce = 64;       ///< of one thread
constexpr std::size_t kMarksAtOnce = 1 << 16; ///< likewise

/// Whether some voxel across a side in which the surface lies is not \p material.
bool bounds_nothing(const VoxelGrid& grid, const VoxelFlags& material, std::uint8_t mark,
                    const Eigen::Vector3i& voxel)
{
    for (int axis = 0; axis < 3; ++axis)
        for (const bool is_upper : {false, true})
        {
            if (!(mark & SurfaceMark::side(axis, is_upper)))
                continue;
            Eigen::Vector3i across = voxel;
            across[axis] += is_upper ? 1 : -1;
            if (!grid.inside_box().contains(across) || !material[grid.index(across)])
                return true;
        }
    return false;
}

/// Number of parts, connected through sides, of the material in the 26 voxels around one.
int parts_around(const VoxelGrid& grid, const VoxelFlags& material,
                 const Eigen::Vector3i& voxel)
{
    constexpr int kMiddle = 13;
    const auto step = [](int i)
    { return Eigen::Vector3i(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1); };
    std::array<bool, 27> is_left{};
    for (int i = 0; i < 27; ++i)
    {
        const Eigen::Vector3i other = voxel + step(i);
        is_left[idx(i)] =
            i != kMiddle && grid.contains(other) && material[grid.index(other)];
    }
    int parts = 0;
    for (int seed = 0; seed < 27; ++seed)
    {
        if (!is_left[idx(seed)])
            continue;
        ++parts;
        is_left[idx(seed)] = false;
        std::array<int, 27> stack;
        std::size_t height = 0;
        stack[height++] = seed;
        while (height > 0)
        {
            const int from = stack[--height];
            for (int to = 0; to < 27; ++to)
                if (is_left[idx(to)] && (step(from) - step(to)).cwiseAbs().sum() == 1)
                {
                    is_left[idx(to)] = false;
                    stack[height++] = to;
                }
        }
    }
    return parts;
}

/// Material of \p width voxels from \p row on: what is inside, and what the surface
/// reaches into. Where neither is near nothing is written, so that it takes no memory.
void settle_row(std::size_t row, std::size_t width, const VoxelFlags& marks,
                const VoxelFlags& is_inside, VoxelFlags& material)
{
    constexpr std::size_t kAtOnce = 64;
    const std::size_t end = row + width;
    for (std::size_t at = row; at < end; at += kAtOnce)
    {
        const std::size_t next = std::min(end, at + kAtOnce);
        if (is_inside.is_zero(at, next) && marks.is_zero(at, next))
            continue;
        for (std::size_t i = at; i < next; ++i)
            material[i] = static_cast<std::uint8_t>(
                (is_inside[i] != 0) | ((marks[i] & SurfaceMark::kPenetrated) != 0));
    }
}

} // namespace

void settle_material(VoxelGrid& grid, const VoxelFlags& marks,
                     const VoxelFlags& is_inside)
{
    VoxelFlags& material = grid.material();
    material = VoxelFlags(grid.size());
    const VoxelRange& box = grid.inside_box();
    const std::size_t width = idx(box.last.x() - box.first.x() + 1);
    const int num_rows = box.last.y() - box.first.y() + 1;
    parallel_for(idx(num_rows * (box.last.z() - box.first.z() + 1)), kRowsAtOnce,
                 [&](std::size_t row)
                 {
                     const int j = box.first.y() + static_cast<int>(row) % num_rows;
                     const int k = box.first.z() + static_cast<int>(row) / num_rows;
                     settle_row(grid.index(box.first.x(), j, k), width, marks, is_inside,
                                material);
                 });
    // Adds what \p is_needed, asked for all that is only touched, finds in the material
    // as it is.
    std::vector<std::vector<std::size_t>> touched_of((grid.size() + kMarksAtOnce - 1) /
                                                     kMarksAtOnce);
    parallel_for(touched_of.size(), 1,
                 [&](std::size_t part)
                 {
                     for_each_set(marks, part * kMarksAtOnce,
                                  std::min(grid.size(), (part + 1) * kMarksAtOnce),
                                  [&](std::size_t voxel)
                                  {
                                      if (!material[voxel])
                                          touched_of[part].push_back(voxel);
                                  });
                 });
    std::vector<std::size_t> touched;
    for (const std::vector<std::size_t>& of_part : touched_of)
        touched.insert(touched.end(), of_part.begin(), of_part.end());
    const auto add = [&](auto&& is_needed)
    {
        std::vector<char> is_added(touched.size(), 0);
        parallel_for(touched.size(), kSmallBodies,
                     [&](std::size_t i)
                     {
                         is_added[i] =
                             !material[touched[i]] &&
                             is_needed(touched[i], grid.coordinates(touched[i]));
                     });
        for (std::size_t i = 0; i < touched.size(); ++i)
            if (is_added[i])
                material[touched[i]] = 1;
    };
    add([&](std::size_t i, const Eigen::Vector3i& voxel)
        { return bounds_nothing(grid, material, marks[i], voxel); });
    add(
        [&](std::size_t i, const Eigen::Vector3i& voxel)
        {
            return !(marks[i] & SurfaceMark::kSides) &&
                   parts_around(grid, material, voxel) != 1;
        });
}

} // namespace cellwarp::core
