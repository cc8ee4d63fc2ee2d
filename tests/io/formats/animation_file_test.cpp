// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/animation_file.h"

#include <bit>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <set>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "io/formats/geometry_file.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::error_of;

namespace
{

using Eigen::Vector3d;
using Json = nlohmann::json;

class AnimationFileTest : public testing::Test
{
protected:
    AnimationFileTest() { std::filesystem::create_directories(folder_); }
    ~AnimationFileTest() override { std::filesystem::remove_all(folder_); }

    /// A square of two triangles far from the origin, moved up by 1 and by 2.
    std::string written(const std::string& name)
    {
        const GeometryFile file = scan_geometry(
            "a.obj", "v 1000 0 0\nv 1001 0 0\nv 1001 1 0\nv 1000 1 0\nf 1 2 3 4\n");
        const std::string path = folder_ + "/" + name;
        OutputSet outputs(Overwrite::No);
        AnimationFile out(path, outputs, file.geometry, {0.0, 0.5});
        for (const double up : {1.0, 2.0})
        {
            std::vector<Vector3d> samples = file.geometry.samples;
            for (Vector3d& x : samples)
                x.z() += up;
            out.add(samples);
        }
        EXPECT_FALSE(std::filesystem::exists(path)); // before it is whole
        out.finish();
        outputs.commit();
        return read_file(path);
    }

    const std::string folder_ =
        testing::TempDir() + "/animation" +
        testing::UnitTest::GetInstance()->current_test_info()->name();
};

float number_at(const std::string& bytes, std::size_t at, bool is_big_endian)
{
    std::uint32_t word = 0;
    for (unsigned k = 0; k < 4; ++k)
        word |= std::uint32_t(std::uint8_t(bytes[at + (is_big_endian ? 3 - k : k)]))
                << (8 * k);
    return std::bit_cast<float>(word);
}

std::uint32_t word_at(const std::string& bytes, std::size_t at, bool is_big_endian)
{
    return std::bit_cast<std::uint32_t>(number_at(bytes, at, is_big_endian));
}

} // namespace

TEST_F(AnimationFileTest, a_pc2_holds_every_place_of_every_frame)
{
    const std::string bytes = written("a.pc2");
    EXPECT_EQ(bytes.substr(0, 12), std::string("POINTCACHE2\0", 12));
    EXPECT_EQ(word_at(bytes, 12, false), 1u);
    EXPECT_EQ(word_at(bytes, 16, false), 4u);
    EXPECT_EQ(word_at(bytes, 28, false), 2u);
    ASSERT_EQ(bytes.size(), 32u + 2 * 4 * 12);
    EXPECT_EQ(number_at(bytes, 32, false), 1000.0f);
    EXPECT_EQ(number_at(bytes, 40, false), 1.0f);
    EXPECT_EQ(number_at(bytes, 32 + 48 + 8, false), 2.0f);
}

TEST_F(AnimationFileTest, an_mdd_is_big_endian_and_has_the_times)
{
    const std::string bytes = written("a.mdd");
    EXPECT_EQ(word_at(bytes, 0, true), 2u);
    EXPECT_EQ(word_at(bytes, 4, true), 4u);
    EXPECT_EQ(number_at(bytes, 12, true), 0.5f);
    ASSERT_EQ(bytes.size(), 16u + 2 * 4 * 12);
    EXPECT_EQ(number_at(bytes, 16 + 8, true), 1.0f);
}

