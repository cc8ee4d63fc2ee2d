// SPDX-License-Identifier: GPL-3.0-or-later
// Patches of a surface, small and large, and whether one, or two side by side, can be
// seen whole from some direction: then nothing of them passes through itself.
#pragma once

#include <algorithm>
#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/shape.h"

namespace cellwarp::core
{

/// Triangles in an order, some hundreds in a patch, four patches in one of the next
/// level, and so on up to one patch of all. Knows the contour of each: the sides of its
/// triangles that no other one of them passes in the opposite direction.
class SurfacePatches
{
public:
    static constexpr std::size_t kSmallest = 256; ///< most triangles of the first level
    static constexpr std::size_t kFanOut = 4;     ///< patches in one of the next level

    /// \p joined: of each sample the one that stands for all at its place. Patches of the
    /// first level end where \p ends_block(k) says that triangle k of the order is the
    /// last before a gap. All but that must outlive this.
    template <class EndsBlock>
    SurfacePatches(std::span<const Triangle> triangles,
                   std::span<const std::uint32_t> joined,
                   std::span<const std::uint32_t> order, const EndsBlock& ends_block)
        : triangles_(triangles), joined_(joined), order_(order)
    {
        for (std::size_t k = 0, begin = 0; k < order.size(); ++k)
            if (k + 1 - begin == kSmallest || k + 1 == order.size() || ends_block(k))
                begin = ends_.emplace_back(static_cast<std::uint32_t>(k + 1));
        make_levels();
    }

    std::size_t num_levels() const { return contours_.size(); }
    std::size_t num_patches(std::size_t level) const;
    /// The first triangle of a patch in the order, and the one behind its last.
    std::array<std::size_t, 2> range(std::size_t level, std::size_t patch) const;

    /// A side of a triangle, by the corners that it leads from and to. Those of one pair
    /// of corners follow each other where sides are sorted.
    struct Side
    {
        std::uint64_t code;

        Side() = default;
        Side(std::uint32_t from, std::uint32_t to)
            : code(std::uint64_t{std::min(from, to)} << 32 |
                   std::uint64_t{std::max(from, to)} << 1 | std::uint64_t{from > to})
        {
        }
        std::uint32_t low() const { return static_cast<std::uint32_t>(code >> 32); }
        std::uint32_t high() const { return static_cast<std::uint32_t>(code) >> 1; }
        bool is_back() const { return (code & 1) != 0; }
        std::uint32_t from() const { return is_back() ? high() : low(); }
        std::uint32_t to() const { return is_back() ? low() : high(); }
        auto operator<=>(const Side&) const = default;
    };
    /// The contour, sorted. Empty where it is longer than patches of that size have, or
    /// where there is none, as around a whole body: nobody sees all of that from one
    /// side.
    std::span<const Side> contour(std::size_t level, std::size_t patch) const;

private:
    /// The contours of some patches that follow each other.
    struct Block
    {
        std::vector<Side> sides;
        std::vector<std::uint32_t> ends;
    };
    static constexpr std::size_t kBlock = 64; ///< patches

    class Balance;
    void find_sides(std::size_t begin, std::size_t end, Balance& balance,
                    std::vector<Side>& sides) const;
    void join_patches(std::size_t level, std::size_t patch, std::vector<Side>& sum,
                      std::vector<Side>& room) const;
    void add_level();
    void make_levels();

    std::span<const Triangle> triangles_;
    std::span<const std::uint32_t> joined_, order_;
    std::vector<std::uint32_t> ends_;          ///< of the patches of the first level
    std::vector<std::vector<Block>> contours_; ///< of each level
};

/// The contour of two patches together: the sides of both that do not cancel. Sorted.
void join_contours(std::span<const SurfacePatches::Side> one,
                   std::span<const SurfacePatches::Side> other,
                   std::vector<SurfacePatches::Side>& out);

/// A bit for each of 26 directions, those to the middles of the faces and edges of a cube
/// and to its corners: whether triangles seen from there all face the viewer.
using Views = std::uint32_t;
inline constexpr Views kAllViews = (Views{1} << 26) - 1;

/// From where a triangle with this normal, of any length, is seen. None if it is too flat
/// there by 4 degrees.
Views views_of(const Eigen::Vector3d& normal);

/// Tells of contours whether they are seen without a crossing, so that no point is seen
/// twice. Keeps its memory.
class ContourView
{
public:
    /// Whether triangles are seen whole, none of them in front of another one, from one
    /// of the directions from which they all face the viewer. \p contour is theirs. True
    /// only far beyond rounding.
    bool sees_all(std::span<const SurfacePatches::Side> contour, Views views,
                  const std::vector<Eigen::Vector3d>& places);

private:
    struct Line
    {
        double low, high; ///< along the diagonal
        std::uint32_t side;
        bool operator<(const Line& other) const { return low < other.low; }
    };

    void find_corners(std::span<const SurfacePatches::Side> contour);
    std::uint32_t number_of(std::uint32_t corner);
    bool are_corners_simple();
    bool is_corner_simple(std::uint32_t corner);
    bool are_sides_apart();
    bool are_apart(std::uint32_t one, std::uint32_t other) const;
    bool are_nested_once();
    double turn(std::uint32_t a, std::uint32_t b, std::uint32_t c) const;

    std::vector<std::uint32_t> slots_;   ///< of a table of corners
    std::vector<std::uint32_t> corners_; ///< each once, numbered by this
    std::vector<std::array<std::uint32_t, 2>> sides_;
    std::vector<Eigen::Vector2d> seen_;                        ///< of each corner
    std::vector<std::uint32_t> out_, in_, next_out_, next_in_; ///< sides at a corner
    std::vector<Line> lines_;
    std::vector<std::uint32_t> group_; ///< of corners that sides connect
    double size_ = 0.0;
};

} // namespace cellwarp::core
