// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/gltf.h"

#include <cmath>
#include <filesystem>
#include <limits>

#include <Eigen/Geometry>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "io/base/base64.h"
#include "io/formats/geometry_file.h"
#include "io/formats/geometry_output.h"
#include "io/formats/stored_number.h"
#include "tests/support/allocations.h"
#include "tests/support/files.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::error_of;

namespace
{

using Json = nlohmann::ordered_json;

std::string numbers(Scalar type, std::initializer_list<double> values)
{
    std::string bytes;
    for (const double value : values)
        store(value, type, false, bytes);
    return bytes;
}

/// Three vertices: positions, normals, tangents (w = -1), and the indices 0 1 2.
std::string triangle_body()
{
    return numbers(Scalar::Float32, {0, 0, 0, 1, 0, 0, 0, 1, 0}) +
           numbers(Scalar::Float32, {0, 0, 1, 0, 0, 1, 0, 0, 1}) +
           numbers(Scalar::Float32, {1, 0, 0, -1, 1, 0, 0, -1, 1, 0, 0, -1}) +
           numbers(Scalar::UInt16, {0, 1, 2, 0});
}

std::string base64(const std::string& bytes)
{
    std::string text((bytes.size() + 2) / 3 * 4, 'A');
    if (bytes.size() % 3 > 0)
        text.replace(text.size() - (3 - bytes.size() % 3), std::string::npos,
                     3 - bytes.size() % 3, '=');
    // Against zeros, which are all A; and once more for bytes that are zero.
    return base64_patched(text, std::string(bytes.size(), '\0'), bytes);
}

std::string data_uri(const std::string& bytes)
{
    return "data:application/octet-stream;base64," + base64(bytes);
}

/// One triangle under one node, spelled in a way of its own.
std::string triangle_text(const std::string& node = "\"mesh\":0",
                          const std::string& uri = data_uri(triangle_body()))
{
    return "{ \"asset\": {\"version\":\"2.0\",  \"generator\":\"caf\\u00e9\"},\n"
           "\"scene\":0, \"scenes\":[{\"nodes\":[0]}], \"nodes\":[{" +
           node +
           "}],\n\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0,"
           "\"NORMAL\":1,\"TANGENT\":2},\"indices\":3}]}],\n"
           "\"accessors\":[\n{\"bufferView\":0,\"componentType\":5126,\"count\":3,"
           "\"type\":\"VEC3\",\"min\":[0, 0.0,0],\"max\":[ 1,1.00,0 ]},\n"
           "{\"bufferView\":0,\"byteOffset\":36,\"componentType\":5126,\"count\":3,"
           "\"type\":\"VEC3\"},\n"
           "{\"bufferView\":0,\"byteOffset\":72,\"componentType\":5126,\"count\":3,"
           "\"type\":\"VEC4\"},\n"
           "{\"bufferView\":0,\"byteOffset\":120,\"componentType\":5123,\"count\":3,"
           "\"type\":\"SCALAR\"}],\n"
           "\"bufferViews\":[{\"buffer\":0,\"byteLength\":128}],\n"
           "\"buffers\":[{\"byteLength\":128,\"uri\":\"" +
           uri + "\"}] }\n";
}

GeometryFile scanned(const std::string& text)
{
    return scan_geometry("x.gltf", text);
}

/// That file with some of its JSON replaced, at a pointer like "/nodes/0/mesh".
std::string with(const std::string& pointer, const Json& value,
                 const std::string& text = triangle_text())
{
    Json json = Json::parse(text);
    json[Json::json_pointer(pointer)] = value;
    return json.dump();
}

std::string without(const std::string& pointer)
{
    Json json = Json::parse(triangle_text());
    const Json::json_pointer at(pointer);
    json[at.parent_pointer()].erase(at.back());
    return json.dump();
}

std::string refused(const std::string& text, const std::string& name = "x.gltf")
{
    return error_of(Fault::Malformed, [&] { scan_geometry(name, text); });
}

DeformedSamples same(const Geometry& geometry)
{
    return {geometry.samples, geometry.directions, geometry.tangents};
}

std::string glb(std::string json, const std::string& body)
{
    json.resize((json.size() + 3) / 4 * 4, ' ');
    const auto word = [](std::size_t value)
    { return numbers(Scalar::UInt32, {static_cast<double>(value)}); };
    const std::string chunks = word(json.size()) + "JSON" + json + word(body.size()) +
                               std::string("BIN\0", 4) + body;
    return "glTF" + word(2) + word(12 + chunks.size()) + chunks;
}

std::string glb_triangle()
{
    Json json = Json::parse(triangle_text());
    json["buffers"][0].erase("uri");
    return glb(json.dump(), triangle_body());
}

/// 20 about x, then times 2 and -3 along x and y, moved by (5, 6, 7).
const std::string kTilted = "\"mesh\":0,\"translation\":[5,6,7],\"scale\":[2,-3,1],"
                            "\"rotation\":[0.17364817766693033,0,0,0.984807753012208]";

} // namespace

