// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/region_set.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "octree/base/index.h"
#include "tests/support/rest_model.h"
#include "tests/support/shapes.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::error_of;
using support::RestModel;

namespace
{

/// A bar of 1 x 1 x 4 in cubes of \p across along it, so many voxels each.
RestModel bar(const std::string& statements, int across = 16, int voxels = 10, int n = 8)
{
    CellSettings cells;
    cells.across = across;
    cells.gap = std::sqrt(6.0) * 4.0 / across / voxels / std::sqrt(18.0);
    return {support::box_shape({0, 0, 0}, {1, 1, 4}, n), statements, cells};
}

Eigen::Vector3d centre_in_model(const RestModel& model, std::size_t voxel)
{
    const VoxelGrid& grid = model.rest->material.grid;
    return model.rest->frame.to_model(grid.centre(grid.coordinates(voxel)));
}

double volume_of(const VoxelGrid& grid, std::size_t voxel)
{
    const Eigen::Vector3i v = grid.coordinates(voxel);
    return grid.extent(0, v.x()) * grid.extent(1, v.y()) * grid.extent(2, v.z());
}

/// The number of a sample of the model.
std::uint32_t sample_at(const RestModel& model, const Eigen::Vector3d& place)
{
    const std::vector<Eigen::Vector3d>& samples = model.geometry.samples;
    const auto found = std::find_if(samples.begin(), samples.end(),
                                    [&](const Eigen::Vector3d& x)
                                    { return (x - place).norm() < 1e-12; });
    EXPECT_NE(found, samples.end());
    return static_cast<std::uint32_t>(found - samples.begin());
}

} // namespace

TEST(RegionSet, holds_the_voxels_whose_centres_lie_in_its_boxes_each_once)
{
    const RestModel model = bar("handle a box 0.1 0.1 0.1 0.4 0.4 0.4\n"
                                "handle a box 0.2 0.1 0.1 0.4 0.4 0.6\n"
                                "fixed b sphere 0.5 0.5 4 0.3\n");
    const RegionSet& regions = *model.regions;
    ASSERT_EQ(regions.size(), 2u);
    EXPECT_EQ(regions.voxels(0).num_voxels(), 12u * 12u * 12u + 8u * 12u * 8u);
    for (std::size_t r = 0; r < 2; ++r)
    {
        std::size_t num_held = 0;
        for (std::size_t voxel = 0; voxel < model.rest->material.grid.size(); ++voxel)
        {
            const bool is_held = regions[r].holds(centre_in_model(model, voxel));
            ASSERT_EQ(regions.voxels(r).has(voxel), is_held);
            num_held += is_held;
        }
        EXPECT_EQ(regions.voxels(r).num_voxels(), num_held);
    }
}

TEST(RegionSet, holds_the_voxels_of_every_selector_one_by_one)
{
    // Far from the origin, and with three different sides.
    const Shape shape = support::box_shape({100, -50, 30}, {101, -48, 34}, 6);
    CellSettings cells;
    cells.across = 8;
    cells.gap = 0.02;
    for (const std::string selector :
         {"box 0.1 0.2 0.3 0.7 0.6 0.9", "sphere 0.5 0.4 0.6 0.2",
          "capsule 0.1 0.1 0.1 0.9 0.9 0.7 0.06", "halfspace 0.3 0.5 0.8 0.9",
          "halfspace -1 0.2 0 -0.3", "all"})
        for (const bool is_relative : {true, false})
        {
            std::string text = selector;
            if (!is_relative && selector.starts_with("box"))
                text = "box 100.2 -49.7 31 100.9 -48.1 33.3";
            else if (!is_relative && selector.starts_with("sphere"))
                text = "sphere 100.4 -49 32 0.83";
            else if (!is_relative && selector.starts_with("half"))
                text = "halfspace 1 -1 0.5 165.7";
            else if (!is_relative)
                continue;
            const RestModel model(
                shape,
                (is_relative ? "units relative\nhandle a " : "handle a ") + text + "\n",
                cells);
            const VoxelGrid& grid = model.rest->material.grid;
            std::size_t num_held = 0;
            for (std::size_t voxel = 0; voxel < grid.size(); ++voxel)
            {
                const bool is_held =
                    grid.material()[voxel] &&
                    (*model.regions)[0].holds(centre_in_model(model, voxel));
                num_held += is_held;
                ASSERT_EQ(model.regions->voxels(0).has(voxel), is_held) << text;
            }
            EXPECT_GT(num_held, 50u) << text;
        }
}

