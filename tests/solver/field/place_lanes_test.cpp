// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/field/place_lanes.h"

#include <gtest/gtest.h>

#include "tests/support/bodies.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

using support::Built;

/// Two slabs side by side, joined at one end, in cells of three sizes.
Built slabs()
{
    return support::built_mixed(
        support::joined(support::box_shape({0, 0, 0}, {8, 3, 4}, 1),
                        support::joined(support::box_shape({0, 3.5, 0}, {8, 6.5, 4}, 1),
                                        support::box_shape({0, 2.5, 0}, {1, 4, 4}, 1))),
        8, 2, 5);
}

/// Eight places of each cell, with what they get alone. \p most: cells that count at one
/// of them.
void compare(const Built& built, int& most)
{
    const ClosestCells closest(built.cells);
    PlaceInfluences influences(closest);
    std::mt19937 rng(2);
    std::vector<Influence> alone;
    most = 0;
    for (std::size_t own = 0; own < built.cells.size(); ++own)
    {
        const Cell& cell = built.cells.cells[own];
        const Eigen::Vector3d half = Eigen::Vector3d::Constant(0.5 * cell.edge);
        CellsAround around;
        around.find(closest, static_cast<int>(own), cell.box_centre - half,
                    cell.box_centre + half);
        PlaceVectors places;
        for (int l = 0; l < kPlaces; ++l) // some of them outside of the box
            places.row(l) =
                (cell.box_centre + support::random_vector(rng, 0.6 * cell.edge))
                    .transpose()
                    .array();
        const auto found = influences.find(places, around, true);
        for (int l = 0; l < kPlaces; ++l)
        {
            closest.influences(places.row(l).transpose().matrix(), static_cast<int>(own),
                               alone);
            std::size_t next = 0;
            for (const InfluenceOnPlaces& influence : found)
            {
                if (influence.weight[l] == 0.0)
                    continue;
                ASSERT_LT(next, alone.size());
                EXPECT_EQ(influence.cell, alone[next].cell);
                EXPECT_EQ(influence.weight[l], alone[next].weight);
                EXPECT_LT((influence.gradient.row(l).transpose().matrix() -
                           alone[next].gradient)
                              .norm(),
                          1e-12 / cell.edge);
                ++next;
            }
            EXPECT_EQ(next, alone.size());
            most = std::max(most, static_cast<int>(next));
        }
    }
}

} // namespace

TEST(PlaceInfluences, have_the_bits_of_those_of_each_place)
{
    int most = 0;
    compare(slabs(), most);
    EXPECT_GE(most, 8);
}

TEST(PlaceInfluences, have_the_bits_of_those_of_each_place_where_ways_are_narrow)
{
    int most = 0;
    for (const Built& built : {support::built(support::comb(), 4, 0, Fill::Solid, 0.02),
                               support::built(support::comb(), 9, 0, Fill::Solid, 0.02),
                               support::built_mixed(support::comb(), 4, 2, 1, 0.02),
                               support::built_mixed(support::hand(), 12, 2, 2, 0.02)})
    {
        compare(built, most);
        EXPECT_GE(most, 3);
    }
}

} // namespace cellwarp::core
