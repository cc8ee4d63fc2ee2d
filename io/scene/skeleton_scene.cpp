// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/scene/skeleton_scene.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

#include <Eigen/Geometry>

#include "io/base/error.h"
#include "io/base/file_limits.h"
#include "io/base/number.h"
#include "io/base/relative_name.h"
#include "io/base/text.h"
#include "io/scene/json_object.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

/// Nearer to 0.5 the equations have hardly a digit left.
constexpr double kMostPoisson = 0.4999;

Vector3d vector_of(const JsonObject& object, const std::string& key, const Json& value)
{
    const std::array<double, 3> v = object.vector(key, value);
    if (std::max({std::abs(v[0]), std::abs(v[1]), std::abs(v[2])}) > kHuge)
        object.fail(key, "is beyond 1e30");
    return {v[0], v[1], v[2]};
}

template <std::size_t count>
std::array<double, count> numbers_of(const JsonObject& object, const std::string& key,
                                     const Json& value)
{
    std::array<double, count> out{};
    if (!value.is_array() || value.size() != count)
        object.fail(key, "need " + std::to_string(count) + " numbers");
    for (std::size_t k = 0; k < count; ++k)
    {
        if (!value[k].is_number() || !(std::abs(value[k].get<double>()) <= kHuge))
            object.fail(key, "need " + std::to_string(count) + " finite numbers");
        out[k] = value[k].get<double>();
    }
    return out;
}

/// Each object of a list.
template <class Each>
void for_each(JsonObject& object, const char* key, Each&& each)
{
    const Json* list = object.find(key);
    if (!list)
        return;
    if (!list->is_array())
        object.fail(key, "need a list");
    for (std::size_t k = 0; k < list->size(); ++k)
        each((*list)[k], std::string(key) + "[" + std::to_string(k) + "]");
}

SkeletonJoint read_joint(const Json& json, const std::string& path,
                         const std::string& prefix, std::vector<std::string>& warnings)
{
    JsonObject object(json, path, prefix + ".", warnings);
    SkeletonJoint joint;
    std::optional<std::string> name;
    object.read("name", name);
    if (!name)
        object.fail("name", "is missing");
    joint.name = *name;
    if (const Json* parent = object.find("parent"); parent && !parent->is_null())
    {
        if (!parent->is_string() || parent->get<std::string>().empty())
            object.fail("parent", "need the name of a joint, or null");
        joint.parent = parent->get<std::string>();
    }
    const Json* at = object.find("at");
    if (!at)
        object.fail("at", "is missing");
    joint.at = vector_of(object, "at", *at);
    if (const Json* json_limits = object.find("limits"))
    {
        JsonObject limits(*json_limits, path, prefix + ".limits.", warnings);
        if (const Json* hinge = limits.find("hinge"))
        {
            joint.hinge = vector_of(limits, "hinge", *hinge);
            if (joint.hinge->isZero(0))
                limits.fail("hinge", "got 0 0 0, need a direction");
        }
        if (const Json* twist = limits.find("twist"))
            joint.twist = numbers_of<2>(limits, "twist", *twist);
        limits.read("swing", Between<double>{0.0, 360.0}, joint.swing);
        limits.warn_of_the_rest();
    }
    object.warn_of_the_rest();
    return joint;
}

SceneKey read_key(const Json& json, const std::string& path, const std::string& prefix,
                  std::vector<std::string>& warnings)
{
    JsonObject object(json, path, prefix + ".", warnings);
    SceneKey key;
    key.field = prefix;
    std::optional<double> time;
    object.read("time", Between<double>{-1e9, 1e9}, time);
    if (!time)
        object.fail("time", "is missing");
    key.time = *time;
    std::optional<std::string> joint;
    object.read("joint", joint);
    if (!joint)
        object.fail("joint", "is missing");
    key.joint = *joint;
    if (const Json* rotate = object.find("rotate"))
    {
        key.rotate = numbers_of<4>(object, "rotate", *rotate);
        if ((*key.rotate)[0] == 0 && (*key.rotate)[1] == 0 && (*key.rotate)[2] == 0)
            object.fail("rotate", "its axis has no length");
    }
    if (const Json* translate = object.find("translate"))
        key.translate = vector_of(object, "translate", *translate);
    if (const Json* to = object.find("to"))
        key.to = vector_of(object, "to", *to);
    object.read("from", key.from);
    if (key.from && !key.to)
        object.fail("from", "is for a key with to");
    if (!key.rotate && !key.translate && !key.to)
        object.fail("", "needs rotate, translate or to");
    object.warn_of_the_rest();
    return key;
}