TEST_F(AnimationFileTest, a_glb_has_a_morph_target_a_frame)
{
    const std::string bytes = written("a.glb");
    ASSERT_EQ(bytes.substr(0, 4), "glTF");
    ASSERT_EQ(word_at(bytes, 8, false), bytes.size());
    const std::size_t length = word_at(bytes, 12, false);
    const Json json = Json::parse(bytes.substr(20, length));
    const std::size_t body = 28 + length;
    const Json& primitive = json["meshes"][0]["primitives"][0];
    ASSERT_EQ(primitive["targets"].size(), 2u);
    EXPECT_EQ(json["nodes"][0]["translation"][0], 1000.5);
    const auto view = [&](std::size_t accessor) -> const Json&
    { return json["bufferViews"][json["accessors"][accessor]["bufferView"].get<int>()]; };
    // About the middle: floats keep their digits.
    const std::size_t rest = body + view(0)["byteOffset"].get<std::size_t>();
    EXPECT_EQ(number_at(bytes, rest, false), -0.5f);
    const std::size_t target = primitive["targets"][1]["POSITION"];
    const std::size_t way = body + view(target)["byteOffset"].get<std::size_t>();
    EXPECT_EQ(number_at(bytes, way + 8, false), 2.0f);
    EXPECT_EQ(json["accessors"][target]["max"][2], 2.0);
    EXPECT_EQ(json["accessors"][primitive["indices"].get<std::size_t>()]["count"], 6);
    const Json& sampler = json["animations"][0]["samplers"][0];
    EXPECT_EQ(json["accessors"][sampler["input"].get<std::size_t>()]["max"][0], 0.5);
    EXPECT_EQ(json["accessors"][sampler["output"].get<std::size_t>()]["count"], 4);
    EXPECT_EQ(json["buffers"][0]["byteLength"], bytes.size() - body);
    // Our own reader takes it: the mesh at rest.
    const GeometryFile again = scan_geometry("a.glb", bytes);
    EXPECT_EQ(again.geometry.samples[2], Vector3d(1001, 1, 0));
    EXPECT_EQ(again.geometry.num_faces(), 2u);
}

TEST_F(AnimationFileTest, colours_of_a_glb_are_shares_of_light)
{
    const GeometryFile file = scan_geometry(
        "a.ply", "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\n"
                 "property float y\nproperty float z\nproperty uchar red\n"
                 "property uchar green\nproperty uchar blue\nend_header\n"
                 "0 0 0 128 255 0\n1 0 0 1 2 3\n0 1 0 10 11 188\n");
    const std::string path = folder_ + "/colours.glb";
    OutputSet outputs(Overwrite::No);
    AnimationFile out(path, outputs, file.geometry, {0.0});
    out.add(file.geometry.samples);
    out.finish();
    outputs.commit();
    const std::string bytes = read_file(path);
    const std::size_t length = word_at(bytes, 12, false);
    const Json json = Json::parse(bytes.substr(20, length));
    const Json& attributes = json["meshes"][0]["primitives"][0]["attributes"];
    const Json& colours = json["accessors"][attributes["COLOR_0"].get<std::size_t>()];
    EXPECT_EQ(colours["componentType"], 5123);
    EXPECT_EQ(colours["normalized"], true);
    EXPECT_EQ(colours["type"], "VEC4");
    const Json& view = json["bufferViews"][colours["bufferView"].get<std::size_t>()];
    const std::size_t start = 28 + length + view["byteOffset"].get<std::size_t>();
    const auto share = [&](std::size_t vertex, std::size_t k)
    {
        const std::uint32_t pair =
            word_at(bytes, start + 8 * vertex + 4 * (k / 2), false);
        return k % 2 == 0 ? pair & 0xffff : pair >> 16;
    };
    // sRGB's curve: 128 is 0.21586 of the light, 188 is 0.50289, 1 is 1 / (255 * 12.92).
    EXPECT_EQ(share(0, 0), std::lround(65535 * 0.2158605));
    EXPECT_EQ(share(0, 1), 65535u);
    EXPECT_EQ(share(0, 2), 0u);
    EXPECT_EQ(share(0, 3), 65535u);
    EXPECT_EQ(share(1, 0), std::lround(65535 / (255 * 12.92)));
    EXPECT_EQ(share(2, 2), std::lround(65535 * 0.5028865));
    // Dark steps stay apart.
    EXPECT_LT(share(1, 0), share(1, 1));
    EXPECT_LT(share(2, 0), share(2, 1));
}

