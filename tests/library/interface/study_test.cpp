// SPDX-License-Identifier: GPL-3.0-or-later
#include <cellwarp/study.h>

#include "tests/support/interface.h"

namespace cellwarp
{

using support::Bar;
using support::bend;
using support::coarse;
using support::contains;
using support::error_of;

TEST(Sweep, measures_errors_from_the_reference)
{
    SweepSettings settings;
    settings.settings = coarse();
    settings.max_depth = 1;
    settings.thresholds = {1e-3, 1e-2};
    settings.fields = {FieldKind::Rbf};
    settings.runs = 1;
    const Sweep result = sweep(Model(Bar()), bend(), settings);
    ASSERT_EQ(result.rows.size(), 5u); // the reference, two uniform, two adaptive
    EXPECT_EQ(result.rows[0].kind, "reference");
    EXPECT_EQ(result.rows[0].error_largest, 0.0);
    EXPECT_EQ(result.rows[3].threshold, 1e-2); // the largest first
    for (const SweepRow& row : result.rows)
    {
        EXPECT_EQ(row.failure, "");
        EXPECT_EQ(row.stop, Stop::Converged);
        EXPECT_LT(row.error_largest, 0.05);
        EXPECT_GT(row.cells, 0u);
        EXPECT_GT(row.seconds, 0.0);
    }
    EXPECT_GT(result.rows[1].error_largest, result.rows[2].error_largest);
}

TEST(Sweep, refuses_settings_out_of_range)
{
    const Model model{Bar()};
    const auto error = [&](auto&& change)
    {
        SweepSettings settings;
        change(settings);
        return error_of(Fault::Usage, [&] { sweep(model, bend(), settings); });
    };
    EXPECT_TRUE(contains(error([](SweepSettings& s) { s.runs = 0; }), "runs"));
    EXPECT_TRUE(contains(error(
                             [](SweepSettings& s) {
                                 s.thresholds = {1.0, -1.0};
                             }),
                         "thresholds[1]"));
    EXPECT_TRUE(contains(error([](SweepSettings& s) { s.fields = {}; }), "fields"));
    EXPECT_TRUE(contains(error([](SweepSettings& s) { s.depths = {-1}; }), "depths"));
    EXPECT_TRUE(
        contains(error([](SweepSettings& s) { s.settings.cells.gap = 9; }), "cells.gap"));
    const std::vector<double> few(6, 1.0);
    EXPECT_TRUE(contains(error([&](SweepSettings& s) { s.against = few; }), "against"));
    error_of(Fault::Usage, [&] { sweep(model, Edit()); });
}

} // namespace cellwarp
