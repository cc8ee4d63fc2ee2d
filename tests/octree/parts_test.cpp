// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/parts.h"

#include <algorithm>
#include <set>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "octree/nearest_sample.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

using support::box_shape;
using support::joined;

/// The inside of it seen from inside.
Shape turned_inside_out(Shape shape)
{
    for (Triangle& t : shape.triangles)
        std::swap(t[1], t[2]);
    return shape;
}

/// A shape on its grid, by parts, and the cells of that.
struct Apart
{
    Shape shape;
    Parts parts;
    Material material;
    Cells cells;

    explicit Apart(Shape of, int across = 16, Fill fill = Fill::Solid)
        : shape(moved_to_origin(std::move(of))),
          material(material_of_parts(shape, bounding_surface(shape),
                                     grid_shape(size(), across, 0, 0.0), fill, parts))
    {
        const Octree octree(material.grid.shape(), material_test(material.grid));
        cells = build_cells(material.grid, octree, find_pieces(material.grid, octree));
    }
    Eigen::Vector3d size() const
    {
        Eigen::Vector3d high = shape.samples.front();
        for (const Eigen::Vector3d& x : shape.samples)
            high = high.cwiseMax(x);
        return high;
    }
    static Shape moved_to_origin(Shape shape)
    {
        Eigen::Vector3d low = shape.samples.front();
        for (const Eigen::Vector3d& x : shape.samples)
            low = low.cwiseMin(x);
        for (Eigen::Vector3d& x : shape.samples)
            x -= low;
        return shape;
    }
    std::size_t num_components() const
    {
        const std::vector<int> number = connected_components(cells);
        return static_cast<std::size_t>(*std::max_element(number.begin(), number.end())) +
               1;
    }
    double volume() const
    {
        double sum = 0.0;
        for (const Cell& cell : cells.cells)
            sum += cell.volume;
        return sum;
    }
    bool is_as_one() const
    {
        return parts.voxel_of_sample.empty() &&
               material.grid.material() == find_material(shape, bounding_surface(shape),
                                                         material.grid.shape(),
                                                         Fill::Solid)
                                               .grid.material();
    }
};

/// Two boxes, of which the second begins at \p at along x, in a place of its own.
Shape two_boxes(double at)
{
    return joined(box_shape({0, 0, 0}, {2, 1, 1}, 4),
                  box_shape({at, 0.13, 0.21}, {at + 1, 0.77, 0.83}, 3));
}

} // namespace

TEST(Parts, that_touch_are_apart)
{
    for (const bool is_mirrored : {false, true})
    {
        Shape shape = two_boxes(2.0);
        if (is_mirrored)
        {
            shape = turned_inside_out(shape);
            for (Eigen::Vector3d& x : shape.samples)
                x.x() = -x.x();
        }
        const Apart boxes(shape);
        EXPECT_EQ(boxes.num_components(), 2u);
        ASSERT_EQ(boxes.parts.count(), 2u);
        EXPECT_EQ(boxes.parts.parts[0].first_sample, 0u);
        EXPECT_EQ(boxes.parts.parts[1].first_sample,
                  box_shape({0, 0, 0}, {2, 1, 1}, 4).samples.size());
        EXPECT_EQ(boxes.parts.touching, (std::vector<std::pair<int, int>>{{0, 1}}));
        EXPECT_EQ(boxes.parts.num_touching(), 2u);
        EXPECT_FALSE(boxes.is_as_one());
    }
}

TEST(Parts, that_overlap_are_apart_and_what_they_share_is_the_smaller_ones)
{
    const Apart boxes(two_boxes(1.4));
    EXPECT_EQ(boxes.num_components(), 2u);
    EXPECT_EQ(boxes.parts.count(), 2u);
    const std::vector<int> component = connected_components(boxes.cells);
    double first = 0.0, second = 0.0;
    for (std::size_t c = 0; c < component.size(); ++c)
        (component[c] == component[0] ? first : second) += boxes.cells.cells[c].volume;
    const double of_second = 1.0 * 0.64 * 0.62, shared = 0.6 * 0.64 * 0.62;
    EXPECT_NEAR(first, 2.0 - shared, 0.2);
    EXPECT_NEAR(second, of_second, 0.2);
}

