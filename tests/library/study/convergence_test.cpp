// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/study/convergence.h"

#include <gtest/gtest.h>

namespace cellwarp::core
{

namespace
{

constexpr int kDeepest = 3;

SweepRow row(SweepKind kind, int depth, double largest, std::size_t cells, double seconds)
{
    SweepRow made;
    made.of.kind = kind;
    made.of.depth = depth;
    made.of.reference_depth = kDeepest;
    made.of.threshold = kind == SweepKind::Adaptive ? largest : INFINITY;
    made.error = {largest, largest / 4.0};
    made.cells = cells;
    made.cell_edge = std::pow(0.5, depth);
    made.seconds.total = seconds;
    return made;
}

/// Uniform cells whose error against the truth is the cell edge to a power, as it looks
/// against a reference at the deepest level.
std::vector<SweepRow> uniform_rows(double order)
{
    const auto truth = [&](int depth) { return 0.01 * std::pow(0.5, order * depth); };
    std::vector<SweepRow> rows;
    rows.push_back(row(SweepKind::Reference, kDeepest, 0.0, 51200, 40.0));
    for (int depth = 0; depth <= kDeepest; ++depth)
    {
        rows.push_back(row(SweepKind::Uniform, depth, truth(depth) - truth(kDeepest),
                           std::size_t(100) << (3 * depth), 0.1 * std::pow(8.0, depth)));
        if (depth > 0)
            rows.back().from_coarser = Deviation{truth(depth - 1) - truth(depth),
                                                 truth(depth - 1) - truth(depth)};
    }
    return rows;
}

} // namespace

TEST(Convergence, differences_of_depths_tell_the_order_that_the_reference_hides)
{
    for (const double order : {1.0, 1.5, 2.0})
    {
        SCOPED_TRACE(order);
        const std::vector<SweepRow> rows = uniform_rows(order);
        const std::vector<Convergence> found = convergence_of(rows);
        ASSERT_EQ(found.size(), 1u);
        ASSERT_EQ(found[0].largest.of_differences.size(), 2u);
        for (const std::optional<double>& step : found[0].largest.of_differences)
            EXPECT_NEAR(step.value(), order, 1e-12);
        ASSERT_EQ(found[0].largest.steps.size(), 2u);
        EXPECT_GT(found[0].largest.steps[1].value(), order + 0.2);
        EXPECT_GT(found[0].rms.fitted.value(), order);
    }
}

TEST(Convergence, an_error_that_is_a_power_has_that_slope)
{
    std::vector<SweepRow> rows;
    for (int depth = 0; depth < kDeepest; ++depth)
        rows.push_back(
            row(SweepKind::Uniform, depth, std::pow(0.5, 1.25 * depth), 1, 1.0));
    const std::vector<Convergence> found = convergence_of(rows);
    EXPECT_NEAR(found.at(0).largest.fitted.value(), 1.25, 1e-12);
    EXPECT_NEAR(found.at(0).largest.steps.at(0).value(), 1.25, 1e-12);
    EXPECT_TRUE(found.at(0).largest.of_differences.empty());
}

TEST(Convergence, one_depth_tells_no_order)
{
    const std::vector<SweepRow> rows = {row(SweepKind::Uniform, 0, 0.01, 100, 0.1)};
    const std::vector<Convergence> found = convergence_of(rows);
    ASSERT_EQ(found.size(), 1u);
    EXPECT_FALSE(found[0].largest.fitted);
    EXPECT_TRUE(found[0].largest.steps.empty());
    EXPECT_TRUE(savings_of(rows).empty());
}

TEST(Convergence, a_saving_is_interpolated_log_over_log)
{
    std::vector<SweepRow> rows = {row(SweepKind::Uniform, 1, 2e-3, 800, 0.8)};
    rows.push_back(row(SweepKind::Adaptive, kDeepest, 4e-3, 100, 0.1));
    rows.push_back(row(SweepKind::Adaptive, kDeepest, 1e-3, 400, 0.9));
    const std::vector<Saving> found = savings_of(rows);
    ASSERT_EQ(found.size(), 1u);
    EXPECT_EQ(found[0].uniform_depth, 1);
    EXPECT_EQ(found[0].adaptive_depth, kDeepest);
    ASSERT_TRUE(found[0].largest && found[0].rms);
    EXPECT_NEAR(found[0].largest->cells, 200.0 / 800.0, 1e-12);
    EXPECT_NEAR(found[0].largest->seconds, 0.3 / 0.8, 1e-12);
    EXPECT_NEAR(found[0].rms->cells, 200.0 / 800.0, 1e-12);
    EXPECT_FALSE(found[0].largest->is_bound);
}

TEST(Convergence, what_adaptive_cells_do_not_reach_is_no_saving)
{
    std::vector<SweepRow> rows = {row(SweepKind::Uniform, 1, 2e-3, 800, 0.8)};
    rows.push_back(row(SweepKind::Adaptive, kDeepest, 4e-3, 100, 0.1));
    rows.push_back(row(SweepKind::Adaptive, kDeepest, 1e-3, 400, 0.9));
    rows.back().of.is_limited = true;
    const std::vector<Saving> found = savings_of(rows);
    ASSERT_EQ(found.size(), 1u);
    EXPECT_FALSE(found[0].largest);
    rows[2].of.is_limited = false;
    rows[2].failure = "too large";
    EXPECT_FALSE(savings_of(rows).at(0).largest);
}

TEST(Convergence, coarse_cells_that_are_good_enough_bound_the_saving)
{
    std::vector<SweepRow> rows = {row(SweepKind::Uniform, 2, 2e-3, 6400, 6.4)};
    rows.push_back(row(SweepKind::Adaptive, kDeepest, 1e-3, 100, 0.1));
    const std::vector<Saving> found = savings_of(rows);
    ASSERT_TRUE(found.at(0).largest);
    EXPECT_TRUE(found[0].largest->is_bound);
    EXPECT_NEAR(found[0].largest->cells, 1.0 / 64.0, 1e-12);
}

TEST(Convergence, more_cells_for_a_larger_error_do_not_count)
{
    std::vector<SweepRow> rows = {row(SweepKind::Uniform, 2, 1e-3, 6400, 6.4)};
    rows.push_back(row(SweepKind::Adaptive, kDeepest, 4e-3, 100, 0.1));
    rows.push_back(row(SweepKind::Adaptive, kDeepest, 5e-3, 200, 0.2));
    rows.push_back(row(SweepKind::Adaptive, kDeepest, 1e-3, 400, 0.4));
    EXPECT_NEAR(savings_of(rows).at(0).largest.value().cells, 400.0 / 6400.0, 1e-12);
}

TEST(Convergence, the_fall_to_the_references_own_cells_is_not_interpolated)
{
    for (const double error : {0.0, 1e-9, 3.9e-4})
    {
        SCOPED_TRACE(error);
        std::vector<SweepRow> rows = {row(SweepKind::Uniform, 2, 2e-3, 6400, 6.4)};
        rows.push_back(row(SweepKind::Adaptive, kDeepest, 4e-3, 100, 0.1));
        rows.push_back(row(SweepKind::Adaptive, kDeepest, error, 51200, 50.0));
        EXPECT_NEAR(savings_of(rows).at(0).largest.value().cells, 8.0, 1e-12);
    }
}

} // namespace cellwarp::core
