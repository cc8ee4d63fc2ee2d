// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/columns.h"

#include <gtest/gtest.h>

#include "io/formats/geometry.h"
#include "io/formats/geometry_file.h"
#include "tests/support/parts.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::error_of;

namespace
{

std::string refused(const std::string& name, const std::string& text)
{
    return error_of(Fault::Malformed, [&] { scan_geometry(name, text); });
}

DeformedSamples same(const Geometry& geometry)
{
    return {geometry.samples, geometry.directions};
}

} // namespace

TEST(Columns, reads_blanks_commas_and_semicolons)
{
    for (const std::string text : {"# c\n1 2 3\n4\t5\t6\r\n", "1,2,3\n4, 5, 6\n",
                                   "1;2;3\n4;5;6", "// c\n\n 1 2 3 \n4 5 6"})
    {
        const GeometryFile file = scan_geometry("x.xyz", text);
        ASSERT_EQ(file.geometry.samples.size(), 2u) << text;
        EXPECT_EQ(file.geometry.samples[1], Eigen::Vector3d(4, 5, 6));
        EXPECT_EQ(patched(file, same(file.geometry)), text);
    }
}

TEST(Columns, keeps_every_other_column)
{
    const std::string text =
        "id,\"na,me\",z,y,x,class\n7,\"a,b\",3,2,1.0,tree\n8,c,6,5,4,wall\n";
    const GeometryFile file = scan_geometry("x.csv", text);
    EXPECT_EQ(file.geometry.samples[0], Eigen::Vector3d(1, 2, 3));
    DeformedSamples patch = same(file.geometry);
    EXPECT_EQ(patched(file, patch), text);
    patch.samples[0] = {1.0, 20, 30};
    EXPECT_TRUE(contains(patched(file, patch), "7,\"a,b\",30,20,1.0,tree\n"));
    EXPECT_EQ(file.geometry.attributes.size(), 3u);
}

TEST(Columns, knows_normals_by_name_by_length_and_by_flag)
{
    EXPECT_EQ(scan_geometry("x.xyz", "0 0 0 0 0 1.0\n1 0 0 0.6 0.8 0\n")
                  .geometry.directions.size(),
              2u);
    EXPECT_TRUE(scan_geometry("x.xyz", "0 0 0 12 0 255\n").geometry.directions.empty());
    const GeometryFile named =
        scan_geometry("x.txt", "//X Y Z R G B Nx Ny Nz\n0 0 0 9 8 7 1 0 0\n");
    EXPECT_EQ(named.geometry.directions.size(), 1u);
    EXPECT_EQ(named.geometry.colours[0][1], 8);
    const GeometryFile flagged =
        scan_geometry("x.xyz", "5 1 2 3 9 8 7\n", {"time,x,y,z,r,g,b"});
    EXPECT_EQ(flagged.geometry.samples[0], Eigen::Vector3d(1, 2, 3));
    EXPECT_EQ(flagged.geometry.colours[0][2], 7);
    EXPECT_TRUE(contains(
        error_of(Fault::Usage, [] { scan_geometry("x.xyz", "1 2 3\n", {"a,b,c"}); }),
        "--columns"));
}

TEST(Columns, six_columns_hold_normals_only_if_every_point_says_so)
{
    using Names = std::vector<std::string>;
    const Names normals = {"x", "y", "z", "nx", "ny", "nz"};
    const Names others = {"x", "y", "z", "column 4", "column 5", "column 6"};
    std::string many;
    for (int i = 0; i < 999; ++i)
        many += std::to_string(i) + " 0 0 0.6 0.8 0\n";
    const auto columns_of = [](const std::string& text)
    { return scan_geometry("x.xyz", text).geometry.columns; };
    EXPECT_EQ(columns_of(many), normals);
    EXPECT_EQ(columns_of(many + "0 0 0 0.5 0.5 0.5\n"), others);
    EXPECT_EQ(columns_of(many + "0 0 0 nan nan nan\n0 0 0 0.5 0.5 0.5\n"), normals);
    EXPECT_EQ(columns_of("0 0 0 0 0 1\n" + many), others);                // blue
    EXPECT_EQ(columns_of("0 0 0 1.0 0.0 0.0\n1 0 0 .5 .5 .5\n"), others); // red and grey
    EXPECT_EQ(columns_of("0 0 0 nan nan nan\n"), others);
    EXPECT_EQ(columns_of("0 0 0 0 0 a\n"), others);
    // A part of a file is no reason to ask fewer points.
    const std::string grey = "# c\n" + many + "0 0 0 0.5 0.5 0.5\n0 0 1 1.0 0 0\n";
    for (const std::size_t size : {7, 100, 5000})
        EXPECT_TRUE(
            support::scanned_in_parts(ColumnsScanner("x.xyz", "xyz", ""), grey, size)
                .directions.empty());
    // Turned normals stay normals for those who read the file again.
    const GeometryFile file = scan_geometry("x.xyz", "1 2 3 0.6 0.8 0.0\n");
    const std::string turned = patched(file, {file.geometry.samples, {{0, 0, 1}}});
    EXPECT_EQ(turned, "1 2 3 0.0 0.0 1.0\n");
    EXPECT_EQ(columns_of(turned), normals);
}

