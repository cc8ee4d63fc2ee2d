// SPDX-License-Identifier: GPL-3.0-or-later
// Triangles are sorted along a curve that fills space, four of them make a leaf, and a
// binary tree over the leaves holds their boxes. Going down both sides of the tree at
// once finds the pairs of leaves that meet, each once, with few boxes compared: of two
// boxes that do not meet nothing below is looked at. Boxes are of floats, rounded
// outward.
#include "octree/self_intersections.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>

#include <Eigen/Geometry>

#include "octree/base/index.h"
#include "octree/base/morton.h"
#include "octree/base/parallel.h"
#include "octree/bounding_surface.h"
#include "octree/wrap/triangle_pair.h"

namespace cellwarp
{

namespace
{

constexpr std::size_t kLeaf = 4;          ///< triangles
constexpr std::int64_t kMostTests = 1000; ///< of boxes, a triangle

/// The fourth lane is 0: four are compared at once.
struct FloatBox
{
    static constexpr float kFar = std::numeric_limits<float>::infinity();
    Eigen::Array4f low = {kFar, kFar, kFar, 0.0f};
    Eigen::Array4f high = -low;

    void include(const FloatBox& other)
    {
        low = low.min(other.low);
        high = high.max(other.high);
    }
    bool meets(const FloatBox& other) const
    {
        // The sign of a difference is exact, and four are found at once.
        return (other.high - low).min(high - other.low).minCoeff() >= 0.0f;
    }
};

float rounded_down(double x)
{
    const auto nearest = static_cast<float>(x);
    return nearest <= x ? nearest : std::nextafter(nearest, -INFINITY);
}

float rounded_up(double x)
{
    return -rounded_down(-x);
}

/// Boxes of the curve along each axis.
constexpr double kBoxes = 1024.0;

class PairCounter
{
public:
    PairCounter(std::span<const Triangle> triangles,
                const std::vector<Eigen::Vector3d>& places,
                const std::vector<Eigen::Vector3d>& rest)
        : triangles_(triangles), places_(places), rest_(rest),
          joined_(joined_samples(rest)), order_(triangles.size())
    {
        sort();
        build_tree();
    }

    std::optional<SelfIntersections> count()
    {
        const std::int64_t most =
            kMostTests * static_cast<std::int64_t>(triangles_.size()) + 1;
        std::atomic<std::int64_t> tests = 0, all = 0, fresh = 0;
        const std::vector<NodePair> tasks = pairs_of_nodes();
        parallel_for(tasks.size(),
                     [&](std::size_t k)
                     {
                         Tally tally{tests, most};
                         visit(tasks[k], tally);
                         tests += tally.tests;
                         all += tally.all;
                         fresh += tally.fresh;
                     });
        if (tests > most)
            return std::nullopt;
        return SelfIntersections{all, fresh};
    }

private:
    /// What one thread has counted.
    struct Tally
    {
        std::atomic<std::int64_t>& of_all; ///< tests, of all threads
        std::int64_t most;
        std::int64_t tests = 0, all = 0, fresh = 0;

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

    Eigen::Vector3d middle(const Triangle& t) const
    {
        return (places_[t[0]] + places_[t[1]] + places_[t[2]]) / 3.0;
    }

    void sort()
    {
        Eigen::AlignedBox3d box;
        for (const Triangle& t : triangles_)
            box.extend(middle(t));
        corner_ = box.min();
        const Eigen::Array3d size = box.sizes().array().max(1e-300);
        std::vector<std::uint64_t> keys(triangles_.size());
        constexpr std::size_t kTrianglesAtOnce = 4096; // of one thread
        parallel_for(triangles_.size(), kTrianglesAtOnce,
                     [&](std::size_t t)
                     {
                         const Eigen::Array3d share =
                             (middle(triangles_[t]) - corner_).array() / size;
                         const Eigen::Vector3i box_of_curve =
                             (kBoxes * share).max(0.0).min(kBoxes - 1).cast<int>();
                         keys[t] = morton(box_of_curve) << 32 | t;
                     });
        std::sort(keys.begin(), keys.end());
        for (std::size_t k = 0; k < keys.size(); ++k)
            order_[k] = static_cast<std::uint32_t>(keys[k]);
    }

    FloatBox box_of(std::uint32_t triangle) const
    {
        FloatBox box;
        for (const std::uint32_t corner : triangles_[triangle])
        {
            // What touches still touches: rounding keeps the order of numbers.
            const Eigen::Vector3d place = places_[corner] - corner_;
            for (int axis = 0; axis < 3; ++axis)
            {
                box.low[axis] = std::min(box.low[axis], rounded_down(place[axis]));
                box.high[axis] = std::max(box.high[axis], rounded_up(place[axis]));
            }
        }
        return box;
    }

    void build_tree()
    {
        boxes_.resize(order_.size());
        levels_.emplace_back((order_.size() + kLeaf - 1) / kLeaf);
        parallel_for(levels_[0].size(), kSmallBodies,
                     [&](std::size_t leaf)
                     {
                         for (std::size_t k = leaf * kLeaf; k < end_of(leaf); ++k)
                         {
                             boxes_[k] = box_of(order_[k]);
                             levels_[0][leaf].include(boxes_[k]);
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

    void visit(const NodePair& pair, Tally& tally) const
    {
        if (!do_meet(pair) || tally.is_over())
            return;
        if (pair.level == 0)
            return test_leaves(pair.a, pair.b, tally);
        for_pairs_below(pair, [&](const NodePair& next) { visit(next, tally); });
    }

    void test_leaves(std::size_t a, std::size_t b, Tally& tally) const
    {
        for (std::size_t i = a * kLeaf; i < end_of(a); ++i)
        {
            if (!boxes_[i].meets(levels_[0][b]))
                continue;
            const std::size_t first = a == b ? i + 1 : b * kLeaf;
            tally.tests += static_cast<std::int64_t>(end_of(b) - first);
            for (std::size_t j = first; j < end_of(b); ++j)
                if (boxes_[i].meets(boxes_[j]))
                    test_pair(triangles_[order_[i]], triangles_[order_[j]], tally);
        }
    }

    void test_pair(Triangle a, Triangle b, Tally& tally) const
    {
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
        tally.fresh += !meet(a, b, shared, rest_);
    }

    /// Whether a plane parts two triangles, but for the corners that they share, so
    /// clearly that no rounding counts: most neighbours, which exact numbers would take
    /// long to tell apart where the surface is flat.
    static bool surely_apart(const Triangle& a, const Triangle& b, int shared,
                             const std::vector<Eigen::Vector3d>& at)
    {
        constexpr double kSure = 1e-6; // far beyond rounding, relative
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
    std::vector<std::uint32_t> joined_; ///< of each sample the first at its place
    std::vector<std::uint32_t> order_;  ///< of the triangles
    Eigen::Vector3d corner_ = Eigen::Vector3d::Zero(); ///< near which boxes are counted
    std::vector<FloatBox> boxes_;                      ///< in that order, from corner_
    /// Of the leaves, of pairs of them, and so on up to one.
    std::vector<std::vector<FloatBox>> levels_;
};

} // namespace

std::optional<SelfIntersections>
self_intersections(std::span<const Triangle> triangles,
                   const std::vector<Eigen::Vector3d>& places,
                   const std::vector<Eigen::Vector3d>& rest)
{
    if (!can_tell_triangle_pairs())
        return std::nullopt;
    if (triangles.empty())
        return SelfIntersections{};
    return PairCounter(triangles, places, rest).count();
}

} // namespace cellwarp
