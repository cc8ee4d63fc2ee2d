// SPDX-License-Identifier: GPL-3.0-or-later
// Joints, rigid bones between them, and where turns of the joints take them.
// skeleton.cpp has the formulas. [Capell02]
#pragma once

#include <span>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "octree/base/rigid_motion.h"
#include "solver/skeleton/joint_limits.h"

namespace cellwarp::core
{

struct RestJoint
{
    std::string name;
    int parent = -1;                              ///< number; -1: a root
    Eigen::Vector3d at = Eigen::Vector3d::Zero(); ///< at rest
    JointLimits limits = {};
};

/// What each joint does, from rest. A turn is about the joint, in the axes of the rest
/// pose as the parent has turned them; a shift is in the same axes.
struct SkeletonPose
{
    std::vector<Eigen::Quaterniond> turns; ///< unit
    std::vector<Eigen::Vector3d> shifts;
};

/// Immutable.
class Skeleton
{
public:
    /// \pre parents stand before their children
    explicit Skeleton(std::vector<RestJoint> joints);

    std::size_t size() const { return joints_.size(); }
    const RestJoint& operator[](std::size_t joint) const { return joints_[joint]; }
    /// The number of a joint, or -1.
    int find(const std::string& name) const;
    const std::vector<int>& children(std::size_t joint) const { return children_[joint]; }
    /// Bones that move with a joint: from it to each of its children, if they are
    /// elsewhere.
    std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>>
    bones(std::size_t joint) const;
    /// Unit: of its first bone, else of the one that leads to it; z where there is none.
    const Eigen::Vector3d& direction(std::size_t joint) const
    {
        return directions_[joint];
    }

    SkeletonPose rest() const;
    /// The motion that space around each joint makes, from rest; exactly the identity for
    /// a joint at rest whose parents are.
    std::vector<Motion> motions(const SkeletonPose& pose) const;
    /// The pose with each turn within its limits; gives how many were not.
    int limit(SkeletonPose& pose) const;

private:
    std::vector<RestJoint> joints_;
    std::vector<std::vector<int>> children_;
    std::vector<Eigen::Vector3d> directions_;
};

/// Between two poses, at \p t in [0, 1]: joint by joint on the shortest way, evenly;
/// exactly \p to at 1.
SkeletonPose between(const SkeletonPose& from, const SkeletonPose& to, double t);

} // namespace cellwarp::core
