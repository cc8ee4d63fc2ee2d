// SPDX-License-Identifier: GPL-3.0-or-later
// Joint j rests at x_j. It turns by R_j and shifts by d_j in axes that its parent p has
// turned, so that space around it makes
//   T_j = T_p L_j,   L_j x = x_j + d_j + R_j (x - x_j),
// from rest, with T the identity above a root. A bone from j to a child moves by T_j.
// All axes are those of the rest pose: files whose joints have axes of their own come
// here in these (joint_keys.h).
#include "solver/skeleton/skeleton.h"

#include <algorithm>
#include <cassert>

#include "octree/base/index.h"
#include "solver/skeleton/joint_keys.h"

namespace cellwarp::core
{

using Eigen::Quaterniond;
using Eigen::Vector3d;

Skeleton::Skeleton(std::vector<RestJoint> joints)
    : joints_(std::move(joints)), children_(joints_.size())
{
    for (std::size_t j = 0; j < size(); ++j)
    {
        assert(joints_[j].parent < static_cast<int>(j));
        if (joints_[j].parent >= 0)
            children_[idx(joints_[j].parent)].push_back(static_cast<int>(j));
    }
    for (std::size_t j = 0; j < size(); ++j)
    {
        Vector3d direction = Vector3d::Zero();
        if (const auto own = bones(j); !own.empty())
            direction = own.front().second - own.front().first;
        else if (joints_[j].parent >= 0)
            direction = joints_[j].at - joints_[idx(joints_[j].parent)].at;
        directions_.push_back(direction.isZero(0) ? Vector3d::UnitZ()
                                                  : direction.stableNormalized());
    }
}

int Skeleton::find(const std::string& name) const
{
    const auto found = std::find_if(joints_.begin(), joints_.end(),
                                    [&](const RestJoint& j) { return j.name == name; });
    return found == joints_.end() ? -1 : static_cast<int>(found - joints_.begin());
}

std::vector<std::pair<Vector3d, Vector3d>> Skeleton::bones(std::size_t joint) const
{
    std::vector<std::pair<Vector3d, Vector3d>> bones;
    for (const int child : children_[joint])
        if (joints_[idx(child)].at != joints_[joint].at)
            bones.emplace_back(joints_[joint].at, joints_[idx(child)].at);
    return bones;
}

SkeletonPose Skeleton::rest() const
{
    return {std::vector<Quaterniond>(size(), Quaterniond::Identity()),
            std::vector<Vector3d>(size(), Vector3d::Zero())};
}

std::vector<Motion> Skeleton::motions(const SkeletonPose& pose) const
{
    std::vector<Motion> motions(size());
    for (std::size_t j = 0; j < size(); ++j)
    {
        Motion& own = motions[j];
        if (!pose.turns[j].vec().isZero(0))
        {
            own.R = pose.turns[j].toRotationMatrix();
            own.t = joints_[j].at - own.R * joints_[j].at;
        }
        own.t += pose.shifts[j];
        if (joints_[j].parent >= 0)
            own = motions[idx(joints_[j].parent)] * own;
    }
    return motions;
}

int Skeleton::limit(SkeletonPose& pose) const
{
    int count = 0;
    for (std::size_t j = 0; j < size(); ++j)
    {
        const Quaterniond turn =
            limited(pose.turns[j], joints_[j].limits, directions_[j]);
        count += turn.coeffs() != pose.turns[j].coeffs();
        pose.turns[j] = turn;
    }
    return count;
}

SkeletonPose between(const SkeletonPose& from, const SkeletonPose& to, double t)
{
    if (t >= 1.0)
        return to;
    SkeletonPose pose = from;
    for (std::size_t j = 0; j < pose.turns.size(); ++j)
    {
        if (from.turns[j].coeffs() != to.turns[j].coeffs())
            pose.turns[j] = part_of_turn(from.turns[j], to.turns[j], t).normalized();
        pose.shifts[j] += t * (to.shifts[j] - from.shifts[j]);
    }
    return pose;
}

} // namespace cellwarp::core
