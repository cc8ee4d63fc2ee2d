// SPDX-License-Identifier: GPL-3.0-or-later
// The thread behind a handle in the hand: frame after frame with the newest place, and
// smaller cells while the hand rests. For display only.
#pragma once

#include <cstdint>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "library/session/prepared_drag.h"
#include "library/session/shape.h"

namespace cellwarp::core
{

/// How the last frames of a drag went.
struct DragStatus
{
    bool is_dragging = false;
    double solve_ms = 0.0, blend_ms = 0.0;
    double latency_ms = 0.0;  ///< from the hand's move to the finished frame
    std::uint64_t frames = 0; ///< finished, in this drag
    std::size_t cells = 0;
    std::string error; ///< why no more frames come; empty: they do
};

/// The same drag in smaller cells, when it is done; nothing where they are not wanted.
using Refining = std::future<std::optional<PreparedDrag>>;

class LiveDrag
{
public:
    /// Starts where the drag stands. A frame allocates nothing but at a change of cells.
    explicit LiveDrag(PreparedDrag prepared);
    /// Ends at once but for the frame under way.
    ~LiveDrag();
    LiveDrag(const LiveDrag&) = delete;
    LiveDrag& operator=(const LiveDrag&) = delete;

    /// The newest motions of the regions, from rest, and what holds their rods and curves
    /// (empty for others); older ones that no frame has been made of are forgotten.
    void move(std::vector<Motion> motions, std::vector<SplineHolds> holds = {});
    /// Whether frames come with their cells.
    void show_cells(bool shows);
    /// The newest finished frame, if there is one that was not taken; swaps buffers.
    /// \p cells: untouched where cells are not shown.
    bool take(ShownShape& shape, ShownCells& cells);
    DragStatus status() const;
    /// Ends, and gives the drag back for the next time; nothing where a frame failed.
    std::optional<PreparedDrag> stop();
    /// What was being made in the background at stop(), told to end too; whoever has it
    /// waits.
    Refining take_refining();

private:
    struct State;
    std::unique_ptr<State> state_;
};

} // namespace cellwarp::core
