// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/ply.h"

#include <cstring>

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

Geometry scanned(const std::string& bytes)
{
    return scan_geometry("x.ply", bytes).geometry;
}

std::string refused(const std::string& bytes)
{
    return error_of(Fault::Malformed, [&] { scan_geometry("x.ply", bytes); });
}

DeformedSamples same(const Geometry& geometry)
{
    DeformedSamples patch{geometry.samples, {}};
    for (const DirectionUse& use : direction_uses(geometry))
        patch.directions.push_back(geometry.directions[use.direction]);
    return patch;
}

std::string header(const std::string& format, const std::string& vertex, int faces)
{
    return "ply\nformat " + format + " 1.0\ncomment c\nelement vertex 3\n" + vertex +
           (faces > 0 ? "element face " + std::to_string(faces) +
                            "\nproperty list uchar int vertex_indices\n"
                      : std::string()) +
           "end_header\n";
}

const std::string kXyz = "property float x\nproperty float y\nproperty float z\n";

/// Three vertices and a face in one of the binary encodings.
std::string binary(bool big, const std::string& line_end = "\n")
{
    std::string text =
        header(big ? "binary_big_endian" : "binary_little_endian", kXyz, 1);
    if (line_end != "\n")
        for (std::size_t at = 0; (at = text.find('\n', at)) != std::string::npos; at += 2)
            text.replace(at, 1, line_end);
    for (const double v : {0.1, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0})
        store(v, Scalar::Float32, big, text);
    text += '\3';
    for (const double i : {0.0, 1.0, 2.0})
        store(i, Scalar::Int32, big, text);
    return text;
}

} // namespace

TEST(Ply, reads_ascii_with_any_properties_in_any_order)
{
    const std::string text =
        header(
            "ascii",
            "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty "
            "double z\n"
            "property list uchar float weights\nproperty double y\nproperty double x\n",
            1) +
        "1 2 3 0.3 2 9 9 0.2 0.1\n4 5 6 0 0 0 1\n7 8 9 0 1 5 1 0\n3 0 1 2\n";
    const GeometryFile file = scan_geometry("x.ply", text);
    EXPECT_EQ(file.geometry.samples[0], Eigen::Vector3d(0.1, 0.2, 0.3));
    EXPECT_EQ(file.geometry.colours[2], (std::array<std::uint8_t, 3>{7, 8, 9}));
    EXPECT_EQ(file.geometry.num_faces(), 1u);
    DeformedSamples patch = same(file.geometry);
    EXPECT_EQ(patched(file, patch), text);
    patch.samples[0] = {11, 22, 33};
    EXPECT_TRUE(contains(patched(file, patch), "1 2 3 33 2 9 9 22 11\n"));
}

TEST(Ply, reads_and_patches_both_binaries)
{
    for (const bool big : {false, true})
    {
        const GeometryFile file = scan_geometry("x.ply", binary(big));
        EXPECT_EQ(file.geometry.samples[0].x(), static_cast<double>(0.1f));
        ASSERT_EQ(file.geometry.num_faces(), 1u);
        DeformedSamples patch = same(file.geometry);
        EXPECT_EQ(patched(file, patch), file.bytes);
        patch.samples[2].y() = 0.7;
        const std::string bytes = patched(file, patch);
        EXPECT_EQ(bytes.size(), file.bytes.size());
        EXPECT_EQ(scanned(bytes).samples[2].y(), static_cast<double>(0.7f));
    }
}

TEST(Ply, strips_of_triangles_are_faces)
{
    const std::string vertices = "element vertex 5\n" + kXyz,
                      strips =
                          "element tristrips 1\nproperty list int int vertex_indices\n",
                      places = "0 0 0\n1 0 0\n0 1 0\n1 1 0\n2 1 0\n";
    const auto text = [&](const std::string& list)
    {
        return "ply\nformat ascii 1.0\n" + vertices + strips + "end_header\n" + places +
               list + "\n";
    };
    // A strip of three, whose second one is turned over; then one of one triangle; a
    // corner that comes twice makes none.
    const Geometry ascii = scanned(text("11 0 1 2 3 4 -1 2 1 3 3 -1"));
    EXPECT_EQ(ascii.corners,
              (std::vector<std::uint32_t>{0, 1, 2, 2, 1, 3, 2, 3, 4, 2, 1, 3}));
    EXPECT_EQ(ascii.num_faces(), 4u);
    EXPECT_TRUE(ascii.attributes.empty());
    std::string bytes =
        "ply\nformat binary_big_endian 1.0\n" + vertices + strips + "end_header\n";
    for (const double v : {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 2, 1, 0})
        store(v, Scalar::Float32, true, bytes);
    for (const double i : {6, 0, 1, 2, -1, 3, 4})
        store(i, Scalar::Int32, true, bytes);
    EXPECT_EQ(scanned(bytes).corners, (std::vector<std::uint32_t>{0, 1, 2}));
    EXPECT_TRUE(contains(refused(text("3 0 1 5")),
                         "x.ply:15: tristrips 0: vertex index: is out of range (got 5"));
    EXPECT_TRUE(contains(refused(text("3 0 1 -2")), "is out of range (got -2"));
}

