// SPDX-License-Identifier: GPL-3.0-or-later
// Unknown is a small turn w_j of each joint of the chains, R_j <- exp(w_j) R_j, of a
// hinge the angle alone. With A_j the turn of its parent, a target at p moves by
//   dp = (A_j w_j) x (p - T_j x_j),
// linear in all of them: J. Levenberg-Marquardt's step is (J^T J + mu I) w = -J^T r with
// r the ways from the targets' places, in units of the skeleton's size; of many ways to
// reach a place it takes nearly the one with the least turns.
//
// Limits. A step that takes a joint out of its limits is cut there, and the others step
// again with what that joint can do taken for given, until none is cut anew: they make up
// for it. A step that lowers nothing is repeated with a larger mu, up to where it is a
// step down the slope.
//
// A straight chain that is to become shorter has no slope across it. Where steps end
// before the targets are there, joints between the ends are turned a little, hinges the
// way they bend, the first one so that the end is still in line, and it is tried again
// from there.
#include "solver/skeleton/reach.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "octree/base/index.h"
#include "solver/skeleton/joint_keys.h"

namespace cellwarp::core
{

namespace
{

using Eigen::MatrixXd;
using Eigen::Quaterniond;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr int kMostIterations = 200;

/// Of the size of the skeleton: targets that are nearer are there.
constexpr double kThere = 1e-12;

/// Steps that turn nothing by more end it [rad].
constexpr double kLeastTurn = 1e-13;

/// A step that brings the targets nearer by a smaller share is the last.
constexpr double kLeastGain = 1e-12;

/// Of the length of a chain: places beyond that are brought so near.
constexpr double kFar = 100.0;

/// By which a straight chain is bent [rad], and the share by which it must come nearer to
/// stay so.
constexpr double kNudge = 0.1, kGain = 1e-6;

class Reacher
{
public:
    Reacher(const Skeleton& skeleton, std::span<const ReachTarget> targets,
            SkeletonPose& pose)
        : skeleton_(skeleton), targets_(targets), pose_(pose)
    {
        for (const ReachTarget& target : targets)
            for (const int joint : target.chain)
                if (std::find(joints_.begin(), joints_.end(), joint) == joints_.end())
                    joints_.push_back(joint);
        std::sort(joints_.begin(), joints_.end());
        for (const int joint : joints_)
        {
            first_.push_back(num_unknowns_);
            num_unknowns_ += hinge(joint) ? 1 : 3;
        }
        for (std::size_t j = 0; j < skeleton.size(); ++j)
            size_ = std::max(size_, (skeleton[j].at - skeleton[0].at).norm());
        if (size_ == 0.0)
            size_ = 1.0;
        for (const int joint : joints_)
            pose_.turns[idx(joint)] = within(joint, pose_.turns[idx(joint)]);
        find_places();
        residual_ = residual(pose_);
    }

    ReachReport solve()
    {
        ReachReport report;
        if (num_unknowns_ > 0)
            go(report);
        for (std::size_t k = 0; k < targets_.size(); ++k)
            report.misses.push_back(
                (size_ * residual_.segment<3>(static_cast<Eigen::Index>(3 * k)) +
                 places_[k] - targets_[k].place)
                    .stableNorm());
        return report;
    }

private:
    const std::optional<Vector3d>& hinge(int joint) const
    {
        return skeleton_[idx(joint)].limits.hinge;
    }
    Quaterniond within(int joint, const Quaterniond& turn) const
    {
        return limited(turn, skeleton_[idx(joint)].limits,
                       skeleton_.direction(idx(joint)));
    }
    /// What is much farther away than a chain is long is only a direction: beside such
    /// ways the joint's own would be rounding.
    void find_places()
    {
        const std::vector<Motion> motions = skeleton_.motions(pose_);
        for (const ReachTarget& target : targets_)
        {
            Vector3d& place = places_.emplace_back(target.place);
            if (target.chain.empty())
                continue;
            const int first = *std::min_element(target.chain.begin(), target.chain.end());
            double length = 0.0;
            for (int joint = target.joint; joint > first;
                 joint = skeleton_[idx(joint)].parent)
                length += (skeleton_[idx(joint)].at -
                           skeleton_[idx(skeleton_[idx(joint)].parent)].at)
                              .norm();
            const Vector3d base = motions[idx(first)](skeleton_[idx(first)].at);
            const Vector3d way = target.place - base;
            if (way.stableNorm() > kFar * length)
                place = base + kFar * length * way.stableNormalized();
        }
    }
    double miss() const { return residual_.lpNorm<Eigen::Infinity>(); }

