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

namespace cellwarp::core
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

/// Of each radius whether there is a place with enough room that its ball cannot come to
/// and that no hollow has yet. A block that is far from all marks is in one as a whole.
std::vector<char> show_room(const BallFlood& flood, const std::vector<double>& radii,
                            const VoxelFlags& hollow)
{
    std::vector<char> shows(radii.size(), 0);
    const auto add = [&](int reached, std::size_t voxel, const auto& has_room)
    {
        if (hollow[voxel])
            return;
        for (std::size_t k = 0; k < radii.size(); ++k)
            if (!shows[k] && reached < ball_of(radii[k]) && has_room(room_of(radii[k])))
                shows[k] = 1;
    };
    flood.for_each(
        [&](int reached, int, std::size_t voxel)
        {
            add(reached, voxel,
                [&](double distance)
                { return flood.distances().is_beyond(voxel, distance); });
        },
        [&](int reached, std::size_t voxel, std::size_t)
        { add(reached, voxel, [](double) { return true; }); });
    return shows;
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

/// How roomy places are: distances from the marks in half voxels, up to a limit.
class RoomLevels
{
public:
    RoomLevels(const NearDistances& room, double limit)
        : room_(room), count_(static_cast<std::size_t>(2.0 * limit) + 1)
    {
        for (std::uint32_t squared = 0; squared <= limit * limit; ++squared)
            level_at_.push_back(static_cast<std::uint16_t>(2.0 * std::sqrt(squared)));
    }
    std::size_t count() const { return count_; }
    std::size_t of(std::size_t place) const
    {
        const std::uint32_t squared =
            room_.is_far(place) ? UINT32_MAX : room_.squared(place);
        return squared < level_at_.size() ? level_at_[squared] : count_ - 1;
    }

private:
    const NearDistances& room_;
    std::size_t count_;
    std::vector<std::uint16_t> level_at_; ///< of each squared distance
};

/// Shares out what is nobody's, by a flood from the roomiest places down. Both sides go
/// on by one voxel in turn, so that of voxels as roomy neither runs along the other's
/// side of the surface. What is nobody's keeps away from the border of the lattice.
void share_out(const Eigen::Vector3i& counts, const RoomLevels& levels,
               VoxelValues<Side>& side)
{
    std::vector<std::array<std::vector<std::size_t>, 2>> fronts(levels.count());
    const auto push = [&](std::size_t place, std::size_t level)
    {
        fronts[std::min(level, levels.of(place))][side[place] == Side::Hollow ? 0 : 1]
            .push_back(place);
    };
    const std::size_t nx = idx(counts.x());
    const std::size_t stride[3] = {1, nx, nx * idx(counts.y())};
    // It begins where somebody's voxel is beside one that is nobody's.
    for_each_set(side,
                 [&](std::size_t i)
                 {
                     if (side[i] != Side::Nobody)
                         return;
                     for (const std::size_t step : stride)
                         for (const std::size_t next : {i - step, i + step})
                             if (side[next] == Side::Hollow ||
                                 side[next] == Side::Outside)
                                 push(next, levels.count() - 1);
                 });
    std::vector<std::size_t> front;
    for (std::size_t level = levels.count(); level-- > 0;)
        while (!fronts[level][0].empty() || !fronts[level][1].empty())
            for (std::size_t of : {0u, 1u})
            {
                front.clear();
                front.swap(fronts[level][of]);
                for (const std::size_t place : front)
                    for (const std::size_t step : stride)
                        for (const std::size_t next : {place - step, place + step})
                            // Below the first voxel the subtraction wraps around.
                            if (next < side.size() && side[next] == Side::Nobody)
                            {
                                side[next] =
                                    of == 0 ? Side::Hollow : Side::TakenByOutside;
                                push(next, level);
                            }
            }
}

/// Writes \p number into \p hollow for what falls to places of enough room that the ball
/// of an opening does not come to.
void add_hollows(const BallFlood& flood, double opening, std::uint8_t number,
                 VoxelFlags& hollow)
{
    const PaddedMarks& lattice = flood.lattice();
    const double room = room_of(opening);
    VoxelValues<Side> side(hollow.size());
    bool has_any = false;
    lattice.for_each_in_grid(flood.dry(ball_of(opening)),
                             [&](std::size_t place, std::size_t)
                             {
                                 const bool is_hollow =
                                     !hollow[place] &&
                                     flood.distances().is_beyond(place, room);
                                 side[place] = is_hollow                ? Side::Hollow
                                               : lattice.marks()[place] ? Side::Mark
                                                                        : Side::Nobody;
                                 has_any = has_any || is_hollow;
                             });
    if (!has_any)
        return;
    share_out(lattice.counts(), RoomLevels(flood.distances(), room), side);
    for_each_set(side,
                 [&](std::size_t place)
                 {
                     if (side[place] == Side::Hollow)
                         hollow[place] = number;
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
    VoxelFlags hollow(flood.lattice().marks().size()); // the number of its radius, from 1
    std::vector<char> shows = show_room(flood, radii, hollow);
    for (std::size_t k = 0; k < radii.size(); ++k)
        if (shows[k])
        {
            add_hollows(flood, radii[k], static_cast<std::uint8_t>(k + 1), hollow);
            // What is filled by now is not filled again through wider openings.
            shows = show_room(flood, radii, hollow);
        }
    flood.lattice().for_each_in_grid(hollow,
                                     [&](std::size_t place, std::size_t voxel)
                                     {
                                         if (!may_fill(voxel))
                                             return;
                                         found.is_inside[voxel] = 1;
                                         found.radius = std::max(
                                             found.radius, radii[hollow[place] - 1u]);
                                     });
    return found;
}

} // namespace cellwarp::core
