// SPDX-License-Identifier: GPL-3.0-or-later
// A file moved part by part is, byte by byte, the file moved whole, wherever it is cut.
#include "io/formats/stream.h"

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <random>
#include <thread>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "io/base/base64.h"
#include "io/base/lzf.h"
#include "io/base/lzf_unpacker.h"
#include "io/formats/geometry_file.h"
#include "io/formats/gltf.h"
#include "io/formats/stored_number.h"
#include "io/formats/stream_ranges.h"
#include "tests/support/files.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::bytes_of;
using support::contains;
using support::error_of;
using support::Folder;

namespace
{

/// A bend about z whose angle grows along y; what it does hangs on the sample alone.
Eigen::Vector3d bent(const Eigen::Vector3d& x)
{
    const double angle = 0.3 * x.y();
    return {std::cos(angle) * x.x() - std::sin(angle) * x.z(), x.y() + 0.125,
            std::sin(angle) * x.x() + std::cos(angle) * x.z()};
}

Eigen::Vector3d turned(const Eigen::Vector3d& x, const Eigen::Vector3d& direction)
{
    return bent(x + 1e-3 * direction) - bent(x - 1e-3 * direction);
}

/// No turn of the bend, but one that hangs on the sample as well.
Eigen::Vector4d spun(const Eigen::Vector3d& x, const Eigen::Vector4d& rotation)
{
    return {rotation[0] - x.y() * rotation[1], rotation[1] + x.y() * rotation[0],
            rotation[2] - x.z(), rotation[3]};
}

void bend(const PartMotion& motion)
{
    for (std::size_t d = 0; d < motion.directions.size(); ++d)
        motion.directions[d] =
            turned(motion.samples[motion.direction_samples[d]], motion.directions[d]);
    for (std::size_t t = 0; t < motion.tangents.size(); ++t)
        motion.tangents[t] =
            turned(motion.samples[motion.tangent_samples[t]], motion.tangents[t]);
    for (std::size_t r = 0; r < motion.rotations.size(); ++r)
        motion.rotations[r] =
            spun(motion.samples[motion.rotation_samples[r]], motion.rotations[r]);
    for (Eigen::Vector3d& x : motion.samples)
        x = bent(x);
}

/// Moves samples beyond x = 0.5 only, so that some numbers keep their bytes.
void bend_half(const PartMotion& motion)
{
    for (std::size_t d = 0; d < motion.directions.size(); ++d)
        if (const Eigen::Vector3d& x = motion.samples[motion.direction_samples[d]];
            x.x() > 0.5)
            motion.directions[d] = turned(x, motion.directions[d]);
    for (std::size_t t = 0; t < motion.tangents.size(); ++t)
        if (const Eigen::Vector3d& x = motion.samples[motion.tangent_samples[t]];
            x.x() > 0.5)
            motion.tangents[t] = turned(x, motion.tangents[t]);
    for (std::size_t r = 0; r < motion.rotations.size(); ++r)
        if (const Eigen::Vector3d& x = motion.samples[motion.rotation_samples[r]];
            x.x() > 0.5)
            motion.rotations[r] = spun(x, motion.rotations[r]);
    for (Eigen::Vector3d& x : motion.samples)
        if (x.x() > 0.5)
            x = bent(x);
}

using Move = std::function<void(const PartMotion&)>;

StreamWork work_with(const Move& move)
{
    return {move,
            [](std::size_t count, const std::function<void(std::size_t)>& job)
            {
                // Out of order, and not on this thread.
                std::vector<std::jthread> threads;
                for (std::size_t i = count; i-- > 0;)
                    threads.emplace_back([&job, i] { job(i); });
            },
            {},
            {}};
}

DeformedSamples moved(const GeometryFile& file, const Move& move)
{
    const std::vector<DirectionUse> uses = direction_uses(file.geometry);
    DeformedSamples patch;
    std::vector<std::uint32_t> points;
    std::vector<Eigen::Vector3d> places = file.geometry.samples;
    for (const DirectionUse& use : uses)
    {
        points.push_back(use.sample);
        patch.directions.push_back(file.geometry.directions[use.direction]);
    }
    patch.tangents = file.geometry.tangents;
    patch.rotations = file.geometry.rotations;
    move({places, points, patch.directions, file.geometry.tangent_samples, patch.tangents,
          file.geometry.rotation_samples, patch.rotations});
    patch.samples = std::move(places);
    return patch;
}

/// What the way through memory gives.
std::string moved_whole(const std::string& name, const std::string& bytes,
                        const Move& move)
{
    const GeometryFile file = scan_geometry(name, bytes);
    return patched(file, moved(file, move));
}

/// The same in pieces; with the number of normals that were split.
std::pair<std::string, std::size_t> moved_in_pieces(const std::string& name,
                                                    const std::string& bytes,
                                                    const Move& move,
                                                    std::uint64_t bytes_at_once)
{
    const GeometryFile file = scan_geometry(name, bytes);
    std::string all;
    const std::size_t num_split = write_patched(
        file, moved(file, move), [&](std::string_view piece) { all.append(piece); },
        bytes_at_once);
    return {std::move(all), num_split};
}

struct Streamed
{
    std::string bytes;
    StreamReport report;
};

Streamed streamed(const Folder& folder, const std::string& name, const std::string& bytes,
                  const Move& move, std::size_t part_bytes,
                  std::size_t sort_records = std::size_t(1) << 16)
{
    StreamOptions options;
    options.part_bytes = part_bytes;
    options.parts_at_once = 3;
    options.sort_records = sort_records;
    const std::string out = folder / ("out-" + name);
    Streamed result;
    OutputSet outputs(Overwrite::Yes);
    result.report = stream_geometry(folder.write(name, bytes), out, outputs, options,
                                    work_with(move));
    outputs.commit();
    result.bytes = bytes_of(out);
    return result;
}

/// Not a number is one of 32 bits.
void put(std::string& bytes, double value, Scalar type, bool big_endian)
{
    if (std::isnan(value))
    {
        bytes +=
            big_endian ? std::string("\x7f\xc0\0\0", 4) : std::string("\0\0\xc0\x7f", 4);
        return;
    }
    EXPECT_TRUE(store(value, type, big_endian, bytes));
}

std::string binary_ply(bool big_endian, bool has_lists)
{
    std::string bytes = std::string("ply\r\nformat binary_") +
                        (big_endian ? "big" : "little") +
                        "_endian 1.0\r\ncomment end_header is not here\r\n"
                        "element vertex 5\r\nproperty double z\r\nproperty float x\r\n"
                        "property short y\r\n";
    bytes += has_lists ? "property list uchar int extra\r\n" : "";
    bytes += "property float nx\r\nproperty float ny\r\nproperty float nz\r\n"
             "element face 2\r\nproperty list uchar uint vertex_indices\r\n"
             "property uchar flag\r\nelement rest 3\r\nproperty int a\r\nend_header\r\n";
    for (int i = 0; i < 5; ++i)
    {
        put(bytes, 0.1 * i, Scalar::Float64, big_endian);
        put(bytes, 0.3 * i, Scalar::Float32, big_endian);
        put(bytes, i, Scalar::Int16, big_endian);
        if (has_lists)
        {
            put(bytes, i, Scalar::UInt8, big_endian);
            for (int k = 0; k < i; ++k)
                put(bytes, 10 * k, Scalar::Int32, big_endian);
        }
        // The first has no normal, the second none that is finite.
        for (const double n : {0.0, 0.6, i == 1 ? std::nan("") : 0.8})
            put(bytes, i == 0 ? 0.0 : n, Scalar::Float32, big_endian);
    }
    for (int f = 0; f < 2; ++f)
    {
        put(bytes, 3, Scalar::UInt8, big_endian);
        for (int k = 0; k < 3; ++k)
            put(bytes, f + k, Scalar::UInt32, big_endian);
        put(bytes, 7, Scalar::UInt8, big_endian);
    }
    for (int i = 0; i < 3; ++i)
        put(bytes, i, Scalar::Int32, big_endian);
    return bytes + "tail";
}

std::string binary_stl()
{
    std::string bytes(80, 's');
    put(bytes, 4, Scalar::UInt32, false);
    for (int f = 0; f < 4; ++f)
    {
        for (const double n : {0.0, 0.0, f == 2 ? 0.0 : 1.0})
            put(bytes, n, Scalar::Float32, false);
        for (int k = 0; k < 9; ++k)
            put(bytes, 0.25 * ((f * 7 + k * k) % 5), Scalar::Float32, false);
        put(bytes, 3, Scalar::UInt16, false);
    }
    return bytes;
}

/// A Gaussian splat: the first rotation is none, the third not finite. More records than
/// the stream has parts at work, so that their memory is used again.
std::string splat_ply(bool big_endian)
{
    std::string bytes = std::string("ply\nformat binary_") +
                        (big_endian ? "big" : "little") +
                        "_endian 1.0\nelement vertex 14\nproperty float x\n"
                        "property float y\nproperty float z\nproperty uchar opacity\n";
    for (const char* rotation : {"rot_3", "rot_0", "rot_1", "rot_2"})
        bytes += std::string("property float ") + rotation + "\n";
    bytes += "end_header\n";
    for (int i = 0; i < 14; ++i)
    {
        for (const double x : {0.4 * i, 1.0, 0.5 * i})
            put(bytes, x, Scalar::Float32, big_endian);
        put(bytes, i, Scalar::UInt8, big_endian);
        for (const double q : {0.1 * i, 1.0 * i, 0.0, -0.3 * i})
            put(bytes, i == 2 ? std::nan("") : q, Scalar::Float32, big_endian);
    }
    return bytes;
}

std::string pcd_header(const std::string& data)
{
    return "# .PCD v0.7\nVERSION 0.7\nFIELDS label normal_z x _ y z rgb normal_x "
           "normal_y\n"
           "SIZE 1 4 4 1 2 8 4 4 4\nTYPE U F F U I F F F F\nCOUNT 2 1 1 3 1 1 1 1 1\n"
           "WIDTH 3\nHEIGHT 4\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 12\nDATA " +
           data + "\n";
}

/// The numbers of point \p i, field by field; the fourth normal is not finite, the fifth
/// zero.
std::vector<std::string> pcd_fields(int i)
{
    std::vector<std::string> fields(1, "ab");
    const auto field = [&](double value, Scalar type)
    { put(fields.emplace_back(), value, type, false); };
    field(i == 3 ? std::nan("") : i == 4 ? 0 : 0.8, Scalar::Float32);
    field(0.25 * i, Scalar::Float32);
    fields.emplace_back("pad");
    field(i, Scalar::Int16);
    field(0.1 * i, Scalar::Float64);
    fields.emplace_back(4, static_cast<char>(i));
    field(0, Scalar::Float32);
    field(i == 4 ? 0 : 0.6, Scalar::Float32);
    return fields;
}

std::string binary_pcd()
{
    std::string bytes = pcd_header("binary");
    for (int i = 0; i < 12; ++i)
        for (const std::string& field : pcd_fields(i))
            bytes += field;
    return bytes + "tail";
}

std::string packed_pcd()
{
    std::string body;
    for (std::size_t f = 0; f < pcd_fields(0).size(); ++f)
        for (int i = 0; i < 12; ++i)
            body += pcd_fields(i)[f];
    const std::string packed = *lzf_packed(body);
    std::string bytes = pcd_header("binary_compressed");
    put(bytes, static_cast<double>(packed.size()), Scalar::UInt32, false);
    put(bytes, static_cast<double>(body.size()), Scalar::UInt32, false);
    return bytes + packed + "tail";
}

struct Sample
{
    const char* name;
    std::string bytes;
};

/// Every format, each as awkward as it may be.
std::vector<Sample> samples()
{
    return {
        {"a.xyz", "# points\r\n1 2 3 0.5\r\n\r\n0.25 1e-3 -7 1\n  4 5 6 2\r1 1 1 1\n"
                  "-0.5 0.25 1 0"},
        {"n.xyz", "0 0 0 0 0 1.0\n1 2 3 0 0.6 0.8\n1 0 0 nan nan nan\n1 1 1 1.0 0 0\n"},
        {"c.xyz", "0 0 0 0 0 1\n1 2 3 0 0.6 0.8\n1 1 1 1.0 0 0\n"},
        {"n.txt", "//X Y Z Nx Ny Nz\n3\n0 0 0 0 0 1\n1 2 3 0 0 0\n1 1 1 nan 0 0\n"},
        {"a.pts", "3\n1 2 3 9 10 20 30\n4 5 6 9 1 2 3\n7 8 9 9 1 2 3\n"},
        {"b.pts", "1\n1 2 3 9 10 20 30\n2\n4 5 6 9 1 2 3\n7 8 9 9 1 2 3\n"},
        {"q.csv", "\"x\",\"y\",\"z\"\n\"1\",\"2\",\"0.5\"\n \"3\" ,\"1\",\" 2 \"\n"},
        {"m.off", "NCSTOFF\n3\n3\n0\n0 0 0 1 1 1 9 0 0 1 .5 .5\n1 0 0 1 1 1 0 0 1 .5 .5\n"
                  "1 2 0 1 1 1 -1.#IND 0 1 .5 .5# c\n0\n2 0 1\n3 0 1 2"},
        {"e.off", std::string("OFF\n1 0 0\n1 2 3\n") + '\0'},
        {"n.ply", "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\n"
                  "property float y\nproperty float z\nend_header\n1 2 3\nnan nan nan\n"
                  "2 1 0\nNaN nan nan\n\x1a"},
        {"f.ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\n"
                  "property float y\nproperty float z\nelement face 3\n"
                  "property list uchar int vertex_indices\nend_header\n1 2 3\n4 5 6\n"
                  "2 1 0\n2 0 1\n3 0 1 2\n0\n"},
        {"e.stl",
         "solid\ncolor 1 0 0\nfacet normal 0 0 1 ; c\nouter loop\nvertex 0 0 0\n"
         "vertex 1 0 0\n; c\nvertex 0 1 0\nend loop\nend facet\nend solid\n\x1a"},
        {"t.stl", binary_stl() + "\n\n"},
        {"z.obj", std::string("# D:\\\nv 0 0 0\nv 1 2 0\nv 0 1 3\nvn 0 0 1\nvn nan 0 0\n"
                              "mtllib C:\\\nf 1//1 2//1 3//1\nf 1//2 2//7 3/9/\nf 1\n"
                              "f 1//1 2//1\nf 3//-5 2//1 1//2\n") +
                      '\0'},
        {"a.csv", "time,x,y,z,\"a,b\"\n1,0.1,0.2,0.3,q\n2, 1.5 ,2,3,\"r,s\"\n3,1,2,3,t"},
        {"a.off", "# first\nCOFF\n4 1 0 # counts\n0 0 0 255 0 0 1\n1 0 0 1 2 3 4\n\n"
                  "1 1 0\n0 1 0.5 1 1 1 1\n4 0 1 2 3 7 7 7\n"},
        {"n.off", "NOFF 3 1 0\n0 0\n0 0 0 1 1 0 0 0 0\n1 0 # and\n1 0 1 0 0 3 0 1 2"},
        {"b.ply", binary_ply(false, false)},
        {"c.ply", binary_ply(true, false)},
        {"d.ply", binary_ply(true, true)},
        {"a.ply", "ply\nformat ascii 1.0\ncomment x\nelement vertex 4\nproperty float x\n"
                  "property float y\nproperty int z\nproperty list uchar int l\n"
                  "property float nx\nproperty float ny\nproperty float nz\n"
                  "element empty 0\nproperty int q\nelement face 1\n"
                  "property list uchar int vertex_index\nend_header\n"
                  "0 0 0 0 0 0 1\n\n1.5 0 1 2 7 8 0 1 0\r\n1 1 2 0 inf 0 0\n"
                  "0.5 1 3 1 9 1 0 0\n4 0 1 2 3\nrest\n"},
        {"s.ply", splat_ply(false)},
        {"t.ply", splat_ply(true)},
        {"a.pcd", "\xef\xbb\xbf# .PCD\r\nVERSION .7\r\nFIELDS x i y z normal_x normal_y "
                  "normal_z\r\nSIZE 4 1 8 4 4 4 4\r\nTYPE F U F F F F F\r\n"
                  "COUNT 1 2 1 1 1 1 1\r\nWIDTH 5\r\nHEIGHT 1\r\nPOINTS 5\r\n"
                  "DATA ascii\r\n0 1 2 0 0 0 0 1\r\n\r\nnan 1 2 nan nan 0 0 1\r\n"
                  "1.50 3 4 0.10 2 0 0.6 0.8\n 1 9 9 1e0 -0.5 nan 0 0\r\n"
                  "1 9 9 1 1 0 0 0\r\n \r\nrest\r\n"},
        {"i.pcd", "FIELDS z x y\nSIZE 4 4 4\nTYPE F I F\nHEIGHT 2\nWIDTH 2\nDATA ascii\n"
                  "0.5 1 2\n1 -2 3\n3 7 -3\n2 1 0.25"},
        {"n.pcd", "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 3\nDATA ascii\n"
                  "nan nan nan\n1 2 3\nNaN nan nan"},
        {"b.pcd", binary_pcd()},
        {"c.pcd", packed_pcd()},
        {"m.ply", "ply\rformat ascii 1.0\relement vertex 2\rproperty float x\r"
                  "property float y\rproperty float z\rend_header\r1 2 3\r4 5 6\r"},
        {"a.stl", "solid one\nfacet normal 0 0 1\n outer loop\n  vertex 0 0 0\n"
                  "  vertex 1 0 0\n  vertex 0 1 0\n endloop\nendfacet\n"
                  "FACET NORMAL nan 0 0\n outer loop\n  vertex 1 0 1\n"
                  "  vertex 1 2 0\n  vertex 0 1 0\n endloop\nendfacet\nendsolid one\n"
                  "solid two\nendsolid two"},
        {"b.stl", binary_stl()},
        {"a.obj", "\xef\xbb\xbf# an obj\r\nv 0 0 0\r\nv 1 0 \\\r\n 0\r\nv 1 1 0 1 0 0\r\n"
                  "vt 0 0\r\nvn 0 0 1\r\nf 1/1 2/1 3/1\r\nf -3 -2 4\r\ng a b\r\n"
                  "v 0 1 0.25\r\nusemtl a/b/c\r\nfancy 3\r\n"},
        {"n.obj", "f 1//1 2//1 3//2\nv 0 0 0\nv 0.4 0 0\nv 1 1 0\nvn 0 0 1\n"
                  "vn 0 1 0\nvn 1 0 0\nv 1 2 3\nf 1/1/1 -1/1/-1 -2/1/+001\nvt 1 1\n"
                  "f 4//1 3//1 1//1 2//2\nf 1 2 3//3"},
        {"w.obj", "v 1 0 0\r\nv 2 5 0\r\nv 3 1 0\r\nvn 0 0 1\r\nf 1//1 2//1 3//1\r\n"},
    };
}

} // namespace

