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
// that it is tried on a grid of larger voxels, which takes a tenth of the time and is
// enough for most shapes that have no hollow: open sheets.
#include "octree/hollows.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
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

/// Free voxels around the grid: the wrap and what lies just outside of it fit in.
constexpr int kBorder = 4;

using Flags = std::vector<std::uint8_t>;

/// The marks of a grid with a border, one unit a voxel.
class Lattice
{
public:
    Lattice(const VoxelGrid& grid, const std::vector<std::uint8_t>& marks)
        : inner_(grid), grid_(shape_of(grid.counts())), marks_(grid_.size(), 0)
    {
        for (std::size_t i = 0; i < inner_.size(); ++i)
            if (marks[i])
            {
                marks_[of(i)] = 1;
                points_.push_back((grid.coordinates(i).array() + kBorder).cast<double>() +
                                  0.5);
            }
        room_ = squared_distances(marks_, grid_.counts());
    }

    const VoxelGrid& grid() const { return grid_; }
    const Eigen::Vector3i& counts() const { return grid_.counts(); }
    std::size_t size() const { return marks_.size(); }
    /// Squared distance from the marks [voxel^2].
    const std::vector<float>& room() const { return room_; }

    /// The place of a voxel of the inner grid.
    std::size_t of(std::size_t voxel) const
    {
        return grid_.index((inner_.coordinates(voxel).array() + kBorder).matrix().eval());
    }

