// SPDX-License-Identifier: GPL-3.0-or-later
// Trees are compared without short branches beside longer ones: fingers, toes and ears
// are left out but for the longest of each hand. The ends of limbs are then matched by
// where they are in their skeletons, each scaled to its height, so that the sum of
// distances is least; the other skeleton looks the same way, or is turned by quarters
// where that is clearly nearer. A joint where limbs branch is, in the other tree, the one
// where the ways between the same ends meet. Joints between two that are matched are
// matched in their order, by the share of the way at which they are.
#include "library/session/matched_joints.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <optional>

#include <Eigen/Geometry>

#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

/// A branch is short if it is shorter than this share of the skeleton's diagonal.
constexpr double kShort = 0.12;

/// Another direction is taken where distances become less than this share of what they
/// are.
constexpr double kClearly = 0.8;

/// The cost of a joint between two others that stays without one of the other skeleton
/// [share of the way].
constexpr double kUnmatched = 0.3;

/// A skeleton without short branches.
class Tree
{
public:
    explicit Tree(const std::vector<SkeletonJoint>& joints)
        : parent_(parents_of(joints)), around_(joints.size()), is_there_(joints.size(), 1)
    {
        for (const SkeletonJoint& joint : joints)
        {
            at_.push_back(joint.at);
            box_.extend(joint.at);
        }
        cut_short_branches();
        for (std::size_t j = 1; j < at_.size(); ++j)
            if (is_there_[j])
            {
                around_[j].push_back(parent_[j]);
                around_[idx(parent_[j])].push_back(static_cast<int>(j));
            }
    }

    std::size_t size() const { return at_.size(); }
    const std::vector<int>& around(int joint) const { return around_[idx(joint)]; }
    std::vector<int> ends() const
    {
        std::vector<int> out;
        for (std::size_t j = 0; j < at_.size(); ++j)
            if (around_[j].size() == 1)
                out.push_back(static_cast<int>(j));
        return out;
    }
    /// The place of a joint in a skeleton of height 1 whose feet are at the origin.
    Vector3d share(int joint) const
    {
        const Vector3d size = box_.sizes();
        const double height =
            size.y() > 0.1 * size.maxCoeff() ? size.y() : size.maxCoeff();
        const Vector3d foot(box_.center().x(), box_.min().y(), box_.center().z());
        return (at_[idx(joint)] - foot) / height;
    }
    /// The way from one joint to another.
    std::vector<int> way(int from, int to) const
    {
        std::vector<int> up = line_to_root(from), down = line_to_root(to);
        int meeting = -1;
        while (!up.empty() && !down.empty() && up.back() == down.back())
        {
            meeting = up.back();
            up.pop_back();
            down.pop_back();
        }
        if (meeting >= 0)
            up.push_back(meeting);
        up.insert(up.end(), down.rbegin(), down.rend());
        return up;
    }
    /// The joint at which the ways between three joints meet.
    int meeting(int a, int b, int c) const
    {
        const std::vector<int> one = way(a, b), other = way(a, c);
        std::size_t k = 0;
        while (k + 1 < std::min(one.size(), other.size()) && one[k + 1] == other[k + 1])
            ++k;
        return one[k];
    }
    /// Shares of the length of a way at which its joints are.
    std::vector<double> shares(const std::vector<int>& way) const
    {
        std::vector<double> out = {0.0};
        for (std::size_t k = 1; k < way.size(); ++k)
            out.push_back(out.back() + (at_[idx(way[k])] - at_[idx(way[k - 1])]).norm());
        for (double& share : out)
            share /= std::max(out.back(), 1e-300);
        return out;
    }

private:
    void cut_short_branches()
    {
        const double shortest = kShort * box_.diagonal().norm();
        std::vector<double> reach(at_.size(), 0.0); // farthest way downwards
        std::vector<std::vector<int>> children(at_.size());
        const auto length = [&](int j)
        { return (at_[idx(j)] - at_[idx(parent_[idx(j)])]).norm() + reach[idx(j)]; };
        for (std::size_t j = at_.size(); j-- > 0;)
        {
            const std::vector<int>& all = children[j];
            for (const int child : all)
                reach[j] = std::max(reach[j], length(child));
            for (const int child : all)
                if (length(child) < shortest && length(child) < reach[j])
                    is_there_[idx(child)] = 0;
            if (parent_[j] >= 0)
                children[idx(parent_[j])].push_back(static_cast<int>(j));
        }
        for (std::size_t j = 1; j < at_.size(); ++j)
            is_there_[j] = is_there_[j] && is_there_[idx(parent_[j])];
    }
    std::vector<int> line_to_root(int joint) const
    {
        std::vector<int> out;
        for (; joint >= 0; joint = parent_[idx(joint)])
            out.push_back(joint);
        return out;
    }