TEST(Gltf, samples_are_in_the_world_and_in_the_order_of_the_nodes)
{
    Json json = Json::parse(triangle_text());
    json["meshes"].push_back(json["meshes"][0]);
    json["nodes"] = Json::parse(
        R"([{"children":[2,1],"translation":[10,0,0]},
            {"mesh":0,"matrix":[0,1,0,0,-1,0,0,0,0,0,1,0,0,0,5,1]},
            {"children":[3],"rotation":[0,0,0.7071067811865476,0.7071067811865476]},
            {"mesh":1,"scale":[2,2,2]}])");
    const Geometry geometry = scanned(json.dump()).geometry;
    ASSERT_EQ(geometry.samples.size(), 6u);
    // Node 3 comes before node 1.
    EXPECT_LT((geometry.samples[1] - Eigen::Vector3d(10, 2, 0)).norm(), 1e-15);
    EXPECT_EQ(geometry.samples[4], Eigen::Vector3d(10, 1, 5));
    EXPECT_EQ(geometry.samples[5], Eigen::Vector3d(9, 0, 5));
    EXPECT_EQ(geometry.corners, (std::vector<std::uint32_t>{0, 1, 2, 3, 4, 5}));
    EXPECT_EQ(geometry.directions.size(), 6u);
    EXPECT_LT((geometry.tangents[3] - Eigen::Vector3d(0, 1, 0)).norm(), 1e-15);
    // Without a default scene: what no other node holds.
    json.erase("scene");
    json["scenes"][0]["nodes"] = Json::array();
    EXPECT_EQ(scanned(json.dump()).geometry.samples, geometry.samples);
}

TEST(Gltf, a_patch_goes_into_the_space_of_its_node)
{
    const std::string text = triangle_text(kTilted);
    const GeometryFile file = scanned(text);
    ASSERT_TRUE(file.geometry.not_writable.empty());
    const Geometry& before = file.geometry;
    for (std::size_t i = 0; i < 3; ++i)
    {
        EXPECT_NEAR(before.directions[i].dot(before.samples[1] - before.samples[0]), 0,
                    1e-15);
        EXPECT_NEAR(before.directions[i].norm(), 1, 1e-15);
    }
    DeformedSamples patch = same(before);
    EXPECT_EQ(patched(file, patch), text);
    patch.samples[1] += Eigen::Vector3d(0.25, -0.5, 3);
    patch.directions[2] = Eigen::Vector3d(0.6, 0, -0.8);
    patch.tangents[0] = Eigen::Vector3d(0, 1, 0);
    const std::string moved_text = patched(file, patch);
    const Geometry moved = scanned(moved_text).geometry;
    for (std::size_t i = 0; i < 3; ++i)
    {
        EXPECT_LT((moved.samples[i] - patch.samples[i]).norm(), 1e-6);
        EXPECT_LT((moved.directions[i] - patch.directions[i]).norm(), 1e-6);
        EXPECT_LT((moved.tangents[i] - patch.tangents[i]).norm(), 1e-6);
    }
    // Outside of what moved no byte of the buffer changes, w among them.
    for (std::size_t at = 0; at < before.unpacked.size(); ++at)
    {
        const bool may_change =
            (at >= 12 && at < 24) || (at >= 60 && at < 72) || (at >= 72 && at < 84);
        if (!may_change)
        {
            EXPECT_EQ(moved.unpacked[at], before.unpacked[at]) << at;
        }
    }
}

TEST(Gltf, bounds_follow_and_the_rest_of_the_json_keeps_its_bytes)
{
    const GeometryFile file = scanned(triangle_text());
    DeformedSamples patch = same(file.geometry);
    patch.samples[0] = {-0.5, 0, 0.1};
    const std::string text = patched(file, patch);
    EXPECT_TRUE(contains(text, "\"min\":[-0.5, 0.0,0],\"max\":[ 1,1.00," +
                                   std::string("0.10000000149011612 ]},")));
    std::string rest = text;
    const std::string old = triangle_text();
    // What is left when bounds and buffer are put back is the old text.
    rest.replace(rest.find("-0.5, 0.0"), 4, "0");
    rest.replace(rest.find("0.10000000149011612"), 19, "0");
    const std::size_t uri = old.find("base64,") + 7;
    rest.replace(uri, base64(triangle_body()).size(), base64(triangle_body()));
    EXPECT_EQ(rest, old);
    EXPECT_EQ(scanned(text).geometry.samples[0].z(), static_cast<double>(0.1f));
    EXPECT_FALSE(
        contains(patched(scanned(without("/accessors/0/min")), patch), "\"min\""));
}

TEST(Gltf, slashes_that_are_escaped_are_still_base64)
{
    std::string body = triangle_body();
    body.replace(body.size() - 2, 2, "\xff\xff");
    std::string escaped = data_uri(body);
    for (std::size_t at = 0; (at = escaped.find('/', at)) != std::string::npos; at += 2)
        escaped.replace(at, 1, "\\/");
    const std::string text = triangle_text("\"mesh\":0", escaped);
    const GeometryFile file = scanned(text);
    DeformedSamples patch = same(file.geometry);
    EXPECT_EQ(patched(file, patch), text);
    patch.samples[2] = {1, 2, 3};
    EXPECT_EQ(scanned(patched(file, patch)).geometry.samples[2], patch.samples[2]);
}