FleshRegion read_material(const Json& json, const std::string& path,
                          const std::string& prefix, std::vector<std::string>& warnings)
{
    JsonObject object(json, path, prefix + ".", warnings);
    FleshRegion material;
    material.field = prefix;
    std::optional<std::string> region;
    object.read("region", region);
    object.read("reference", Between<std::int64_t>{-100'000'000, 100'000'000},
                material.reference);
    if (region ? region->empty() || region->find('\n') != std::string::npos
               : !material.reference)
        object.fail("region", "need a selector, as \"box 0 0 0 1 1 1\"");
    if (region && material.reference)
        object.fail("reference", "is instead of a region");
    material.region = region.value_or("");
    object.read("E", Between<double>{kTiny, kHuge}, material.young);
    object.read("nu", Between<double>{0.0, kMostPoisson}, material.poisson);
    object.read("density", Between<double>{kTiny, kHuge}, material.density);
    object.warn_of_the_rest();
    return material;
}

ShiftStatement read_shifts(JsonObject& of, const std::string& path,
                           const std::string& prefix, std::vector<std::string>& warnings)
{
    ShiftStatement shifts;
    for_each(of, "keys",
             [&](const Json& json, const std::string& name)
             {
                 JsonObject object(json, path, prefix + "." + name + ".", warnings);
                 std::optional<double> time;
                 object.read("time", Between<double>{-1e9, 1e9}, time);
                 if (!time)
                     object.fail("time", "is missing");
                 if (!shifts.times.empty() && *time <= shifts.times.back())
                     object.fail("time", "got " + shortest(*time) + ", need more than " +
                                             shortest(shifts.times.back()));
                 const Json* const translate = object.find("translate");
                 if (!translate)
                     object.fail("translate", "is missing");
                 shifts.times.push_back(*time);
                 shifts.shifts.push_back(vector_of(object, "translate", *translate));
                 object.warn_of_the_rest();
             });
    return shifts;
}

FleshObstacleStatement read_obstacle(const Json& json, const std::string& path,
                                     const std::string& prefix,
                                     std::vector<std::string>& warnings)
{
    JsonObject object(json, path, prefix + ".", warnings);
    FleshObstacleStatement obstacle;
    obstacle.field = prefix;
    if (const Json* plane = object.find("plane"))
    {
        obstacle.plane = numbers_of<4>(object, "plane", *plane);
        const auto& [x, y, z, d] = *obstacle.plane;
        if (x == 0 && y == 0 && z == 0)
            object.fail("plane", "its normal has no length");
    }
    if (const Json* sphere = object.find("sphere"))
    {
        obstacle.sphere = numbers_of<4>(object, "sphere", *sphere);
        if (!((*obstacle.sphere)[3] > 0.0))
            object.fail("sphere", "got the radius " + shortest((*obstacle.sphere)[3]) +
                                      ", need > 0");
    }
    if (obstacle.plane.has_value() == obstacle.sphere.has_value())
        object.fail("", "needs a plane or a sphere");
    std::optional<double> friction;
    object.read("friction", Between<double>{0.0, 10.0}, friction);
    obstacle.friction = friction.value_or(0.0);
    obstacle.keys = read_shifts(object, path, prefix, warnings);
    object.warn_of_the_rest();
    return obstacle;
}

FleshHoldStatement read_held(const Json& json, const std::string& path,
                             const std::string& prefix,
                             std::vector<std::string>& warnings)
{
    JsonObject object(json, path, prefix + ".", warnings);
    FleshHoldStatement held;
    held.field = prefix;
    const Json* const at = object.find("at");
    if (!at)
        object.fail("at", "is missing");
    held.at = vector_of(object, "at", *at);
    if (const Json* normal = object.find("normal"))
    {
        held.normal = vector_of(object, "normal", *normal);
        if (held.normal->isZero(0))
            object.fail("normal", "got 0 0 0, need a direction");
    }
    held.keys = read_shifts(object, path, prefix, warnings);
    object.warn_of_the_rest();
    return held;
}

std::optional<bool> read_switch(JsonObject& object, const char* key)
{
    const Json* const value = object.find(key);
    if (value && !value->is_boolean())
        object.fail(key, "need true or false");
    return value ? std::optional(value->get<bool>()) : std::nullopt;
}

