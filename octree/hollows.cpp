// SPDX-License-Identifier: GPL-3.0-or-later
// A wrap with radius alpha closes what a ball of that radius cannot pass. It also spans
// every groove that is narrower, so that alone says nothing. But in a groove, which
// narrows inwards, no ball is larger than one that fits through its mouth. So where a
// wrap encloses room for a ball clearly larger than alpha, a hollow begins.
//
// How far it reaches: what the wrap encloses is shared out between the hollows and the
// outside by a flood from both, through the roomiest places first. A voxel goes to the
// side from which the larger ball reaches it. So a hollow ends in the throat of its
// opening, and a groove outside stays outside, though samples leave gaps between the two.
//
// Wraps are tried from the narrowest up; each adds the hollows that no smaller one
// closed. The widest comes first: it tells whether there is anything to look for. Before
// that all are tried on a grid of larger voxels, which takes a tenth of the time: it is
// enough for most shapes that have no hollow, open sheets, and tells from which radius on
// there may be one. Wraps of less than that go into every corner and find nothing.
#include "octree/hollows.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "octree/distance_transform.h"
#include "octree/winding.h"
#include "octree/wrap/wrap.h"

namespace cellwarp
{

namespace
{

/// How much larger than the ball that cannot enter is the largest one that fits inside.
constexpr double kRoom = 1.25;

/// From one radius to the next.
constexpr double kRadiusStep = 1.25;

/// How far the wrap stays away from the marks' centres [voxel].
constexpr double kOffset = 1.0;

/// How many voxels of the first, coarse look the radius of the narrowest opening has, and
/// how much less room counts there: voxels that large misjudge it by as much.
constexpr double kCoarseRadius = 4.0, kCoarseRoom = 0.7;

/// A ball of this radius [voxel] is kept out as well by every second mark, and a wrap of
/// a quarter of the points takes half the time.
constexpr double kThinFrom = 4.0;

/// Free voxels around the grid: the wrap and what lies just outside of it fit in.
constexpr int kBorder = 4;

using Flags = VoxelFlags;

/// The marks of a grid with a border, one unit a voxel.
class Lattice
{
public:
    /// \p most: what is as far from all marks has room for every ball [voxel].
    Lattice(const VoxelGrid& grid, const Flags& marks, double most)
        : inner_(grid), grid_(shape_of(grid.counts())), marks_(grid_.size())
    {
        const Eigen::Vector3i blocks = (grid_.counts().array() + 1) / 2;
        Flags has_point(idx(blocks.x()) * idx(blocks.y()) * idx(blocks.z()));
        for_each_set(
            marks,
            [&](std::size_t i)
            {
                marks_[of(i)] = 1;
                const Eigen::Vector3i place = grid.coordinates(i).array() + kBorder;
                points_.push_back(place.cast<double>().array() + 0.5);
                const Eigen::Vector3i block = place / 2;
                std::uint8_t& has =
                    has_point[(idx(block.z()) * idx(blocks.y()) + idx(block.y())) *
                                  idx(blocks.x()) +
                              idx(block.x())];
                if (!has)
                    thin_points_.push_back(points_.back());
                has = 1;
            });
        room_.emplace(marks_, grid_.counts(), most);
    }

    const Eigen::Vector3i& counts() const { return grid_.counts(); }
    std::size_t size() const { return marks_.size(); }
    /// Distances from the marks [voxel].
    const NearDistances& room() const { return *room_; }
    bool is_mark(std::size_t voxel) const { return marks_[voxel] != 0; }

    /// The place of a voxel of the inner grid.
    std::size_t of(std::size_t voxel) const
    {
        return grid_.index((inner_.coordinates(voxel).array() + kBorder).matrix().eval());
    }

    /// The other way; outside of the inner grid where \p place is in the border.
    Eigen::Vector3i in_inner_grid(std::size_t place) const
    {
        return grid_.coordinates(place).array() - kBorder;
    }

    /// What lies inside a wrap, its offset taken off.
    Flags enclosed(double alpha) const
    {
        const Shape wrap =
            alpha_wrap(alpha < kThinFrom ? points_ : thin_points_, alpha, kOffset);
        const Flags inside = inside_by_winding(wrap, wrap.triangles, grid_);
        // Farther than one voxel from the outside: neither a voxel nor one beside it is
        // out. The wrap leaves the border's outermost voxels free.
        static_assert(kOffset == 1.0);
        Flags deep(size());
        const std::size_t nx = idx(counts().x()), plane = nx * idx(counts().y());
        parallel_for_each_set(inside,
                              [&](std::size_t at)
                              {
                                  if (inside[at - 1] && inside[at + 1] &&
                                      inside[at - nx] && inside[at + nx] &&
                                      inside[at - plane] && inside[at + plane])
                                      deep[at] = 1;
                              });
        return deep;
    }

private:
    static GridShape shape_of(const Eigen::Vector3i& inner)
    {
        GridShape shape;
        shape.coarsest = (inner.array() + 2 * kBorder).matrix();
        shape.size = shape.coarsest.cast<double>();
        shape.voxels_per_leaf = 1;
        return shape;
    }

