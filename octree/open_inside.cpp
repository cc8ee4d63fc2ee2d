// SPDX-License-Identifier: GPL-3.0-or-later
// Openings are closed in voxels that are no finer than that needs: finer ones, asked for
// by parts that are near each other, cost many times as much and close the same openings.
// What the larger voxels say holds for all that lies in them, but where the surface
// passes. There both sides flow in from around, through the small voxels that the surface
// leaves free, the one that is there first taking each; so two parts are told apart by
// the space between them as well as if all had been done in small voxels. What neither
// reaches is enclosed by the surface itself.
#include "octree/open_inside.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "octree/hollows.h"
#include "octree/sealed_inside.h"
#include "octree/surface_marks.h"

namespace cellwarp::core
{

namespace
{

/// Largest opening that is closed to find an inside, as a radius [of the diagonal].
/// The bunny's two base holes need 0.03.
constexpr double kMaxSealRadius = 0.04;

/// Above this radius of an opening [of the diagonal] hollows are nearer to the closed
/// shape than what a flood leaves (docs/benchmarks.md).
constexpr double kWideRadius = 0.015;

/// Largest opening of a hollow, as a radius [of the diagonal]. A pot without its lid is
/// solid; the sample vase, whose rim needs 0.16, stays a shell.
constexpr double kMaxHollowRadius = 0.125;

/// Voxels as large as this are fine enough for openings [of the diagonal].
constexpr double kFineEnough = 0.00327;

/// So many of the six rays of a voxel must say that it is inside.
constexpr std::uint8_t kVotes = 4;

/// Which openings are closed where a flood needed \p seal_radius [voxel] (negative: where
/// it found no inside up to \p max_seal). Below two voxels marks are no surface.
Openings wide_openings(const GridShape& shape, double seal_radius, double max_seal)
{
    const double narrowest = std::max(2.0, seal_radius < 0 ? max_seal : seal_radius);
    const double widest = kMaxHollowRadius * shape.size.norm() / shape.voxel();
    return {narrowest, std::max(narrowest, widest)};
}

/// Of a soup or a cloud: what its marks enclose, and of the voxels that the surface only
/// touches those beside it. Which side of the surface the others are on nobody knows.
void add_touched_inside(const VoxelGrid& grid, const VoxelFlags& marks,
                        VoxelFlags& is_inside)
{
    const VoxelFlags enclosed = beyond_marks(is_inside, marks);
    parallel_for_each_set(
        marks,
        [&](std::size_t i)
        {
            const Eigen::Vector3i voxel = grid.coordinates(i);
            std::uint8_t is_beside = 0;
            for_each_voxel(
                VoxelRange{voxel.array() - 1, voxel.array() + 1}.cut(grid.inside_box()),
                [&](const Eigen::Vector3i& other)
                { is_beside |= enclosed[grid.index(other)]; });
            is_inside[i] = is_beside;
        });
}

/// What is enclosed in the voxels of a grid as they are.
OpenInside inside_in(const VoxelGrid& grid, const VoxelFlags& marks,
                     const VoxelFlags& votes)
{
    const auto may_fill = [&](std::size_t i)
    { return votes.empty() || votes[i] >= kVotes; };
    const GridShape& shape = grid.shape();
    const int max_radius = max_seal_radius(shape);
    SealedInside sealed(grid, marks, max_radius);
    const double radius = sealed.radius();
    if (radius < 0 || radius * shape.voxel() > kWideRadius * shape.size.norm())
        if (Hollows hollows = hollow_voxels(
                grid, marks, wide_openings(shape, radius, max_radius), may_fill);
            hollows.radius >= 0)
            return {InsideMethod::Hollows, std::move(hollows.is_inside), radius,
                    hollows.radius};
    const InsideMethod method = radius < 0      ? InsideMethod::None
                                : votes.empty() ? InsideMethod::Flood
                                                : InsideMethod::Votes;
    return {method, std::move(sealed).voxels(may_fill), radius, std::max(radius, 0.0)};
}

/// A grid, and one of larger voxels over it.
class TwoGrids
{
public:
    TwoGrids(const VoxelGrid& fine, const VoxelFlags& marks, int scale)
        : fine_(fine), marks_(marks), scale_(scale), coarse_(inside_grid(fine.shape())),
          coarse_marks_(largest_of(marks))
    {
    }

    const VoxelGrid& coarse() const { return coarse_; }
    const VoxelFlags& coarse_marks() const { return coarse_marks_; }

    /// Of each large voxel the largest number of those in it.
    VoxelFlags largest_of(const VoxelFlags& values) const
    {
        VoxelFlags largest(coarse_.size());
        const std::size_t nx = idx(fine_.counts().x());
        for (int k = 0; k < fine_.counts().z(); ++k)
            for (int j = 0; j < fine_.counts().y(); ++j)
            {
                const std::size_t row = fine_.index(0, j, k),
                                  to = coarse_.index(0, j / scale_, k / scale_);
                for_each_set(values, row, row + nx,
                             [&](std::size_t i)
                             {
                                 std::uint8_t& of = largest[to + (i - row) / idx(scale_)];
                                 of = std::max(of, values[i]);
                             });
            }
        return largest;
    }