TEST(RegionSet, listed_samples_stand_for_the_voxels_that_are_nearest_to_them)
{
    const RestModel model = bar("handle a indices 0 3 7 11\n", 16, 4, 1);
    const std::vector<Eigen::Vector3d>& samples = model.geometry.samples;
    ASSERT_EQ(samples.size(), 20u);
    std::size_t num_clear = 0, num_held = 0;
    for (std::size_t voxel = 0; voxel < model.rest->material.grid.size(); ++voxel)
    {
        const Eigen::Vector3d x = centre_in_model(model, voxel);
        double listed = INFINITY, other = INFINITY;
        for (std::uint32_t i = 0; i < samples.size(); ++i)
        {
            const bool is_listed = i == 0 || i == 3 || i == 7 || i == 11;
            double& least = is_listed ? listed : other;
            least = std::min(least, (samples[i] - x).norm());
        }
        if (std::abs(listed - other) < 1e-3)
            continue;
        ++num_clear;
        num_held += listed < other;
        EXPECT_EQ(model.regions->voxels(0).has(voxel), listed < other);
    }
    EXPECT_GT(num_clear, 15000u);
    EXPECT_GT(num_held, 2000u);
}

TEST(RegionSet, ranges_that_overlap_list_each_sample_once)
{
    // Spread one by one they would take 12 million numbers.
    std::string statements = "handle a indices 7";
    for (int k = 0; k < 20000; ++k)
        statements += " 0-600";
    const RestModel model = bar(statements + "\nhandle a indices 3 610 605\n");
    const std::vector<std::uint32_t>& listed = (*model.regions)[0].listed;
    ASSERT_EQ(listed.size(), 603u);
    for (std::uint32_t i = 0; i <= 600; ++i)
        EXPECT_EQ(listed[i], i);
    EXPECT_EQ(listed[601], 605u);
    EXPECT_EQ(listed[602], 610u);
    EXPECT_LT(listed.capacity(), 3000u);
}

TEST(RegionSet, a_listed_region_with_a_shape_holds_the_voxels_of_both)
{
    const RestModel one = bar("handle a indices 0\n", 16, 4, 1);
    const RestModel both = bar("handle a indices 0\n"
                               "handle a box 0.1 0.1 3.1 0.9 0.9 3.9\n",
                               16, 4, 1);
    for (std::size_t voxel = 0; voxel < one.rest->material.grid.size(); ++voxel)
        EXPECT_EQ(
            both.regions->voxels(0).has(voxel),
            one.regions->voxels(0).has(voxel) ||
                both.regions->regions()[0].shapes[0].holds(centre_in_model(both, voxel)));
}

TEST(RegionSet, a_region_with_samples_but_no_voxel_centre_counts_as_their_list)
{
    // Thinner than a voxel, on the end face.
    const RestModel thin = bar("handle a box -1 -1 3.999 2 2 4.001\n");
    EXPECT_EQ(thin.regions->regions()[0].samples.size(), 81u);
    EXPECT_GE(thin.regions->voxels(0).num_voxels(), 1600u);
    thin.regions->voxels(0).for_each(
        [&](std::size_t voxel) { EXPECT_GT(centre_in_model(thin, voxel).z(), 3.5); });
}

TEST(RegionSet, a_voxel_just_between_samples_belongs_to_the_first)
{
    // Five voxels across: the middle ones are as far from the left as from the right.
    const RestModel all = bar("handle a indices 0\n", 4, 5, 1);
    const std::uint32_t left = sample_at(all, {0, 0, 2}),
                        right = sample_at(all, {1, 0, 2});
    const std::uint32_t first = std::min(left, right), last = std::max(left, right);
    for (const std::uint32_t listed : {first, last})
    {
        const RestModel model =
            bar("handle a indices " + std::to_string(listed) + "\n", 4, 5, 1);
        std::size_t num_between = 0;
        model.regions->voxels(0).for_each(
            [&](std::size_t voxel)
            { num_between += std::abs(centre_in_model(model, voxel).x() - 0.5) < 1e-9; });
        EXPECT_EQ(num_between > 0, listed == first);
        EXPECT_FALSE(model.regions->voxels(0).empty());
    }
}