TEST_F(AnimationFileTest, texture_coordinates_and_groups_survive_into_a_glb)
{
    // Two squares that share an edge, with a seam there; a loose point; a face without a
    // group, and a group that comes back.
    const GeometryFile file = scan_geometry(
        "a.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 2 0 0\nv 2 1 0\nv 9 9 9\n"
                 "v 3 0 0\nvt 0 0\nvt 0.5 0\nvt 0.5 1\nvt 0 \\\n1\nvt 0.75 0.25\n"
                 "f 2/2 5/5 6/5\ng left\nf 1/1 2/2 3/3 4/4 # 9/9\ng \"right\"\n"
                 "f 2/1 5/-1 6/5 \\\n 3/4\ng left\nf 5 8 6\n");
    const std::vector<TextureCoordinate> texture = texture_coordinates(file);
    ASSERT_EQ(texture.size(), file.geometry.corners.size());
    EXPECT_EQ(texture[3], (TextureCoordinate{0.0f, 1.0f}));
    EXPECT_EQ(texture[6], (TextureCoordinate{0.0f, 0.0f}));
    EXPECT_EQ(texture[8], (TextureCoordinate{0.75f, 0.75f}));
    for (const bool is_still : {true, false})
    {
        const std::string path = folder_ + (is_still ? "/still.glb" : "/moves.glb");
        OutputSet outputs(Overwrite::No);
        AnimationFile out(path, outputs, file.geometry,
                          is_still ? std::vector{0.0} : std::vector{0.0, 1.0}, {},
                          texture);
        std::vector<Vector3d> samples = file.geometry.samples;
        for (int frame = 0; frame < (is_still ? 1 : 2); ++frame)
        {
            for (Vector3d& x : samples)
                x.z() += 1;
            out.add(samples);
        }
        out.finish();
        outputs.commit();
        const std::string bytes = read_file(path);
        const GeometryFile again = scan_geometry("a.glb", bytes);
        const Json json = Json::parse(bytes.substr(20, word_at(bytes, 12, false)));
        const Json& primitives = json["meshes"][0]["primitives"];
        ASSERT_EQ(primitives.size(), 3u);
        EXPECT_FALSE(primitives[0].contains("material"));
        EXPECT_EQ(json["materials"][primitives[1]["material"].get<int>()]["name"],
                  "left");
        EXPECT_EQ(json["materials"][primitives[2]["material"].get<int>()]["name"],
                  "\"right\"");
        // Every corner has its place and its coordinate; groups stand together.
        const std::vector<TextureCoordinate> read = texture_coordinates(again);
        ASSERT_EQ(again.geometry.num_faces(), 6u);
        ASSERT_EQ(read.size(), 18u);
        std::set<std::array<double, 5>> of_model, of_copy;
        for (std::size_t c = 0; c < texture.size(); ++c)
        {
            const Vector3d& x = file.geometry.samples[file.geometry.corners[c]];
            of_model.insert({x.x(), x.y(), x.z() + (is_still ? 1.0 : 0.0), texture[c][0],
                             texture[c][1]});
        }
        for (std::size_t c = 0; c < read.size(); ++c)
        {
            const Vector3d& x = again.geometry.samples[again.geometry.corners[c]];
            of_copy.insert({x.x(), x.y(), x.z(), read[c][0], read[c][1]});
        }
        EXPECT_EQ(of_copy, of_model);
        // The loose point is there as well, and nothing else.
        EXPECT_EQ(again.geometry.samples.size(), of_model.size() + 1);
    }
}

