// SPDX-License-Identifier: GPL-3.0-or-later
// Nodes have the axes of space, so that a joint's turn from rest is its node's rotation,
// and the inverse bind matrix of a joint at x is a shift by -x. [glTF2]
#include "io/scene/skinned_file.h"

#include <bit>
#include <cmath>
#include <map>

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include "io/base/error.h"
#include "io/base/number.h"
#include "io/formats/face_triangles.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;
using OrderedJson = nlohmann::ordered_json;

constexpr int kFloat = 5126, kShort = 5123, kInt = 5125;

std::vector<Vector3d> smooth_normals(const std::vector<Vector3d>& samples,
                                     const std::vector<std::array<std::uint32_t, 3>>& all)
{
    std::vector<Vector3d> normals(samples.size(), Vector3d::Zero());
    for (const auto& [a, b, c] : all)
    {
        const Vector3d area = (samples[b] - samples[a]).cross(samples[c] - samples[a]);
        for (const std::uint32_t corner : {a, b, c})
            normals[corner] += area;
    }
    for (Vector3d& normal : normals)
        normal = normal.norm() > 0.0 ? normal.normalized() : Vector3d::UnitZ();
    return normals;
}

/// The binary part, and what JSON says of it.
class Buffer
{
public:
    explicit Buffer(const std::string& path) : path_(path) {}

    void add(double value)
    {
        const float number = static_cast<float>(value);
        if (!std::isfinite(number))
            throw malformed({path_, 0, ""}, shortest(value) + " does not fit 32 bits");
        add_word(std::bit_cast<std::uint32_t>(number), 4);
    }
    void add_word(std::uint32_t word, int bytes)
    {
        for (int k = 0; k < bytes; ++k)
            bytes_ += static_cast<char>(word >> (8 * k));
    }
    /// Makes an accessor of all bytes since the last one. Returns its number.
    std::size_t accessor(std::size_t count, const char* type, int component)
    {
        views_.push_back({{"buffer", 0},
                          {"byteOffset", viewed_},
                          {"byteLength", bytes_.size() - viewed_}});
        accessors_.push_back({{"bufferView", views_.size() - 1},
                              {"componentType", component},
                              {"count", count},
                              {"type", type}});
        viewed_ = bytes_.size();
        return accessors_.size() - 1;
    }
    std::size_t accessor_of(const std::vector<Vector3d>& vectors)
    {
        Eigen::Array3d low = Eigen::Array3d::Constant(INFINITY), high = -low;
        for (const Vector3d& x : vectors)
            for (Eigen::Index k = 0; k < 3; ++k)
            {
                add(x[k]);
                low[k] = std::min(low[k], double(float(x[k])));
                high[k] = std::max(high[k], double(float(x[k])));
            }
        const std::size_t number = accessor(vectors.size(), "VEC3", kFloat);
        accessors_[number]["min"] = {low[0], low[1], low[2]};
        accessors_[number]["max"] = {high[0], high[1], high[2]};
        return number;
    }
    std::size_t accessor_of_times(const std::vector<double>& times)
    {
        for (const double time : times)
            add(time);
        const std::size_t number = accessor(times.size(), "SCALAR", kFloat);
        accessors_[number]["min"] = OrderedJson::array({double(float(times.front()))});
        accessors_[number]["max"] = OrderedJson::array({double(float(times.back()))});
        return number;
    }
    const std::string& bytes() const { return bytes_; }
    const OrderedJson& views() const { return views_; }
    const OrderedJson& accessors() const { return accessors_; }

private:
    const std::string& path_;
    std::string bytes_;
    std::size_t viewed_ = 0;
    OrderedJson views_ = OrderedJson::array(), accessors_ = OrderedJson::array();
};

OrderedJson primitive_of(const Geometry& geometry, const std::vector<SkinShares>& shares,
                         Buffer& buffer)
{
    const std::vector<std::array<std::uint32_t, 3>> triangles = triangles_of(geometry);
    OrderedJson primitive = {
        {"attributes", {{"POSITION", buffer.accessor_of(geometry.samples)}}}};
    if (!triangles.empty())
    {
        primitive["attributes"]["NORMAL"] =
            buffer.accessor_of(smooth_normals(geometry.samples, triangles));
        for (const auto& triangle : triangles)
            for (const std::uint32_t corner : triangle)
                buffer.add_word(corner, 4);
        primitive["indices"] = buffer.accessor(3 * triangles.size(), "SCALAR", kInt);
    }
    else
        primitive["mode"] = 0;
    for (const SkinShares& of : shares)
        for (const std::uint16_t joint : of.joints)
            buffer.add_word(joint, 2);
    primitive["attributes"]["JOINTS_0"] = buffer.accessor(shares.size(), "VEC4", kShort);
    for (const SkinShares& of : shares)
        for (const float share : of.shares)
            buffer.add(share);
    primitive["attributes"]["WEIGHTS_0"] = buffer.accessor(shares.size(), "VEC4", kFloat);
    return primitive;
}

