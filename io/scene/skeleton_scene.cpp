// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/scene/skeleton_scene.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

#include <Eigen/Geometry>

#include "io/base/error.h"
#include "io/base/number.h"
#include "io/base/text.h"
#include "io/scene/json_object.h"
#include "io/scene/timed_keys.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

/// Nearer to 0.5 the equations have hardly a digit left.
constexpr double kMostPoisson = 0.4999;

/// Reads a vector that has a length.
void read_direction(JsonObject& object, const char* key, std::optional<Vector3d>& out)
{
    if (object.read(key, out) && out->isZero(0))
        object.fail(key, "got 0 0 0, need a direction");
}

/// The text of a selector in a handle file.
bool is_selector(const Json& value)
{
    return value.is_string() && !value.get<std::string>().empty() &&
           value.get<std::string>().find('\n') == std::string::npos;
}

constexpr Between<double> kPoisson{0.0, kMostPoisson};

SkeletonJoint read_joint(JsonObject& object)
{
    SkeletonJoint joint;
    object.need("name", joint.name);
    if (const Json* parent = object.find("parent"); parent && !parent->is_null())
    {
        if (!parent->is_string() || parent->get<std::string>().empty())
            object.fail("parent", "need the name of a joint, or null");
        joint.parent = parent->get<std::string>();
    }
    object.need("at", joint.at);
    object.read_object("limits",
                       [&](JsonObject& limits)
                       {
                           read_direction(limits, "hinge", joint.hinge);
                           limits.read("twist", joint.twist);
                           limits.read("swing", Between<double>{0.0, 360.0}, joint.swing);
                       });
    return joint;
}

JointKey read_key(JsonObject& object)
{
    JointKey key;
    key.field = object.name();
    object.need("time", kKeyTimes, key.time);
    object.need("joint", key.joint);
    key.turns = read_turn(object, key.move);
    key.shifts = object.read("translate", key.move.translation);
    object.read("to", key.to);
    object.read("from", key.from);
    if (key.from && !key.to)
        object.fail("from", "is for a key with to");
    if (!key.turns && !key.shifts && !key.to)
        object.fail("", "needs rotate, translate or to");
    return key;
}

FleshRegion read_material(JsonObject& object)
{
    FleshRegion material;
    material.field = object.name();
    const bool has_reference =
        object.read("reference", Between<std::int64_t>{-100'000'000, 100'000'000},
                    material.reference);
    const Json* const region = object.find("region");
    if (region ? !is_selector(*region) : !has_reference)
        object.fail("region", "need a selector, as \"box 0 0 0 1 1 1\"");
    if (region && has_reference)
        object.fail("reference", "is instead of a region");
    object.read("region", material.region);
    object.read("E", kPositive, material.young);
    object.read("nu", kPoisson, material.poisson);
    object.read("density", kPositive, material.density);
    return material;
}

/// Flesh is held and kept out by what is shifted, but does not turn.
void refuse_turns(JsonObject& object, const MoveKeys& keys)
{
    for (std::size_t k = 0; k < keys.size(); ++k)
        if (keys[k].move.degrees != 0.0)
            object.fail("keys[" + std::to_string(k) + "].rotate",
                        "need translate: for flesh keys do not turn");
}

ObstacleStatement read_flesh_obstacle(JsonObject& object)
{
    ObstacleStatement obstacle = read_obstacle(object);
    if (!obstacle.mesh.empty())
        object.fail("mesh", "flesh is kept out of planes and spheres alone");
    refuse_turns(object, obstacle.keys);
    return obstacle;
}

FleshHoldStatement read_held(JsonObject& object)
{
    FleshHoldStatement held;
    held.field = object.name();
    object.need("at", held.at);
    read_direction(object, "normal", held.normal);
    read_move_keys(object, kKeyTimes, held.keys);
    refuse_turns(object, held.keys);
    return held;
}

void read_detail(JsonObject& object, FleshStatement& flesh)
{
    object.read("detail", kShare, flesh.detail);
    const Json* const regions = object.find("detail_regions");
    if (!regions)
        return;
    const char* const need = "need a list of selectors, as [\"box 0 0 0 1 1 1\"]";
    if (!regions->is_array() || flesh.detail == 0.0)
        object.fail("detail_regions", flesh.detail == 0.0 ? "need detail" : need);
    for (const Json& region : *regions)
    {
        if (!is_selector(region))
            object.fail("detail_regions", need);
        flesh.fine_regions.push_back(region.get<std::string>());
    }
}

