// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/obj.h"

#include <random>
#include <tuple>

#include <gtest/gtest.h>

#include "io/formats/geometry.h"
#include "io/formats/geometry_file.h"
#include "tests/support/parts.h"
#include "tests/support/random.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::error_of;

namespace
{

Geometry scanned(const std::string& text)
{
    return scan_geometry("x.obj", text).geometry;
}

std::string refused(const std::string& text)
{
    return error_of(Fault::Malformed, [&] { scan_geometry("x.obj", text); });
}

const std::string kTriangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";

DeformedSamples same(const Geometry& geometry)
{
    DeformedSamples patch{geometry.samples, {}};
    for (const DirectionUse& use : direction_uses(geometry))
        patch.directions.push_back(geometry.directions[use.direction]);
    return patch;
}

} // namespace

TEST(Obj, reads_positions_faces_groups_and_colours)
{
    const Geometry g =
        scanned("# a comment\no thing\ng left\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\n"
                "v 0 1 0 0 0 1\nv 1 1 0 1 1 1\nf 1 2 3\ng right\nf -3 -1 -2\n");
    ASSERT_EQ(g.samples.size(), 4u);
    EXPECT_EQ(g.samples[3], Eigen::Vector3d(1, 1, 0));
    ASSERT_EQ(g.num_faces(), 2u);
    EXPECT_EQ(g.face(1)[0], 1u);
    EXPECT_EQ(g.face(1)[1], 3u);
    EXPECT_EQ(g.colours[1], (std::array<std::uint8_t, 3>{0, 255, 0}));
    ASSERT_EQ(g.groups.size(), 4u);
    EXPECT_EQ(g.groups[0].name, "left");
    EXPECT_EQ(g.groups[1].name, "thing");
    EXPECT_EQ(g.groups[2].name, "right");
    EXPECT_EQ(g.groups[2].first_face, 1u);
}

TEST(Obj, reads_every_kind_of_corner_and_many_sided_faces)
{
    std::string text;
    for (int i = 0; i < 5000; ++i)
        text += "v " + std::to_string(i) + " 0 " + std::to_string(i * i) + "\n";
    text += "vt 0 0\nvn 0 0 1\nf 1 2/1 3//1 4/1/1\nf";
    for (int i = 1; i <= 5000; ++i)
        text += " " + std::to_string(i);
    const Geometry g = scanned(text + "\n");
    EXPECT_EQ(g.face(0).size(), 4u);
    EXPECT_EQ(g.face(1).size(), 5000u);
    EXPECT_EQ(g.num_triangles(), 2u + 4998u);
    EXPECT_EQ(g.corner_directions[1], kNone);
    EXPECT_EQ(g.corner_directions[2], 0u);
}

TEST(Obj, reads_any_line_end_byte_order_mark_and_continuation)
{
    for (const std::string end : {"\n", "\r\n", "\r"})
    {
        const std::string text = "\xef\xbb\xbf"
                                 "v 0 0 0" +
                                 end + "v 1 0 \\" + end + " 0" + end + "v 0 1 0" + end +
                                 "f 1 2 \\" + end + "3";
        const Geometry g = scanned(text);
        EXPECT_EQ(g.samples.size(), 3u);
        EXPECT_EQ(g.num_faces(), 1u);
    }
}

TEST(Obj, a_face_may_come_before_its_vertices)
{
    EXPECT_EQ(scanned("f 1 2 3\n" + kTriangle).num_faces(), 1u);
    EXPECT_TRUE(contains(refused("f 1 2 4\n" + kTriangle), "x.obj:1: face index"));
}

TEST(Obj, refuses_indices_that_cannot_be_trusted)
{
    for (const std::string index :
         {"0", "4", "-4", "4294967297", "18446744073709551617", "1.5", "1x",
          "99999999999999999999999999", "1/2/3/4", "/1", "1/x", "1//x"})
        EXPECT_TRUE(
            contains(refused(kTriangle + "f 1 2 " + index + "\n"), "x.obj:4: face index"))
            << index;
    EXPECT_TRUE(contains(refused(kTriangle + "f 1 4\n"), "x.obj:4: face index"));
}

