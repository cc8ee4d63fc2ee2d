// SPDX-License-Identifier: GPL-3.0-or-later
// The curve skeleton of a surface has spurs, which end within the thickness of what they
// leave: they are cut off. What is left branches where limbs begin. The flow that makes
// it cuts corners, and where a limb bends it even leaves it: each place of a line goes
// first to the middle of what came to it, then to that of the ring that the surface makes
// around it.
#include "octree/curve_graph.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>

#include <Eigen/Geometry>

#include "octree/base/bounding_box.h"
#include "octree/base/index.h"
#include "octree/base/point_tree.h"
#include "octree/closed_surface.h"
#include "octree/winding.h"

namespace cellwarp::core
{

namespace
{

/// A tip whose radius is a smaller share of that where its branch leaves is pointed: of
/// branches to the corners of boxes it is at most 0.41, of ears and fingers 0.44 or more.
constexpr double kPointed = 0.43;

/// A surface stands for the shape if the box of the part that has lines holds such a
/// share of its samples; what lies farther off than this from the box is outside
/// [diagonal].
constexpr double kMostOfShape = 0.95, kOutside = 0.01;

/// Rounds of smoothing.
constexpr int kRounds = 40, kFewRounds = 3;

/// A ring is looked for in so many directions, and is one if most of them meet it.
constexpr int kDirections = 12, kLeastDirections = 9;

/// How far along and across, in radii; and how often the middle is looked for anew.
constexpr double kAlong = 0.6, kAcross = 2.5;
constexpr int kCentrings = 4;

/// Where so many points of the surface came to places of a line, they lie on all sides.
constexpr std::size_t kLeastAround = 48;

/// How far towards the surface the tip goes.
constexpr double kToTip = 0.75;

/// What reaches as far as this share of what reaches farthest is the end of a limb.
constexpr double kEndOfLimb = 0.7;

/// Where it leads out of the limb it goes half as far, so often at the most.
constexpr int kHalvings = 3;

void smooth(std::vector<Eigen::Vector3d>& places, int rounds)
{
    for (int round = 0; round < rounds; ++round)
    {
        std::vector<Eigen::Vector3d> next = places;
        for (std::size_t k = 1; k + 1 < places.size(); ++k)
            next[k] = 0.5 * places[k] + 0.25 * (places[k - 1] + places[k + 1]);
        places = std::move(next);
    }
}

/// The middle of the ring of surface around a line's place; the place where there is
/// none. \p r: the distance of the surface.
Eigen::Vector3d middle_of_ring(const std::vector<Eigen::Vector3d>& surface,
                               const Eigen::Vector3d& place, const Eigen::Vector3d& along,
                               double r)
{
    const Eigen::Vector3d one = along.unitOrthogonal(), other = along.cross(one);
    std::array<double, kDirections> least;
    least.fill(kAcross * r);
    std::array<Eigen::Vector3d, kDirections> nearest;
    for (const Eigen::Vector3d& x : surface)
    {
        const Eigen::Vector3d off = x - place;
        if (std::abs(off.dot(along)) > kAlong * r || off.squaredNorm() > 9.0 * r * r)
            continue;
        const double u = off.dot(one), v = off.dot(other), away = std::hypot(u, v);
        const double turn = std::atan2(v, u) / (2.0 * std::numbers::pi) + 0.5;
        const std::size_t k =
            std::min(idx(static_cast<int>(turn * kDirections)), least.size() - 1);
        if (away < least[k])
        {
            least[k] = away;
            nearest[k] = u * one + v * other;
        }
    }
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    int count = 0;
    for (std::size_t k = 0; k < least.size(); ++k)
        if (least[k] < kAcross * r)
        {
            sum += nearest[k];
            ++count;
        }
    return count < kLeastDirections ? place
                                    : Eigen::Vector3d(place + sum / double(count));
}

/// All but the ends to the middle of what is around them.
void centre(const std::vector<Eigen::Vector3d>& surface,
            std::vector<Eigen::Vector3d>& places)
{
    const PointTree tree(surface);
    for (int round = 0; round < kCentrings; ++round)
    {
        const std::vector<Eigen::Vector3d> before = places;
        for (std::size_t k = 1; k + 1 < places.size(); ++k)
        {
            const Eigen::Vector3d along =
                (before[k + 1] - before[k - 1]).stableNormalized();
            const double r = std::sqrt(tree.nearest(before[k]).distance_squared);
            if (r > 0.0 && along.norm() > 0.5)
                places[k] = middle_of_ring(surface, before[k], along, r);
        }
        smooth(places, 2);
    }
}

std::vector<Eigen::Vector3d> resampled(const std::vector<Eigen::Vector3d>& line,
                                       int count)
{
    std::vector<double> at = {0.0};
    for (std::size_t k = 1; k < line.size(); ++k)
        at.push_back(at.back() + (line[k] - line[k - 1]).norm());
    std::vector<Eigen::Vector3d> out;
    std::size_t k = 0;
    for (int i = 0; i < count; ++i)
    {
        const double s = at.back() * i / (count - 1);
        while (k + 2 < line.size() && at[k + 1] < s)
            ++k;
        const double gap = at[k + 1] - at[k];
        const double t = gap > 0 ? std::clamp((s - at[k]) / gap, 0.0, 1.0) : 0.0;
        out.push_back(line[k] + t * (line[k + 1] - line[k]));
    }
    return out;
}

/// The flow shortens limbs as well as it thins them, so the middles of what came to the
/// places next to a tip may lie beyond the tip. Without those places the line does not
/// fold back.
void unfold_end(std::vector<Eigen::Vector3d>& line)
{
    for (std::size_t last = line.size() - 1;
         last >= 2 &&
         (line[last] - line[last - 1]).dot(line[last - 1] - line[last - 2]) < 0.0;
         --last)
        line.erase(line.end() - 2);
}

/// Of a surface of either orientation.
bool is_within(const Shape& surface, const Eigen::Vector3d& x)
{
    return std::abs(winding_number(surface, surface.triangles, x)) > 0.5;
}

/// From a tip to the middle of what reaches farthest from it along a direction, \p most.
/// \pre most > 0
Eigen::Vector3d to_farthest(const std::vector<Eigen::Vector3d>& around,
                            const Eigen::Vector3d& tip, const Eigen::Vector3d& along,
                            double most)
{
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double total = 0.0;
    for (const Eigen::Vector3d& x : around)
        if (const double beyond = (x - tip).dot(along) - kEndOfLimb * most; beyond > 0.0)
        {
            sum += beyond * (x - tip);
            total += beyond;
        }
    return sum / total;
}

/// On towards the surface around a tip, in the direction of the line there. Where the
/// limb bends and that leads out of it, to where it ends.
void extend_to_tip(const Shape& surface, const std::vector<Eigen::Vector3d>& around,
                   double radius, std::vector<Eigen::Vector3d>& line)
{
    const Eigen::Vector3d tip = line.back();
    std::size_t back = line.size() - 1;
    while (back > 0 && (line[back] - tip).norm() < 2.0 * radius)
        --back;
    const Eigen::Vector3d along = (tip - line[back]).stableNormalized();
    double most = 0.0;
    for (const Eigen::Vector3d& x : around)
        most = std::max(most, (x - tip).dot(along));
    if (!(most > 0.0))
        return;
    Eigen::Vector3d on = kToTip * most * along;
    // Of a tip that is outside itself (a thin limb) nothing can be told.
    if (is_within(surface, tip) && !is_within(surface, tip + on))
    {
        on = kToTip * to_farthest(around, tip, along, most);
        int half = 0;
        while (!is_within(surface, tip + on))
        {
            if (++half > kHalvings)
                return;
            on *= 0.5;
        }
    }
    line.push_back(tip + on);
}

/// The share of samples that the box of what a skeleton was made of holds.
double share_of_shape(const std::vector<Eigen::Vector3d>& samples,
                      const CurveSkeleton& skeleton)
{
    Eigen::AlignedBox3d part;
    for (const std::vector<Eigen::Vector3d>& around : skeleton.around)
        part.extend(box_around(around));
    if (part.isEmpty())
        return 0.0;
    const double beyond = kOutside * box_around(samples).diagonal().norm();
    const auto held =
        std::count_if(samples.begin(), samples.end(),
                      [&](const Eigen::Vector3d& x)
                      { return part.squaredExteriorDistance(x) <= beyond * beyond; });
    return static_cast<double>(held) / static_cast<double>(samples.size());
}

/// The middle of a box that is far away, of its size: the flow does not end there, digits
/// of its differences are lost. Else zero.
Eigen::Vector3d far_middle(const std::vector<Eigen::Vector3d>& samples)
{
    constexpr double kFar = 100.0; // [diagonal]
    const Eigen::AlignedBox3d box = box_around(samples);
    const Eigen::Vector3d middle = box.center();
    return middle.norm() > kFar * box.diagonal().norm() ? middle
                                                        : Eigen::Vector3d::Zero();
}

} // namespace

CurveGraph::CurveGraph(const Shape& shape, const CurveOptions& options)
    : options_(options)
{
    if (shape.samples.size() < 4)
        return;
    const Eigen::Vector3d away = far_middle(shape.samples);
    if (away.isZero(0))
    {
        find(shape);
        return;
    }
    Shape near = shape;
    for (Eigen::Vector3d& x : near.samples)
        x -= away;
    find(near);
    for (Eigen::Vector3d& x : surface_.samples)
        x += away;
    for (Eigen::Vector3d& x : skeleton_.points)
        x += away;
    for (std::vector<std::vector<Eigen::Vector3d>>* const all :
         {&skeleton_.around, &around_})
        for (std::vector<Eigen::Vector3d>& around : *all)
            for (Eigen::Vector3d& x : around)
                x += away;
}

void CurveGraph::find(const Shape& shape)
{
    double most = 0.0;
    for (const auto& way : closed_surfaces(shape, options_.most_triangles))
    {
        Shape surface = way();
        CurveSkeleton skeleton = curve_skeleton(surface);
        const double share =
            skeleton.edges.empty() ? 0.0 : share_of_shape(shape.samples, skeleton);
        if (share > most)
        {
            most = share;
            surface_ = std::move(surface);
            skeleton_ = std::move(skeleton);
        }
        if (most >= kMostOfShape)
            break;
    }
    if (is_empty())
        return;
    neighbours_.resize(skeleton_.points.size());
    is_gone_.resize(skeleton_.points.size(), false);
    around_ = skeleton_.around;
    for (const auto& [a, b] : skeleton_.edges)
    {
        neighbours_[idx(a)].push_back(b);
        neighbours_[idx(b)].push_back(a);
    }
    const PointTree tree(surface_.samples);
    for (const Eigen::Vector3d& x : skeleton_.points)
        radius_.push_back(std::sqrt(tree.nearest(x).distance_squared));
    cut_spurs();
}

bool CurveGraph::is_inside(const Eigen::Vector3d& x) const
{
    return is_within(surface_, x);
}

double CurveGraph::length(int a, int b) const
{
    return (skeleton_.points[idx(a)] - skeleton_.points[idx(b)]).norm();
}

std::vector<int> CurveGraph::around(int node) const
{
    std::vector<int> out;
    for (const int other : neighbours_[idx(node)])
        if (!is_gone_[idx(other)])
            out.push_back(other);
    return out;
}

int CurveGraph::degree(int node) const
{
    return static_cast<int>(around(node).size());
}

std::vector<int> CurveGraph::tips() const
{
    std::vector<int> tips;
    for (std::size_t i = 0; i < is_gone_.size(); ++i)
        if (!is_gone_[i] && degree(int(i)) == 1)
            tips.push_back(int(i));
    return tips;
}

std::vector<int> CurveGraph::branch(int node, int next) const
{
    std::vector<int> way = {node, next};
    while (degree(way.back()) == 2 && way.back() != node)
    {
        const std::vector<int> both = around(way.back());
        way.push_back(both[0] == way[way.size() - 2] ? both[1] : both[0]);
    }
    return way;
}

double CurveGraph::length_of(const std::vector<int>& way) const
{
    double sum = 0.0;
    for (std::size_t k = 1; k < way.size(); ++k)
        sum += length(way[k - 1], way[k]);
    return sum;
}

/// Cuts off branches that end within the thickness of what they leave, the shortest first
/// and with it all such of the same place: of the four to the corners of a bar's end none
/// is its axis. What came to them comes to that place.
void CurveGraph::cut_spurs()
{
    for (;;)
    {
        int place = -1;
        double least = 1.0;
        for (const int tip : tips())
            if (const auto [share, foot] = spur_of(tip); share < least)
            {
                least = share;
                place = foot;
            }
        if (place < 0)
            return;
        std::vector<std::pair<double, int>> spurs; // length, tip
        for (const int tip : tips())
            if (const auto [share, foot] = spur_of(tip); foot == place && share < 1.0)
                spurs.emplace_back(share, tip);
        std::sort(spurs.begin(), spurs.end());
        // Where there is nothing else the longest two are the line.
        const int others = degree(place) - static_cast<int>(spurs.size());
        if (others == 0)
            spurs.resize(spurs.size() - std::min<std::size_t>(2, spurs.size()));
        std::vector<int> cut; // before any is gone: then the place is none any more
        for (const auto& [share, tip] : spurs)
        {
            const std::vector<int> way = branch(tip, around(tip).front());
            cut.insert(cut.end(), way.begin(), way.end() - 1);
        }
        for (const int node : cut)
        {
            is_gone_[idx(node)] = true;
            around_[idx(place)].insert(around_[idx(place)].end(),
                                       around_[idx(node)].begin(),
                                       around_[idx(node)].end());
        }
        if (spurs.empty())
            return;
    }
}

/// How long a tip's branch is, of what makes it a spur, and where it leaves; infinite of
/// one that leaves nothing.
std::pair<double, int> CurveGraph::spur_of(int tip) const
{
    const std::vector<int> way = branch(tip, around(tip).front());
    const int foot = way.back();
    if (degree(foot) < 3)
        return {INFINITY, -1};
    const double r = std::max(radius(foot), 1e-300);
    const double spur =
        radius(tip) < kPointed * r ? options_.pointed_spur : options_.blunt_spur;
    return {length_of(way) / (spur * r), foot};
}

/// Of what came to a place of a way and to its neighbours; to more of them where that is
/// little, as on a coarse surface: few points lie to one side. A branching stays where it
/// is.
Eigen::Vector3d CurveGraph::middle(const std::vector<int>& way, std::size_t k) const
{
    const int node = way[k];
    if (degree(node) != 2 || k == 0 || k + 1 == way.size())
        return skeleton_.points[idx(node)];
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    std::size_t count = 0;
    const auto add = [&](std::size_t other)
    {
        if (degree(way[other]) != 2)
            return;
        for (const Eigen::Vector3d& x : skeleton_.around[idx(way[other])])
        {
            sum += x;
            ++count;
        }
    };
    add(k);
    for (std::size_t off = 1;
         off <= k && k + off < way.size() && (off == 1 || count < kLeastAround); ++off)
    {
        add(k - off);
        add(k + off);
    }
    return count == 0 ? skeleton_.points[idx(node)]
                      : Eigen::Vector3d(sum / static_cast<double>(count));
}

/// Shortest ways from a node: distance and the node before.
std::pair<std::vector<double>, std::vector<int>> CurveGraph::ways_from(int start) const
{
    std::vector<double> away(is_gone_.size(), std::numeric_limits<double>::infinity());
    std::vector<int> before(is_gone_.size(), -1), open = {start};
    away[idx(start)] = 0.0;
    while (!open.empty())
    {
        const auto nearest =
            std::min_element(open.begin(), open.end(),
                             [&](int a, int b) { return away[idx(a)] < away[idx(b)]; });
        const int node = *nearest;
        open.erase(nearest);
        for (const int other : around(node))
            if (const double d = away[idx(node)] + length(node, other);
                d < away[idx(other)])
            {
                away[idx(other)] = d;
                before[idx(other)] = node;
                if (std::find(open.begin(), open.end(), other) == open.end())
                    open.push_back(other);
            }
    }
    return {away, before};
}

int CurveGraph::farthest_from(int start, std::vector<int>* way) const
{
    const auto [away, before] = ways_from(start);
    int best = start;
    for (std::size_t i = 0; i < away.size(); ++i)
        if (!is_gone_[i] && std::isfinite(away[i]) && away[i] > away[idx(best)])
            best = int(i);
    if (way)
        for (int node = best; node >= 0; node = before[idx(node)])
            way->push_back(node);
    return best;
}

double CurveGraph::least_radius(const std::vector<int>& way) const
{
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k + 1 < way.size(); ++k)
        if (radius(way[k]) > 0.0)
            least = std::min(least, radius(way[k]));
    return std::isfinite(least) ? least : 0.0;
}

