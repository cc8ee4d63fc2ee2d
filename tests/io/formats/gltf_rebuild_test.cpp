// SPDX-License-Identifier: GPL-3.0-or-later
// Numbers without a place of their own in a glTF are moved: they are read back as they
// were asked for, and all else is as it was.
#include "io/formats/gltf_rebuild.h"

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <map>
#include <random>
#include <set>
#include <vector>

#include <draco/compression/encode.h>
#include <draco/mesh/triangle_soup_mesh_builder.h>
#include <gtest/gtest.h>
#include <meshoptimizer.h>
#include <nlohmann/json.hpp>

#include "io/base/base64.h"
#include "io/formats/geometry_file.h"
#include "io/formats/gltf_memory.h"
#include "io/formats/stored_number.h"
#include "io/formats/stream.h"
#include "tests/support/files.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::error_of;

namespace
{

using Json = nlohmann::ordered_json;
using Eigen::Vector3d;

/// A glTF that is put together piece by piece.
struct Scene
{
    Json json = {{"asset", {{"version", "2.0"}}},
                 {"scene", 0},
                 {"scenes", {{{"nodes", Json::array()}}}},
                 {"nodes", Json::array()},
                 {"meshes", Json::array()},
                 {"accessors", Json::array()},
                 {"bufferViews", Json::array()},
                 {"buffers", {{{"byteLength", 0}}}}};
    std::string body;

    std::size_t view(const std::string& bytes, std::size_t stride = 0)
    {
        body.resize((body.size() + 3) / 4 * 4, '\0');
        Json view = {{"buffer", 0}, {"byteOffset", body.size()}};
        view["byteLength"] = bytes.size();
        if (stride > 0)
            view["byteStride"] = stride;
        body += bytes;
        json["buffers"][0]["byteLength"] = body.size();
        json["bufferViews"].push_back(view);
        return json["bufferViews"].size() - 1;
    }
    std::size_t accessor(std::optional<std::size_t> view, int type, std::size_t count,
                         const char* kind)
    {
        Json accessor = {{"componentType", type}, {"count", count}, {"type", kind}};
        if (view)
            accessor["bufferView"] = *view;
        json["accessors"].push_back(accessor);
        return json["accessors"].size() - 1;
    }
    std::size_t floats(const std::vector<float>& values, const char* kind,
                       std::size_t length)
    {
        const std::string bytes(reinterpret_cast<const char*>(values.data()),
                                values.size() * sizeof(float));
        return accessor(view(bytes), 5126, values.size() / length, kind);
    }
    std::size_t indices(const std::vector<std::uint16_t>& values)
    {
        const std::string bytes(reinterpret_cast<const char*>(values.data()),
                                values.size() * sizeof(std::uint16_t));
        return accessor(view(bytes), 5123, values.size(), "SCALAR");
    }
    std::size_t node(Json object)
    {
        json["nodes"].push_back(std::move(object));
        json["scenes"][0]["nodes"].push_back(json["nodes"].size() - 1);
        return json["nodes"].size() - 1;
    }
    std::string glb() const
    {
        std::string text = json.dump(), chunk = body;
        text.resize((text.size() + 3) / 4 * 4, ' ');
        chunk.resize((chunk.size() + 3) / 4 * 4, '\0');
        const auto word = [](std::size_t value)
        {
            std::string bytes;
            store(static_cast<double>(value), Scalar::UInt32, false, bytes);
            return bytes;
        };
        const std::string chunks = word(text.size()) + "JSON" + text +
                                   word(chunk.size()) + std::string("BIN\0", 4) + chunk;
        return "glTF" + word(2) + word(12 + chunks.size()) + chunks;
    }
    std::string gltf() const
    {
        Json copy = json;
        copy["buffers"][0]["uri"] =
            "data:application/octet-stream;base64," + base64_encoded(body);
        return copy.dump();
    }
};

/// A grid of n x n vertices over the unit square, seeded bumps on it.
struct Sheet
{
    std::vector<float> places, normals, tangents, texture, colours;
    std::vector<std::uint16_t> corners;
    std::size_t count;

