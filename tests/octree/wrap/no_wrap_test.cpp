// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/wrap/wrap.h"

#include <gtest/gtest.h>

#include "tests/support/pot.h"

namespace cellwarp::core
{

TEST(NoWrap, is_empty_around_all_points)
{
    EXPECT_TRUE(alpha_wrap(support::pot().samples, 0.2, 0.03).triangles.empty());
}

} // namespace cellwarp::core
