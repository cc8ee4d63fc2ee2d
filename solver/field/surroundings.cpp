// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/field/surroundings.h"

namespace cellwarp::core
{

std::size_t Surroundings::num_bytes() const
{
    return sizeof(*this) + cells.num_bytes() + nodes.num_bytes();
}

KeptSurroundings::KeptSurroundings(std::size_t num_cells, std::size_t max_bytes)
    : num_cells_(num_cells)
{
    const std::size_t bytes = kParts * num_cells * sizeof(const Surroundings*);
    if (2 * bytes > max_bytes)
        return;
    kept_ = std::vector<std::atomic<const Surroundings*>>(kParts * num_cells);
    bytes_left_ = static_cast<std::ptrdiff_t>(max_bytes - bytes);
}

KeptSurroundings::~KeptSurroundings()
{
    for (const std::atomic<const Surroundings*>& place : kept_)
        delete place.load(std::memory_order_relaxed);
}

const Surroundings* KeptSurroundings::keep(std::atomic<const Surroundings*>& place,
                                           std::unique_ptr<const Surroundings> made)
{
    const Surroundings* known = nullptr;
    // Where another thread was first, its own are the same.
    if (!place.compare_exchange_strong(known, made.get(), std::memory_order_acq_rel))
        return known;
    bytes_left_ -= static_cast<std::ptrdiff_t>(made->num_bytes());
    return made.release();
}

} // namespace cellwarp::core
