// SPDX-License-Identifier: GPL-3.0-or-later
// Property test of patched text: unmoved it keeps its bytes, moved it reads back as
// moved.
#include "io/formats/part_patch.h"

#include <array>
#include <cmath>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "io/formats/geometry_file.h"
#include "io/formats/stored_number.h"
#include "io/formats/stream.h"
#include "tests/support/files.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::bytes_of;
using support::Folder;

namespace
{

struct Seed
{
    const char* name;
    std::string text;
};

std::vector<Seed> seeds()
{
    const std::string binary_stl = []
    {
        std::string bytes(80, 'h');
        store(2, Scalar::UInt32, false, bytes);
        for (int k = 0; k < 24; ++k)
        {
            store(0.25 * (k * k % 7), Scalar::Float32, false, bytes);
            if (k % 12 == 11)
                bytes += "\n\n";
        }
        return bytes;
    }();
    const std::string binary_ply = []
    {
        std::string bytes = "ply\nformat binary_little_endian 1.0\nelement vertex 3\n"
                            "property float z\nproperty double x\nproperty short y\n"
                            "property float nx\nproperty float ny\nproperty float nz\n"
                            "element face 1\nproperty list uchar int vertex_indices\n"
                            "end_header\n";
        for (int i = 0; i < 3; ++i)
        {
            store(0.5 * i, Scalar::Float32, false, bytes);
            store(0.1 * i, Scalar::Float64, false, bytes);
            store(i, Scalar::Int16, false, bytes);
            for (const double n : {0.6, 0.8, 0.0})
                store(n, Scalar::Float32, false, bytes);
        }
        bytes += '\3';
        for (int k = 0; k < 3; ++k)
            store(k, Scalar::Int32, false, bytes);
        return bytes;
    }();
    return {
        {"a.obj", "# an obj \\\nv 0 0 0\nv 1 0 \\\n 0\nv 1 1 0 1 0 0\nvt 0 0\nvn 0 0 1\n"
                  "vn 0.6 0 .8\nmtllib a.mtl\nf 1/1/1 2/1/2 3/1/1\nf -3 -2 4\ng a b\n"
                  "l 1 2 3\nv 0 1 0.25\nf 1//2 2//1 3//2\nusemtl b\n"},
        {"b.obj", "f 1//1 2//1 3//2\r\nv 0 0 0\r\nv 0.4 0 0\r\nv 1 1 0\r\nvn 0 0 1\r\n"
                  "vn 0 1 0\r\nf 1/1/1 -1/1/-1 -2/1/+001\r\nvt 1 1\r\n"},
        {"a.ply", "ply\nformat ascii 1.0\ncomment x\nelement vertex 4\nproperty float x\n"
                  "property float y\nproperty int z\nproperty list uchar int l\n"
                  "property float nx\nproperty float ny\nproperty float nz\n"
                  "property uchar red\nproperty uchar green\nproperty uchar blue\n"
                  "element face 1\nproperty list uchar int vertex_index\nend_header\n"
                  "0 0 0 0 0 0 1 1 2 3\n\n1.5 0 1 2 7 8 0 1 0 4 5 6\r\n"
                  "1 1 2 0 inf 0 0 7 8 9\n0.5 1 3 1 9 1 0 0 1 1 1\n4 0 1 2 3\nrest\n"},
        {"c.ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\n"
                  "property float y\nproperty float z\nend_header\n1 2 3\nnan nan nan\n"
                  "4 5e-3 6\n"},
        {"b.ply", binary_ply},
        {"a.stl", "solid one\nfacet normal 0 0 1\n outer loop\n  vertex 0 0 0\n"
                  "  vertex 1 0 0\n  vertex 0 1 0\n endloop\nendfacet\nendsolid one\n"
                  "solid two\nfacet normal nan 0 0\n outer loop\n  vertex 1 0 1\n"
                  "  vertex 1 2 0\n  vertex 0 1 0\n endloop\nendfacet\nendsolid two\n"},
        {"b.stl", binary_stl},
        {"a.off",
         "OFF # first\n4 1 0\n0 0 0# 9\n1 0 0 # 8\n1 1 0\n0 1 0.5\n4 0 1 2 3#\n"},
        {"b.off",
         "COFF\n3 1 0\n0 0 0 255 0 0 1\n1 0 0 1 2 3 4#5\n1 1 0\n3 0 1 2 7 7 7\n"},
        {"n.off", "NOFF 3 1 0\n0 0\n0 0 0 1 1 0 0 0 0\n1 0 # and\n1 0 1 0 0 3 0 1 2\n"},
        {"a.xyz", "# points\r\n1 2 3 0.5\r\n\r\n0.25 1e-3 -7 1\n  4 5 6 2\r1 1 1 1\n"},
        {"n.xyz", "0 0 0 0.0 0.0 1.0\n1 2 3 0 0.6 0.8\n1 0 0 -1.0 0 0\n"},
        {"a.pts", "3\n1 2 3 9 10 20 30\n4 5 6 9 1 2 3\n7 8 9 9 1 2 3\n"},
        {"a.csv",
         "time,x,y,z,\"a,b\"\n1,0.1,0.2,0.3,q\n2, 1.5 ,2,3,\"r,s\"\n3,1,2,3,t\n"},
        {"b.csv", "x;y;z\n0.1;0.2;0.3\n1;2;3\n"},
        {"a.txt", "//X Y Z R G B\n0 1 2 3 4 5\n1 1 2 30 40 50\n"},
        {"a.pcd", "VERSION .7\nFIELDS x i y z normal_x normal_y normal_z\n"
                  "SIZE 4 1 8 4 4 4 4\nTYPE F U F I F F F\nCOUNT 1 2 1 1 1 1 1\n"
                  "WIDTH 4\nHEIGHT 1\nPOINTS 4\nDATA ascii\n0 1 2 0 0 0 0 1\n\n"
                  "1.50 3 4 0.10 2 0 0.6 0.8\n 1 9 9 1e0 -5 nan 0 0\n1 9 9 1 1 0 0 0\n"},
        {"a.gltf",
         R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0,)"
         R"("translation":[1,2,3]}],"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],)"
         R"("accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3",)"
         R"("min":[0,0,0],"max":[1,1,0]}],"bufferViews":[{"buffer":0,"byteLength":36}],)"
         R"("buffers":[{"byteLength":36,"uri":"data:application/octet-stream;base64,)"
         R"(AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]})"},
    };
}

