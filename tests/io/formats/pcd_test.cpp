// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/pcd.h"

#include <cmath>
#include <cstring>
#include <limits>

#include <gtest/gtest.h>

#include "io/base/lzf.h"
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
    return error_of(Fault::Malformed, [&] { scan_geometry("x.pcd", bytes); });
}

DeformedSamples same(const Geometry& geometry)
{
    return {geometry.samples, geometry.directions};
}

std::string header(const std::string& data, int width = 3, int height = 1)
{
    const std::string points = std::to_string(width * height);
    return "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n"
           "FIELDS label x y z normal_x normal_y normal_z rgb _ id\n"
           "SIZE 1 4 4 4 4 4 4 4 1 4\nTYPE U F F F F F F F U U\n"
           "COUNT 2 1 1 1 1 1 1 1 3 1\nWIDTH " +
           std::to_string(width) + "\nHEIGHT " + std::to_string(height) +
           "\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS " + points + "\nDATA " + data + "\n";
}

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
/// Bytes of one point of that header.
constexpr std::size_t kPointBytes = 2 + 7 * 4 + 3 + 4;

/// The fields of three points, one string a field and point.
std::vector<std::vector<std::string>> fields(double first_x = 0.5)
{
    std::vector<std::vector<std::string>> result;
    for (int i = 0; i < 3; ++i)
    {
        std::vector<std::string> point = {"ab"};
        const double values[] = {i == 0 ? first_x : i, 2.0 * i, 0, 0,
                                 i == 1 ? 0.0 : 1,     0};
        for (const double v : values)
            store(v, Scalar::Float32, false, point.emplace_back());
        point.push_back(std::string("\x30\x20\x10\x7f", 4));
        point.push_back("pad");
        point.push_back(std::string(4, static_cast<char>(i)));
        result.push_back(point);
    }
    return result;
}

std::string binary_body(double first_x = 0.5)
{
    std::string body;
    for (const auto& point : fields(first_x))
        for (const std::string& field : point)
            body += field;
    return body;
}

std::string columns_body(double first_x = 0.5)
{
    std::string body;
    const auto points = fields(first_x);
    for (std::size_t f = 0; f < points[0].size(); ++f)
        for (const auto& point : points)
            body += point[f];
    return body;
}

std::string number(std::size_t value)
{
    std::string bytes;
    store(static_cast<double>(value), Scalar::UInt32, false, bytes);
    return bytes;
}

std::string compressed(double first_x = 0.5)
{
    const std::string body = columns_body(first_x), packed = *lzf_packed(body);
    return header("binary_compressed") + number(packed.size()) + number(body.size()) +
           packed;
}

std::string text_cloud(const std::string& rows, int width, int height = 1)
{
    return "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH " +
           std::to_string(width) + "\nHEIGHT " + std::to_string(height) +
           "\nDATA ascii\n" + rows;
}

} // namespace

TEST(Pcd, reads_text_and_keeps_what_does_not_change)
{
    const std::string text =
        "VERSION 0.6\r\nFIELDS x intensity y z rgb\r\nSIZE 4 1 8 2 4\r\n"
        "TYPE F U F I U\r\nCOUNT 1 2 1 1 1\r\nWIDTH 2\r\nPOINTS 2\r\nDATA ascii\r\n"
        "0.10 1 2 +3 4 1056816\r\n\r\n5 6 7 8 -9 0";
    const GeometryFile file = scan_geometry("x.pcd", text);
    EXPECT_EQ(file.geometry.samples[0], Eigen::Vector3d(0.1, 3, 4));
    EXPECT_EQ(file.geometry.samples[1], Eigen::Vector3d(5, 8, -9));
    EXPECT_EQ(file.geometry.colours[0], (std::array<std::uint8_t, 3>{16, 32, 48}));
    EXPECT_EQ(file.geometry.attributes,
              (std::vector<std::string>{"intensity", "colours"}));
    DeformedSamples patch = same(file.geometry);
    EXPECT_EQ(patched(file, patch), text);
    patch.samples[1] = {5.25, 8, -9.6};
    EXPECT_TRUE(
        contains(patched(file, patch), "0.10 1 2 +3 4 1056816\r\n\r\n5.25 6 7 8 -10 0"));
}