/// At tips.
void CurveGraph::extend(const std::vector<int>& way,
                        std::vector<Eigen::Vector3d>& places) const
{
    for (const int end : {way.back(), way.front()})
    {
        if (degree(end) == 1)
            extend_to_tip(surface_, around_[idx(end)], radius(end), places);
        std::reverse(places.begin(), places.end());
    }
}

std::vector<Eigen::Vector3d> CurveGraph::plain_line(const std::vector<int>& way,
                                                    int count) const
{
    std::vector<Eigen::Vector3d> places;
    for (const int node : way)
        places.push_back(place(node));
    smooth(places, kFewRounds);
    extend(way, places);
    return resampled(places, count);
}

std::vector<Eigen::Vector3d> CurveGraph::line(const std::vector<int>& way,
                                              int count) const
{
    std::vector<Eigen::Vector3d> places;
    for (std::size_t k = 0; k < way.size(); ++k)
        places.push_back(middle(way, k));
    for (const int end : {way.back(), way.front()})
    {
        if (degree(end) == 1)
            unfold_end(places);
        std::reverse(places.begin(), places.end());
    }
    extend(way, places);
    places = resampled(places, count);
    smooth(places, kRounds);
    centre(surface_.samples, places);
    smooth(places, kRounds);
    return resampled(places, count);
}

} // namespace cellwarp::core
