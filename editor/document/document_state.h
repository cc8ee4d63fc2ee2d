// SPDX-License-Identifier: GPL-3.0-or-later
// What a document is made of; for its own sources alone.
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "editor/document/document.h"
#include "editor/document/journal_header.h"
#include "io/base/error.h"
#include "io/base/number.h"
#include "io/journal/journal.h"
#include "library/session/default_plane.h"
#include "library/session/frame_plan.h"
#include "library/session/script_fingerprint.h"
#include "library/session/skeleton_handle.h"
#include "octree/base/index.h"
#include "octree/coincident_samples.h"

namespace cellwarp::core
{

inline Error usage(const std::string& what)
{
    return {Fault::Usage, what};
}

inline SceneFile with_settings(SceneFile scene, const SceneSettings& settings)
{
    scene.settings = settings;
    return scene;
}

/// A region that an edit is made of: its statements, and the samples they mean.
struct RegionDraft
{
    std::vector<RegionStatement> statements;
    const EditedRegion* region;
};

struct Document::State
{
    std::string path, scene_path;
    SceneFile scene; ///< as it was opened: model, frame
    std::shared_ptr<const GeometryFile> model;
    ModelBox box;
    WorkFrame frame; ///< of the first stage
    std::vector<std::string> warnings;
    Edited edited;
    History history{Journal::create("", "")}; ///< until the journal is there
    struct Left
    {
        Journal journal;
        JournalContents contents;
        std::size_t count;    ///< of its records since it was last closed
        bool is_kept = false; ///< it was ended well: its edits are wanted
    };
    std::optional<Left> left; ///< by an earlier run
    std::string last_view;
    std::string journal_folder;
    std::string journal; ///< its path; empty: none
    std::optional<std::uint32_t> saved_content = 0;
    /// Checksums of the scene and its handle file as last read or saved, by path.
    std::map<std::string, std::uint32_t> checksums;
    /// Frames that stand for keys of the scene's skeleton: the first ones.
    std::size_t num_keyed_frames = 0;
    bool is_intact_save =
        false; ///< the files were written by save(), when they were read

    // Derived.
    std::vector<EditedRegion> regions;
    std::vector<std::int32_t> region_of_sample;
    std::vector<std::uint64_t>
        stage_fingerprints;             ///< ScriptFingerprint::before() of each
    std::uint64_t rest_fingerprint = 0; ///< of the rest that is known
    std::shared_ptr<const std::vector<Eigen::Vector3d>> rest;
    mutable std::optional<CoincidentSamples>
        coincident; ///< found when they are asked for
    mutable const std::vector<Eigen::Vector3d>* coincident_of = nullptr;
    ModelBox rest_box;
    /// EditedRegion::border of the regions, where they are known.
    std::map<std::string, Eigen::Vector3d> borders;
    std::shared_ptr<const SkeletonHandle> skeleton; ///< of the stage; null: none
    SkeletonAim pose;                               ///< after so many of its frames
    std::size_t posed_frames = 0;
    std::uint64_t revision = 0, result_revision = 0;

    Stage& stage() { return edited.handles.stages.back(); }
    std::vector<RegionStatement>& statements() { return stage().regions; }
    std::vector<FrameStatement>& frames() { return stage().frames; }

    bool knows_rest() const
    {
        return edited.handles.stages.size() == 1 ||
               (rest && rest_fingerprint == stage_fingerprints.back());
    }

    RegionGround ground() const
    {
        const bool is_first = edited.handles.stages.size() == 1 || !knows_rest();
        const std::vector<Eigen::Vector3d>& samples =
            is_first ? model->geometry.samples : *rest;
        Units units{frame, edited.handles.is_relative, is_first ? box : rest_box};
        if (!is_first && !scene.frame)
            units.frame = automatic_frame(units.box);
        if (!coincident || coincident_of != &samples)
        {
            coincident.emplace(samples, kCoincident * units.box.size().norm());
            coincident_of = &samples;
        }
        return {model->geometry, samples,     units,
                edited.handles,  *coincident, knows_rest()};
    }