TEST(Gltf, a_media_type_keeps_its_escapes)
{
    std::string uri = data_uri(triangle_body());
    uri.replace(uri.find("octet"), 5, "o\\tet\\\"");
    const GeometryFile file = scanned(triangle_text("\"mesh\":0", uri));
    DeformedSamples patch = same(file.geometry);
    patch.samples[2] = {1, 2, 3};
    EXPECT_EQ(scanned(patched(file, patch)).geometry.samples[2], patch.samples[2]);
}

TEST(Gltf, a_binary_file_is_patched_with_its_lengths)
{
    const std::string bytes = glb_triangle();
    const GeometryFile file = scan_geometry("x.glb", bytes + "after");
    EXPECT_TRUE(contains(file.geometry.warnings.at(0), "5 bytes after the end"));
    DeformedSamples patch = same(file.geometry);
    EXPECT_EQ(patched(file, patch), bytes + "after");
    patch.samples[1] = {0.1, 0.2, 0.3};
    const std::string moved = patched(file, patch);
    const std::size_t length = moved.size() - 5;
    EXPECT_EQ(length % 4, 0u);
    EXPECT_EQ(load_stored(moved.data() + 8, Scalar::UInt32, false),
              static_cast<double>(length));
    const Geometry again = scan_geometry("x.glb", moved).geometry;
    for (int k = 0; k < 3; ++k)
        EXPECT_EQ(again.samples[1][k],
                  static_cast<double>(static_cast<float>(patch.samples[1][k])));
    EXPECT_EQ(again.unpacked.substr(24), file.geometry.unpacked.substr(24));
    EXPECT_TRUE(moved.ends_with("after"));
}

TEST(Gltf, containers_that_lie_are_refused)
{
    const std::string bytes = glb_triangle();
    const auto refused_with = [&](std::size_t at, const std::string& what)
    {
        std::string changed = bytes;
        return refused(changed.replace(at, what.size(), what), "x.glb");
    };
    const std::string huge = "\xff\xff\xff\xff";
    EXPECT_TRUE(contains(refused_with(0, "glTG"), "is no binary glTF"));
    EXPECT_TRUE(contains(refused_with(4, "\1"), "version: got 1, need 2"));
    EXPECT_TRUE(contains(refused_with(8, huge), "length: got 4294967295"));
    EXPECT_TRUE(contains(refused_with(12, huge), "chunk 0 (byte 12): length"));
    EXPECT_TRUE(contains(refused_with(16, "NOSJ"), "need a JSON chunk"));
    const std::size_t chunk = bytes.find("BIN") - 4;
    EXPECT_TRUE(contains(refused_with(chunk, huge), "chunk 1 (byte"));
    EXPECT_TRUE(contains(refused_with(chunk + 4, "NIB"), "buffers[0]: has no data"));
    std::string header_only = bytes.substr(0, chunk + 4);
    header_only.replace(
        8, 4, numbers(Scalar::UInt32, {static_cast<double>(header_only.size())}));
    EXPECT_TRUE(contains(refused(header_only, "x.glb"), "the file ends in its header"));
    for (std::size_t size = 1; size < bytes.size(); ++size)
    {
        SCOPED_TRACE(size);
        refused(bytes.substr(0, size), "x.glb");
    }
}

TEST(Gltf, buffers_beside_it_are_written_beside_the_result)
{
    const support::Folder folder;
    std::filesystem::create_directory(folder / "in");
    folder.write("in/the buffer.bin", triangle_body());
    const std::string path =
        folder.write("in/x.gltf", triangle_text("\"mesh\":0", "the%20buffer.bin"));
    const GeometryFile file = read_geometry(path);
    DeformedSamples patch = same(file.geometry);
    EXPECT_EQ(patched(file, patch), file.bytes);
    patch.samples[1] = {1, 2, 3};
    const std::string out = folder / "moved here.gltf";
    check_geometry_output(out, file, Overwrite::No);
    write_geometry(out, file, patch, Overwrite::No);
    EXPECT_TRUE(contains(support::bytes_of(out), "\"uri\":\"moved%20here.bin\""));
    EXPECT_EQ(read_geometry(out).geometry.samples[1], Eigen::Vector3d(1, 2, 3));
    EXPECT_EQ(support::bytes_of(folder / "moved here.bin").size(), 128u);
    EXPECT_EQ(support::bytes_of(folder / "in/the buffer.bin"), triangle_body());
    // The companion is an output like the file itself.
    std::filesystem::remove(out);
    EXPECT_TRUE(contains(
        error_of(Fault::File, [&] { check_geometry_output(out, file, Overwrite::No); }),
        "moved here.bin: exists already"));
    check_geometry_output(out, file, Overwrite::Yes);
    EXPECT_TRUE(contains(
        error_of(Fault::Usage, [&] { check_geometry_output("-", file, Overwrite::No); }),
        "buffers in files of their own"));
    // A copy must not take the model's own buffer.
    EXPECT_TRUE(contains(error_of(Fault::File,
                                  [&] {
                                      check_geometry_output(folder / "in/the buffer.gltf",
                                                            file, Overwrite::Yes);
                                  }),
                         "would replace the model's own"));
}