TEST(Stream, parts_of_any_size_give_the_bytes_of_the_whole)
{
    const Folder folder;
    for (const Sample& sample : samples())
        for (const Move& move : {Move(bend), Move(bend_half)})
        {
            SCOPED_TRACE(sample.name);
            const auto [whole, num_split] =
                moved_in_pieces(sample.name, sample.bytes, move, 1 << 20);
            const GeometryFile file = scan_geometry(sample.name, sample.bytes);
            for (std::size_t part = 1; part <= sample.bytes.size() + 1;
                 part += part < 24 ? 1 : 1 + part / 4)
            {
                const Streamed parts =
                    streamed(folder, sample.name, sample.bytes, move, part, 2);
                ASSERT_EQ(parts.bytes, whole) << "parts of " << part << " bytes";
                ASSERT_EQ(parts.report.samples, file.geometry.samples.size());
                ASSERT_EQ(parts.report.bytes, whole.size());
                ASSERT_EQ(parts.report.num_split, num_split);
                ASSERT_EQ(parts.report.warnings.size(), file.geometry.warnings.size());
            }
        }
}

TEST(Stream, a_whole_file_is_written_the_same_in_pieces_of_any_size)
{
    for (const Sample& sample : samples())
    {
        SCOPED_TRACE(sample.name);
        for (const Move& move : {Move(bend), Move(bend_half)})
        {
            const std::string whole = moved_whole(sample.name, sample.bytes, move);
            for (std::size_t piece = 1; piece <= sample.bytes.size() + 1;
                 piece += piece < 24 ? 1 : 1 + piece / 4)
                ASSERT_EQ(moved_in_pieces(sample.name, sample.bytes, move, piece).first,
                          whole)
                    << "pieces of " << piece << " bytes";
        }
    }
}

