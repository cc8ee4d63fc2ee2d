// SPDX-License-Identifier: GPL-3.0-or-later
// Triangles are sorted along a curve that fills space; patches of them, small and large,
// have boxes. Going down both sides of the tree of patches at once finds those that may
// meet: of two whose boxes do not meet nothing below is looked at, and nothing of a
// patch, or of two, that is seen whole from some direction (surface_patches.h), as most
// are but for folds and what has come near. Boxes are of floats, rounded outward.
//   What is left is pairs of small patches, whose triangles are compared. Nearly all
//   pairs
// of them whose boxes meet are neighbours, which share a corner. Around most corners the
// triangles, seen along the mean of their normals, fill every direction just once: then
// no two of them meet but in the corner and edges that they share, and that is found out
// once a corner, not once a pair.
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
#include "octree/surface_patches.h"
#include "octree/wrap/triangle_pair.h"

namespace cellwarp::core
{

namespace
{

constexpr std::size_t kLeaf = 4;                                   ///< triangles
constexpr std::size_t kLeaves = SurfacePatches::kSmallest / kLeaf; ///< of a patch
constexpr std::uint32_t kNoTriangle = 0xffffffff;
constexpr std::int64_t kMostTests = 1000; ///< of boxes, a triangle
constexpr std::size_t kMostPairs = 256;   ///< that may meet, a patch

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

/// For the triangles a number each, in its upper half the place of its middle at rest
/// along a curve that fills space: what is near then mostly stays so. Sorted.
std::vector<std::uint64_t> along_curve(std::span<const Triangle> triangles,
                                       const std::vector<Eigen::Vector3d>& rest)
{
    constexpr double kBoxes = 1024.0; // of the curve along each axis
    const auto middle = [&](const Triangle& t) -> Eigen::Vector3d
    { return (rest[t[0]] + rest[t[1]] + rest[t[2]]) / 3.0; };
    Eigen::AlignedBox3d box;
    for (const Triangle& t : triangles)
        box.extend(middle(t));
    const double size = std::max(1e-300, box.sizes().maxCoeff());
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
    return keys;
}

/// How far the numbers of along_curve() are shifted down to be those of blocks of space
/// that some thousand triangles lie in. From one to another the curve may go far.
int bits_of_block(std::size_t num_triangles)
{
    constexpr std::size_t kInBlock = 4096;
    int bits = 32 + 30;
    for (std::size_t blocks = num_triangles / kInBlock; blocks >= 4; blocks /= 4)
        bits -= 3;
    return bits;
}

} // namespace

/// One count: the boxes of the patches where the samples are now, and from where they can
/// be seen; of the patches that are looked at their triangles.
class IntersectionCounter::Count
{
public:
    Count(const IntersectionCounter& of, const std::vector<Eigen::Vector3d>& places)
        : triangles_(of.triangles_), places_(places), rest_(of.rest_),
          joined_(of.joined_), order_(of.order_), patches_(*of.patches_)
    {
        for (const Triangle& t : triangles_)
            corner_ = corner_.cwiseMin(places_[t[0]]);
        find_smallest();
        while (levels_.size() < patches_.num_levels())
            add_level();
    }