TEST(Obj, indices_that_no_sample_needs_may_lack)
{
    // Empty ones, ones of vt that the file has not, and of vn with a warning.
    for (const std::string face : {"f 1/ 2/ 3/", "f 1// 2// 3//", "f 1/1/ 2/1/ 3/1/",
                                   "f 1/1 2/7 3/-4", "f 1/0/0 2/0/0 3/0/0"})
    {
        const GeometryFile file = scan_geometry("x.obj", kTriangle + face + "\n");
        EXPECT_EQ(file.geometry.num_faces(), 1u) << face;
        EXPECT_TRUE(file.geometry.warnings.empty()) << face;
        EXPECT_EQ(patched(file, {file.geometry.samples, {}}), file.bytes);
    }
    for (const std::string face : {"f 1//1 2//3 3//2", "f 3//1 2//-2 1//1"})
    {
        const Geometry g =
            scan_geometry("x.obj", kTriangle + "vn 0 0 1\n" + face + "\n").geometry;
        EXPECT_EQ(direction_uses(g).size(), face[2] == '1' ? 1u : 2u) << face;
        ASSERT_EQ(g.warnings.size(), 1u);
        EXPECT_TRUE(contains(g.warnings[0], face[2] == '1'
                                                ? "x.obj:5: face index: the file has no "
                                                  "normal 3 (of 1)"
                                                : "the file has no normal -2 (of 1)"));
    }
}

TEST(Obj, faces_of_too_few_corners_are_none_and_two_are_an_edge)
{
    const std::string text =
        kTriangle + "vn 0 0 1\nf\nf 2\nf 1//1 3//1\nf 1//1 2//1 3//1\nf 3\n";
    const GeometryFile file = scan_geometry("x.obj", text);
    const Geometry& g = file.geometry;
    EXPECT_EQ(g.num_faces(), 1u);
    EXPECT_EQ(g.corners, (std::vector<std::uint32_t>{0, 1, 2}));
    EXPECT_EQ(g.corner_directions, (std::vector<std::uint32_t>{0, 0, 0}));
    EXPECT_EQ(g.lines, (std::vector<std::array<std::uint32_t, 2>>{{0, 2}}));
    std::string many = kTriangle + "f";
    for (int k = 0; k < 1000001; ++k)
        many += " 1";
    EXPECT_TRUE(contains(refused(many), "x.obj:4: face: got 1000001 corners, need 0 to"));
}

TEST(Obj, normals_that_are_not_finite_stay)
{
    const std::string text = kTriangle + "vn nan nan nan\nvn 0 0 1\nvn -1.#IND 0 0\n"
                                         "f 1//1 2//2 3//3\nf 1//2 2//1 3//2\n";
    const GeometryFile file = scan_geometry("x.obj", text);
    EXPECT_EQ(direction_uses(file.geometry).size(), 3u);
    ASSERT_EQ(file.geometry.warnings.size(), 1u);
    EXPECT_TRUE(contains(file.geometry.warnings[0], "2 normals are not finite"));
    DeformedSamples patch{file.geometry.samples, {}};
    patch.directions.assign(3, Eigen::Vector3d(1, 0, 0));
    std::string moved = text;
    moved.replace(moved.find("vn 0 0 1"), 8, "vn 1 0 0");
    EXPECT_EQ(patched(file, patch), moved);
}