void read_lattice(JsonObject& object, std::string& file)
{
    std::string lattice = "octree";
    object.read("lattice", lattice);
    if (lattice.empty())
        object.fail("lattice", "need octree, or the name of a file");
    if (lattice == "octree")
        return;
    if (extension_of(lattice) != "mesh")
        object.fail("lattice", "got " + in_quotes(lattice) +
                                   ", need octree, or a file that ends in .mesh");
    object.read_file_name("lattice", file);
}

FleshStatement read_flesh(JsonObject& object)
{
    FleshStatement flesh;
    object.read("E", kPositive, flesh.young);
    object.read("nu", kPoisson, flesh.poisson);
    object.read("density", kPositive, flesh.density);
    object.read_object("damping",
                       [&](JsonObject& damping)
                       {
                           damping.read("alpha", kNotNegative, flesh.alpha);
                           damping.read("beta", kNotNegative, flesh.beta);
                       });
    object.read_objects("materials", [&](JsonObject& material)
                        { flesh.materials.push_back(read_material(material)); });
    object.read("law", OneOf{{"cells", "linear", "regions", "stvk", "neo-hookean"}},
                flesh.law);
    object.read("newton", Between<std::int64_t>{1, 5}, flesh.newton);
    read_lattice(object, flesh.lattice);
    object.read("across", Between<std::int64_t>{1, 1 << 20}, flesh.across);
    object.read("max_depth", Between<std::int64_t>{0, 20}, flesh.max_depth);
    read_detail(object, flesh);
    object.read("tube", flesh.has_tube);
    object.read("tube_stiffness", kNotNegative, flesh.tube_stiffness);
    object.read("settle", flesh.settles);
    std::string rest;
    object.read("rest", OneOf{{"unloaded", "as-drawn"}}, rest);
    flesh.is_at_rest_as_drawn = rest == "as-drawn";
    if (object.read_file_name("weights", flesh.weights) && flesh.law != "regions")
        object.fail("weights", "are of the law regions, the law is " + flesh.law);
    object.read_objects(object.renamed("obstacles", "contact"), [&](JsonObject& obstacle)
                        { flesh.obstacles.push_back(read_flesh_obstacle(obstacle)); });
    object.read_objects("held",
                        [&](JsonObject& held) { flesh.held.push_back(read_held(held)); });
    return flesh;
}

Eigen::Vector4d turn_of(const RigidMove& move)
{
    const Vector3d& axis = move.axis;
    return Eigen::Quaterniond(
               Eigen::AngleAxisd(std::remainder(move.degrees, 720.0) * std::numbers::pi /
                                     180.0,
                                 (axis / axis.cwiseAbs().maxCoeff()).normalized()))
        .coeffs();
}

/// Adds a key to the track of its joint, which it returns.
template <class Track>
Track& add_key(std::vector<Track>& tracks, std::size_t joint, const JointKey& key,
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
        throw malformed({path, 0, key.field}, "joint " + key.joint + " has a key at " +
                                                  shortest(key.time) + " already");
    track->values.insert(track->values.begin() + (later - track->times.begin()), value);
    track->times.insert(later, key.time);
    return *track;
}

/// Joints from the parent of \p joint up to the one that \p key names.
std::vector<std::size_t> chain_of(const std::vector<SkeletonJoint>& joints,
                                  const std::map<std::string, std::size_t>& number,
                                  std::size_t joint, const JointKey& key,
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
    throw malformed({path, 0, key.field + ".from"},
                    in_quotes(*key.from) + " is no joint above " + key.joint);
}

/// Adds the place of a key to the track of its joint.
void add_reach(SkeletonValues& out, const std::map<std::string, std::size_t>& number,
               std::size_t joint, const JointKey& key, KeyStep step,
               const std::string& path)
{
    if (out.joints[joint].parent.empty())
        throw malformed({path, 0, key.field + ".to"},
                        "joint " + key.joint +
                            " is a root: nothing above it turns, use translate");
    ReachTrack& track = add_key(out.reaches, joint, key, *key.to, step, path);
    if (track.field.empty())
        track.field = key.field;
    if (!key.from)
        return;
    std::vector<std::size_t> chain = chain_of(out.joints, number, joint, key, path);
    if (!track.chain.empty() && track.chain != chain)
        throw malformed({path, 0, key.field + ".from"},
                        "got " + in_quotes(*key.from) + ", an earlier key of joint " +
                            key.joint + " has " +
                            in_quotes(out.joints[track.chain.back()].name));
    track.chain = std::move(chain);
}

