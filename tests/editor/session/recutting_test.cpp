// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/session/recutting.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "solver/refinement.h"
#include "tests/support/rest_model.h"
#include "tests/support/throws.h"

namespace cellwarp
{

using support::contains;
using support::error_of;
using support::RestModel;

namespace
{

const std::string kEnds = "fixed foot box -1 -1 -1 2 2 0.500001\n"
                          "handle head box -1 -1 3.499999 2 2 5\n";

/// A bar of 1 x 1 x 4 in 2 x 2 x 8 cells.
CellSettings coarse(int max_depth, double threshold)
{
    CellSettings cells;
    cells.across = 8;
    cells.max_depth = max_depth;
    cells.threshold = threshold;
    cells.gap = 0.05;
    return cells;
}

RestModel bar(const CellSettings& cells, const std::string& statements = kEnds)
{
    return {support::box_shape({0, 0, 0}, {1, 1, 4}, 2), statements, cells};
}

Recutting recutting(const RestModel& model)
{
    return {model.rest, model.regions, model.settings, {}};
}

/// An error of one for the cells that \p where picks by their places in the model.
template <class Where>
std::function<std::vector<double>(const Rig&)> marked(Where where)
{
    return [where](const Rig& rig)
    {
        std::vector<double> errors;
        for (const Cell& cell : rig.body().cells.cells)
            errors.push_back(where(rig.rest().frame.to_model(cell.centre)));
        return errors;
    };
}

const std::vector<Leaf>& leaves(const Rig& rig)
{
    return rig.body().octree.leaves();
}

/// The second region turned about the bar's middle, the others at rest.
std::vector<Motion> second_turned(const Rig& rig, double angle)
{
    std::vector<Motion> motions(rig.regions().size());
    const Eigen::Vector3d c = rig.rest().frame.to_work({0.5, 0.5, 2.5});
    motions[1].R = rotation_about(Eigen::Vector3d(1, 0.3, 0).normalized(), angle);
    motions[1].t = c - motions[1].R * c;
    return motions;
}

void solve(Rig& rig)
{
    SolveOptions tight;
    tight.gradient_tolerance = 1e-9;
    EXPECT_EQ(rig.solve(tight).stop, Stop::Converged);
}

void bend(Rig& rig, double angle)
{
    rig.move_regions(second_turned(rig, angle));
    rig.carry_others();
    solve(rig);
}

/// Of the cells in each leaf.
std::vector<double> errors_of_leaves(const Rig& rig)
{
    const std::vector<double> errors =
        cell_errors(rig.body().cells, rig.glue(), rig.constraints(), rig.poses());
    std::vector<double> worst(leaves(rig).size(), 0.0);
    for (std::size_t c = 0; c < errors.size(); ++c)
    {
        double& of_leaf = worst[static_cast<std::size_t>(rig.body().cells.cells[c].leaf)];
        of_leaf = std::max(of_leaf, errors[c]);
    }
    return worst;
}

int level_at(const Rig& rig, const Eigen::Vector3d& model_place)
{
    const VoxelGrid& grid = rig.rest().material.grid;
    const Eigen::Vector3i voxel = grid.locate(rig.rest().frame.to_work(model_place));
    return leaves(rig)[static_cast<std::size_t>(
                           rig.body().octree.find(voxel / grid.shape().voxels_per_leaf))]
        .level;
}

int deepest(const Rig& rig)
{
    int level = 0;
    for (const Leaf& leaf : leaves(rig))
        level = std::max(level, leaf.level);
    return level;
}

} // namespace

TEST(Recutting, splits_the_cells_above_the_threshold_and_no_others)
{
    const RestModel model = bar(coarse(2, 1e-3));
    Recutting cells = recutting(model);
    Rig rig = cells.first();
    ASSERT_EQ(leaves(rig).size(), 32u);
    EXPECT_FALSE(cells.finer(rig));
    EXPECT_FALSE(cells.coarser(rig));
    bend(rig, 0.8);
    const double threshold = 1e-3 * rig.rest().frame.diagonal();
    const std::vector<double> errors = errors_of_leaves(rig);
    const std::size_t num_above = static_cast<std::size_t>(std::count_if(
        errors.begin(), errors.end(), [&](double error) { return error > threshold; }));
    ASSERT_GT(num_above, 0u);
    ASSERT_LT(num_above, 32u);
    const std::optional<Rig> next = cells.finer(rig);
    ASSERT_TRUE(next);
    EXPECT_EQ(leaves(*next).size(), 32u + 7u * num_above);
    for (std::size_t leaf = 0; leaf < errors.size(); ++leaf)
    {
        const int now = next->body().octree.find(leaves(rig)[leaf].corner);
        EXPECT_EQ(leaves(*next)[static_cast<std::size_t>(now)].level,
                  errors[leaf] > threshold ? 1 : 0);
    }
}

TEST(Recutting, hands_on_the_motions_and_holds_the_regions_where_they_are)
{
    const RestModel model = bar(coarse(2, 1e-3));
    Recutting cells = recutting(model);
    Rig rig = cells.first();
    bend(rig, 0.8);
    const std::optional<Rig> next = cells.finer(rig);
    ASSERT_TRUE(next);
    ASSERT_EQ(next->motions().size(), 2u);
    for (std::size_t r = 0; r < 2; ++r)
    {
        EXPECT_EQ(next->motions()[r].R, rig.motions()[r].R);
        EXPECT_EQ(next->motions()[r].t, rig.motions()[r].t);
    }
    for (std::size_t c = 0; c < next->poses().size(); ++c)
        if (const int region = next->region_of_cell()[c]; region >= 0)
        {
            const Pose wanted = carried(rig.motions()[static_cast<std::size_t>(region)],
                                        next->body().cells.cells[c].centre);
            EXPECT_LT((next->poses()[c].p - wanted.p).norm(), 1e-15);
            EXPECT_EQ(next->poses()[c].R, wanted.R);
        }
}

TEST(Recutting, goes_no_deeper_than_it_may)
{
    CellSettings settings = coarse(2, 0.1);
    settings.errors = marked([](const Eigen::Vector3d&) { return 1.0; });
    const RestModel model = bar(settings);
    Recutting cells = recutting(model);
    Rig rig = cells.first();
    for (const std::size_t wanted : {256u, 2048u})
    {
        std::optional<Rig> next = cells.finer(rig);
        ASSERT_TRUE(next);
        rig = std::move(*next);
        EXPECT_EQ(leaves(rig).size(), wanted);
    }
    EXPECT_FALSE(cells.finer(rig));
    EXPECT_FALSE(cells.coarser(rig));
    EXPECT_TRUE(cells.take_warnings().empty());
}

TEST(Recutting, keeps_the_balance_wherever_it_splits_and_merges)
{
    Eigen::Vector3d centre;
    CellSettings settings = coarse(3, 0.1);
    settings.errors = [&](const Rig& rig)
    {
        const Eigen::Vector3d x = rig.rest().frame.to_work(centre);
        std::vector<double> errors;
        for (const Cell& cell : rig.body().cells.cells)
            errors.push_back((x - cell.box_centre).lpNorm<Eigen::Infinity>() <
                             0.5 * cell.edge);
        return errors;
    };
    const RestModel model = bar(settings);
    Recutting cells = recutting(model);
    Rig rig = cells.first();
    std::mt19937 rng(1);
    for (int trial = 0; trial < 6; ++trial)
    {
        SCOPED_TRACE(trial);
        centre = {support::random_number(rng, 0, 1), support::random_number(rng, 0, 1),
                  support::random_number(rng, 0, 4)};
        for (const auto change : {&Recutting::coarser, &Recutting::finer})
            while (std::optional<Rig> next = (cells.*change)(rig))
            {
                rig = std::move(*next);
                EXPECT_TRUE(rig.body().octree.is_balanced());
            }
        EXPECT_EQ(level_at(rig, centre), 3);
        EXPECT_EQ(level_at(rig, {0.5, 0.5, centre.z() > 2 ? 0.1 : 3.9}), 0);
    }
}

TEST(Recutting, merges_back_to_the_first_cells_where_nothing_is_wrong)
{
    const RestModel model = bar(coarse(2, 2e-4));
    Recutting cells = recutting(model);
    Rig rig = cells.first();
    const std::vector<Leaf> start = leaves(rig);
    bend(rig, 0.8);
    while (std::optional<Rig> next = cells.finer(rig))
    {
        rig = std::move(*next);
        solve(rig);
    }
    EXPECT_EQ(deepest(rig), 2);
    bend(rig, 0.0);
    int num_merges = 0;
    while (std::optional<Rig> next = cells.coarser(rig))
    {
        EXPECT_LT(leaves(*next).size(), leaves(rig).size());
        rig = std::move(*next);
        ++num_merges;
    }
    EXPECT_EQ(num_merges, 2);
    EXPECT_EQ(leaves(rig), start);
    for (std::size_t c = 0; c < rig.poses().size(); ++c)
        EXPECT_LT((rig.poses()[c].p - rig.body().cells.cells[c].centre).norm(),
                  1e-6 * rig.rest().frame.diagonal());
}

TEST(Recutting, does_not_merge_again_what_it_split_for_the_same_state)
{
    for (const double angle : {0.4, 0.8, 1.2})
    {
        SCOPED_TRACE(angle);
        const RestModel model = bar(coarse(3, 1e-3));
        Recutting cells = recutting(model);
        Rig rig = cells.first();
        bend(rig, angle);
        while (std::optional<Rig> next = cells.finer(rig))
        {
            rig = std::move(*next);
            solve(rig);
            std::optional<Rig> merged = cells.coarser(rig);
            EXPECT_FALSE(merged);
        }
        EXPECT_GT(deepest(rig), 0);
    }
}

TEST(Recutting, never_merges_beyond_the_least_depth)
{
    CellSettings settings = coarse(2, 1e-3);
    settings.min_depth = 1;
    const RestModel model = bar(settings);
    Recutting cells = recutting(model);
    const Rig rig = cells.first();
    EXPECT_EQ(leaves(rig).size(), 256u);
    EXPECT_FALSE(cells.coarser(rig));
}

TEST(Recutting, parts_regions_that_move_differently_down_to_the_deepest_cells)
{
    // Both lie in the cells between 1.5 and 2.
    const RestModel model =
        bar(coarse(2, 1e9), "fixed left box -1 -1 -1 2 2 1.800001\n"
                            "handle right box -1 -1 1.859999 2 2 5\n");
    Recutting cells = recutting(model);
    Rig rig = cells.first();
    EXPECT_FALSE(cells.parted(rig, std::vector<Motion>(2)));
    std::vector<Motion> both = second_turned(rig, 0.3);
    both[0] = both[1];
    EXPECT_FALSE(cells.parted(rig, both));
    const std::vector<Motion> apart = second_turned(rig, 0.3);
    int num_splits = 0;
    while (std::optional<Rig> next = cells.parted(rig, apart))
    {
        rig = std::move(*next);
        ++num_splits;
    }
    EXPECT_EQ(num_splits, 2);
    EXPECT_EQ(level_at(rig, {0.5, 0.5, 1.82}), 2);
    EXPECT_EQ(level_at(rig, {0.5, 0.5, 1.6}), 1);
    EXPECT_EQ(level_at(rig, {0.5, 0.5, 0.1}), 0);
    EXPECT_EQ(level_at(rig, {0.5, 0.5, 3.9}), 0);
    EXPECT_TRUE(rig.body().octree.is_balanced());
    // Merged is all but what is contested, for as long as they move apart.
    CellSettings adaptive = model.settings;
    adaptive.errors = marked([](const Eigen::Vector3d&) { return 0.0; });
    adaptive.threshold = 1e-3;
    Recutting merging(model.rest, model.regions, adaptive, {});
    merging.first();
    rig.move_regions(apart);
    std::optional<Rig> merged;
    while ((merged = merging.coarser(rig)))
        rig = std::move(*merged);
    EXPECT_EQ(level_at(rig, {0.5, 0.5, 1.82}), 2);
    rig.set_state(rig.poses(), std::vector<Motion>(2));
    while ((merged = merging.coarser(rig)))
        rig = std::move(*merged);
    EXPECT_EQ(leaves(rig).size(), 32u);
}

TEST(Recutting, stiff_regions_part_nothing)
{
    const RestModel model =
        bar(coarse(2, INFINITY), "stiff bone box -1 -1 1.6 2 2 1.75 10\n"
                                 "handle right box -1 -1 1.8 2 2 5\n");
    Recutting cells = recutting(model);
    const Rig rig = cells.first();
    EXPECT_FALSE(cells.parted(rig, second_turned(rig, 0.3)));
}

TEST(Recutting, splits_first_where_a_region_would_have_no_cell_of_its_own)
{
    // The small region lies within one cell of the foot.
    const std::string statements = "fixed foot box -1 -1 -1 2 2 0.500001\n"
                                   "handle bud box 0.0 0.0 0.0 0.13 0.13 0.13\n";
    const RestModel shallow = bar(coarse(0, 1e-3), statements);
    Recutting single = recutting(shallow);
    EXPECT_TRUE(contains(error_of(Fault::Unsolvable, [&] { single.first(); }),
                         "has no cell of its own"));
    double error_everywhere = 1.0;
    CellSettings settings = coarse(3, 1e-3);
    settings.errors = marked([&](const Eigen::Vector3d&) { return error_everywhere; });
    const RestModel model = bar(settings, "fixed foot box 0.13 -1 -1 2 2 0.500001\n"
                                          "fixed foot box -1 0.13 -1 2 2 0.500001\n"
                                          "fixed foot box -1 -1 0.13 2 2 0.500001\n"
                                          "handle bud box 0.0 0.0 0.0 0.13 0.13 0.13\n");
    Recutting cells = recutting(model);
    Rig rig = cells.first();
    EXPECT_GT(level_at(rig, {0.05, 0.05, 0.05}), 0);
    EXPECT_EQ(level_at(rig, {0.9, 0.9, 0.1}), 0);
    EXPECT_EQ(level_at(rig, {0.9, 0.9, 3.9}), 0);
    EXPECT_TRUE(rig.body().octree.is_balanced());
    EXPECT_NE(std::find(rig.region_of_cell().begin(), rig.region_of_cell().end(), 1),
              rig.region_of_cell().end());
    // These are the coarsest cells from now on.
    const std::vector<Leaf> start = leaves(rig);
    std::optional<Rig> next = cells.finer(rig);
    ASSERT_TRUE(next);
    rig = std::move(*next);
    EXPECT_GT(leaves(rig).size(), start.size());
    error_everywhere = 0.0;
    while ((next = cells.coarser(rig)))
        rig = std::move(*next);
    EXPECT_EQ(leaves(rig), start);
}

TEST(Recutting, over_the_budget_splits_the_worst_first_and_says_so_once)
{
    CellSettings settings = coarse(1, 0.1);
    settings.max_cells = 32 + 3 * 7 + 5;
    settings.errors = marked([](const Eigen::Vector3d& x)
                             { return 10.0 - x.z() - 0.1 * x.x() - 0.01 * x.y(); });
    const RestModel model = bar(settings);
    Recutting cells = recutting(model);
    Rig rig = cells.first();
    std::optional<Rig> next = cells.finer(rig);
    ASSERT_TRUE(next);
    EXPECT_EQ(leaves(*next).size(), 32u + 3u * 7u);
    // The worst are at the foot, in this order.
    EXPECT_EQ(level_at(*next, {0.1, 0.1, 0.1}), 1);
    EXPECT_EQ(level_at(*next, {0.1, 0.9, 0.1}), 1);
    EXPECT_EQ(level_at(*next, {0.9, 0.1, 0.1}), 1);
    EXPECT_EQ(level_at(*next, {0.9, 0.9, 0.1}), 0);
    const std::vector<std::string> warnings = cells.take_warnings();
    ASSERT_EQ(warnings.size(), 1u);
    EXPECT_TRUE(contains(warnings[0], "58")) << warnings[0];
    EXPECT_FALSE(cells.finer(*next));
    EXPECT_TRUE(cells.take_warnings().empty());
}

TEST(Recutting, never_has_more_cells_than_it_may)
{
    for (const std::int64_t most : {32, 40, 100, 300, 1000})
    {
        SCOPED_TRACE(most);
        CellSettings settings = coarse(3, 1e-4);
        settings.max_cells = most;
        const RestModel model = bar(settings);
        Recutting cells = recutting(model);
        Rig rig = cells.first();
        bend(rig, 0.5);
        while (std::optional<Rig> next = cells.finer(rig))
        {
            rig = std::move(*next);
            solve(rig);
            EXPECT_LE(static_cast<std::int64_t>(leaves(rig).size()), most);
            EXPECT_TRUE(rig.body().octree.is_balanced());
        }
        EXPECT_EQ(cells.take_warnings().size(), 1u);
        if (most >= 40)
        {
            EXPECT_GT(static_cast<std::int64_t>(leaves(rig).size()), most - 60);
        }
    }
}

TEST(Recutting, regions_get_no_more_cells_than_there_may_be)
{
    CellSettings settings = coarse(3, 1e-3);
    settings.max_cells = 35;
    const RestModel model = bar(settings, "fixed foot box 0.13 -1 -1 2 2 0.500001\n"
                                          "fixed foot box -1 0.13 -1 2 2 0.500001\n"
                                          "fixed foot box -1 -1 0.13 2 2 0.500001\n"
                                          "handle bud box 0.0 0.0 0.0 0.13 0.13 0.13\n");
    Recutting cells = recutting(model);
    EXPECT_TRUE(contains(error_of(Fault::Unsolvable, [&] { cells.first(); }),
                         "has no cell of its own"));
}

TEST(Recutting, a_coarsest_grid_over_the_budget_is_refused)
{
    CellSettings settings = coarse(2, 1e-3);
    settings.max_cells = 31;
    const RestModel model = bar(settings);
    Recutting cells = recutting(model);
    EXPECT_TRUE(contains(error_of(Fault::Budget, [&] { cells.first(); }),
                         "the coarsest grid has 32 cells"));
}

TEST(Recutting, is_adaptive_only_with_a_threshold_and_a_depth)
{
    EXPECT_TRUE(recutting(bar(coarse(2, 1e-3))).is_adaptive());
    EXPECT_FALSE(recutting(bar(coarse(2, INFINITY))).is_adaptive());
    EXPECT_FALSE(recutting(bar(coarse(0, 1e-3))).is_adaptive());
    CellSettings uniform = coarse(2, 1e-3);
    uniform.min_depth = 2;
    EXPECT_FALSE(recutting(bar(uniform)).is_adaptive());
}

} // namespace cellwarp