TEST(Parts, hold_their_own_samples_wherever_these_are)
{
    const Apart boxes(two_boxes(1.4));
    const VoxelFlags& material = boxes.material.grid.material();
    const std::size_t first_of_second = boxes.parts.parts.at(1).first_sample;
    ASSERT_EQ(boxes.parts.voxel_of_sample.size(), boxes.shape.samples.size());
    std::size_t in_the_other = 0;
    for (std::size_t i = 0; i < boxes.shape.samples.size(); ++i)
    {
        const std::size_t voxel = boxes.parts.voxel_of_sample[i];
        EXPECT_EQ(material[voxel], i < first_of_second ? 1 : 2) << i;
        in_the_other += material[boxes.material.grid.index(boxes.material.grid.locate(
                            boxes.shape.samples[i]))] != material[voxel];
    }
    EXPECT_GT(in_the_other, 0u);
    // And the voxels that are nearest to them.
    std::vector<std::uint32_t> part_of_sample(boxes.shape.samples.size(), 2);
    std::fill_n(part_of_sample.begin(), first_of_second, 1);
    const std::vector<VoxelRuns> voxels =
        NearestSamples(boxes.material.grid, boxes.shape.samples,
                       boxes.parts.voxel_of_sample, {})
            .voxels_of(part_of_sample, 3);
    std::size_t count = 0;
    for (const std::uint8_t part : {1, 2})
        voxels[part].for_each(
            [&](std::size_t voxel)
            {
                EXPECT_EQ(material[voxel], part);
                ++count;
            });
    EXPECT_EQ(count, static_cast<std::size_t>(
                         std::count_if(material.begin(), material.end(),
                                       [](std::uint8_t number) { return number != 0; })));
}

TEST(Parts, that_are_far_from_each_other_are_found_as_one_shape)
{
    const Apart boxes(two_boxes(3.0));
    EXPECT_EQ(boxes.parts.count(), 2u);
    EXPECT_TRUE(boxes.parts.touching.empty());
    EXPECT_TRUE(boxes.is_as_one());
    const Apart one(support::l_prism());
    EXPECT_EQ(one.parts.count(), 1u);
    EXPECT_EQ(one.parts.parts[0].num_samples, one.shape.samples.size());
    EXPECT_TRUE(one.is_as_one());
}

TEST(Parts, that_have_samples_at_one_place_are_one)
{
    // Boxes with one side in common; exactly, and up to rounding.
    for (const double off : {0.0, 1e-10})
    {
        const Apart boxes(joined(box_shape({0, 0, 0}, {1, 1, 1}, 4),
                                 box_shape({1 + off, 0, 0}, {2, 1, 1}, 4)));
        EXPECT_EQ(boxes.num_components(), 1u) << off;
        EXPECT_EQ(boxes.parts.count(), 1u) << off;
        EXPECT_TRUE(boxes.is_as_one()) << off;
    }
    const Apart apart(joined(box_shape({0, 0, 0}, {1, 1, 1}, 4),
                             box_shape({1 + 1e-7, 0, 0}, {2, 1, 1}, 4)));
    EXPECT_EQ(apart.num_components(), 2u);
}

TEST(Parts, a_void_belongs_to_what_is_around_it_and_what_is_in_it_does_not)
{
    // A box with a void, and in the void a box that touches nothing; then as large as it.
    const Shape shell = joined(box_shape({0, 0, 0}, {4, 4, 4}, 4),
                               turned_inside_out(box_shape({1, 1, 1}, {3, 3, 3}, 3)));
    const Apart hollow(shell);
    EXPECT_EQ(hollow.parts.count(), 1u);
    EXPECT_NEAR(hollow.volume(), 64.0 - 8.0, 0.1);
    EXPECT_TRUE(hollow.is_as_one());
    for (const double gap : {0.6, 0.05})
    {
        const Apart bell(
            joined(shell, box_shape(Eigen::Vector3d::Constant(1.0 + gap),
                                    Eigen::Vector3d::Constant(3.0 - 0.7 * gap), 2)));
        EXPECT_EQ(bell.parts.count(), 2u);
        EXPECT_EQ(bell.num_components(), 2u);
    }
}

