// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/geometry_output.h"

#include <gtest/gtest.h>

namespace cellwarp
{

TEST(GeometryOutput, tells_what_a_file_that_is_written_anew_leaves_out)
{
    using Names = std::vector<std::string>;
    Geometry geometry;
    geometry.attributes = {"texture coordinates", "normals", "colours", "groups"};
    EXPECT_EQ(left_out("a.obj", geometry), (Names{"texture coordinates", "colours"}));
    EXPECT_EQ(left_out("a.ply", geometry),
              (Names{"texture coordinates", "colours", "groups"}));
    EXPECT_EQ(left_out("a.stl", geometry), geometry.attributes);
    EXPECT_EQ(left_out("a.off", geometry), geometry.attributes);
    EXPECT_EQ(left_out("a.glb", geometry),
              (Names{"texture coordinates", "normals", "groups"}));
    EXPECT_EQ(left_out("a.pc2", geometry), Names{});
    geometry.attributes.clear();
    EXPECT_EQ(left_out("a.glb", geometry), Names{});
}

} // namespace cellwarp