    explicit Sheet(int n, unsigned seed) : count(static_cast<std::size_t>(n * n))
    {
        std::mt19937 random(seed);
        std::uniform_real_distribution<float> bump(-0.1f, 0.1f);
        for (int j = 0; j < n; ++j)
            for (int i = 0; i < n; ++i)
            {
                const float u = float(i) / float(n - 1), v = float(j) / float(n - 1);
                for (const float x : {u, v, bump(random)})
                    places.push_back(x);
                const Eigen::Vector3f normal =
                    Eigen::Vector3f(bump(random), bump(random), 1).normalized();
                normals.insert(normals.end(), normal.begin(), normal.end());
                const Eigen::Vector3f along =
                    normal.cross(Eigen::Vector3f(0, 1, 0)).normalized();
                tangents.insert(tangents.end(), along.begin(), along.end());
                tangents.push_back(i % 2 ? 1.0f : -1.0f);
                texture.insert(texture.end(), {u, 1 - v});
                colours.insert(colours.end(), {u, v, 0.5f, 1.0f});
            }
        for (int j = 0; j + 1 < n; ++j)
            for (int i = 0; i + 1 < n; ++i)
                for (const int corner : {0, 1, n, n, 1, n + 1})
                    corners.push_back(static_cast<std::uint16_t>(j * n + i + corner));
    }
};

/// Adds a mesh with all that a vertex may have. Gives its number.
std::size_t add_mesh(Scene& scene, const Sheet& sheet)
{
    const std::size_t texture = scene.floats(sheet.texture, "VEC2", 2),
                      colours = scene.floats(sheet.colours, "VEC4", 4),
                      places = scene.floats(sheet.places, "VEC3", 3),
                      normals = scene.floats(sheet.normals, "VEC3", 3),
                      tangents = scene.floats(sheet.tangents, "VEC4", 4),
                      corners = scene.indices(sheet.corners);
    scene.json["meshes"].push_back({{"name", "sheet"},
                                    {"primitives",
                                     {{{"attributes",
                                        {{"POSITION", places},
                                         {"NORMAL", normals},
                                         {"TANGENT", tangents},
                                         {"TEXCOORD_0", texture},
                                         {"COLOR_0", colours}}},
                                       {"indices", corners},
                                       {"material", 0}}}}});
    scene.json["materials"] = {{{"name", "cloth"}}};
    return scene.json["meshes"].size() - 1;
}

/// Bends everything beyond x = \p from.
void bend(const PartMotion& part, double from)
{
    const auto angle = [&](const Vector3d& x) { return std::max(0.0, x.x() - from); };
    std::vector<Vector3d> rest(part.samples.begin(), part.samples.end());
    for (Vector3d& x : part.samples)
        x = Eigen::AngleAxisd(angle(x), Vector3d::UnitY()) * x;
    const auto turn =
        [&](std::span<const std::uint32_t> samples, std::span<Vector3d> vectors)
    {
        for (std::size_t i = 0; i < vectors.size(); ++i)
            vectors[i] = Eigen::AngleAxisd(angle(rest[samples[i]]), Vector3d::UnitY()) *
                         vectors[i];
    };
    turn(part.direction_samples, part.directions);
    turn(part.tangent_samples, part.tangents);
}

DeformedSamples bent(const Geometry& geometry, double from)
{
    DeformedSamples patch{geometry.samples, geometry.directions, geometry.tangents};
    bend({patch.samples, geometry.direction_samples, patch.directions,
          geometry.tangent_samples, patch.tangents},
         from);
    return patch;
}

double farthest(const std::vector<Vector3d>& a, const std::vector<Vector3d>& b)
{
    if (a.size() != b.size())
        return INFINITY;
    double most = 0;
    for (std::size_t i = 0; i < a.size(); ++i)
        most = std::max(most, (a[i] - b[i]).norm());
    return most;
}

Json json_of(const std::string& bytes)
{
    if (!bytes.starts_with("glTF"))
        return Json::parse(bytes);
    const auto size =
        static_cast<std::size_t>(load_stored(bytes.data() + 12, Scalar::UInt32, false));
    return Json::parse(bytes.substr(20, size));
}

/// The numbers of attribute \p name of each part's first primitive, part by part.
std::vector<std::vector<double>> attribute_of(const GeometryFile& file, const char* name)
{
    const Json json = json_of(file.bytes);
    std::vector<std::vector<double>> all;
    for (const GltfLayout::Part& part : file.gltf->parts)
    {
        const Json& attributes = json["meshes"][part.mesh]["primitives"][0]["attributes"];
        if (attributes.contains(name))
            all.push_back(accessor_numbers(
                file.gltf->accessors[attributes[name].get<std::size_t>()],
                file.geometry.unpacked));
    }
    return all;
}

/// Moved, written and read again it is what was asked for; all else is as it was.
/// Streamed it is the same to the byte. Gives what was written.
GeometryFile check_moved(const std::string& name, const std::string& bytes, double from,
                         double tolerance = 1e-6)
{
    const support::Folder folder;
    const GeometryFile file = scan_geometry(folder.write(name, bytes), bytes);
    EXPECT_EQ(file.geometry.not_writable, "");
    const Geometry& before = file.geometry;
    EXPECT_TRUE(patched(file, {before.samples, before.directions, before.tangents}) ==
                bytes);
    const DeformedSamples patch = bent(before, from);
    const std::string out = folder / ("out-" + name);
    const std::string written = patched_gltf(file, patch, out).bytes;
    const GeometryFile after = scan_geometry(name, written);
    EXPECT_LT(farthest(after.geometry.samples, patch.samples), tolerance);
    EXPECT_LT(farthest(after.geometry.directions, patch.directions), tolerance);
    EXPECT_LT(farthest(after.geometry.tangents, patch.tangents), tolerance);
    EXPECT_EQ(after.geometry.corners, before.corners);
    EXPECT_EQ(after.geometry.attributes, before.attributes);
    EXPECT_EQ(after.geometry.not_writable, "");
    for (const char* attribute : {"TEXCOORD_0", "COLOR_0", "JOINTS_0", "WEIGHTS_0"})
        EXPECT_EQ(attribute_of(after, attribute), attribute_of(file, attribute))
            << attribute;
    // All accessors of positions have bounds that hold.
    const Json json = json_of(written);
    for (const Json& mesh : json["meshes"])
        for (const Json& primitive : mesh["primitives"])
        {
            const auto number = primitive["attributes"]["POSITION"].get<std::size_t>();
            const Json& accessor = json["accessors"][number];
            if (!accessor.contains("min"))
                continue;
            const std::vector<double> numbers =
                accessor_numbers(after.gltf->accessors[number], after.geometry.unpacked);
            for (std::size_t k = 0; k < 3; ++k)
            {
                double least = INFINITY, most = -INFINITY;
                for (std::size_t i = k; i < numbers.size(); i += 3)
                {
                    least = std::min(least, numbers[i]);
                    most = std::max(most, numbers[i]);
                }
                EXPECT_FLOAT_EQ(accessor["min"][k].get<float>(), float(least));
                EXPECT_FLOAT_EQ(accessor["max"][k].get<float>(), float(most));
            }
        }
    StreamOptions options;
    StreamWork work;
    work.move = [&](const PartMotion& part) { bend(part, from); };
    work.run = [](std::size_t count, const std::function<void(std::size_t)>& job)
    {
        for (std::size_t i = 0; i < count; ++i)
            job(i);
    };
    for (const std::size_t part : {std::size_t(100), std::size_t(1) << 20})
    {
        options.part_bytes = part;
        OutputSet outputs(Overwrite::Yes);
        const StreamReport report =
            stream_geometry(file.path, out, outputs, options, work);
        outputs.commit();
        EXPECT_TRUE(support::bytes_of(out) == written);
        EXPECT_EQ(report.samples, before.samples.size());
        EXPECT_EQ(report.warnings, before.warnings);
    }
    return after;
}

/// Has meshopt compress every view of the scene.
void pack_views(Scene& scene, bool is_fallback_named = true)
{
    std::string packed;
    Json& views = scene.json["bufferViews"];
    const std::string body = std::exchange(scene.body, {});
    std::size_t end = 0;
    std::set<std::size_t> of_indices;
    for (const Json& mesh : scene.json["meshes"])
        for (const Json& primitive : mesh["primitives"])
            of_indices.insert(
                scene
                    .json["accessors"][primitive["indices"].get<std::size_t>()]
                         ["bufferView"]
                    .get<std::size_t>());
    for (std::size_t i = 0; i < views.size(); ++i)
    {
        Json& view = views[i];
        const std::size_t offset = view["byteOffset"], length = view["byteLength"];
        Json how = {{"buffer", 0}};
        std::vector<unsigned char> out;
        if (of_indices.contains(i))
        {
            const std::size_t count = length / 2;
            std::vector<unsigned> corners(count);
            for (std::size_t k = 0; k < count; ++k)
                corners[k] = static_cast<unsigned>(
                    load_stored(body.data() + offset + 2 * k, Scalar::UInt16, false));
            // Even and odd views in both of the ways that there are.
            const bool are_triangles = i % 2 == 0;
            out.resize(are_triangles ? meshopt_encodeIndexBufferBound(count, 65536)
                                     : meshopt_encodeIndexSequenceBound(count, 65536));
            meshopt_encodeIndexVersion(1);
            out.resize(are_triangles
                           ? meshopt_encodeIndexBuffer(out.data(), out.size(),
                                                       corners.data(), count)
                           : meshopt_encodeIndexSequence(out.data(), out.size(),
                                                         corners.data(), count));
            how["mode"] = are_triangles ? "TRIANGLES" : "INDICES";
            how["count"] = count;
            how["byteStride"] = 2;
        }
        else
        {
            const std::size_t stride = view.contains("byteStride")
                                           ? view["byteStride"].get<std::size_t>()
                                           : 4,
                              count = length / stride;
            out.resize(meshopt_encodeVertexBufferBound(count, stride));
            meshopt_encodeVertexVersion(0);
            out.resize(meshopt_encodeVertexBuffer(out.data(), out.size(),
                                                  body.data() + offset, count, stride));
            how["mode"] = "ATTRIBUTES";
            how["count"] = count;
            how["byteStride"] = stride;
        }
        packed.resize((packed.size() + 3) / 4 * 4, '\0');
        how["byteOffset"] = packed.size();
        how["byteLength"] = out.size();
        packed.append(reinterpret_cast<const char*>(out.data()), out.size());
        view["buffer"] = 1;
        view["extensions"]["EXT_meshopt_compression"] = how;
        end = std::max(end, offset + length);
    }
    scene.body = packed;
    Json fallback = {{"byteLength", end}};
    if (is_fallback_named)
        fallback["extensions"]["EXT_meshopt_compression"]["fallback"] = true;
    scene.json["buffers"] = {{{"byteLength", packed.size()}}, fallback};
    for (const char* key : {"extensionsUsed", "extensionsRequired"})
        scene.json[key].push_back("EXT_meshopt_compression");
}

/// Bytes of a sheet that Draco has compressed, with numbers of its attributes.
std::string draco_bytes(const Sheet& sheet, bool is_sequential,
                        std::map<std::string, int>& ids)
{
    draco::Mesh mesh;
    mesh.set_num_points(static_cast<std::uint32_t>(sheet.count));
    mesh.SetNumFaces(sheet.corners.size() / 3);
    for (std::uint32_t f = 0; f < sheet.corners.size() / 3; ++f)
    {
        draco::Mesh::Face face;
        for (std::size_t k = 0; k < 3; ++k)
            face[k] = draco::PointIndex(sheet.corners[3 * f + k]);
        mesh.SetFace(draco::FaceIndex(f), face);
    }
    const auto add = [&](const char* name, draco::GeometryAttribute::Type type,
                         const std::vector<float>& values, int length)
    {
        draco::GeometryAttribute attribute;
        attribute.Init(type, nullptr, static_cast<std::int8_t>(length), draco::DT_FLOAT32,
                       false, length * sizeof(float), 0);
        const int id =
            mesh.AddAttribute(attribute, true, static_cast<std::uint32_t>(sheet.count));
        for (std::uint32_t i = 0; i < sheet.count; ++i)
            mesh.attribute(id)->SetAttributeValue(
                draco::AttributeValueIndex(i),
                &values[i * static_cast<std::size_t>(length)]);
        ids[name] = static_cast<int>(mesh.attribute(id)->unique_id());
    };
    add("POSITION", draco::GeometryAttribute::POSITION, sheet.places, 3);
    add("NORMAL", draco::GeometryAttribute::NORMAL, sheet.normals, 3);
    add("TANGENT", draco::GeometryAttribute::GENERIC, sheet.tangents, 4);
    add("TEXCOORD_0", draco::GeometryAttribute::TEX_COORD, sheet.texture, 2);
    add("COLOR_0", draco::GeometryAttribute::COLOR, sheet.colours, 4);
    draco::Encoder encoder;
    encoder.SetEncodingMethod(is_sequential ? draco::MESH_SEQUENTIAL_ENCODING
                                            : draco::MESH_EDGEBREAKER_ENCODING);
    encoder.SetAttributeQuantization(draco::GeometryAttribute::POSITION, 16);
    encoder.SetAttributeQuantization(draco::GeometryAttribute::NORMAL, 10);
    draco::EncoderBuffer buffer;
    EXPECT_TRUE(encoder.EncodeMeshToBuffer(mesh, &buffer).ok());
    return {buffer.data(), buffer.size()};
}

Scene draco_scene(const Sheet& sheet, bool is_sequential)
{
    Scene scene;
    std::map<std::string, int> ids;
    const std::size_t view = scene.view(draco_bytes(sheet, is_sequential, ids));
    Json attributes = Json::object(), packed = Json::object();
    for (const auto& [name, kind] :
         {std::pair("POSITION", "VEC3"), std::pair("NORMAL", "VEC3"),
          std::pair("TANGENT", "VEC4"), std::pair("TEXCOORD_0", "VEC2"),
          std::pair("COLOR_0", "VEC4")})
    {
        attributes[name] = scene.accessor({}, 5126, sheet.count, kind);
        packed[name] = ids[name];
    }
    const std::size_t corners = scene.accessor({}, 5123, sheet.corners.size(), "SCALAR");
    scene.json["meshes"].push_back(
        {{"primitives",
          {{{"attributes", attributes},
            {"indices", corners},
            {"extensions",
             {{"KHR_draco_mesh_compression",
               {{"bufferView", view}, {"attributes", packed}}}}}}}}});
    for (const char* key : {"extensionsUsed", "extensionsRequired"})
        scene.json[key] = {"KHR_draco_mesh_compression"};
    return scene;
}

std::string refused(const std::string& bytes)
{
    return error_of(Fault::Malformed, [&] { scan_geometry("x.glb", bytes); });
}

} // namespace