TEST(Stream, a_file_that_is_cut_ends_as_it_does_whole)
{
    const Folder folder;
    for (const Sample& sample : samples())
        for (std::size_t length = 0; length < sample.bytes.size(); ++length)
        {
            SCOPED_TRACE(std::string(sample.name) + " cut at " + std::to_string(length));
            const std::string cut = sample.bytes.substr(0, length);
            std::string whole, message;
            try
            {
                whole = moved_whole(folder / sample.name, cut, bend);
            }
            catch (const Error& error)
            {
                message = error.what();
            }
            if (message.empty())
                ASSERT_EQ(streamed(folder, sample.name, cut, bend, 7).bytes, whole);
            else
            {
                ASSERT_EQ(error_of(Fault::Malformed,
                                   [&] { streamed(folder, sample.name, cut, bend, 7); }),
                          message);
                ASSERT_EQ(
                    std::distance(std::filesystem::directory_iterator(folder.path()), {}),
                    1);
            }
            std::filesystem::remove(folder / (std::string("out-") + sample.name));
            std::filesystem::remove(folder / sample.name);
        }
}

TEST(Stream, normals_of_a_large_mesh_are_split_as_in_memory)
{
    // A grid whose vn are shared by rows, so that many are split; corners at random.
    std::mt19937 rng(3);
    std::string text;
    const int n = 40;
    for (int i = 0; i < n * n; ++i)
    {
        text += "v " + std::to_string(0.05 * (i % n)) + " " +
                std::to_string(0.05 * (i / n)) + " 0\n";
        if (i % n == 0)
            text += "vn 0.1 0 1\n";
    }
    for (int f = 0; f < 4000; ++f)
    {
        text += "f";
        for (int k = 0; k < 3; ++k)
            text += " " + std::to_string(1 + rng() % (n * n)) + "//" +
                    std::to_string(1 + rng() % n);
        text += "\n";
    }
    const auto [whole, num_split] = moved_in_pieces("x.obj", text, bend, 1 << 20);
    EXPECT_GT(num_split, 100u);
    const Folder folder;
    for (const std::size_t sort_records : {100, 1000000})
    {
        const Streamed parts = streamed(folder, "x.obj", text, bend, 5000, sort_records);
        EXPECT_TRUE(parts.bytes == whole);
        EXPECT_EQ(parts.report.num_split, num_split);
    }
}