TEST(Gltf, several_buffers_beside_it_are_numbered)
{
    const support::Folder folder;
    Json json = Json::parse(triangle_text("\"mesh\":0", "a.bin"));
    json["buffers"].push_back({{"byteLength", 8}, {"uri", data_uri("12345678")}});
    json["buffers"].push_back({{"byteLength", 4}, {"uri", "b.bin"}});
    folder.write("a.bin", triangle_body());
    folder.write("b.bin", "1234");
    const GeometryFile file = read_geometry(folder.write("x.gltf", json.dump()));
    write_geometry(folder / "y.gltf", file, same(file.geometry), Overwrite::No);
    EXPECT_EQ(support::bytes_of(folder / "y-0.bin"), triangle_body());
    EXPECT_EQ(support::bytes_of(folder / "y-2.bin"), "1234");
    EXPECT_EQ(read_geometry(folder / "y.gltf").geometry.samples, file.geometry.samples);
}

TEST(Gltf, a_file_that_many_buffers_name_is_read_once_and_written_once)
{
    const support::Folder folder;
    std::filesystem::create_directory(folder / "in");
    std::string body = triangle_body();
    body.resize(1000000);
    folder.write("in/b.bin", body);
    Json json = Json::parse(triangle_text("\"mesh\":0", "b.bin"));
    for (int i = 0; i < 500; ++i)
        json["buffers"].push_back(
            {{"byteLength", 1000000}, {"uri", i % 2 ? "b.bin" : "./b.bin"}});
    json["bufferViews"].push_back({{"buffer", 300}, {"byteLength", 128}});
    json["accessors"][1]["bufferView"] = 1;
    const std::string model = folder.write("in/x.gltf", json.dump());
    const support::MostMemory memory;
    const GeometryFile file = read_geometry(model);
    EXPECT_LT(memory.bytes(), 20000000u);
    EXPECT_EQ(file.geometry.unpacked.size(), 1000000u);
    EXPECT_EQ(file.geometry.directions[0], Eigen::Vector3d(0, 0, 1));
    DeformedSamples patch = same(file.geometry);
    for (Eigen::Vector3d& x : patch.samples)
        x += Eigen::Vector3d(1, 2, 3);
    std::filesystem::create_directory(folder / "out");
    write_geometry(folder / "out/y.gltf", file, patch, Overwrite::No);
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder / "out"), {}), 2);
    const Json written = Json::parse(support::bytes_of(folder / "out/y.gltf"));
    for (const Json& buffer : written["buffers"])
        EXPECT_EQ(buffer["uri"], "y.bin");
    EXPECT_EQ(read_geometry(folder / "out/y.gltf").geometry.samples, patch.samples);
}

TEST(Gltf, what_many_primitives_share_is_read_in_proportion_to_the_file_or_refused)
{
    Json json = Json::parse(triangle_text());
    const auto share = [&](std::size_t count, const Json& primitive)
    {
        Json list = Json::array();
        for (std::size_t i = 0; i < count; ++i)
            list.push_back(primitive);
        json["meshes"][0]["primitives"] = list;
    };
    share(100000, {{"attributes", {{"POSITION", 0}}}, {"indices", 3}});
    const GeometryFile file = scanned(json.dump());
    EXPECT_EQ(file.geometry.samples.size(), 3u);
    EXPECT_EQ(file.geometry.num_faces(), 100000u);
    EXPECT_TRUE(file.geometry.not_writable.empty());

    // One node or many, faces or points: small data that is used all too often.
    constexpr std::size_t kMany = 3000;
    json["buffers"].push_back(
        {{"byteLength", kMany}, {"uri", data_uri(std::string(kMany, '\0'))}});
    json["bufferViews"].push_back({{"buffer", 1}, {"byteLength", kMany}});
    json["accessors"].push_back({{"bufferView", 1},
                                 {"componentType", 5121},
                                 {"count", kMany},
                                 {"type", "SCALAR"}});
    for (const int mode : {0, 4, 5})
    {
        share(5000, {{"attributes", {{"POSITION", 0}}}, {"indices", 4}, {"mode", mode}});
        const support::MostMemory memory;
        EXPECT_TRUE(contains(refused(json.dump()), "nodes: more corners of faces than"));
        EXPECT_LT(memory.bytes(), 300000000u);
    }
    // Every primitive by an accessor of its own over the same bytes.
    json = Json::parse(triangle_text());
    const std::string body(3000 * 12, '\0');
    json["buffers"][0] = {{"byteLength", body.size()}, {"uri", data_uri(body)}};
    json["bufferViews"][0]["byteLength"] = body.size();
    json["accessors"] = Json::array();
    Json list = Json::array();
    for (int i = 0; i < 5000; ++i)
    {
        json["accessors"].push_back({{"bufferView", 0},
                                     {"componentType", 5126},
                                     {"count", 3000},
                                     {"type", "VEC3"}});
        list.push_back({{"attributes", {{"POSITION", i}}}, {"mode", 0}});
    }
    json["meshes"][0]["primitives"] = list;
    EXPECT_TRUE(contains(refused(json.dump()), "nodes: more "));
    for (int i = 0; i < 5000; ++i)
        json["meshes"][0]["primitives"][static_cast<std::size_t>(i)]["attributes"] = {
            {"POSITION", 0}, {"NORMAL", i}};
    EXPECT_TRUE(contains(refused(json.dump()), "nodes: more "));
}

