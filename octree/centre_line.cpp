// SPDX-License-Identifier: GPL-3.0-or-later
// The curve skeleton of a surface has spurs, which end within the thickness of what they
// leave: they are cut off. What is left branches where limbs begin. The limb at a region
// is the way from the tip nearest to it inwards, through branchings inside the region
// (the fingers of a hand), to the first one outside. The flow cuts corners, and where a
// limb bends it even leaves it: each place of the way goes first to the middle of what
// came to it, then to that of the ring that the surface makes around it.
#include "octree/centre_line.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>

#include <Eigen/Geometry>

#include "octree/base/index.h"
#include "octree/base/point_tree.h"
#include "octree/wrap/skeleton.h"
#include "octree/wrap/wrap.h"

namespace cellwarp
{

namespace
{

/// Surfaces of more triangles are wrapped first: the flow's time grows faster than they
/// do, and a limb shows in a few thousand as well.
constexpr std::size_t kMostTriangles = 20000;

/// The ball of the wrap, and its distance [diagonal]; it rolls over what samples leave
/// open.
constexpr double kBall = 1.0 / 40.0, kOffset = 1.0 / 400.0, kSpacings = 3.0;

/// A spur is shorter than so many radii of where it leaves.
constexpr double kSpur = 2.0;

/// Places of the line, and rounds of smoothing.
constexpr int kPlaces = 97, kRounds = 40;

/// A ring is looked for in so many directions, and is one if most of them meet it.
constexpr int kDirections = 12, kLeastDirections = 9;

/// How far along and across, in radii; and how often the middle is looked for anew.
constexpr double kAlong = 0.6, kAcross = 2.5;
constexpr int kCentrings = 4;

/// How far towards the surface the tip goes.
constexpr double kToTip = 0.75;

struct Graph
{
    const CurveSkeleton& skeleton;
    std::vector<std::vector<int>> neighbours;
    std::vector<double> radius;
    std::vector<bool> is_gone;
    std::vector<std::vector<Eigen::Vector3d>> around_; ///< what came to each place

