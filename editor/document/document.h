// SPDX-License-Identifier: GPL-3.0-or-later
// A model and what the user has done to it, edit by edit. What is kept is the edits, in a
// journal on the disk; all else follows from them. No window, no thread, no solving.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "editor/document/edit.h"
#include "editor/document/edited_region.h"
#include "editor/document/history.h"
#include "editor/document/selection.h"
#include "io/base/bytes.h"
#include "io/base/error.h"
#include "io/formats/geometry.h"
#include "io/scene/handle_file.h"
#include "io/scene/scene_file.h"
#include "library/session/work_frame.h"

namespace cellwarp::core
{

/// The part of a scene that is saved.
enum class SavedPart
{
    All,
    /// The poses without their times: what has its own time in the scene (the keys of its
    /// skeleton, its flesh, `simulate`) is left out.
    Poses
};

/// The fate of unsaved edits when a document is closed.
enum class Unsaved
{
    Undo, ///< they are undone, and can be done again the next time
    Keep  ///< the next time goes on with them
};

/// Thrown instead of overwriting what another program has written.
class ChangedOnDisk : public Error
{
public:
    using Error::Error;
};

class Document
{
public:
    /// Opens a model or a scene (*.json). Its journal goes into \p journal_folder (empty:
    /// nothing is kept on the disk). Throws Error; InUse "is open in another window (in
    /// use by PID)" if another process edits it.
    Document(const std::string& path, const std::string& journal_folder);
    ~Document();
    Document(Document&&) noexcept;
    Document& operator=(Document&&) noexcept;

    /// How many edits of an earlier run, which did not end well, can be recovered for
    /// this file; 0: none. While there are some no command is taken: first recover() or
    /// drop_recoverable().
    std::size_t num_recoverable() const;
    /// Does them again, from the file as it was then. Gives warnings: what was cut, what
    /// has changed since. Throws Fault::Malformed; then they are still there.
    std::vector<std::string> recover();
    void drop_recoverable();

    const std::string& path() const;       ///< the model or scene as it was opened
    const std::string& scene_path() const; ///< where save() writes; empty: nowhere yet
    std::shared_ptr<const GeometryFile> model() const;
    const ModelBox& box() const; ///< of the model's samples [model unit]
    const std::vector<std::string>& warnings() const;

    // What the edits amount to.
    const HandleFile& handles() const;
    const SceneSettings& settings() const;
    SceneFile scene() const; ///< all that a scene file would say now
    const Selection& selection() const;
    const std::vector<EditedRegion>& regions() const;          ///< of the current stage
    const EditedRegion* region(const std::string& name) const; ///< null: none
    /// Of the joints, in their order, from rest [work]; \p joint: one that the hand has
    /// at a placement, or none.
    std::vector<Motion> joint_motions(const std::string& joint,
                                      const RigidMove& to) const;
    /// The joints of the current stage at rest; none: it has no skeleton.
    std::vector<PosedJoint> joints_at_rest() const;
    /// Number of frames that no key of the scene states.
    std::size_t num_frames_without_key() const;
    /// Whether the scene says the poses itself: as keys of its skeleton.
    bool has_keys_of_scene() const;
    /// The region that holds a sample, the first declared; -1: none.
    int region_of(std::size_t sample) const;
    /// Finds the points of a rod in the centre line of the limb at some samples, or
    /// (none) of the whole shape [model unit], where a line drawn now would be at rest:
    /// \p moved has the result, where there are frames. For another thread: the document
    /// may change. Throws what centre_points() throws.
    std::function<std::vector<Eigen::Vector3d>()>
    centre_line(const std::vector<std::uint32_t>& near,
                const std::shared_ptr<const DeformedSamples>& moved) const;
    /// Rises with everything that changes any of these.
    std::uint64_t revision() const;
    /// Rises with what changes the result: not with the selection.
    std::uint64_t result_revision() const;

    /// Where the current stage begins, as ScriptFingerprint::before() tells it.
    std::uint64_t stage_fingerprint() const;
    /// The rest samples of a stage that is not the first; known from its solution. Until
    /// then its regions are placed on the model.
    void set_rest(std::uint64_t stage_fingerprint,
                  std::shared_ptr<const std::vector<Eigen::Vector3d>> samples);

    /// Where the glue of regions is at rest, by their names [model unit]: known from the
    /// cells, for as long as neither those nor the regions change.
    void set_borders(std::map<std::string, Eigen::Vector3d> borders);

    // Commands: each is one edit, or none where it changes nothing. Throw Error
    // (Fault::Usage) with the reason where they cannot be. Regions that change after a
    // frame begin a new stage: a commit, with all other regions as lists of samples.
    void select(const Selection& selection, const std::string& name);
    /// Makes a region of the selection, of which nothing is selected then; what other
    /// regions hold of it they lose. Gives its name: \p name, or one of the role if
    /// empty.
    std::string add_region(Role role, const std::string& name = "");
    /// Replaces a region's samples by the selection.
    void set_samples(const std::string& region);
    void remove_region(const std::string& region);
    void rename_region(const std::string& region, const std::string& name);
    void set_role(const std::string& region, Role role, double factor = 1.0);
    /// Adds a frame. One that takes a flat model out of the plane that it is kept in by
    /// default lets it bend in space from the first frame on: cells.flat is false then.
    void move_region(const std::string& region, const RigidMove& placement);
    /// A joint that is held at its place is so no longer.
    void release_joint(const std::string& joint);
    /// Makes a rod or a curve of rest coordinates. Gives its name.
    std::string add_line(Role role, const RodShape& shape, const std::string& name = "");
    /// Before the first frame of a stage: other points, radius (none: the usual one).
    void set_line(const std::string& region, const RodShape& shape);
    /// Adds a frame that moves a point of a rod or curve, or lets it go.
    void move_point(const std::string& region, std::size_t point,
                    const PointPlacement& placement);
    void release_point(const std::string& region, std::size_t point,
                       const HoldParts& parts = {true, true, true});
    /// A pin stays on a curve or rod (empty: on none), at a share of it or sliding;
    /// before the first frame of a stage.
    void put_on(const std::string& pin, const std::string& guide,
                std::optional<double> share);
    void change_settings(const SceneSettings& settings);

    // Undo and redo, without limit.
    const History& history() const;
    bool can_undo() const;
    bool can_redo() const;
    void undo();
    void redo();
    /// To after the first \p position edits.
    void go_to(std::size_t position);

    /// What close() was told when the document was last open; empty: nothing.
    const std::string& last_view() const;
    bool is_saved() const; ///< since the last change that a file would hold
    /// Writes scene and handle file, NAME.json and NAME.handles beside it; what they hold
    /// replays to the same result. Its own scene is replaced without Overwrite::Yes, too,
    /// but where that or its handle file is not as it was read or saved last:
    /// ChangedOnDisk then. A scene keeps all that is not edited: its skeleton, keys with
    /// their times, flesh. Throws Error; Fault::Usage with why_not_whole() for
    /// SavedPart::All.
    void save(const std::string& scene_path, Overwrite overwrite = Overwrite::No,
              SavedPart part = SavedPart::All);
    /// Why the scene cannot be saved with all its parts; empty: it can.
    std::string why_not_whole() const;
    /// Ends the journal: nothing is left to recover. What was saved is kept in it, with a
    /// word of the caller's: who opens the same again can go on to undo, and to redo what
    /// was not saved.
    void close(const std::string& view = "", Unsaved unsaved = Unsaved::Undo);

private:
    struct State;
    std::unique_ptr<State> state_;
};

} // namespace cellwarp::core
