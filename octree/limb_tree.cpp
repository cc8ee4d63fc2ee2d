// SPDX-License-Identifier: GPL-3.0-or-later
// Tips and branchings of the curve skeleton are joints; branchings within the thickness
// of the shape are one (a chest has several, one for each limb that leaves). The tree
// hangs on the root by shortest ways, so that a ring is open where two of them meet.
// Between two joints the centre line is cut where it bends: at the place that is farthest
// from its straight piece, again and again, until all is nearer than a share of the
// limb's radius (Douglas and Peucker's way). A long piece that does not bend is cut as
// well, because arms and legs of a T-pose are straight: evenly, but at a waist where one
// is near.
#include "octree/limb_tree.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <queue>
#include <utility>

#include "octree/base/bounding_box.h"
#include "octree/base/index.h"
#include "octree/base/point_tree.h"
#include "octree/base/segment.h"
#include "octree/curve_graph.h"
#include "octree/mirror_plane.h"
#include "octree/mirrored_limbs.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

/// Places of a limb's line.
constexpr int kPlacesOfLimb = 65;

/// What is a limb: branches to the corners of a box are up to 1.73 radii long. Fingers
/// that are close together show where they are not wrapped.
constexpr CurveOptions kLimbs = {1.75, 1.4, 60000};

/// Branchings whose distance is less than so many of the larger radius are one joint.
constexpr double kOne = 1.0;

/// Joints so near to a mirror plane are in it, and so near to the surface in the shape
/// [diagonal].
constexpr double kInPlane = 0.01;

/// A bone is at least so long, in radii.
constexpr double kShortest = 0.8;

/// A straight piece is cut if it is so much of its limb: a shin below a bent knee is not.
constexpr double kMostOfLimb = 0.45;

/// It is cut at a waist that is nearer to its middle than this part of its
/// length, if its radius is less than such a share of those around it.
constexpr std::size_t kNearMiddle = 8;
constexpr double kWaist = 0.97;

/// A way between two nodes that are joints.
struct Branch
{
    std::vector<int> way;
    double length = 0.0;
};

/// Where the line from \p first to \p last bends, in order.
void find_bends(const std::vector<Vector3d>& line, std::size_t first, std::size_t last,
                double tolerance, double shortest, std::vector<std::size_t>& out)
{
    double most = tolerance;
    std::size_t bend = 0;
    for (std::size_t k = first + 1; k < last; ++k)
    {
        const double t = nearest_share(line[first], line[last], line[k]);
        const double away =
            (line[first] + t * (line[last] - line[first]) - line[k]).norm();
        const bool is_long = (line[k] - line[first]).norm() >= shortest &&
                             (line[last] - line[k]).norm() >= shortest;
        if (is_long && away > most)
        {
            most = away;
            bend = k;
        }
    }
    if (bend == 0)
        return;
    find_bends(line, first, bend, tolerance, shortest, out);
    out.push_back(bend);
    find_bends(line, bend, last, tolerance, shortest, out);
}

/// The narrowest place of a piece of a line near \p at, between \p low and \p high; \p at
/// where it is not wider on both sides.
std::size_t waist_near(const std::vector<double>& radii, std::size_t at, std::size_t low,
                       std::size_t high)
{
    const auto begin = radii.begin();
    const auto least =
        std::min_element(begin + std::ptrdiff_t(low), begin + std::ptrdiff_t(high + 1));
    const auto k = static_cast<std::size_t>(least - begin);
    return k > low && k < high && *least < kWaist * radii[low] &&
                   *least < kWaist * radii[high]
               ? k
               : at;
}

/// Adds to the places \p bends, ascending, those that divide long straight pieces between
/// them into \p bones.
void divide_long_pieces(const std::vector<Vector3d>& line,
                        const std::vector<double>& radii, int bones,
                        std::vector<std::size_t>& bends)
{
    std::vector<std::size_t> out;
    std::size_t first = 0;
    bends.push_back(line.size() - 1);
    for (const std::size_t last : bends)
    {
        std::vector<double> between(radii.begin() + std::ptrdiff_t(first),
                                    radii.begin() + std::ptrdiff_t(last + 1));
        const auto middle = between.begin() + std::ptrdiff_t(between.size() / 2);
        std::nth_element(between.begin(), middle, between.end());
        const std::size_t count = last - first, near = count / kNearMiddle;
        if ((line[last] - line[first]).norm() > kLongBone * *middle &&
            static_cast<double>(count) > kMostOfLimb * static_cast<double>(line.size()) &&
            count > static_cast<std::size_t>(bones))
            for (int k = 1; k < bones; ++k)
            {
                const std::size_t at = first + idx(k) * count / idx(bones);
                out.push_back(bones == 2 ? waist_near(radii, at, at - near, at + near)
                                         : at);
            }
        if (last + 1 < line.size())
            out.push_back(last);
        first = last;
    }
    bends = std::move(out);
}