TEST(Stream, errors_tell_the_same_place_and_leave_the_old_output)
{
    std::string points, far;
    for (int i = 0; i < 200; ++i)
        points += std::to_string(i) + " 1 2\n";
    far = points + "1e200 0 0\n" + points;
    const std::string bad = points + "1 2 x\n" + points + "1 2\n";
    const Folder folder;
    const std::string out = folder.write("out-p.xyz", "old");
    for (const std::string& text : {bad, far})
    {
        const std::string whole =
            error_of(Fault::Malformed, [&] { scan_geometry(folder / "p.xyz", text); });
        EXPECT_EQ(error_of(Fault::Malformed,
                           [&] { streamed(folder, "p.xyz", text, bend, 100); }),
                  whole);
        EXPECT_EQ(bytes_of(out), "old");
    }
}

TEST(Stream, a_record_that_never_ends_is_refused)
{
    const Folder folder;
    const std::string text = "1 2 3\n# " + std::string(20000000, 'x');
    EXPECT_TRUE(contains(error_of(Fault::Malformed, [&]
                                  { streamed(folder, "p.xyz", text, bend, 1 << 20); }),
                         "longer than 16 MB"));
}

TEST(Stream, a_stop_leaves_no_output)
{
    const Folder folder;
    std::string text;
    for (int i = 0; i < 2000; ++i)
        text += "1 2 3\n";
    std::stop_source stop;
    StreamWork work = work_with(bend);
    work.stop = stop.get_token();
    work.progress = [&](double done)
    {
        if (done > 0.3)
            stop.request_stop();
    };
    StreamOptions options;
    options.part_bytes = 500;
    {
        OutputSet outputs(Overwrite::No);
        EXPECT_TRUE(stream_geometry(folder.write("p.xyz", text), folder / "out.xyz",
                                    outputs, options, work)
                        .is_stopped);
    }
    EXPECT_FALSE(std::filesystem::exists(folder / "out.xyz"));
}