TEST(Obj, a_comment_is_not_continued_and_a_folder_is_none)
{
    const std::string body = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    for (const std::string line :
         {"# C:\\x\\", "mtllib C:\\x\\", "usemtl a\\", "o a\\", "g a\\"})
        for (const std::string end : {"\n", "\r\n"})
        {
            const GeometryFile file =
                scan_geometry("x.obj", line + end + body + line + end + "f 1 2 3\n");
            EXPECT_EQ(file.geometry.samples.size(), 3u) << line;
            EXPECT_EQ(file.geometry.num_faces(), 1u) << line;
        }
    EXPECT_EQ(scan_geometry("x.obj", body + "f 1 2 \\\n3 # C:\\\nf 1 2 3\n")
                  .geometry.num_faces(),
              2u);
    // A name may go on where no statement follows.
    const Geometry g = scan_geometry("x.obj", body + "g a \\\n b\nf 1 2 3\n").geometry;
    EXPECT_EQ(g.groups.size(), 2u);
    for (const std::size_t size : {1, 3, 7, 20})
        EXPECT_EQ(support::scanned_in_parts(ObjScanner("x.obj"),
                                            body + "mtllib a\\\nf 1 2 3\n# b\\\nf 1 2 3",
                                            size)
                      .num_faces(),
                  2u);
}

TEST(Obj, new_normals_stand_before_an_end_mark)
{
    const std::string text = kTriangle + "vn 0 0 1\nf 1//1 2//1 3//1\n";
    for (const char mark : {'\0', '\x1a'})
    {
        const GeometryFile file = scan_geometry("x.obj", text + mark);
        DeformedSamples patch{file.geometry.samples, {{1, 0, 0}, {0, 1, 0}, {0, 1, 0}}};
        const std::string moved = patched(file, patch);
        EXPECT_EQ(moved.substr(moved.size() - 10), std::string("vn 0 1 0\n") + mark);
        EXPECT_EQ(scan_geometry("x.obj", moved).geometry.directions.size(), 2u);
        EXPECT_TRUE(contains(refused(text + mark + mark), "x.obj"));
        EXPECT_TRUE(contains(refused(text + "v 0 0 0" + mark), "x.obj"));
        EXPECT_TRUE(contains(refused(text + mark + "\n"), "x.obj"));
    }
}

TEST(Obj, refuses_numbers_that_cannot_be_trusted)
{
    for (const std::string number :
         {"nan", "inf", "-Infinity", "1e400", "nan(0x1)", "1x", "0x1", "1,5"})
        EXPECT_TRUE(
            contains(refused("v 0 0 0\nv 0 " + number + " 0\n"), "x.obj:2: number 2"))
            << number;
    EXPECT_TRUE(contains(refused("v 0 0\n"), "x.obj:1: vertex"));
    EXPECT_TRUE(contains(refused("v 1 2 3 4 5 6 7 8 9\n"),
                         "x.obj:1: number 9: one too many (need at most 8)"));
    const Geometry g =
        scan_geometry("x.obj", "v 0 0 0 1 1 0 0 0.5\nv 1 0 0 nan 1 0\n").geometry;
    EXPECT_EQ(g.colours[0], (std::array<std::uint8_t, 3>{255, 0, 0}));
    EXPECT_EQ(g.colours[1], (std::array<std::uint8_t, 3>{200, 255, 0}));
    EXPECT_TRUE(
        contains(refused("v 0 0 0\nvn 0 1\n"), "x.obj:2: normal: got 2 numbers, need 3"));
    EXPECT_TRUE(contains(refused("v 1e200 0 0\n"), "beyond 1e150"));
}

TEST(Obj, refuses_a_line_without_end)
{
    const std::string blanks(std::size_t(17) << 20, ' ');
    EXPECT_TRUE(contains(refused(kTriangle + "f 1 2" + blanks + "3\n"),
                         "x.obj:4: the line is longer than 16 MB"));
}

TEST(Obj, names_what_a_foreign_file_looks_like)
{
    EXPECT_TRUE(contains(refused(""), "empty"));
    EXPECT_TRUE(contains(refused("# nothing\n"), "no vertices"));
    EXPECT_TRUE(contains(refused("version https://git-lfs.github.com/spec/v1\noid x\n"),
                         "git LFS pointer"));
    EXPECT_TRUE(contains(refused("<!DOCTYPE html>\n<html></html>\n"), "HTML"));
    EXPECT_TRUE(contains(refused("PK\x03\x04zip"), "ZIP"));
    EXPECT_TRUE(contains(refused(std::string("v 0 0 0\n\0\0", 10)), "NUL"));
    EXPECT_TRUE(contains(refused("v 0 0 0\n{}\n"), "x.obj:2"));
}