    const VoxelGrid& inner_;
    VoxelGrid grid_;
    Flags marks_;
    std::optional<NearDistances> room_;
    std::vector<Eigen::Vector3d> points_;
    std::vector<Eigen::Vector3d> thin_points_; ///< one of every eight voxels, at the most
};

/// Whether a hollow that \p widest encloses could be closed by \p radius and is not yet
/// in \p hollow.
bool is_any_left(const Lattice& lattice, const Flags& widest, const Flags& hollow,
                 double radius)
{
    constexpr std::size_t kAtOnce = 1 << 16;
    bool is_any = false;
    for (std::size_t begin = 0; begin < widest.size() && !is_any; begin += kAtOnce)
        for_each_set(widest, begin, std::min(widest.size(), begin + kAtOnce),
                     [&](std::size_t i) {
                         is_any = is_any || (!hollow[i] &&
                                             lattice.room().is_beyond(i, kRoom * radius));
                     });
    return is_any;
}

/// Whose a voxel is while the wrap is shared out.
enum class Side : std::uint8_t
{
    Outside, ///< from the beginning
    Nobody,  ///< enclosed, and not reached yet
    Hollow,
    TakenByOutside,
    Mark
};

/// Adds to \p hollow what of \p enclosed falls to places of enough room in it. Returns
/// whether there was any.
bool add_hollows(const Lattice& lattice, const Flags& enclosed, double radius,
                 Flags& hollow)
{
    const NearDistances& room = lattice.room();
    VoxelValues<Side> side(hollow.size());
    // The level of a voxel's room, for a flood from the roomiest places down.
    const std::size_t num_levels = static_cast<std::size_t>(2.0 * kRoom * radius) + 1;
    const auto level_of = [&](std::size_t voxel)
    {
        return room.is_far(voxel)
                   ? num_levels - 1
                   : std::min(
                         static_cast<std::size_t>(
                             2.0f * std::sqrt(static_cast<float>(room.squared(voxel)))),
                         num_levels - 1);
    };
    // Two of each level: the hollow goes first.
    std::vector<std::vector<std::size_t>> stacks(2 * num_levels);
    const auto push = [&](std::size_t voxel, std::size_t level)
    {
        const std::size_t there = std::min(level, level_of(voxel));
        stacks[2 * there + (side[voxel] == Side::Hollow)].push_back(voxel);
    };
    bool has_any = false;
    for_each_set(enclosed,
                 [&](std::size_t i)
                 {
                     const bool is_hollow =
                         !hollow[i] && room.is_beyond(i, kRoom * radius);
                     side[i] = is_hollow            ? Side::Hollow
                               : lattice.is_mark(i) ? Side::Mark
                                                    : Side::Nobody;
                     has_any = has_any || is_hollow;
                 });
    if (!has_any)
        return false;
    const std::size_t nx = idx(lattice.counts().x());
    const std::size_t stride[3] = {1, nx, nx * idx(lattice.counts().y())};
    // The flood begins where a voxel that is nobody's yet has a neighbour that is
    // somebody's. What is enclosed keeps away from the border of the lattice.
    for_each_set(side,
                 [&](std::size_t i)
                 {
                     if (side[i] != Side::Nobody)
                         return;
                     for (const std::size_t step : stride)
                         for (const std::size_t next : {i - step, i + step})
                             if (side[next] == Side::Hollow ||
                                 (side[next] == Side::Outside && !lattice.is_mark(next)))
                                 push(next, num_levels - 1);
                 });
    for (std::size_t at = stacks.size(); at-- > 0;)
        while (!stacks[at].empty())
        {
            const std::size_t voxel = stacks[at].back();
            stacks[at].pop_back();
            const Side taken =
                side[voxel] == Side::Hollow ? Side::Hollow : Side::TakenByOutside;
            for (const std::size_t step : stride)
                for (const std::size_t next : {voxel - step, voxel + step})
                    // Below the first voxel the subtraction wraps around.
                    if (next < side.size() && side[next] == Side::Nobody)
                    {
                        side[next] = taken;
                        push(next, at / 2);
                    }
        }
    for_each_set(side,
                 [&](std::size_t i)
                 {
                     if (side[i] == Side::Hollow)
                         hollow[i] = 1;
                 });
    return true;
}

/// The radii of the balls that are tried, from the narrowest opening to the widest.
std::vector<double> radii_between(const Openings& openings)
{
    std::vector<double> radii;
    for (double radius = openings.narrowest; radius < openings.widest * kRadiusStep;
         radius *= kRadiusStep)
        radii.push_back(std::min(radius, openings.widest));
    return radii;
}

/// What wraps of several radii enclose, each found when it is asked for; the next one is
/// found beside it, on another thread, for the library wraps on one.
class Wraps
{
public:
    Wraps(const Lattice& lattice, std::vector<double> radii)
        : lattice_(lattice), radii_(std::move(radii)), enclosed_(radii_.size())
    {
    }
    /// Of radius \p k: to be asked in ascending order. Those before it are given back.
    const Flags& enclosed(std::size_t k)
    {
        for (std::size_t i = 0; i < k; ++i)
            enclosed_[i].reset();
        if (!enclosed_[k])
            parallel_for(std::min<std::size_t>(2, radii_.size() - k), 1,
                         [&](std::size_t i)
                         { enclosed_[k + i] = lattice_.enclosed(radii_[k + i]); });
        return *enclosed_[k];
    }

private:
    const Lattice& lattice_;
    std::vector<double> radii_;
    std::vector<std::optional<Flags>> enclosed_;
};

/// Of \p radii those from the first on at which larger voxels show room for a hollow;
/// none where not even the widest does.
std::span<const double> radii_worth_trying(const VoxelGrid& grid, const Flags& marks,
                                           const Openings& openings,
                                           std::span<const double> radii)
{
    const int scale = std::max(1, static_cast<int>(openings.narrowest / kCoarseRadius));
    if (scale == 1)
        return radii;
    GridShape shape;
    shape.coarsest = (grid.counts().array() + scale - 1) / scale;
    shape.size = shape.coarsest.cast<double>();
    shape.voxels_per_leaf = 1;
    const VoxelGrid coarse(shape);
    Flags coarse_marks(coarse.size());
    for_each_set(marks, [&](std::size_t i)
                 { coarse_marks[coarse.index(grid.coordinates(i) / scale)] = 1; });
    const Lattice lattice(coarse, coarse_marks, kRoom * openings.widest / scale);
    const Flags none(lattice.size());
    const auto shows_room = [&](const Flags& enclosed, double radius)
    { return is_any_left(lattice, enclosed, none, kCoarseRoom * radius / scale); };
    std::vector<double> coarse_radii{openings.widest / scale};
    for (const double radius : radii.first(radii.size() - 1))
        coarse_radii.push_back(radius / scale);
    Wraps wraps(lattice, coarse_radii);
    if (!shows_room(wraps.enclosed(0), openings.narrowest))
        return {};
    std::size_t first = 0;
    while (first + 1 < radii.size() &&
           !shows_room(wraps.enclosed(first + 1), radii[first]))
        ++first;
    return radii.subspan(first);
}

} // namespace

EnclosedVoxels hollow_voxels(const VoxelGrid& grid, const Flags& marks,
                             const Openings& openings,
                             const std::function<bool(std::size_t)>& may_fill)
{
    EnclosedVoxels found{-1.0, Flags(grid.size())};
    if (!has_alpha_wrap())
        return found;
    const std::vector<double> all_radii = radii_between(openings);
    const std::span<const double> radii =
        radii_worth_trying(grid, marks, openings, all_radii);
    if (radii.empty())
        return found;
    const Lattice lattice(grid, marks, kRoom * openings.widest);
    std::vector<double> narrower{openings.widest};
    for (const double radius : radii)
        if (radius < openings.widest)
            narrower.push_back(radius);
    Wraps wraps(lattice, narrower);
    const Flags widest = wraps.enclosed(0);
    Flags hollow(lattice.size());
    double closed = -1.0;
    for (std::size_t k = 0; k < radii.size(); ++k)
    {
        const double alpha = radii[k];
        if (!is_any_left(lattice, widest, hollow, alpha))
            break;
        if (add_hollows(lattice, alpha < openings.widest ? wraps.enclosed(k + 1) : widest,
                        alpha, hollow))
            closed = alpha;
    }
    if (closed < 0)
        return found;
    for_each_set(hollow,
                 [&](std::size_t at)
                 {
                     const Eigen::Vector3i place = lattice.in_inner_grid(at);
                     const std::size_t i = grid.index(place);
                     if (!grid.contains(place) || !may_fill(i))
                         return;
                     found.is_inside[i] = 1;
                     found.radius = closed;
                 });
    return found;
}

} // namespace cellwarp
