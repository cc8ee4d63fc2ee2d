// SPDX-License-Identifier: GPL-3.0-or-later
// Triangles are sorted along a curve that fills space, four of them make a leaf, and a
// binary tree over the leaves holds their boxes. Going down both sides of the tree at
// once finds the pairs of leaves that meet, each once, with few boxes compared: of two
// boxes that do not meet nothing below is looked at. Boxes are of floats, rounded
// outward.
//   Nearly all pairs whose boxes meet are neighbours, which share a corner. Around most
// corners the triangles, seen along the mean of their normals, fill every direction just
// once: then no two of them meet but in the corner and edges that they share, and that is
// found out once a corner, not once a pair.
#include "octree/self_intersections.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>

#include <Eigen/Geometry>

#include "octree/base/hash.h"
#include "octree/base/index.h"
#include "octree/base/morton.h"
#include "octree/base/parallel.h"
#include "octree/joined_samples.h"
#include "octree/wrap/triangle_pair.h"

namespace cellwarp
{

namespace
{

constexpr std::size_t kLeaf = 4; ///< triangles
constexpr std::uint32_t kNoTriangle = 0xffffffff;
constexpr std::int64_t kMostTests = 1000; ///< of boxes, a triangle

/// The signs of four numbers: of two in the highest bits of each half of a word.
std::array<std::uint64_t, 2> signs(const Eigen::Array4f& x)
{
    constexpr std::uint64_t kSigns = 0x8000000080000000;
    std::array<std::uint64_t, 2> words;
    std::memcpy(words.data(), x.data(), sizeof words);
    return {words[0] & kSigns, words[1] & kSigns};
}

/// The fourth lane is 0: four are compared at once.
struct FloatBox
{
    static constexpr float kFar = std::numeric_limits<float>::infinity();
    Eigen::Array4f low = {kFar, kFar, kFar, 0.0f};
    Eigen::Array4f high = {-kFar, -kFar, -kFar, 0.0f};

    void include(const FloatBox& other)
    {
        low = low.min(other.low);
        high = high.max(other.high);
    }
    bool meets(const FloatBox& other) const
    {
        // The sign of a difference is exact, and four are found at once.
        const Eigen::Array4f least = (other.high - low).min(high - other.low);
        return (signs(least)[0] | signs(least)[1]) == 0;
    }
};

/// No larger, by a rounding or two.
float rounded_down(double x)
{
    // A float's neighbours are less than this share of it away.
    constexpr float kNext = 1.2e-7f;
    const auto nearest = static_cast<float>(x);
    return nearest - (kNext * std::abs(nearest) + std::numeric_limits<float>::min());
}

float rounded_up(double x)
{
    return -rounded_down(-x);
}

/// The triangles of a leaf, side by side: their boxes, and of their corners those in
/// which neighbours meet and nowhere else (numbers above 0).
struct TriangleLeaf
{
    std::array<Eigen::Array4f, 3> low, high;
    std::array<std::array<std::uint32_t, kLeaf>, 3> corners;