    std::optional<SelfIntersections> operator()()
    {
        const std::int64_t most =
            kMostTests * static_cast<std::int64_t>(triangles_.size()) + 1;
        const std::vector<PatchPair> pairs = near_pairs();
        if (pairs.size() > kMostPairs * levels_[0].boxes.size())
            return std::nullopt;
        find_leaves(pairs);
        std::atomic<std::int64_t> tests = 0, all = 0, fresh = 0;
        std::atomic<std::uint32_t> first = kNoTriangle;
        constexpr std::size_t kPairsAtOnce = 16; // of one thread
        parallel_ranges(pairs.size(), kPairsAtOnce,
                        [&](std::size_t begin, std::size_t end)
                        {
                            Tally tally{tests, most};
                            for (std::size_t k = begin; k < end; ++k)
                                test_patches(pairs[k].a, pairs[k].b, tally);
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

    /// Patches of one level.
    struct Level
    {
        std::vector<FloatBox> boxes; ///< from corner_
        std::vector<Views> views;

        explicit Level(std::size_t size) : boxes(size), views(size, kAllViews) {}
    };

    /// Two patches of a level, the first not behind the second.
    struct PatchPair
    {
        std::uint32_t a, b;
    };

    /// The pairs that one thread found, and its room for contours.
    struct Search
    {
        std::vector<PatchPair> near; ///< of the smallest
        ContourView view;
        std::vector<SurfacePatches::Side> contour;
    };

    void find_smallest()
    {
        Level& level = levels_.emplace_back(patches_.num_patches(0));
        parallel_for(level.boxes.size(),
                     [&](std::size_t patch)
                     {
                         const auto [begin, end] = patches_.range(0, patch);
                         for (std::size_t k = begin; k < end; ++k)
                         {
                             level.boxes[patch].include(box_of(order_[k]));
                             if (level.views[patch] != 0)
                                 level.views[patch] &= views_of(triangles_[order_[k]]);
                         }
                     });
    }

    void add_level()
    {
        const Level& below = levels_.back();
        Level level(patches_.num_patches(levels_.size()));
        for (std::size_t patch = 0; patch < level.boxes.size(); ++patch)
        {
            const auto [begin, end] = below_of(levels_.size(), patch);
            for (std::size_t k = begin; k < end; ++k)
            {
                level.boxes[patch].include(below.boxes[k]);
                level.views[patch] &= below.views[k];
            }
        }
        levels_.push_back(std::move(level));
    }

    /// The patches of the level below that are in one.
    std::array<std::size_t, 2> below_of(std::size_t level, std::size_t patch) const
    {
        return {patch * SurfacePatches::kFanOut,
                std::min(levels_[level - 1].boxes.size(),
                         (patch + 1) * SurfacePatches::kFanOut)};
    }

    /// None of a triangle next to nothing, or whose corners no longer are where those are
    /// that they coincided with at rest.
    Views views_of(const Triangle& t) const
    {
        for (const std::uint32_t corner : t)
            if (is_parted(corner))
                return 0;
        const Eigen::Vector3d a = places_[t[1]] - places_[t[0]],
                              b = places_[t[2]] - places_[t[0]];
        const Eigen::Vector3d normal = a.cross(b);
        const bool is_sure =
            normal.squaredNorm() > kSure * kSure * a.squaredNorm() * b.squaredNorm();
        return is_sure ? cellwarp::core::views_of(normal) : 0;
    }

    bool is_parted(std::uint32_t sample) const
    {
        return joined_[sample] != sample && places_[sample] != places_[joined_[sample]];
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

    /// Whether triangles of both may meet.
    bool may_meet(std::size_t level, const PatchPair& pair, Search& search) const
    {
        const auto& [a, b] = pair;
        const Level& of = levels_[level];
        return (a == b || of.boxes[a].meets(of.boxes[b])) &&
               !is_seen_whole(level, pair, search);
    }

    bool is_seen_whole(std::size_t level, const PatchPair& pair, Search& search) const
    {
        const auto& [a, b] = pair;
        const std::vector<Views>& views = levels_[level].views;
        const Views both = views[a] & views[b];
        if (both == 0)
            return false;
        if (a == b)
            return search.view.sees_all(patches_.contour(level, a), both, places_);
        const auto one = patches_.contour(level, a), other = patches_.contour(level, b);
        if (one.empty() || other.empty())
            return false;
        join_contours(one, other, search.contour);
        return search.view.sees_all(search.contour, both, places_);
    }

    /// Calls take(pair) for the pairs of the patches below that may meet.
    template <class Take>
    void for_pairs_below(std::size_t level, const PatchPair& pair, Search& search,
                         Take&& take) const
    {
        const auto [from, to] = below_of(level, pair.a);
        const auto [begin, end] = below_of(level, pair.b);
        for (std::size_t a = from; a < to; ++a)
            for (std::size_t b = std::max(a, begin); b < end; ++b)
                if (const PatchPair next{static_cast<std::uint32_t>(a),
                                         static_cast<std::uint32_t>(b)};
                    may_meet(level - 1, next, search))
                    take(next);
    }

    void visit(std::size_t level, const PatchPair& pair, Search& search) const
    {
        if (search.near.size() > kMostPairs * levels_[0].boxes.size())
            return;
        if (level == 0)
            return search.near.push_back(pair);
        for_pairs_below(level, pair, search,
                        [&](const PatchPair& next) { visit(level - 1, next, search); });
    }

    /// The pairs of smallest patches that may meet.
    std::vector<PatchPair> near_pairs() const
    {
        constexpr std::size_t kEnough = 512; // for all threads
        std::size_t level = levels_.size() - 1;
        std::vector<PatchPair> pairs;
        Search first;
        if (may_meet(level, {0, 0}, first))
            pairs.push_back({0, 0});
        for (; level > 0 && pairs.size() < kEnough; --level)
        {
            std::vector<PatchPair> below;
            for (const PatchPair& pair : pairs)
                for_pairs_below(level, pair, first,
                                [&](const PatchPair& next) { below.push_back(next); });
            pairs = std::move(below);
        }
        std::vector<std::vector<PatchPair>> near(pairs.size());
        parallel_for(pairs.size(),
                     [&](std::size_t k)
                     {
                         Search search;
                         visit(level, pairs[k], search);
                         near[k] = std::move(search.near);
                     });
        pairs.clear();
        for (const std::vector<PatchPair>& some : near)
            pairs.insert(pairs.end(), some.begin(), some.end());
        return pairs;
    }

    /// The triangles of the patches that are looked at.
    void find_leaves(const std::vector<PatchPair>& pairs)
    {
        if (pairs.empty())
            return;
        first_leaf_.assign(levels_[0].boxes.size(), kNoLeaf);
        std::vector<std::uint32_t> looked_at;
        for (const PatchPair& pair : pairs)
            for (const std::uint32_t patch : {pair.a, pair.b})
                if (first_leaf_[patch] == kNoLeaf)
                {
                    first_leaf_[patch] =
                        static_cast<std::uint32_t>(kLeaves * looked_at.size());
                    looked_at.push_back(patch);
                }
        const std::vector<char> is_simple = simple_corners(looked_at);
        const auto number_of = [&](std::uint32_t corner)
        { return is_simple[joined_[corner]] ? joined_[corner] + 1 : 0; };
        leaves_.resize(kLeaves * looked_at.size());
        boxes_.resize(leaves_.size());
        parallel_for(looked_at.size(),
                     [&](std::size_t i)
                     {
                         const auto [begin, end] = patches_.range(0, looked_at[i]);
                         for (std::size_t k = begin; k < end; ++k)
                         {
                             const std::size_t leaf = kLeaves * i + (k - begin) / kLeaf;
                             const FloatBox box = box_of(order_[k]);
                             const auto& [x, y, z] = triangles_[order_[k]];
                             leaves_[leaf].set(
                                 (k - begin) % kLeaf, box,
                                 {number_of(x), number_of(y), number_of(z)});
                             boxes_[leaf].include(box);
                         }
                     });
    }

    /// For each corner: whether the triangles of these patches around it surely meet in
    /// nothing but shared corners and sides. Corners of a boundary are left out.
    std::vector<char> simple_corners(const std::vector<std::uint32_t>& patches) const
    {
        const auto for_triangles = [&](const auto& visit_one)
        {
            for (const std::uint32_t patch : patches)
            {
                const auto [begin, end] = patches_.range(0, patch);
                for (std::size_t k = begin; k < end; ++k)
                    visit_one(triangles_[order_[k]]);
            }
        };
        // For each corner the passes by it: the corner before and the one after.
        std::vector<std::uint32_t> end(places_.size() + 1, 0);
        std::vector<char> has_parted(places_.size(), 0);
        for_triangles(
            [&](const Triangle& t)
            {
                for (const std::uint32_t corner : t)
                {
                    ++end[joined_[corner] + 1];
                    has_parted[joined_[corner]] |= static_cast<char>(is_parted(corner));
                }
            });
        std::partial_sum(end.begin(), end.end(), end.begin());
        std::vector<std::array<std::uint32_t, 2>> passes(end.back());
        for_triangles(
            [&](const Triangle& t)
            {
                for (std::size_t k = 0; k < 3; ++k)
                    passes[end[joined_[t[k]]]++] = {joined_[t[(k + 1) % 3]],
                                                    joined_[t[(k + 2) % 3]]};
            });
        std::vector<char> is_simple(places_.size(), 0);
        parallel_for(places_.size(), kSmallBodies,
                     [&](std::size_t corner)
                     {
                         const std::size_t begin = corner == 0 ? 0 : end[corner - 1];
                         const std::span<const std::array<std::uint32_t, 2>> around =
                             std::span(passes).subspan(begin, end[corner] - begin);
                         is_simple[corner] =
                             !around.empty() && !has_parted[corner] &&
                             std::none_of(around.begin(), around.end(),
                                          [&](const auto& pass) {
                                              return has_parted[pass[0]] ||
                                                     has_parted[pass[1]];
                                          }) &&
                             is_fan(around, corner, places_);
                     });
        return is_simple;
    }

    void test_patches(std::size_t a, std::size_t b, Tally& tally) const
    {
        const std::size_t in_a = first_leaf_[a], in_b = first_leaf_[b];
        std::array<std::size_t, kLeaves> near; // leaves of b
        std::size_t count = 0;
        for (std::size_t leaf = in_b; leaf < in_b + kLeaves; ++leaf)
            if (boxes_[leaf].meets(levels_[0].boxes[a]))
                near[count++] = leaf;
        for (std::size_t leaf = in_a; leaf < in_a + kLeaves; ++leaf)
            if (boxes_[leaf].meets(levels_[0].boxes[b]))
                for (std::size_t k = 0; k < count; ++k)
                    if ((a != b || near[k] >= leaf) &&
                        boxes_[leaf].meets(boxes_[near[k]]))
                        test_leaves(patches_.range(0, a)[0] + kLeaf * (leaf - in_a), leaf,
                                    patches_.range(0, b)[0] + kLeaf * (near[k] - in_b),
                                    near[k], tally);
    }

    /// \p from, \p begin: where the triangles of the leaves are in the order.
    void test_leaves(std::size_t from, std::size_t a, std::size_t begin, std::size_t b,
                     Tally& tally) const
    {
        if (tally.is_over())
            return;
        const TriangleLeaf &one = leaves_[a], &other = leaves_[b];
        const FloatBox& box = boxes_[b];
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
                test_pair(order_[from + i],
                          order_[begin + static_cast<std::size_t>(std::countr_zero(met))],
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
    const SurfacePatches& patches_;
    std::vector<Level> levels_;
    static constexpr std::uint32_t kNoLeaf = 0xffffffff;
    std::vector<std::uint32_t> first_leaf_; ///< of each smallest patch
    std::vector<TriangleLeaf> leaves_;      ///< from corner_, as their boxes
    std::vector<FloatBox> boxes_;
};

IntersectionCounter::IntersectionCounter(std::span<const Triangle> triangles,
                                         const std::vector<Eigen::Vector3d>& rest)
    : triangles_(triangles), rest_(rest)
{
    if (!can_tell_triangle_pairs() || triangles.empty())
        return;
    joined_ = joined_samples(rest);
    const std::vector<std::uint64_t> keys = along_curve(triangles, rest);
    order_.resize(keys.size());
    std::transform(keys.begin(), keys.end(), order_.begin(),
                   [](std::uint64_t key) { return static_cast<std::uint32_t>(key); });
    const int bits = bits_of_block(keys.size());
    patches_ = std::make_unique<const SurfacePatches>(
        triangles, joined_, order_,
        [&](std::size_t k) { return (keys[k] ^ keys[k + 1]) >> bits != 0; });
}

IntersectionCounter::~IntersectionCounter() = default;

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

} // namespace cellwarp::core