    std::vector<int> parent_;
    std::vector<Vector3d> at_;
    std::vector<std::vector<int>> around_; ///< also the parent
    std::vector<char> is_there_;
    Eigen::AlignedBox3d box_;
};

/// For each of the first places one of the second, -1 where these are fewer; of nearly
/// the least sum of distances, which is returned too: the nearest pair first, then
/// exchanges.
std::pair<double, std::vector<int>> nearest_pairs(const std::vector<Vector3d>& first,
                                                  const std::vector<Vector3d>& second)
{
    std::vector<int> of_first(first.size(), -1);
    std::vector<char> is_taken(second.size(), 0);
    const auto away = [&](std::size_t i, int k)
    { return k < 0 ? 0.0 : (first[i] - second[idx(k)]).norm(); };
    for (std::size_t n = 0; n < std::min(first.size(), second.size()); ++n)
    {
        double least = std::numeric_limits<double>::infinity();
        std::pair<std::size_t, std::size_t> best;
        for (std::size_t i = 0; i < first.size(); ++i)
            for (std::size_t k = 0; k < second.size(); ++k)
                if (of_first[i] < 0 && !is_taken[k] &&
                    (first[i] - second[k]).norm() < least)
                {
                    least = (first[i] - second[k]).norm();
                    best = {i, k};
                }
        of_first[best.first] = static_cast<int>(best.second);
        is_taken[best.second] = 1;
    }
    for (bool again = true; again;)
    {
        again = false;
        for (std::size_t i = 0; i < first.size(); ++i)
            for (std::size_t j = 0; j < i; ++j)
                if (away(i, of_first[j]) + away(j, of_first[i]) <
                    away(i, of_first[i]) + away(j, of_first[j]) - 1e-9)
                {
                    std::swap(of_first[i], of_first[j]);
                    again = true;
                }
    }
    double sum = 0.0;
    for (std::size_t i = 0; i < first.size(); ++i)
        sum += away(i, of_first[i]);
    return {sum, of_first};
}

/// Pairs of inner joints of two ways, in order, of the least sum of differences of their
/// shares: of each of the first the number of the second, or 0.
std::vector<std::size_t> ordered_pairs(const std::vector<double>& first,
                                       const std::vector<double>& second)
{
    const std::size_t n = first.size() - 2, m = second.size() - 2;
    // cost(i, k): of the first i and k of both.
    std::vector<std::vector<double>> cost(n + 1, std::vector<double>(m + 1, 0.0));
    for (std::size_t i = 1; i <= n; ++i)
    {
        cost[i][0] = cost[i - 1][0] + kUnmatched;
        for (std::size_t k = 1; k <= m; ++k)
            cost[i][k] = std::min({cost[i][k - 1], cost[i - 1][k] + kUnmatched,
                                   cost[i - 1][k - 1] + std::abs(first[i] - second[k])});
    }
    std::vector<std::size_t> out(first.size(), 0);
    for (std::size_t i = n, k = m; i > 0 && k > 0;)
        if (cost[i][k] == cost[i][k - 1])
            --k;
        else if (cost[i][k] == cost[i - 1][k] + kUnmatched)
            --i;
        else
            out[i--] = k--;
    return out;
}

class ByShape
{
public:
    ByShape(const std::vector<SkeletonJoint>& joints,
            const std::vector<SkeletonJoint>& other)
        : one_(joints), other_(other), of_other_(joints.size(), -1)
    {
    }