TEST(Pcd, reads_and_patches_binary_points_and_compressed_columns)
{
    for (const std::string& bytes : {header("binary") + binary_body(), compressed()})
    {
        const GeometryFile file = scan_geometry("x.pcd", bytes);
        ASSERT_EQ(file.geometry.samples.size(), 3u);
        EXPECT_EQ(file.geometry.samples[0], Eigen::Vector3d(0.5, 0, 0));
        EXPECT_EQ(file.geometry.samples[2], Eigen::Vector3d(2, 4, 0));
        EXPECT_EQ(file.geometry.colours[1], (std::array<std::uint8_t, 3>{16, 32, 48}));
        // The second normal is zero: it takes no part.
        EXPECT_EQ(file.geometry.direction_samples, (std::vector<std::uint32_t>{0, 2}));
        DeformedSamples patch = same(file.geometry);
        EXPECT_EQ(patched(file, patch), bytes);
        patch.samples[0].x() = 0.7;
        patch.directions[1] = {0, 0, -1};
        const GeometryFile moved = scan_geometry("x.pcd", patched(file, patch));
        EXPECT_EQ(moved.geometry.samples[0].x(), static_cast<double>(0.7f));
        EXPECT_EQ(moved.geometry.directions[1], Eigen::Vector3d(0, 0, -1));
        EXPECT_EQ(moved.geometry.samples[1], file.geometry.samples[1]);
        EXPECT_EQ(moved.geometry.directions[0], file.geometry.directions[0]);
        // Back again, nothing else has changed.
        EXPECT_EQ(
            scan_geometry("x.pcd", patched(moved, same(file.geometry))).geometry.unpacked,
            file.geometry.unpacked);
        if (file.geometry.unpacked.empty())
        {
            EXPECT_EQ(patched(moved, same(file.geometry)), bytes);
        }
    }
    // Columns in the order of the fields, and new sizes in front of them.
    const GeometryFile file = scan_geometry("x.pcd", compressed() + "tail");
    EXPECT_EQ(file.geometry.unpacked, columns_body());
    DeformedSamples patch = same(file.geometry);
    patch.samples[0].x() = 0.75;
    EXPECT_EQ(patched(file, patch), compressed(0.75) + "tail");
    EXPECT_TRUE(contains(file.geometry.warnings.back(), "4 bytes after the last point"));
}

TEST(Pcd, a_missing_point_of_an_organised_cloud_is_no_sample_and_stays)
{
    const std::string text = text_cloud("0 0 0\nnan nan nan\n1 1 1\nnan nan nan\n", 2, 2);
    const GeometryFile file = scan_geometry("x.pcd", text);
    ASSERT_EQ(file.geometry.samples.size(), 2u);
    ASSERT_EQ(file.geometry.warnings.size(), 1u);
    EXPECT_TRUE(contains(file.geometry.warnings[0], "2 points without a place"));
    DeformedSamples patch = same(file.geometry);
    patch.samples[1] = {2, 3, 4};
    EXPECT_TRUE(
        contains(patched(file, patch), "0 0 0\nnan nan nan\n2 3 4\nnan nan nan\n"));
    EXPECT_TRUE(contains(refused(text_cloud("0 0 0\nnan 1 nan\n", 2)),
                         "x.pcd:9: point 1: x: is not finite"));
    EXPECT_TRUE(contains(refused(text_cloud("0 0 0\n1 -inf 0\n", 2)),
                         "x.pcd:9: point 1: y: is not finite"));
    EXPECT_TRUE(contains(refused(text_cloud("nan nan nan\n", 1)), "every point is NaN"));
    EXPECT_TRUE(contains(refused(header("binary") + binary_body(kNaN)),
                         "point 0 (byte " + std::to_string(header("binary").size() + 2) +
                             "): x: is not finite"));
    EXPECT_TRUE(contains(refused(compressed(kNaN)),
                         "point 0 (byte 6 of the unpacked data): x: is not finite"));
}

