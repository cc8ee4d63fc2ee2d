// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/cell_refiner.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "octree/base/index.h"
#include "solver/cells/refinement.h"
#include "tests/support/random.h"
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

const std::string kEnds = "fixed foot box -1 -1 -1 2 2 0.500001\n"
                          "handle head box -1 -1 3.499999 2 2 5\n";

/// A bud in a corner of the foot, smaller than a cell.
const std::string kBudInFoot = "fixed foot box 0.13 -1 -1 2 2 0.500001\n"
                               "fixed foot box -1 0.13 -1 2 2 0.500001\n"
                               "fixed foot box -1 -1 0.13 2 2 0.500001\n"
                               "handle bud box 0.0 0.0 0.0 0.13 0.13 0.13\n";

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

CellRefiner refiner(const RestModel& model)
{
    return {model.rest, model.regions, model.settings, {}};
}

/// An error of one for the cells that \p where picks by their places in the model.
template <class Where>
std::function<std::vector<double>(const CellSystem&)> marked(Where where)
{
    return [where](const CellSystem& system)
    {
        std::vector<double> errors;
        for (const Cell& cell : system.body().cells.cells)
            errors.push_back(where(system.rest().frame.to_model(cell.centre)));
        return errors;
    };
}

const std::vector<Leaf>& leaves(const CellSystem& system)
{
    return system.body().octree.leaves();
}

/// The second region turned about the bar's middle, the others at rest.
std::vector<Motion> second_turned(const CellSystem& system, double angle)
{
    std::vector<Motion> motions(system.regions().size());
    const Eigen::Vector3d c = system.rest().frame.to_work({0.5, 0.5, 2.5});
    motions[1].R = rotation_about(Eigen::Vector3d(1, 0.3, 0).normalized(), angle);
    motions[1].t = c - motions[1].R * c;
    return motions;
}

void solve(CellSystem& system)
{
    SolveOptions tight;
    tight.gradient_tolerance = 1e-9;
    EXPECT_EQ(system.solve(tight).stop, Stop::Converged);
}

void bend(CellSystem& system, double angle)
{
    system.move_regions(second_turned(system, angle));
    system.carry_others();
    solve(system);
}

/// Of the cells in each leaf.
std::vector<double> errors_of_leaves(const CellSystem& system)
{
    const std::vector<double> errors = cell_errors(system.body().cells, system.glue(),
                                                   system.constraints(), system.poses());
    std::vector<double> worst(leaves(system).size(), 0.0);
    for (std::size_t c = 0; c < errors.size(); ++c)
    {
        double& of_leaf = worst[idx(system.body().cells.cells[c].leaf)];
        of_leaf = std::max(of_leaf, errors[c]);
    }
    return worst;
}

int level_at(const CellSystem& system, const Eigen::Vector3d& model_place)
{
    const VoxelGrid& grid = system.rest().material.grid;
    const Eigen::Vector3i voxel = grid.locate(system.rest().frame.to_work(model_place));
    return leaves(system)[idx(system.body().octree.find(voxel /
                                                        grid.shape().voxels_per_leaf))]
        .level;
}

int deepest(const CellSystem& system)
{
    int level = 0;
    for (const Leaf& leaf : leaves(system))
        level = std::max(level, leaf.level);
    return level;
}

} // namespace

TEST(CellRefiner, splits_the_cells_above_the_threshold_and_no_others)
{
    const RestModel model = bar(coarse(2, 1e-3));
    CellRefiner cells = refiner(model);
    CellSystem system = cells.first();
    ASSERT_EQ(leaves(system).size(), 32u);
    EXPECT_FALSE(cells.finer(system));
    EXPECT_FALSE(cells.coarser(system));
    bend(system, 0.8);
    const double threshold = 1e-3 * system.rest().frame.diagonal();
    const std::vector<double> errors = errors_of_leaves(system);
    const std::size_t num_above = static_cast<std::size_t>(std::count_if(
        errors.begin(), errors.end(), [&](double error) { return error > threshold; }));
    ASSERT_GT(num_above, 0u);
    ASSERT_LT(num_above, 32u);
    const std::optional<CellSystem> next = cells.finer(system);
    ASSERT_TRUE(next);
    EXPECT_EQ(leaves(*next).size(), 32u + 7u * num_above);
    for (std::size_t leaf = 0; leaf < errors.size(); ++leaf)
    {
        const LeafNumber now = next->body().octree.find(leaves(system)[leaf].corner);
        EXPECT_EQ(leaves(*next)[idx(now)].level, errors[leaf] > threshold ? 1 : 0);
    }
}