void read_up(JsonObject& object, char& up)
{
    std::string axis(1, up);
    object.read("up", OneOf{{"x", "y", "z"}}, axis);
    up = axis[0];
}

MotionStatement read_motion(JsonObject& object)
{
    MotionStatement motion;
    std::string name;
    object.read("file", name);
    if (name.empty())
        object.fail("file", "need the name of a file");
    const std::string extension = extension_of(name);
    if (extension == "tgf" || !is_skeleton_format(extension))
        object.fail("file", "got " + in_quotes(name) + ", need .bvh, .gltf or .glb");
    object.read_file_name("file", motion.file);
    read_up(object, motion.placement.up);
    object.read("animation", motion.placement.animation);
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
    return motion;
}

void read_placement(JsonObject& object, SkeletonScene& scene)
{
    std::string name;
    if (object.read("file", name) && !name.empty() &&
        !is_skeleton_format(extension_of(name)))
        object.fail("file",
                    "got " + in_quotes(name) + ", need .tgf, .bvh, .gltf or .glb");
    object.read_file_name("file", scene.file);
    SkeletonPlacement& placement = scene.placement;
    object.read("root", placement.root);
    object.read("animation", placement.animation);
    if (object.read("animation_file", name) && extension_of(name) != "gltf" &&
        extension_of(name) != "glb")
        object.fail("animation_file", "got " + in_quotes(name) + ", need .gltf or .glb");
    object.read_file_name("animation_file", placement.animation_file);
    object.read("scale", kPositive, placement.scale);
    read_up(object, placement.up);
    object.read("translate", placement.shift);
}

} // namespace

SkeletonScene parse_skeleton_scene(JsonObject& object, std::vector<std::string>& left_out)
{
    SkeletonScene scene;
    read_placement(object, scene);
    object.read_objects("joints",
                        [&](JsonObject& joint)
                        {
                            if (scene.joints.size() == kMostJoints)
                                object.fail("joints", "more than " +
                                                          std::to_string(kMostJoints) +
                                                          " joints");
                            scene.joints.push_back(read_joint(joint));
                        });
    if (scene.file.empty() == scene.joints.empty())
        object.fail("", "needs either a file or joints");
    if (scene.file.empty() && (scene.placement != SkeletonPlacement()))
        object.fail(
            "",
            "root, animation, animation_file, scale, up and translate are for a file");
    scene.joints = in_order(std::move(scene.joints), object.reading().path,
                            object.name_of("joints"));
    object.read_objects("keys",
                        [&](JsonObject& key) { scene.keys.push_back(read_key(key)); });
    object.read_object("motion",
                       [&](JsonObject& motion)
                       {
                           if (!scene.keys.empty())
                               motion.fail("", "stands beside keys: one of them moves "
                                               "the joints");
                           scene.motion = read_motion(motion);
                       });
    std::string interpolation;
    if (object.read("interpolation", OneOf{{"slerp", "squad"}}, interpolation))
        scene.step = interpolation == "squad" ? KeyStep::Smooth : KeyStep::Linear;
    object.read("every", Between<double>{1e-6, 1e9}, scene.every);
    object.read("tube_radius", kPositive, scene.radius);
    const std::size_t num_of_poses = object.known().size();
    scene.flesh = read_flesh(object);
    left_out =
        object.left_out(num_of_poses, "is for flesh that follows in time, ignored");
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
    for (const JointKey& key : scene.keys)
    {
        const auto joint = number.find(key.joint);
        if (joint == number.end())
            throw malformed({path, 0, key.field + ".joint"},
                            in_quotes(key.joint) + " is no joint");
        if (key.turns)
            add_key(out.turns, joint->second, key, turn_of(key.move), step, path);
        if (key.shifts && !out.joints[joint->second].parent.empty())
            throw malformed({path, 0, key.field + ".translate"},
                            "joint " + key.joint + " hangs on " +
                                out.joints[joint->second].parent +
                                ": only a root is moved");
        if (key.shifts)
            add_key(out.shifts, joint->second, key, key.move.translation, step, path);
        if (key.to)
            add_reach(out, number, joint->second, key, step, path);
    }
    return out;
}

} // namespace cellwarp::core