TEST(Gltf, a_hundred_thousand_accessors_over_the_same_bytes_are_looked_at_once_each)
{
    Json json = Json::parse(triangle_text());
    for (int i = 0; i < 100000; ++i)
        json["accessors"].push_back({{"bufferView", 0},
                                     {"byteOffset", 120},
                                     {"componentType", 5123},
                                     {"count", 1 + i % 4},
                                     {"type", "SCALAR"}});
    EXPECT_TRUE(scanned(json.dump()).geometry.not_writable.empty());
}

TEST(Gltf, numbers_that_move_where_another_accessor_reads_are_not_patched)
{
    const Json bytes = {{"bufferView", 0},
                        {"byteOffset", 30},
                        {"componentType", 5121},
                        {"count", 10},
                        {"type", "SCALAR"}};
    Json json = Json::parse(triangle_text());
    json["accessors"].push_back(bytes);
    const auto overlaps = [&] { return scanned(json.dump()).gltf->does_overlap; };
    EXPECT_TRUE(overlaps());
    EXPECT_FALSE(scanned(json.dump()).gltf->is_patched);
    // One that begins before, and goes on while others have ended.
    json = Json::parse(triangle_text());
    json["accessors"].push_back(json["accessors"][1]);
    json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = 4;
    json["accessors"][1] = bytes;
    json["accessors"][1]["byteOffset"] = 0;
    json["accessors"][1]["count"] = 128;
    json["accessors"].push_back(bytes);
    EXPECT_TRUE(overlaps());
    // Two that only read may share; and so may what nothing moves.
    json = Json::parse(triangle_text());
    json["accessors"].push_back(bytes);
    json["accessors"][4]["byteOffset"] = 119;
    json["accessors"][4]["count"] = 9;
    EXPECT_TRUE(overlaps());
    json["accessors"][4]["byteOffset"] = 120;
    json["accessors"][4]["count"] = 8;
    EXPECT_FALSE(overlaps());
    EXPECT_TRUE(scanned(json.dump()).gltf->is_patched);
}

TEST(Gltf, a_buffer_that_leads_nowhere_is_a_file_error)
{
    const support::Folder folder;
    std::filesystem::create_symlink("loop.bin", folder / "loop.bin");
    const std::string model =
        folder.write("x.gltf", triangle_text("\"mesh\":0", "loop.bin"));
    EXPECT_TRUE(contains(error_of(Fault::File, [&] { read_geometry(model); }),
                         "buffers[0].uri: cannot open 'loop.bin': Too many levels"));
}

TEST(Gltf, buffers_outside_of_its_folder_are_not_opened)
{
    const support::Folder folder;
    std::filesystem::create_directory(folder / "in");
    folder.write("secret.bin", triangle_body());
    std::filesystem::create_symlink(folder / "secret.bin", folder / "in/link.bin");
    for (const std::string uri :
         {"../secret.bin", "%2e%2e/secret.bin", "a/../../secret.bin", "link.bin",
          "/dev/zero", "file:///dev/zero", "http://127.0.0.1:9/x.bin", "..\\\\secret.bin",
          "a\\u0000b", ""})
    {
        const std::string path =
            folder.write("in/x.gltf", triangle_text("\"mesh\":0", uri));
        EXPECT_TRUE(contains(error_of(Fault::Malformed, [&] { read_geometry(path); }),
                             "buffers[0].uri"))
            << uri;
    }
    const std::string path =
        folder.write("in/x.gltf", triangle_text("\"mesh\":0", "none.bin"));
    EXPECT_TRUE(
        contains(error_of(Fault::File, [&] { read_geometry(path); }), "in/none.bin"));
}

