// SPDX-License-Identifier: GPL-3.0-or-later
// A joint is in the plane if it is near it, or if ends of limbs on both sides or in the
// plane come after it; else it is on the side of those that do. A limb is what begins at
// a joint beside the plane whose parent is in it. The flow finds limbs of both sides a
// little differently: of two that are each other's image the one with more ends counts,
// then the one with more joints. A joint in the plane where nothing branches any more,
// because the limb of the other side left elsewhere, is dropped.
#include "octree/mirrored_limbs.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

/// Two limbs are each other's image where the one ends no farther from the image of the
/// other's end than this share of its length.
constexpr double kImageOfEnd = 0.35;

class Mirrored
{
public:
    Mirrored(const std::vector<LimbJoint>& joints, const MirrorPlane& plane,
             double tolerance, const std::function<bool(const Vector3d&)>& is_inside)
        : joints_(joints), plane_(plane), tolerance_(tolerance), is_inside_(is_inside),
          children_(joints.size()), sides_(joints.size(), 0)
    {
        for (std::size_t j = 1; j < joints.size(); ++j)
            children_[idx(joints[j].parent)].push_back(static_cast<int>(j));
        find_sides();
    }

    std::vector<LimbJoint> joints()
    {
        // A root beside the plane, as of a line across it, and all on one side of it.
        if (sides_[0] != kMiddle || std::abs(plane_.side(joints_[0].at)) >
                                        std::max(tolerance_, joints_[0].radius))
            return {};
        choose();
        if (!std::all_of(kept_.begin(), kept_.end(),
                         [&](int limb) { return has_place_for_image(limb); }))
            return {}; // the shape does something else on the other side
        add_middle(0, -1);
        return std::move(out_);
    }

private:
    static constexpr unsigned kLeft = 1, kRight = 2, kMiddle = 4;

    void find_sides()
    {
        for (std::size_t j = joints_.size(); j-- > 0;)
        {
            unsigned sides = 0;
            for (const int child : children_[j])
                sides |= sides_[idx(child)];
            if (children_[j].empty() || j == 0)
            {
                const double side = plane_.side(joints_[j].at);
                const double near = std::max(tolerance_, 0.5 * joints_[j].radius);
                if (children_[j].empty() || sides == 0)
                    sides |= side > near ? kLeft : side < -near ? kRight : kMiddle;
            }
            const bool is_one = sides == kLeft || sides == kRight;
            sides_[j] = is_one && std::abs(plane_.side(joints_[j].at)) > tolerance_
                            ? sides
                            : kMiddle;
        }
    }
    bool is_middle(int joint) const { return sides_[idx(joint)] == kMiddle; }

    template <class Visit>
    void for_each_of_limb(int joint, const Visit& visit) const
    {
        visit(joint);
        for (const int child : children_[idx(joint)])
            for_each_of_limb(child, visit);
    }
    std::pair<int, int> ends_and_joints(int limb) const
    {
        std::pair<int, int> out(0, 0);
        for_each_of_limb(limb,
                         [&](int joint)
                         {
                             out.first += children_[idx(joint)].empty() ? 1 : 0;
                             ++out.second;
                         });
        return out;
    }
    /// The end of a limb that is farthest from where it begins, and how far.
    std::pair<Vector3d, double> end_of(int limb) const
    {
        const Vector3d& from = joints_[idx(joints_[idx(limb)].parent)].at;
        std::pair<Vector3d, double> out(from, -1.0);
        for_each_of_limb(limb,
                         [&](int joint)
                         {
                             const Vector3d& at = joints_[idx(joint)].at;
                             if (const double away = (at - from).norm();
                                 away > out.second)
                                 out = {at, away};
                         });
        return out;
    }
    bool has_place_for_image(int limb) const
    {
        bool has = true;
        for_each_of_limb(
            limb, [&](int joint)
            { has = has && is_inside_(plane_.mirrored(joints_[idx(joint)].at)); });
        return has;
    }

