// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/boundary_points.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "tests/support/grids.h"

namespace cellwarp::core
{

namespace
{

/// Voxels of edge 1, filled where \p holds says.
template <class Holds>
VoxelGrid filled(const Eigen::Vector3i& counts, Holds&& holds)
{
    VoxelGrid grid = support::grid_of(counts);
    for_each_voxel({Eigen::Vector3i::Zero(), counts - Eigen::Vector3i::Ones()},
                   [&](const Eigen::Vector3i& voxel) {
                       grid.material()[grid.index(voxel)] =
                           static_cast<std::uint8_t>(holds(voxel));
                   });
    return grid;
}

} // namespace

TEST(BoundaryPoints, lie_on_all_sides_of_a_box_and_lead_out_of_it)
{
    const VoxelGrid grid =
        filled({20, 20, 20}, [](const Eigen::Vector3i& v)
               { return (v.array() >= 4).all() && (v.array() < 16).all(); });
    const BoundaryPoints points(grid);
    // Six sides of 12 x 12, one point of 2 x 2; those on edges count once.
    EXPECT_EQ(points.all().size(), 6u * 6 * 6 - 4 * 4 * 4);
    EXPECT_EQ(points.area(), 4.0);
    for (const BoundaryPoint& point : points.all())
    {
        EXPECT_EQ(point.place, grid.centre(point.voxel));
        EXPECT_NEAR(point.outward.norm(), 1.0, 1e-12);
        EXPECT_GT(point.outward.dot(point.place - Eigen::Vector3d::Constant(10)), 0.0);
    }
    const auto any = [](const BoundaryPoint&) { return true; };
    const BoundaryPoint* const right = points.nearest({15.4, 10, 10}, any);
    ASSERT_TRUE(right);
    EXPECT_TRUE(right->outward.isApprox(Eigen::Vector3d(1, 0, 0), 1e-12));
    EXPECT_EQ(points.nearest({15.4, 10, 10}, [](const BoundaryPoint& at)
                             { return at.outward.x() < -0.5; }),
              nullptr); // none of the nearest few
}

TEST(BoundaryPoints, of_a_film_have_no_direction_and_are_never_the_nearest)
{
    // A film of one voxel over a slab.
    const VoxelGrid grid = filled({20, 20, 20}, [](const Eigen::Vector3i& v)
                                  { return v.z() == 14 || v.z() < 5; });
    const BoundaryPoints points(grid);
    int num_of_film = 0;
    for (const BoundaryPoint& point : points.all())
        if (point.voxel.z() == 14)
        {
            ++num_of_film;
            const Eigen::Array2i at = point.voxel.head<2>().array();
            if ((at >= 2).all() && (at < 18).all())
            {
                EXPECT_TRUE(point.outward.isZero(0));
            }
        }
    EXPECT_EQ(num_of_film, 100);
    const BoundaryPoint* const nearest =
        points.nearest({10, 10, 13}, [](const BoundaryPoint&) { return true; });
    ASSERT_TRUE(nearest);
    EXPECT_EQ(nearest->voxel.z(), 4);
}

TEST(BoundaryPoints, of_a_flat_shape_look_within_its_plane)
{
    const VoxelGrid grid =
        filled({20, 20, 1}, [](const Eigen::Vector3i& v) { return v.x() < 10; });
    EXPECT_EQ(BoundaryPoints(grid).nearest({9.5, 10, 0.5},
                                           [](const BoundaryPoint&) { return true; }),
              nullptr);
    const BoundaryPoints flat(grid, 2);
    const BoundaryPoint* const nearest =
        flat.nearest({9.5, 10, 0.5}, [](const BoundaryPoint&) { return true; });
    ASSERT_TRUE(nearest);
    EXPECT_TRUE(nearest->outward.isApprox(Eigen::Vector3d(1, 0, 0), 1e-12));
    for (const BoundaryPoint& point : flat.all())
        EXPECT_NE(point.voxel.x(), 5); // inside
}

TEST(BoundaryPoints, of_two_materials_lie_where_they_touch)
{
    const VoxelGrid grid =
        filled({20, 8, 8}, [](const Eigen::Vector3i& v) { return v.x() < 10 ? 1 : 2; });
    const BoundaryPoints points(grid);
    const auto at_border = [](int x)
    {
        return [x](const BoundaryPoint& point)
        { return point.voxel.x() == x && point.outward.cwiseAbs().x() > 0.99; };
    };
    EXPECT_GT(std::count_if(points.all().begin(), points.all().end(), at_border(9)), 0);
    EXPECT_GT(std::count_if(points.all().begin(), points.all().end(), at_border(10)), 0);
}

} // namespace cellwarp::core
