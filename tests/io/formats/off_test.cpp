// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/off.h"

#include <gtest/gtest.h>

#include "io/formats/geometry.h"
#include "io/formats/geometry_file.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::error_of;

namespace
{

std::string refused(const std::string& text)
{
    return error_of(Fault::Malformed, [&] { scan_geometry("x.off", text); });
}

} // namespace

TEST(Off, reads_headers_of_every_shape)
{
    const std::string body = "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    for (const std::string head :
         {"off\n3 1 0\n", "OFF\n3\n1\n0\n", "OFF 3\n# c\n1 0\n", "OFF\n3 1 0\n",
          "OFF 3 1 0\n", "OFF3 1 0\n", "OFF\n3 1\n", "# c\n\nOFF # c\n# d\n3 1 3\n"})
    {
        const GeometryFile file = scan_geometry("x.off", head + body);
        EXPECT_EQ(file.geometry.samples.size(), 3u) << head;
        EXPECT_EQ(file.geometry.num_faces(), 1u) << head;
        EXPECT_EQ(patched(file, {file.geometry.samples, {}}), file.bytes);
    }
}

TEST(Off, records_may_break_over_lines)
{
    const GeometryFile file =
        scan_geometry("x.off", "OFF\n4 1 0\n0 0\n0 1 0 0 1\n1 0 0 1 0\n4 0\n1 2\n3\n");
    EXPECT_EQ(file.geometry.samples[2], Eigen::Vector3d(1, 1, 0));
    EXPECT_EQ(file.geometry.face(0).size(), 4u);
    DeformedSamples patch{file.geometry.samples, {}};
    patch.samples[0].z() = 5;
    EXPECT_EQ(patched(file, patch),
              "OFF\n4 1 0\n0 0\n5 1 0 0 1\n1 0 0 1 0\n4 0\n1 2\n3\n");
}

TEST(Off, colours_and_normals_are_told_apart)
{
    const GeometryFile file = scan_geometry(
        "x.off", "CNOFF\n3 1 0\n0 0 0 0 0 1 255 0 0 255\n1 0 0 0 0 1 1 1 1\n0 1 0 0 0 1\n"
                 "3 0 1 2 0.5 0.5 0.5\n");
    EXPECT_EQ(file.geometry.directions.size(), 3u);
    DeformedSamples patch{file.geometry.samples, file.geometry.directions};
    patch.directions[0] = {1, 0, 0};
    EXPECT_TRUE(contains(patched(file, patch), "0 0 0 1 0 0 255 0 0 255\n"));
}

TEST(Off, prefixes_may_stand_in_any_order)
{
    const auto normals_of = [](const std::string& magic, const std::string& rest)
    {
        const std::string text = magic + "\n3 1 0\n0 0 0 " + rest + "\n1 0 0 " + rest +
                                 "\n0 1 0 " + rest + "\n3 0 1 2\n";
        const GeometryFile file = scan_geometry("x.off", text);
        EXPECT_EQ(file.geometry.num_faces(), 1u) << magic;
        DeformedSamples patch{file.geometry.samples, file.geometry.directions};
        EXPECT_EQ(patched(file, patch), text);
        for (Eigen::Vector3d& n : patch.directions)
            n = {0, 1, 0};
        return file.geometry.directions.empty() ? std::string() : patched(file, patch);
    };
    EXPECT_EQ(normals_of("STOFF", "0.5 0.5"), "");
    EXPECT_EQ(normals_of("CSTOFF", "255 0 0 255 0.5 0.5"), "");
    EXPECT_EQ(normals_of("STCOFF", "255 0 0 255 0.5 0.5"), "");
    EXPECT_TRUE(contains(normals_of("CNOFF", "0 0 1 255 0 0"), "0 0 0 0 1 0 255 0 0\n"));
    EXPECT_TRUE(
        contains(normals_of("STCNOFF", "0 0 1 9 0 0 .5 .5"), "0 0 0 0 1 0 9 0 0 .5 .5"));
    // MeshLab, which has the prefix N first, has normals behind colours.
    EXPECT_TRUE(
        contains(normals_of("NCOFF", "255 0 0 9 0 0 1"), "0 0 0 255 0 0 9 0 1 0\n"));
    EXPECT_TRUE(contains(normals_of("NCOFF", "255 0 0 0 0 1"), "0 0 0 255 0 0 0 1 0\n"));
    EXPECT_TRUE(contains(normals_of("NCSTOFF", "255 0 0 9 0 0 1 .5 .5"),
                         "0 0 0 255 0 0 9 0 1 0 .5 .5"));
    EXPECT_TRUE(contains(refused("NCOFF\n1 0 0\n0 0 0 1 1 0 0 1\n"),
                         "x.off:3: vertex 0: got 8 numbers on the line, need 9 or 10"));
    EXPECT_TRUE(contains(refused("NCOFF\n1 0 0\n0 0 0 1 red 0 0 0 1\n"),
                         "x.off:3: vertex 0: is no number (got 'red')"));
    EXPECT_TRUE(
        contains(refused("nOFF\n1 0 0\n0 0 0\n"), "this kind of OFF is not read"));
}

