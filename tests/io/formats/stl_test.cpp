// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/stl.h"

#include <limits>

#include <gtest/gtest.h>

#include "io/formats/geometry.h"
#include "io/formats/geometry_file.h"
#include "io/formats/stored_number.h"
#include "tests/support/parts.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::error_of;

namespace
{

std::string refused(const std::string& bytes)
{
    return error_of(Fault::Malformed, [&] { scan_geometry("x.stl", bytes); });
}

const std::string kFacet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
                           "vertex 0 1.50 0\nendloop\nendfacet\n";

std::string binary(std::uint32_t count, int facets, const std::string& head = "binary")
{
    std::string bytes = head;
    bytes.resize(80, ' ');
    store(count, Scalar::UInt32, false, bytes);
    for (int f = 0; f < facets; ++f)
    {
        for (const double v :
             {0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.5})
            store(v, Scalar::Float32, false, bytes);
        bytes += "at";
    }
    return bytes;
}

} // namespace

TEST(Stl, reads_ascii_of_any_case_with_several_solids)
{
    const GeometryFile file = scan_geometry(
        "x.stl",
        "solid facet of endsolid\r\n" + kFacet +
            "endsolid\nSOLID\nFACET NORMAL 0 0 0\n"
            "OUTER LOOP\nVERTEX 0 0 0\nVERTEX 1 0 0\nVERTEX 0 1 0\nENDLOOP\nENDFACET\n"
            "ENDSOLID\n");
    EXPECT_EQ(file.geometry.samples.size(), 6u);
    EXPECT_EQ(file.geometry.num_faces(), 2u);
    EXPECT_EQ(file.geometry.directions.size(), 1u);
    EXPECT_EQ(patched(file, {file.geometry.samples, {}}), file.bytes);
}

TEST(Stl, normals_follow_the_facets)
{
    const GeometryFile file = scan_geometry("x.stl", "solid\n" + kFacet + "endsolid\n");
    std::vector<Eigen::Vector3d> moved = file.geometry.samples;
    for (Eigen::Vector3d& x : moved)
        x = Eigen::Vector3d(x.z(), x.x(), x.y());
    EXPECT_TRUE(contains(patched(file, {moved, {}}), "facet normal 1 0 0\n"));
    EXPECT_TRUE(contains(patched(file, {moved, {}}), "vertex 0 0 1.5"));
}

TEST(Stl, reads_and_patches_binary_also_when_it_says_solid)
{
    for (const std::string head : {"binary", "solid x"})
    {
        std::string bytes = binary(2, 2, head);
        bytes[20] = '\0';
        const GeometryFile file = scan_geometry("x.stl", bytes);
        EXPECT_EQ(file.geometry.samples.size(), 6u);
        EXPECT_EQ(patched(file, {file.geometry.samples, {}}), bytes);
        std::vector<Eigen::Vector3d> moved = file.geometry.samples;
        moved[4] += Eigen::Vector3d(0.1, 0, 0);
        const std::string out = patched(file, {moved, {}});
        EXPECT_EQ(out.size(), bytes.size());
        EXPECT_EQ(scan_geometry("x.stl", out).geometry.samples[4].x(),
                  static_cast<double>(1.1f));
        EXPECT_EQ(out.substr(0, 84), bytes.substr(0, 84));
    }
}

TEST(Stl, counts_that_lie_are_refused)
{
    for (const std::uint32_t count : {0u, 1u, 3u, 4294967295u, 85899346u})
        EXPECT_TRUE(contains(refused(binary(count, 2)), "count")) << count;
    EXPECT_TRUE(contains(refused(binary(2, 2).substr(0, 83)), "the file ends here"));
    EXPECT_TRUE(contains(refused(binary(2, 2).substr(0, 150)), "count"));
    EXPECT_TRUE(contains(refused(binary(0, 0)),
                         "x.stl: count (byte 80): no vertices (0 facets)"));
    Geometry out;
    EXPECT_TRUE(
        contains(error_of(Fault::Malformed,
                          [&]
                          {
                              StlScanner("x.stl", 84 + 50 * std::uint64_t(715827883))
                                  .scan(binary(715827883u, 2), 0, false, out);
                          }),
                 "count (byte 80): got 715827883 facets, need at most 715827882"));
}

TEST(Stl, bytes_after_the_last_facet_pass_through)
{
    const std::string bytes = binary(2, 2) + "\n\n";
    const GeometryFile file = scan_geometry("x.stl", bytes);
    EXPECT_EQ(file.geometry.num_faces(), 2u);
    ASSERT_EQ(file.geometry.warnings.size(), 1u);
    EXPECT_TRUE(contains(file.geometry.warnings[0], "2 bytes after the last facet"));
    EXPECT_EQ(patched(file, {file.geometry.samples, {}}), bytes);
    // A whole facet more is none that is counted.
    EXPECT_TRUE(
        contains(refused(binary(2, 3)), "got 2 facets, need 3 for the file's size"));
    for (const std::size_t size : {1, 3, 60, 300})
        EXPECT_EQ(
            support::scanned_in_parts(StlScanner("x.stl", bytes.size()), bytes, size, 84)
                .warnings.size(),
            1u);
}