    TriangleLeaf()
    {
        low.fill(Eigen::Array4f::Constant(FloatBox::kFar));
        high.fill(Eigen::Array4f::Constant(-FloatBox::kFar));
        corners.fill({});
    }
    void set(std::size_t k, const FloatBox& one,
             const std::array<std::uint32_t, 3>& of_corners)
    {
        const auto i = static_cast<Eigen::Index>(k);
        for (std::size_t axis = 0; axis < 3; ++axis)
        {
            low[axis][i] = one.low[static_cast<Eigen::Index>(axis)];
            high[axis][i] = one.high[static_cast<Eigen::Index>(axis)];
            corners[axis][k] = of_corners[axis];
        }
    }
    /// Bit k: the box of triangle k meets that from \p from to \p to.
    unsigned met(const std::array<float, 3>& from, const std::array<float, 3>& to) const
    {
        Eigen::Array4f least = Eigen::Array4f::Constant(FloatBox::kFar);
        for (std::size_t axis = 0; axis < 3; ++axis)
            least = least.min(to[axis] - low[axis]).min(high[axis] - from[axis]);
        const auto [first, second] = signs(least);
        const std::uint64_t apart = (first >> 31 & 1) | (first >> 62 & 2) |
                                    (second >> 29 & 4) | (second >> 60 & 8);
        return static_cast<unsigned>(~apart & 0xf);
    }
    /// Bit k: triangle k has such a corner in common with triangle \p l of a leaf.
    unsigned sharing(const TriangleLeaf& other, std::size_t l) const
    {
        std::array<std::uint32_t, kLeaf> any = {};
        for (const auto& theirs : other.corners)
            for (const auto& own : corners)
                for (std::size_t k = 0; k < kLeaf; ++k)
                    any[k] |= static_cast<std::uint32_t>(theirs[l] != 0) &
                              static_cast<std::uint32_t>(own[k] == theirs[l]);
        return any[0] | any[1] << 1 | any[2] << 2 | any[3] << 3;
    }
};

/// Far beyond rounding, relative.
constexpr double kSure = 1e-6;

/// Whether the triangles around a corner, seen along the mean of their normals, have
/// every direction once. Each is given by the two corners that follow this one in it.
bool is_fan(std::span<const std::array<std::uint32_t, 2>> around, std::size_t corner,
            const std::vector<Eigen::Vector3d>& places)
{
    const Eigen::Vector3d& at = places[corner];
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();
    std::uint64_t balance = 0; // of the edges that come in and go out: 0 where they close
    for (const auto& [p, q] : around)
    {
        normal += (places[p] - at).cross(places[q] - at);
        balance += hash_of(p) - hash_of(q);
    }
    if (balance != 0)
        return false;
    normal.normalize();
    const std::uint32_t first = around[0][0];
    const Eigen::Vector3d start = (places[first] - at).normalized();
    const double rise = normal.dot(start);
    // Whether an edge goes the way of the start as both are seen, not the opposite way.
    const auto goes_along = [&](const Eigen::Vector3d& edge)
    { return edge.dot(start) - normal.dot(edge) * rise > 0.0; };
    int count = 0; // of the triangles that have this direction
    for (const auto& [p, q] : around)
    {
        const Eigen::Vector3d a = places[p] - at, b = places[q] - at;
        const double size_a = a.norm(), size_b = b.norm();
        if (!(normal.dot(a.cross(b)) > kSure * size_a * size_b))
            return false;
        // Where the start is in this triangle, its edges included, that of its upper one.
        // An edge may point the opposite way, as in a regular grid, but not the same way.
        const double in_a = p == first ? 0.0 : normal.dot(a.cross(start));
        const double in_b = q == first ? 0.0 : normal.dot(start.cross(b));
        if ((p != first && std::abs(in_a) <= kSure * size_a && goes_along(a)) ||
            (q != first && std::abs(in_b) <= kSure * size_b && goes_along(b)))
            return false;
        count += in_a >= 0.0 && in_b > 0.0;
    }
    return count == 1;
}

/// The triangles along a curve that fills space, by where their middles are at rest: what
/// is near then mostly stays so.
std::vector<std::uint32_t> along_curve(std::span<const Triangle> triangles,
                                       const std::vector<Eigen::Vector3d>& rest)
{
    constexpr double kBoxes = 1024.0; // of the curve along each axis
    const auto middle = [&](const Triangle& t) -> Eigen::Vector3d
    { return (rest[t[0]] + rest[t[1]] + rest[t[2]]) / 3.0; };
    Eigen::AlignedBox3d box;
    for (const Triangle& t : triangles)
        box.extend(middle(t));
    const Eigen::Array3d size = box.sizes().array().max(1e-300);
    std::vector<std::uint64_t> keys(triangles.size());
    constexpr std::size_t kTrianglesAtOnce = 4096; // of one thread
    parallel_for(triangles.size(), kTrianglesAtOnce,
                 [&](std::size_t t)
                 {
                     const Eigen::Array3d share =
                         (middle(triangles[t]) - box.min()).array() / size;
                     const Eigen::Vector3i at =
                         (kBoxes * share).max(0.0).min(kBoxes - 1).cast<int>();
                     keys[t] = morton(at) << 32 | t;
                 });
    parallel_sort(keys);
    std::vector<std::uint32_t> order(keys.size());
    for (std::size_t k = 0; k < keys.size(); ++k)
        order[k] = static_cast<std::uint32_t>(keys[k]);
    return order;
}

} // namespace

/// One count: the boxes of the triangles where the samples are now, and of which corners
/// the triangles need not be compared.
class IntersectionCounter::Count
{
public:
    Count(const IntersectionCounter& of, const std::vector<Eigen::Vector3d>& places)
        : triangles_(of.triangles_), places_(places), rest_(of.rest_),
          joined_(of.joined_), order_(of.order_)
    {
        for (const Triangle& t : triangles_)
            corner_ = corner_.cwiseMin(places_[t[0]]);
        build_tree(simple_corners());
    }

