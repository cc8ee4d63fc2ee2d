// SPDX-License-Identifier: GPL-3.0-or-later
#include <cellwarp/settings.h>

#include <cmath>
#include <limits>

#include "tests/support/interface.h"

namespace cellwarp
{

using support::contains;
using support::error_of;

namespace
{

template <class Change>
std::string error_after(Change&& change)
{
    Settings settings;
    change(settings);
    return error_of(Fault::Usage, [&] { settings.check(); });
}

} // namespace

TEST(Settings, names_the_first_value_that_is_out_of_range)
{
    const double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_NO_THROW(Settings().check());
    EXPECT_EQ(error_after([](Settings& s) { s.cells.gap = 2.0; }),
              "cells.gap: got 2, need 1e-06 to 1");
    EXPECT_TRUE(contains(error_after([&](Settings& s) { s.cells.thickness = nan; }),
                         "cells.thickness: got nan"));
    EXPECT_TRUE(contains(error_after([](Settings& s) { s.cells.max_depth = 21; }),
                         "cells.max_depth"));
    EXPECT_TRUE(
        contains(error_after([](Settings& s) { s.cells.across = -1; }), "cells.across"));
    EXPECT_TRUE(contains(error_after([](Settings& s) { s.cells.threshold = -1.0; }),
                         "cells.threshold"));
    EXPECT_TRUE(contains(error_after([](Settings& s) { s.cells.max_cells = 0; }),
                         "cells.max_cells"));
    EXPECT_TRUE(contains(error_after([](Settings& s) { s.max_iterations = 0; }),
                         "max_iterations"));
    EXPECT_TRUE(contains(error_after([&](Settings& s) { s.gradient_tolerance = nan; }),
                         "gradient_tolerance"));
    EXPECT_TRUE(
        contains(error_after([](Settings& s) { s.time_budget = -1.0; }), "time_budget"));
    EXPECT_TRUE(
        contains(error_after([](Settings& s) { s.max_memory = -1.0; }), "max_memory"));
    EXPECT_TRUE(contains(error_after([](Settings& s) { s.threads = -1; }), "threads"));
    EXPECT_TRUE(
        contains(error_after([](Settings& s) { s.frame.emplace(); }), "frame.size"));
    EXPECT_TRUE(contains(
        error_after([](Settings& s) { s.cells.fill = static_cast<Fill>(9); }), "fill"));
    Settings uniform;
    uniform.cells.threshold = INFINITY;
    uniform.max_memory = INFINITY;
    EXPECT_NO_THROW(uniform.check());
}

TEST(Settings, are_those_of_a_scene)
{
    const Settings settings = Settings::parse(R"({"cellwarp": 1, "model": "a.obj",
        "cells": {"across": 7, "fill": "closed", "flat": false, "threshold": 0.5},
        "field": {"release": "blend"}})");
    EXPECT_EQ(settings.cells.across, 7);
    EXPECT_EQ(settings.cells.fill, Fill::Closed);
    EXPECT_EQ(settings.cells.flat, false);
    EXPECT_EQ(settings.cells.threshold, 0.5);
    EXPECT_EQ(settings.field, FieldKind::Blend);
    EXPECT_TRUE(contains(error_of(Fault::Malformed,
                                  []
                                  {
                                      Settings::parse(R"({"cellwarp": 1,
                                          "model": "a.obj", "cells": {"gap": 7}})");
                                  }),
                         "cells.gap"));
}

} // namespace cellwarp