TEST(Stl, ascii_may_have_colours_comments_and_two_words_for_an_end)
{
    const std::string text =
        "solid a ; b\n; c\ncolor 1 0 0\nfacet normal -1.#IND 0 0 ; c\n// c\n outer loop\n"
        "  vertex 0 0 0\n# c\n  vertex 1 0 0 ; c\n  vertex 0 1 0\n end loop\n"
        "color 0 1 0\nend facet ; c\nend solid a\n; end\n";
    const GeometryFile file = scan_geometry("x.stl", text);
    EXPECT_EQ(file.geometry.num_faces(), 1u);
    EXPECT_EQ(file.geometry.num_bad_normals, 1u);
    EXPECT_EQ(patched(file, {file.geometry.samples, {}}), text);
    EXPECT_TRUE(
        contains(refused("solid\nend\n"), "got 'end', need facet normal|endsolid"));
}

TEST(Stl, binary_facets_must_be_there_and_finite)
{
    std::string bytes = binary(2, 2), nan;
    store(std::numeric_limits<double>::quiet_NaN(), Scalar::Float32, false, nan);
    bytes.replace(84 + 50 + 24, 4, nan);
    EXPECT_TRUE(
        contains(refused(bytes), "x.stl: facet 1 (byte 158): a corner is not finite"));
    // A file that another program cuts while it is read.
    const std::string cut = binary(2, 2).substr(0, 150);
    EXPECT_TRUE(contains(
        error_of(Fault::Malformed, [&]
                 { support::scanned_in_parts(StlScanner("x.stl", 184), cut, 50, 84); }),
        "x.stl: facet 1: the file ends here"));
    // Or one that grows.
    EXPECT_TRUE(contains(error_of(Fault::Malformed,
                                  [&]
                                  {
                                      support::scanned_in_parts(
                                          StlScanner("x.stl", 184),
                                          binary(2, 2) + std::string(50, 'x'), 500, 84);
                                  }),
                         "count (byte 80): more data than its 2 facets"));
}

TEST(Stl, ascii_must_be_complete_and_name_its_line)
{
    EXPECT_TRUE(contains(refused("solid\nendsolid\n"), "no vertices"));
    EXPECT_TRUE(contains(refused("solid\n" + kFacet), "endsolid"));
    std::string text = "solid\n" + kFacet + "endsolid\n";
    const auto with = [&](const std::string& from, const std::string& to)
    {
        std::string changed = text;
        return refused(changed.replace(changed.find(from), from.size(), to));
    };
    EXPECT_TRUE(contains(with("vertex 1 0 0\n", ""), "x.stl:6"));
    EXPECT_TRUE(contains(with("vertex 1 0 0", "vertex 1 0"), "x.stl:5: vertex"));
    EXPECT_TRUE(contains(with("vertex 1 0 0", "vertex 1 nan 0"), "not finite"));
    EXPECT_TRUE(contains(with("vertex 1 0 0", "vertex 1 0 0 0"), "x.stl:5"));
    EXPECT_TRUE(contains(with("outer loop", "inner loop"), "x.stl:3"));
    EXPECT_TRUE(contains(with("normal 0 0 1", "normal 0 0 x"), "x.stl:2: normal"));
}

TEST(Stl, normals_that_are_none_stay)
{
    const GeometryFile file = scan_geometry(
        "x.stl", "solid\nfacet normal nan 0 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
                 "vertex 0 1 0\nendloop\nendfacet\nendsolid\n");
    EXPECT_EQ(file.geometry.warnings.size(), 1u);
    std::vector<Eigen::Vector3d> moved = file.geometry.samples;
    moved[0].z() = 2;
    EXPECT_TRUE(contains(patched(file, {moved, {}}), "normal nan 0 0\n"));
}

TEST(Stl, parts_of_a_file_give_what_the_whole_gives)
{
    for (const std::string& bytes :
         {binary(3, 3), "solid x\n" + kFacet + kFacet + "endsolid"})
    {
        const Geometry whole = scan_geometry("x.stl", bytes).geometry;
        for (std::size_t size = 1; size < 200; size += 7)
        {
            const Geometry out = support::scanned_in_parts(
                StlScanner("x.stl", bytes.size()), bytes, size, 84);
            ASSERT_EQ(out.samples, whole.samples) << size;
            ASSERT_EQ(out.direction_places, whole.direction_places) << size;
        }
    }
}

} // namespace cellwarp::core