/// Node 0 is the mesh, node k + 1 the joint k.
OrderedJson nodes_of(const std::vector<SkeletonJoint>& joints)
{
    OrderedJson nodes =
        OrderedJson::array({{{"name", "shape"}, {"mesh", 0}, {"skin", 0}}});
    std::map<std::string, std::size_t> numbers;
    for (std::size_t k = 0; k < joints.size(); ++k)
    {
        numbers[joints[k].name] = k;
        Vector3d from = Vector3d::Zero();
        if (!joints[k].parent.empty())
        {
            const std::size_t parent = numbers.at(joints[k].parent);
            from = joints[parent].at;
            nodes[parent + 1]["children"].push_back(k + 1);
        }
        const Vector3d x = joints[k].at - from;
        nodes.push_back({{"name", joints[k].name}, {"translation", {x[0], x[1], x[2]}}});
    }
    return nodes;
}

OrderedJson animation_of(const SkeletonValues& skeleton, Buffer& buffer)
{
    OrderedJson samplers = OrderedJson::array(), channels = OrderedJson::array();
    std::map<std::vector<double>, std::size_t> inputs;
    const auto add = [&](const std::vector<double>& times, std::size_t joint,
                         const char* path, std::size_t output)
    {
        channels.push_back({{"sampler", samplers.size()},
                            {"target", {{"node", joint + 1}, {"path", path}}}});
        samplers.push_back({{"input", inputs.at(times)}, {"output", output}});
    };
    const auto find_input = [&](const std::vector<double>& times)
    {
        if (!inputs.contains(times))
            inputs[times] = buffer.accessor_of_times(times);
    };
    for (const TurnTrack& track : skeleton.turns)
    {
        find_input(track.times);
        for (const Eigen::Vector4d& turn : track.values)
            for (const double value : turn)
                buffer.add(value);
        add(track.times, track.joint, "rotation",
            buffer.accessor(track.times.size(), "VEC4", kFloat));
    }
    for (const ShiftTrack& track : skeleton.shifts)
    {
        find_input(track.times);
        for (const Vector3d& shift : track.values)
            for (const double value : Vector3d(skeleton.joints[track.joint].at + shift))
                buffer.add(value);
        add(track.times, track.joint, "translation",
            buffer.accessor(track.times.size(), "VEC3", kFloat));
    }
    return {{"name", "motion"}, {"samplers", samplers}, {"channels", channels}};
}

} // namespace

std::string skinned_glb(const std::string& path, const Geometry& geometry,
                        const SkeletonValues& skeleton,
                        const std::vector<SkinShares>& shares)
{
    if (skeleton.joints.size() > 65535)
        throw Error(
            Fault::Usage,
            at({path, 0, ""},
               "cannot hold " + std::to_string(skeleton.joints.size()) + " joints"));
    Buffer buffer(path);
    const OrderedJson primitive = primitive_of(geometry, shares, buffer);
    OrderedJson joints = OrderedJson::array();
    for (std::size_t k = 0; k < skeleton.joints.size(); ++k)
    {
        joints.push_back(k + 1);
        const Vector3d& x = skeleton.joints[k].at;
        for (int column = 0; column < 4; ++column)
            for (int row = 0; row < 4; ++row)
                buffer.add(row == column ? 1.0 : column == 3 && row < 3 ? -x[row] : 0.0);
    }
    const std::size_t binds = buffer.accessor(skeleton.joints.size(), "MAT4", kFloat);
    OrderedJson json = {
        {"asset", {{"version", "2.0"}, {"generator", "cellwarp"}}},
        {"scene", 0},
        {"scenes", OrderedJson::array({{{"nodes", {0, 1}}}})},
        {"nodes", nodes_of(skeleton.joints)},
        {"meshes",
         OrderedJson::array({{{"primitives", OrderedJson::array({primitive})}}})},
        {"skins",
         OrderedJson::array({{{"joints", joints}, {"inverseBindMatrices", binds}}})}};
    if (!skeleton.turns.empty() || !skeleton.shifts.empty())
        json["animations"] = OrderedJson::array({animation_of(skeleton, buffer)});
    json["accessors"] = buffer.accessors();
    json["bufferViews"] = buffer.views();
    json["buffers"] = OrderedJson::array({{{"byteLength", buffer.bytes().size()}}});
    std::string text =
        json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
    while (text.size() % 4 != 0)
        text += ' ';
    if (text.size() + buffer.bytes().size() > 4'200'000'000u)
        throw Error(Fault::Usage, at({path, 0, ""}, "a .glb ends at 4 GB"));
    Buffer head(path);
    const auto word = [&](std::size_t value)
    { head.add_word(static_cast<std::uint32_t>(value), 4); };
    word(0x46546c67); // "glTF"
    word(2);
    word(28 + text.size() + buffer.bytes().size());
    word(text.size());
    word(0x4e4f534a); // "JSON"
    Buffer middle(path);
    middle.add_word(static_cast<std::uint32_t>(buffer.bytes().size()), 4);
    middle.add_word(0x004e4942, 4); // "BIN"
    return head.bytes() + text + middle.bytes() + buffer.bytes();
}

} // namespace cellwarp::core
