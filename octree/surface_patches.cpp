// SPDX-License-Identifier: GPL-3.0-or-later
// Why what is seen whole does not pass through itself. All triangles face the viewer, so
// each covers what it hides once, and a point of the picture is covered as often as the
// contour winds around it (the sum of the boundaries of the triangles is the contour). If
// the contour winds around no point twice, the insides of the triangles are seen apart.
// Suppose two triangles have a point in common that is no corner or side that they share.
// As a point of the surface it is two points; both are seen at one place. If one of them
// is not on the contour, the triangles around it cover all directions around that place,
// and those around the other one cover some of them again: twice, which cannot be. So
// both are on the contour, which is seen at one place twice: but it does not touch
// itself.
//   It winds around nothing twice if, first, its sides meet in corners alone; second,
// around each corner those that leave and those that arrive take turns: then what is to
// the left of a side is always covered once more than what is to its right, and the same
// is true all along the sides that hang together; third, of what hangs together the left
// is covered once, which is found out at one point of each.
#include "octree/surface_patches.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <numeric>
#include <utility>

#include <Eigen/Geometry>

#include "octree/base/hash.h"
#include "octree/base/parallel.h"

namespace cellwarp::core
{

namespace
{

using PatchSide = SurfacePatches::Side;

constexpr std::uint32_t kNobody = 0xffffffff;

/// The cosine of the steepest angle at which a triangle may be seen.
constexpr double kSteepest = 0.07;

/// Number of axes of views: view k looks along axis k, view 13 + k the opposite way.
constexpr std::size_t kAxes = 13;
const std::array<Eigen::Vector3d, kAxes>& view_axes()
{
    static const std::array<Eigen::Vector3d, kAxes> axes = []
    {
        std::array<Eigen::Vector3d, kAxes> all;
        std::size_t count = 0;
        for (int x = -1; x <= 1; ++x)
            for (int y = -1; y <= 1; ++y)
                for (int z = -1; z <= 1; ++z)
                    if (9 * x + 3 * y + z > 0) // of two opposite ones one
                        all[count++] = Eigen::Vector3d(x, y, z).normalized();
        return all;
    }();
    return axes;
}

/// The middle of the directions in a set of views.
Eigen::Vector3d best_view(Views views)
{
    const auto direction = [](std::size_t k) -> Eigen::Vector3d
    { return k < kAxes ? view_axes()[k] : -view_axes()[k - kAxes]; };
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (std::size_t k = 0; k < 2 * kAxes; ++k)
        if (views >> k & 1)
            sum += direction(k);
    Eigen::Vector3d best = Eigen::Vector3d::Zero();
    double most = -INFINITY;
    for (std::size_t k = 0; k < 2 * kAxes; ++k)
        if (views >> k & 1 && direction(k).dot(sum) > most)
        {
            most = direction(k).dot(sum);
            best = direction(k);
        }
    return best;
}

/// Far beyond rounding, relative to the picture.
constexpr double kApart = 1e-12;

/// A bound of the sides in the contour of a patch: its triangles have three times as many
/// sides. A patch that is about as wide as long has a quarter of the bound.
std::size_t longest_contour(std::size_t triangles)
{
    return std::min(2 * triangles, static_cast<std::size_t>(
                                       16.0 * std::sqrt(static_cast<double>(triangles))));
}

std::size_t rounded_up(std::size_t count, std::size_t by)
{
    return (count + by - 1) / by;
}

} // namespace

/// How often sides are passed, less how often in the opposite direction. Keeps its
/// memory.
class SurfacePatches::Balance
{
public:
    void begin(std::size_t most)
    {
        slots_.assign(std::bit_ceil(2 * most + 1), {kFree, 0});
    }
    void add(const PatchSide& side)
    {
        const std::uint64_t pair = side.code >> 1;
        for (std::size_t at = hash_of(pair);; ++at)
        {
            Slot& slot = slots_[at & (slots_.size() - 1)];
            if (slot.pair == kFree)
                slot.pair = pair;
            if (slot.pair != pair)
                continue;
            slot.count += side.is_back() ? -1 : 1;
            return;
        }
    }
    /// The sides that do not cancel, sorted.
    void end(std::vector<PatchSide>& sides) const
    {
        sides.clear();
        for (const Slot& slot : slots_)
        {
            PatchSide side;
            side.code = slot.pair << 1 | std::uint64_t{slot.count < 0};
            sides.insert(sides.end(), static_cast<std::size_t>(std::abs(slot.count)),
                         side);
        }
        std::sort(sides.begin(), sides.end());
    }

private:
    static constexpr std::uint64_t kFree = ~std::uint64_t{0};
    struct Slot
    {
        std::uint64_t pair;
        std::int64_t count;
    };
    std::vector<Slot> slots_;
};

void SurfacePatches::make_levels()
{
    do
        add_level();
    while (num_patches(num_levels() - 1) > 1);
}

std::size_t SurfacePatches::num_patches(std::size_t level) const
{
    std::size_t count = ends_.size();
    for (; level > 0; --level)
        count = rounded_up(count, kFanOut);
    return count;
}

std::array<std::size_t, 2> SurfacePatches::range(std::size_t level,
                                                 std::size_t patch) const
{
    const std::size_t first = patch << 2 * level, end = (patch + 1) << 2 * level;
    return {first == 0 ? 0 : ends_[first - 1], ends_[std::min(end, ends_.size()) - 1]};
}

std::span<const PatchSide> SurfacePatches::contour(std::size_t level,
                                                   std::size_t patch) const
{
    const Block& block = contours_[level][patch / kBlock];
    const std::size_t k = patch % kBlock, begin = k == 0 ? 0 : block.ends[k - 1];
    return std::span(block.sides).subspan(begin, block.ends[k] - begin);
}

/// The contour of the triangles from \p begin to \p end in the order.
void SurfacePatches::find_sides(std::size_t begin, std::size_t end, Balance& balance,
                                std::vector<PatchSide>& sides) const
{
    balance.begin(3 * (end - begin));
    for (std::size_t k = begin; k < end; ++k)
    {
        const Triangle& t = triangles_[order_[k]];
        const std::array<std::uint32_t, 3> corners = {joined_[t[0]], joined_[t[1]],
                                                      joined_[t[2]]};
        for (std::size_t i = 0; i < 3; ++i)
            if (const std::uint32_t from = corners[i], to = corners[(i + 1) % 3];
                from != to)
                balance.add({from, to});
    }
    balance.end(sides);
}

/// The contour of a patch, from those of the patches below it.
void SurfacePatches::join_patches(std::size_t level, std::size_t patch,
                                  std::vector<PatchSide>& sum,
                                  std::vector<PatchSide>& room) const
{
    sum.clear();
    const std::size_t end = std::min(num_patches(level - 1), (patch + 1) * kFanOut);
    for (std::size_t below = patch * kFanOut; below < end; ++below)
    {
        const std::span<const PatchSide> part = contour(level - 1, below);
        if (part.empty())
            return sum.clear();
        join_contours(sum, part, room);
        sum.swap(room);
    }
}

void SurfacePatches::add_level()
{
    const std::size_t level = num_levels(), count = num_patches(level);
    std::vector<Block> blocks(rounded_up(count, kBlock));
    parallel_for(blocks.size(),
                 [&](std::size_t b)
                 {
                     std::vector<PatchSide> sides, room;
                     Balance balance;
                     for (std::size_t patch = b * kBlock;
                          patch < std::min(count, (b + 1) * kBlock); ++patch)
                     {
                         const auto [begin, end] = range(level, patch);
                         if (level == 0)
                             find_sides(begin, end, balance, sides);
                         else
                             join_patches(level, patch, sides, room);
                         if (sides.size() > longest_contour(end - begin))
                             sides.clear();
                         std::vector<PatchSide>& all = blocks[b].sides;
                         all.insert(all.end(), sides.begin(), sides.end());
                         blocks[b].ends.push_back(static_cast<std::uint32_t>(all.size()));
                     }
                     blocks[b].sides.shrink_to_fit();
                 });
    contours_.push_back(std::move(blocks));
}

void join_contours(std::span<const PatchSide> one, std::span<const PatchSide> other,
                   std::vector<PatchSide>& out)
{
    out.clear();
    std::size_t i = 0, j = 0;
    while (i < one.size() && j < other.size())
    {
        if ((one[i].code ^ other[j].code) == 1)
            ++i, ++j;
        else
            out.push_back(one[i] < other[j] ? one[i++] : other[j++]);
    }
    out.insert(out.end(), one.begin() + static_cast<std::ptrdiff_t>(i), one.end());
    out.insert(out.end(), other.begin() + static_cast<std::ptrdiff_t>(j), other.end());
}

Views views_of(const Eigen::Vector3d& normal)
{
    const double least = kSteepest * normal.norm();
    Views views = 0;
    for (std::size_t k = 0; k < kAxes; ++k)
    {
        const double along = view_axes()[k].dot(normal);
        views |= Views{along > least} << k | Views{along < -least} << (kAxes + k);
    }
    return views;
}

bool ContourView::sees_all(std::span<const PatchSide> contour, Views views,
                           const std::vector<Eigen::Vector3d>& places)
{
    if (views == 0 || contour.empty())
        return false;
    find_corners(contour);
    const Eigen::Vector3d view = best_view(views);
    const Eigen::Vector3d across = view.unitOrthogonal(), up = view.cross(across);
    const Eigen::Vector3d& origin = places[corners_[0]];
    seen_.clear();
    size_ = 0.0;
    for (const std::uint32_t corner : corners_)
    {
        const Eigen::Vector3d x = places[corner] - origin;
        seen_.emplace_back(across.dot(x), up.dot(x));
        size_ = std::max(size_, seen_.back().cwiseAbs().maxCoeff());
    }
    return are_corners_simple() && are_sides_apart() && are_nested_once();
}

/// Numbers the corners, and finds the sides at each.
void ContourView::find_corners(std::span<const PatchSide> contour)
{
    slots_.assign(std::bit_ceil(4 * contour.size()), kNobody);
    corners_.clear();
    sides_.clear();
    for (const PatchSide& side : contour)
        sides_.push_back({number_of(side.from()), number_of(side.to())});
    out_.assign(corners_.size(), kNobody);
    in_.assign(corners_.size(), kNobody);
    next_out_.resize(sides_.size());
    next_in_.resize(sides_.size());
    for (std::uint32_t s = 0; s < sides_.size(); ++s)
    {
        next_out_[s] = std::exchange(out_[sides_[s][0]], s);
        next_in_[s] = std::exchange(in_[sides_[s][1]], s);
    }
}

std::uint32_t ContourView::number_of(std::uint32_t corner)
{
    for (std::size_t slot = hash_of(std::uint64_t{corner});; ++slot)
    {
        std::uint32_t& number = slots_[slot & (slots_.size() - 1)];
        if (number == kNobody)
        {
            number = static_cast<std::uint32_t>(corners_.size());
            corners_.push_back(corner);
        }
        if (corners_[number] == corner)
            return number;
    }
}

bool ContourView::are_corners_simple()
{
    for (std::uint32_t corner = 0; corner < corners_.size(); ++corner)
        if (!is_corner_simple(corner))
            return false;
    return true;
}

/// Whether sides that leave it and sides that arrive take turns, all in directions of
/// their own.
bool ContourView::is_corner_simple(std::uint32_t corner)
{
    struct Way
    {
        Eigen::Vector2d direction;
        bool leaves;
        double angle;
    };
    constexpr std::size_t kMost = 16;
    std::array<Way, kMost> ways;
    std::size_t count = 0;
    const auto add = [&](std::uint32_t other, bool leaves)
    {
        if (count < kMost)
            ways[count] = {seen_[other] - seen_[corner], leaves, 0.0};
        ++count;
    };
    for (std::uint32_t s = out_[corner]; s != kNobody; s = next_out_[s])
        add(sides_[s][1], true);
    for (std::uint32_t s = in_[corner]; s != kNobody; s = next_in_[s])
        add(sides_[s][0], false);
    if (count < 2 || count > kMost)
        return false;
    const auto are_apart = [&](const Way& a, const Way& b)
    {
        const double cross =
            a.direction.x() * b.direction.y() - a.direction.y() * b.direction.x();
        const double sizes = a.direction.norm() + b.direction.norm();
        return std::abs(cross) > kApart * size_ * sizes ||
               a.direction.dot(b.direction) < 0.0;
    };
    if (count == 2)
        return ways[0].leaves != ways[1].leaves && are_apart(ways[0], ways[1]);
    const auto end = ways.begin() + static_cast<std::ptrdiff_t>(count);
    for (auto way = ways.begin(); way != end; ++way)
        way->angle = std::atan2(way->direction.y(), way->direction.x());
    std::sort(ways.begin(), end,
              [](const Way& a, const Way& b) { return a.angle < b.angle; });
    for (std::size_t k = 0; k < count; ++k)
    {
        const Way &one = ways[k], &next = ways[(k + 1) % count];
        if (one.leaves == next.leaves || !are_apart(one, next))
            return false;
    }
    return true;
}

/// Whether sides that have no corner in common are apart.
bool ContourView::are_sides_apart()
{
    // Along a diagonal, across which no row of sides lies in a regular grid.
    const Eigen::Vector2d diagonal(0.8090169943749475, 0.5877852522924731);
    lines_.clear();
    for (std::uint32_t s = 0; s < sides_.size(); ++s)
    {
        const double a = diagonal.dot(seen_[sides_[s][0]]),
                     b = diagonal.dot(seen_[sides_[s][1]]);
        lines_.push_back({std::min(a, b), std::max(a, b) + kApart * size_, s});
    }
    std::sort(lines_.begin(), lines_.end());
    for (std::size_t i = 0; i < lines_.size(); ++i)
        for (std::size_t j = i + 1; j < lines_.size() && lines_[j].low <= lines_[i].high;
             ++j)
            if (!are_apart(lines_[i].side, lines_[j].side))
                return false;
    return true;
}

/// Twice the area of a triangle of corners, positive if they turn left.
double ContourView::turn(std::uint32_t a, std::uint32_t b, std::uint32_t c) const
{
    const Eigen::Vector2d s = seen_[b] - seen_[a], t = seen_[c] - seen_[a];
    return s.x() * t.y() - s.y() * t.x();
}

bool ContourView::are_apart(std::uint32_t one, std::uint32_t other) const
{
    const auto [a, b] = sides_[one];
    const auto [c, d] = sides_[other];
    if (a == c || a == d || b == c || b == d)
        return true; // the corner has been looked at
    for (int axis = 0; axis < 2; ++axis)
    {
        const auto [low, high] = std::minmax(seen_[a][axis], seen_[b][axis]);
        const auto [from, to] = std::minmax(seen_[c][axis], seen_[d][axis]);
        if (low > to + kApart * size_ || from > high + kApart * size_)
            return true;
    }
    const auto are_beside =
        [&](std::uint32_t from, std::uint32_t to, std::uint32_t p, std::uint32_t q)
    {
        const double of_p = turn(from, to, p), of_q = turn(from, to, q);
        const double sure =
            kApart * size_ *
            ((seen_[to] - seen_[from]).norm() + (seen_[p] - seen_[from]).norm() +
             (seen_[q] - seen_[from]).norm());
        return (of_p > sure && of_q > sure) || (of_p < -sure && of_q < -sure);
    };
    return are_beside(a, b, c, d) || are_beside(c, d, a, b);
}

/// Whether what is to the left of the sides is covered once, if they cross nowhere.
bool ContourView::are_nested_once()
{
    group_.resize(corners_.size());
    std::iota(group_.begin(), group_.end(), 0u);
    const auto first_of = [&](std::uint32_t corner)
    {
        while (group_[corner] != corner)
            corner = group_[corner] = group_[group_[corner]];
        return corner;
    };
    for (const auto& [from, to] : sides_)
    {
        const std::uint32_t a = first_of(from), b = first_of(to);
        group_[std::max(a, b)] = std::min(a, b);
    }
    constexpr std::size_t kMost = 16;
    std::array<std::uint32_t, kMost> groups;
    std::size_t count = 0;
    for (std::uint32_t corner = 0; corner < corners_.size(); ++corner)
        if (first_of(corner) == corner)
        {
            if (count == kMost)
                return false;
            groups[count++] = corner;
        }
    if (count == 1)
        return true; // all that it goes around is covered, and nothing less than never
    for (std::size_t g = 0; g < count; ++g)
    {
        const std::uint32_t corner = groups[g];
        const Eigen::Vector2d& at = seen_[corner];
        double area = 0.0;
        int winding = 0; // of all others around this one
        for (const auto& [from, to] : sides_)
            if (first_of(from) == corner)
                area += turn(corner, from, to);
            else if ((seen_[from].y() <= at.y()) != (seen_[to].y() <= at.y()))
            {
                const bool goes_up = seen_[from].y() <= at.y();
                if ((turn(from, to, corner) > 0.0) == goes_up)
                    winding += goes_up ? 1 : -1;
            }
        if (winding != (area > 0.0 ? 0 : 1))
            return false;
    }
    return true;
}

} // namespace cellwarp::core