TEST(Pcd, headers_that_lie_or_are_wrong_name_their_line)
{
    const auto with = [](const std::string& from, const std::string& to)
    {
        std::string text = header("binary") + binary_body();
        return text.replace(text.find(from), from.size(), to);
    };
    EXPECT_TRUE(contains(refused(with("VERSION 0.7", "VERSION 7")), "x.pcd:2: VERSION"));
    EXPECT_TRUE(contains(refused(with("VERSION 0.7", "COLOUR 7")),
                         "x.pcd:2: header: this is no PCD header line"));
    EXPECT_TRUE(contains(refused(with(" x y", " x")), "x.pcd:4: SIZE: got 10 words"));
    EXPECT_TRUE(contains(refused(with("label", "x")), "x.pcd:3: FIELDS: 'x'"));
    EXPECT_TRUE(contains(refused(with(" x y", " w y")), "has no x, y or z"));
    EXPECT_TRUE(contains(refused(with("FIELDS label", "FIELDS\nFIELDS label")),
                         "x.pcd:3: FIELDS: got"));
    EXPECT_TRUE(contains(refused(with("_ id", "x id")), "'x' stands twice"));
    EXPECT_TRUE(contains(refused(with("SIZE 1", "SIZE 3")), "x.pcd:4: SIZE: of 'label'"));
    EXPECT_TRUE(contains(refused(with("TYPE U F", "TYPE U G")), "x.pcd:5: TYPE: of 'x'"));
    EXPECT_TRUE(
        contains(refused(with("TYPE U F", "TYPE U F F")), "x.pcd:5: TYPE: got 11 words"));
    for (const char* count : {"0", "-1", "many", "18446744073709551615", "268435457"})
        EXPECT_TRUE(contains(refused(with("COUNT 2", std::string("COUNT ") + count)),
                             "x.pcd:6: COUNT: of 'label'"))
            << count;
    EXPECT_TRUE(contains(refused(with("COUNT 2 1", "COUNT 2 2")), "needs a COUNT of 1"));
    for (const char* width : {"-3", "three", "3 4", "18446744073709551619"})
        EXPECT_TRUE(contains(refused(with("WIDTH 3", std::string("WIDTH ") + width)),
                             "x.pcd:7: WIDTH: is no count"))
            << width;
    EXPECT_TRUE(contains(refused(with("WIDTH 3", "WIDTH 4")),
                         "x.pcd:10: POINTS: is not WIDTH * HEIGHT (got 3, need 4)"));
    EXPECT_TRUE(contains(
        refused(with("WIDTH 3\nHEIGHT 1", "WIDTH 4294967296\nHEIGHT 4294967296")),
        "more than 2147483647 points"));
    EXPECT_TRUE(contains(
        refused(with("WIDTH 3\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 3", "")),
        "neither WIDTH nor POINTS"));
    EXPECT_TRUE(
        contains(refused(with("WIDTH 3\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 3",
                              "POINTS 4294967296")),
                 "more than 2147483647 points"));
    EXPECT_TRUE(contains(
        refused(with("WIDTH 3\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 3", "POINTS 0")),
        "no vertices"));
    EXPECT_TRUE(contains(refused(with("DATA binary", "DATA gzip")), "DATA: is unknown"));
    EXPECT_TRUE(contains(refused("VERSION 0.7\nDATA ascii\n"), "no FIELDS line"));
    EXPECT_TRUE(contains(refused("VERSION 0.7\n"), "x.pcd:2: header: ends before DATA"));
    EXPECT_TRUE(contains(refused(std::string(std::size_t(1) << 21, '#')),
                         "header: is longer than 1 MB"));
}