    std::optional<SelfIntersections> operator()()
    {
        const std::int64_t most =
            kMostTests * static_cast<std::int64_t>(triangles_.size()) + 1;
        std::atomic<std::int64_t> tests = 0, all = 0, fresh = 0;
        std::atomic<std::uint32_t> first = kNoTriangle;
        const std::vector<NodePair> tasks = pairs_of_nodes();
        parallel_for(tasks.size(),
                     [&](std::size_t k)
                     {
                         Tally tally{tests, most};
                         visit(tasks[k], tally);
                         tests += tally.tests;
                         all += tally.all;
                         fresh += tally.fresh;
                         std::uint32_t known = first;
                         while (tally.first < known &&
                                !first.compare_exchange_weak(known, tally.first))
                         {
                         }
                     });
        if (tests > most)
            return std::nullopt;
        SelfIntersections found{all, fresh};
        if (first != kNoTriangle)
            found.first_fresh = first;
        return found;
    }

private:
    /// What one thread has counted.
    struct Tally
    {
        std::atomic<std::int64_t>& of_all; ///< tests, of all threads
        std::int64_t most;
        std::int64_t tests = 0, all = 0, fresh = 0;
        std::uint32_t first = kNoTriangle; ///< of a fresh pair

        /// Whether all threads together have tested too many.
        bool is_over()
        {
            constexpr std::int64_t kAtOnce = 1 << 16;
            if (tests > kAtOnce)
            {
                of_all += tests;
                tests = 0;
            }
            return of_all > most;
        }
    };

    /// Two nodes of a level, the first not behind the second.
    struct NodePair
    {
        std::size_t level, a, b;
    };

    bool do_meet(const NodePair& pair) const
    {
        return pair.a == pair.b ||
               levels_[pair.level][pair.a].meets(levels_[pair.level][pair.b]);
    }

    /// Calls take(pair) for the pairs of the nodes below.
    template <class Take>
    void for_pairs_below(const NodePair& pair, Take&& take) const
    {
        const std::size_t level = pair.level - 1;
        for (std::size_t a = 2 * pair.a; a < 2 * pair.a + 2; ++a)
            for (std::size_t b = std::max(a, 2 * pair.b); b < 2 * pair.b + 2; ++b)
                if (b < levels_[level].size())
                    take(NodePair{level, a, b});
    }

    /// Pairs that meet, of a level where there are enough of them for all threads.
    std::vector<NodePair> pairs_of_nodes() const
    {
        constexpr std::size_t kEnough = 512;
        std::vector<NodePair> pairs = {{levels_.size() - 1, 0, 0}};
        while (pairs.size() < kEnough && pairs.front().level > 0)
        {
            std::vector<NodePair> below;
            for (const NodePair& pair : pairs)
                for_pairs_below(pair,
                                [&](const NodePair& next)
                                {
                                    if (do_meet(next))
                                        below.push_back(next);
                                });
            pairs = std::move(below);
        }
        return pairs;
    }

    /// Of each corner whether its triangles meet in nothing but what they share, for
    /// sure. Those of a boundary are not looked at.
    std::vector<char> simple_corners() const
    {
        // Of each corner the passes by it: the corner before and the one after.
        std::vector<std::uint32_t> end(places_.size() + 1, 0);
        for (const Triangle& t : triangles_)
            for (const std::uint32_t corner : t)
                ++end[joined_[corner] + 1];
        std::partial_sum(end.begin(), end.end(), end.begin());
        std::vector<std::array<std::uint32_t, 2>> passes(end.back());
        for (const Triangle& t : triangles_)
            for (std::size_t k = 0; k < 3; ++k)
                passes[end[joined_[t[k]]]++] = {joined_[t[(k + 1) % 3]],
                                                joined_[t[(k + 2) % 3]]};
        // Corners whose samples no longer are at one place.
        std::vector<char> is_parted(places_.size(), 0);
        for (std::size_t i = 0; i < places_.size(); ++i)
            if (places_[i] != places_[joined_[i]])
                is_parted[joined_[i]] = 1;
        std::vector<char> is_simple(places_.size(), 0);
        parallel_for(places_.size(), kSmallBodies,
                     [&](std::size_t corner)
                     {
                         const std::size_t begin = corner == 0 ? 0 : end[corner - 1];
                         const std::span<const std::array<std::uint32_t, 2>> around =
                             std::span(passes).subspan(begin, end[corner] - begin);
                         is_simple[corner] = !around.empty() && !is_parted[corner] &&
                                             std::none_of(around.begin(), around.end(),
                                                          [&](const auto& pass) {
                                                              return is_parted[pass[0]] ||
                                                                     is_parted[pass[1]];
                                                          }) &&
                                             is_fan(around, corner, places_);
                     });
        return is_simple;
    }

