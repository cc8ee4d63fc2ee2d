// SPDX-License-Identifier: GPL-3.0-or-later
// With G_s the turn of space that a bone of the source has made since its rest, Y the
// turn that lets the source look as the skeleton does, and A the smallest turn that
// brings the bone at rest from its own direction to that of the source, the bone is
// turned by
//   G = Y G_s Y^T A,
// so that it points where the source's bone points. A is the identity where limbs branch
// (a chest and a pelvis have no direction), and that of the bone before at the end of a
// limb. The turn of a joint is what its bone does beyond the bone before: G_before^T G.
// Joints without a counterpart go with the bone before them.
#include "library/session/retargeted_motion.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include <Eigen/Geometry>

#include "io/base/error.h"
#include "io/base/number.h"
#include "library/session/matched_joints.h"
#include "library/session/skeleton_handle.h"
#include "octree/base/bounding_box.h"
#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Quaterniond;
using Eigen::Vector3d;

/// Turns of space around joints, and where these are.
struct Posed
{
    std::vector<Quaterniond> turns;
    std::vector<Vector3d> places;
};

Posed posed(const SkeletonValues& skeleton, const std::vector<int>& parents,
            const std::vector<JointMotion>& motions)
{
    Posed out;
    for (std::size_t j = 0; j < parents.size(); ++j)
    {
        const Vector3d& at = skeleton.joints[j].at;
        if (parents[j] < 0)
        {
            out.turns.push_back(motions[j].turn);
            out.places.push_back(at + motions[j].shift);
            continue;
        }
        const std::size_t parent = idx(parents[j]);
        const Quaterniond& before = out.turns[parent];
        out.places.push_back(out.places[parent] +
                             before *
                                 (at - skeleton.joints[parent].at + motions[j].shift));
        out.turns.push_back((before * motions[j].turn).normalized());
    }
    return out;
}

double lowest(const std::vector<Vector3d>& places)
{
    double out = std::numeric_limits<double>::infinity();
    for (const Vector3d& x : places)
        out = std::min(out, x.y());
    return out;
}

class Retarget
{
public:
    Retarget(const SkeletonValues& source, const MotionStatement& motion,
             const std::string& path, SkeletonValues& skeleton)
        : source_(source), skeleton_(skeleton), parents_(parents_of(skeleton.joints)),
          source_parents_(parents_of(source.joints)),
          matched_(matched_joints(skeleton.joints, source.joints))
    {
        take_map(motion, path);
        if (std::all_of(matched_.of_other.begin(), matched_.of_other.end(),
                        [](int other) { return other < 0; }))
            throw malformed({path, 0, "skeleton.motion"},
                            "no joint of " + in_quotes(motion.file) +
                                " is like one of this skeleton: map names to names");
        look_ = Eigen::AngleAxisd(0.5 * matched_.quarter_turns * std::numbers::pi,
                                  Vector3d::UnitY());
        for (const SkeletonJoint& joint : skeleton.joints)
            rest_.push_back(joint.at);
        for (const SkeletonJoint& joint : source.joints)
            source_rest_.push_back(joint.at);
        find_bones();
        find_anchor();
    }

    void write_tracks() const
    {
        const std::vector<double> times = key_times(source_);
        const KeyedJoints keyed(source_);
        std::vector<Posed> poses;
        double floor = std::numeric_limits<double>::infinity();
        for (const double time : times)
        {
            poses.push_back(posed(source_, source_parents_, keyed.motions_at(time)));
            floor = std::min(floor, lowest(poses.back().places));
        }
        std::vector<TurnTrack> turns;
        for (std::size_t j = 0; j < bones_.size(); ++j)
            if (bones_[j].source >= 0)
                turns.push_back({j, KeyStep::Linear, times, {}});
        ShiftTrack shifts{0, KeyStep::Linear, times, {}};
        for (const Posed& pose : poses)
        {
            std::vector<Quaterniond> space; // turned by each joint
            std::vector<Vector3d> places;   // with the root at rest
            std::size_t track = 0;
            for (std::size_t j = 0; j < bones_.size(); ++j)
            {
                const bool is_root = parents_[j] < 0;
                const Quaterniond before =
                    is_root ? Quaterniond::Identity() : space[idx(parents_[j])];
                places.push_back(
                    is_root ? rest_[j]
                            : Vector3d(places[idx(parents_[j])] +
                                       before * (rest_[j] - rest_[idx(parents_[j])])));
                if (bones_[j].source < 0)
                {
                    space.push_back(before);
                    continue;
                }
                space.push_back((look_ * pose.turns[idx(bones_[j].source)] *
                                 look_.conjugate() * bones_[j].aligned)
                                    .normalized());
                turns[track++].values.push_back(
                    (before.conjugate() * space.back()).normalized().coeffs());
            }
            const Vector3d &here = pose.places[idx(source_anchor_)],
                           &first = poses.front().places[idx(source_anchor_)];
            Vector3d goal = rest_[idx(anchor_)] + scale_ * (look_ * (here - first));
            goal.y() = lowest(rest_) + scale_ * (here.y() - floor);
            shifts.values.push_back(goal - places[idx(anchor_)]);
        }
        skeleton_.turns = std::move(turns);
        skeleton_.shifts = {std::move(shifts)};
    }

