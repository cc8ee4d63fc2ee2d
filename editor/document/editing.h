// SPDX-License-Identifier: GPL-3.0-or-later
// A document with the threads that solve behind it: what is seen while a handle is in the
// hand is for display only; on release the edit is solved as a replay of the file would.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "editor/document/document.h"
#include "editor/document/shape.h"
#include "editor/session/session.h"

namespace cellwarp
{

/// What the solve thread is doing, and what it did last.
struct SolveStatus
{
    enum class State
    {
        Idle,      ///< the result of the document is there
        Preparing, ///< material, cells
        Solving,
        Field, ///< release field
        Failed ///< see error
    };
    State state = State::Idle;
    FrameProgress progress;   ///< while Solving
    double seconds = 0.0;     ///< since it began, or what it took
    std::string error;        ///< in words; of the last attempt
    std::string error_region; ///< that it concerns, if it is one
    std::vector<std::string> warnings;

    // Of the last result.
    std::optional<FrameReport> report; ///< of the last frame
    std::size_t cells = 0, free_cells = 0, centres = 0, clusters = 0;
    std::vector<int> cells_per_depth;
    int across = 0;
    double energy = 0.0, max_gap = 0.0, diagonal = 0.0;
    std::string inside; ///< how the inside was found
    /// Energy against seconds of the last solve.
    std::vector<std::pair<double, double>> energy_curve;
};

/// How the last frames of a drag went.
struct DragStatus
{
    bool is_dragging = false;
    double solve_ms = 0.0, blend_ms = 0.0, latency_ms = 0.0; ///< of the newest frame
    std::uint64_t frames = 0;                                ///< finished, in this drag
};

class Editing
{
public:
    explicit Editing(Document document);
    ~Editing();
    Editing(const Editing&) = delete;
    Editing& operator=(const Editing&) = delete;

    /// Change it only between begin_drag() and end_drag()'s pairs.
    Document& document();
    const Document& document() const;

    /// Takes what the threads have finished and hands them what the document asks for. To
    /// be called once a drawn frame. True if there is something new to see.
    bool update();
    /// Until the result of the document is there, or has failed. For tests and scripts.
    void wait();
    /// Gives the solve up that is under way; the document stays.
    void cancel();

    /// View space: model axes, the rest model's box centred at 0, scaled by a power of
    /// two to a longest side of 1 at the most.
    const WorkFrame& view_frame() const;

    const ShownShape& shape() const;      ///< the newest
    const ShownShape& rest_shape() const; ///< of the model as it was opened
    const ShownCells& cells() const;
    /// Of the document, at full precision: what export writes. Null while it is not
    /// there.
    std::shared_ptr<const Patch> result() const;
    SolveStatus status() const;
    DragStatus drag_status() const;

    /// Takes a region into the hand; false (with a reason in \p why) where it cannot
    /// move.
    bool begin_drag(const std::string& region, std::string* why = nullptr);
    /// Newer places replace older ones that were not shown yet. A place that is not
    /// finite is left out.
    void drag_to(const Placement& placement);
    /// Lets go: one edit. Without a change, none.
    void end_drag();
    void cancel_drag();
    std::optional<std::string> dragged() const;

    /// Writes the deformed model, or the field. Throws Error; Fault::Usage while the
    /// result is not there.
    void export_model(const std::string& path, bool overwrites);
    void export_field(const std::string& path, bool overwrites);

private:
    struct State;
    std::unique_ptr<State> state_;
};

} // namespace cellwarp