TEST(Obj, lines_join_their_samples_in_turn)
{
    const Geometry g =
        scanned("l 1 2\n" + kTriangle + "vt 0\nl 3/1 1 -2 # closed\nl 1 \\\n 3\n");
    ASSERT_EQ(g.lines.size(), 4u);
    EXPECT_EQ(g.lines[0], (std::array<std::uint32_t, 2>{0, 1}));
    EXPECT_EQ(g.lines[1], (std::array<std::uint32_t, 2>{2, 0}));
    EXPECT_EQ(g.lines[2], (std::array<std::uint32_t, 2>{0, 1}));
    EXPECT_EQ(g.lines[3], (std::array<std::uint32_t, 2>{0, 2}));
    EXPECT_EQ(g.num_faces(), 0u);
}

TEST(Obj, a_wrong_line_is_told_with_its_place)
{
    EXPECT_TRUE(contains(refused(kTriangle + "l 1\n"),
                         "x.obj:4: line: got 1 places, need at least 2"));
    EXPECT_TRUE(contains(refused(kTriangle + "l 1 4\n"),
                         "x.obj:4: line index: is out of range (got 4, need at most 3)"));
    EXPECT_TRUE(contains(refused(kTriangle + "l 1 -4\n"), "x.obj:4: line index"));
    EXPECT_TRUE(contains(refused(kTriangle + "l 1 2//1\n"), "x.obj:4: line index"));
    EXPECT_TRUE(contains(refused(kTriangle + "l 1 2//1\n"), "need v or v/vt"));
    EXPECT_TRUE(contains(refused(kTriangle + "l 1 b\n"), "line index: is no index"));
}

TEST(Obj, an_unknown_statement_passes_through_with_a_warning)
{
    const GeometryFile file = scan_geometry("x.obj", kTriangle + "fancy 1 2 3\n");
    ASSERT_EQ(file.geometry.warnings.size(), 1u);
    EXPECT_EQ(patched(file, same(file.geometry)), file.bytes);
}

TEST(Obj, a_patch_that_changes_nothing_keeps_every_byte)
{
    const std::string text =
        "# c\r\nv  1.50 +2e0\t3.000 0.1 0.2 0.3\nvt 0.5\nvn 0 0 1.00\n"
        "v 1 0 0\nv 0 1 0\nusemtl x\nf 1/1/1 2/1/1 3/1/1\nl 1 2\n";
    const GeometryFile file = scan_geometry("x.obj", text);
    EXPECT_EQ(patched(file, same(file.geometry)), text);
}

TEST(Obj, a_patch_replaces_only_the_numbers_that_change)
{
    const GeometryFile file = scan_geometry(
        "x.obj", "v 1.50 2 3 0.5 0.5 0.5 # c\nv 1 0 \\\n 0\nv 0 1 0\nf 1 2 3\n");
    DeformedSamples patch = same(file.geometry);
    patch.samples[0] = {1.5, -0.1, 1e-20};
    patch.samples[1].z() = 7;
    EXPECT_EQ(patched(file, patch),
              "v 1.50 -0.1 1e-20 0.5 0.5 0.5 # c\nv 1 0 \\\n 7\nv 0 1 0\nf 1 2 3\n");
}