TEST(Ply, a_first_data_byte_that_is_a_line_end_is_data)
{
    std::string bytes = binary(false);
    const std::size_t data = bytes.find("end_header\n") + 11;
    bytes[data] = '\n';
    EXPECT_EQ(scanned(bytes).samples.size(), 3u);
    EXPECT_EQ(scanned(binary(false, "\r\n")).samples.size(), 3u);
}

TEST(Ply, integers_stay_integers)
{
    const std::string text =
        header("ascii", "property int x\nproperty int y\nproperty int z\n", 0) +
        "0 0 0\n10 0 0\n0 10 0\n";
    const GeometryFile file = scan_geometry("x.ply", text);
    DeformedSamples patch = same(file.geometry);
    patch.samples[1].x() = 12.7;
    EXPECT_TRUE(contains(patched(file, patch), "\n13 0 0\n"));
}

TEST(Ply, a_value_that_its_type_cannot_hold_is_an_error)
{
    std::string bytes = header("binary_little_endian",
                               "property char x\nproperty char y\nproperty char z\n", 0) +
                        std::string("\1\2\3\4\5\6\7\1\2");
    const GeometryFile file = scan_geometry("x.ply", bytes);
    DeformedSamples patch = same(file.geometry);
    patch.samples[0].x() = 200.0;
    EXPECT_TRUE(
        contains(error_of(Fault::Malformed, [&] { patched(file, patch); }), "byte"));
}

TEST(Ply, of_several_values_that_do_not_fit_the_first_in_the_file_is_named)
{
    // A normal of the first vertex stands before the places of the second.
    const std::string head =
        header("binary_little_endian",
               "property char x\nproperty char y\nproperty char z\n"
               "property char nx\nproperty char ny\nproperty char nz\n",
               0);
    const std::string bytes = head + std::string("\1\2\3\1\1\1\4\5\6\1\1\1\7\1\2\1\1\1");
    const GeometryFile file = scan_geometry("x.ply", bytes);
    DeformedSamples patch = same(file.geometry);
    patch.samples[1].x() = 200.0;
    patch.directions[0].y() = 300.0;
    patch.directions[1].x() = 400.0;
    const std::string error = error_of(Fault::Malformed, [&] { patched(file, patch); });
    EXPECT_TRUE(contains(error, "byte " + std::to_string(head.size() + 4))) << error;
    EXPECT_TRUE(contains(error, "300")) << error;
}

TEST(Ply, normals_turn_and_bad_ones_stay)
{
    const std::string text =
        header("ascii",
               kXyz + "property float nx\nproperty float ny\nproperty float nz\n", 0) +
        "0 0 0 0 0 1\n1 0 0 nan 0 0\n0 1 0 0 0 0\n";
    const GeometryFile file = scan_geometry("x.ply", text);
    ASSERT_EQ(file.geometry.directions.size(), 1u);
    EXPECT_EQ(file.geometry.warnings.size(), 1u);
    DeformedSamples patch = same(file.geometry);
    patch.directions[0] = {1, 0, 0};
    EXPECT_TRUE(
        contains(patched(file, patch), "0 0 0 1 0 0\n1 0 0 nan 0 0\n0 1 0 0 0 0\n"));
}

