// SPDX-License-Identifier: GPL-3.0-or-later
// What a scene file says of a skeleton, as plain values.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "io/scene/obstacle_statement.h"
#include "io/scene/skeleton_file.h"
#include "octree/base/rigid_move.h"

namespace cellwarp::core
{

class JsonObject;

/// A key of a joint: how it turns or is shifted from rest [model unit], or where it goes.
struct JointKey : MoveKey
{
    std::string joint;
    bool turns = false, shifts = false;
    std::optional<Eigen::Vector3d> to; ///< a place to reach [model unit]
    std::optional<std::string> from;   ///< first joint of the chain that turns for it
    std::string field;                 ///< of the scene, for messages
};

/// What one material of the flesh is like; what it leaves out is that of the flesh.
struct FleshRegion
{
    std::string region; ///< a selector, as in a handle file; empty: by reference
    std::optional<std::int64_t> reference; ///< of cells in the file of a drawn lattice
    std::optional<double> young, poisson, density;
    std::string field; ///< of the scene, for messages
};

/// A point of the flesh that is held, along a normal alone or wholly.
struct FleshHoldStatement
{
    Eigen::Vector3d at; ///< at rest [model unit]
    std::optional<Eigen::Vector3d> normal;
    MoveKeys keys;     ///< shifts from there
    std::string field; ///< of the scene, for messages
};

/// Flesh that follows the skeleton in time.
struct FleshStatement
{
    /// [Pa]; none: such that the shape holds in its weight, see softness.h.
    std::optional<double> young;
    double poisson = 0.4, density = 1000.0; ///< of that [kg/m^3]
    double alpha = 0.0, beta = 0.0;         ///< damping [1/s], [s]
    std::vector<FleshRegion> materials;
    std::string law = "cells";
    std::int64_t newton = 1;
    std::string lattice; ///< file, resolved; empty: the octree
    std::optional<std::int64_t> across, max_depth;
    /// Cells with a larger error are halved while they have it [diagonal]; 0: none.
    double detail = 0.0;
    std::vector<std::string> fine_regions; ///< selectors: detail is there all the time
    bool has_tube = true;
    double tube_stiffness = 10.0;
    /// Whether it hangs in its weight from the first frame on; none: where it can.
    std::optional<bool> settles;
    bool is_at_rest_as_drawn = false; ///< its drawn shape bears its weight
    std::vector<ObstacleStatement> obstacles;
    std::vector<FleshHoldStatement> held;
    std::string weights; ///< file, resolved; empty: by distances
};

/// The motion of another skeleton, which moves this one.
struct MotionStatement
{
    std::string file;            ///< resolved; empty: none
    SkeletonPlacement placement; ///< its axis that points up, and its animation
    /// A joint and its counterpart there; empty: it has none.
    std::vector<std::pair<std::string, std::string>> map;
};

struct SkeletonScene
{
    std::string file; ///< resolved; empty: the scene has the joints
    SkeletonPlacement placement;
    std::vector<SkeletonJoint> joints; ///< of the scene, parents first
    std::vector<JointKey> keys;        ///< in the order of the scene
    MotionStatement motion;
    /// Between keys of the scene, or frames of a handle file in time; none: Linear for
    /// keys, Smooth for frames.
    std::optional<KeyStep> step;
    std::optional<double> every;  ///< frames so far apart [s]; none: at the keys
    std::optional<double> radius; ///< of all bones [model unit]
    FleshStatement flesh;
};

/// Reads the object "skeleton" of a scene. Throws Fault::Malformed. \p left_out: gets the
/// warnings of what is there for other commands.
SkeletonScene parse_skeleton_scene(JsonObject& object,
                                   std::vector<std::string>& left_out);

/// The joints of the scene or its file, and what moves them: the scene's keys, else the
/// file's. \p path: of the scene. Throws what read_skeleton() throws, and
/// Fault::Malformed for keys of no joint, of one time, for translations of a joint that
/// is no root, and for places of one.
SkeletonValues skeleton_of(const SkeletonScene& scene, const std::string& path);

} // namespace cellwarp::core
