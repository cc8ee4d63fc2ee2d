// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/surface_marks.h"

#include <array>
#include <cmath>
#include <random>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "tests/support/random.h"

namespace cellwarp::core
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

using Number = long double;
using Place = Eigen::Matrix<Number, 3, 1>;

/// By how much a box is from being parted from a triangle by each of 13 axes, the least
/// of them: below 0 they do not meet [voxel].
Number overlap(const Corners& corners, const Place& low, const Place& high)
{
    std::array<Place, 3> p;
    for (std::size_t k = 0; k < 3; ++k)
        p[k] = corners[k].cast<Number>();
    std::vector<Place> axes = {Place::Unit(0), Place::Unit(1), Place::Unit(2),
                               (p[1] - p[0]).cross(p[2] - p[0])};
    for (std::size_t e = 0; e < 3; ++e)
        for (int k = 0; k < 3; ++k)
            axes.push_back(Place::Unit(k).cross(p[(e + 1) % 3] - p[e]));
    Number least = INFINITY;
    for (const Place& axis : axes)
    {
        if (axis.norm() < 1e-12)
            continue;
        const Number middle = axis.dot(low + high) / 2;
        const Number reach = axis.cwiseAbs().dot(high - low) / 2;
        Number from = INFINITY, to = -INFINITY;
        for (const Place& corner : p)
        {
            from = std::min(from, axis.dot(corner));
            to = std::max(to, axis.dot(corner));
        }
        least = std::min(least, std::min(middle + reach - from, to - middle + reach) /
                                    axis.norm());
    }
    return least;
}

} // namespace

TEST(SurfaceMarks, are_those_of_each_voxel_by_itself)
{
    // The box ends within voxels: the outermost ones are cut.
    const GridShape shape = grid_shape({1.013, 0.71, 0.457}, 4, 0, 0.05);
    const VoxelGrid grid(shape);
    std::mt19937 rng(21);
    const double voxel = shape.voxel();
    const auto line = [&](int axis, int i)
    { return grid.to_voxels(Eigen::Vector3d::Constant(grid.lines(axis)[idx(i)]))[axis]; };
    int num_marks = 0, num_sides = 0, num_left = 0;
    for (int trial = 0; trial < 90; ++trial)
    {
        const double size = voxel * std::array{0.5, 2.0, 6.0, 30.0}[rng() % 4];
        Eigen::Vector3d middle;
        for (int axis = 0; axis < 3; ++axis)
            middle[axis] = support::random_number(rng, 0.0, shape.size[axis]);
        Corners corners;
        for (Eigen::Vector3d& corner : corners)
            corner = middle + size * support::random_vector(rng, 1.0);
        if (trial % 5 == 1) // a needle
            corners[2] = corners[1] + 1e-3 * (corners[2] - corners[1]);
        if (trial % 5 == 2) // a line, a point
            corners[2] = trial % 2 ? corners[0] : 0.5 * (corners[0] + corners[1]);
        if (trial % 10 == 7)
            corners[1] = corners[2] = corners[0];
        const int flat = static_cast<int>(rng() % 3);
        if (trial % 5 == 3) // in a plane between layers, nearly, or beside it
        {
            const double plane = grid.lines(flat)[1 + rng() % 6];
            const double off = std::array{0.0, 0.5e-3, 1.5e-3, 0.1}[rng() % 4] * voxel;
            for (Eigen::Vector3d& corner : corners)
                corner[flat] = plane + off;
        }
        // A place in the plane where the box ends is in the last voxel as a whole.
        const Eigen::Vector3d rim = Eigen::Vector3d::Constant(0.01 * voxel);
        for (Eigen::Vector3d& corner : corners)
            corner = corner.cwiseMax(rim).cwiseMin(shape.size - rim);
        const VoxelFlags marks = surface_marks(shape_of({corners}), grid);
        Corners in_voxels;
        for (std::size_t k = 0; k < 3; ++k)
            in_voxels[k] = grid.to_voxels(corners[k]);
        const Number touch = 1e-3;
        // What is decided by less than this is left to rounding.
        const Number unsure = 1e-9;
        const auto expect = [&](Number gap, int mark, int bit)
        {
            if (std::abs(gap) < unsure)
                ++num_left;
            else
                ASSERT_EQ((mark & bit) != 0, gap > 0) << trial << ' ' << bit;
        };
        for_each_voxel(
            grid.inside_box(),
            [&](const Eigen::Vector3i& v)
            {
                const int mark = marks[grid.index(v)];
                Place low, high;
                for (int axis = 0; axis < 3; ++axis)
                {
                    low[axis] = line(axis, v[axis]);
                    high[axis] = line(axis, v[axis] + 1);
                }
                const Place edge = Place::Constant(touch);
                const Number touched = overlap(in_voxels, low - edge, high + edge);
                expect(touched, mark, SurfaceMark::kTouched);
                expect(overlap(in_voxels, low + edge, high - edge), mark,
                       SurfaceMark::kPenetrated);
                num_marks += mark != 0;
                for (int axis = 0; axis < 3; ++axis)
                    for (const bool is_upper : {false, true})
                    {
                        const Number plane = is_upper ? high[axis] : low[axis];
                        Number spread = 0;
                        for (const Eigen::Vector3d& corner : in_voxels)
                            spread = std::max<Number>(
                                spread, std::abs(Number(corner[axis]) - plane));
                        Place from = low + edge, to = high - edge;
                        from[axis] = plane - 2 * touch;
                        to[axis] = plane + 2 * touch;
                        const Number inside = std::min(
                            {overlap(in_voxels, from, to), 2 * touch - spread, touched});
                        num_sides += inside > 0;
                        expect(inside, mark, SurfaceMark::side(axis, is_upper));
                    }
            });
    }
    EXPECT_GT(num_marks, 1000);
    EXPECT_GT(num_sides, 100);
    EXPECT_LT(num_left, num_marks / 20);
}

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

} // namespace cellwarp::core