TEST(Ply, the_rotations_of_splats_turn_and_zero_normals_stay)
{
    const std::string properties =
        kXyz +
        "property float nx\nproperty float ny\nproperty float nz\nproperty float "
        "rot_1\nproperty float rot_0\nproperty float opacity\nproperty float rot_2\n"
        "property float rot_3\n";
    const std::string text = header("ascii", properties, 0) +
                             "0 0 0 0 0 0 .2 .1 7 .3 .4\n1 0 0 0 0 0 0 0 7 0 0\n"
                             "0 1 0 0 0 0 nan 0 7 0 0\n";
    const GeometryFile file = scan_geometry("x.ply", text);
    EXPECT_TRUE(file.geometry.directions.empty());
    ASSERT_EQ(file.geometry.rotations.size(), 1u);
    EXPECT_EQ(file.geometry.rotations[0], Eigen::Vector4d(0.1, 0.2, 0.3, 0.4));
    ASSERT_EQ(file.geometry.warnings.size(), 1u);
    EXPECT_TRUE(contains(file.geometry.warnings[0], "2 rotations are zero or not"));
    DeformedSamples patch = same(file.geometry);
    EXPECT_EQ(patched(file, patch), text);
    patch.rotations = {Eigen::Vector4d(5, 0.2, 6, 0.4)};
    EXPECT_TRUE(contains(patched(file, patch), "\n0 0 0 0 0 0 .2 5 7 6 .4\n"));
    // Whole numbers cannot hold a rotation.
    std::string whole = text;
    whole.replace(whole.find("float rot_3"), 11, "uchar rot_3");
    whole.replace(whole.find(" .4"), 3, " 40");
    EXPECT_TRUE(scanned(whole).rotations.empty());
}

TEST(Ply, counts_that_lie_are_seen_through)
{
    for (const char* count : {"4000000000", "9223372036854775807", "18446744073709551615",
                              "1537228672809129302", "-1", "three"})
    {
        std::string bytes = binary(false);
        bytes.replace(bytes.find("vertex 3"), 8, std::string("vertex ") + count);
        EXPECT_TRUE(contains(refused(bytes), "element")) << count;
    }
    std::string bytes = binary(false);
    bytes.replace(bytes.find("face 1"), 6, "face 2");
    EXPECT_TRUE(contains(refused(bytes), "face 1"));
}