FleshStatement read_flesh(JsonObject& object, const std::string& path,
                          std::vector<std::string>& warnings)
{
    FleshStatement flesh;
    const auto number =
        [](JsonObject& of, const char* key, double low, double high, double& out)
    {
        std::optional<double> value;
        of.read(key, Between<double>{low, high}, value);
        out = value.value_or(out);
    };
    object.read("E", Between<double>{kTiny, kHuge}, flesh.young);
    number(object, "nu", 0.0, kMostPoisson, flesh.poisson);
    number(object, "density", kTiny, kHuge, flesh.density);
    if (const Json* json = object.find("damping"))
    {
        JsonObject damping(*json, path, "skeleton.damping.", warnings);
        number(damping, "alpha", 0.0, kHuge, flesh.alpha);
        number(damping, "beta", 0.0, kHuge, flesh.beta);
        damping.warn_of_the_rest();
    }
    for_each(object, "materials",
             [&](const Json& material, const std::string& name)
             {
                 flesh.materials.push_back(
                     read_material(material, path, "skeleton." + name, warnings));
             });
    std::optional<std::string> law, lattice;
    object.read("law", OneOf{{"cells", "linear", "regions", "stvk", "neo-hookean"}}, law);
    flesh.law = law.value_or(flesh.law);
    std::optional<std::int64_t> newton;
    object.read("newton", Between<std::int64_t>{1, 5}, newton);
    flesh.newton = newton.value_or(flesh.newton);
    object.read("lattice", lattice);
    if (lattice && lattice->empty())
        object.fail("lattice", "need octree, or the name of a file");
    if (lattice && *lattice != "octree")
    {
        if (extension_of(*lattice) != "mesh")
            object.fail("lattice", "got " + in_quotes(*lattice) +
                                       ", need octree, or a file that ends in .mesh");
        flesh.lattice = resolved_name(path, *lattice);
    }
    object.read("across", Between<std::int64_t>{1, 1 << 20}, flesh.across);
    object.read("max_depth", Between<std::int64_t>{0, 20}, flesh.max_depth);
    number(object, "detail", 0.0, 1.0, flesh.detail);
    if (const Json* regions = object.find("detail_regions"))
    {
        const char* const need = "need a list of selectors, as [\"box 0 0 0 1 1 1\"]";
        if (!regions->is_array() || flesh.detail == 0.0)
            object.fail("detail_regions", flesh.detail == 0.0 ? "need detail" : need);
        for (const Json& region : *regions)
        {
            if (!region.is_string() ||
                region.get<std::string>().find('\n') != std::string::npos ||
                region.get<std::string>().empty())
                object.fail("detail_regions", need);
            flesh.fine_regions.push_back(region.get<std::string>());
        }
    }
    flesh.has_tube = read_switch(object, "tube").value_or(true);
    number(object, "tube_stiffness", 0.0, kHuge, flesh.tube_stiffness);
    flesh.settles = read_switch(object, "settle");
    std::optional<std::string> rest;
    object.read("rest", OneOf{{"unloaded", "as-drawn"}}, rest);
    flesh.is_at_rest_as_drawn = rest == "as-drawn";
    std::optional<std::string> weights;
    object.read("weights", weights);
    if (weights && weights->empty())
        object.fail("weights", "need the name of a file");
    flesh.weights = weights ? resolved_name(path, *weights) : "";
    if (weights && flesh.law != "regions")
        object.fail("weights", "are of the law regions, the law is " + flesh.law);
    for_each(object, "contact",
             [&](const Json& obstacle, const std::string& name)
             {
                 flesh.contact.push_back(
                     read_obstacle(obstacle, path, "skeleton." + name, warnings));
             });
    for_each(
        object, "held",
        [&](const Json& held, const std::string& name)
        { flesh.held.push_back(read_held(held, path, "skeleton." + name, warnings)); });
    return flesh;
}

Eigen::Vector4d turn_of(const std::array<double, 4>& rotate)
{
    const Vector3d axis(rotate[0], rotate[1], rotate[2]);
    return Eigen::Quaterniond(
               Eigen::AngleAxisd(std::remainder(rotate[3], 720.0) * std::numbers::pi /
                                     180.0,
                                 (axis / axis.cwiseAbs().maxCoeff()).normalized()))
        .coeffs();
}