TEST(Columns, numbers_in_quotes_are_patched_inside)
{
    const std::string text = "\"a\",\"X\",\"y\",\"z\"\n\"u,v\",\"1\",\" 2.0 \",\"3\"\n";
    const GeometryFile file = scan_geometry("x.csv", text);
    EXPECT_EQ(file.geometry.samples[0], Eigen::Vector3d(1, 2, 3));
    EXPECT_EQ(patched(file, {{{1.5, 7, -3}}, {}}),
              "\"a\",\"X\",\"y\",\"z\"\n\"u,v\",\"1.5\",\" 7 \",\"-3\"\n");
    EXPECT_EQ(scan_geometry("x.csv", "\"1\",\"2\",\"3\"\n").geometry.samples.size(), 1u);
    EXPECT_TRUE(contains(refused("x.csv", "\"1,5\",\"2\",\"3\"\n"), "x.csv:1"));
}

TEST(Columns, a_number_of_points_may_come_before_the_first)
{
    for (const std::string text : {"//X Y Z R G B\n2\n0 0 0 1 2 3\n1 0 0 4 5 6\n",
                                   "2\n0 0 0\n1 0 0\n", "//X;Y;Z\n2\n0;0;0\n1;0;0\n"})
    {
        const GeometryFile file = scan_geometry("x.txt", text);
        EXPECT_EQ(file.geometry.samples.size(), 2u);
        EXPECT_EQ(patched(file, same(file.geometry)), text);
    }
    EXPECT_TRUE(contains(refused("x.txt", "3\n0 0 0\n1 0 0\n"),
                         "x.txt:1: count: got 3 points, need 2"));
    EXPECT_TRUE(contains(refused("x.txt", "2\n3\n4\n"), "x.txt:1: point"));
    EXPECT_TRUE(contains(refused("x.txt", "0 0 0\n2\n1 0 0\n"), "x.txt:2: point"));
}

TEST(Columns, a_pts_may_hold_several_scans)
{
    const std::string text = "2\n0 0 0 9\n1 0 0 9\n1\n2 0 0 9\n";
    const GeometryFile file = scan_geometry("x.pts", text);
    EXPECT_EQ(file.geometry.samples.size(), 3u);
    EXPECT_EQ(patched(file, same(file.geometry)), text);
    EXPECT_TRUE(contains(refused("x.pts", text + "3 0 0 9\n"),
                         "x.pts:1: count: got 3 points, need 4"));
    const std::string most = "9223372036854775807\n";
    EXPECT_TRUE(contains(refused("x.pts", most + most + "3\n1 2 3\n4 5 6\n7 8 9\n"),
                         "x.pts:1: count"));
}

TEST(Columns, a_pts_starts_with_its_count)
{
    const std::string text = "2\n1 2 3 0.5 9 8 7\n4 5 6 0.5 9 8 7\n";
    const GeometryFile file = scan_geometry("x.pts", text);
    EXPECT_EQ(file.geometry.samples.size(), 2u);
    EXPECT_EQ(patched(file, same(file.geometry)), text);
    EXPECT_TRUE(contains(refused("x.pts", "3\n1 2 3\n4 5 6\n"), "x.pts:1: count"));
    EXPECT_EQ(scan_geometry("x.pts", "1 2 3\n").geometry.samples.size(), 1u);
}

TEST(Columns, refuses_what_is_no_table_of_points)
{
    EXPECT_TRUE(contains(refused("x.xyz", "0 0\n1 0\n"), "x.xyz:1: point"));
    EXPECT_TRUE(contains(refused("x.xyz", "0 0 0\n1 0\n"), "x.xyz:2: point"));
    EXPECT_TRUE(contains(refused("x.xyz", "0 0 0\n1 nan 0\n"), "x.xyz:2: column 2"));
    EXPECT_TRUE(contains(refused("x.xyz", "2\nwater\nO 0 0 0\n"), "x.xyz:1"));
    EXPECT_TRUE(contains(refused("x.xyz", "0,1 0,2 0,3\n"), "x.xyz:1"));
    EXPECT_TRUE(contains(refused("x.xyz", "0 0 0\n0 1 1e"), "x.xyz:2: column 3"));
    EXPECT_TRUE(contains(refused("x.csv", "a,b,c\n1,2,3\n"), "--columns"));
    EXPECT_TRUE(contains(refused("x.xyz", "# nothing\n"), "no vertices"));
}

TEST(Columns, an_empty_field_is_no_number)
{
    EXPECT_TRUE(contains(refused("x.xyz", "1;;1\n"), "x.xyz:1: column 2"));
    EXPECT_TRUE(contains(refused("x.csv", ",,\n"), "x.csv:1"));
}

TEST(Columns, parts_of_a_file_give_what_the_whole_gives)
{
    const std::string text = "x,y,z,n\r\n1,2,3,\"a,b\"\r\n4,5,6,c";
    const Geometry whole = scan_geometry("x.csv", text).geometry;
    for (std::size_t size = 1; size < text.size(); ++size)
    {
        const Geometry out =
            support::scanned_in_parts(ColumnsScanner("x.csv", "csv", ""), text, size);
        ASSERT_EQ(out.samples, whole.samples) << size;
        ASSERT_EQ(out.sample_places, whole.sample_places) << size;
    }
}

} // namespace cellwarp::core
