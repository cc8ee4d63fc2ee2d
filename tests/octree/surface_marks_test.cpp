// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/surface_marks.h"

#include <random>

#include <gtest/gtest.h>

#include "tests/support/shapes.h"

namespace cellwarp
{

namespace
{

using Corners = std::array<Eigen::Vector3d, 3>;

Shape shape_of(const std::vector<Corners>& triangles)
{
    Shape shape;
    for (const Corners& corners : triangles)
    {
        const auto first = static_cast<std::uint32_t>(shape.samples.size());
        shape.samples.insert(shape.samples.end(), corners.begin(), corners.end());
        shape.triangles.push_back({first, first + 1, first + 2});
    }
    return shape;
}

/// Into four, by the middles of the edges.
std::vector<Corners> divided(const std::vector<Corners>& triangles)
{
    std::vector<Corners> parts;
    for (const auto& [a, b, c] : triangles)
    {
        const Eigen::Vector3d ab = 0.5 * (a + b), bc = 0.5 * (b + c), ca = 0.5 * (c + a);
        parts.insert(parts.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    }
    return parts;
}

} // namespace

TEST(SurfaceMarks, of_a_triangle_are_those_of_its_parts)
{
    // From triangles within a voxel, along a row of them, to such that span many: the
    // parts go other ways than the whole.
    const GridShape shape = grid_shape({1, 0.7, 0.45}, 4, 0, 0.05);
    const VoxelGrid grid(shape);
    std::mt19937 rng(11);
    for (int k = 0; k < 400; ++k)
    {
        const double size = shape.voxel() * (k % 4 == 0 ? 8.0 : k % 4 == 1 ? 2.0 : 0.6);
        Eigen::Vector3d stretch = Eigen::Vector3d::Ones();
        if (k % 4 == 3)
            stretch[k % 3] = 8.0;
        Eigen::Vector3d middle;
        for (int axis = 0; axis < 3; ++axis)
            middle[axis] = support::random_number(rng, 0.0, shape.size[axis]);
        Corners corners;
        for (Eigen::Vector3d& corner : corners)
            corner =
                (middle + size * stretch.cwiseProduct(support::random_vector(rng, 1.0)))
                    .cwiseMax(Eigen::Vector3d::Constant(0.001))
                    .cwiseMin(shape.size - Eigen::Vector3d::Constant(0.001));
        std::vector<Corners> parts = {corners};
        const VoxelFlags whole = surface_marks(shape_of(parts), grid);
        for (int level = 0; level < 3; ++level)
        {
            parts = divided(parts);
            EXPECT_TRUE(surface_marks(shape_of(parts), grid) == whole) << k;
        }
    }
}

TEST(SurfaceMarks, of_a_triangle_in_a_row_reach_as_far_as_it_does)
{
    const VoxelGrid grid(grid_shape({8, 1, 1}, 8, 0, 1.0 / 3)); // voxels of a quarter
    const double voxel = grid.shape().voxel();
    const auto marks_of = [&](double from, double to)
    {
        const double y = 0.5, z = 0.4; // all [voxel]
        Corners corners = {Eigen::Vector3d(from, y, z), Eigen::Vector3d(to, y, z),
                           Eigen::Vector3d(from, y, z + 0.1)};
        for (Eigen::Vector3d& corner : corners)
            corner *= voxel;
        const VoxelFlags marks = surface_marks(shape_of({corners}), grid);
        std::vector<int> row;
        for (int i = 0; i < 7; ++i)
            row.push_back(marks[grid.index(i, 0, 0)]);
        return row;
    };
    constexpr int kTouched = SurfaceMark::kTouched,
                  kThrough = kTouched | SurfaceMark::kPenetrated;
    EXPECT_EQ(marks_of(2.5, 4.5),
              (std::vector<int>{0, 0, kThrough, kThrough, kThrough, 0, 0}));
    EXPECT_EQ(marks_of(2.5, 5.0),
              (std::vector<int>{0, 0, kThrough, kThrough, kThrough, kTouched, 0}));
    // It lies in the plane between two voxels: in a side of either.
    EXPECT_EQ(marks_of(3.0, 3.0),
              (std::vector<int>{0, 0, kTouched | SurfaceMark::side(0, true),
                                kTouched | SurfaceMark::side(0, false), 0, 0, 0}));
}

} // namespace cellwarp