/// Adds a key to the track of its joint, which it returns.
template <class Track>
Track& add_key(std::vector<Track>& tracks, std::size_t joint, const SceneKey& key,
               const typename Track::Value& value, KeyStep step, const std::string& path)
{
    auto track = std::find_if(tracks.begin(), tracks.end(),
                              [&](const auto& t) { return t.joint == joint; });
    if (track == tracks.end())
    {
        track = tracks.emplace(tracks.end());
        track->joint = joint;
        track->step = step;
    }
    const auto later =
        std::lower_bound(track->times.begin(), track->times.end(), key.time);
    if (later != track->times.end() && *later == key.time)
        throw JsonError(path, key.field,
                        "joint " + key.joint + " has a key at " + shortest(key.time) +
                            " already");
    track->values.insert(track->values.begin() + (later - track->times.begin()), value);
    track->times.insert(later, key.time);
    return *track;
}

/// Joints from the parent of \p joint up to the one that \p key names.
std::vector<std::size_t> chain_of(const std::vector<SkeletonJoint>& joints,
                                  const std::map<std::string, std::size_t>& number,
                                  std::size_t joint, const SceneKey& key,
                                  const std::string& path)
{
    std::vector<std::size_t> chain;
    while (!joints[joint].parent.empty())
    {
        joint = number.at(joints[joint].parent);
        chain.push_back(joint);
        if (joints[joint].name == *key.from)
            return chain;
    }
    throw JsonError(path, key.field + ".from",
                    in_quotes(*key.from) + " is no joint above " + key.joint);
}

/// Adds the place of a key to the track of its joint.
void add_reach(SkeletonValues& out, const std::map<std::string, std::size_t>& number,
               std::size_t joint, const SceneKey& key, KeyStep step,
               const std::string& path)
{
    if (out.joints[joint].parent.empty())
        throw JsonError(path, key.field + ".to",
                        "joint " + key.joint +
                            " is a root: nothing above it turns, use translate");
    ReachTrack& track = add_key(out.reaches, joint, key, *key.to, step, path);
    if (track.field.empty())
        track.field = key.field;
    if (!key.from)
        return;
    std::vector<std::size_t> chain = chain_of(out.joints, number, joint, key, path);
    if (!track.chain.empty() && track.chain != chain)
        throw JsonError(path, key.field + ".from",
                        "got " + in_quotes(*key.from) + ", an earlier key of joint " +
                            key.joint + " has " +
                            in_quotes(out.joints[track.chain.back()].name));
    track.chain = std::move(chain);
}

MotionStatement read_motion(const Json& json, const std::string& path,
                            std::vector<std::string>& warnings)
{
    JsonObject object(json, path, "skeleton.motion.", warnings);
    MotionStatement motion;
    std::optional<std::string> file, up, animation;
    object.read("file", file);
    if (!file || file->empty())
        object.fail("file", "need the name of a file");
    const std::string extension = extension_of(*file);
    if (extension == "tgf" || !is_skeleton_format(extension))
        object.fail("file", "got " + in_quotes(*file) + ", need .bvh, .gltf or .glb");
    motion.file = resolved_name(path, *file);
    object.read("up", OneOf{{"x", "y", "z"}}, up);
    motion.placement.up = up.value_or("y")[0];
    object.read("animation", animation);
    motion.placement.animation = animation.value_or("");
    if (const Json* map = object.find("map"))
    {
        if (!map->is_object())
            object.fail("map", "need an object of names");
        for (const auto& [joint, other] : map->items())
        {
            if (!other.is_string() && !other.is_null())
                object.fail("map." + joint, "need the name of a joint, or null");
            motion.map.emplace_back(joint,
                                    other.is_null() ? "" : other.get<std::string>());
        }
    }
    object.warn_of_the_rest();
    return motion;
}

} // namespace