TEST(Gltf, strips_fans_and_lines_are_what_they_are)
{
    Json json = Json::parse(triangle_text());
    json["buffers"][0]["uri"] =
        data_uri(numbers(Scalar::Float32, {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 2, 2, 0}) +
                 std::string(68, '\0'));
    json["accessors"][0]["count"] = 5;
    json["meshes"][0]["primitives"][0] = {{"attributes", {{"POSITION", 0}}}, {"mode", 5}};
    Json& mode = json["meshes"][0]["primitives"][0]["mode"];
    EXPECT_EQ(scanned(json.dump()).geometry.corners,
              (std::vector<std::uint32_t>{0, 1, 2, 1, 3, 2, 2, 3, 4}));
    mode = 6;
    EXPECT_EQ(scanned(json.dump()).geometry.corners,
              (std::vector<std::uint32_t>{1, 2, 0, 2, 3, 0, 3, 4, 0}));
    for (const int lines : {0, 1, 2, 3})
    {
        mode = lines;
        EXPECT_EQ(scanned(json.dump()).geometry.num_faces(), 0u);
        EXPECT_EQ(scanned(json.dump()).geometry.samples.size(), 5u);
    }
    mode = 4;
    EXPECT_TRUE(contains(refused(json.dump()), "got 5 corners, need a multiple of 3"));
    mode = 7;
    EXPECT_TRUE(contains(refused(json.dump()), "mode: got 7, need 0 to 6"));
}

TEST(Gltf, primitives_of_one_mesh_share_their_samples)
{
    Json json = Json::parse(triangle_text());
    json["meshes"][0]["primitives"].push_back(json["meshes"][0]["primitives"][0]);
    const Geometry geometry = scanned(json.dump()).geometry;
    EXPECT_EQ(geometry.samples.size(), 3u);
    EXPECT_EQ(geometry.directions.size(), 3u);
    EXPECT_EQ(geometry.num_faces(), 2u);
    EXPECT_TRUE(geometry.not_writable.empty());
}

TEST(Gltf, what_has_shapes_or_no_space_is_read_but_not_written)
{
    const auto reason = [](const Json& json)
    {
        const GeometryFile file = scanned(json.dump());
        DeformedSamples patch = same(file.geometry);
        EXPECT_EQ(patched(file, patch), file.bytes);
        patch.samples[0] += Eigen::Vector3d(1, 0, 0);
        const std::string error =
            error_of(Fault::Malformed, [&] { patched(file, patch); });
        EXPECT_TRUE(contains(error, "cannot be written: " + file.geometry.not_writable));
        return file.geometry.not_writable;
    };
    const Json one = Json::parse(triangle_text("\"mesh\":0,\"name\":\"Wheel\""));
    Json json = one;
    json["meshes"][0]["primitives"][0]["targets"] = {{{"POSITION", 1}}};
    EXPECT_TRUE(contains(reason(json), "'Wheel': its mesh has morph targets"));
    json = one;
    json["nodes"][0]["scale"] = {1, 0, 1};
    EXPECT_TRUE(contains(reason(json), "'Wheel': its matrix is singular"));
    // A skin's mesh stands where its numbers say.
    json["nodes"][0]["skin"] = 0;
    EXPECT_EQ(scanned(json.dump()).geometry.not_writable, "");
    EXPECT_EQ(scanned(json.dump()).geometry.samples[1], Eigen::Vector3d(1, 0, 0));
}

TEST(Gltf, interleaved_attributes_are_written)
{
    std::string body;
    for (int i = 0; i < 3; ++i)
        body += numbers(Scalar::Float32, {1.0 * i, 2.0 * i, 0, 0, 0, 1});
    Json json = Json::parse(triangle_text());
    json["meshes"][0]["primitives"][0] = {
        {"attributes", {{"POSITION", 0}, {"NORMAL", 1}}}};
    json["accessors"].erase(3);
    json["accessors"].erase(2);
    json["accessors"][1]["byteOffset"] = 12;
    json["bufferViews"][0] = {{"buffer", 0}, {"byteLength", 72}, {"byteStride", 24}};
    json["buffers"][0] = {{"byteLength", 72}, {"uri", data_uri(body)}};
    const GeometryFile file = scanned(json.dump());
    EXPECT_EQ(file.geometry.not_writable, "");
    DeformedSamples patch = same(file.geometry);
    patch.samples[1] = {7, 8, 9};
    patch.directions[2] = {1, 0, 0};
    const Geometry moved = scanned(patched(file, patch)).geometry;
    EXPECT_EQ(moved.samples, patch.samples);
    EXPECT_EQ(moved.directions, patch.directions);
}