class Tree
{
public:
    Tree(const CurveGraph& graph, const LimbOptions& options)
        : graph_(graph), options_(options), joint_of_(idx(graph.size()), -1)
    {
        find_joints();
        merge();
    }

    std::vector<LimbJoint> grow()
    {
        out_.push_back({place_of(root()), -1, 0, radius_of(root())});
        std::vector<int> number(members_.size(), -1); // of a joint: in the tree
        std::vector<bool> is_used(branches_.size(), false);
        number[idx(root())] = 0;
        // Nearest first, along the branches.
        using Next = std::tuple<double, std::size_t, int>; // distance, branch, from
        std::priority_queue<Next, std::vector<Next>, std::greater<>> open;
        const auto add = [&](int joint, double away)
        {
            for (std::size_t b = 0; b < branches_.size(); ++b)
                if (!is_used[b] && (end(b, 0) == joint || end(b, 1) == joint))
                    open.emplace(away + branches_[b].length, b, joint);
        };
        add(root(), 0.0);
        while (!open.empty())
        {
            const auto [away, b, from] = open.top();
            open.pop();
            if (is_used[b])
                continue;
            is_used[b] = true;
            const int to = end(b, 0) == from ? end(b, 1) : end(b, 0);
            const bool closes = number[idx(to)] >= 0;
            const int last = add_limb(b, from, to, number[idx(from)], closes);
            if (closes)
                continue;
            number[idx(to)] = last;
            add(to, away);
        }
        return std::move(out_);
    }

private:
    void find_joints()
    {
        for (int node = 0; node < graph_.size(); ++node)
            if (graph_.is_there(node) && graph_.degree(node) != 2 &&
                graph_.degree(node) > 0)
                add_joint(node);
        if (members_.empty()) // a ring
            for (int node = 0; node < graph_.size() && members_.empty(); ++node)
                if (graph_.is_there(node))
                    add_joint(node);
        for (std::size_t j = 0; j < members_.size(); ++j)
        {
            const int node = members_[j].front();
            for (const int next : graph_.around(node))
            {
                std::vector<int> way = graph_.branch(node, next);
                // From either end; of a ring both ways are from one.
                if (joint_of_[idx(way.back())] < 0 || way.back() < node ||
                    (way.back() == node && way[1] > way[way.size() - 2]))
                    continue;
                const double length = graph_.length_of(way);
                branches_.push_back({std::move(way), length});
            }
        }
    }
    void add_joint(int node)
    {
        joint_of_[idx(node)] = static_cast<int>(members_.size());
        members_.push_back({node});
    }
    int end(std::size_t branch, int which) const
    {
        const std::vector<int>& way = branches_[branch].way;
        return joint_of_[idx(which == 0 ? way.front() : way.back())];
    }
    /// Branchings that are one joint.
    void merge()
    {
        for (bool again = true; again;)
        {
            again = false;
            for (std::size_t b = 0; b < branches_.size() && !again; ++b)
            {
                const int one = end(b, 0), other = end(b, 1);
                const int first = branches_[b].way.front(),
                          last = branches_[b].way.back();
                if (graph_.degree(first) < 3 || graph_.degree(last) < 3 ||
                    branches_[b].length >
                        kOne * std::max(graph_.radius(first), graph_.radius(last)))
                    continue;
                again = true;
                branches_.erase(branches_.begin() + std::ptrdiff_t(b));
                if (one == other)
                    continue;
                for (const int node : members_[idx(other)])
                {
                    joint_of_[idx(node)] = one;
                    members_[idx(one)].push_back(node);
                }
                members_[idx(other)].clear();
            }
        }
    }
    Vector3d place_of(int joint) const
    {
        Vector3d sum = Vector3d::Zero();
        for (const int node : members_[idx(joint)])
            sum += graph_.place(node);
        return sum / static_cast<double>(members_[idx(joint)].size());
    }
    double radius_of(int joint) const
    {
        double most = 0.0;
        for (const int node : members_[idx(joint)])
            most = std::max(most, graph_.radius(node));
        return most;
    }
    /// The branching nearest to the middle; where there is none the thicker end.
    int root() const
    {
        Vector3d middle = Vector3d::Zero();
        double all = 0.0;
        for (const Branch& branch : branches_)
            for (std::size_t k = 1; k < branch.way.size(); ++k)
            {
                const Vector3d &a = graph_.place(branch.way[k - 1]),
                               &b = graph_.place(branch.way[k]);
                middle += (b - a).norm() * 0.5 * (a + b);
                all += (b - a).norm();
            }
        if (all > 0.0)
            middle /= all;
        int best = -1;
        double least = std::numeric_limits<double>::infinity();
        for (std::size_t j = 0; j < members_.size(); ++j)
        {
            if (members_[j].empty())
                continue;
            const bool branches = graph_.degree(members_[j].front()) > 2;
            const double rank = branches ? (place_of(int(j)) - middle).norm()
                                         : 1e300 / (1.0 + radius_of(int(j)));
            if (rank < least)
            {
                least = rank;
                best = static_cast<int>(j);
            }
        }
        return best;
    }