/// One or two changes, of the kind that files differ in.
std::string altered(std::string text, std::mt19937& rng)
{
    static constexpr std::array<std::string_view, 44> pieces = {"#",
                                                                " ",
                                                                "\t",
                                                                "\n",
                                                                "\r",
                                                                "\r\n",
                                                                "\\",
                                                                "\\\n",
                                                                "/",
                                                                "//",
                                                                ",",
                                                                ";",
                                                                "\"",
                                                                "'",
                                                                "0",
                                                                "1",
                                                                "7",
                                                                "-",
                                                                "+",
                                                                ".",
                                                                "e",
                                                                "e-5",
                                                                "nan",
                                                                "inf",
                                                                "1e9",
                                                                "\n# c\n",
                                                                " # c",
                                                                "#c",
                                                                "v ",
                                                                "f 1 2\n",
                                                                "vn nan nan nan\n",
                                                                "0x1",
                                                                "1#IND",
                                                                "-1.#IND",
                                                                "_",
                                                                "\v",
                                                                "\x1a",
                                                                "%",
                                                                "\n\n",
                                                                "\xef\xbb\xbf",
                                                                "00",
                                                                "1 2 3",
                                                                "\"1\"",
                                                                "3\n"};
    for (unsigned changes = rng() % 4 == 0 ? 2 : 1; changes > 0; --changes)
    {
        const std::size_t at = rng() % (text.size() + 1);
        const std::size_t length = std::min<std::size_t>(rng() % 4, text.size() - at);
        switch (rng() % 6)
        {
        case 0: // out
            text.erase(at, length);
            break;
        case 1: // twice
            text.insert(at, text.substr(at, 8 * length));
            break;
        case 2: // from elsewhere
            text.insert(at, text.substr(rng() % (text.size() + 1), 1 + rng() % 12));
            break;
        case 3: // another byte
            if (at < text.size())
                text[at] = static_cast<char>(32 + rng() % 95);
            break;
        case 4: // in the place of what is there
            text.replace(at, length, pieces[rng() % pieces.size()]);
            break;
        default:
            text.insert(at, pieces[rng() % pieces.size()]);
        }
    }
    return text;
}