    MatchedJoints find()
    {
        MatchedJoints out;
        out.quarter_turns = match_ends();
        match_branchings();
        match_between();
        out.of_other = of_other_;
        return out;
    }

private:
    int match_ends()
    {
        const std::vector<int> ends = one_.ends(), others = other_.ends();
        std::vector<Vector3d> places;
        for (const int end : ends)
            places.push_back(one_.share(end));
        double least = 0.0;
        int turns = 0;
        std::vector<int> best;
        for (int quarter = 0; quarter < 4; ++quarter)
        {
            const Eigen::AngleAxisd turn(0.5 * quarter * std::numbers::pi,
                                         Vector3d::UnitY());
            std::vector<Vector3d> turned;
            for (const int end : others)
                turned.push_back(turn * other_.share(end));
            const auto [sum, pairs] = nearest_pairs(places, turned);
            if (quarter == 0 || sum < (turns == 0 ? kClearly : 1.0) * least)
            {
                least = sum;
                turns = quarter;
                best = pairs;
            }
        }
        for (std::size_t k = 0; k < ends.size(); ++k)
            if (best[k] >= 0)
            {
                of_other_[idx(ends[k])] = others[idx(best[k])];
                ends_.push_back(ends[k]);
            }
        return turns;
    }
    /// Ends that are matched, by the joint around \p joint that leads to them.
    std::vector<std::vector<int>> ends_around(int joint) const
    {
        std::map<int, std::vector<int>> by_next;
        for (const int end : ends_)
            if (end != joint)
                by_next[one_.way(joint, end)[1]].push_back(end);
        std::vector<std::vector<int>> out;
        for (auto& [next, ends] : by_next)
            out.push_back(std::move(ends));
        return out;
    }
    void match_branchings()
    {
        for (std::size_t j = 0; j < one_.size(); ++j)
        {
            const int joint = static_cast<int>(j);
            if (one_.around(joint).size() < 3)
                continue;
            const std::vector<std::vector<int>> ends = ends_around(joint);
            std::map<int, int> votes;
            for (std::size_t a = 0; a < ends.size(); ++a)
                for (std::size_t b = 0; b < a; ++b)
                    for (std::size_t c = 0; c < b; ++c)
                        ++votes[other_.meeting(of_other_[idx(ends[a].front())],
                                               of_other_[idx(ends[b].front())],
                                               of_other_[idx(ends[c].front())])];
            int most = 0;
            for (const auto& [meeting, count] : votes)
                if (count > most)
                {
                    most = count;
                    of_other_[j] = meeting;
                }
        }
    }
    /// Along the ways from each end to the next joint that is matched, and between those.
    void match_between()
    {
        const std::vector<int> anchors = of_other_;
        for (std::size_t a = 0; a < one_.size(); ++a)
            for (std::size_t b = 0; b < a && anchors[a] >= 0; ++b)
            {
                if (anchors[b] < 0)
                    continue;
                const std::vector<int> way = one_.way(int(a), int(b));
                if (std::any_of(way.begin() + 1, way.end() - 1,
                                [&](int joint) { return anchors[idx(joint)] >= 0; }))
                    continue;
                const std::vector<int> others = other_.way(anchors[a], anchors[b]);
                if (way.size() < 3 || others.size() < 3)
                    continue;
                const std::vector<std::size_t> pairs =
                    ordered_pairs(one_.shares(way), other_.shares(others));
                for (std::size_t k = 1; k + 1 < way.size(); ++k)
                    if (pairs[k] > 0)
                        of_other_[idx(way[k])] = others[pairs[k]];
            }
    }

    const Tree one_, other_;
    std::vector<int> of_other_;
    std::vector<int> ends_; ///< that are matched
};

/// The part of a name that counts: letters and numbers behind a colon, in lower case.
std::string plain(const std::string& name)
{
    std::string out;
    for (const char c : name.substr(name.rfind(':') + 1))
        if (std::isalnum(static_cast<unsigned char>(c)))
            out += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return out;
}

std::optional<MatchedJoints> by_names(const std::vector<SkeletonJoint>& joints,
                                      const std::vector<SkeletonJoint>& other)
{
    std::map<std::string, int> numbers;
    for (std::size_t k = other.size(); k-- > 0;)
        numbers[plain(other[k].name)] = static_cast<int>(k);
    std::vector<char> has_bone(joints.size(), 0);
    for (const int parent : parents_of(joints))
        if (parent >= 0)
            has_bone[idx(parent)] = 1;
    MatchedJoints out;
    int bones = 0, named = 0;
    for (std::size_t j = 0; j < joints.size(); ++j)
    {
        const auto found = numbers.find(plain(joints[j].name));
        out.of_other.push_back(found == numbers.end() ? -1 : found->second);
        bones += has_bone[j];
        named += has_bone[j] && out.of_other.back() >= 0;
    }
    if (2 * named < bones)
        return {};
    return out;
}

} // namespace

std::vector<int> parents_of(const std::vector<SkeletonJoint>& joints)
{
    std::map<std::string, int> numbers;
    std::vector<int> out;
    for (std::size_t k = 0; k < joints.size(); ++k)
    {
        numbers[joints[k].name] = static_cast<int>(k);
        out.push_back(joints[k].parent.empty() ? -1 : numbers.at(joints[k].parent));
    }
    return out;
}

MatchedJoints matched_joints(const std::vector<SkeletonJoint>& joints,
                             const std::vector<SkeletonJoint>& other)
{
    if (const std::optional<MatchedJoints> named = by_names(joints, other))
        return *named;
    return ByShape(joints, other).find();
}

} // namespace cellwarp::core