TEST(Obj, a_normal_whose_users_part_company_is_split)
{
    const GeometryFile file = scan_geometry(
        "x.obj", kTriangle + "vn 0 0 1\nvt 0 0\nf 1/1/1 2/1/1 3/1/-1\nf 3//1 2//1 1//1");
    DeformedSamples patch = same(file.geometry);
    const std::vector<DirectionUse> uses = direction_uses(file.geometry);
    ASSERT_EQ(uses.size(), 3u);
    patch.directions[1] = Eigen::Vector3d(1, 0, 0);
    patch.directions[2] = Eigen::Vector3d(1, 0, 5e-7); // as good as the same
    std::string bytes;
    const std::size_t num_split =
        write_patched(file, patch, [&](std::string_view piece) { bytes.append(piece); });
    EXPECT_EQ(bytes,
              kTriangle +
                  "vn 0 0 1\nvt 0 0\nf 1/1/1 2/1/2 3/1/2\nf 3//2 2//2 1//1\nvn 1 0 0\n");
    EXPECT_EQ(num_split, 1u);
}

TEST(Obj, directions_that_the_digits_of_the_file_do_not_tell_apart_share_a_statement)
{
    // The second use is 4e-5 off: half of the fourth decimal is more, of the fifth less.
    for (const auto& [direction, decimals, num_wanted] : {std::tuple("0.0000 0 1", 4, 0u),
                                                          {"0.00000 0 1", 5, 1u},
                                                          {"0 0e0 1", 6, 1u},
                                                          {"0 0 1.0", 1, 0u},
                                                          {"-0.123456789 0 1", 6, 1u}})
    {
        const GeometryFile file =
            scan_geometry("x.obj", kTriangle + "vn " + direction +
                                       "\nf 1//1 2//1 3//1\nf 3//1 2//1 1//1\n");
        EXPECT_EQ(file.geometry.direction_decimals, decimals) << direction;
        DeformedSamples patch = same(file.geometry);
        ASSERT_EQ(patch.directions.size(), 3u);
        patch.directions[0] = patch.directions[1] = Eigen::Vector3d(1, 0, 0);
        patch.directions[2] = Eigen::Vector3d(1, 4e-5, 0);
        EXPECT_EQ(write_patched(file, patch, [](std::string_view) {}), num_wanted)
            << direction;
    }
}

TEST(Obj, parts_of_a_file_give_what_the_whole_gives)
{
    const std::string text =
        "v 0 0 0\r\nv 1 0 0\rv 0 \\\n1 0\nvn 0 0 1\nf 1//1 2//1 3//1\n";
    const Geometry whole = scanned(text);
    for (std::size_t size = 1; size <= text.size(); ++size)
    {
        const Geometry out = support::scanned_in_parts(ObjScanner("x.obj"), text, size);
        ASSERT_EQ(out.samples, whole.samples) << size;
        ASSERT_EQ(out.corners, whole.corners) << size;
        ASSERT_EQ(out.sample_places, whole.sample_places) << size;
        ASSERT_EQ(out.corner_direction_starts, whole.corner_direction_starts) << size;
    }
}

TEST(Obj, many_uses_of_one_direction_join_the_first_that_is_near)
{
    // Lengths differ, too, and some uses are near to several statements.
    std::mt19937 rng(5);
    std::vector<Eigen::Vector3d> values, kept;
    for (int i = 0; i < 3000; ++i)
    {
        const Eigen::Vector3d around = Eigen::Vector3d(1, 0.001 * (i % 40), 0);
        const double length = i % 50 == 49 ? 3.0 : i % 50 == 48 ? 1e-9 : 1.0;
        values.push_back(length * (around + support::random_vector(rng, 2e-6)));
    }
    DirectionSplitter splitter(1, 6, "\n");
    std::string lines;
    for (std::size_t i = 0; i < values.size(); ++i)
    {
        std::size_t first = 0;
        while (first < kept.size() &&
               (kept[first] - values[i]).norm() > 1e-6 * values[i].norm())
            ++first;
        if (first == kept.size())
            kept.push_back(values[i]);
        ASSERT_EQ(splitter.index({0, static_cast<std::uint32_t>(i)}, values[i], lines),
                  first + 1)
            << i;
    }
    EXPECT_EQ(splitter.num_lines() + 1, kept.size());
    EXPECT_GT(kept.size(), 200u);
    EXPECT_LT(kept.size(), 2900u);
}

} // namespace cellwarp::core
