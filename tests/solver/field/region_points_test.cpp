// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/field/region_points.h"

#include <algorithm>
#include <utility>

#include <gtest/gtest.h>

#include "octree/base/index.h"
#include "tests/support/held_cells.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

using support::Built;
using support::cell_at;
using support::holding;

namespace
{

const std::size_t kHighX = side_of(0, true), kHighZ = side_of(2, true);

/// Where the points of a cell are that lie at a corner, or the middle of an edge or a
/// side, of its box.
std::vector<Eigen::Vector3d> points_from(const RegionPoints& points, const Built& bar,
                                         std::size_t cell, const Eigen::Vector3d& at)
{
    const Cell& first = bar.cells.cells.front();
    std::vector<Eigen::Vector3d> found;
    for (const RegionPoints::Point& point : points.of(cell))
    {
        Eigen::Vector3d lattice = first.box_centre;
        for (int axis = 0; axis < 3; ++axis)
            lattice[axis] += 0.5 * static_cast<double>(point.lattice[idx(axis)]);
        if ((lattice - at).norm() < 1e-9)
            found.push_back(point.at);
    }
    return found;
}

void expect_point(const RegionPoints& points, const Built& bar, std::size_t cell,
                  const Eigen::Vector3d& at, const Eigen::Vector3d& wanted)
{
    SCOPED_TRACE(::testing::Message() << "cell " << cell << ", " << at.transpose());
    const std::vector<Eigen::Vector3d> found = points_from(points, bar, cell, at);
    ASSERT_EQ(found.size(), 1u);
    EXPECT_LT((found[0] - wanted).norm(), 1e-12) << found[0].transpose();
}

} // namespace

TEST(RegionPoints, are_where_the_region_ends_within_its_cell)
{
    // How deep within the cell the region ends, and where its points are: not nearer to
    // the middle than a tenth of the edge, and at the side where it ends close to it.
    const std::pair<double, double> cases[] = {
        {0.0, 0.0}, {0.03, 0.0}, {0.1, 0.1}, {0.3, 0.3}, {0.47, 0.4}};
    for (int axis = 0; axis < 3; ++axis)
        for (const bool is_high : {false, true})
            for (const auto& [inset, wanted] : cases)
            {
                SCOPED_TRACE(::testing::Message()
                             << axis << " " << is_high << " " << inset);
                const Built bar =
                    support::bar(axis == 0 ? 3 : 1, axis == 1 ? 3 : 1, axis == 2 ? 3 : 1);
                Eigen::Vector3d middle(0.5, 0.5, 0.5);
                middle[axis] = is_high ? 0.5 : 2.5;
                const std::size_t held = cell_at(bar, middle);
                std::vector<Constraint> constraints = holding(bar, {held});
                constraints[held].insets[side_of(axis, is_high)] = inset;
                const RegionPoints points(bar.cells, constraints);
                // Four corners, and nine points at the border.
                ASSERT_EQ(points.of(held).size(), 13u);
                const double border = is_high ? 1.0 - wanted : 2.0 + wanted;
                for (const RegionPoints::Point& point : points.of(held))
                    EXPECT_NEAR(point.at[axis],
                                point.is_at_border ? border : (is_high ? 0.0 : 3.0),
                                1e-12);
                EXPECT_EQ(std::count_if(points.of(held).begin(), points.of(held).end(),
                                        [](const auto& point)
                                        { return point.is_at_border; }),
                          9);
                for (std::size_t cell = 0; cell < bar.cells.size(); ++cell)
                    EXPECT_EQ(points.of(cell).empty(), cell != held);
            }
}

TEST(RegionPoints, at_a_corner_of_the_region_are_within_both_its_sides)
{
    const Built block = support::bar(2, 1, 2);
    const std::size_t held = cell_at(block, {0.5, 0.5, 0.5});
    std::vector<Constraint> constraints = holding(block, {held});
    constraints[held].insets[kHighX] = 0.1;
    constraints[held].insets[kHighZ] = 0.3;
    const RegionPoints points(block.cells, constraints);
    expect_point(points, block, held, {1, 0, 1}, {0.9, 0, 0.7});
    expect_point(points, block, held, {0, 0, 1}, {0, 0, 0.7});
    expect_point(points, block, held, {1, 0.5, 0.5}, {0.9, 0.5, 0.5});
    expect_point(points, block, held, {0, 1, 0}, {0, 1, 0});
}

