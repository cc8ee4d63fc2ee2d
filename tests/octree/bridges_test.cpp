// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/bridges.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "octree/base/index.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

/// A bar 4 x 1 x 1, and beyond it boxes one after another, at the gaps told.
Shape bar_and_boxes(const std::vector<double>& gaps)
{
    Shape shape = support::box_shape({0, 0, 0}, {4, 1, 1});
    double x = 4.0;
    for (const double gap : gaps)
    {
        x += gap;
        shape = support::joined(shape, support::box_shape({x, 0, 0}, {x + 0.5, 1, 1}));
        x += 0.5;
    }
    return shape;
}

/// The bridges where the bar alone is held; cell 0 is a part of it.
Bridges bridges_of(const support::Built& built)
{
    const std::vector<int> component = connected_components(built.cells);
    std::vector<bool> is_held(
        idx(*std::max_element(component.begin(), component.end()) + 1), false);
    is_held[0] = true;
    return find_bridges(built.material.grid, built.pieces, built.material.notches,
                        component, is_held);
}

} // namespace

TEST(Bridges, stand_on_what_is_nearest)
{
    // Sixteen cells of a block face the bar's end over a quarter.
    const support::Built built =
        support::built(bar_and_boxes({0.25}), 19, 0, Fill::Solid, 0.0625);
    const Bridges bridges = bridges_of(built);
    ASSERT_EQ(bridges.components.size(), 1u);
    EXPECT_EQ(bridges.components[0].to, 0);
    const double voxel = built.material.grid.shape().voxel();
    double area = 0.0;
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    for (const Bridge& bridge : bridges.all)
    {
        EXPECT_NE(bridge.a, bridge.b);
        EXPECT_NEAR(bridge.length, 0.25, 2.0 * voxel);
        EXPECT_NEAR(bridge.centre.x(), 4.125, 1.5 * voxel);
        area += bridge.area;
        middle += bridge.area * bridge.centre;
        // As large as the spots that it stands on.
        EXPECT_GT(bridge.moment.trace(), voxel * voxel / 4 - 1e-12);
    }
    EXPECT_NEAR(area, 1.0, 0.6); // two more layers count
    middle /= area;
    EXPECT_NEAR(middle.y(), 0.5, 0.1 * voxel);
    EXPECT_NEAR(middle.z(), 0.5, 0.1 * voxel);
}

TEST(Bridges, form_a_tree_from_what_is_held_outwards)
{
    const support::Built built = support::built(bar_and_boxes({0.25, 0.4, 0.2}), 36);
    const Bridges bridges = bridges_of(built);
    ASSERT_EQ(bridges.components.size(), 3u);
    for (int k = 0; k < 3; ++k)
    {
        EXPECT_EQ(bridges.components[idx(k)].component, k + 1);
        EXPECT_EQ(bridges.components[idx(k)].to, k);
        EXPECT_LT(bridges.components[idx(k)].first, bridges.components[idx(k)].end);
    }
    EXPECT_EQ(bridges.components[2].end, static_cast<int>(bridges.all.size()));
}

TEST(Bridges, of_equally_near_ones_the_first_is_taken)
{
    // A block in the middle between two bars.
    Shape shape = support::joined(support::box_shape({0, 0, 0}, {1, 1, 1}),
                                  support::box_shape({1.5, 0, 0}, {2, 1, 1}));
    shape = support::joined(shape, support::box_shape({2.5, 0, 0}, {3.5, 1, 1}));
    const support::Built built = support::built(shape, 14);
    const std::vector<int> component = connected_components(built.cells);
    ASSERT_EQ(*std::max_element(component.begin(), component.end()), 2);
    const int middle = component[idx(built.pieces.at(
        built.material.grid, built.material.grid.locate({1.75, 0.5, 0.5})))];
    std::vector<bool> is_held(3, true);
    is_held[idx(middle)] = false;
    const Bridges bridges = find_bridges(built.material.grid, built.pieces,
                                         built.material.notches, component, is_held);
    ASSERT_EQ(bridges.components.size(), 1u);
    EXPECT_EQ(bridges.components[0].to, middle == 0 ? 1 : 0);
}

TEST(Bridges, are_the_same_whatever_the_cells)
{
    const Shape shape = bar_and_boxes({0.3});
    const support::Built coarse = support::built(shape, 12, 1, Fill::Solid, 0.05);
    const support::Built mixed = support::built_mixed(shape, 12, 1, 3, 0.05);
    const auto sum = [](const Bridges& bridges)
    {
        double area = 0.0, stiffness = 0.0;
        for (const Bridge& bridge : bridges.all)
        {
            area += bridge.area;
            stiffness += bridge.area / bridge.length;
        }
        return std::pair(area, stiffness);
    };
    const Bridges one = bridges_of(coarse), other = bridges_of(mixed);
    EXPECT_NE(one.all.size(), other.all.size());
    EXPECT_NEAR(sum(one).first, sum(other).first, 1e-12);
    EXPECT_NEAR(sum(one).second, sum(other).second, 0.05 * sum(one).second);
}

TEST(Bridges, are_none_where_nothing_or_everything_is_held)
{
    const support::Built built = support::built(bar_and_boxes({0.3}), 12);
    const std::vector<int> component = connected_components(built.cells);
    for (const bool is_held : {false, true})
        EXPECT_TRUE(find_bridges(built.material.grid, built.pieces,
                                 built.material.notches, component,
                                 std::vector<bool>(2, is_held))
                        .all.empty());
}

} // namespace cellwarp::core
