// SPDX-License-Identifier: GPL-3.0-or-later
// Asks for the end of the work when it has been looked at so many times: stops
// everywhere.
#pragma once

#include <atomic>
#include <cstdint>

#include "octree/base/stop_scope.h"

namespace cellwarp::core::support
{

class CountedStop final : public StopScope
{
public:
    /// Stops at look number \p looks (from 0) and at all later ones.
    explicit CountedStop(std::int64_t looks) : looks_(looks) {}

    std::int64_t num_looks() const { return num_looks_; }

private:
    bool is_met() const override { return num_looks_++ >= looks_; }

    const std::int64_t looks_;
    mutable std::atomic<std::int64_t> num_looks_ = 0;
};

} // namespace cellwarp::core::support