TEST(RegionPoints, in_a_corner_that_the_region_goes_around_are_at_one_place)
{
    const Built block = support::bar(2, 1, 2);
    const std::size_t below = cell_at(block, {1.5, 0.5, 0.5}),
                      beside = cell_at(block, {0.5, 0.5, 1.5}),
                      between = cell_at(block, {0.5, 0.5, 0.5});
    std::vector<Constraint> constraints = holding(block, {below, beside, between});
    constraints[below].insets[kHighZ] = 0.2;
    constraints[beside].insets[kHighX] = 0.3;
    const RegionPoints points(block.cells, constraints);
    for (const std::size_t cell : {below, beside, between})
        expect_point(points, block, cell, {1, 0, 1}, {0.7, 0, 0.8});
}

TEST(RegionPoints, of_several_cells_are_as_deep_as_they_are_on_average)
{
    const Built bar = support::bar(2, 1, 3);
    const std::size_t left = cell_at(bar, {0.5, 0.5, 0.5}),
                      right = cell_at(bar, {1.5, 0.5, 0.5});
    std::vector<Constraint> constraints = holding(bar, {left, right});
    constraints[left].insets[kHighZ] = 0.1;
    constraints[right].insets[kHighZ] = 0.3;
    const RegionPoints points(bar.cells, constraints);
    expect_point(points, bar, left, {0, 0, 1}, {0, 0, 0.9});
    expect_point(points, bar, right, {2, 0, 1}, {2, 0, 0.7});
    for (const std::size_t cell : {left, right})
        expect_point(points, bar, cell, {1, 0, 1}, {1, 0, 0.8});
}

TEST(RegionPoints, are_no_deeper_than_the_smallest_of_their_cells_allows)
{
    Built bar = support::bar(2, 1, 3);
    const std::size_t large = cell_at(bar, {0.5, 0.5, 0.5}),
                      small = cell_at(bar, {1.5, 0.5, 0.5});
    Cell& cell = bar.cells.cells[small];
    cell.edge = 0.5;
    cell.volume = 0.125;
    cell.box_centre = cell.anchor = {1.25, 0.25, 0.75};
    std::vector<Constraint> constraints = holding(bar, {large, small});
    constraints[large].insets[kHighZ] = 0.4;
    constraints[small].insets[kHighZ] = 0.2;
    const RegionPoints points(bar.cells, constraints);
    const auto depth = [&](std::size_t of, const Eigen::Vector3d& from)
    {
        for (const RegionPoints::Point& point : points.of(of))
            if ((point.at - from).head<2>().norm() < 1e-9 && point.is_at_border)
                return 1.0 - point.at.z();
        return -1.0;
    };
    EXPECT_NEAR(depth(large, {0, 0, 1}), 0.4, 1e-12);
    EXPECT_NEAR(depth(large, {1, 0, 1}), 0.2, 1e-12);
    EXPECT_NEAR(depth(small, {1, 0, 1}), 0.2, 1e-12);
    // Smaller cells have corners alone.
    EXPECT_EQ(depth(small, {1.25, 0.25, 1}), -1.0);
}

TEST(RegionPoints, are_left_out_close_to_the_anchor)
{
    Built bar = support::bar(1, 1, 3);
    const std::size_t foot = cell_at(bar, {0.5, 0.5, 0.5});
    std::vector<Constraint> constraints = holding(bar, {foot});
    constraints[foot].insets[kHighZ] = 0.3;
    // A crooked piece of material has its anchor off the middle of its box.
    bar.cells.cells[foot].anchor.z() = 0.72;
    const RegionPoints points(bar.cells, constraints);
    EXPECT_EQ(points.of(foot).size(), 12u);
    EXPECT_TRUE(points_from(points, bar, foot, {0.5, 0.5, 1}).empty());
}

} // namespace cellwarp::core