TEST_F(AnimationFileTest, a_glb_is_shown_with_normals_where_there_are_some)
{
    const GeometryFile file =
        scan_geometry("a.obj", "v 0 0 0\nv 2 0 0\nv 2 2 0\nf 1 2 3\n");
    // Towards z at rest, and towards x where the first sample has moved.
    const auto normals = [](std::span<const Vector3d> samples)
    {
        return std::vector<Vector3d>(
            samples.size(), samples[0].x() > 0.5 ? Vector3d::UnitX() : Vector3d::UnitZ());
    };
    const auto numbers_of =
        [&](const std::string& name, const std::vector<double>& times, bool is_target)
    {
        OutputSet outputs(Overwrite::No);
        AnimationFile out(folder_ + "/" + name, outputs, file.geometry, times, normals);
        for (std::size_t k = 0; k < times.size(); ++k)
            out.add({{1, 0, 0}, {2, 0, 0}, {2, 2, 0}});
        out.finish();
        outputs.commit();
        const std::string bytes = read_file(folder_ + "/" + name);
        const std::size_t length = word_at(bytes, 12, false);
        const Json json = Json::parse(bytes.substr(20, length));
        EXPECT_EQ(json["buffers"][0]["byteLength"], bytes.size() - 28 - length);
        const Json& primitive = json["meshes"][0]["primitives"][0];
        const std::size_t accessor = is_target ? primitive["targets"][0]["NORMAL"]
                                               : primitive["attributes"]["NORMAL"];
        EXPECT_EQ(json["accessors"][accessor]["count"], 3);
        const std::size_t view = json["accessors"][accessor]["bufferView"];
        const std::size_t at =
            28 + length + json["bufferViews"][view]["byteOffset"].get<std::size_t>();
        return Vector3d(number_at(bytes, at, false), number_at(bytes, at + 4, false),
                        number_at(bytes, at + 8, false));
    };
    EXPECT_EQ(numbers_of("still.glb", {0.0}, false), Vector3d(1, 0, 0));
    EXPECT_EQ(numbers_of("rest.glb", {0.0, 1.0}, false), Vector3d(0, 0, 1));
    EXPECT_EQ(numbers_of("moved.glb", {0.0, 1.0}, true), Vector3d(1, 0, -1));
    EXPECT_EQ(scan_geometry("rest.glb", read_file(folder_ + "/rest.glb"))
                  .geometry.samples.size(),
              3u);
}

TEST_F(AnimationFileTest, a_glb_of_one_frame_is_the_mesh_as_that_has_it)
{
    const GeometryFile file =
        scan_geometry("a.obj", "v 0 0 0\nv 2 0 0\nv 2 2 0\nf 1 2 3\n");
    const std::string path = folder_ + "/still.glb";
    OutputSet outputs(Overwrite::No);
    AnimationFile out(path, outputs, file.geometry, {3.0});
    out.add({{0, 0, 5}, {2, 0, 5}, {2, 2, 7}});
    out.finish();
    outputs.commit();
    const std::string bytes = read_file(path);
    const Json json = Json::parse(bytes.substr(20, word_at(bytes, 12, false)));
    EXPECT_FALSE(json.contains("animations"));
    EXPECT_FALSE(json["meshes"][0].contains("weights"));
    EXPECT_FALSE(json["meshes"][0]["primitives"][0].contains("targets"));
    const GeometryFile again = scan_geometry("still.glb", bytes);
    EXPECT_EQ(again.geometry.samples[2], Vector3d(2, 2, 7));
    EXPECT_EQ(again.geometry.num_faces(), 1u);
    EXPECT_TRUE(again.geometry.not_writable.empty());
}

TEST_F(AnimationFileTest, what_is_not_committed_leaves_nothing)
{
    const GeometryFile file = scan_geometry("a.obj", "v 0 0 0\nv 1 0 0\n");
    {
        OutputSet outputs(Overwrite::No);
        AnimationFile out(folder_ + "/b.pc2", outputs, file.geometry, {0.0});
        out.add(file.geometry.samples);
    }
    EXPECT_TRUE(std::filesystem::is_empty(folder_));
}

TEST_F(AnimationFileTest, what_does_not_fit_is_refused)
{
    const GeometryFile file = scan_geometry("a.obj", "v 0 0 0\nv 1e60 0 0\n");
    OutputSet outputs(Overwrite::No);
    AnimationFile out(folder_ + "/b.pc2", outputs, file.geometry, {0.0});
    EXPECT_TRUE(contains(
        error_of(Fault::Malformed, [&] { out.add(file.geometry.samples); }), "32 bits"));
}

TEST_F(AnimationFileTest, a_glb_of_a_glb_is_a_patch_but_of_a_skinned_one)
{
    EXPECT_TRUE(is_animation_format("pc2", "obj", true));
    EXPECT_TRUE(is_animation_format("mdd", "glb", true));
    EXPECT_TRUE(is_animation_format("glb", "obj", true));
    EXPECT_FALSE(is_animation_format("glb", "glb", true));
    EXPECT_FALSE(is_animation_format("glb", "gltf", true));
    EXPECT_TRUE(is_animation_format("glb", "glb", false));
    EXPECT_FALSE(is_animation_format("obj", "obj", true));
}

} // namespace cellwarp::core
