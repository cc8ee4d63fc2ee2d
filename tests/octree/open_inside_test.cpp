// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/open_inside.h"

#include <cmath>

#include <gtest/gtest.h>

#include "octree/bounding_surface.h"
#include "octree/surface_marks.h"
#include "octree/winding.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

using Eigen::Vector3d;

namespace
{

/// Without every \p nth triangle.
Shape opened(Shape shape, std::size_t nth)
{
    std::vector<Triangle> kept;
    for (std::size_t t = 0; t < shape.triangles.size(); ++t)
        if ((t + 1) % nth != 0)
            kept.push_back(shape.triangles[t]);
    shape.triangles = kept;
    return shape;
}

struct Found
{
    VoxelGrid grid;
    VoxelFlags marks;
    OpenInside inside;
};

/// \p voxel: of the diagonal.
Found found(const Shape& shape, const Vector3d& size, double voxel, bool has_votes)
{
    Found out{VoxelGrid(grid_shape(size, 8, 0, voxel * size.norm())), {}, {}};
    out.marks = surface_marks(shape, out.grid);
    out.inside = open_inside(
        out.grid, out.marks,
        has_votes ? inside_votes(shape, bounding_surface(shape).triangles, out.grid)
                  : VoxelFlags());
    return out;
}

/// Of what is inside and touched by no surface.
double volume(const Found& of)
{
    double sum = 0.0;
    const double voxel = std::pow(of.grid.shape().voxel(), 3);
    for (std::size_t i = 0; i < of.grid.size(); ++i)
        sum += of.inside.is_inside[i] && !of.marks[i] ? voxel : 0.0;
    return sum;
}

bool is_inside(const Found& of, const Vector3d& x)
{
    return of.inside.is_inside[of.grid.index(of.grid.locate(x))] != 0;
}

} // namespace

TEST(OpenInside, fine_voxels_enclose_what_larger_ones_do)
{
    // A box with small openings all over.
    const Vector3d size(1.0, 0.3, 0.2);
    const Shape shape = opened(support::box_shape({0, 0, 0}, size, 24), 40);
    for (const bool has_votes : {true, false})
    {
        SCOPED_TRACE(has_votes);
        const Found coarse = found(shape, size, 0.0033, has_votes);
        const Found fine = found(shape, size, 0.0010, has_votes);
        EXPECT_EQ(inside_scale(coarse.grid.shape()), 1);
        EXPECT_GE(inside_scale(fine.grid.shape()), 3);
        EXPECT_EQ(fine.inside.method, coarse.inside.method);
        EXPECT_EQ(fine.inside.method,
                  has_votes ? InsideMethod::Votes : InsideMethod::Flood);
        // Both leave out the voxels at the surface: large ones more of them.
        EXPECT_NEAR(volume(coarse), 0.06, 0.006);
        EXPECT_NEAR(volume(fine), 0.06, 0.002);
        EXPECT_GT(volume(fine), volume(coarse));
        // The same opening in voxels of either size.
        EXPECT_NEAR(fine.inside.flood_radius * fine.grid.shape().voxel(),
                    coarse.inside.flood_radius * coarse.grid.shape().voxel(),
                    2.5 * coarse.grid.shape().voxel());
        for (const double s : {0.02, 0.3, 0.98})
            EXPECT_TRUE(is_inside(fine, s * size)) << s;
    }
}

TEST(OpenInside, the_space_between_parts_is_outside_however_narrow)
{
    // Two boxes with a slit between that is narrower than a large voxel.
    constexpr double kSlit = 0.003;
    const Vector3d size(1.0 + kSlit, 0.2, 0.2);
    const Shape shape =
        opened(support::joined(support::box_shape({0, 0, 0}, {0.5, 0.2, 0.2}, 20),
                               support::box_shape({0.5 + kSlit, 0, 0}, size, 20)),
               50);
    const double diagonal = size.norm();
    ASSERT_LT(kSlit / diagonal, 0.0033);
    const Found fine = found(shape, size, 0.0008, true);
    ASSERT_GE(inside_scale(fine.grid.shape()), 4);
    for (double y = 0.02; y < 0.19; y += 0.02)
        for (double z = 0.02; z < 0.19; z += 0.02)
        {
            EXPECT_FALSE(is_inside(fine, {0.5 + 0.5 * kSlit, y, z})) << y << " " << z;
            EXPECT_TRUE(is_inside(fine, {0.45, y, z}));
            EXPECT_TRUE(is_inside(fine, {0.55, y, z}));
        }
}

TEST(OpenInside, a_slender_box_is_measured_by_its_own_diagonal)
{
    // Leaves in a whole number reach far beyond it.
    GridShape shape = grid_shape({1.0, 0.1, 0.1}, 2, 0, 0.001);
    ASSERT_GE(inside_scale(shape), 3);
    const GridShape larger = inside_grid(shape);
    EXPECT_EQ(larger.size, shape.size);
    EXPECT_NEAR(max_seal_radius(larger),
                max_seal_radius(shape) / double(inside_scale(shape)), 1.0);
    EXPECT_EQ(inside_scale(larger), 1);
}

TEST(OpenInside, a_sheet_encloses_nothing_in_voxels_of_any_size)
{
    const Shape sheet = support::sheet_shape(1.0, 0.5, 8);
    for (const double voxel : {0.0033, 0.0012})
    {
        const Found of = found(sheet, {1.0, 0.5, 0.1}, voxel, false);
        EXPECT_EQ(of.inside.method, InsideMethod::None);
        EXPECT_EQ(volume(of), 0.0);
    }
}

} // namespace cellwarp::core