TEST(CellRefiner, hands_on_the_motions_and_holds_the_regions_where_they_are)
{
    const RestModel model = bar(coarse(2, 1e-3));
    CellRefiner cells = refiner(model);
    CellSystem system = cells.first();
    bend(system, 0.8);
    const std::optional<CellSystem> next = cells.finer(system);
    ASSERT_TRUE(next);
    ASSERT_EQ(next->motions().size(), 2u);
    for (std::size_t r = 0; r < 2; ++r)
    {
        EXPECT_EQ(next->motions()[r].R, system.motions()[r].R);
        EXPECT_EQ(next->motions()[r].t, system.motions()[r].t);
    }
    for (std::size_t c = 0; c < next->poses().size(); ++c)
        if (const int region = next->region_of_cell()[c]; region >= 0)
        {
            const Pose wanted = carried(system.motions()[idx(region)],
                                        next->body().cells.cells[c].centre);
            EXPECT_LT((next->poses()[c].p - wanted.p).norm(), 1e-15);
            EXPECT_EQ(next->poses()[c].R, wanted.R);
        }
}

TEST(CellRefiner, goes_no_deeper_than_it_may)
{
    CellSettings settings = coarse(2, 0.1);
    // Each round splits once: the errors are less than four thresholds.
    settings.errors = [](const CellSystem& now) {
        return std::vector<double>(now.poses().size(), 0.3 * now.rest().frame.diagonal());
    };
    const RestModel model = bar(settings);
    CellRefiner cells = refiner(model);
    CellSystem system = cells.first();
    for (const std::size_t wanted : {256u, 2048u})
    {
        std::optional<CellSystem> next = cells.finer(system);
        ASSERT_TRUE(next);
        system = std::move(*next);
        EXPECT_EQ(leaves(system).size(), wanted);
    }
    EXPECT_FALSE(cells.finer(system));
    EXPECT_FALSE(cells.coarser(system));
    EXPECT_TRUE(cells.take_warnings().empty());
}

TEST(CellRefiner, keeps_the_balance_wherever_it_splits_and_merges)
{
    Eigen::Vector3d centre;
    CellSettings settings = coarse(3, 0.1);
    settings.errors = [&](const CellSystem& system)
    {
        const Eigen::Vector3d x = system.rest().frame.to_work(centre);
        std::vector<double> errors;
        for (const Cell& cell : system.body().cells.cells)
            errors.push_back((x - cell.box_centre).lpNorm<Eigen::Infinity>() <
                             0.5 * cell.edge);
        return errors;
    };
    const RestModel model = bar(settings);
    CellRefiner cells = refiner(model);
    CellSystem system = cells.first();
    std::mt19937 rng(1);
    for (int trial = 0; trial < 6; ++trial)
    {
        SCOPED_TRACE(trial);
        centre = {support::random_number(rng, 0, 1), support::random_number(rng, 0, 1),
                  support::random_number(rng, 0, 4)};
        for (const auto change : {&CellRefiner::coarser, &CellRefiner::finer})
            while (std::optional<CellSystem> next = (cells.*change)(system))
            {
                system = std::move(*next);
                EXPECT_TRUE(system.body().octree.is_balanced());
            }
        EXPECT_EQ(level_at(system, centre), 3);
        EXPECT_EQ(level_at(system, {0.5, 0.5, centre.z() > 2 ? 0.1 : 3.9}), 0);
    }
}