TEST(Stream, a_compressed_cloud_of_many_blocks_is_the_one_of_memory)
{
    // Two blocks and a half, some of it noise; every third point is missing.
    std::mt19937 rng(5);
    std::string x, y, z;
    const int n = 220000;
    for (int i = 0; i < n; ++i)
    {
        put(x, i % 3 == 0 ? std::nan("") : 0.01 * (i % 1000), Scalar::Float32, false);
        put(y, i % 3 == 0 ? std::nan("") : 1e-6 * (rng() % 1000000), Scalar::Float32,
            false);
        put(z, i % 3 == 0 ? std::nan("") : 0.5, Scalar::Float32, false);
    }
    const std::string packed = *lzf_packed(x + y + z);
    std::string bytes = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH " +
                        std::to_string(n) + "\nDATA binary_compressed\n";
    put(bytes, static_cast<double>(packed.size()), Scalar::UInt32, false);
    put(bytes, 12.0 * n, Scalar::UInt32, false);
    bytes += packed;
    const Folder folder;
    EXPECT_TRUE(streamed(folder, "p.pcd", bytes, bend, 1 << 17).bytes ==
                moved_whole("p.pcd", bytes, bend));
    // What does not move keeps the packing it came with.
    EXPECT_TRUE(streamed(
                    folder, "p.pcd", bytes, [](const PartMotion&) {}, 1 << 17)
                    .bytes == bytes);
}

