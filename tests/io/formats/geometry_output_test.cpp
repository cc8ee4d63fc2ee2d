// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/geometry_output.h"

#include <gtest/gtest.h>

namespace cellwarp::core
{

TEST(GeometryOutput, tells_what_a_file_that_is_written_anew_leaves_out)
{
    using Names = std::vector<std::string>;
    Geometry geometry;
    geometry.attributes = {"texture coordinates", "normals", "colours", "groups"};
    geometry.samples = {{0, 0, 0}, {1, 0, 0}};
    geometry.directions = {{0, 0, 1}, {0, 0, 1}};
    geometry.direction_samples = {0, 1};
    EXPECT_EQ(left_out("a.obj", geometry, true),
              (Names{"texture coordinates", "colours"}));
    EXPECT_EQ(left_out("a.ply", geometry, true),
              (Names{"texture coordinates", "colours", "groups"}));
    // One sample has none: then no other's is written.
    geometry.direction_samples = {0, 0};
    EXPECT_EQ(left_out("a.obj", geometry, true),
              (Names{"texture coordinates", "normals", "colours"}));
    EXPECT_EQ(left_out("a.stl", geometry, true), geometry.attributes);
    EXPECT_EQ(left_out("a.off", geometry, true), geometry.attributes);
    EXPECT_EQ(left_out("a.glb", geometry, true), Names{"normals"});
    EXPECT_EQ(left_out("a.glb", geometry, false),
              (Names{"texture coordinates", "normals"}));
    EXPECT_EQ(left_out("a.pc2", geometry, true), Names{});
    EXPECT_EQ(left_out_note("a.glb", geometry, true),
              "not in the .glb: the model's normals");
    geometry.attributes.assign(9, "f_rest");
    EXPECT_TRUE(left_out_note("a.glb", geometry, true).ends_with("f_rest and 3 more"));
    geometry.attributes.clear();
    EXPECT_EQ(left_out("a.glb", geometry, true), Names{});
    EXPECT_EQ(left_out_note("a.glb", geometry, true), "");
    // What follows from the faces is there again.
    geometry.format = "stl";
    geometry.attributes = {"normals"};
    EXPECT_EQ(left_out("a.off", geometry, true), Names{});
}

} // namespace cellwarp::core
