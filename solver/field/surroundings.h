// SPDX-License-Identifier: GPL-3.0-or-later
// What a field looks up once for all points in a box: the cells that may count there, and
// the nodes of regions. A field that is asked for many points, a few at a time, keeps it
// for the box of each of its cells, and for the octants of that box.
#pragma once

#include <atomic>
#include <cstddef>
#include <memory>
#include <vector>

#include "solver/field/place_lanes.h"
#include "solver/field/region_fade.h"

namespace cellwarp::core
{

struct Surroundings
{
    CellsAround cells;
    NearNodesOfRegions nodes;
    std::size_t num_bytes() const;
};

/// The octants of a box; bit k of a number says that it is the upper half along axis k.
inline constexpr std::size_t kOctants = 8;
/// In place of the number of an octant: the whole box.
inline constexpr std::size_t kWholeBox = kOctants;

/// One for each box and octant, made when it is first asked for. Safe for many threads.
class KeptSurroundings
{
public:
    /// No more of them are kept when all take \p max_bytes.
    KeptSurroundings(std::size_t num_cells, std::size_t max_bytes);
    ~KeptSurroundings();
    KeptSurroundings(const KeptSurroundings&) = delete;
    KeptSurroundings& operator=(const KeptSurroundings&) = delete;

    /// Counts points before they are looked at; false: so far they are too few to keep
    /// anything.
    bool expect(std::size_t num_points)
    {
        return (num_points_ += num_points) >= kLeastPoints * kOctants * num_cells_;
    }
    /// Those of an octant of a cell, or of its whole box, made by \p make() if they are
    /// not there yet. Null: they are not there, and no room is left.
    template <class Make>
    const Surroundings* get(int cell, std::size_t part, const Make& make)
    {
        if (kept_.empty())
            return nullptr;
        std::atomic<const Surroundings*>& place = kept_[kParts * idx(cell) + part];
        const Surroundings* const known = place.load(std::memory_order_acquire);
        if (known || bytes_left_.load(std::memory_order_relaxed) <= 0)
            return known;
        return keep(place, std::make_unique<const Surroundings>(make()));
    }

private:
    static constexpr std::size_t kParts = kOctants + 1; ///< of a cell
    /// Points of an octant, on an average, that are worth it.
    static constexpr std::size_t kLeastPoints = 4;

    const Surroundings* keep(std::atomic<const Surroundings*>& place,
                             std::unique_ptr<const Surroundings> made);

    std::size_t num_cells_;
    std::atomic<std::size_t> num_points_ = 0;
    std::vector<std::atomic<const Surroundings*>> kept_; ///< empty: there is no room
    std::atomic<std::ptrdiff_t> bytes_left_ = 0;
};

} // namespace cellwarp::core