    /// What a region's last move of the stage makes of it.
    void find_placement(EditedRegion& region, const RegionGround& on)
    {
        region.points = points_of(region, frames(), on);
        region.placement = {};
        region.border.reset();
        if (const auto border = borders.find(region.name); border != borders.end())
            region.border = border->second;
        region.knows_placement = on.is_known || !on.units.is_relative;
        if (!region.moves())
            return;
        const std::vector<FrameStatement>& all = frames();
        const Move* last = nullptr;
        for (std::size_t f = all.size(); f-- > 0 && !last;)
            for (const Move& move : all[f].moves)
                if (move.region == region.name && !is_of_points(move))
                    last = &move;
        if (!last)
            return;
        region.placement = placement_of(*last, region, on);
        region.knows_placement = (region.border || !turns_about_border(*last)) &&
                                 (on.is_known || is_placed_anywhere(*last, on));
    }

    /// Of the stages that have none yet: so an edit costs the same after thousands of
    /// them.
    void find_stage_fingerprints()
    {
        const std::vector<Stage>& stages = edited.handles.stages;
        if (stage_fingerprints.empty())
            stage_fingerprints = {
                ScriptFingerprint::before_first(edited.handles.is_relative)};
        while (stage_fingerprints.size() < stages.size())
            stage_fingerprints.push_back(ScriptFingerprint::before_next(
                stage_fingerprints.back(), stages[stage_fingerprints.size() - 1]));
    }

    void find_regions()
    {
        find_stage_fingerprints();
        const RegionGround on = ground();
        std::vector<EditedRegion> found = edited_regions(statements(), on);
        std::vector<std::int32_t> of_sample(model->geometry.samples.size(), -1);
        for (std::size_t r = found.size(); r-- > 0;)
            for (const std::uint32_t i : found[r].samples)
                of_sample[i] = static_cast<std::int32_t>(r);
        for (EditedRegion& region : found)
        {
            for (const OnStatement& one : stage().ons)
                if (one.pin == region.name)
                {
                    region.guide = one.guide;
                    region.share = one.at;
                }
            find_placement(region, on);
        }
        skeleton = stage().joints.empty()
                       ? nullptr
                       : std::make_shared<const SkeletonHandle>(stage().joints, on.units,
                                                                edited.handles.path);
        if (skeleton)
        {
            pose = skeleton->rest();
            posed_frames = 0;
            find_pose(on);
            for (EditedRegion& joint : edited_joints(*skeleton, pose, on))
                found.push_back(std::move(joint));
        }
        regions = std::move(found);
        region_of_sample = std::move(of_sample);
    }

    /// Goes on through the frames that are new; from rest where some have gone.
    void find_pose(const RegionGround& on)
    {
        if (frames().size() < posed_frames)
        {
            pose = skeleton->rest();
            posed_frames = 0;
        }
        for (; posed_frames < frames().size(); ++posed_frames)
        {
            std::vector<const Move*> moves;
            for (const Move& move : frames()[posed_frames].moves)
                if (skeleton->find(move.region) >= 0)
                    moves.push_back(&move);
            pose = skeleton->moved(pose, moves, on.units);
        }
    }

    void place_joints(const RegionGround& on)
    {
        find_pose(on);
        for (EditedRegion& joint : edited_joints(*skeleton, pose, on))
            regions[idx(static_cast<std::ptrdiff_t>(regions.size() - skeleton->size()) +
                        skeleton->find(joint.name))] = joint;
    }

    /// What changes may have made other than it was.
    struct Touched
    {
        bool regions = false, cells = false, content = false;
        std::set<std::string> moved;

        void add(const Edit& edit)
        {
            for (const Change& change : edit.changes)
            {
                if (const auto* added = std::get_if<FramesAdded>(&change))
                    for (const FrameStatement& statement : added->frames)
                        for (const Move& move : statement.moves)
                            moved.insert(move.region);
                regions |= std::holds_alternative<RegionChange>(change) ||
                           std::holds_alternative<OnsChange>(change) ||
                           std::holds_alternative<Renamed>(change) ||
                           std::holds_alternative<StageAdded>(change);
                cells |= std::holds_alternative<SettingsChange>(change);
                content |= !std::holds_alternative<Toggled>(change);
            }
        }
    };

    void follow(const Touched& touched)
    {
        if (touched.regions || touched.cells)
            borders.clear();
        if (touched.regions)
            find_regions();
        else if (touched.cells || !touched.moved.empty())
        {
            const RegionGround on = ground();
            for (EditedRegion& region : regions)
                if (!region.joint &&
                    (touched.cells || touched.moved.contains(region.name)))
                    find_placement(region, on);
            if (skeleton)
                place_joints(on);
        }
        result_revision += touched.content;
        ++revision;
    }

