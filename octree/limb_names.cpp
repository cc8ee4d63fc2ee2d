// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/limb_names.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

#include <Eigen/Geometry>

#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

/// The share of the height that is near the ground, and how long a leg or an arm is at
/// least [height].
constexpr double kGround = 0.15, kShortestLeg = 0.1;

/// Limbs leave at one height if that differs by no more than this [height].
constexpr double kOneHeight = 0.05;

/// Feet point somewhere where their last bones reach so far, of their lengths.
constexpr double kPoints = 0.3;

struct Limb
{
    std::vector<int> joints; ///< of one side where it has two
    int parent = -1;         ///< joint that it begins at
    bool is_pair = false;
    double length = 0.0;
    double lowest = std::numeric_limits<double>::infinity();
    double highest = -std::numeric_limits<double>::infinity();
};

class Names
{
public:
    Names(const std::vector<LimbJoint>& joints, char up)
        : joints_(joints), up_(Vector3d::Unit(up - 'x'))
    {
        for (const LimbJoint& joint : joints)
        {
            low_ = std::min(low_, height(joint));
            high_ = std::max(high_, height(joint));
        }
        find_limbs();
        name_limbs();
        find_left();
    }

    std::vector<std::string> all() const
    {
        std::vector<std::string> out;
        std::map<std::pair<int, int>, int> count;
        for (const LimbJoint& joint : joints_)
        {
            std::string name = "root";
            if (joint.parent >= 0)
                name = base_.at(joint.limb) + "." +
                       std::to_string(++count[{joint.limb, joint.side}]);
            if (joint.side != 0)
                name += joint.side == left_ ? ".L" : ".R";
            out.push_back(std::move(name));
        }
        return out;
    }

private:
    double height(const LimbJoint& joint) const { return up_.dot(joint.at); }

    void find_limbs()
    {
        for (std::size_t j = 0; j < joints_.size(); ++j)
        {
            const LimbJoint& joint = joints_[j];
            if (joint.parent < 0)
                continue;
            Limb& limb = limbs_[joint.limb];
            limb.is_pair = limb.is_pair || joint.side != 0;
            if (joint.side < 0)
                continue;
            const LimbJoint& before = joints_[idx(joint.parent)];
            if (limb.joints.empty())
                limb.parent = joint.parent;
            limb.joints.push_back(static_cast<int>(j));
            limb.length += (joint.at - before.at).norm();
            limb.lowest = std::min(limb.lowest, height(joint));
            limb.highest = std::max(limb.highest, height(joint));
        }
    }
    /// The limb of the joint that a limb begins at; 0: the root.
    int before(const Limb& limb) const { return joints_[idx(limb.parent)].limb; }

    void name_limbs()
    {
        for (const auto& [number, limb] : limbs_)
            base_[number] = "limb" + std::to_string(number);
        const double size = high_ - low_;
        for (const auto& [number, limb] : limbs_)
            if (limb.is_pair && limb.length > kShortestLeg * size &&
                limb.lowest < low_ + kGround * size &&
                !(before(limb) > 0 && limbs_.at(before(limb)).is_pair))
                legs_.push_back(number);
        for (std::size_t k = 0; k < legs_.size(); ++k)
            base_[legs_[k]] = legs_.size() == 1 ? "leg" : "leg" + std::to_string(k + 1);
        if (legs_.size() == 1)
            name_upright(limbs_.at(legs_.front()));
        for (const char* const part : {"arm", "leg"})
            name_parts(part);
    }
    /// Arms, spine and head of what stands on two legs.
    void name_upright(const Limb& legs)
    {
        const double size = high_ - low_, pelvis = height(joints_[idx(legs.parent)]);
        int arms = 0;
        // The longest of those that leave lowest.
        double least = std::numeric_limits<double>::infinity(), longest = 0.0;
        for (const auto& [number, limb] : limbs_)
        {
            if (!limb.is_pair || limb.length < kShortestLeg * size ||
                base_[number] == "leg" ||
                (before(limb) > 0 && limbs_.at(before(limb)).is_pair))
                continue;
            const double from = height(joints_[idx(limb.parent)]);
            const bool is_lower = from < least - kOneHeight * size;
            if (from > pelvis &&
                (is_lower || (from < least + kOneHeight * size && limb.length > longest)))
            {
                least = from;
                longest = limb.length;
                arms = number;
            }
        }
        if (arms == 0)
            return;
        base_[arms] = "arm";
        const int chest = limbs_.at(arms).parent;
        // Limbs in the plane: between pelvis and chest, and above the chest.
        int head = 0;
        double top = height(joints_[idx(chest)]);
        for (const auto& [number, limb] : limbs_)
        {
            if (limb.is_pair)
                continue;
            if (limb.joints.back() == chest)
                base_[number] = "spine";
            else if (limb.joints.back() == legs.parent)
                base_[number] = "pelvis";
            else if (limb.highest > top)
            {
                top = limb.highest;
                head = number;
            }
        }
        if (head == 0)
            return;
        base_[head] = "head";
        if (const int neck = before(limbs_.at(head));
            neck > 0 && !limbs_.at(neck).is_pair &&
            limbs_.at(neck).joints.back() != chest)
            base_[neck] = "neck";
    }
    /// Fingers and toes: what hangs on arms and legs, and on other fingers and toes.
    void name_parts(const std::string& of)
    {
        const std::string part = of == "arm" ? "finger" : "toe";
        int count = 0;
        for (const auto& [number, limb] : limbs_)
            if (const std::string& base = base_[before(limb)];
                base.starts_with(of) || base.starts_with(part))
                base_[number] = part + std::to_string(++count);
    }

    /// Finds the LimbJoint::side that is the left one.
    void find_left()
    {
        Vector3d normal = Vector3d::Zero();
        for (const LimbJoint& joint : joints_)
            normal += joint.side * joint.at;
        if (normal.isZero(0))
            return;
        normal = (normal - normal.dot(up_) * up_).stableNormalized();
        // Forwards, if the normal points to the left.
        const Vector3d forwards = normal.cross(up_);
        double ahead = 0.0, lengths = 0.0;
        for (const int leg : legs_)
        {
            const Limb& limb = limbs_.at(leg);
            const LimbJoint& end = joints_[idx(limb.joints.back())];
            const Vector3d foot = end.at - joints_[idx(end.parent)].at;
            ahead += foot.dot(forwards);
            lengths += foot.norm();
        }
        if (std::abs(ahead) > kPoints * lengths)
            left_ = ahead > 0.0 ? 1 : -1;
        else
        {
            // The side of x, or of y where x points upwards; where that axis lies in the
            // plane, the side to the left of it.
            const Vector3d axis =
                up_.x() > 0.5 ? Vector3d(Vector3d::UnitY()) : Vector3d(Vector3d::UnitX());
            const double along = normal.dot(axis);
            const double side =
                std::abs(along) > 0.5 ? along : normal.dot(up_.cross(axis));
            left_ = side >= 0.0 ? 1 : -1;
        }
    }

    const std::vector<LimbJoint>& joints_;
    Vector3d up_;
    double low_ = std::numeric_limits<double>::infinity();
    double high_ = -std::numeric_limits<double>::infinity();
    std::map<int, Limb> limbs_; ///< by number
    std::map<int, std::string> base_;
    std::vector<int> legs_; ///< numbers
    int left_ = 1;
};

} // namespace

std::vector<std::string> limb_names(const std::vector<LimbJoint>& joints, char up)
{
    return Names(joints, up).all();
}

} // namespace cellwarp::core