    /// What lies inside a wrap, its offset taken off.
    Flags enclosed(double alpha) const
    {
        const Shape wrap = alpha_wrap(points_, alpha, kOffset);
        const Flags inside = inside_by_winding(wrap, wrap.triangles, grid_);
        // Farther than one voxel from the outside: neither a voxel nor one beside it is
        // out. The wrap leaves the border's outermost voxels free.
        static_assert(kOffset == 1.0);
        Flags deep(size(), 0);
        const std::size_t nx = idx(counts().x()), ny = idx(counts().y()),
                          nz = idx(counts().z());
        parallel_for(nz - 2,
                     [&](std::size_t plane)
                     {
                         for (std::size_t j = 1; j + 1 < ny; ++j)
                             for (std::size_t i = 1; i + 1 < nx; ++i)
                             {
                                 const std::size_t at = ((plane + 1) * ny + j) * nx + i;
                                 deep[at] = inside[at] & inside[at - 1] & inside[at + 1] &
                                            inside[at - nx] & inside[at + nx] &
                                            inside[at - nx * ny] & inside[at + nx * ny];
                             }
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
    std::vector<float> room_;
    std::vector<Eigen::Vector3d> points_;
};

bool has_room(float room, double radius)
{
    return room > static_cast<float>(radius * radius);
}

/// Whether a hollow that \p widest encloses could be closed by \p radius and is not yet
/// in \p hollow.
bool is_any_left(const Lattice& lattice, const Flags& widest, const Flags& hollow,
                 double radius)
{
    for (std::size_t i = 0; i < widest.size(); ++i)
        if (widest[i] && !hollow[i] && has_room(lattice.room()[i], kRoom * radius))
            return true;
    return false;
}

/// Whose a free voxel is.
enum class Side : std::uint8_t
{
    None,
    Hollow,
    Outside
};

/// The level of a voxel's room, for a flood from the roomiest places down.
std::size_t level_of(float room, std::size_t num_levels)
{
    return std::min(static_cast<std::size_t>(2.0f * std::sqrt(room)), num_levels - 1);
}

/// Adds to \p hollow what of \p enclosed falls to places of enough room in it. Returns
/// whether there was any.
bool add_hollows(const Lattice& lattice, const Flags& enclosed, double radius,
                 Flags& hollow)
{
    const std::vector<float>& room = lattice.room();
    std::vector<Side> side(hollow.size(), Side::None);
    const std::size_t num_levels = static_cast<std::size_t>(2.0 * kRoom * radius) + 1;
    // Two of each level: the hollow goes first.
    std::vector<std::vector<std::size_t>> stacks(2 * num_levels);
    const auto push = [&](std::size_t voxel, std::size_t level)
    {
        const std::size_t there = std::min(level, level_of(room[voxel], num_levels));
        stacks[2 * there + (side[voxel] == Side::Hollow)].push_back(voxel);
    };
    bool has_any = false;
    for (std::size_t i = 0; i < hollow.size(); ++i)
    {
        if (!enclosed[i])
            side[i] = Side::Outside;
        else if (!hollow[i] && has_room(room[i], kRoom * radius))
            side[i] = Side::Hollow;
        else
            continue;
        has_any = has_any || side[i] == Side::Hollow;
    }
    if (!has_any)
        return false;
    const std::size_t nx = idx(lattice.counts().x());
    const std::size_t stride[3] = {1, nx, nx * idx(lattice.counts().y())};
    // The flood begins where a side has a neighbour that is nobody's yet.
    const auto may_go_on = [&](std::size_t voxel)
    {
        for (const std::size_t step : stride)
            for (const std::size_t next : {voxel - step, voxel + step})
                if (next < side.size() && side[next] == Side::None)
                    return true;
        return false;
    };
    for (std::size_t i = 0; i < side.size(); ++i)
        if (side[i] != Side::None && room[i] > 0 && may_go_on(i))
            push(i, num_levels - 1);
    for (std::size_t at = stacks.size(); at-- > 0;)
        while (!stacks[at].empty())
        {
            const std::size_t voxel = stacks[at].back();
            stacks[at].pop_back();
            for (const std::size_t step : stride)
                for (const std::size_t next : {voxel - step, voxel + step})
                    // Below the first voxel the subtraction wraps around.
                    if (next < side.size() && side[next] == Side::None && room[next] > 0)
                    {
                        side[next] = side[voxel];
                        push(next, at / 2);
                    }
        }
    for (std::size_t i = 0; i < hollow.size(); ++i)
        hollow[i] = hollow[i] || side[i] == Side::Hollow;
    return true;
}

/// Whether larger voxels show room for a hollow.
bool may_have_hollows(const VoxelGrid& grid, const Flags& marks, const Openings& openings)
{
    const int scale = std::max(1, static_cast<int>(openings.narrowest / kCoarseRadius));
    if (scale == 1)
        return true;
    GridShape shape;
    shape.coarsest = (grid.counts().array() + scale - 1) / scale;
    shape.size = shape.coarsest.cast<double>();
    shape.voxels_per_leaf = 1;
    const VoxelGrid coarse(shape);
    Flags coarse_marks(coarse.size(), 0);
    for (std::size_t i = 0; i < marks.size(); ++i)
        if (marks[i])
            coarse_marks[coarse.index(grid.coordinates(i) / scale)] = 1;
    const Lattice lattice(coarse, coarse_marks);
    return is_any_left(lattice, lattice.enclosed(openings.widest / scale),
                       Flags(lattice.size(), 0),
                       kCoarseRoom * openings.narrowest / scale);
}

} // namespace

EnclosedVoxels hollow_voxels(const VoxelGrid& grid,
                             const std::vector<std::uint8_t>& marks,
                             const Openings& openings,
                             const std::function<bool(std::size_t)>& may_fill)
{
    EnclosedVoxels found{-1.0, std::vector<std::uint8_t>(grid.size(), 0)};
    if (!has_alpha_wrap())
        return found;
    if (!may_have_hollows(grid, marks, openings))
        return found;
    const Lattice lattice(grid, marks);
    const Flags widest = lattice.enclosed(openings.widest);
    Flags hollow(lattice.size(), 0);
    double closed = -1.0;
    for (double radius = openings.narrowest;
         radius < openings.widest * kRadiusStep &&
         is_any_left(lattice, widest, hollow, std::min(radius, openings.widest));
         radius *= kRadiusStep)
    {
        const double alpha = std::min(radius, openings.widest);
        if (add_hollows(lattice,
                        alpha < openings.widest ? lattice.enclosed(alpha) : widest, alpha,
                        hollow))
            closed = alpha;
    }
    if (closed < 0)
        return found;
    for (std::size_t i = 0; i < grid.size(); ++i)
        if (hollow[lattice.of(i)] && may_fill(i))
        {
            found.is_inside[i] = 1;
            found.radius = closed;
        }
    return found;
}

} // namespace cellwarp
