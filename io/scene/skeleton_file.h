// SPDX-License-Identifier: GPL-3.0-or-later
// Skeletons of files, as plain values: joints at rest, and keys that move them. TGF, BVH,
// and the nodes, skins and animations of a glTF. skeleton_file.cpp tells what each means.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

namespace cellwarp::core
{

/// Most joints of a skeleton.
inline constexpr std::size_t kMostJoints = 10000;

struct SkeletonJoint
{
    std::string name;
    std::string parent; ///< empty: a root
    Eigen::Vector3d at = Eigen::Vector3d::Zero();
    std::optional<Eigen::Vector3d> hinge;       ///< axis that it turns about alone
    std::optional<std::array<double, 2>> twist; ///< least and largest [degree]
    std::optional<double> swing;                ///< largest, >= 0 [degree]
    std::optional<double> radius;               ///< of its bones, > 0
    std::int64_t line = 0;

    bool operator==(const SkeletonJoint&) const = default;
};

/// How values come about between two keys.
enum class KeyStep
{
    Hold,   ///< the earlier one
    Linear, ///< evenly; turns on the sphere
    Smooth, ///< with one speed at each key, by the keys around it
    Cubic   ///< by tangents
};

/// Keys of one joint: turns from rest, in the axes of the rest pose as the parent has
/// turned them, as quaternions x y z w of length 1; or shifts in these axes.
template <int size>
struct KeyTrack
{
    using Value = Eigen::Matrix<double, size, 1>;

    std::size_t joint = 0;
    KeyStep step = KeyStep::Linear;
    std::vector<double> times; ///< [s], strictly increasing
    std::vector<Value> values;
    /// Of KeyStep::Cubic: slopes before and after each key [1/s].
    std::vector<std::array<Value, 2>> tangents = {};
};
using TurnTrack = KeyTrack<4>;
using ShiftTrack = KeyTrack<3>;

/// Places that a joint reaches: the joints above it turn for it (inverse kinematics).
struct ReachTrack : KeyTrack<3>
{
    /// Joints that turn for it; empty: those up to below the next branching.
    std::vector<std::size_t> chain = {};
    /// false: it acts at all times, and turns the joints of its chain that have no track
    /// of turns. true: it acts from its first to its last key alone, and turns all joints
    /// of its chain, from where their tracks have them.
    bool is_hold = false;
    std::string field = {}; ///< of the scene, for messages
};

struct SkeletonValues
{
    std::vector<SkeletonJoint> joints; ///< parents first; names differ
    std::vector<TurnTrack> turns;      ///< at most one a joint
    std::vector<ShiftTrack> shifts;
    std::vector<ReachTrack> reaches = {}; ///< at most one at a time of a joint
    std::vector<std::string> warnings;
};

/// What a file does not tell of itself.
struct SkeletonPlacement
{
    std::string root;      ///< of a TGF: name of the joint that has no parent
    std::string animation; ///< of a glTF: name or number; the first one
    /// Another glTF, whose animation moves the joints that have the names of its nodes;
    /// resolved; empty: the file's own.
    std::string animation_file;
    double scale = 1.0; ///< > 0, of all lengths of the file
    char up = 'y';      ///< which of its axes becomes y, to which it is turned
    Eigen::Vector3d shift = Eigen::Vector3d::Zero(); ///< added to all places in the end

    bool operator==(const SkeletonPlacement&) const = default;
};

/// Reads FILE.tgf, .bvh, .gltf or .glb. Throws Fault::Usage for another extension,
/// Fault::File, Fault::Malformed.
SkeletonValues read_skeleton(const std::string& path,
                             const SkeletonPlacement& placement = {});
/// The same for bytes in memory; \p path names them.
SkeletonValues parse_skeleton(const std::string& path, std::string bytes,
                              const SkeletonPlacement& placement = {});

/// Whether read_skeleton() takes such files.
bool is_skeleton_format(std::string_view extension);

/// The joints as TGF, whose names are their numbers from 1.
std::string tgf_text(const std::vector<SkeletonJoint>& joints);

/// Puts parents first, in the order given otherwise. Throws Fault::Malformed, with the
/// names, for names that are there twice or cannot be, parents that are not there, rings,
/// two roots, bones without length, and limits that contradict. \p field names joint k in
/// messages: field + "[k]"; empty: its line does.
std::vector<SkeletonJoint> in_order(std::vector<SkeletonJoint> joints,
                                    const std::string& file, const std::string& field);

/// gltf_skeleton.cpp. \p bytes of a .gltf or .glb; of the placement only what is of its
/// animation.
SkeletonValues parse_gltf_skeleton(const std::string& path, std::string bytes,
                                   const SkeletonPlacement& placement);

} // namespace cellwarp::core