/// Turned, so that directions keep their length, and shifted. It depends on the sample
/// alone.
Eigen::Vector3d turned(const Eigen::Vector3d& n)
{
    return {0.6 * n.x() - 0.8 * n.y(), 0.8 * n.x() + 0.6 * n.y(), n.z()};
}
Eigen::Vector3d moved(const Eigen::Vector3d& x)
{
    return turned(x) + Eigen::Vector3d(0.125, 100.0 / 3.0, -2.5e-7);
}
void move(const PartMotion& motion)
{
    for (Eigen::Vector3d& n : motion.directions)
        n = turned(n);
    for (Eigen::Vector3d& x : motion.samples)
        x = moved(x);
}

/// \p value as a number of this type reads back.
double stored(double value, Scalar scalar)
{
    if (scalar == Scalar::Float32)
        return static_cast<double>(static_cast<float>(value));
    const bool is_real =
        scalar == Scalar::Text || scalar == Scalar::Float64 || scalar == Scalar::TextReal;
    return is_real ? value : std::nearbyint(value);
}

/// The bytes without their numbers that may change.
std::string without_numbers(const GeometryFile& file)
{
    const Geometry& geometry = file.geometry;
    std::string rest = file.bytes;
    const auto blank = [&](const ByteOffsets& places, std::size_t vectors)
    {
        for (std::size_t i = 0; i < places.length * vectors; ++i)
        {
            const std::size_t size = stored_size(places.scalars[i % places.length]);
            for (std::size_t k = 0; k < (size > 0 ? size : places.lengths[i]); ++k)
                rest[static_cast<std::size_t>(places.start(i)) + k] = '\1';
        }
    };
    blank(geometry.sample_places, geometry.samples.size());
    blank(geometry.direction_places, geometry.directions.size());
    for (std::size_t c = 0; c < geometry.corner_directions.size(); ++c)
        if (geometry.corner_directions[c] != kNone)
            for (std::size_t k = 0; k < geometry.corner_direction_lengths[c]; ++k)
                rest[static_cast<std::size_t>(geometry.corner_direction_starts[c]) + k] =
                    '\1';
    std::erase(rest, '\1');
    return rest;
}

void expect_same_but_moved(const GeometryFile& file, const GeometryFile& again,
                           const DeformedSamples& patch)
{
    const Geometry &a = file.geometry, &b = again.geometry;
    ASSERT_EQ(b.samples.size(), a.samples.size());
    const bool is_gltf = a.format == "gltf"; // it stores them in the node's own frame
    for (std::size_t i = 0; i < a.samples.size(); ++i)
        for (int k = 0; k < 3; ++k)
        {
            const Scalar scalar = a.sample_places.scalars[static_cast<std::size_t>(k)];
            const double wanted = stored(patch.samples[i][k], scalar);
            ASSERT_LE(std::abs(b.samples[i][k] - wanted),
                      is_gltf ? 1e-6 * patch.samples[i].norm() : 0.0)
                << "sample " << i;
        }
    ASSERT_EQ(b.corners, a.corners);
    ASSERT_EQ(b.face_ends, a.face_ends);
    ASSERT_EQ(b.lines, a.lines);
    ASSERT_EQ(b.colours, a.colours);
    ASSERT_EQ(b.attributes, a.attributes);
    ASSERT_EQ(b.columns, a.columns);
    ASSERT_EQ(b.num_missing, a.num_missing);
    ASSERT_EQ(b.groups.size(), a.groups.size());
    ASSERT_EQ(b.direction_samples, a.direction_samples);
    ASSERT_EQ(b.corner_directions.size(), a.corner_directions.size());
    const std::vector<DirectionUse> uses = direction_uses(a);
    if (a.format == "obj")
    {
        // Every corner has the direction that it needs, in the same statement or a new
        // one.
        ASSERT_GE(b.directions.size(), a.directions.size());
        for (std::size_t c = 0; c < a.corner_directions.size(); ++c)
        {
            ASSERT_EQ(b.corner_directions[c] == kNone, a.corner_directions[c] == kNone);
            if (a.corner_directions[c] == kNone)
                continue;
            const Eigen::Vector3d wanted = turned(a.directions[a.corner_directions[c]]);
            ASSERT_LE((b.directions[b.corner_directions[c]] - wanted).norm(),
                      1e-4 * wanted.norm());
        }
        const std::string rest = without_numbers(file), now = without_numbers(again);
        ASSERT_EQ(now.substr(0, rest.size() - 1), rest.substr(0, rest.size() - 1));
        return;
    }
    ASSERT_EQ(b.directions.size(), a.directions.size());
    for (std::size_t use = 0; use < uses.size(); ++use)
        for (int k = 0; k < 3; ++k)
            ASSERT_EQ(b.directions[uses[use].direction][k],
                      stored(patch.directions[use][k],
                             a.direction_places.scalars[static_cast<std::size_t>(k)]));
    if (!is_gltf)
    {
        ASSERT_EQ(without_numbers(again), without_numbers(file));
    }
}