TEST(Stream, compressed_data_are_unpacked_wherever_they_are_cut)
{
    std::mt19937 rng(7);
    std::string bytes;
    while (bytes.size() < 30000)
        bytes += rng() % 3 ? bytes.substr(rng() % (bytes.size() + 1), rng() % 700)
                           : std::string(1 + rng() % 9, static_cast<char>(rng() % 256));
    const std::string packed = *lzf_packed(bytes);
    for (const std::size_t size : {1, 2, 3, 5, 64, 4096, 1 << 20})
    {
        LzfUnpacker unpacker(bytes.size());
        std::string all, made;
        for (std::size_t first = 0; first < packed.size(); first += size)
        {
            EXPECT_FALSE(unpacker.is_complete());
            ASSERT_TRUE(unpacker.take(packed.substr(first, size), made));
            all += made;
        }
        EXPECT_TRUE(unpacker.is_complete());
        EXPECT_TRUE(all == bytes) << "pieces of " << size;
    }
    std::string made;
    // Too long for what it must make; a reference to before the beginning.
    EXPECT_FALSE(LzfUnpacker(bytes.size() - 1).take(packed, made));
    EXPECT_FALSE(LzfUnpacker(9).take(std::string("\0a\x20\x01", 4), made));
    EXPECT_TRUE(LzfUnpacker(9).take(std::string("\0a\x20\0", 4), made));
}

namespace
{

constexpr int kGltfVertices = 60;

/// Positions and normals in turns, tangents, indices; the second normal is zero, the
/// third not finite.
std::string gltf_body()
{
    std::string bytes, tangents;
    for (int i = 0; i < kGltfVertices; ++i)
    {
        for (const double x : {0.02 * i, 0.1 * (i % 7), 1.0 - 0.01 * i})
            put(bytes, x, Scalar::Float32, false);
        for (const double n : {0.0, 0.6, i == 2 ? std::nan("") : 0.8})
            put(bytes, i == 1 ? 0.0 : n, Scalar::Float32, false);
        for (const double t : {1.0, 0.0, 0.0, -1.0})
            put(tangents, t, Scalar::Float32, false);
    }
    bytes += tangents;
    for (int i = 0; i < kGltfVertices; ++i)
        put(bytes, i, Scalar::UInt16, false);
    return bytes;
}

/// A turned and scaled node, and one in place with a part of the same body in a buffer of
/// its own. An empty URI: the buffer is the chunk.
nlohmann::ordered_json gltf_json(const std::string& first_uri,
                                 const std::string& second_uri)
{
    const std::string n = std::to_string(kGltfVertices);
    const auto accessor = [&](const std::string& view, int start, const std::string& type,
                              int component = 5126)
    {
        return R"({"bufferView":)" + view + R"(,"byteOffset":)" + std::to_string(start) +
               R"(,"componentType":)" + std::to_string(component) + R"(,"count":)" + n +
               R"(,"type":")" + type + R"("})";
    };
    const int size = static_cast<int>(gltf_body().size()), ends = 24 * kGltfVertices;
    nlohmann::ordered_json json = nlohmann::ordered_json::parse(
        R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0,1]}],
        "nodes":[{"mesh":0,"translation":[0.1,0.2,0],"scale":[2,-3,1],
        "rotation":[0.17364817766693033,0,0,0.984807753012208]},{"mesh":1}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0,"NORMAL":1,"TANGENT":2},
        "indices":3},{"attributes":{"POSITION":0},"mode":0}]},
        {"primitives":[{"attributes":{"POSITION":4,"NORMAL":5}}]}],"accessors":[)" +
        accessor("0", 0, "VEC3") + "," + accessor("0", 12, "VEC3") + "," +
        accessor("1", 0, "VEC4") + "," + accessor("2", 0, "SCALAR", 5123) + "," +
        accessor("3", 0, "VEC3") + "," + accessor("3", 12, "VEC3") +
        R"(],"bufferViews":[{"buffer":0,"byteLength":)" + std::to_string(ends) +
        R"(,"byteStride":24},{"buffer":0,"byteOffset":)" + std::to_string(ends) +
        R"(,"byteLength":)" + std::to_string(16 * kGltfVertices) +
        R"(},{"buffer":0,"byteOffset":)" + std::to_string(ends + 16 * kGltfVertices) +
        R"(,"byteLength":)" + std::to_string(2 * kGltfVertices) +
        R"(},{"buffer":1,"byteLength":)" + std::to_string(ends) +
        R"(,"byteStride":24}],"buffers":[{"byteLength":)" + std::to_string(size) +
        R"(},{"byteLength":)" + std::to_string(size) + "}]}");
    for (const int i : {0, 4})
    {
        json["accessors"][i]["min"] = {0, 0.0, 0.5};
        json["accessors"][i]["max"] = {1.5, 0.6, 1};
    }
    if (!first_uri.empty())
        json["buffers"][0]["uri"] = first_uri;
    json["buffers"][1]["uri"] = second_uri;
    return json;
}

