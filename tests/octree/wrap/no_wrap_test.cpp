// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/wrap/wrap.h"

#include <gtest/gtest.h>

#include "tests/support/pot.h"

namespace cellwarp
{

TEST(NoWrap, leaves_a_pot_without_its_lid_a_shell)
{
    EXPECT_FALSE(has_alpha_wrap());
    Shape open = support::with_hole(support::pot(), {0, 0.8, 0}, 0.4);
    const Eigen::Vector3d size = support::to_origin({&open});
    const Material material =
        find_material(open, bounding_surface(open),
                      grid_shape(size, 16, 0, 0.006 * size.norm()), Fill::Solid);
    EXPECT_EQ(material.method, InsideMethod::None);
}

} // namespace cellwarp