    VectorXd residual(const SkeletonPose& pose) const
    {
        const std::vector<Motion> motions = skeleton_.motions(pose);
        VectorXd residual(3 * static_cast<Eigen::Index>(targets_.size()));
        for (std::size_t k = 0; k < targets_.size(); ++k)
            residual.segment<3>(static_cast<Eigen::Index>(3 * k)) =
                (motions[idx(targets_[k].joint)](skeleton_[idx(targets_[k].joint)].at) -
                 places_[k]) /
                size_;
        return residual;
    }

    MatrixXd jacobian() const
    {
        const std::vector<Motion> motions = skeleton_.motions(pose_);
        MatrixXd J = MatrixXd::Zero(residual_.size(), num_unknowns_);
        for (std::size_t k = 0; k < targets_.size(); ++k)
        {
            const auto row = static_cast<Eigen::Index>(3 * k);
            const Vector3d place = size_ * residual_.segment<3>(row) + places_[k];
            for (std::size_t i = 0; i < joints_.size(); ++i)
            {
                const int joint = joints_[i];
                if (!is_above(joint, targets_[k].joint))
                    continue;
                const int parent = skeleton_[idx(joint)].parent;
                const Eigen::Matrix3d axes =
                    parent < 0 ? Eigen::Matrix3d::Identity() : motions[idx(parent)].R;
                const Vector3d arm =
                    (place - motions[idx(joint)](skeleton_[idx(joint)].at)) / size_;
                if (hinge(joint))
                    J.block<3, 1>(row, first_[i]) = (axes * *hinge(joint)).cross(arm);
                else
                    J.block<3, 3>(row, first_[i]) = -cross_matrix(arm) * axes;
            }
        }
        return J;
    }

    bool is_above(int joint, int below) const
    {
        for (int above = skeleton_[idx(below)].parent; above >= 0;
             above = skeleton_[idx(above)].parent)
            if (above == joint)
                return true;
        return false;
    }

    Vector3d turn_of(std::size_t i, const VectorXd& step) const
    {
        if (const auto& axis = hinge(joints_[i]))
            return step[first_[i]] * *axis;
        return step.segment<3>(first_[i]);
    }

    /// A step with damping \p mu, within the limits.
    VectorXd step(const MatrixXd& J, double mu, SkeletonPose& pose) const
    {
        std::vector<char> is_cut(joints_.size(), 0);
        VectorXd step = VectorXd::Zero(num_unknowns_);
        for (std::size_t round = 0; round <= joints_.size(); ++round)
        {
            std::vector<int> free;
            for (std::size_t i = 0; i < joints_.size(); ++i)
                for (int k = first_[i]; !is_cut[i] && k < end(i); ++k)
                {
                    free.push_back(k);
                    step[k] = 0.0;
                }
            if (!free.empty())
            {
                const MatrixXd of_free = J(Eigen::all, free);
                const VectorXd left = residual_ + J * step;
                MatrixXd A = of_free.transpose() * of_free;
                A.diagonal().array() += mu;
                step(free) = -A.ldlt().solve(of_free.transpose() * left);
            }
            bool has_cut = false;
            for (std::size_t i = 0; i < joints_.size(); ++i)
            {
                const std::size_t joint = idx(joints_[i]);
                const Vector3d wanted = turn_of(i, step);
                const Quaterniond turned =
                    (exponential(wanted) * pose_.turns[joint]).normalized();
                pose.turns[joint] = within(joints_[i], turned);
                const Vector3d done =
                    logarithm(pose.turns[joint] * pose_.turns[joint].conjugate());
                if (is_cut[i] || (done - wanted).norm() <= 1e-6 * wanted.norm() + 1e-14)
                    continue;
                is_cut[i] = has_cut = true;
                if (hinge(joints_[i]))
                    step[first_[i]] = done.dot(*hinge(joints_[i]));
                else
                    step.segment<3>(first_[i]) = done;
            }
            if (!has_cut)
                break;
        }
        return step;
    }