std::string glb_of(std::string json, const std::string& body)
{
    std::string bytes = "glTF";
    json.resize((json.size() + 3) / 4 * 4, ' ');
    const auto word = [&](std::size_t value)
    { put(bytes, static_cast<double>(value), Scalar::UInt32, false); };
    word(2);
    word(12 + 8 + json.size() + 8 + body.size());
    word(json.size());
    bytes += "JSON" + json;
    word(body.size());
    return bytes + std::string("BIN\0", 4) + body + "tail";
}

std::string data_uri_of(const std::string& body)
{
    const std::string zeros(body.size(), '\0');
    std::string text((body.size() + 2) / 3 * 4, 'A');
    for (std::size_t i = 0; i < (3 - body.size() % 3) % 3; ++i)
        text[text.size() - 1 - i] = '=';
    return "data:application/octet-stream;base64," + base64_patched(text, zeros, body);
}

} // namespace

TEST(Stream, a_gltf_in_ranges_is_the_one_of_memory_and_so_is_what_stands_beside_it)
{
    const Folder folder;
    const std::string body = gltf_body();
    folder.write("one.bin", body + "rest");
    folder.write("t wo.bin", body);
    const std::string inside = data_uri_of(body);
    const std::vector<Sample> files = {
        {"a.gltf", gltf_json("one.bin", "t%20wo.bin").dump(1)},
        {"b.gltf", gltf_json("one.bin", inside).dump()},
        {"c.gltf", gltf_json(inside, inside).dump()},
        {"d.glb", glb_of(gltf_json("", "t%20wo.bin").dump(), body)},
        {"e.glb", glb_of(gltf_json("", inside).dump(), body)},
        {"f.glb", glb_of(gltf_json(inside, inside).dump(), body)},
    };
    for (const Sample& sample : files)
        for (const Move& move :
             {Move(bend), Move(bend_half), Move([](const PartMotion&) {})})
        {
            SCOPED_TRACE(sample.name);
            const GeometryFile file = scan_geometry(folder / sample.name, sample.bytes);
            const PatchedGltf whole = patched_gltf(
                file, moved(file, move), folder / (std::string("out-") + sample.name));
            for (const std::size_t part : {1, 100, 1000, 100000})
            {
                const Streamed parts =
                    streamed(folder, sample.name, sample.bytes, move, part);
                ASSERT_TRUE(parts.bytes == whole.bytes)
                    << "parts of " << part << " bytes";
                for (const Companion& companion : whole.companions)
                {
                    ASSERT_TRUE(bytes_of(companion.path) == companion.bytes);
                    std::filesystem::remove(companion.path);
                }
                ASSERT_EQ(parts.report.samples, 2u * kGltfVertices);
                ASSERT_EQ(parts.report.bytes, whole.bytes.size());
                ASSERT_EQ(parts.report.warnings, file.geometry.warnings);
            }
        }
}