TEST(Off, faces_of_too_few_corners_are_none_and_stay)
{
    const GeometryFile file = scan_geometry(
        "x.off", "OFF\n3 4 0\n0 0 0\n1 0 0\n0 1 0\n0\n3 0 1 2\n1 2 9 9 9\n2 0 1\n");
    EXPECT_EQ(file.geometry.num_faces(), 1u);
    EXPECT_EQ(file.geometry.num_triangles(), 1u);
    DeformedSamples patch{file.geometry.samples, {}};
    EXPECT_EQ(patched(file, patch), file.bytes);
    EXPECT_TRUE(contains(refused("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n2 0 3\n"),
                         "x.off:6: face 0: vertex index is out of range"));
    EXPECT_TRUE(contains(refused("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n-1 0 3\n"),
                         "got '-1' corners, need 0 to 1000000"));
}

TEST(Off, what_old_libraries_write_for_no_number_is_no_comment)
{
    const GeometryFile file =
        scan_geometry("x.off", "NOFF\n3 1 0\n0 0 0 -1.#IND 1.#QNAN0 0\n1 0 0 0 0 1 # c\n"
                               "0 1 0 0 0 1#c\n3 0 1 2\n");
    EXPECT_EQ(file.geometry.directions.size(), 2u);
    EXPECT_EQ(file.geometry.num_bad_normals, 1u);
    EXPECT_EQ(file.geometry.warnings.size(), 1u);
}

TEST(Off, refuses_what_does_not_add_up)
{
    const std::string body = "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    EXPECT_TRUE(contains(refused("OFF\n4 1 0\n" + body), "x.off:6: face 0"));
    EXPECT_TRUE(contains(refused("OFF\n3 2 0\n" + body), "face 1"));
    EXPECT_TRUE(contains(refused("OFF\n2 1 0\n" + body), "x.off"));
    EXPECT_TRUE(contains(refused("OFF\n4000000000 1 0\n" + body), "too short"));
    EXPECT_TRUE(contains(refused("OFF\n-3 1 0\n" + body), "x.off:2"));
    EXPECT_TRUE(contains(refused("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n"),
                         "x.off:6: face 0"));
    EXPECT_TRUE(contains(refused("OFF\n3 1 0\n0 0 0\n1 0 nan\n0 1 0\n3 0 1 2\n"),
                         "x.off:4: vertex 1"));
    EXPECT_TRUE(contains(refused("OFF\n0 0 0\n"), "no vertices"));
    EXPECT_TRUE(contains(refused("OFF BINARY\n3 1 0\n"), "binary"));
    EXPECT_TRUE(contains(refused("4OFF\n3 1 0\n" + body), "x.off:1"));
    EXPECT_TRUE(contains(refused("OFF\n"), "no counts"));
    EXPECT_TRUE(contains(refused("hello\n3 1 0\n" + body),
                         "x.off:1: header: is no OFF file (got 'hello', need 'OFF')"));
    EXPECT_TRUE(contains(refused("OFF\n3\n" + body),
                         "x.off:3: header: counts are wrong (got '0'"));
    EXPECT_TRUE(contains(refused("OFF\n3 4000000000 0\n" + body),
                         "x.off:2: header: the file is too short for its faces (got "
                         "4000000000)"));
    EXPECT_TRUE(contains(refused("OFF\n3 1 0\n0 0 0\n1 x 0\n0 1 0\n3 0 1 2\n"),
                         "x.off:4: vertex 1: is no number (got 'x')"));
    EXPECT_TRUE(contains(refused("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 two\n"),
                         "x.off:6: face 0: is no index (got 'two')"));
    EXPECT_TRUE(contains(refused("COFF\n3 1 0\n0 0 0 1 1 1\n1 0 0 red\n0 1 0 1 1 1\n"
                                 "3 0 1 2\n"),
                         "x.off:4: colour: is no number (got 'red')"));
    EXPECT_TRUE(
        contains(refused("OFF\n3 1 0\n" + body + "7\n"), "more than the counted"));
}

} // namespace cellwarp::core