TEST(RegionSet, shares_of_all_cells_add_up_to_the_volume_of_the_region)
{
    const RestModel model = bar("handle a box 0.1 0.1 0.1 0.43 0.4 0.61\n"
                                "fixed b indices 0 1 2 30 50\n"
                                "stiff c halfspace 1 0 0 0.4 10\n");
    for (const int depth : {0, 1})
    {
        CellSettings cells = model.settings;
        cells.max_depth = cells.min_depth = depth;
        const auto rest = build_rest_shape(model.geometry, model.geometry.samples, cells);
        const RegionSet regions(rest, model.regions->regions(), "h.handles");
        const Body body = build_body(rest, cells);
        const std::vector<RegionShares> shares = regions.shares(body);
        ASSERT_EQ(shares.size(), 3u);
        for (std::size_t r = 0; r < 3; ++r)
        {
            double wanted = 0.0, sum = 0.0;
            regions.voxels(r).for_each(
                [&](std::size_t voxel)
                { wanted += volume_of(rest->material.grid, voxel); });
            int last = -1;
            for (const auto& [cell, share] : shares[r].cells)
            {
                EXPECT_GT(cell, last);
                EXPECT_GT(share, 0.0);
                EXPECT_LE(share, 1.0 + 1e-12);
                EXPECT_LE(share, shares[r].largest());
                sum += share * body.cells.cells[idx(cell)].volume;
                last = cell;
            }
            EXPECT_GT(wanted, 0.0);
            EXPECT_NEAR(sum, wanted, 1e-9 * wanted);
        }
    }
}

TEST(RegionSet, a_box_over_half_of_a_cell_has_a_share_of_a_half)
{
    const RestModel model = bar("handle a box -1 -1 -1 2 2 0.375\n");
    const Body body = build_body(model.rest, model.settings);
    const RegionShares shares = model.regions->shares(body)[0];
    ASSERT_EQ(shares.cells.size(), 32u);
    double sum = 0.0;
    for (const auto& [cell, share] : shares.cells)
    {
        EXPECT_NEAR(std::min(std::abs(share - 1.0), std::abs(share - 0.5)), 0.0, 1e-9);
        sum += share;
    }
    EXPECT_NEAR(sum, 16.0 * 1.5, 1e-9);
    EXPECT_NEAR(shares.largest(), 1.0, 1e-12);
}

TEST(RegionSet, has_the_box_of_its_samples_or_else_of_its_voxel_centres)
{
    const RestModel model = bar("fixed foot box -1 -1 -1 2 2 0.3\n"
                                "handle core box 0.3 0.3 1 0.7 0.7 2\n");
    const auto expect_box =
        [&](std::size_t region, const Eigen::Vector3d& low, const Eigen::Vector3d& high)
    {
        const WorkFrame& frame = model.rest->frame;
        EXPECT_LT((frame.to_model(model.regions->box(region).low) - low).norm(), 1e-9);
        EXPECT_LT((frame.to_model(model.regions->box(region).high) - high).norm(), 1e-9);
    };
    expect_box(0, {0, 0, 0}, {1, 1, 0.25});
    ASSERT_TRUE((*model.regions)[1].samples.empty());
    expect_box(1, {0.3125, 0.3125, 1.0125}, {0.6875, 0.6875, 1.9875});
}

TEST(RegionSet, samples_of_two_regions_overlap_but_not_those_of_stiff_ones)
{
    const RestModel model = bar("stiff bone box -1 -1 -1 2 2 5 10\n"
                                "fixed foot box -1 -1 -1 2 2 0.5\n"
                                "handle head box -1 -1 0.5 2 2 5\n");
    const std::vector<RegionSet::Overlap>& overlaps = model.regions->overlaps();
    EXPECT_EQ(overlaps.size(), 32u);
    for (const RegionSet::Overlap& overlap : overlaps)
    {
        EXPECT_EQ(overlap.a, 1u);
        EXPECT_EQ(overlap.b, 2u);
        EXPECT_NEAR(model.geometry.samples[overlap.sample].z(), 0.5, 1e-12);
    }
    EXPECT_TRUE(bar("fixed foot box -1 -1 -1 2 2 0.4\nhandle head box -1 -1 0.5 2 2 5\n")
                    .regions->overlaps()
                    .empty());
}

TEST(RegionSet, a_region_that_selects_nothing_is_told_how_far_it_missed)
{
    const std::string message = error_of(Fault::Malformed,
                                         []
                                         {
                                             bar("fixed foot box -1 -1 -1 2 2 0.5\n"
                                                 "handle far box 0 0 4.25 1 1 5\n");
                                         });
    EXPECT_TRUE(contains(message, "h.handles:3")) << message;
    EXPECT_TRUE(contains(message, "far")) << message;
    EXPECT_TRUE(contains(message, "selects nothing of the model")) << message;
    EXPECT_TRUE(contains(message, "is 0.25 away, at ")) << message;
    EXPECT_TRUE(contains(message, " 4.000, relative ")) << message;
    EXPECT_TRUE(contains(
        error_of(Fault::Malformed, [] { bar("handle far sphere 0.5 0.5 6 0.5\n"); }),
        "is 1.5 away"));
}

} // namespace cellwarp::core