TEST(GltfRebuild, a_moved_instance_gets_a_mesh_of_its_own)
{
    Scene scene;
    const std::size_t mesh = add_mesh(scene, Sheet(5, 1));
    for (int i = 0; i < 4; ++i)
        scene.node({{"mesh", mesh},
                    {"name", "instance " + std::to_string(i)},
                    {"translation", {1.5 * i, 0, 0.5}},
                    {"scale", {1, 2, 1}}});
    for (const auto& [name, bytes] :
         {std::pair("x.glb", scene.glb()), std::pair("x.gltf", scene.gltf())})
    {
        // Two of the four stand beyond 2.9 and move.
        const GeometryFile after = check_moved(name, bytes, 2.9);
        const Json json = json_of(after.bytes);
        EXPECT_EQ(json["meshes"].size(), 3u);
        EXPECT_EQ(json["nodes"][0], scene.json["nodes"][0]);
        EXPECT_EQ(json["nodes"][1]["mesh"], 0);
        EXPECT_EQ(json["nodes"][2]["mesh"], 1);
        EXPECT_EQ(json["nodes"][3]["mesh"], 2);
        EXPECT_EQ(json["meshes"][2]["name"], "sheet");
        EXPECT_EQ(json["meshes"][2]["primitives"][0]["material"], 0);
        EXPECT_EQ(json["meshes"][2]["primitives"][0]["attributes"]["TEXCOORD_0"],
                  json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"]);
        // If all move, nothing is left that nobody shows.
        EXPECT_EQ(json_of(check_moved(name, bytes, -1).bytes)["meshes"].size(), 4u);
        // Numbers that moved once have a place of their own, and are patched there.
        const GeometryFile again = scan_geometry(name, after.bytes);
        EXPECT_EQ(json_of(patched(again, bent(again.geometry, 4.4)))["meshes"].size(),
                  3u);
    }
}

TEST(GltfRebuild, a_mesh_that_a_hidden_node_shows_too_is_left_to_it)
{
    Scene scene;
    const std::size_t mesh = add_mesh(scene, Sheet(4, 2));
    scene.node({{"mesh", mesh}});
    scene.json["nodes"].push_back({{"mesh", mesh}, {"name", "of no scene"}});
    const GeometryFile after = check_moved("x.glb", scene.glb(), 0.5);
    const Json json = json_of(after.bytes);
    EXPECT_EQ(json["nodes"][0]["mesh"], 1);
    EXPECT_EQ(json["nodes"][1]["mesh"], 0);
    EXPECT_EQ(json["meshes"][0], scene.json["meshes"][0]);
}

TEST(GltfRebuild, a_skinned_mesh_moves_in_its_bind_pose_and_keeps_its_skin)
{
    Scene scene;
    const Sheet sheet(4, 3);
    const std::size_t mesh = add_mesh(scene, sheet);
    const std::size_t joints = scene.accessor(
        scene.view(std::string(4 * sheet.count, '\0')), 5121, sheet.count, "VEC4");
    std::vector<float> weights;
    for (std::size_t i = 0; i < sheet.count; ++i)
        weights.insert(weights.end(), {1, 0, 0, 0});
    Json& attributes = scene.json["meshes"][mesh]["primitives"][0]["attributes"];
    attributes["JOINTS_0"] = joints;
    attributes["WEIGHTS_0"] = scene.floats(weights, "VEC4", 4);
    scene.node({{"mesh", mesh}, {"skin", 0}, {"translation", {9, 9, 9}}});
    const std::size_t bone = scene.node({{"name", "bone"}, {"translation", {0, 1, 0}}});
    const std::size_t bind =
        scene.floats({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -1, 0, 1}, "MAT4", 16);
    scene.json["skins"] = {{{"joints", {bone}}, {"inverseBindMatrices", bind}}};
    const GeometryFile after = check_moved("x.glb", scene.glb(), 0.4);
    const Json json = json_of(after.bytes);
    EXPECT_EQ(json["skins"], scene.json["skins"]);
    EXPECT_EQ(json["nodes"], scene.json["nodes"]);
    // It is patched where it stands: no accessor is new.
    EXPECT_EQ(json["accessors"].size(), scene.json["accessors"].size());
    // Two that show one bind pose move alike, and share what comes out.
    scene.node({{"mesh", mesh}, {"skin", 0}, {"translation", {5, 5, 5}}});
    const Json two = json_of(check_moved("x.glb", scene.glb(), 0.4).bytes);
    EXPECT_EQ(two["meshes"].size(), 1u);
    EXPECT_EQ(two["nodes"], scene.json["nodes"]);
}

TEST(GltfRebuild, instances_on_the_gpu_are_read_and_become_nodes_where_they_move)
{
    Scene scene;
    const std::size_t mesh = add_mesh(scene, Sheet(4, 4));
    const double half = std::sqrt(0.5);
    const std::size_t shifts = scene.floats({0, 0, 0, 3, 0, 0, 6, 0, 0}, "VEC3", 3);
    const std::size_t turns =
        scene.floats({0, 0, 0, 1, 0, 0, float(half), float(half), 0, 0, 0, 1}, "VEC4", 4);
    scene.node({{"mesh", mesh},
                {"translation", {0, 0, 1}},
                {"extensions",
                 {{"EXT_mesh_gpu_instancing",
                   {{"attributes", {{"TRANSLATION", shifts}, {"ROTATION", turns}}}}}}}});
    scene.json["extensionsUsed"] = {"EXT_mesh_gpu_instancing", "KHR_lights_punctual"};
    const Geometry geometry = scan_geometry("x.glb", scene.glb()).geometry;
    ASSERT_EQ(geometry.samples.size(), 48u);
    // The second one is turned by 90 degrees.
    EXPECT_LT((geometry.samples[16 + 3] - Vector3d(3 - geometry.samples[3].y(),
                                                   geometry.samples[3].x(),
                                                   geometry.samples[3].z()))
                  .norm(),
              1e-6);
    const GeometryFile after = check_moved("x.glb", scene.glb(), 4);
    const Json json = json_of(after.bytes);
    EXPECT_EQ(json["nodes"].size(), 4u);
    EXPECT_EQ(json["meshes"].size(), 2u);
    EXPECT_FALSE(json["nodes"][0].contains("mesh"));
    EXPECT_FALSE(json["nodes"][0].contains("extensions"));
    EXPECT_EQ(json["extensionsUsed"], Json::array({"KHR_lights_punctual"}));
    Json& many = scene.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"];
    const Json good = many;
    many["attributes"]["ROTATION"] = shifts;
    EXPECT_TRUE(contains(refused(scene.glb()), "ROTATION: accessors[6] is no VEC4"));
    many["attributes"]["ROTATION"] = scene.floats({0, 0, 0, 0}, "VEC4", 4);
    EXPECT_TRUE(contains(refused(scene.glb()), "its attributes differ in count"));
    many["attributes"] = {{"ROTATION", many["attributes"]["ROTATION"]}};
    EXPECT_TRUE(contains(refused(scene.glb()), "element 0 is no rotation"));
    many["attributes"] = {{"OTHER", 0}};
    EXPECT_TRUE(contains(refused(scene.glb()), "need TRANSLATION, ROTATION or SCALE"));
    many = 3;
    EXPECT_TRUE(contains(refused(scene.glb()), "attributes: need an object"));
}

TEST(GltfRebuild, quantised_and_sparse_numbers_become_floats_where_they_move)
{
    Scene scene;
    const Sheet sheet(5, 5);
    const std::size_t mesh = add_mesh(scene, sheet);
    Json& attributes = scene.json["meshes"][mesh]["primitives"][0]["attributes"];
    std::string places, normals;
    for (std::size_t i = 0; i < sheet.count; ++i)
        for (std::size_t k = 0; k < 4; ++k)
        {
            store(k < 3 ? std::round(10000 * sheet.places[3 * i + k]) : 0.0,
                  Scalar::Int16, false, places);
            store(k < 3 ? std::round(127 * sheet.normals[3 * i + k]) : 0.0, Scalar::Int8,
                  false, normals);
        }
    attributes["POSITION"] =
        scene.accessor(scene.view(places, 8), 5122, sheet.count, "VEC3");
    attributes["NORMAL"] =
        scene.accessor(scene.view(normals, 4), 5120, sheet.count, "VEC3");
    scene.json["accessors"][attributes["NORMAL"].get<std::size_t>()]["normalized"] = true;
    scene.json["extensionsRequired"] = {"KHR_mesh_quantization"};
    scene.node({{"mesh", mesh}, {"scale", {1e-4, 1e-4, 1e-4}}});
    const GeometryFile after = check_moved("x.glb", scene.glb(), 0.3);
    const Json json = json_of(after.bytes);
    // The accessors have new numbers: there are no others.
    EXPECT_EQ(json["accessors"].size(), scene.json["accessors"].size());
    EXPECT_EQ(json["accessors"][6]["componentType"], 5126);
    EXPECT_FALSE(json["accessors"][7].contains("normalized"));

    Scene thin;
    const std::size_t other = add_mesh(thin, sheet);
    const std::size_t at = thin.view(std::string("\3\0\5\0", 4));
    const std::size_t values = thin.view(std::string(24, '\0'));
    thin.json["accessors"][2]["sparse"] = {
        {"count", 2},
        {"indices", {{"bufferView", at}, {"componentType", 5123}}},
        {"values", {{"bufferView", values}}}};
    thin.node({{"mesh", other}});
    const GeometryFile dense = check_moved("x.glb", thin.glb(), 0.3);
    EXPECT_FALSE(json_of(dense.bytes)["accessors"][2].contains("sparse"));
}

TEST(GltfRebuild, numbers_that_meshes_share_part_where_they_move)
{
    Scene scene;
    const std::size_t mesh = add_mesh(scene, Sheet(4, 6));
    scene.json["meshes"].push_back(scene.json["meshes"][mesh]);
    scene.node({{"mesh", 0}});
    scene.node({{"mesh", 1}, {"translation", {2, 0, 0}}});
    check_moved("x.glb", scene.glb(), 1.5);
    // An accessor over the same bytes, of another attribute.
    Scene other;
    add_mesh(other, Sheet(4, 7));
    other.json["accessors"].push_back(other.json["accessors"][2]);
    other.json["meshes"][0]["primitives"][0]["attributes"]["_REST"] = 6;
    other.node({{"mesh", 0}});
    const GeometryFile before = scan_geometry("x.glb", other.glb());
    const GeometryFile after = check_moved("x.glb", other.glb(), 0.5);
    EXPECT_EQ(attribute_of(after, "_REST"), attribute_of(before, "_REST"));
    // And one accessor for both.
    other.json["meshes"][0]["primitives"][0]["attributes"]["_REST"] = 2;
    EXPECT_EQ(attribute_of(check_moved("x.glb", other.glb(), 0.5), "_REST"),
              attribute_of(before, "_REST"));
    // One list of normals for two lists of positions.
    Scene twice;
    add_mesh(twice, Sheet(4, 8));
    const std::size_t second = add_mesh(twice, Sheet(4, 9));
    Json primitive = twice.json["meshes"][second]["primitives"][0];
    primitive["attributes"]["NORMAL"] = 3;
    twice.json["meshes"][0]["primitives"].push_back(primitive);
    twice.node({{"mesh", 0}});
    check_moved("x.glb", twice.glb(), 0.5);
}

TEST(GltfRebuild, draco_is_read_and_written_uncompressed)
{
    for (const bool is_sequential : {false, true})
    {
        SCOPED_TRACE(is_sequential);
        const Sheet sheet(9, 10);
        Scene scene = draco_scene(sheet, is_sequential);
        const std::size_t hull = scene.json["buffers"][0]["byteLength"];
        scene.node({{"mesh", 0}, {"translation", {1, 0, 0}}});
        const GeometryFile file = scan_geometry("x.glb", scene.glb());
        ASSERT_EQ(file.geometry.samples.size(), sheet.count);
        ASSERT_EQ(file.geometry.corners.size(), sheet.corners.size());
        // The encoder puts vertices and triangles in another order.
        for (std::size_t f = 0; f < file.geometry.num_faces(); ++f)
            for (const std::uint32_t corner : file.geometry.face(f))
            {
                const Vector3d x = file.geometry.samples[corner] - Vector3d(1, 0, 0);
                const double i = 8 * x.x(), j = 8 * x.y();
                EXPECT_LT(std::abs(i - std::round(i)) + std::abs(j - std::round(j)),
                          1e-3);
                const auto k =
                    static_cast<std::size_t>(std::round(j) * 9 + std::round(i));
                EXPECT_NEAR(x.z(), sheet.places[3 * k + 2], 1e-4);
                EXPECT_NEAR(file.geometry.directions[corner].x(), sheet.normals[3 * k],
                            0.01);
            }
        EXPECT_TRUE(contains(file.geometry.warnings.at(0), "holds compressed data"));
        const GeometryFile after = check_moved("x.glb", scene.glb(), 1.2);
        const Json json = json_of(after.bytes);
        EXPECT_FALSE(json.contains("extensionsUsed"));
        EXPECT_FALSE(json.contains("extensionsRequired"));
        EXPECT_FALSE(json["meshes"][0]["primitives"][0].contains("extensions"));
        EXPECT_TRUE(after.geometry.warnings.empty());
        EXPECT_FALSE(after.gltf->is_packed);
        // The compressed bytes are gone.
        const std::size_t numbers =
            sheet.count * (3 + 3 + 4 + 2 + 4) * 4 + 2 * sheet.corners.size();
        EXPECT_LT(json["buffers"][0]["byteLength"].get<std::size_t>(),
                  numbers + 8 * 6 + 16);
        EXPECT_GT(hull, 100u);
        EXPECT_EQ(unpacked_gltf_bytes(scene.json.dump()), double(numbers));
        // Two instances of it, of which one moves.
        scene.node({{"mesh", 0}, {"translation", {5, 0, 0}}});
        check_moved("x.glb", scene.glb(), 4);
        check_moved("x.gltf", scene.gltf(), 4);
    }
}

TEST(GltfRebuild, draco_beside_what_is_not_compressed_leaves_that_alone)
{
    Scene scene = draco_scene(Sheet(7, 11), false);
    const std::size_t plain = add_mesh(scene, Sheet(5, 12));
    std::map<std::string, int> ids;
    scene.node({{"mesh", 0}});
    scene.node({{"mesh", plain}, {"translation", {3, 0, 0}}});
    check_moved("x.glb", scene.glb(), 0.5);
    // Only the other one moves: it has its place, and the rest stays compressed.
    const GeometryFile after = check_moved("x.glb", scene.glb(), 3.2);
    EXPECT_TRUE(after.gltf->is_packed);
}

TEST(GltfRebuild, draco_that_lies_is_refused)
{
    const Sheet sheet(6, 13);
    for (const bool is_sequential : {false, true})
    {
        Scene scene = draco_scene(sheet, is_sequential);
        scene.node({{"mesh", 0}});
        Json& json = scene.json;
        const Json good = json;
        const auto primitive = [&]() -> Json&
        { return json["meshes"][0]["primitives"][0]; };
        const auto packed = [&]() -> Json&
        { return primitive()["extensions"]["KHR_draco_mesh_compression"]; };
        const auto reason = [&]
        {
            const std::string message = refused(scene.glb());
            json = good;
            return message;
        };
        for (int a = 0; a < 5; ++a)
            json["accessors"][a]["count"] = 35;
        EXPECT_TRUE(contains(reason(), "holds 36 vertices, its accessors 35"));
        json["accessors"][5]["count"] = 147;
        EXPECT_TRUE(contains(reason(), "holds 50 triangles, its accessors 49"));
        json["accessors"][0]["count"] = 37;
        EXPECT_TRUE(contains(reason(), "its attributes differ in count"));
        packed()["attributes"]["NORMAL"] = 17;
        EXPECT_TRUE(contains(reason(), "has no attribute 17"));
        packed()["attributes"]["TANGENT"] = packed()["attributes"]["NORMAL"];
        EXPECT_TRUE(contains(reason(), "numbers a vertex, need 4"));
        packed()["attributes"]["JOINTS_0"] = 5;
        EXPECT_TRUE(contains(reason(), "the primitive has no 'JOINTS_0'"));
        packed().erase("bufferView");
        EXPECT_TRUE(contains(reason(), "bufferView: is missing"));
        packed()["attributes"] = 1;
        EXPECT_TRUE(contains(reason(), "attributes: need an object"));
        primitive().erase("indices");
        EXPECT_TRUE(contains(reason(), "need attributes and indices"));
        primitive()["mode"] = 5;
        EXPECT_TRUE(contains(reason(), "need triangles"));
        packed() = 7;
        EXPECT_TRUE(contains(reason(), "need an object"));
        // More than stands there may be asked for.
        for (int a = 0; a < 5; ++a)
            json["accessors"][a]["count"] = 40;
        EXPECT_EQ(scan_geometry("x.glb", scene.glb()).geometry.samples.size(), 36u);
        json = good;
        scene.body[5] = '\1';
        EXPECT_TRUE(contains(reason(), "version 1.2 of Draco's format, need 2.2"));
        scene.body[0] = 'X';
        EXPECT_TRUE(contains(reason(), "is no Draco data"));
    }
}

TEST(GltfRebuild, meshopt_is_read_and_written_uncompressed)
{
    for (const bool is_fallback_named : {true, false})
    {
        Scene scene;
        add_mesh(scene, Sheet(9, 14));
        add_mesh(scene, Sheet(6, 15));
        scene.node({{"mesh", 0}});
        scene.node({{"mesh", 1}, {"translation", {4, 0, 0}}});
        const GeometryFile plain = scan_geometry("x.glb", scene.glb());
        pack_views(scene, is_fallback_named);
        const GeometryFile file = scan_geometry("x.glb", scene.glb());
        EXPECT_EQ(file.geometry.samples, plain.geometry.samples);
        EXPECT_EQ(file.geometry.directions, plain.geometry.directions);
        ASSERT_EQ(file.geometry.num_faces(), plain.geometry.num_faces());
        // Triangles may begin with another corner.
        for (std::size_t f = 0; f < file.geometry.num_faces(); ++f)
        {
            std::multiset<std::uint32_t> a(file.geometry.face(f).begin(),
                                           file.geometry.face(f).end()),
                b(plain.geometry.face(f).begin(), plain.geometry.face(f).end());
            EXPECT_EQ(a, b);
        }
        const GeometryFile after = check_moved("x.glb", scene.glb(), 0.7);
        const Json json = json_of(after.bytes);
        EXPECT_EQ(json["buffers"].size(), 1u);
        EXPECT_FALSE(json.contains("extensionsUsed"));
        EXPECT_FALSE(contains(json.dump(), "meshopt"));
        EXPECT_FALSE(after.gltf->is_packed);
        EXPECT_GT(unpacked_gltf_bytes(scene.json.dump()), 5000.0);
    }
}

TEST(GltfRebuild, filters_of_meshopt_are_undone)
{
    Scene scene;
    const Sheet sheet(8, 16);
    add_mesh(scene, sheet);
    std::vector<float> four;
    for (std::size_t i = 0; i < sheet.count; ++i)
        four.insert(four.end(), {sheet.normals[3 * i], sheet.normals[3 * i + 1],
                                 sheet.normals[3 * i + 2], 0.0f});
    std::string normals(sheet.count * 4, '\0'), places(sheet.count * 12, '\0');
    meshopt_encodeFilterOct(normals.data(), sheet.count, 4, 8, four.data());
    meshopt_encodeFilterExp(places.data(), sheet.count, 12, 15, sheet.places.data());
    Json& attributes = scene.json["meshes"][0]["primitives"][0]["attributes"];
    const std::size_t view = scene.view(normals, 4);
    attributes["NORMAL"] = scene.accessor(view, 5120, sheet.count, "VEC3");
    scene.json["accessors"][6]["normalized"] = true;
    attributes["POSITION"] =
        scene.accessor(scene.view(places, 12), 5126, sheet.count, "VEC3");
    scene.json["extensionsUsed"] = {"KHR_mesh_quantization"};
    scene.node({{"mesh", 0}});
    pack_views(scene);
    Json& views = scene.json["bufferViews"];
    Json& packed = views[view]["extensions"]["EXT_meshopt_compression"];
    packed["filter"] = "OCTAHEDRAL";
    views[view + 1]["extensions"]["EXT_meshopt_compression"]["filter"] = "EXPONENTIAL";
    const GeometryFile file = scan_geometry("x.glb", scene.glb());
    for (std::size_t i = 0; i < sheet.count; ++i)
        for (std::size_t k = 0; k < 3; ++k)
        {
            EXPECT_NEAR(file.geometry.directions[i][Eigen::Index(k)],
                        sheet.normals[3 * i + k], 0.02);
            EXPECT_NEAR(file.geometry.samples[i][Eigen::Index(k)],
                        sheet.places[3 * i + k], 1e-3);
        }
    check_moved("x.glb", scene.glb(), 0.5);
    packed["filter"] = "QUATERNION";
    EXPECT_TRUE(contains(refused(scene.glb()), "got 4, need 8 for its filter"));
    packed["filter"] = "OTHER";
    EXPECT_TRUE(contains(refused(scene.glb()), "filter: is unknown"));
}

TEST(GltfRebuild, meshopt_that_lies_is_refused)
{
    Scene scene;
    add_mesh(scene, Sheet(6, 17));
    scene.node({{"mesh", 0}});
    pack_views(scene);
    Json& json = scene.json;
    const Json good = json;
    const auto view = [&](int number) -> Json&
    { return json["bufferViews"][number]["extensions"]["EXT_meshopt_compression"]; };
    const auto reason = [&]
    {
        const std::string message = refused(scene.glb());
        json = good;
        return message;
    };
    view(2)["count"] = 1 << 20;
    EXPECT_TRUE(contains(reason(), "are more than its"));
    view(2)["byteStride"] = 3;
    EXPECT_TRUE(contains(reason(), "byteStride: got 3, need a multiple of 4"));
    view(5)["byteStride"] = 3;
    EXPECT_TRUE(contains(reason(), "byteStride: got 3, need 2 or 4"));
    view(5)["filter"] = "EXPONENTIAL";
    EXPECT_TRUE(contains(reason(), "indices have none"));
    view(5)["mode"] = "TRIANGLES";
    view(5)["count"] = 7;
    EXPECT_TRUE(contains(reason(), "count: got 7, need a multiple of 3"));
    view(2)["mode"] = "ODD";
    EXPECT_TRUE(contains(reason(), "mode: is unknown"));
    view(2)["byteLength"] = 5;
    EXPECT_TRUE(contains(reason(), "bytes and its view can hold"));
    view(2)["byteLength"] = view(2)["byteLength"].get<int>() - 3;
    EXPECT_TRUE(contains(reason(), "cannot be unpacked"));
    view(2)["byteOffset"] = 1 << 20;
    EXPECT_TRUE(contains(reason(), "lies outside of its buffer"));
    view(2)["buffer"] = 1;
    EXPECT_TRUE(contains(reason(), "buffers[1]: has no data"));
    view(2).erase("buffer");
    EXPECT_TRUE(contains(reason(), "buffer: is missing"));
    view(2) = 1;
    EXPECT_TRUE(contains(reason(), "need an object"));
    json["buffers"][1]["byteLength"] = 1ull << 40;
    EXPECT_TRUE(contains(reason(), "buffers[1].byteLength: got 1099511627776, more"));
    // Many buffers, each of which could be.
    for (int k = 2; k < 70; ++k)
    {
        json["buffers"].push_back({{"byteLength", 64 * scene.body.size()}});
        Json more = json["bufferViews"][2];
        more["buffer"] = k;
        json["bufferViews"].push_back(more);
    }
    EXPECT_TRUE(contains(reason(), "byteLength: got"));
    // A fallback that is there is taken, whatever the compressed bytes are.
    json["buffers"][1]["uri"] =
        "data:;base64," + base64_encoded(std::string(
                              json["buffers"][1]["byteLength"].get<std::size_t>(), '\0'));
    view(2)["count"] = 1 << 30;
    EXPECT_EQ(scan_geometry("x.glb", scene.glb()).geometry.samples.size(), 36u);
}

TEST(GltfRebuild, damaged_data_end_in_an_error_or_in_a_model)
{
    std::vector<Scene> scenes = {draco_scene(Sheet(5, 18), false),
                                 draco_scene(Sheet(5, 19), true), Scene()};
    add_mesh(scenes[2], Sheet(6, 20));
    for (Scene& scene : scenes)
        scene.node({{"mesh", 0}});
    pack_views(scenes[2]);
    // More of them by hand: CELLWARP_MUTATIONS=20000
    const char* const wanted = std::getenv("CELLWARP_MUTATIONS");
    const int count = wanted ? std::atoi(wanted) : 300;
    std::mt19937 random(21);
    for (const Scene& scene : scenes)
    {
        int read = 0;
        for (int k = 0; k < count; ++k)
        {
            SCOPED_TRACE(k);
            Scene bad = scene;
            const int changes = 1 + int(random() % 3);
            for (int c = 0; c < changes; ++c)
                bad.body[random() % bad.body.size()] =
                    static_cast<char>(random() % 4 == 0 ? 0xff : random());
            if (random() % 5 == 0)
                std::fill(bad.body.begin() + long(random() % bad.body.size()),
                          bad.body.end(), '\0');
            try
            {
                const GeometryFile file = scan_geometry("x.glb", bad.glb());
                ++read;
                const std::string bytes = patched(file, bent(file.geometry, 0.5));
                EXPECT_EQ(scan_geometry("x.glb", bytes).geometry.samples.size(),
                          file.geometry.samples.size());
            }
            catch (const Error& error)
            {
                EXPECT_EQ(error.fault(), Fault::Malformed) << error.what();
            }
        }
        EXPECT_GT(read, 0);
        EXPECT_LT(read, count);
    }
}

TEST(GltfRebuild, a_stream_keeps_to_the_memory_that_it_is_given)
{
    const support::Folder folder;
    Scene scene = draco_scene(Sheet(30, 22), false);
    scene.node({{"mesh", 0}});
    const std::string path = folder.write("x.glb", scene.glb());
    StreamOptions options;
    options.max_whole_memory = 100000;
    StreamWork work;
    work.move = [](const PartMotion& part) { bend(part, 0.5); };
    work.run = [](std::size_t count, const std::function<void(std::size_t)>& job)
    {
        for (std::size_t i = 0; i < count; ++i)
            job(i);
    };
    const auto stream = [&]
    {
        OutputSet outputs(Overwrite::No);
        stream_geometry(path, folder / "y.glb", outputs, options, work);
        outputs.commit();
    };
    EXPECT_TRUE(
        contains(error_of(Fault::Budget, stream), "is read whole and needs about"));
    EXPECT_FALSE(std::filesystem::exists(folder / "y.glb"));
    options.max_whole_memory = 0;
    stream();
    EXPECT_TRUE(std::filesystem::exists(folder / "y.glb"));
}

} // namespace cellwarp::core
