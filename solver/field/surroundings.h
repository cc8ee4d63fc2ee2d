// SPDX-License-Identifier: GPL-3.0-or-later
// What a field looks up once for all points in a box: the cells that may count there, and
// the nodes of regions. A field that is asked for many points, a few at a time, keeps it
// for each octant of its cells.
#pragma once

#include <atomic>
#include <cstddef>
#include <memory>
#include <vector>

#include "solver/field/place_lanes.h"
#include "solver/field/region_fade.h"

namespace cellwarp
{

struct Surroundings
{
    CellsAround cells;
    NearNodesOfRegions nodes;
    std::size_t num_bytes() const;
};

/// The octants of a box; bit k of a number says that it is the upper half along axis k.
inline constexpr std::size_t kOctants = 8;

/// One for each octant of each cell, made when it is first asked for. Safe for many
/// threads.
class KeptSurroundings
{
public:
    /// No more of them are kept when all take \p max_bytes.
    KeptSurroundings(std::size_t num_cells, std::size_t max_bytes);
    ~KeptSurroundings();
    KeptSurroundings(const KeptSurroundings&) = delete;
    KeptSurroundings& operator=(const KeptSurroundings&) = delete;

    /// Counts points before they are looked at; false: so far they are too few for the
    /// octants.
    bool expect(std::size_t num_points)
    {
        return (num_points_ += num_points) >= kOctants * num_cells_;
    }
    /// The octant's; if there are none and no room is left, null. \p make() makes them.
    template <class Make>
    const Surroundings* get(int cell, std::size_t octant, const Make& make)
    {
        if (kept_.empty())
            return nullptr;
        std::atomic<const Surroundings*>& place = kept_[kOctants * idx(cell) + octant];
        const Surroundings* const known = place.load(std::memory_order_acquire);
        if (known || bytes_left_.load(std::memory_order_relaxed) <= 0)
            return known;
        return keep(place, std::make_unique<const Surroundings>(make()));
    }

private:
    const Surroundings* keep(std::atomic<const Surroundings*>& place,
                             std::unique_ptr<const Surroundings> made);

    std::size_t num_cells_;
    std::atomic<std::size_t> num_points_ = 0;
    std::vector<std::atomic<const Surroundings*>> kept_; ///< empty: there is no room
    std::atomic<std::ptrdiff_t> bytes_left_ = 0;
};

} // namespace cellwarp