TEST(CellRefiner, merges_back_to_the_first_cells_where_nothing_is_wrong)
{
    const RestModel model = bar(coarse(2, 2e-4));
    CellRefiner cells = refiner(model);
    CellSystem system = cells.first();
    const std::vector<Leaf> start = leaves(system);
    bend(system, 0.8);
    while (std::optional<CellSystem> next = cells.finer(system))
    {
        system = std::move(*next);
        solve(system);
    }
    EXPECT_EQ(deepest(system), 2);
    bend(system, 0.0);
    int num_merges = 0;
    while (std::optional<CellSystem> next = cells.coarser(system))
    {
        EXPECT_LT(leaves(*next).size(), leaves(system).size());
        system = std::move(*next);
        ++num_merges;
    }
    EXPECT_EQ(num_merges, 2);
    EXPECT_EQ(leaves(system), start);
    for (std::size_t c = 0; c < system.poses().size(); ++c)
        EXPECT_LT((system.poses()[c].p - system.body().cells.cells[c].centre).norm(),
                  1e-6 * system.rest().frame.diagonal());
}

TEST(CellRefiner, does_not_merge_again_what_it_split_for_the_same_state)
{
    for (const double angle : {0.4, 0.8, 1.2})
    {
        SCOPED_TRACE(angle);
        const RestModel model = bar(coarse(3, 1e-3));
        CellRefiner cells = refiner(model);
        CellSystem system = cells.first();
        bend(system, angle);
        while (std::optional<CellSystem> next = cells.finer(system))
        {
            system = std::move(*next);
            solve(system);
            std::optional<CellSystem> merged = cells.coarser(system);
            EXPECT_FALSE(merged);
        }
        EXPECT_GT(deepest(system), 0);
    }
}

TEST(CellRefiner, never_merges_beyond_the_least_depth)
{
    CellSettings settings = coarse(2, 1e-3);
    settings.min_depth = 1;
    const RestModel model = bar(settings);
    CellRefiner cells = refiner(model);
    const CellSystem system = cells.first();
    EXPECT_EQ(leaves(system).size(), 256u);
    EXPECT_FALSE(cells.coarser(system));
}

TEST(CellRefiner, has_larger_bodies_down_to_few_cells)
{
    CellSettings fine = coarse(0, INFINITY);
    EXPECT_TRUE(refiner(bar(fine)).larger_bodies(refiner(bar(fine)).first(), {}).empty());
    fine.across = 64; // 16 x 16 x 64
    const RestModel model = bar(fine);
    CellRefiner cells = refiner(model);
    CellSystem system = cells.first();
    const std::vector<Motion> apart = second_turned(system, 0.3);
    const auto larger = cells.larger_bodies(system, apart);
    ASSERT_EQ(larger.size(), 2u);
    EXPECT_EQ(larger[0]->cells.size(), 2048u);
    EXPECT_EQ(larger[1]->cells.size(), 256u);
    double volume = 0.0;
    for (const Cell& cell : larger[1]->cells.cells)
        volume += cell.volume;
    const double diagonal = model.rest->frame.diagonal();
    EXPECT_NEAR(volume, 4.0 * std::pow(diagonal / std::sqrt(18.0), 3), 1e-9);
    // At rest the poses are handed on as they are, and a turn of all comes back.
    CellSystem few = cells.handed_to(larger[1], system);
    few.move_regions(std::vector<Motion>(2, apart[1]));
    few.carry_others();
    cells.hand_on(few, system);
    for (std::size_t c = 0; c < system.poses().size(); ++c)
    {
        const Cell& cell = system.body().cells.cells[c];
        EXPECT_LT((system.poses()[c].R - apart[1].R).norm(), 1e-12);
        EXPECT_LT((system.poses()[c].p - apart[1].R * cell.centre - apart[1].t).norm(),
                  1e-12);
    }
}

