// SPDX-License-Identifier: GPL-3.0-or-later
// What a ball of radius r from outside cannot come to lies behind openings narrower than
// it, or in a groove. But in a groove, which narrows inwards, no ball is larger than one
// that fits through its mouth. So where it cannot come and there is room for a ball
// clearly larger than r, a hollow begins.
//
// How far it reaches: what the ball does not come to is shared out between the hollows
// and the outside by a flood from both, through the roomiest places first. A voxel goes
// to the side from which the larger ball reaches it. So a hollow ends in the throat of
// its opening, and a groove outside stays outside, though samples leave gaps between the
// two.
//
// Radii are tried from the narrowest up; each adds the hollows that no smaller one
// closed.
#include "octree/hollows.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "octree/ball_flood.h"
#include "octree/base/index.h"
#include "octree/near_distances.h"

namespace cellwarp
{

namespace
{

/// How much larger than the ball that cannot enter is the largest one that fits inside.
constexpr double kRoom = 1.25;

/// From one radius to the next.
constexpr double kRadiusStep = 1.25;

/// The radii of the openings that are tried, from the narrowest to the widest.
std::vector<double> radii_between(const Openings& openings)
{
    const double widest = std::min<double>(openings.widest, BallFlood::kLargest - 1);
    std::vector<double> radii;
    for (double radius = openings.narrowest; radius < widest; radius *= kRadiusStep)
        radii.push_back(radius);
    radii.push_back(widest);
    return radii;
}

/// The ball that an opening keeps out: marks begin half a voxel before their middles.
int ball_of(double opening)
{
    return static_cast<int>(opening) + 1;
}

/// What a place must be away from all marks so that a hollow may begin there. Where the
/// ball does not fit at all it does not come to places outside either.
double room_of(double opening)
{
    return std::max<double>(kRoom * opening, ball_of(opening));
}

/// Of each radius whether there is a place with enough room that its ball cannot come to.
std::vector<char> show_room(const BallFlood& flood, const std::vector<double>& radii)
{
    std::vector<char> shows(radii.size(), 0);
    const auto add = [&](int reached, const auto& has_room)
    {
        for (std::size_t k = 0; k < radii.size(); ++k)
            if (!shows[k] && reached < ball_of(radii[k]) && has_room(room_of(radii[k])))
                shows[k] = 1;
    };
    flood.for_each(
        [&](int reached, int, std::size_t voxel)
        {
            add(reached, [&](double distance)
                { return flood.distances().is_beyond(voxel, distance); });
        },
        [&](int reached, std::size_t) { add(reached, [](double) { return true; }); });
    return shows;
}

/// Calls visit(place in the lattice, voxel of the grid) for the voxels of the grid that
/// are not 0 in \p set, which tells of the lattice.
template <class Visit>
void for_each_in_grid(const VoxelGrid& grid, const PaddedMarks& lattice,
                      const VoxelFlags& set, Visit&& visit)
{
    const std::size_t nx = idx(grid.counts().x());
    for (int k = 0; k < grid.counts().z(); ++k)
        for (int j = 0; j < grid.counts().y(); ++j)
        {
            const std::size_t row = grid.index(0, j, k), from = lattice.at({0, j, k});
            for_each_set(set, from, from + nx,
                         [&](std::size_t place) { visit(place, row + (place - from)); });
        }
}

/// Whose a voxel is while what the ball does not come to is shared out.
enum class Side : std::uint8_t
{
    Outside, ///< from the beginning: the border of the lattice, too
    Nobody,  ///< not reached yet
    Hollow,
    TakenByOutside,
    Mark
};

/// Writes \p number into \p hollow for what falls to places of enough room that the ball
/// of an opening does not come to.
void add_hollows(const VoxelGrid& grid, const BallFlood& flood, double opening,
                 std::uint8_t number, VoxelFlags& hollow)
{
    const NearDistances& room = flood.distances();
    const PaddedMarks& lattice = flood.lattice();
    VoxelValues<Side> side(hollow.size());
    // The level of a voxel's room, for a flood from the roomiest places down: half
    // voxels, up to the room of a hollow.
    const double most = room_of(opening);
    const std::size_t num_levels = static_cast<std::size_t>(2.0 * most) + 1;
    std::vector<std::uint16_t> level_at; // of each squared distance
    for (std::uint32_t squared = 0; squared <= most * most; ++squared)
        level_at.push_back(static_cast<std::uint16_t>(2.0 * std::sqrt(squared)));
    const auto level_of = [&](std::size_t voxel)
    {
        const std::uint32_t squared =
            room.is_far(voxel) ? UINT32_MAX : room.squared(voxel);
        return squared < level_at.size() ? level_at[squared] : num_levels - 1;
    };
    // Of each level: of the hollows and of the outside. Both go on by one voxel in turn,
    // so that of voxels as roomy neither runs along the other's side of the surface.
    std::vector<std::array<std::vector<std::size_t>, 2>> fronts(num_levels);
    const auto push = [&](std::size_t voxel, std::size_t level)
    {
        const std::size_t there = std::min(level, level_of(voxel));
        fronts[there][side[voxel] == Side::Hollow ? 0 : 1].push_back(voxel);
    };
    bool has_any = false;
    for_each_in_grid(grid, lattice, flood.dry(ball_of(opening)),
                     [&](std::size_t place, std::size_t)
                     {
                         const bool is_hollow =
                             !hollow[place] && room.is_beyond(place, most);
                         side[place] = is_hollow                ? Side::Hollow
                                       : lattice.marks()[place] ? Side::Mark
                                                                : Side::Nobody;
                         has_any = has_any || is_hollow;
                     });
    if (!has_any)
        return;
    const std::size_t nx = idx(lattice.counts().x());
    const std::size_t stride[3] = {1, nx, nx * idx(lattice.counts().y())};
    // The flood begins where a voxel that is nobody's yet has a neighbour that is
    // somebody's.
    for_each_set(side,
                 [&](std::size_t i)
                 {
                     if (side[i] != Side::Nobody)
                         return;
                     for (const std::size_t step : stride)
                         for (const std::size_t next : {i - step, i + step})
                             if (side[next] == Side::Hollow ||
                                 side[next] == Side::Outside)
                                 push(next, num_levels - 1);
                 });
    std::vector<std::size_t> front;
    for (std::size_t level = num_levels; level-- > 0;)
        while (!fronts[level][0].empty() || !fronts[level][1].empty())
            for (std::size_t of : {0u, 1u})
            {
                front.clear();
                front.swap(fronts[level][of]);
                for (const std::size_t voxel : front)
                    for (const std::size_t step : stride)
                        for (const std::size_t next : {voxel - step, voxel + step})
                            // Below the first voxel the subtraction wraps around.
                            if (next < side.size() && side[next] == Side::Nobody)
                            {
                                side[next] =
                                    of == 0 ? Side::Hollow : Side::TakenByOutside;
                                push(next, level);
                            }
            }
    for_each_set(side,
                 [&](std::size_t i)
                 {
                     if (side[i] == Side::Hollow)
                         hollow[i] = number;
                 });
}

} // namespace

Hollows hollow_voxels(const VoxelGrid& grid, const VoxelFlags& marks,
                      const Openings& openings,
                      const std::function<bool(std::size_t)>& may_fill)
{
    Hollows found{-1.0, VoxelFlags(grid.size())};
    const std::vector<double> radii = radii_between(openings);
    const BallFlood flood(grid, marks, ball_of(radii.back()), room_of(radii.back()));
    const std::vector<char> shows = show_room(flood, radii);
    VoxelFlags hollow(flood.lattice().marks().size()); // the number of its radius, from 1
    for (std::size_t k = 0; k < radii.size(); ++k)
        if (shows[k])
            add_hollows(grid, flood, radii[k], static_cast<std::uint8_t>(k + 1), hollow);
    for_each_in_grid(grid, flood.lattice(), hollow,
                     [&](std::size_t place, std::size_t voxel)
                     {
                         if (!may_fill(voxel))
                             return;
                         found.is_inside[voxel] = 1;
                         found.radius = std::max(found.radius, radii[hollow[place] - 1u]);
                     });
    return found;
}

} // namespace cellwarp