    int end(std::size_t i) const
    {
        return i + 1 < first_.size() ? first_[i + 1] : num_unknowns_;
    }

    /// Bends what is straight, but for where it begins.
    void nudge()
    {
        for (std::size_t i = 1; i < joints_.size(); ++i)
        {
            const std::size_t joint = idx(joints_[i]);
            const Vector3d axis =
                hinge(joints_[i]).value_or(skeleton_.direction(joint).unitOrthogonal());
            // A hinge bends the way its limits let it bend farther.
            const auto& [least, most] = skeleton_[joint].limits.twist;
            const double angle = hinge(joints_[i]) && -least > most ? -kNudge : kNudge;
            pose_.turns[joint] =
                within(joints_[i], exponential(angle * axis) * pose_.turns[joint]);
        }
        for (const ReachTarget& target : targets_)
            point_at(target);
        residual_ = residual(pose_);
    }

    /// Turns the first joint of a chain so that the last one is in line with its place.
    void point_at(const ReachTarget& target)
    {
        if (target.chain.empty())
            return;
        const int first = *std::min_element(target.chain.begin(), target.chain.end());
        const int parent = skeleton_[idx(first)].parent;
        const std::vector<Motion> motions = skeleton_.motions(pose_);
        const Vector3d from = motions[idx(first)](skeleton_[idx(first)].at);
        const Quaterniond turn = Quaterniond::FromTwoVectors(
            motions[idx(target.joint)](skeleton_[idx(target.joint)].at) - from,
            target.place - from);
        const Quaterniond axes =
            parent < 0 ? Quaterniond::Identity() : Quaterniond(motions[idx(parent)].R);
        Quaterniond& own = pose_.turns[idx(first)];
        own = within(first, (axes.conjugate() * turn * axes * own).normalized());
    }

    void go(ReachReport& report)
    {
        descend(report);
        if (miss() <= kThere || report.iterations >= kMostIterations)
            return;
        const SkeletonPose before = pose_;
        const VectorXd residual_before = residual_;
        nudge();
        descend(report);
        if (residual_.norm() < (1.0 - kGain) * residual_before.norm())
            return;
        pose_ = before;
        residual_ = residual_before;
    }

    void descend(ReachReport& report)
    {
        double mu = 1e-3;
        while (report.iterations < kMostIterations && miss() > kThere)
        {
            ++report.iterations;
            const MatrixXd J = jacobian();
            for (;; mu *= 8.0)
            {
                SkeletonPose next = pose_;
                const VectorXd by = step(J, mu, next);
                if (by.lpNorm<Eigen::Infinity>() <= kLeastTurn)
                    return;
                VectorXd at_next = residual(next);
                if (at_next.norm() >= residual_.norm())
                    continue;
                const bool is_still =
                    at_next.norm() > (1.0 - kLeastGain) * residual_.norm();
                pose_ = std::move(next);
                residual_ = std::move(at_next);
                mu = std::max(1e-12, mu / 20.0);
                if (is_still)
                    return;
                break;
            }
        }
    }

    const Skeleton& skeleton_;
    std::span<const ReachTarget> targets_;
    SkeletonPose& pose_;
    std::vector<int> joints_, first_; ///< those that turn; the first unknown of each
    int num_unknowns_ = 0;
    double size_ = 0.0;            ///< of the skeleton
    std::vector<Vector3d> places_; ///< of the targets, not too far away
    VectorXd residual_;            ///< [size]
};

} // namespace

std::vector<int> usual_chain(const Skeleton& skeleton, int joint)
{
    std::vector<int> chain;
    for (int above = skeleton[idx(joint)].parent; above >= 0;
         above = skeleton[idx(above)].parent)
    {
        if (skeleton.children(idx(above)).size() > 1)
        {
            if (chain.empty())
                chain.push_back(above);
            break;
        }
        chain.push_back(above);
    }
    std::reverse(chain.begin(), chain.end());
    return chain;
}

ReachReport reach(const Skeleton& skeleton, std::span<const ReachTarget> targets,
                  SkeletonPose& pose)
{
    return Reacher(skeleton, targets, pose).solve();
}

} // namespace cellwarp::core