TEST(CellRefiner, splits_a_few_larger_cells_where_errors_are_largest)
{
    CellSettings fine = coarse(0, INFINITY);
    fine.across = 64; // 16 x 16 x 64
    fine.errors =
        marked([](const Eigen::Vector3d& x) { return 5.0 - std::abs(x.z() - 2.0); });
    const RestModel model = bar(fine);
    CellRefiner cells = refiner(model);
    const CellSystem system = cells.first();
    const CellSystem larger = cells.handed_to(
        cells.larger_bodies(system, std::vector<Motion>(2)).front(), system);
    const auto partly = cells.partly_split(larger, system.body());
    const std::size_t before = larger.body().cells.size(), after = partly->cells.size();
    EXPECT_EQ((after - before) % 7, 0u);
    EXPECT_GT(after, before + before / 4); // each becomes eight
    EXPECT_LT(after, before + before / 2);
    double farthest = 0.0, nearest = INFINITY; // from the middle, of split and of others
    for (const Cell& cell : partly->cells.cells)
    {
        const Eigen::Vector3d x = model.rest->frame.to_model(cell.centre);
        const double away = std::abs(x.z() - 2.0);
        const int level = partly->octree[cell.leaf].level;
        EXPECT_LE(level, 0);
        if (level == 0)
            farthest = std::max(farthest, away);
        else
            nearest = std::min(nearest, away);
    }
    // Cells of one layer have one error: there some are split and others are not.
    EXPECT_LT(farthest, nearest + 4.0 / 32.0);
    // Where cells are no larger than the target's there is nothing to split.
    EXPECT_EQ(cells.partly_split(system, system.body())->octree.leaves(), leaves(system));
}

TEST(CellRefiner, leaves_no_larger_cell_to_regions_that_move_apart)
{
    CellSettings fine = coarse(0, INFINITY);
    fine.across = 64;
    // They end in the middle of what would be one larger cell, of edge 1/4.
    const RestModel model = bar(fine, "fixed left box -1 -1 -1 2 2 1.812501\n"
                                      "handle right box -1 -1 1.874999 2 2 5\n");
    CellRefiner cells = refiner(model);
    CellSystem system = cells.first();
    const auto apart = cells.larger_bodies(system, second_turned(system, 0.3));
    const auto together = cells.larger_bodies(system, std::vector<Motion>(2));
    ASSERT_FALSE(apart.empty());
    ASSERT_FALSE(together.empty());
    EXPECT_GT(apart.back()->cells.size(), together.back()->cells.size());
    for (const std::shared_ptr<const Body>& body : apart)
    {
        const std::vector<RegionShares> shares = model.regions->shares(*body);
        std::vector<int> holders(body->cells.size(), 0);
        for (const RegionShares& of : shares)
            for (const auto& [cell, share] : of.cells)
                ++holders[idx(cell)];
        for (std::size_t c = 0; c < holders.size(); ++c)
        {
            const bool is_larger = body->octree[body->cells.cells[c].leaf].level < 0;
            EXPECT_LE(holders[c], is_larger ? 1 : 2) << c;
        }
    }
}

TEST(CellRefiner, parts_regions_that_move_differently_down_to_the_deepest_cells)
{
    // Both lie in the cells between 1.5 and 2.
    const RestModel model =
        bar(coarse(2, 1e9), "fixed left box -1 -1 -1 2 2 1.800001\n"
                            "handle right box -1 -1 1.859999 2 2 5\n");
    CellRefiner cells = refiner(model);
    CellSystem system = cells.first();
    EXPECT_FALSE(cells.parted(system, std::vector<Motion>(2)));
    std::vector<Motion> both = second_turned(system, 0.3);
    both[0] = both[1];
    EXPECT_FALSE(cells.parted(system, both));
    const std::vector<Motion> apart = second_turned(system, 0.3);
    int num_splits = 0;
    while (std::optional<CellSystem> next = cells.parted(system, apart))
    {
        system = std::move(*next);
        ++num_splits;
    }
    EXPECT_EQ(num_splits, 2);
    EXPECT_EQ(level_at(system, {0.5, 0.5, 1.82}), 2);
    EXPECT_EQ(level_at(system, {0.5, 0.5, 1.6}), 1);
    EXPECT_EQ(level_at(system, {0.5, 0.5, 0.1}), 0);
    EXPECT_EQ(level_at(system, {0.5, 0.5, 3.9}), 0);
    EXPECT_TRUE(system.body().octree.is_balanced());
    // Merged is all but what is contested, for as long as they move apart.
    CellSettings adaptive = model.settings;
    adaptive.errors = marked([](const Eigen::Vector3d&) { return 0.0; });
    adaptive.threshold = 1e-3;
    CellRefiner merging(model.rest, model.regions, adaptive, {});
    merging.first();
    system.move_regions(apart);
    std::optional<CellSystem> merged;
    while ((merged = merging.coarser(system)))
        system = std::move(*merged);
    EXPECT_EQ(level_at(system, {0.5, 0.5, 1.82}), 2);
    system.move_regions(std::vector<Motion>(2));
    while ((merged = merging.coarser(system)))
        system = std::move(*merged);
    EXPECT_EQ(leaves(system).size(), 32u);
}