GeometryFile reread(const std::string& path, const std::string& text)
{
    try
    {
        return scan_geometry(path, text);
    }
    catch (const Error& error)
    {
        ADD_FAILURE() << error.what() << "\nin what was written:\n" << text;
        return {};
    }
}

StreamWork work()
{
    return {move,
            [](std::size_t count, const std::function<void(std::size_t)>& job)
            {
                for (std::size_t i = count; i-- > 0;)
                    job(i);
            },
            {},
            {}};
}

/// The output of the stream; nothing if it refuses the text.
std::optional<std::string> streamed(const Folder& folder, const std::string& name,
                                    const std::string& text, std::size_t part_bytes)
{
    StreamOptions options;
    options.part_bytes = part_bytes;
    options.parts_at_once = 2;
    const std::string out = folder / ("out-" + name);
    try
    {
        OutputSet outputs(Overwrite::Yes);
        stream_geometry(folder.write(name, text), out, outputs, options, work());
        outputs.commit();
    }
    catch (const Error&)
    {
        return std::nullopt;
    }
    return bytes_of(out);
}

} // namespace

TEST(PartPatch, a_text_altered_at_random_comes_back_the_same_or_as_it_was_moved)
{
    constexpr int kTexts = 600, kOneStreamedIn = 20;
    const Folder folder;
    int num_streamed = 0;
    for (const Seed& seed : seeds())
    {
        int accepted = 0;
        std::mt19937 rng(69);
        for (int i = 0; i < kTexts; ++i)
        {
            const std::string text = i == 0 ? seed.text : altered(seed.text, rng);
            const std::string path = folder / seed.name;
            SCOPED_TRACE(path + " " + std::to_string(i) + ":\n" + text);
            std::optional<std::string> whole;
            std::optional<GeometryFile> file;
            bool is_writable = true;
            DeformedSamples patch;
            try
            {
                file = scan_geometry(path, text);
                is_writable = file->geometry.not_writable.empty();
                patch.samples = file->geometry.samples;
                for (const DirectionUse& use : direction_uses(file->geometry))
                    patch.directions.push_back(file->geometry.directions[use.direction]);
                if (is_writable)
                {
                    ASSERT_EQ(patched(*file, patch), text);
                    for (Eigen::Vector3d& x : patch.samples)
                        x = moved(x);
                    for (Eigen::Vector3d& n : patch.directions)
                        n = turned(n);
                    whole = patched(*file, patch);
                }
            }
            catch (const Error&)
            {
                // Also where a number does not fit its type any more.
            }
            accepted += file.has_value();
            if (whole)
                expect_same_but_moved(*file, reread(path, *whole), patch);
            if (HasFailure())
                return;
            if (i % kOneStreamedIn == 0 && is_writable)
            {
                ++num_streamed;
                ASSERT_EQ(streamed(folder, seed.name, text, 1 + rng() % 90), whole);
            }
        }
        RecordProperty(std::string("accepted_") + seed.name, accepted);
        // Many texts of every format have to be read, or nothing is tested.
        EXPECT_GT(accepted, kTexts / 10) << seed.name;
    }
    EXPECT_GT(num_streamed, 250);
}

TEST(PartPatch, a_comment_behind_a_number_stays_and_is_no_number)
{
    const GeometryFile file =
        scan_geometry("x.off", "OFF\n4 1 0\n0 0 0# 9\n1 0 0#\n0 1 0 #\n0 0 1\n3 0 1 2\n");
    DeformedSamples patch{file.geometry.samples, {}};
    for (Eigen::Vector3d& x : patch.samples)
        x += Eigen::Vector3d(1, 2, 3);
    EXPECT_EQ(patched(file, patch),
              "OFF\n4 1 0\n1 2 3# 9\n2 2 3#\n1 3 3 #\n1 2 4\n3 0 1 2\n");
}

} // namespace cellwarp::core