    FloatBox box_of(std::uint32_t triangle) const
    {
        // What touches still touches: rounding keeps the order of numbers.
        const auto& [a, b, c] = triangles_[triangle];
        const Eigen::Vector3d low =
            places_[a].cwiseMin(places_[b]).cwiseMin(places_[c]) - corner_;
        const Eigen::Vector3d high =
            places_[a].cwiseMax(places_[b]).cwiseMax(places_[c]) - corner_;
        FloatBox box;
        for (int axis = 0; axis < 3; ++axis)
        {
            box.low[axis] = rounded_down(low[axis]);
            box.high[axis] = rounded_up(high[axis]);
        }
        return box;
    }

    void build_tree(const std::vector<char>& is_simple)
    {
        const auto number_of = [&](std::uint32_t corner)
        { return is_simple[joined_[corner]] ? joined_[corner] + 1 : 0; };
        leaves_.resize((order_.size() + kLeaf - 1) / kLeaf);
        levels_.emplace_back(leaves_.size());
        parallel_for(leaves_.size(), kSmallBodies,
                     [&](std::size_t leaf)
                     {
                         for (std::size_t k = leaf * kLeaf; k < end_of(leaf); ++k)
                         {
                             const FloatBox box = box_of(order_[k]);
                             const auto& [x, y, z] = triangles_[order_[k]];
                             leaves_[leaf].set(
                                 k % kLeaf, box,
                                 {number_of(x), number_of(y), number_of(z)});
                             levels_[0][leaf].include(box);
                         }
                     });
        while (levels_.back().size() > 1)
        {
            const std::vector<FloatBox>& below = levels_.back();
            std::vector<FloatBox> level((below.size() + 1) / 2);
            for (std::size_t i = 0; i < below.size(); ++i)
                level[i / 2].include(below[i]);
            levels_.push_back(std::move(level));
        }
    }

    std::size_t end_of(std::size_t leaf) const
    {
        return std::min(order_.size(), (leaf + 1) * kLeaf);
    }

    /// Of two nodes that meet.
    void visit(const NodePair& pair, Tally& tally) const
    {
        if (pair.level == 0)
            return test_leaves(pair.a, pair.b, tally);
        for_pairs_below(pair,
                        [&](const NodePair& next)
                        {
                            if (do_meet(next))
                                visit(next, tally);
                        });
    }

    void test_leaves(std::size_t a, std::size_t b, Tally& tally) const
    {
        if (tally.is_over())
            return;
        const TriangleLeaf &one = leaves_[a], &other = leaves_[b];
        const FloatBox& box = levels_[0][b];
        unsigned of_one = one.met({box.low[0], box.low[1], box.low[2]},
                                  {box.high[0], box.high[1], box.high[2]});
        for (; of_one != 0; of_one &= of_one - 1)
        {
            const auto i = static_cast<std::size_t>(std::countr_zero(of_one));
            const auto lane = static_cast<Eigen::Index>(i);
            tally.tests += static_cast<std::int64_t>(kLeaf);
            unsigned met =
                other.met({one.low[0][lane], one.low[1][lane], one.low[2][lane]},
                          {one.high[0][lane], one.high[1][lane], one.high[2][lane]});
            if (a == b)
                met &= 0xeu << i; // each pair once
            if (met != 0)
                met &= ~other.sharing(one, i);
            for (; met != 0; met &= met - 1)
                test_pair(
                    order_[a * kLeaf + i],
                    order_[b * kLeaf + static_cast<std::size_t>(std::countr_zero(met))],
                    tally);
        }
    }