    void check_open() const
    {
        if (left)
            throw usage("there are edits of an earlier run: recover or drop them first");
    }

    enum class Way
    {
        Forth,
        Back
    };

    /// Changes what is edited; what follows from that is for follow().
    void change(const Edit& edit, Way way, Touched& touched)
    {
        touched.add(edit);
        if (way == Way::Forth)
            apply(edit, edited);
        else
            take_back(edit, edited);
        // A stage that is the last one may change.
        stage_fingerprints.resize(
            std::min(stage_fingerprints.size(), edited.handles.stages.size()));
    }

    /// Does an edit; what cannot be leaves everything as it was.
    void push(const Edit& edit)
    {
        check_open();
        Touched touched;
        change(edit, Way::Forth, touched);
        try
        {
            follow(touched);
            history.add(edit);
        }
        catch (...)
        {
            change(edit, Way::Back, touched);
            follow(touched);
            throw;
        }
    }

    /// Does or takes back edits until \p done of them are \p goal; the history is told
    /// later.
    void walk(std::size_t& done, std::size_t goal, Touched& touched)
    {
        for (; done < goal; ++done)
            change(history.edit(done), Way::Forth, touched);
        for (; done > goal; --done)
            change(history.edit(done - 1), Way::Back, touched);
    }

    const EditedRegion& find(const std::string& name) const
    {
        const auto found =
            std::find_if(regions.begin(), regions.end(),
                         [&](const EditedRegion& region) { return region.name == name; });
        if (found == regions.end())
            throw usage("there is no region " + in_quotes(name));
        return *found;
    }

    /// The samples of a region. Throws where they are not known yet.
    static const std::vector<std::uint32_t>& samples_of(const EditedRegion& region);
    /// All regions, ready to be changed: as they stand, or, where a frame has moved them
    /// and a commit must come first, as lists of their samples. One without samples has
    /// no list: its shapes stay where they are.
    std::vector<RegionDraft> drafts();
    /// Takes samples away from all regions but one, if it prescribes where they go.
    static void take_from_others(std::vector<RegionDraft>& drafts,
                                 const std::vector<std::uint32_t>& samples, Role role,
                                 const std::string& but);
    /// One edit that makes these the regions, with other changes before.
    void push_regions(const std::string& name, const std::vector<RegionDraft>& drafts,
                      const std::vector<RegionStatement>& more = {},
                      std::vector<Change> changes = {});
    std::vector<std::uint32_t> selected() const;
    void check_new_name(const std::string& name) const;
    std::string free_name(Role role) const;
    /// Of the next frame. Throws where there is none.
    std::int64_t next_number() const;
    /// The plane that the current stage may be kept in if its settings leave that open.
    std::optional<DefaultPlane> default_plane() const;
    /// More frames of the current stage. Where they are the first that take a flat model
    /// out of its plane it is no longer kept in it, and a scene that is saved says so.
    std::vector<Change> with_frames(std::vector<FrameStatement> added) const;
    /// A rod or curve, to change what it is written as: not after a frame.
    const EditedRegion& line_to_change(const std::string& region) const;
    void change_line(const EditedRegion& region, const SplineStatement& line);
    /// The statements of a handle file beside a scene that has \p own_skeleton.
    HandleFile handles_to_write(bool own_skeleton) const;
    /// Document::num_frames_without_key().
    std::size_t num_frames_without_key() const;
    JournalHeader header() const;
    void start_history();
    /// Keeps a journal that cannot be read, under another name.
    void set_aside(const Error& error);
    /// What the edits of a journal that are done amount to, from what it begins with.
    Edited replayed(const JournalHeader& header, const History& edits) const;
    void take(Edited now, History edits);
    bool is_of_this_model(const JournalHeader& header) const;
    /// Whether edits on top of the header's files say what was edited on these.
    bool is_of_these_files(const JournalHeader& header) const;
    /// Throws ChangedOnDisk unless a file is as it was read or saved last, or is gone.
    void check_unchanged(const std::string& file) const;
    /// Goes on with the journal of a document that was saved, if that is what the files
    /// say.
    bool go_on_with(Left kept);
    /// Looks for the journal of an earlier run: what it has left to recover, or its
    /// history. False: there is none.
    bool find_left();
};

} // namespace cellwarp::core
