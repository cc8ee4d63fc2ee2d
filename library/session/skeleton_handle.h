// SPDX-License-Identifier: GPL-3.0-or-later
// The skeleton of an edit session: joints at rest, and where the statements of a frame
// take them. Each bone is a handle of its own (bone_regions.h); on their way joints turn
// evenly.
#pragma once

#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "io/scene/handle_file.h"
#include "library/session/handle_trajectory.h"
#include "octree/base/rigid_motion.h"
#include "solver/skeleton/skeleton.h"

namespace cellwarp::core
{

/// A joint that stays at a place: those of the chain turn for it.
struct JointHold
{
    int joint = 0;
    Eigen::Vector3d place = Eigen::Vector3d::Zero(); ///< [work]
    std::vector<int> chain;
    double miss = 0.0; ///< how far away it ends [work]

    bool operator==(const JointHold&) const = default;
};

/// Where the statements so far have a skeleton. Turns are in work axes.
struct SkeletonAim
{
    std::vector<Eigen::Quaterniond> turns; ///< a joint
    std::vector<Eigen::Vector3d> shifts;   ///< a joint [work]
    std::vector<JointHold> holds;
    int limited = 0; ///< turns of the last frame that were beyond their limits

    bool is_at(const SkeletonAim& other) const;
};

/// A joint as it is shown.
struct PosedJoint
{
    std::string name;
    int parent = -1;
    Eigen::Vector3d place = Eigen::Vector3d::Zero(); ///< [model unit]
};

/// At rest. Immutable.
class SkeletonHandle
{
public:
    /// \p joints: parents first. \p file: where they are told, for messages.
    SkeletonHandle(const std::vector<SkeletonJoint>& joints, const Units& units,
                   std::string file);

    std::size_t size() const { return skeleton_.size(); }
    const SkeletonJoint& statement(std::size_t joint) const { return statements_[joint]; }
    int parent(std::size_t joint) const { return skeleton_[joint].parent; }
    /// Straight pieces that move with a joint, from it to its children [work].
    std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>>
    bones(std::size_t joint) const
    {
        return skeleton_.bones(joint);
    }
    /// [work]
    const Eigen::Vector3d& place(std::size_t joint) const { return skeleton_[joint].at; }
    std::optional<double> told_radius(std::size_t joint) const; ///< [work]
    /// The number of a joint, or -1.
    int find(const std::string& name) const { return skeleton_.find(name); }

    SkeletonAim rest() const;
    /// After the moves of a frame, all of joints. What holds a joint at its place turns
    /// the others of its chain but for those that this frame turns.
    SkeletonAim moved(const SkeletonAim& from, std::span<const Move* const> moves,
                      const Units& units) const;
    /// Of space around each joint, from rest, at \p t of the way in [0, 1] [work].
    std::vector<Motion> motions(const SkeletonAim& from, const SkeletonAim& to,
                                double t) const;
    /// How many equal parts of the way keep each bone to 45 degrees and each joint to a
    /// quarter of \p diagonal.
    int num_parts(const SkeletonAim& from, const SkeletonAim& to, double diagonal) const;

private:
    void apply(const Move& move, const Units& units, SkeletonAim& to,
               std::set<int>& told) const;
    std::vector<int> chain_of(int joint, const std::string& first) const;

    const std::string file_;
    const std::vector<SkeletonJoint> statements_;
    const Skeleton skeleton_;
    const double unit_;
    const int exponent_;
};

/// The motion of a joint from rest: its turn, in the axes of the rest pose as its parent
/// has turned them, and its shift in these.
struct JointMotion
{
    Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();
    Eigen::Vector3d shift = Eigen::Vector3d::Zero(); ///< [model unit]
};

/// The motion of joints by the tracks of their skeleton. A result depends on its time
/// alone: places that joints reach are solved for anew at each time. Immutable.
class KeyedJoints
{
public:
    explicit KeyedJoints(const SkeletonValues& skeleton);

    /// Before the first key and after the last one a joint holds.
    std::vector<Move> moves_at(double time) const;
    /// The same of every joint.
    std::vector<JointMotion> motions_at(double time) const;
    /// Warnings of places out of reach. \p file: of the scene.
    std::vector<std::string> warnings(const std::string& file) const;

private:
    struct Tracks;
    std::shared_ptr<const Tracks> tracks_;
};

/// Times at which a track of \p skeleton has a key, ascending.
std::vector<double> key_times(const SkeletonValues& skeleton);

/// The tracks of \p skeleton as frames, numbered from 1: at each time that has a key, or
/// \p every so many seconds from the first on, and at the last. \p file: of the scene,
/// for messages. Adds warnings.
std::vector<FrameStatement> posed_frames(const SkeletonValues& skeleton,
                                         std::optional<double> every,
                                         const std::string& file,
                                         std::vector<std::string>& warnings);

} // namespace cellwarp::core