TEST(Gltf, sparse_and_quantised_positions_are_read)
{
    Json json = Json::parse(triangle_text());
    json["accessors"][0]["sparse"] = {
        {"count", 1},
        {"indices", {{"bufferView", 0}, {"byteOffset", 122}, {"componentType", 5123}}},
        {"values", {{"bufferView", 0}, {"byteOffset", 12}}}};
    EXPECT_EQ(scanned(json.dump()).geometry.samples[1], Eigen::Vector3d(1, 0, 0));
    EXPECT_FALSE(scanned(json.dump()).gltf->is_patched);
    // All zeros but for what the sparse part says.
    json["accessors"][0].erase("bufferView");
    EXPECT_EQ(scanned(json.dump()).geometry.samples[2], Eigen::Vector3d(0, 0, 0));
    json["accessors"][0]["sparse"]["indices"]["byteOffset"] = 14;
    EXPECT_TRUE(contains(refused(json.dump()), "sparse.indices: is out of range"));
    json["accessors"][0]["sparse"]["count"] = 4;
    EXPECT_TRUE(contains(refused(json.dump()), "sparse.count: got 4, need 1 to 3"));
    json["accessors"][0]["sparse"] = 1;
    EXPECT_TRUE(contains(refused(json.dump()), "sparse: need indices and values"));
    json["accessors"][0].erase("sparse");
    json["accessors"][0]["count"] = 4000000000u;
    json["meshes"][0]["primitives"][0] = {{"attributes", {{"POSITION", 0}}}};
    EXPECT_TRUE(contains(refused(json.dump()), "accessors[0]: has no bufferView"));

    json = Json::parse(triangle_text());
    json["accessors"][0]["componentType"] = 5122;
    json["accessors"][0]["normalized"] = true;
    EXPECT_TRUE(contains(refused(json.dump()), "accessors[0] is no VEC3 of floats"));
    json["extensionsRequired"] = {"KHR_mesh_quantization"};
    json["buffers"][0]["uri"] =
        data_uri(numbers(Scalar::Int16, {32767, 0, -32768, 0, 0, 0, 0, 0, 0}) +
                 triangle_body().substr(18));
    const Geometry geometry = scanned(json.dump()).geometry;
    EXPECT_EQ(geometry.samples[0], Eigen::Vector3d(1, 0, -1));
    EXPECT_EQ(geometry.not_writable, "");
}

TEST(Gltf, nodes_must_be_a_tree)
{
    Json json = Json::parse(triangle_text());
    json["nodes"] = Json::parse(R"([{"mesh":0},{"children":[2]},{"children":[1]}])");
    EXPECT_TRUE(contains(refused(json.dump()), "nodes: some are their own ancestors"));
    json["nodes"] = Json::parse(R"([{"children":[2,1]},{"children":[2]},{"mesh":0}])");
    EXPECT_TRUE(contains(refused(json.dump()), "nodes[2]: has two parents"));
    json["nodes"] = Json::parse(R"([{"children":[0]}])");
    EXPECT_TRUE(contains(refused(json.dump()), "own ancestors"));
    json["nodes"] = Json::parse(R"([{"children":7}])");
    EXPECT_TRUE(contains(refused(json.dump()), "nodes[0].children: need a list"));
    const auto chain = [&](int length)
    {
        json["nodes"] = Json::array();
        for (int i = 0; i + 1 < length; ++i)
            json["nodes"].push_back({{"children", {i + 1}}});
        json["nodes"].push_back({{"mesh", 0}});
        return json.dump();
    };
    EXPECT_EQ(scanned(chain(128)).geometry.samples.size(), 3u);
    EXPECT_TRUE(contains(refused(chain(129)), "nodes[128]: is nested deeper than 128"));
    json["nodes"] = Json::parse(R"([{"mesh":0},{"children":[0]}])");
    EXPECT_TRUE(contains(refused(json.dump()), "scenes[0].nodes: nodes[0] is no root"));
    json["nodes"] = Json::array();
    for (int i = 0; i < 100001; ++i)
        json["nodes"].push_back({{"mesh", 0}});
    json.erase("scene");
    EXPECT_TRUE(contains(refused(json.dump()), "more than 100000 nodes with meshes"));
}

