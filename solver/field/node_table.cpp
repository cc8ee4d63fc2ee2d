// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/field/node_table.h"

#include <bit>
#include <limits>
#include <utility>

#include "octree/base/hash.h"
#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

constexpr std::uint32_t kEmpty = std::numeric_limits<std::uint32_t>::max();

/// Most places that are looked for have no node: they are to end at an empty slot.
constexpr std::size_t kSlotsANode = 4;

} // namespace

NodeTable::NodeTable(std::vector<Node> nodes) : nodes_(std::move(nodes))
{
    if (nodes_.empty())
        return;
    slots_.assign(std::bit_ceil(kSlotsANode * nodes_.size()), kEmpty);
    for (std::size_t i = 0; i < nodes_.size(); ++i)
    {
        std::uint32_t& slot = slots_[slot_of(*nodes_[i].place)];
        if (slot == kEmpty)
            slot = static_cast<std::uint32_t>(i);
        else if (nodes_[slot].cell != nodes_[i].cell)
            nodes_[slot].cell = kNotFound;
    }
}

/// The one of the node at this place, or the empty one where it would be.
std::size_t NodeTable::slot_of(const Eigen::Vector3d& place) const
{
    const std::size_t mask = slots_.size() - 1;
    std::size_t slot = static_cast<std::size_t>(hash_of(place)) & mask;
    while (slots_[slot] != kEmpty && *nodes_[slots_[slot]].place != place)
        slot = (slot + 1) & mask;
    return slot;
}

int NodeTable::region_at(const Eigen::Vector3d& place, int cell) const
{
    if (slots_.empty())
        return -1;
    const std::uint32_t node = slots_[slot_of(place)];
    return node != kEmpty && nodes_[node].cell == cell ? nodes_[node].region : -1;
}

} // namespace cellwarp::core