SkeletonScene parse_skeleton_scene(JsonObject& object, const std::string& path,
                                   std::vector<std::string>& warnings,
                                   std::vector<std::string>& left_out)
{
    SkeletonScene scene;
    std::optional<std::string> file, up, interpolation;
    object.read("file", file);
    if (file && file->empty())
        object.fail("file", "need the name of a file");
    scene.file = file ? resolved_name(path, *file) : "";
    if (file && !is_skeleton_format(extension_of(*file)))
        object.fail("file",
                    "got " + in_quotes(*file) + ", need .tgf, .bvh, .gltf or .glb");
    std::optional<std::string> root, animation, animation_file;
    object.read("root", root);
    object.read("animation", animation);
    object.read("animation_file", animation_file);
    if (animation_file && extension_of(*animation_file) != "gltf" &&
        extension_of(*animation_file) != "glb")
        object.fail("animation_file",
                    "got " + in_quotes(*animation_file) + ", need .gltf or .glb");
    if (animation_file)
        scene.placement.animation_file = resolved_name(path, *animation_file);
    scene.placement.root = root.value_or("");
    scene.placement.animation = animation.value_or("");
    std::optional<double> scale;
    object.read("scale", Between<double>{kTiny, kHuge}, scale);
    scene.placement.scale = scale.value_or(1.0);
    object.read("up", OneOf{{"x", "y", "z"}}, up);
    scene.placement.up = up.value_or("y")[0];
    if (const Json* shift = object.find("translate"))
        scene.placement.shift = vector_of(object, "translate", *shift);
    for_each(object, "joints",
             [&](const Json& joint, const std::string& name)
             {
                 if (scene.joints.size() == kMostJoints)
                     object.fail("joints",
                                 "more than " + std::to_string(kMostJoints) + " joints");
                 scene.joints.push_back(
                     read_joint(joint, path, "skeleton." + name, warnings));
             });
    if (scene.file.empty() == scene.joints.empty())
        object.fail("", "needs either a file or joints");
    if (scene.file.empty() && (scene.placement != SkeletonPlacement()))
        object.fail(
            "",
            "root, animation, animation_file, scale, up and translate are for a file");
    scene.joints = in_order(std::move(scene.joints), path, "skeleton.joints");
    for_each(object, "keys",
             [&](const Json& key, const std::string& name) {
                 scene.keys.push_back(read_key(key, path, "skeleton." + name, warnings));
             });
    if (const Json* motion = object.find("motion"))
    {
        if (!scene.keys.empty())
            object.fail("motion", "stands beside keys: one of them moves the joints");
        scene.motion = read_motion(*motion, path, warnings);
    }
    object.read("interpolation", OneOf{{"slerp", "squad"}}, interpolation);
    if (interpolation)
        scene.step = *interpolation == "squad" ? KeyStep::Smooth : KeyStep::Linear;
    object.read("every", Between<double>{1e-6, 1e9}, scene.every);
    object.read("tube_radius", Between<double>{kTiny, kHuge}, scene.radius);
    for (const char* key :
         {"E", "nu", "density", "damping", "materials", "law", "weights", "newton",
          "lattice", "across", "max_depth", "detail", "detail_regions", "tube",
          "tube_stiffness", "settle", "rest", "contact", "held"})
        if (object.find(key))
            left_out.push_back(at({path, 0, std::string("skeleton.") + key},
                                  "is for flesh that follows in time, ignored"));
    scene.flesh = read_flesh(object, path, warnings);
    object.warn_of_the_rest();
    return scene;
}

SkeletonValues skeleton_of(const SkeletonScene& scene, const std::string& path)
{
    SkeletonValues out;
    if (scene.file.empty())
        out.joints = scene.joints;
    else
        out = read_skeleton(scene.file, scene.placement);
    if (scene.radius)
        for (SkeletonJoint& joint : out.joints)
            joint.radius = scene.radius;
    if (scene.keys.empty())
        return out;
    out.turns.clear();
    out.shifts.clear();
    std::map<std::string, std::size_t> number;
    for (std::size_t k = 0; k < out.joints.size(); ++k)
        number[out.joints[k].name] = k;
    const KeyStep step = scene.step.value_or(KeyStep::Linear);
    for (const SceneKey& key : scene.keys)
    {
        const auto joint = number.find(key.joint);
        if (joint == number.end())
            throw JsonError(path, key.field + ".joint",
                            in_quotes(key.joint) + " is no joint");
        if (key.rotate)
            add_key(out.turns, joint->second, key, turn_of(*key.rotate), step, path);
        if (key.translate && !out.joints[joint->second].parent.empty())
            throw JsonError(path, key.field + ".translate",
                            "joint " + key.joint + " hangs on " +
                                out.joints[joint->second].parent +
                                ": only a root is moved");
        if (key.translate)
            add_key(out.shifts, joint->second, key, *key.translate, step, path);
        if (key.to)
            add_reach(out, number, joint->second, key, step, path);
    }
    return out;
}

} // namespace cellwarp::core