    Graph(const CurveSkeleton& of, const std::vector<Eigen::Vector3d>& surface)
        : skeleton(of), neighbours(of.points.size()), radius(of.points.size(), 0.0),
          is_gone(of.points.size(), false), around_(of.around)
    {
        for (const auto& [a, b] : of.edges)
        {
            neighbours[idx(a)].push_back(b);
            neighbours[idx(b)].push_back(a);
        }
        const PointTree tree(surface);
        for (std::size_t i = 0; i < of.points.size(); ++i)
            radius[i] = std::sqrt(tree.nearest(of.points[i]).distance_squared);
    }
    double length(int a, int b) const
    {
        return (skeleton.points[idx(a)] - skeleton.points[idx(b)]).norm();
    }
    std::vector<int> around(int node) const
    {
        std::vector<int> out;
        for (const int other : neighbours[idx(node)])
            if (!is_gone[idx(other)])
                out.push_back(other);
        return out;
    }
    int degree(int node) const { return static_cast<int>(around(node).size()); }
    std::vector<int> tips() const
    {
        std::vector<int> tips;
        for (std::size_t i = 0; i < is_gone.size(); ++i)
            if (!is_gone[i] && degree(int(i)) == 1)
                tips.push_back(int(i));
        return tips;
    }
    /// From a tip to the branching, or other tip, where its branch ends.
    std::vector<int> branch(int tip) const
    {
        std::vector<int> way = {tip};
        for (int before = -1;;)
        {
            int next = -1;
            for (const int other : around(way.back()))
                if (other != before)
                    next = other;
            if (next < 0 || way.size() > is_gone.size())
                return way;
            before = way.back();
            way.push_back(next);
            if (degree(next) != 2)
                return way;
        }
    }
    double length_of(const std::vector<int>& way) const
    {
        double sum = 0.0;
        for (std::size_t k = 1; k < way.size(); ++k)
            sum += length(way[k - 1], way[k]);
        return sum;
    }
    /// Cuts off branches that end within the thickness of what they leave, the shortest
    /// first and with it all such of the same place: of the four to the corners of a
    /// bar's end none is its axis. What came to them comes to that place.
    void cut_spurs()
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
                const std::vector<int> way = branch(tip);
                cut.insert(cut.end(), way.begin(), way.end() - 1);
            }
            for (const int node : cut)
            {
                is_gone[idx(node)] = true;
                around_[idx(place)].insert(around_[idx(place)].end(),
                                           around_[idx(node)].begin(),
                                           around_[idx(node)].end());
            }
            if (spurs.empty())
                return;
        }
    }
    /// How long a tip's branch is, of what makes it a spur, and where it leaves; infinite
    /// of one that leaves nothing.
    std::pair<double, int> spur_of(int tip) const
    {
        const std::vector<int> way = branch(tip);
        const int foot = way.back();
        if (degree(foot) < 3)
            return {INFINITY, -1};
        return {length_of(way) / (kSpur * std::max(radius[idx(foot)], 1e-300)), foot};
    }
    const std::vector<Eigen::Vector3d>& around_of(int node) const
    {
        return around_[idx(node)];
    }
    /// Of what came to a place of a way and its neighbours; a branching stays where it
    /// is.
    Eigen::Vector3d middle(const std::vector<int>& way, std::size_t k) const
    {
        const int node = way[k];
        if (degree(node) != 2)
            return skeleton.points[idx(node)];
        Eigen::Vector3d sum = Eigen::Vector3d::Zero();
        std::size_t count = 0;
        for (std::size_t other = k - 1; other <= k + 1; ++other)
            if (degree(way[other]) == 2)
                for (const Eigen::Vector3d& x : skeleton.around[idx(way[other])])
                {
                    sum += x;
                    ++count;
                }
        return count == 0 ? skeleton.points[idx(node)]
                          : Eigen::Vector3d(sum / static_cast<double>(count));
    }
    /// Shortest ways from a node: distance and the node before.
    std::pair<std::vector<double>, std::vector<int>> ways_from(int start) const
    {
        std::vector<double> away(is_gone.size(), std::numeric_limits<double>::infinity());
        std::vector<int> before(is_gone.size(), -1), open = {start};
        away[idx(start)] = 0.0;
        while (!open.empty())
        {
            const auto nearest = std::min_element(
                open.begin(), open.end(),
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
    int farthest_from(int start, std::vector<int>* way = nullptr) const
    {
        const auto [away, before] = ways_from(start);
        int best = start;
        for (std::size_t i = 0; i < away.size(); ++i)
            if (!is_gone[i] && std::isfinite(away[i]) && away[i] > away[idx(best)])
                best = int(i);
        if (way)
            for (int node = best; node >= 0; node = before[idx(node)])
                way->push_back(node);
        return best;
    }
};

/// From where the limb begins to its tip.
std::vector<int> limb_at(const Graph& graph, const std::vector<Eigen::Vector3d>& region)
{
    const PointTree tree(region);
    const auto away = [&](int node) {
        return std::sqrt(tree.nearest(graph.skeleton.points[idx(node)]).distance_squared);
    };
    int tip = -1;
    for (const int other : graph.tips())
        if (tip < 0 || away(other) < away(tip))
            tip = other;
    if (tip < 0)
        return {};
    // Inwards is the way to what lies farthest off.
    std::vector<int> way;
    graph.farthest_from(tip, &way);
    std::reverse(way.begin(), way.end()); // from the tip on
    std::size_t end = 1;
    while (end + 1 < way.size() && (graph.degree(way[end]) < 3 ||
                                    away(way[end]) <= 1.5 * graph.radius[idx(way[end])]))
        ++end;
    way.resize(std::min(end + 1, way.size()));
    std::reverse(way.begin(), way.end());
    return way;
}

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

/// On towards the surface around a tip, in the direction of the line there.
void extend_to_tip(const std::vector<Eigen::Vector3d>& around, double radius,
                   std::vector<Eigen::Vector3d>& line)
{
    const Eigen::Vector3d tip = line.back();
    std::size_t back = line.size() - 1;
    while (back > 0 && (line[back] - tip).norm() < 2.0 * radius)
        --back;
    const Eigen::Vector3d along = (tip - line[back]).stableNormalized();
    double most = 0.0;
    for (const Eigen::Vector3d& x : around)
        most = std::max(most, (x - tip).dot(along));
    if (most > 0.0)
        line.push_back(tip + kToTip * most * along);
}

Shape surface_of(const Shape& shape)
{
    if (shape.triangles.size() <= kMostTriangles && !shape.triangles.empty())
        return shape;
    Eigen::Vector3d low = shape.samples.front(), high = low;
    for (const Eigen::Vector3d& x : shape.samples)
    {
        low = low.cwiseMin(x);
        high = high.cwiseMax(x);
    }
    const double diagonal = (high - low).norm();
    const double ball =
        std::max(kBall * diagonal, kSpacings * point_spacing(shape.samples));
    return alpha_wrap(shape.samples, ball, std::max(kOffset * diagonal, 0.05 * ball));
}

} // namespace

CentreLine centre_line(const Shape& shape, const std::vector<std::uint32_t>& near)
{
    CentreLine line;
    if (shape.samples.size() < 4)
        return line;
    Shape surface = surface_of(shape);
    CurveSkeleton skeleton = curve_skeleton(surface);
    if (skeleton.edges.empty() && shape.triangles.size() <= kMostTriangles)
    {
        // It was not closed.
        Shape samples;
        samples.samples = shape.samples;
        surface = surface_of(samples);
        skeleton = curve_skeleton(surface);
    }
    if (skeleton.edges.empty())
        return line;
    Graph graph(skeleton, surface.samples);
    graph.cut_spurs();
    std::vector<int> way;
    if (near.empty())
    {
        const std::vector<int> tips = graph.tips();
        if (tips.empty())
            return line;
        graph.farthest_from(graph.farthest_from(tips.front()), &way);
    }
    else
    {
        std::vector<Eigen::Vector3d> region;
        for (const std::uint32_t i : near)
            region.push_back(shape.samples[i]);
        way = limb_at(graph, region);
    }
    if (way.size() < 2)
        return line;
    std::vector<Eigen::Vector3d> places;
    line.radius = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < way.size(); ++k)
    {
        places.push_back(graph.middle(way, k));
        if (k + 1 < way.size() && graph.radius[idx(way[k])] > 0.0)
            line.radius = std::min(line.radius, graph.radius[idx(way[k])]);
    }
    if (!std::isfinite(line.radius))
        line.radius = 0.0;
    if (graph.degree(way.back()) == 1)
        extend_to_tip(graph.around_of(way.back()), graph.radius[idx(way.back())], places);
    if (graph.degree(way.front()) == 1)
    {
        std::reverse(places.begin(), places.end());
        extend_to_tip(graph.around_of(way.front()), graph.radius[idx(way.front())],
                      places);
        std::reverse(places.begin(), places.end());
    }
    places = resampled(places, kPlaces);
    smooth(places, kRounds);
    centre(surface.samples, places);
    smooth(places, kRounds);
    line.places = resampled(places, kPlaces);
    return line;
}

} // namespace cellwarp