TEST(Parts, a_void_behind_a_wall_far_thinner_than_a_voxel_belongs_to_what_is_around_it)
{
    int num_outside = 0; // middles of the voxels of its corner: they cannot tell
    for (int k = 0; k < 8; ++k)
    {
        SCOPED_TRACE(k); // the wall lies elsewhere among the voxels
        const Eigen::Vector3d low = Eigen::Vector3d::Constant(1.0 + 0.007 * k),
                              high = Eigen::Vector3d::Constant(3.0);
        const Eigen::Vector3d wall = Eigen::Vector3d::Constant(1e-3);
        const Apart hollow(
            joined(box_shape({0, 0, 0}, {0.5, 0.5, 0.5}, 2),
                   joined(box_shape(low, high, 3),
                          turned_inside_out(box_shape(low + wall, high - wall, 3)))));
        EXPECT_EQ(hollow.parts.count(), 2u);
        const VoxelGrid& grid = hollow.material.grid;
        num_outside += (grid.centre(grid.locate(low + wall)).array() < low.array()).any();
    }
    EXPECT_GT(num_outside, 0);
}

TEST(Parts, a_part_wholly_within_another_is_one_with_it)
{
    const Shape head = box_shape({0, 0, 0}, {4, 4, 4}, 4);
    const Apart inside(joined(head, box_shape({1, 1, 1}, {2.9, 2.9, 2.9}, 3)));
    EXPECT_EQ(inside.parts.count(), 1u);
    EXPECT_TRUE(inside.is_as_one());
    // Of an eye a part looks out.
    const Apart eye(joined(head, box_shape({1, 1, 2.5}, {2.9, 2.9, 4.4}, 3)));
    EXPECT_EQ(eye.parts.count(), 2u);
    EXPECT_EQ(eye.num_components(), 2u);
}

TEST(Parts, open_surfaces_soups_and_points_hold_what_is_near_together)
{
    // Two boxes that touch, and a sheet over both.
    Shape sheet = support::sheet_shape(3.0, 1.0, 4);
    for (Eigen::Vector3d& x : sheet.samples)
        x.z() += 1.0;
    const Apart with_sheet(joined(two_boxes(2.0), sheet));
    EXPECT_EQ(with_sheet.parts.count(), 1u);
    EXPECT_TRUE(with_sheet.is_as_one());

    Shape with_point = two_boxes(2.0);
    with_point.samples.push_back({2.0, 0.47, 0.52});
    EXPECT_EQ(Apart(with_point).parts.count(), 2u); // the point has its own number
    EXPECT_EQ(Apart(with_point).num_components(), 1u);
    // Strays at both ends of the box are near neither.
    Shape with_strays = two_boxes(2.0);
    with_strays.samples.push_back({-1.5, -1.5, -1.5});
    with_strays.samples.push_back({4.5, 2.5, 2.5});
    const Apart strays(with_strays, 24);
    EXPECT_EQ(strays.num_components(), 4u);
    EXPECT_EQ(strays.parts.touching, (std::vector<std::pair<int, int>>{{0, 1}}));

    // Far from them it changes nothing.
    for (Eigen::Vector3d& x : sheet.samples)
        x.z() += 4.0;
    const Apart with_far(joined(two_boxes(2.0), sheet), 20);
    EXPECT_EQ(with_far.parts.count(), 3u);
    EXPECT_EQ(with_far.num_components(), 3u);
}

TEST(Parts, many_that_touch_are_all_apart)
{
    // A wall of bricks, each of which touches several.
    Shape wall;
    for (int row = 0; row < 5; ++row)
        for (int k = 0; k < 4; ++k)
        {
            const double x = 2.0 * k + (row % 2);
            const double y = 0.01 * k + 0.003 * row; // no two share a corner
            const Shape brick =
                box_shape({x, y, 1.0 * row}, {x + 2.0, 1.0 + y, row + 1.0}, 2);
            wall = wall.samples.empty() ? brick : joined(wall, brick);
        }
    const Apart bricks(wall, 36);
    EXPECT_EQ(bricks.parts.count(), 20u);
    EXPECT_EQ(bricks.num_components(), 20u);
    EXPECT_EQ(bricks.parts.num_touching(), 20u);
    EXPECT_NEAR(bricks.volume(), 40.0, 2.5); // voxels at the outside
}

TEST(Parts, of_shells_are_apart_too)
{
    const Apart boxes(two_boxes(2.0), 24, Fill::Shell);
    EXPECT_EQ(boxes.num_components(), 2u);
    EXPECT_FALSE(boxes.material.is_sheet.empty());
}

} // namespace cellwarp::core