TEST(CellRefiner, stiff_regions_part_nothing)
{
    const RestModel model =
        bar(coarse(2, INFINITY), "stiff bone box -1 -1 1.6 2 2 1.75 10\n"
                                 "handle right box -1 -1 1.8 2 2 5\n");
    CellRefiner cells = refiner(model);
    const CellSystem system = cells.first();
    EXPECT_FALSE(cells.parted(system, second_turned(system, 0.3)));
}

TEST(CellRefiner, splits_first_where_a_region_would_have_no_cell_of_its_own)
{
    // The small region lies within one cell of the foot.
    const std::string statements = "fixed foot box -1 -1 -1 2 2 0.500001\n"
                                   "handle bud box 0.0 0.0 0.0 0.13 0.13 0.13\n";
    const RestModel shallow = bar(coarse(0, 1e-3), statements);
    CellRefiner single = refiner(shallow);
    EXPECT_TRUE(contains(error_of(Fault::Unsolvable, [&] { single.first(); }),
                         "has no cell of its own"));
    double error_everywhere = 1.0;
    CellSettings settings = coarse(3, 1e-3);
    settings.errors = marked([&](const Eigen::Vector3d&) { return error_everywhere; });
    const RestModel model = bar(settings, kBudInFoot);
    CellRefiner cells = refiner(model);
    CellSystem system = cells.first();
    EXPECT_GT(level_at(system, {0.05, 0.05, 0.05}), 0);
    EXPECT_EQ(level_at(system, {0.9, 0.9, 0.1}), 0);
    EXPECT_EQ(level_at(system, {0.9, 0.9, 3.9}), 0);
    EXPECT_TRUE(system.body().octree.is_balanced());
    EXPECT_NE(
        std::find(system.region_of_cell().begin(), system.region_of_cell().end(), 1),
        system.region_of_cell().end());
    // These are the coarsest cells from now on.
    const std::vector<Leaf> start = leaves(system);
    std::optional<CellSystem> next = cells.finer(system);
    ASSERT_TRUE(next);
    system = std::move(*next);
    EXPECT_GT(leaves(system).size(), start.size());
    error_everywhere = 0.0;
    while ((next = cells.coarser(system)))
        system = std::move(*next);
    EXPECT_EQ(leaves(system), start);
}

TEST(CellRefiner, merges_the_rest_where_some_leaves_must_stay_for_a_region)
{
    double error_everywhere = 1.0;
    CellSettings settings = coarse(2, 1e-3);
    settings.errors = marked([&](const Eigen::Vector3d&) { return error_everywhere; });
    // All of the bud's cells are split: merged, its cell would be the foot's.
    const RestModel model = bar(settings, kBudInFoot);
    CellRefiner cells = refiner(model);
    CellSystem system = cells.first();
    while (std::optional<CellSystem> next = cells.finer(system))
        system = std::move(*next);
    EXPECT_EQ(level_at(system, {0.9, 0.9, 3.9}), 2);
    error_everywhere = 0.0;
    while (std::optional<CellSystem> next = cells.coarser(system))
        system = std::move(*next);
    EXPECT_EQ(level_at(system, {0.9, 0.9, 3.9}), 0);
    EXPECT_NE(
        std::find(system.region_of_cell().begin(), system.region_of_cell().end(), 1),
        system.region_of_cell().end());
}

