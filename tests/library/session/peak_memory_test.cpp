// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/peak_memory.h"

#include <cstddef>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/sanitized.h"

namespace cellwarp::core
{

namespace
{

/// Takes 64 MB, writes them, and gives them back.
void take_memory()
{
    const std::vector<char> bytes(std::size_t(64) << 20, 1);
    EXPECT_EQ(bytes.back(), 1);
}

} // namespace

TEST(PeakMemory, is_of_what_comes_after_its_start)
{
    if (support::kIsSanitized)
        GTEST_SKIP() << "a sanitizer keeps memory that was given back";
    const PeakMemory during;
    if (!during.is_since_start())
        GTEST_SKIP() << "this system does not let a peak be measured anew";
    const double before = during.mb();
    take_memory();
    const double peak = during.mb();
    EXPECT_GT(peak, before + 50.0);
    EXPECT_LT(PeakMemory().mb(), peak - 50.0);
}

} // namespace cellwarp::core
