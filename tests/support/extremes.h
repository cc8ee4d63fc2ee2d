// SPDX-License-Identifier: GPL-3.0-or-later
// The extremes of sweep --stability that run in time.
#pragma once

#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/support/files.h"
#include "tests/support/program.h"

namespace cellwarp::core::support
{

/// Runs those with \p only in their names: all converge and keep their constraints.
inline void expect_stable_extremes(const std::string& only)
{
    const Folder folder;
    const Result result =
        run({"sweep", samples_folder() + "/block.json", "--stability", "-o",
             folder / only, "--only", only, "--long-steps", "500", "--json"});
    ASSERT_EQ(result.code, 0) << result.err << result.out;
    const nlohmann::json cases = nlohmann::json::parse(result.out)["cases"];
    EXPECT_GT(cases.size(), 2u); // beside the scene and the base
    for (const nlohmann::json& row : cases)
    {
        EXPECT_EQ(row["outcome"], "converged");
        if (!row["constraint"].is_null())
        {
            EXPECT_LT(row["constraint"], 1e-6);
        }
    }
}

} // namespace cellwarp::core::support