TEST(Gltf, what_is_wrong_is_named)
{
    const auto told = [](const std::string& pointer, const Json& value)
    { return refused(with(pointer, value)); };
    EXPECT_TRUE(contains(told("/asset", 3), "asset: is missing"));
    EXPECT_TRUE(contains(told("/asset/version", "1.0"), "asset.version: got '1.0'"));
    EXPECT_TRUE(contains(told("/asset/minVersion", "3.0"), "asset.minVersion"));
    EXPECT_TRUE(contains(told("/asset/version", 2), "asset: need a text version"));
    EXPECT_TRUE(contains(told("/extensionsRequired", {"ACME_warp"}), "\"ACME_warp\""));
    EXPECT_TRUE(contains(told("/extensionsRequired", 1), "need a list of names"));
    EXPECT_TRUE(contains(told("/nodes", 1), "nodes: need a list of objects"));
    EXPECT_TRUE(contains(told("/nodes/0/mesh", 1), "nodes[0].mesh: is out of range"));
    EXPECT_TRUE(contains(told("/nodes/0/mesh", -1), "need a whole number"));
    EXPECT_TRUE(contains(told("/nodes/0/rotation", {0, 0, 0, 0}), "is no rotation"));
    EXPECT_TRUE(contains(told("/nodes/0/scale", {1, 1}), "scale: need 3 finite numbers"));
    EXPECT_TRUE(contains(told("/nodes/0/scale", {1, "x", 1}),
                         "scale: need 3 finite numbers (got \"x\")"));
    EXPECT_TRUE(contains(
        told("/nodes/0/matrix", {1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}),
        "its last row is not 0 0 0 1"));
    EXPECT_TRUE(contains(told("/scenes/0/nodes", 1), "scenes[0].nodes: need a list"));
    EXPECT_TRUE(contains(told("/scenes/0/nodes", Json::array()), "no vertices"));
    EXPECT_TRUE(contains(told("/meshes/0/primitives", 1), "primitives: need a list"));
    EXPECT_TRUE(contains(told("/meshes/0/primitives/0/attributes", 1),
                         "meshes[0].primitives[0].attributes: need an object"));
    EXPECT_TRUE(contains(refused(without("/meshes/0/primitives/0/attributes/POSITION")),
                         "has no POSITION"));
    EXPECT_TRUE(contains(told("/meshes/0/primitives/0/attributes/NORMAL", 3),
                         "NORMAL: accessors[3] is no VEC3"));
    EXPECT_TRUE(
        contains(told("/accessors/1/count", 2), "its attributes differ in count"));
    EXPECT_TRUE(contains(told("/meshes/0/primitives/0/indices", 0),
                         "accessors[0] is no SCALAR of unsigned integers"));
    EXPECT_TRUE(contains(told("/accessors/3/byteOffset", 12), "index 1 is out of range"));
    EXPECT_TRUE(contains(told("/accessors/0/count", 0), "count: got 0"));
    EXPECT_TRUE(contains(told("/accessors/0/count", 3.5), "need a whole number"));
    EXPECT_TRUE(contains(told("/accessors/0/type", "VEC5"), "type: is unknown"));
    EXPECT_TRUE(contains(told("/accessors/0/componentType", 5125.0), "POSITION"));
    EXPECT_TRUE(contains(told("/accessors/0/componentType", 5124), "is unknown"));
    EXPECT_TRUE(contains(told("/accessors/0/byteOffset", 18446744073709551608u),
                         "accessors[0]: lies outside"));
    EXPECT_TRUE(contains(refused(without("/accessors/0/count")), "count: is missing"));
    EXPECT_TRUE(contains(told("/bufferViews/0/byteOffset", 18446744073709551608u),
                         "bufferViews[0]: lies outside of its buffer"));
    EXPECT_TRUE(contains(told("/bufferViews/0/byteStride", 0), "byteStride: got 0"));
    EXPECT_TRUE(contains(told("/bufferViews/0/byteStride", 8), "byteStride: got 8"));
    EXPECT_TRUE(
        contains(refused(without("/bufferViews/0/buffer")), "buffer: is missing"));
    EXPECT_TRUE(contains(told("/buffers/0/byteLength", 129), "its data has 128"));
    EXPECT_TRUE(contains(told("/buffers/0/uri", "data:,x"), "its data URI is no base64"));
    EXPECT_TRUE(contains(refused(without("/buffers/0/uri")), "buffers[0]: has no data"));
    Json json = Json::parse(without("/buffers/0/uri"));
    json["bufferViews"][0]["extensions"]["EXT_meshopt_compression"] = Json::object();
    EXPECT_TRUE(contains(refused(json.dump()), "byteLength: got 128, more than"));
    json = Json::parse(without("/accessors/0/bufferView"));
    json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"] = 1;
    EXPECT_TRUE(
        contains(refused(json.dump()), "KHR_draco_mesh_compression.attributes: need"));
    json = Json::parse(triangle_text());
    json["accessors"][0]["sparse"] = {
        {"count", 1}, {"indices", {{"componentType", 5123}}}, {"values", Json::object()}};
    EXPECT_TRUE(contains(refused(json.dump()), "indices.bufferView: is missing"));

    EXPECT_TRUE(contains(refused("[]"), "need an object"));
    EXPECT_TRUE(contains(refused("{\n\"a\":"), "x.gltf:2: is no JSON"));
    EXPECT_TRUE(contains(refused(std::string(200, '[')), "depth: got 200"));
    std::string body = triangle_body();
    body.replace(12, 4, numbers(Scalar::Float32, {std::nan("")}));
    EXPECT_TRUE(
        contains(refused(triangle_text("\"mesh\":0", data_uri(body))),
                 "accessors[0]: vertex 1 (byte 12 of the buffers): is not finite"));
}

TEST(Gltf, normals_that_are_none_stay)
{
    std::string body = triangle_body();
    body.replace(36, 12, numbers(Scalar::Float32, {0, 0, 0}));
    body.replace(48, 4, numbers(Scalar::Float32, {std::nan("")}));
    const GeometryFile file = scanned(triangle_text(kTilted, data_uri(body)));
    EXPECT_EQ(file.geometry.direction_samples, (std::vector<std::uint32_t>{2}));
    EXPECT_EQ(file.geometry.warnings.size(), 1u);
    DeformedSamples patch = same(file.geometry);
    patch.directions[0] = {0, 1, 0};
    EXPECT_EQ(scanned(patched(file, patch)).geometry.unpacked.substr(36, 24),
              body.substr(36, 24));
}

TEST(Gltf, a_number_beyond_all_others_is_malformed)
{
    EXPECT_TRUE(contains(
        error_of(Fault::Malformed,
                 [] { scan_geometry("a.gltf", "{\"asset\": {\"version\": 2e999}}"); }),
        "a number that is out of range"));
}

} // namespace cellwarp::core