    /// The joints of a branch behind the joint \p parent of the tree; gives the last.
    int add_limb(std::size_t b, int from, int to, int parent, bool closes)
    {
        std::vector<int> way = branches_[b].way;
        if (joint_of_[idx(way.front())] != from)
            std::reverse(way.begin(), way.end());
        std::vector<Vector3d> line = graph_.plain_line(way, kPlacesOfLimb);
        if (graph_.degree(way.front()) == 1)
            out_[idx(parent)].at = line.front(); // the root is a tip
        else
            line.front() = place_of(from);
        if (graph_.degree(way.back()) > 2)
            line.back() = place_of(to);
        std::vector<double> of_way, radii;
        for (const int node : way)
            of_way.push_back(graph_.radius(node));
        // Places of the line are as evenly along it as nodes are along the way.
        for (std::size_t k = 0; k < line.size(); ++k)
            radii.push_back(of_way[k * (way.size() - 1) / (line.size() - 1)]);
        std::vector<double> inner(of_way.begin() + std::ptrdiff_t(way.size() / 4),
                                  of_way.end() - std::ptrdiff_t(way.size() / 4));
        std::nth_element(inner.begin(), inner.begin() + std::ptrdiff_t(inner.size() / 2),
                         inner.end());
        const double radius = inner[inner.size() / 2];
        std::vector<std::size_t> bends;
        find_bends(line, 0, line.size() - 1, options_.bend * radius, kShortest * radius,
                   bends);
        divide_long_pieces(line, radii, options_.bones, bends);
        if (!closes)
            bends.push_back(line.size() - 1);
        ++limbs_;
        for (const std::size_t k : bends)
        {
            // What would come to lie where its parent is adds nothing.
            if (line[k] == out_[idx(parent)].at)
                continue;
            const int near =
                way[std::min(way.size() - 1, k * (way.size() - 1) / (line.size() - 1))];
            out_.push_back({line[k], parent, limbs_, graph_.radius(near)});
            parent = static_cast<int>(out_.size()) - 1;
        }
        return parent;
    }

    const CurveGraph& graph_;
    const LimbOptions options_;
    std::vector<int> joint_of_; ///< of a node; -1: none
    /// Nodes of each joint; of one that was merged into another none.
    std::vector<std::vector<int>> members_;
    std::vector<Branch> branches_;
    std::vector<LimbJoint> out_;
    int limbs_ = 0;
};

/// Limbs are numbered anew, in the order in which they come; of one that goes into the
/// plane what is beside it is another.
void number_limbs(std::vector<LimbJoint>& joints)
{
    std::map<std::pair<int, bool>, int> numbers = {{{0, false}, 0}};
    for (LimbJoint& joint : joints)
        joint.limb = numbers
                         .emplace(std::pair(joint.limb, joint.side != 0),
                                  static_cast<int>(numbers.size()))
                         .first->second;
}

/// Symmetric about the plane that has the most joints beside it; of a shape without such
/// a plane the same.
std::vector<LimbJoint> symmetric(const Shape& shape, const CurveGraph& graph,
                                 std::vector<LimbJoint> joints)
{
    const double tolerance = kInPlane * box_around(shape.samples).diagonal().norm();
    const PointTree surface(graph.surface());
    // Images of joints in thin limbs may lie beside them a little.
    const auto has_place = [&](const Vector3d& x)
    {
        return graph.is_inside(x) ||
               surface.nearest(x).distance_squared <= tolerance * tolerance;
    };
    std::ptrdiff_t most = -1;
    std::vector<LimbJoint> best;
    for (const MirrorPlane& plane : mirror_planes(shape.samples))
    {
        std::vector<LimbJoint> one = mirrored_limbs(joints, plane, tolerance, has_place);
        const std::ptrdiff_t beside =
            std::count_if(one.begin(), one.end(),
                          [](const LimbJoint& joint) { return joint.side != 0; });
        if (one.size() > 1 && beside > most)
        {
            most = beside;
            best = std::move(one);
        }
    }
    if (most < 0)
        return joints;
    number_limbs(best);
    return best;
}

} // namespace

std::vector<LimbJoint> limb_tree(const Shape& shape, const LimbOptions& options)
{
    const CurveGraph graph(shape, kLimbs);
    if (graph.is_empty())
        return {};
    return symmetric(shape, graph, Tree(graph, options).grow());
}

} // namespace cellwarp::core