TEST(Pcd, counts_beyond_the_file_are_seen_through)
{
    std::string bytes = header("binary", 2147483647, 1) + binary_body();
    EXPECT_TRUE(contains(refused(bytes), "POINTS: the file is too short for its count"));
    bytes = text_cloud("0 0 0\n", 1000000);
    EXPECT_TRUE(contains(refused(bytes), "the file is too short for its count"));
    EXPECT_TRUE(contains(refused(text_cloud("0 0 0\n0 0 0\n", 3)),
                         "x.pcd:9: point 2: the file ends here (need 3 points)"));
    const std::string body = columns_body(), packed = *lzf_packed(body);
    const std::string head = header("binary_compressed");
    EXPECT_TRUE(contains(refused(head + number(packed.size()) + number(4000000000u)),
                         "sizes (byte " + std::to_string(head.size()) +
                             "): got 4000000000 bytes, need 3 points of " +
                             std::to_string(kPointBytes) + " bytes"));
    EXPECT_TRUE(contains(refused(header("binary_compressed", 100000000, 1) + number(10) +
                                 number(100000000 * kPointBytes)),
                         "too few for"));
    EXPECT_TRUE(
        contains(refused(head + number(packed.size() + 1) + number(body.size()) + packed),
                 "the file is too short for its packed data"));
    EXPECT_TRUE(
        contains(refused(head + number(packed.size() - 1) + number(body.size()) + packed),
                 "the packed data cannot be unpacked"));
    EXPECT_TRUE(contains(refused(head + "123"), "the file ends here"));
}

TEST(Pcd, rows_of_text_must_fit_their_fields)
{
    EXPECT_TRUE(contains(refused(text_cloud("0 0\n", 1)), "x.pcd:8: point 0: z"));
    EXPECT_TRUE(contains(refused(text_cloud("0 0 0 0\n", 1)), "more values than fields"));
    EXPECT_TRUE(contains(refused(text_cloud("0 y 0\n", 1)), "point 0: y: is no number"));
    EXPECT_TRUE(contains(refused(text_cloud(std::string("0 0 \0\n", 6), 1)), "NUL"));
    std::string text = text_cloud("0 0 300\n", 1);
    text.replace(text.find("4 4 4"), 5, "4 4 1");
    text.replace(text.find("F F F"), 5, "F F U");
    EXPECT_TRUE(contains(refused(text), "x.pcd:8: point 0: z: does not fit its type"));
}

TEST(Pcd, a_value_that_its_type_cannot_hold_is_an_error)
{
    const GeometryFile file = scan_geometry("x.pcd", compressed());
    DeformedSamples patch = same(file.geometry);
    patch.samples[0].x() = 1e300;
    EXPECT_TRUE(
        contains(error_of(Fault::Malformed, [&] { patched(file, patch); }), "byte 6"));
}

TEST(Pcd, parts_of_a_file_give_what_the_whole_gives)
{
    for (const std::string& bytes :
         {header("binary") + binary_body(), compressed(), text_cloud("0 0 0\n1 2 3", 2)})
    {
        const Geometry whole = scan_geometry("x.pcd", bytes).geometry;
        const std::size_t head = bytes.find('\n', bytes.find("DATA")) + 1;
        for (std::size_t size = 1; size < 20; ++size)
        {
            const Geometry out = support::scanned_in_parts(
                PcdScanner("x.pcd", bytes.size()), bytes, size, head);
            ASSERT_EQ(out.samples, whole.samples) << size;
            ASSERT_EQ(out.sample_places, whole.sample_places) << size;
        }
    }
}

TEST(Pcd, a_file_that_is_cut_anywhere_is_refused)
{
    for (const std::string& bytes :
         {header("binary") + binary_body(), compressed(), text_cloud("0 0 0\n1 2 3", 2)})
        for (std::size_t size = 1; size < bytes.size(); ++size)
        {
            SCOPED_TRACE(size);
            refused(bytes.substr(0, size));
        }
}

} // namespace cellwarp::core