    /// Chooses the limbs that get an image, and those that stay alone.
    void choose()
    {
        std::vector<int> left, right;
        for (std::size_t j = 1; j < joints_.size(); ++j)
            if (sides_[j] != kMiddle && is_middle(joints_[j].parent))
                (sides_[j] == kLeft ? left : right).push_back(static_cast<int>(j));
        std::vector<char> is_taken(right.size(), 0);
        for (const int one : left)
        {
            const auto [end, length] = end_of(one);
            std::optional<std::size_t> image;
            double least = kImageOfEnd * length;
            for (std::size_t k = 0; k < right.size(); ++k)
                if (const double away =
                        (plane_.mirrored(end) - end_of(right[k]).first).norm();
                    !is_taken[k] && away < least)
                {
                    least = away;
                    image = k;
                }
            if (image)
            {
                is_taken[*image] = 1;
                const int other = right[*image];
                kept_.push_back(ends_and_joints(other) > ends_and_joints(one) ? other
                                                                              : one);
            }
            else
                (has_place_for_image(one) ? kept_ : alone_).push_back(one);
        }
        for (std::size_t k = 0; k < right.size(); ++k)
            if (!is_taken[k])
                (has_place_for_image(right[k]) ? kept_ : alone_).push_back(right[k]);
    }
    bool is_in(const std::vector<int>& limbs, int joint) const
    {
        return std::find(limbs.begin(), limbs.end(), joint) != limbs.end();
    }
    /// The number of limbs that are left behind a joint in the plane.
    int count_of_children(int joint) const
    {
        int count = 0;
        for (const int child : children_[idx(joint)])
            count += is_middle(child) ? (is_left_over(child) ? 0 : 1)
                                      : is_in(kept_, child) || is_in(alone_, child);
        return count;
    }
    /// A joint in the plane all of whose limbs are gone.
    bool is_left_over(int joint) const
    {
        return !children_[idx(joint)].empty() && count_of_children(joint) == 0;
    }

    void add_middle(int joint, int parent)
    {
        if (is_left_over(joint))
            return;
        const std::size_t had = children_[idx(joint)].size();
        int here = parent;
        // A joint that only limbs needed which are now elsewhere is none any more.
        if (parent < 0 || had < 2 || count_of_children(joint) > 1 || has_limb(joint))
        {
            LimbJoint copy = joints_[idx(joint)];
            copy.at = plane_.projected(copy.at);
            if (parent < 0 || (copy.at - out_[idx(parent)].at).norm() > tolerance_)
            {
                copy.parent = parent;
                out_.push_back(copy);
                here = static_cast<int>(out_.size()) - 1;
            }
        }
        for (const int child : children_[idx(joint)])
            if (is_middle(child))
                add_middle(child, here);
            else if (is_in(kept_, child))
                for (const bool is_image : {false, true})
                    add_limb(child, here, sides_[idx(child)] == kLeft ? 1 : -1, is_image);
            else if (is_in(alone_, child))
                add_limb(child, here, 0, false);
    }
    bool has_limb(int joint) const
    {
        const std::vector<int>& all = children_[idx(joint)];
        return std::any_of(all.begin(), all.end(),
                           [&](int child)
                           { return is_in(kept_, child) || is_in(alone_, child); });
    }
    void add_limb(int joint, int parent, int side, bool is_image)
    {
        LimbJoint copy = joints_[idx(joint)];
        copy.parent = parent;
        copy.side = is_image ? -side : side;
        if (is_image)
            copy.at = plane_.mirrored(copy.at);
        out_.push_back(copy);
        const int here = static_cast<int>(out_.size()) - 1;
        for (const int child : children_[idx(joint)])
            add_limb(child, here, side, is_image);
    }

    const std::vector<LimbJoint>& joints_;
    const MirrorPlane& plane_;
    const double tolerance_;
    const std::function<bool(const Vector3d&)>& is_inside_;
    std::vector<std::vector<int>> children_;
    std::vector<unsigned> sides_;
    std::vector<int> kept_, alone_; ///< first joints of limbs
    std::vector<LimbJoint> out_;
};

} // namespace

std::vector<LimbJoint>
mirrored_limbs(const std::vector<LimbJoint>& joints, const MirrorPlane& plane,
               double tolerance,
               const std::function<bool(const Eigen::Vector3d&)>& is_inside)
{
    return joints.empty() ? std::vector<LimbJoint>()
                          : Mirrored(joints, plane, tolerance, is_inside).joints();
}

} // namespace cellwarp::core