TEST(CellRefiner, splits_twice_at_once_where_one_split_would_not_do)
{
    CellSettings settings = coarse(3, 0.01);
    settings.errors = [](const CellSystem& now)
    {
        std::vector<double> errors;
        for (const Cell& cell : now.body().cells.cells)
        {
            const double z = now.rest().frame.to_model(cell.centre).z();
            errors.push_back((z > 2.0   ? 0.0
                              : z < 1.0 ? 0.045
                                        : 0.03) *
                             now.rest().frame.diagonal());
        }
        return errors;
    };
    const RestModel model = bar(settings);
    CellRefiner cells = refiner(model);
    const CellSystem system = cells.first();
    const std::optional<CellSystem> finer = cells.finer(system);
    ASSERT_TRUE(finer);
    EXPECT_EQ(level_at(*finer, {0.1, 0.1, 0.1}), 2);
    EXPECT_EQ(level_at(*finer, {0.9, 0.1, 1.9}), 1);
    EXPECT_EQ(level_at(*finer, {0.9, 0.1, 3.9}), 0);
    EXPECT_TRUE(finer->body().octree.is_balanced());
}

TEST(CellRefiner, over_the_budget_splits_the_worst_first_and_says_so_once)
{
    CellSettings settings = coarse(1, 0.1);
    settings.max_cells = 32 + 3 * 7 + 5;
    settings.errors = marked([](const Eigen::Vector3d& x)
                             { return 10.0 - x.z() - 0.1 * x.x() - 0.01 * x.y(); });
    const RestModel model = bar(settings);
    CellRefiner cells = refiner(model);
    CellSystem system = cells.first();
    std::optional<CellSystem> next = cells.finer(system);
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

TEST(CellRefiner, never_has_more_cells_than_it_may)
{
    for (const std::int64_t most : {32, 40, 100, 300, 1000})
    {
        SCOPED_TRACE(most);
        CellSettings settings = coarse(3, 1e-4);
        settings.max_cells = most;
        const RestModel model = bar(settings);
        CellRefiner cells = refiner(model);
        CellSystem system = cells.first();
        bend(system, 0.5);
        while (std::optional<CellSystem> next = cells.finer(system))
        {
            system = std::move(*next);
            solve(system);
            EXPECT_LE(static_cast<std::int64_t>(leaves(system).size()), most);
            EXPECT_TRUE(system.body().octree.is_balanced());
        }
        EXPECT_EQ(cells.take_warnings().size(), 1u);
        if (most >= 40)
        {
            EXPECT_GT(static_cast<std::int64_t>(leaves(system).size()), most - 60);
        }
    }
}

TEST(CellRefiner, regions_get_no_more_cells_than_there_may_be)
{
    CellSettings settings = coarse(3, 1e-3);
    settings.max_cells = 35;
    const RestModel model = bar(settings, kBudInFoot);
    CellRefiner cells = refiner(model);
    EXPECT_TRUE(contains(error_of(Fault::Unsolvable, [&] { cells.first(); }),
                         "has no cell of its own"));
}

TEST(CellRefiner, a_coarsest_grid_over_the_budget_is_refused)
{
    CellSettings settings = coarse(2, 1e-3);
    settings.max_cells = 31;
    const RestModel model = bar(settings);
    CellRefiner cells = refiner(model);
    EXPECT_TRUE(contains(error_of(Fault::Budget, [&] { cells.first(); }),
                         "the coarsest grid has 32 cells"));
}

TEST(CellRefiner, is_adaptive_only_with_a_threshold_and_a_depth)
{
    EXPECT_TRUE(refiner(bar(coarse(2, 1e-3))).is_adaptive());
    EXPECT_FALSE(refiner(bar(coarse(2, INFINITY))).is_adaptive());
    EXPECT_FALSE(refiner(bar(coarse(0, 1e-3))).is_adaptive());
    CellSettings uniform = coarse(2, 1e-3);
    uniform.min_depth = 2;
    EXPECT_FALSE(refiner(bar(uniform)).is_adaptive());
}

} // namespace cellwarp::core