    void test_pair(std::uint32_t one, std::uint32_t other, Tally& tally) const
    {
        Triangle a = triangles_[one], b = triangles_[other];
        int shared = 0;
        for (std::size_t i = 0; i < 3; ++i)
            for (std::size_t j = idx(shared); j < 3; ++j)
                if (joined_[a[i]] == joined_[b[j]])
                {
                    std::swap(a[i], a[idx(shared)]);
                    std::swap(b[j], b[idx(shared)]);
                    ++shared;
                    break;
                }
        if (surely_apart(a, b, shared, places_) || !meet(a, b, shared, places_))
            return;
        ++tally.all;
        if (meet(a, b, shared, rest_))
            return;
        ++tally.fresh;
        tally.first = std::min({tally.first, one, other});
    }

    /// Whether a plane parts two triangles, but for the corners that they share, so
    /// clearly that no rounding counts: most neighbours, which exact numbers would take
    /// long to tell apart where the surface is flat.
    static bool surely_apart(const Triangle& a, const Triangle& b, int shared,
                             const std::vector<Eigen::Vector3d>& at)
    {
        if (shared == 2)
        {
            const Eigen::Vector3d edge = at[a[1]] - at[a[0]];
            const Eigen::Vector3d s = edge.cross(at[a[2]] - at[a[0]]).cross(edge);
            const Eigen::Vector3d t = edge.cross(at[b[2]] - at[a[0]]).cross(edge);
            return s.dot(t) < -kSure * s.norm() * t.norm();
        }
        if (shared == 1)
        {
            // Through the corner, between the middles of their angles.
            const Eigen::Vector3d a1 = (at[a[1]] - at[a[0]]).normalized(),
                                  a2 = (at[a[2]] - at[a[0]]).normalized(),
                                  b1 = (at[b[1]] - at[a[0]]).normalized(),
                                  b2 = (at[b[2]] - at[a[0]]).normalized();
            const Eigen::Vector3d across = a1 + a2 - b1 - b2;
            return across.dot(a1) > kSure && across.dot(a2) > kSure &&
                   across.dot(b1) < -kSure && across.dot(b2) < -kSure;
        }
        if (shared > 2)
            return false;
        const Eigen::Vector3d middle = (at[b[0]] + at[b[1]] + at[b[2]]) / 3.0;
        const Eigen::Vector3d across = (at[a[0]] + at[a[1]] + at[a[2]]) / 3.0 - middle;
        double low = INFINITY, high = -INFINITY, size = 0.0;
        for (std::size_t k = 0; k < 3; ++k)
        {
            const double in_a = across.dot(at[a[k]] - middle);
            const double in_b = across.dot(at[b[k]] - middle);
            low = std::min(low, in_a);
            high = std::max(high, in_b);
            size = std::max({size, std::abs(in_a), std::abs(in_b)});
        }
        return low - high > kSure * size;
    }

    static bool meet(const Triangle& a, const Triangle& b, int shared,
                     const std::vector<Eigen::Vector3d>& at)
    {
        return triangles_meet({at[a[0]], at[a[1]], at[a[2]]},
                              {at[b[0]], at[b[1]], at[b[2]]}, shared);
    }

    std::span<const Triangle> triangles_;
    const std::vector<Eigen::Vector3d>& places_;
    const std::vector<Eigen::Vector3d>& rest_;
    const std::vector<std::uint32_t>& joined_;
    const std::vector<std::uint32_t>& order_;
    /// Near which boxes are counted.
    Eigen::Vector3d corner_ = Eigen::Vector3d::Constant(INFINITY);
    std::vector<TriangleLeaf> leaves_; ///< in that order, from corner_
    /// Of the leaves, of pairs of them, and so on up to one.
    std::vector<std::vector<FloatBox>> levels_;
};

IntersectionCounter::IntersectionCounter(std::span<const Triangle> triangles,
                                         const std::vector<Eigen::Vector3d>& rest)
    : triangles_(triangles), rest_(rest)
{
    if (!can_tell_triangle_pairs() || triangles.empty())
        return;
    joined_ = joined_samples(rest);
    order_ = along_curve(triangles, rest);
}

std::optional<SelfIntersections>
IntersectionCounter::count(const std::vector<Eigen::Vector3d>& places) const
{
    assert(places.size() == rest_.size());
    if (!can_tell_triangle_pairs())
        return std::nullopt;
    if (triangles_.empty())
        return SelfIntersections{};
    return Count(*this, places)();
}

} // namespace cellwarp