    void add_warnings(const MotionStatement& motion) const
    {
        std::string still;
        for (std::size_t j = 0; j < bones_.size(); ++j)
            if (bones_[j].source < 0 && bones_[j].is_bone)
                still += (still.empty() ? "" : ", ") + skeleton_.joints[j].name;
        if (!still.empty())
            skeleton_.warnings.push_back(
                "of " + in_quotes(motion.file) + " nothing moves the joints " + still +
                ", which go with the bones before them (skeleton.motion.map names "
                "counterparts)");
    }

private:
    struct Bone
    {
        int source = -1; ///< joint that turns its counterpart; -1: none
        bool is_bone = false;
        Quaterniond aligned = Quaterniond::Identity();
    };

    void take_map(const MotionStatement& motion, const std::string& path)
    {
        const auto number = [&](const SkeletonValues& skeleton, const std::string& name)
        {
            for (std::size_t k = 0; k < skeleton.joints.size(); ++k)
                if (skeleton.joints[k].name == name)
                    return static_cast<int>(k);
            throw malformed({path, 0, "skeleton.motion.map"},
                            in_quotes(name) + " is no joint of " +
                                (&skeleton == &source_ ? in_quotes(motion.file)
                                                       : std::string("the skeleton")));
        };
        for (const auto& [own, other] : motion.map)
            matched_.of_other[idx(number(skeleton_, own))] =
                other.empty() ? -1 : number(source_, other);
    }
    int match(int joint) const { return matched_.of_other[idx(joint)]; }

    /// The next joints behind one that are matched.
    void add_next(int joint, std::vector<int>& out) const
    {
        for (std::size_t k = 0; k < parents_.size(); ++k)
            if (parents_[k] == joint)
            {
                if (match(static_cast<int>(k)) >= 0)
                    out.push_back(static_cast<int>(k));
                else
                    add_next(static_cast<int>(k), out);
            }
    }
    /// The joint that turns the first bone on the way from one joint of the source to
    /// another: the upper one of its two.
    int turning(int from, int to) const
    {
        for (int joint = to; joint >= 0; joint = source_parents_[idx(joint)])
            if (joint == from)
                return from;
        return source_parents_[idx(from)] >= 0 ? source_parents_[idx(from)] : from;
    }
    void find_bones()
    {
        bones_.resize(parents_.size());
        for (std::size_t j = 0; j < parents_.size(); ++j)
        {
            if (parents_[j] >= 0)
                bones_[idx(parents_[j])].is_bone = true;
            const int joint = static_cast<int>(j), other = match(joint);
            if (other < 0)
                continue;
            Bone& bone = bones_[j];
            bone.source = other;
            std::vector<int> next;
            add_next(joint, next);
            if (next.empty() && parents_[j] >= 0)
                bone.aligned = bones_[idx(parents_[j])].aligned;
            if (next.size() != 1 || match(next.front()) == other)
                continue;
            bone.source = turning(other, match(next.front()));
            const Vector3d own = rest_[idx(next.front())] - rest_[j],
                           its = look_ * (source_rest_[idx(match(next.front()))] -
                                          source_rest_[idx(other)]);
            if (own.norm() > 0.0 && its.norm() > 0.0)
                bone.aligned = Quaterniond::FromTwoVectors(own, its);
        }
        // Joints without a bone turn nothing.
        for (Bone& bone : bones_)
            if (!bone.is_bone)
                bone.source = -1;
    }
    /// The joints of both that make the way of the root: the source's root, or what is
    /// matched nearest to it.
    void find_anchor()
    {
        double least = std::numeric_limits<double>::infinity();
        for (std::size_t j = 0; j < parents_.size(); ++j)
            if (const int other = match(static_cast<int>(j)); other >= 0)
                if (const double away =
                        (source_rest_[idx(other)] - source_rest_.front()).norm();
                    away < least)
                {
                    least = away;
                    anchor_ = static_cast<int>(j);
                    source_anchor_ = other;
                }
        const double own = rest_[idx(anchor_)].y() - lowest(rest_),
                     its = source_rest_[idx(source_anchor_)].y() - lowest(source_rest_);
        const double size = box_around(rest_).diagonal().norm(),
                     source_size = box_around(source_rest_).diagonal().norm();
        scale_ = own > 0.05 * size && its > 0.05 * source_size ? own / its
                 : source_size > 0.0                           ? size / source_size
                                                               : 1.0;
    }

    const SkeletonValues& source_;
    SkeletonValues& skeleton_;
    const std::vector<int> parents_, source_parents_;
    MatchedJoints matched_;
    Quaterniond look_; ///< the source, as the skeleton
    std::vector<Vector3d> rest_, source_rest_;
    std::vector<Bone> bones_; ///< of the skeleton's joints
    int anchor_ = 0, source_anchor_ = 0;
    double scale_ = 1.0; ///< of lengths of the source
};

} // namespace

void retarget(const SkeletonValues& source, const MotionStatement& motion,
              const std::string& path, SkeletonValues& skeleton)
{
    const Retarget one(source, motion, path, skeleton);
    one.write_tracks();
    one.add_warnings(motion);
}

SkeletonValues moving_skeleton(const SkeletonScene& scene, const std::string& path)
{
    SkeletonValues skeleton = skeleton_of(scene, path);
    if (scene.motion.file.empty())
        return skeleton;
    const SkeletonValues source =
        read_skeleton(scene.motion.file, scene.motion.placement);
    skeleton.warnings.insert(skeleton.warnings.end(), source.warnings.begin(),
                             source.warnings.end());
    if (source.turns.empty() && source.shifts.empty())
        throw malformed({path, 0, "skeleton.motion.file"},
                        in_quotes(scene.motion.file) + " moves nothing");
    retarget(source, scene.motion, path, skeleton);
    return skeleton;
}

} // namespace cellwarp::core
