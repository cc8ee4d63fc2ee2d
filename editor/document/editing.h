// SPDX-License-Identifier: GPL-3.0-or-later
// A document with the threads that solve behind it: what is seen while a handle is in the
// hand is for display only; on release the edit is solved as a replay of the file would.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "editor/document/document.h"
#include "editor/document/field_export.h"
#include "editor/document/solve_worker.h"
#include "library/session/live_drag.h"
#include "library/session/shape.h"

namespace cellwarp::core
{

/// What came of a centre line.
struct DrawnLine
{
    std::string name;  ///< of the rod
    std::string error; ///< why there is none; empty: there is
};

class Editing
{
public:
    explicit Editing(Document document);
    ~Editing();
    Editing(const Editing&) = delete;
    Editing& operator=(const Editing&) = delete;

    /// A command that changes the result ends a drag, which then leaves no edit.
    Document& document();
    const Document& document() const;

    /// Takes what the threads have finished and hands them what the document asks for. To
    /// be called once a drawn frame. True if there is something new to see. Where it
    /// throws, for want of memory or threads, the next call goes on.
    bool update();
    /// Until the result of the document is there, has failed, or is not asked for. For
    /// tests and scripts.
    void wait_for_result();
    /// Further on until a drag could begin and no field is being written.
    void wait_for_drag();
    /// Further on until there is nothing more to say of the result.
    void wait();
    /// Gives the solve up that is under way; the document stays.
    void cancel();

    /// Asks for the result: where opening the document has not, and once more after it
    /// was given up, or failed.
    void solve();
    /// Nothing has asked for the result: the model is seen at rest, with its skeleton. A
    /// document is opened so that the keys of its scene move, and one in time, until an
    /// edit is begun: such scenes are played.
    bool is_unsolved() const;

    /// View space: model axes, the rest model's box from 0 on, scaled by a power of two
    /// to a longest side of 1 at the most.
    const WorkFrame& view_frame() const;

    const ShownShape& shape() const;      ///< the newest
    const ShownShape& rest_shape() const; ///< of the model as it was opened
    /// Of the shape, during a drag only where show_cells() asks for them.
    const ShownCells& cells() const;
    void show_cells(bool shows);
    /// Of the document, at full precision: what export writes. Null while it is not
    /// there.
    std::shared_ptr<const DeformedSamples> result() const;
    SolveStatus status() const;
    DragStatus drag_status() const;

    /// Takes a region into the hand; false (with a reason in \p why) where it cannot
    /// move. Where the cells are not ready yet the shape follows when they are.
    bool begin_drag(const std::string& region, std::string* why = nullptr);
    /// The same with a point of a rod or curve alone.
    bool begin_point_drag(const std::string& region, std::size_t point,
                          std::string* why = nullptr);
    void drag_point_to(const PointPlacement& to);
    /// Newer places replace older ones that were not shown yet. A place that is not
    /// finite is left out.
    void drag_to(const RigidMove& placement);
    /// Lets go: one edit. Without a change, none.
    void end_drag();
    void cancel_drag();
    std::optional<std::string> dragged() const;
    /// Where the region in the hand is; none while a point of it is, or nothing.
    std::optional<RigidMove> dragged_placement() const;

    /// A frame of a film is seen instead of the shape, and nothing can be taken into the
    /// hand; null: the shape again. \p deformed: the frame as a file holds it; null: it
    /// cannot be exported.
    void show_instead(std::shared_ptr<const ShownShape> frame,
                      std::shared_ptr<const DeformedSamples> deformed = nullptr);
    bool shows_film() const;

    /// Makes a rod of the centre line of the limb at some samples, or of the whole shape:
    /// in the background, one edit when it is there. \p near: empty for the longest line.
    void draw_centre_line(const std::vector<std::uint32_t>& near);
    bool is_drawing() const;
    /// What came of the last one, once.
    std::optional<DrawnLine> take_drawn();

    /// Why what is seen can be written to no file now; empty: it can.
    std::string why_no_export() const;
    /// Writes the model as it is seen: as it is edited, or the frame of a film. Throws
    /// Error; Fault::Usage with why_no_export().
    void export_model(const std::string& path, Overwrite overwrite);
    /// Why the field of what is seen cannot be written now; empty: it can be tried.
    std::string why_no_field_export() const;
    /// Begins to write the field of all stages, for `cellwarp apply`; the whole document
    /// is replayed for it, in a thread of its own. Edits meanwhile do not change it; the
    /// end of this object cancels it. Throws Error for what is known at once, and while
    /// another one is written; the rest is told by export_status().
    void export_field(const std::string& path, Overwrite overwrite);
    void cancel_export();
    ExportStatus export_status() const; ///< of the last one

private:
    struct State;
    std::unique_ptr<State> state_;
};

} // namespace cellwarp::core
