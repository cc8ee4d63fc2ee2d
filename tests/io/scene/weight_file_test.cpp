// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/scene/weight_file.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "io/base/error.h"
#include "io/formats/stored_number.h"
#include "tests/support/files.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::error_of;

TEST(WeightFile, lines_are_samples_and_columns_joints)
{
    const PaintedWeights weights =
        parse_weights("w.txt", "cellwarp-weights 1 # by hand\n\n"
                               "root, \"left arm\" head\n"
                               "1,0,0\r\n0.25\t0.5 0.25 # mixed\n0 0 2e0\n");
    ASSERT_EQ(weights.joints, (std::vector<std::string>{"root", "left arm", "head"}));
    ASSERT_EQ(weights.num_samples(), 3u);
    EXPECT_EQ(weights.values, (std::vector<double>{1, 0, 0, 0.25, 0.5, 0.25, 0, 0, 2}));
}

namespace
{

/// Three points with a skin of two joints, and one without.
nlohmann::json skinned(support::Folder& folder)
{
    std::string bytes;
    const auto add = [&](std::initializer_list<double> values, Scalar type)
    {
        for (const double value : values)
            store(value, type, false, bytes);
    };
    add({0, 0, 0, 1, 0, 0, 2, 0, 0}, Scalar::Float32);                    // 0, 36
    add({0, 1, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0}, Scalar::UInt8);             // 36, 12
    add({0.5, 0.5, 0, 0, 1, 0, 0, 0, 0.25, 0.75, 0, 0}, Scalar::Float32); // 48, 48
    folder.write("rig.bin", bytes);
    return {
        {"asset", {{"version", "2.0"}}},
        {"nodes",
         {{{"name", "foot"}, {"children", {1, 2}}},
          {{"name", "knee"}, {"translation", {1, 0, 0}}},
          {{"mesh", 0}, {"skin", 0}},
          {{"mesh", 1}}}},
        {"meshes",
         {{{"primitives",
            {{{"attributes", {{"POSITION", 0}, {"JOINTS_0", 1}, {"WEIGHTS_0", 2}}},
              {"mode", 0}}}}},
          {{"primitives", {{{"attributes", {{"POSITION", 0}}}, {"mode", 0}}}}}}},
        {"skins", {{{"joints", {1, 0}}}}},
        {"accessors",
         {{{"bufferView", 0}, {"componentType", 5126}, {"count", 3}, {"type", "VEC3"}},
          {{"bufferView", 1}, {"componentType", 5121}, {"count", 3}, {"type", "VEC4"}},
          {{"bufferView", 2}, {"componentType", 5126}, {"count", 3}, {"type", "VEC4"}}}},
        {"bufferViews",
         {{{"buffer", 0}, {"byteOffset", 0}, {"byteLength", 36}},
          {{"buffer", 0}, {"byteOffset", 36}, {"byteLength", 12}},
          {{"buffer", 0}, {"byteOffset", 48}, {"byteLength", 48}}}},
        {"buffers", {{{"byteLength", bytes.size()}, {"uri", "rig.bin"}}}}};
}

} // namespace

TEST(WeightFile, a_skin_has_weights_for_the_samples_of_its_mesh)
{
    support::Folder folder;
    const nlohmann::json usual = skinned(folder);
    const PaintedWeights weights = read_weights(folder.write("rig.gltf", usual.dump()));
    ASSERT_EQ(weights.joints, (std::vector<std::string>{"foot", "knee"}));
    // Slots 0 and 1 of the skin are knee and foot; samples without a skin have none.
    EXPECT_EQ(weights.values, (std::vector<double>{0.5, 0.5, 1, 0, 0.25, 0.75, //
                                                   0, 0, 0, 0, 0, 0}));
    nlohmann::json none = usual;
    none.erase("skins");
    none["nodes"][2].erase("skin");
    nlohmann::json beyond = usual;
    beyond["skins"][0]["joints"] = {1};
    nlohmann::json nowhere = usual;
    nowhere["meshes"][1]["primitives"][0]["attributes"].erase("POSITION");
    nlohmann::json below = usual;
    below["accessors"][2]["componentType"] = 5126;
    below["bufferViews"][2] = {{"buffer", 0}, {"byteOffset", 96}, {"byteLength", 48}};
    below["buffers"][0]["byteLength"] = 144;
    below["buffers"][0]["uri"] = "below.bin";
    std::string bytes = support::bytes_of(folder / "rig.bin");
    for (const double value :
         {0.5, -0.5, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0})
        store(value, Scalar::Float32, false, bytes);
    folder.write("below.bin", bytes);
    nlohmann::json short_of = usual;
    short_of["accessors"][2]["count"] = 2;
    for (const auto& [json, words] :
         {std::pair{none, "skins: there is no skin"},
          {beyond, "JOINTS_0: names a joint that the skin has not"},
          {nowhere, "meshes[1].primitives[0]: has no POSITION"},
          {below, "WEIGHTS_0: holds a weight below 0"},
          {short_of, "its attributes differ in count"}})
    {
        const std::string found =
            error_of(Fault::Malformed, [&, text = json]
                     { read_weights(folder.write("rig.gltf", text.dump())); });
        EXPECT_TRUE(contains(found, words)) << found;
    }
}

TEST(WeightFile, what_is_wrong_is_told_with_its_line)
{
    for (const auto& [text, words] :
         {std::pair<std::string, std::string>{"", "names no joints"},
          {"PK\x03\x04", "this looks like a ZIP archive, need weights"},
          {"cellwarp-weights 2\na\n", "w.txt:1: the first line is wrong"},
          {"cellwarp-weights 1\na a\n", "w.txt:2: a: is named twice"},
          {"cellwarp-weights 1\na b\n1 2\n1\n",
           "w.txt:4: got 1 numbers, need one a joint, 2"},
          {"cellwarp-weights 1\na b\n1 -2\n", "w.txt:3: b: got '-2', need a number >= 0"},
          {"cellwarp-weights 1\na b\n1 nan\n", "need a number >= 0"},
          {"cellwarp-weights 1\na b\n1 1e308\n", "need a number >= 0"},
          {"cellwarp-weights 1\n\"a b\n", "w.txt:2: a double quote is not closed"}})
    {
        const std::string found = error_of(Fault::Malformed, [&, input = text]
                                           { parse_weights("w.txt", input); });
        EXPECT_TRUE(contains(found, words)) << found;
    }
    error_of(Fault::File, [] { read_weights("/nowhere/w.txt"); });
}

} // namespace cellwarp::core