TEST(Ply, a_file_that_is_cut_anywhere_is_refused)
{
    for (const std::string& bytes :
         {binary(false), header("ascii", kXyz, 1) + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2"})
        for (std::size_t size = 1; size < bytes.size(); ++size)
        {
            SCOPED_TRACE(size);
            refused(bytes.substr(0, size));
        }
}

TEST(Ply, lists_of_impossible_length_name_their_face)
{
    {
        std::string bytes = binary(false);
        bytes[bytes.size() - 13] = '\xff';
        EXPECT_TRUE(contains(refused(bytes), "face 0 (byte"));
    }
    std::string bytes = binary(false);
    bytes[bytes.size() - 4] = '\3';
    EXPECT_TRUE(contains(refused(bytes), "face 0 (byte"));
    EXPECT_TRUE(contains(refused(bytes), "out of range"));
    bytes = binary(false);
    bytes.replace(bytes.find("list uchar"), 10, "list char ");
    bytes[bytes.size() - 13] = '\xff';
    EXPECT_TRUE(contains(refused(bytes), "x.ply: face 0 (byte "));
    EXPECT_TRUE(contains(refused(bytes), "vertex_indices: is no list length (got -1)"));
}

TEST(Ply, faces_of_too_few_corners_are_none_and_stay)
{
    const std::string ascii =
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nelement face 4\nproperty list uchar int vertex_indices\n"
        "end_header\n0 0 0\n1 0 0\n0 1 0\n0\n2 0 1\n3 0 1 2\n1 2\n";
    std::string binary = ascii.substr(0, ascii.find("0 0 0"));
    binary.replace(binary.find("ascii"), 5, "binary_little_endian");
    for (const double x : {0, 0, 0, 1, 0, 0, 0, 1, 0})
        store(x, Scalar::Float32, false, binary);
    for (const std::vector<int>& face : {std::vector<int>{}, {0, 1}, {0, 1, 2}, {2}})
    {
        binary += static_cast<char>(face.size());
        for (const int corner : face)
            store(corner, Scalar::Int32, false, binary);
    }
    for (const std::string& text : {ascii, binary})
    {
        const GeometryFile file = scan_geometry("x.ply", text);
        EXPECT_EQ(file.geometry.num_faces(), 1u);
        EXPECT_EQ(file.geometry.num_triangles(), 1u);
        EXPECT_EQ(patched(file, {file.geometry.samples, {}}), text);
        for (const std::size_t size : {1, 5, 40})
            EXPECT_EQ(support::scanned_in_parts(PlyScanner("x.ply", text.size()), text,
                                                size, text.find("end_header") + 11)
                          .corners,
                      file.geometry.corners);
    }
    std::string many = ascii;
    many.replace(many.find("list uchar"), 10, "list int");
    many.replace(many.find("3 0 1 2"), 7, "1000001 0 1 2");
    EXPECT_TRUE(contains(refused(many), "x.ply:15: face 2: got 1000001 corners"));
    std::string wrong = ascii;
    wrong.replace(wrong.find("2 0 1\n"), 5, "2 0 3");
    EXPECT_TRUE(
        contains(refused(wrong), "x.ply:14: face 1: vertex index: is out of range"));
}

TEST(Ply, points_without_a_place_are_no_samples_where_there_are_no_faces)
{
    const std::string head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\n"
                             "property float y\nproperty float z\nproperty float nx\n"
                             "property float ny\nproperty float nz\n";
    const std::string points =
        "end_header\n1 2 3 0 0 1\nnan nan nan 0 0 1\n4 5 6 0 0 1\n";
    std::string binary = head + "end_header\n";
    binary.replace(binary.find("ascii"), 5, "binary_big_endian");
    for (const double x :
         {1., 2., 3., 0., 0., 1., -1., -1., -1., 0., 0., 1., 4., 5., 6., 0., 0., 1.})
        if (x == -1.)
            binary += std::string("\x7f\xc0\0\0", 4);
        else
            store(x, Scalar::Float32, true, binary);
    for (const std::string& text : {head + points, binary})
    {
        const GeometryFile file = scan_geometry("x.ply", text);
        ASSERT_EQ(file.geometry.samples.size(), 2u);
        EXPECT_EQ(file.geometry.samples[1], Eigen::Vector3d(4, 5, 6));
        EXPECT_EQ(file.geometry.direction_samples, (std::vector<std::uint32_t>{0, 1}));
        ASSERT_EQ(file.geometry.warnings.size(), 1u);
        EXPECT_TRUE(
            contains(file.geometry.warnings[0], "1 points without a place (NaN)"));
        DeformedSamples patch{{{1, 2, 3}, {7, 8, 9}}, file.geometry.directions};
        const GeometryFile moved = scan_geometry("x.ply", patched(file, patch));
        EXPECT_EQ(moved.geometry.samples, patch.samples);
        EXPECT_EQ(moved.geometry.num_missing, 1u);
    }
    const std::string faces = "element face 0\nproperty list uchar int vertex_indices\n";
    EXPECT_EQ(scan_geometry("x.ply", head + faces + points).geometry.samples.size(), 2u);
    std::string with_face = head + faces + points + "3 0 1 2\n";
    with_face.replace(with_face.find("face 0"), 6, "face 1");
    EXPECT_TRUE(contains(refused(with_face), "vertex 1: x: is not finite (got nan)"));
    std::string half = head + points;
    half.replace(half.find("nan nan"), 7, "nan 2.0");
    EXPECT_TRUE(contains(refused(half), "vertex 1: x: is not finite"));
    std::string none =
        head + "end_header\nnan nan nan 0 0 1\nnan nan nan 0 0 1\nnan nan nan 0 0 1\n";
    EXPECT_TRUE(contains(refused(none), "no vertices: every point is NaN"));
}

TEST(Ply, headers_that_are_wrong_name_their_line)
{
    const auto with = [](const std::string& from, const std::string& to)
    {
        std::string text = header("ascii", kXyz, 1) + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
        return text.replace(text.find(from), from.size(), to);
    };
    EXPECT_TRUE(contains(refused(with("ply", "plx")), "x.ply:1"));
    EXPECT_TRUE(contains(refused(with("ascii", "text")), "x.ply:2"));
    EXPECT_TRUE(contains(refused(with("float y", "real y")), "x.ply:6"));
    EXPECT_TRUE(contains(refused(with("float y", "float x")), "x.ply:6"));
    EXPECT_TRUE(contains(refused(with("uchar int", "float int")), "x.ply:9"));
    for (const char* type : {"float", "double"})
        EXPECT_TRUE(contains(refused(with("uchar int", std::string("uchar ") + type)),
                             "x.ply:9: header: the indices of faces must be integers"))
            << type;
    EXPECT_TRUE(contains(refused(with("format ascii 1.0\n", "")), "no format"));
    EXPECT_TRUE(contains(refused(with("vertex 3", "vertex 0")), "no vertices"));
    EXPECT_TRUE(contains(refused(with("float z", "float w")), "no property x, y or z"));
    EXPECT_TRUE(contains(refused(with("comment c", "remark c")), "x.ply:3"));
    EXPECT_TRUE(contains(refused(with("ascii 1.0", "ascii 2.0")),
                         "x.ply:2: header: format is wrong (got 'format ascii 2.0'"));
    EXPECT_TRUE(contains(refused(with("comment c", "format ascii 1.0")),
                         "x.ply:3: header: format is wrong"));
    EXPECT_TRUE(contains(refused(with("element face", "element vertex")),
                         "x.ply:8: header: element 'vertex' stands twice"));
    EXPECT_TRUE(contains(refused(with("comment c", "property float x")),
                         "x.ply:3: header: property before any element"));
    for (const std::string property :
         {"property", "property float", "property float y z", "property list uchar y"})
        EXPECT_TRUE(
            contains(refused(with("property float y", property)),
                     "x.ply:6: header: property is wrong (got '" + property + "', need"));
    EXPECT_TRUE(contains(refused(with("element vertex", "element point")),
                         "x.ply: header: no vertices (no element vertex)"));
    std::string many;
    for (int i = 0; i < 1022; ++i)
        many += "property float p" + std::to_string(i) + "\n";
    EXPECT_TRUE(contains(refused(with("property float x\n", many + "property float x\n")),
                         "x.ply:1029: header: more than 1024 properties in one element"));
}

TEST(Ply, a_file_of_too_many_vertices_is_refused_by_its_header)
{
    std::string text = header("binary_little_endian", kXyz, 0);
    text.replace(text.find("vertex 3"), 8, "vertex 2147483648");
    Geometry out;
    EXPECT_TRUE(contains(
        error_of(
            Fault::Malformed, [&]
            { PlyScanner("x.ply", std::uint64_t(1) << 40).scan(text, 0, false, out); }),
        "x.ply:4: element vertex: more than 2147483647 vertices"));
}

TEST(Ply, ascii_records_must_fit_their_properties)
{
    const std::string head = header("ascii", kXyz, 0);
    EXPECT_TRUE(contains(refused(head + "0 0 0\n1 0\n0 1 0\n"), "x.ply:10: vertex 1: z"));
    EXPECT_TRUE(contains(refused(head + "0 0 0\n1 0 0 0\n0 1 0\n"), "x.ply:10"));
    EXPECT_TRUE(
        contains(refused(head + "0 0 0\n1 x 0\n0 1 0\n"), "x.ply:10: vertex 1: y"));
    EXPECT_TRUE(contains(refused(head + "0 0 0\n1 inf 0\n0 1 0\n"), "not finite"));
    for (const std::string value : {"256", "-1", "0.5", "nan"})
        EXPECT_TRUE(contains(refused(header("ascii", kXyz + "property uchar red\n", 0) +
                                     "0 0 0 0\n1 0 0 " + value + "\n0 1 0 0\n"),
                             "x.ply:11: vertex 1: red: does not fit its type (got '" +
                                 value + "')"));
    for (const std::string count : {"-1", "2.5", "4294967296", "nan"})
        EXPECT_TRUE(contains(
            refused(header("ascii", kXyz, 1) + "0 0 0\n1 0 0\n0 1 0\n" + count +
                    " 0 1 2\n"),
            "x.ply:14: face 0: vertex_indices: is no list length (got '" + count + "')"));
    EXPECT_TRUE(
        contains(refused(head + std::string("0 0 0\n1 \0 0\n0 1 0\n", 18)), "NUL"));
}

TEST(Ply, bytes_after_the_last_record_pass_through)
{
    const GeometryFile file = scan_geometry("x.ply", binary(false) + "more");
    EXPECT_EQ(file.geometry.warnings.size(), 1u);
    EXPECT_EQ(patched(file, same(file.geometry)), file.bytes);
}

TEST(Ply, parts_of_a_file_give_what_the_whole_gives)
{
    for (const std::string& bytes :
         {binary(true), header("ascii", kXyz, 1) + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2"})
    {
        const Geometry whole = scanned(bytes);
        const std::size_t head = bytes.find("end_header\n") + 11;
        for (std::size_t size = 1; size < 20; ++size)
        {
            const Geometry out = support::scanned_in_parts(
                PlyScanner("x.ply", bytes.size()), bytes, size, head);
            ASSERT_EQ(out.samples, whole.samples) << size;
            ASSERT_EQ(out.corners, whole.corners) << size;
            ASSERT_EQ(out.sample_places, whole.sample_places) << size;
        }
    }
}

} // namespace cellwarp::core
