// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/document/document.h"

#include <filesystem>
#include <functional>
#include <system_error>

#include <fmt/format.h>

#include "editor/document/document_state.h"
#include "io/base/checksum.h"
#include "io/base/output_set.h"
#include "io/base/text.h"
#include "io/formats/geometry_file.h"
#include "io/scene/saved_pair.h"
#include "library/session/scene_script.h"
#include "library/session/spline_region.h"

namespace cellwarp::core
{

namespace
{

/// A name for a file's journal: the file's own, and a fingerprint of where it lies.
std::string journal_path(const std::string& folder, const std::string& path)
{
    if (folder.empty())
        return {};
    std::error_code none;
    const std::filesystem::path whole = std::filesystem::weakly_canonical(path, none);
    const std::string text = none ? path : whole.string();
    return (std::filesystem::path(folder) /
            (std::filesystem::path(path).stem().string().substr(0, 100) + "-" +
             std::to_string(checksum_of(text)) + ".journal"))
        .string();
}

/// Removes a journal from which there is nothing to recover, of a file that is written
/// anew; any other stays.
void remove_closed(const std::string& journal)
{
    std::error_code none;
    if (journal.empty() || !std::filesystem::exists(journal, none))
        return;
    try
    {
        JournalContents contents;
        Journal opened = Journal::open(journal, contents);
        const History::End end = History::end_of(opened, contents);
        if (end.word && end.records_after == 0)
            opened.remove();
    }
    catch (const Error&)
    {
        // It is kept aside.
    }
}

/// Somebody else has the journal of a file.
[[noreturn]] void fail_in_use(const std::string& path, const InUse& error)
{
    const std::string what = error.what();
    throw InUse(Fault::File,
                at({path, 0, ""}, "is open in another window (" +
                                      what.substr(what.rfind("in use by")) + ")"));
}

/// Nothing where there is no file that can be read.
std::optional<std::uint32_t> checksum_of_file(const std::string& path)
{
    try
    {
        return checksum_of(read_file(path));
    }
    catch (const Error&)
    {
        return std::nullopt;
    }
}

/// Whether a handle file with these would say nothing.
bool is_empty(const HandleFile& handles)
{
    return std::all_of(handles.stages.begin(), handles.stages.end(),
                       [](const Stage& stage)
                       {
                           return stage.regions.empty() && stage.frames.empty() &&
                                  stage.ons.empty() && stage.joints.empty();
                       }) &&
           handles.stages.size() < 2;
}

} // namespace

void Document::State::check_unchanged(const std::string& file) const
{
    std::error_code unknown;
    if (!std::filesystem::exists(file, unknown) && !unknown)
        return;
    const std::optional<std::uint32_t> now = checksum_of_file(file);
    if (!now)
        throw ChangedOnDisk(Fault::File,
                            at({file, 0, ""}, "cannot be read now: another program may "
                                              "have changed it"));
    const auto known = checksums.find(file);
    if (known == checksums.end() || known->second != *now)
        throw ChangedOnDisk(
            Fault::File, at({file, 0, ""}, "is not as it was read or saved last: another "
                                           "program has changed it"));
}

JournalHeader Document::State::header() const
{
    return {path,
            scene_text(with_settings(scene, edited.settings)),
            handle_text(edited.handles),
            edited.handles.path,
            model->bytes.size(),
            checksum_of(model->bytes)};
}

void Document::State::start_history()
{
    const std::string text = header_text(header());
    try
    {
        history = History(Journal::create(journal, text));
    }
    catch (const InUse&)
    {
        throw;
    }
    catch (const Error& error)
    {
        if (journal.empty())
            throw;
        warnings.push_back(std::string("no journal is kept: ") + error.what());
        history = History(Journal::create("", text));
    }
}

void Document::State::set_aside(const Error& error)
{
    std::string note = error.what();
    try
    {
        note += " (kept as " + Journal::keep_aside(journal) + ")";
    }
    catch (const Error&)
    {
        // It stays where it is, and start_history() tells that none can be kept.
    }
    warnings.push_back(note);
}

Edited Document::State::replayed(const JournalHeader& header, const History& edits) const
{
    Edited now;
    now.settings = parse_scene(header.document, header.scene).settings;
    now.handles = parse_handles(header.handles_path, header.handles);
    now.handles.labels = edited.handles.labels;
    now.selection = Selection(model->geometry.samples.size());
    for (std::size_t k = 0; k < edits.position(); ++k)
        apply(edits.edit(k), now);
    return now;
}

void Document::State::take(Edited now, History edits)
{
    edited = std::move(now);
    stage_fingerprints.clear();
    find_regions();
    history = std::move(edits);
    saved_content = history.closed_content();
}

bool Document::State::is_of_this_model(const JournalHeader& header) const
{
    return header.model_bytes == model->bytes.size() &&
           header.model_checksum == checksum_of(model->bytes);
}

bool Document::State::is_of_these_files(const JournalHeader& header) const
{
    HandleFile handles = parse_handles(header.handles_path, header.handles);
    handles.path = edited.handles.path;
    return parse_scene(header.document, header.scene).settings == edited.settings &&
           handle_text(handles) == handle_text(edited.handles);
}

bool Document::State::go_on_with(Left kept)
{
    const JournalHeader header = parse_header(kept.contents.header, journal);
    if (!is_of_this_model(header))
        return false;
    History edits(std::move(kept.journal), kept.contents);
    const std::optional<std::size_t> saved =
        edits.closed_content() ? edits.position_of(*edits.closed_content())
                               : std::nullopt;
    if (!saved)
        return false;
    edits.move_to(*saved);
    Edited now = replayed(header, edits);
    now.handles.path = edited.handles.path;
    if (now.settings != edited.settings ||
        handle_text(now.handles) != handle_text(edited.handles))
        return false; // something else was written there
    take(std::move(now), std::move(edits));
    warnings.insert(warnings.end(), kept.contents.warnings.begin(),
                    kept.contents.warnings.end());
    return true;
}

bool Document::State::find_left()
{
    std::error_code none;
    if (journal.empty() || !std::filesystem::exists(journal, none))
        return false;
    JournalContents contents;
    try
    {
        Journal opened = Journal::open(journal, contents);
        const History::End end = History::end_of(opened, contents);
        Left found{std::move(opened), std::move(contents), end.records_after,
                   end.is_kept};
        last_view = end.word.value_or("");
        if (found.count > 0)
            left.emplace(std::move(found));
        return left || (end.word && go_on_with(std::move(found)));
    }
    catch (const InUse&)
    {
        throw;
    }
    catch (const Error& error)
    {
        set_aside(error);
        return false;
    }
}

Document::~Document() = default;
Document::Document(Document&&) noexcept = default;
Document& Document::operator=(Document&&) noexcept = default;

Document::Document(const std::string& path, const std::string& journal_folder)
    : state_(std::make_unique<State>())
{
    State& s = *state_;
    s.path = path;
    s.edited.handles.stages.resize(1);
    if (extension_of(path) == "json")
    {
        // Before it is read: what changes in between is noticed as a change.
        if (const auto checksum = checksum_of_file(path))
            s.checksums[path] = *checksum;
        s.scene = read_scene(path);
        need_model(s.scene);
        if (const auto checksum = checksum_of_file(s.scene.handles))
            s.checksums[s.scene.handles] = *checksum;
        s.scene_path = path;
        s.warnings = s.scene.warnings;
        if (!s.scene.time.carries() && !s.scene.has_flesh()) // else it can be played
            s.warnings.insert(s.warnings.end(), s.scene.left_out.begin(),
                              s.scene.left_out.end());
        s.edited.settings = s.scene.settings;
        if (std::optional<HandleFile> script =
                script_of(s.scene, s.scene.handles, s.warnings))
            s.edited.handles = std::move(*script);
        // Its joints and keys are statements, too: a save writes them as the scene does.
        if (s.scene.skeleton && !s.edited.handles.stages.empty())
            for (const FrameStatement& frame : s.edited.handles.stages.front().frames)
                s.num_keyed_frames += frame.time.has_value();
        if (const auto parted = parted_save(s.scene, s.edited.handles))
            s.warnings.push_back(*parted);
        const std::optional<std::string> save = s.scene.save;
        s.scene.save.reset(); // what is edited is of none
        s.edited.handles.save.reset();
        s.is_intact_save =
            save && *save == save_fingerprint(scene_text(s.scene),
                                              handle_text(s.handles_to_write(
                                                  s.scene.skeleton.has_value())));
    }
    else
        s.scene = scene_or_model(path);
    s.model = std::make_shared<const GeometryFile>(read_geometry(s.scene.model));
    s.box = bounding_box(s.model->geometry.samples);
    s.frame = s.scene.frame ? given_frame(*s.scene.frame, s.scene.path)
                            : automatic_frame(s.box);
    s.edited.selection = Selection(s.model->geometry.samples.size());
    s.find_regions();
    s.journal_folder = journal_folder;
    s.journal = journal_path(journal_folder, path);
    try
    {
        if (!s.find_left())
            s.start_history();
    }
    catch (const InUse& error)
    {
        fail_in_use(path, error);
    }
    if (!s.left || !s.left->is_kept)
        return;
    try
    {
        for (std::string& warning : recover())
            s.warnings.push_back(std::move(warning));
    }
    catch (const Error& error)
    {
        s.warnings.push_back(error.what());
    }
}

std::size_t Document::num_recoverable() const
{
    return state_->left ? state_->left->count : 0;
}

std::vector<std::string> Document::recover()
{
    State& s = *state_;
    if (!s.left)
        return {};
    State::Left left = std::move(*s.left);
    s.left.reset();
    std::vector<std::string> warnings = left.contents.warnings;
    try
    {
        const JournalHeader header = parse_header(left.contents.header, s.journal);
        if (!s.is_of_this_model(header))
            warnings.push_back(s.model->path +
                               ": has changed since then (its checksum was " +
                               std::to_string(header.model_checksum) + ", and is " +
                               std::to_string(checksum_of(s.model->bytes)) + " now)");
        History edits(std::move(left.journal), left.contents);
        Edited now = s.replayed(header, edits);
        // The edits are of other files than those that are there: save() asks.
        if (!s.is_intact_save && !s.is_of_these_files(header))
            s.checksums.clear();
        s.take(std::move(now), std::move(edits));
    }
    catch (const Error& error)
    {
        s.set_aside(error);
        s.start_history();
        throw;
    }
    ++s.revision;
    ++s.result_revision;
    return warnings;
}

void Document::drop_recoverable()
{
    State& s = *state_;
    if (!s.left)
        return;
    State::Left left = std::move(*s.left);
    s.left.reset();
    try
    {
        // What was saved before has its history all the same.
        if (s.go_on_with(std::move(left)))
        {
            ++s.revision;
            return;
        }
    }
    catch (const Error&)
    {
        // They are not wanted anyway.
    }
    s.start_history();
}

const std::string& Document::path() const
{
    return state_->path;
}

const std::string& Document::scene_path() const
{
    return state_->scene_path;
}

std::shared_ptr<const GeometryFile> Document::model() const
{
    return state_->model;
}

const ModelBox& Document::box() const
{
    return state_->box;
}

const std::vector<std::string>& Document::warnings() const
{
    return state_->warnings;
}

const HandleFile& Document::handles() const
{
    return state_->edited.handles;
}

const SceneSettings& Document::settings() const
{
    return state_->edited.settings;
}

SceneFile Document::scene() const
{
    return with_settings(state_->scene, state_->edited.settings);
}

const Selection& Document::selection() const
{
    return state_->edited.selection;
}

std::function<std::vector<Eigen::Vector3d>()>
Document::centre_line(const std::vector<std::uint32_t>& near,
                      const std::shared_ptr<const DeformedSamples>& moved) const
{
    const State& s = *state_;
    const bool has_frames = !s.edited.handles.stages.back().frames.empty();
    if (has_frames ? !moved : !s.knows_rest())
        throw usage("the centre line is of a shape that is not there yet");
    const RegionGround ground = s.ground();
    RegionStatement statement;
    statement.role = Role::Rod;
    statement.name = role_name(Role::Rod);
    statement.spline = std::make_shared<const SplineStatement>();
    return [statement, near, model = s.model,
            samples = has_frames ? moved->samples : ground.rest, units = ground.units,
            path = s.path]
    {
        std::vector<Eigen::Vector3d> points;
        for (const Eigen::Vector3d& point :
             centre_points(statement, model->geometry, samples, near, units, path))
            points.push_back(units.frame.to_model(point));
        return points;
    };
}

const std::vector<EditedRegion>& Document::regions() const
{
    return state_->regions;
}

const EditedRegion* Document::region(const std::string& name) const
{
    for (const EditedRegion& region : state_->regions)
        if (region.name == name)
            return &region;
    return nullptr;
}

std::vector<Motion> Document::joint_motions(const std::string& joint,
                                            const RigidMove& to) const
{
    const State& s = *state_;
    if (!s.skeleton)
        return {};
    SkeletonAim aim = s.pose;
    if (const EditedRegion* const held = region(joint); held && held->joint)
    {
        const RegionGround ground = s.ground();
        const Move move = joint_move(*held, to, ground);
        const std::vector<const Move*> moves = {&move};
        aim = s.skeleton->moved(aim, moves, ground.units);
    }
    return s.skeleton->motions(aim, aim, 1.0);
}

std::vector<PosedJoint> Document::joints_at_rest() const
{
    const State& s = *state_;
    std::vector<PosedJoint> joints;
    if (!s.skeleton)
        return joints;
    const WorkFrame& frame = s.ground().units.frame;
    for (std::size_t j = 0; j < s.skeleton->size(); ++j)
        joints.push_back({s.skeleton->statement(j).name, s.skeleton->parent(j),
                          frame.to_model(s.skeleton->place(j))});
    return joints;
}

std::size_t Document::State::num_frames_without_key() const
{
    std::size_t frames = 0;
    for (const Stage& stage : edited.handles.stages)
        frames += stage.frames.size();
    return frames - std::min(frames, num_keyed_frames);
}

std::size_t Document::num_frames_without_key() const
{
    return state_->num_frames_without_key();
}

bool Document::has_keys_of_scene() const
{
    return state_->num_keyed_frames > 0;
}

int Document::region_of(std::size_t sample) const
{
    return state_->region_of_sample[sample];
}

std::uint64_t Document::revision() const
{
    return state_->revision;
}

std::uint64_t Document::result_revision() const
{
    return state_->result_revision;
}

std::uint64_t Document::stage_fingerprint() const
{
    return state_->stage_fingerprints.back();
}

void Document::set_borders(std::map<std::string, Eigen::Vector3d> borders)
{
    State& s = *state_;
    if (s.borders == borders)
        return;
    s.borders = std::move(borders);
    const RegionGround on = s.ground();
    for (EditedRegion& region : s.regions)
        if (!region.joint)
            s.find_placement(region, on);
    ++s.revision;
}

void Document::set_rest(std::uint64_t stage_fingerprint,
                        std::shared_ptr<const std::vector<Eigen::Vector3d>> samples)
{
    State& s = *state_;
    if (s.rest && s.rest_fingerprint == stage_fingerprint)
        return;
    s.rest = std::move(samples);
    s.rest_fingerprint = stage_fingerprint;
    s.coincident.reset(); // another rest may come to lie where the last one was
    s.rest_box = bounding_box(*s.rest);
    if (s.edited.handles.stages.size() == 1 ||
        s.stage_fingerprints.back() != stage_fingerprint)
        return;
    try
    {
        s.find_regions();
    }
    catch (...)
    {
        s.rest.reset();
        s.coincident.reset();
        throw;
    }
    ++s.revision;
}

const History& Document::history() const
{
    return state_->history;
}

bool Document::can_undo() const
{
    return history().position() > 0;
}

bool Document::can_redo() const
{
    return history().position() < history().size();
}

void Document::undo()
{
    if (can_undo())
        go_to(history().position() - 1);
}

void Document::redo()
{
    if (can_redo())
        go_to(history().position() + 1);
}

void Document::go_to(std::size_t position)
{
    State& s = *state_;
    s.check_open();
    const std::size_t goal = std::min(position, s.history.size());
    std::size_t done = s.history.position();
    State::Touched touched;
    try
    {
        s.walk(done, goal, touched);
        s.follow(touched);
        s.history.move_to(goal);
    }
    catch (...)
    {
        s.walk(done, s.history.position(), touched);
        s.follow(touched);
        throw;
    }
}

const std::string& Document::last_view() const
{
    return state_->last_view;
}

bool Document::is_saved() const
{
    return state_->saved_content == history().content();
}

HandleFile Document::State::handles_to_write(bool own_skeleton) const
{
    HandleFile handles = edited.handles;
    if (!own_skeleton)
        return handles;
    Stage& first = handles.stages.front();
    first.joints.clear();
    first.frames.erase(
        first.frames.begin(),
        first.frames.begin() +
            static_cast<std::ptrdiff_t>(std::min(first.frames.size(), num_keyed_frames)));
    return handles;
}

std::string Document::why_not_whole() const
{
    const State& s = *state_;
    if (!s.scene.skeleton || s.num_keyed_frames == 0)
        return "";
    const std::size_t added = s.num_frames_without_key();
    if (added == 0 && s.edited.handles.stages.size() == 1)
        return "";
    return fmt::format(
        "{} no time, which the keys of the scene have: undo {}, or save the poses alone, "
        "without times, flesh and simulate",
        added == 1  ? "the pose made here has"
        : added > 1 ? fmt::format("the {} poses made here have", added)
                    : "the regions made here have",
        added == 1 ? "it" : "them");
}

void Document::save(const std::string& scene_path, Overwrite overwrite, SavedPart part)
{
    State& s = *state_;
    s.check_open();
    if (extension_of(scene_path) != "json")
        throw usage("a scene's name ends in .json (got " + in_quotes(scene_path) + ")");
    const bool is_own = scene_path == s.scene_path;
    const bool is_whole = part == SavedPart::All && s.scene.skeleton.has_value();
    if (const std::string why = why_not_whole(); is_whole && !why.empty())
        throw usage(why);
    if (is_own && !is_whole && s.scene.has_flesh())
        throw usage(in_quotes(scene_path) +
                    " has flesh in time, which poses alone do not keep: save them under "
                    "another name");
    SceneFile scene = with_settings(s.scene, s.edited.settings);
    scene.text = moved_scene_text(s.scene, scene_path);
    scene.path = scene_path;
    if (!is_whole)
        scene.skeleton.reset();
    HandleFile handles = s.handles_to_write(is_whole);
    const bool has_handles = !is_whole || !is_empty(handles);
    if (!has_handles)
        scene.handles.clear();
    else if (!is_own || scene.handles.empty())
        scene.handles = scene_path.substr(0, scene_path.size() - 5) + ".handles";
    handles.path = has_handles ? scene.handles : scene_path;
    if (is_own && overwrite == Overwrite::No)
    {
        s.check_unchanged(scene.path);
        if (has_handles)
            s.check_unchanged(scene.handles);
        overwrite = Overwrite::Yes;
    }
    SceneFile saved_scene = scene;
    if (has_handles)
    {
        saved_scene.save = save_fingerprint(scene_text(scene), handle_text(handles));
        handles.save = {*saved_scene.save,
                        std::filesystem::path(scene_path).filename().string()};
    }
    const std::string scene_bytes = scene_text(saved_scene),
                      handle_bytes = has_handles ? handle_text(handles) : "";
    check_output(scene.path, overwrite);
    if (has_handles)
        check_output(scene.handles, overwrite);
    const std::string journal = journal_path(s.journal_folder, scene_path);
    try
    {
        if (!is_own && journal != s.journal)
            Journal::check_free(journal);
    }
    catch (const InUse& error)
    {
        fail_in_use(scene_path, error);
    }
    SceneFile written = parse_scene(scene_path, scene_bytes);
    written.save.reset();
    OutputSet files(overwrite);
    if (has_handles)
        files.write(scene.handles, handle_bytes);
    files.write(scene.path, scene_bytes);
    files.commit();
    if (!is_own)
    {
        // Whoever opens the new scene finds the edits under its name.
        remove_closed(journal);
        s.history.move_journal(journal);
        s.journal = journal;
    }
    s.checksums = {{scene.path, checksum_of(scene_bytes)}};
    if (has_handles)
        s.checksums[scene.handles] = checksum_of(handle_bytes);
    s.scene_path = scene_path;
    s.scene = std::move(written);
    if (!is_whole)
        s.num_keyed_frames = 0;
    s.edited.handles.path = handles.path;
    s.saved_content = s.history.content();
    ++s.revision;
}

void Document::close(const std::string& view, Unsaved unsaved)
{
    State& s = *state_;
    if (unsaved == Unsaved::Keep && !is_saved() && !s.left)
        return s.history.keep(view);
    const std::optional<std::size_t> saved =
        s.saved_content ? s.history.position_of(*s.saved_content) : std::nullopt;
    if (!saved)
        return s.history.remove();
    if (!is_saved())
        s.history.move_to(*saved);
    s.history.close(view);
}

} // namespace cellwarp::core