TEST(Stream, a_gltf_is_refused_as_in_memory)
{
    const Folder folder;
    const std::string body = gltf_body(), inside = data_uri_of(body);
    const std::string whole = glb_of(gltf_json("", inside).dump(), body);
    std::string far = body, gone = body, index = body;
    far.replace(24 * 50, 4, std::string("\x60\xec\x78\x7f", 4));
    gone.replace(24 * 40 + 8, 4, std::string("\0\0\xc0\x7f", 4));
    index.replace(index.size() - 2, 2, std::string("\xff\0", 2));
    nlohmann::ordered_json huge = gltf_json("", inside);
    // Float coordinates stay below 1e150; the node takes them there.
    huge["nodes"][0]["scale"] = {1e120, 1e120, 1e120};
    std::vector<std::string> files = {glb_of(gltf_json("", inside).dump(), gone),
                                      glb_of(gltf_json("", inside).dump(), index),
                                      glb_of(huge.dump(), far)};
    for (std::size_t length = 0; length < whole.size(); length += length < 50 ? 1 : 97)
        files.push_back(whole.substr(0, length));
    for (std::size_t i = 0; i < files.size(); ++i)
    {
        SCOPED_TRACE(i);
        const std::string message = error_of(
            Fault::Malformed, [&] { scan_geometry(folder / "x.glb", files[i]); });
        EXPECT_EQ(error_of(Fault::Malformed,
                           [&] { streamed(folder, "x.glb", files[i], bend, 300); }),
                  message);
        EXPECT_FALSE(std::filesystem::exists(folder / "out-x.glb"));
    }
    nlohmann::ordered_json shapes = gltf_json("", inside);
    shapes["meshes"][0]["primitives"][0]["targets"] = {{{"POSITION", 0}}};
    EXPECT_TRUE(contains(
        error_of(Fault::Malformed, [&]
                 { streamed(folder, "x.glb", glb_of(shapes.dump(), body), bend, 300); }),
        "cannot be written: nodes[0]: its mesh has morph targets"));
}

TEST(Stream, what_cannot_be_streamed_says_why)
{
    const Folder folder;
    StreamOptions options;
    const auto refused = [&](const std::string& input, const std::string& output)
    {
        OutputSet outputs(Overwrite::No);
        return error_of(
            Fault::Usage,
            [&] { stream_geometry(input, output, outputs, options, work_with(bend)); });
    };
    options.format = "glb";
    EXPECT_TRUE(contains(refused("-", folder / "x.glb"), "need a file, not stdin"));
    options.format = {};
    EXPECT_TRUE(contains(refused("-", "-"), "stdin does not tell its format"));
    EXPECT_TRUE(contains(refused(folder / "x.unheard", "-"), "unheard"));
    // 300 MB of JSON that take no place on the disk.
    const std::string long_json = folder.write("x.glb", glb_of("{}", "").substr(0, 12) +
                                                            std::string("\0\0\0\x12", 4));
    std::filesystem::resize_file(long_json, 310000000);
    EXPECT_TRUE(contains(refused(long_json, folder / "y.glb"), "longer than 256 MB"));
    folder.write("one.bin", gltf_body());
    const std::string beside =
        folder.write("x.gltf", gltf_json("one.bin", data_uri_of(gltf_body())).dump());
    EXPECT_TRUE(contains(refused(beside, "-"), "buffers in files of their own"));
}

TEST(Stream, a_gltf_keeps_to_the_memory_that_it_is_given)
{
    const Folder folder;
    const std::string path =
        folder.write("x.glb", glb_of(gltf_json("", "").dump(), gltf_body()));
    StreamOptions options;
    options.max_whole_memory = 1000.0;
    OutputSet outputs(Overwrite::No);
    EXPECT_TRUE(contains(error_of(Fault::Budget,
                                  [&] {
                                      stream_geometry(path, folder / "y.glb", outputs,
                                                      options, work_with(bend));
                                  }),
                         "its JSON is read whole and needs about"));
}

TEST(Stream, packed_data_that_cannot_be_unpacked_leave_no_output)
{
    const Folder folder;
    std::string bytes = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 10\n"
                        "DATA binary_compressed\n";
    put(bytes, 40.0, Scalar::UInt32, false);
    put(bytes, 120.0, Scalar::UInt32, false);
    bytes += std::string(40, '\xff'); // every one looks back to before the first
    EXPECT_TRUE(contains(
        error_of(Fault::Malformed, [&] { streamed(folder, "p.pcd", bytes, bend, 100); }),
        "the packed data cannot be unpacked"));
    EXPECT_FALSE(std::filesystem::exists(folder / "out-p.pcd"));
}

TEST(Stream, without_a_folder_for_temporary_files_stdout_says_so)
{
    const Folder folder;
    const char* const before = std::getenv("TMPDIR");
    const std::string kept = before ? before : "";
    ::setenv("TMPDIR", (folder / "none").c_str(), 1);
    const std::string text = error_of(Fault::File, [] { spill_folder("-"); });
    if (before)
        ::setenv("TMPDIR", kept.c_str(), 1);
    else
        ::unsetenv("TMPDIR");
    EXPECT_TRUE(contains(text, "the folder for temporary files (TMPDIR)"));
    EXPECT_EQ(spill_folder(folder / "x.obj"), folder.path().string());
}

} // namespace cellwarp::core