    /// What is inside in the large voxels, told in small ones, the marks among it.
    VoxelFlags refined(const VoxelFlags& coarse_inside) const
    {
        VoxelFlags is_inside(fine_.size());
        for_each_set(coarse_inside,
                     [&](std::size_t c)
                     {
                         if (!coarse_marks_[c])
                             for_each_voxel(voxels_of(c), [&](const Eigen::Vector3i& v)
                                            { is_inside[fine_.index(v)] = 1; });
                     });
        VoxelFlags side(fine_.size());
        for_each_set(coarse_marks_,
                     [&](std::size_t c)
                     {
                         for_each_voxel(voxels_of(c),
                                        [&](const Eigen::Vector3i& v)
                                        {
                                            const std::size_t i = fine_.index(v);
                                            side[i] = marks_[i] ? Side::Wall : Side::Open;
                                        });
                     });
        flow(is_inside, side);
        for_each_set(side,
                     [&](std::size_t i)
                     {
                         if (side[i] != Side::Outside)
                             is_inside[i] = 1;
                     });
        return is_inside;
    }

private:
    /// Of a small voxel in a large one that the surface touches; 0 elsewhere.
    enum Side : std::uint8_t
    {
        Open = 1,
        Wall,
        Inside,
        Outside
    };

    VoxelRange voxels_of(std::size_t coarse) const
    {
        const Eigen::Vector3i first = coarse_.coordinates(coarse) * scale_;
        return VoxelRange{first, first.array() + scale_ - 1}.cut(
            {Eigen::Vector3i::Zero(), fine_.counts().array() - 1});
    }

    /// Whether a voxel is beside one that the surface is far from, on each side of it.
    std::array<bool, 2> sides_beside(const Eigen::Vector3i& voxel,
                                     const VoxelFlags& is_inside,
                                     const VoxelFlags& side) const
    {
        std::array<bool, 2> is_at = {false, false};
        for_each_beside(voxel,
                        [&](const Eigen::Vector3i& other)
                        {
                            if (!fine_.contains(other))
                                is_at[1] = true;
                            else if (const std::size_t o = fine_.index(other);
                                     side[o] == 0)
                                is_at[is_inside[o] ? 0 : 1] = true;
                        });
        return is_at;
    }

    /// From both sides into what is open, layer by layer, the inside first.
    void flow(const VoxelFlags& is_inside, VoxelFlags& side) const
    {
        constexpr std::array<Side, 2> kSides = {Side::Inside, Side::Outside};
        std::array<std::vector<std::size_t>, 2> front, next;
        const auto begin_at = [&](const Eigen::Vector3i& voxel)
        {
            const std::size_t i = fine_.index(voxel);
            if (side[i] != Side::Open)
                return;
            const std::array<bool, 2> is_at = sides_beside(voxel, is_inside, side);
            if (is_at[0] || is_at[1])
                front[is_at[0] ? 0 : 1].push_back(i);
        };
        for_each_set(coarse_marks_,
                     [&](std::size_t c) { for_each_voxel(voxels_of(c), begin_at); });
        for (std::size_t s : {0u, 1u})
            for (const std::size_t i : front[s])
                side[i] = kSides[s];
        const auto take = [&](const Eigen::Vector3i& voxel, std::size_t s)
        {
            if (!fine_.contains(voxel))
                return;
            const std::size_t i = fine_.index(voxel);
            if (side[i] != Side::Open)
                return;
            side[i] = kSides[s];
            next[s].push_back(i);
        };
        while (!front[0].empty() || !front[1].empty())
        {
            for (std::size_t s : {0u, 1u})
            {
                next[s].clear();
                for (const std::size_t i : front[s])
                    for_each_beside(fine_.coordinates(i),
                                    [&](const Eigen::Vector3i& other)
                                    { take(other, s); });
            }
            front.swap(next);
        }
    }

    const VoxelGrid& fine_;
    const VoxelFlags& marks_;
    int scale_;
    VoxelGrid coarse_;
    VoxelFlags coarse_marks_;
};

OpenInside inside_by_large_voxels(const VoxelGrid& grid, const VoxelFlags& marks,
                                  const VoxelFlags& votes, int scale)
{
    const TwoGrids grids(grid, marks, scale);
    OpenInside found = inside_in(grids.coarse(), grids.coarse_marks(),
                                 votes.empty() ? VoxelFlags() : grids.largest_of(votes));
    if (found.method == InsideMethod::None)
    {
        found.is_inside = VoxelFlags(grid.size());
        return found;
    }
    found.is_inside = grids.refined(found.is_inside);
    if (!votes.empty())
        parallel_for_each_set(found.is_inside,
                              [&](std::size_t i)
                              {
                                  if (votes[i] < kVotes)
                                      found.is_inside[i] = 0;
                              });
    if (found.flood_radius >= 0)
        found.flood_radius *= scale;
    found.seal_radius *= scale;
    return found;
}

} // namespace

int max_seal_radius(const GridShape& shape)
{
    return std::clamp(
        static_cast<int>(kMaxSealRadius * shape.size.norm() / shape.voxel()), 1, 100);
}

int inside_scale(const GridShape& shape)
{
    const double voxels = kFineEnough * shape.size.norm() / shape.voxel();
    return std::isfinite(voxels) ? std::clamp(static_cast<int>(voxels), 1, 1000) : 1;
}

GridShape inside_grid(const GridShape& shape)
{
    const int scale = inside_scale(shape);
    if (scale == 1)
        return shape;
    GridShape larger;
    larger.size = shape.size;
    larger.edge = shape.voxel() * scale;
    larger.coarsest =
        (shape.coarsest.array() * shape.voxels_per_coarsest() + scale - 1) / scale;
    larger.voxels_per_leaf = 1;
    return larger;
}

OpenInside open_inside(const VoxelGrid& grid, const VoxelFlags& marks,
                       const VoxelFlags& votes)
{
    const int scale = inside_scale(grid.shape());
    OpenInside found = scale == 1 ? inside_in(grid, marks, votes)
                                  : inside_by_large_voxels(grid, marks, votes, scale);
    // Rays tell of each voxel whether it is inside; the others only of those beyond the
    // marks.
    if (found.method != InsideMethod::Votes)
        add_touched_inside(grid, marks, found.is_inside);
    return found;
}

} // namespace cellwarp::core
