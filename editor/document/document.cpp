// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/document/document.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <set>

#include "editor/document/journal_header.h"
#include "editor/session/statement_chain.h"
#include "io/checksum.h"
#include "io/error.h"
#include "io/journal.h"
#include "io/number.h"

namespace cellwarp
{

namespace
{

Error usage(const std::string& what)
{
    return {Fault::Usage, what};
}

/// A name for a file's journal: the file's own, and a print of where it lies.
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

SceneFile with_settings(SceneFile scene, const EditSettings& settings)
{
    scene.across = settings.across;
    scene.max_depth = settings.max_depth;
    scene.max_cells = settings.max_cells;
    scene.threshold = settings.threshold;
    scene.gap = settings.gap;
    scene.fill = settings.fill;
    scene.drag = settings.drag;
    scene.release = settings.release;
    return scene;
}

EditSettings settings_in(const SceneFile& scene)
{
    return {scene.across, scene.max_depth, scene.max_cells, scene.threshold,
            scene.gap,    scene.fill,      scene.drag,      scene.release};
}

/// A region that an edit is made of: its statements, and the samples they mean.
struct Draft
{
    std::vector<RegionStatement> statements;
    const EditedRegion* region;
};

bool prescribes(Role role)
{
    return role != Role::Stiff;
}

std::vector<std::uint32_t> without(const std::vector<std::uint32_t>& samples,
                                   const std::vector<std::uint32_t>& others)
{
    std::vector<std::uint32_t> left;
    std::set_difference(samples.begin(), samples.end(), others.begin(), others.end(),
                        std::back_inserter(left));
    return left;
}

RegionStatement statement_of(const std::string& name, Role role, double factor,
                             const std::vector<std::uint32_t>& samples)
{
    RegionStatement statement;
    statement.name = name;
    statement.role = role;
    statement.factor = role == Role::Stiff ? factor : 1.0;
    statement.selector = selector_of(samples);
    return statement;
}

bool is_same(const RegionStatement& a, const RegionStatement& b)
{
    return a.role == b.role && a.name == b.name && a.factor == b.factor &&
           a.selector.kind == b.selector.kind &&
           a.selector.numbers == b.selector.numbers &&
           a.selector.ranges == b.selector.ranges && a.selector.name == b.selector.name &&
           a.selector.label == b.selector.label;
}

/// The part of two lists in which they differ.
RegionChange change_between(const std::vector<RegionStatement>& before,
                            const std::vector<RegionStatement>& after)
{
    const auto first =
        std::mismatch(before.begin(), before.end(), after.begin(), after.end(), is_same);
    const auto last =
        std::mismatch(before.rbegin(), std::make_reverse_iterator(first.first),
                      after.rbegin(), std::make_reverse_iterator(first.second), is_same);
    return {static_cast<std::size_t>(first.first - before.begin()),
            {first.first, last.first.base()},
            {first.second, last.second.base()}};
}

} // namespace

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
    };
    std::optional<Left> left; ///< by an earlier run
    std::string journal_folder;
    std::string journal; ///< its path; empty: none
    std::optional<std::uint32_t> saved_content = 0;

    // Derived.
    std::vector<EditedRegion> regions;
    std::vector<std::int32_t> region_of_sample;
    std::vector<std::uint64_t> stage_prints; ///< StatementChain::before() of each
    std::uint64_t rest_print = 0;            ///< of the rest that is known
    std::shared_ptr<const std::vector<Eigen::Vector3d>> rest;
    mutable std::optional<Twins> twins; ///< found when they are asked for
    mutable const std::vector<Eigen::Vector3d>* twins_of = nullptr;
    ModelBox rest_box;
    std::uint64_t revision = 0, result_revision = 0;

    std::vector<RegionStatement>& statements()
    {
        return edited.handles.stages.back().regions;
    }
    std::vector<FrameStatement>& frames() { return edited.handles.stages.back().frames; }

    bool knows_rest() const
    {
        return edited.handles.stages.size() == 1 ||
               (rest && rest_print == stage_prints.back());
    }

    RegionGround ground() const
    {
        const bool is_first = edited.handles.stages.size() == 1 || !knows_rest();
        const std::vector<Eigen::Vector3d>& samples =
            is_first ? model->geometry.samples : *rest;
        Units units{frame, edited.handles.is_relative, is_first ? box : rest_box};
        if (!is_first && !scene.frame)
            units.frame = automatic_frame(units.box);
        if (!twins || twins_of != &samples)
        {
            twins.emplace(samples, units.box);
            twins_of = &samples;
        }
        return {model->geometry, samples, units, edited.handles.path, *twins};
    }

    /// What a region's last move of the stage makes of it.
    void find_placement(EditedRegion& region, const RegionGround& on)
    {
        region.placement = {};
        if (!region.moves())
            return;
        const std::vector<FrameStatement>& all = frames();
        const Move* last = nullptr;
        for (std::size_t f = all.size(); f-- > 0 && !last;)
            for (const Move& move : all[f].moves)
                if (move.region == region.name)
                    last = &move;
        if (last)
            region.placement = placement_of(*last, region, on);
    }

    /// Of the stages that have none yet: so an edit costs the same after thousands of
    /// them.
    void find_stage_prints()
    {
        const std::vector<Stage>& stages = edited.handles.stages;
        if (stage_prints.empty())
            stage_prints = {StatementChain::before_first(edited.handles.is_relative)};
        while (stage_prints.size() < stages.size())
            stage_prints.push_back(StatementChain::before_next(
                stage_prints.back(), stages[stage_prints.size() - 1]));
    }

    void find_regions()
    {
        find_stage_prints();
        regions = edited_regions(statements(), ground());
        region_of_sample.assign(model->geometry.samples.size(), -1);
        for (std::size_t r = regions.size(); r-- > 0;)
            for (const std::uint32_t i : regions[r].samples)
                region_of_sample[i] = static_cast<std::int32_t>(r);
        const RegionGround on = ground();
        for (EditedRegion& region : regions)
            find_placement(region, on);
    }

    /// What changes may have made other than it was.
    struct Touched
    {
        bool regions = false, content = false;
        std::set<std::string> moved;

        void add(const Edit& edit)
        {
            for (const Change& change : edit.changes)
            {
                if (const auto* added = std::get_if<FramesAdded>(&change))
                    for (const FrameStatement& frame : added->frames)
                        for (const Move& move : frame.moves)
                            moved.insert(move.region);
                regions |= std::holds_alternative<RegionChange>(change) ||
                           std::holds_alternative<Renamed>(change) ||
                           std::holds_alternative<StageAdded>(change);
                content |= !std::holds_alternative<Toggled>(change);
            }
        }
    };

    void follow(const Touched& touched)
    {
        if (touched.regions)
            find_regions();
        else if (!touched.moved.empty())
        {
            const RegionGround on = ground();
            for (EditedRegion& region : regions)
                if (touched.moved.contains(region.name))
                    find_placement(region, on);
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
        stage_prints.resize(std::min(stage_prints.size(), edited.handles.stages.size()));
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

    /// All regions, ready to be changed: as they stand, or, where a frame has moved them
    /// and a commit must come first, as lists of their samples.
    std::vector<Draft> drafts()
    {
        std::vector<Draft> drafts;
        for (const EditedRegion& region : regions)
        {
            Draft& draft = drafts.emplace_back(Draft{{}, &region});
            if (!frames().empty())
                draft.statements = {statement_of(region.name, region.role, region.factor,
                                                 region.samples)};
            else
                std::copy_if(statements().begin(), statements().end(),
                             std::back_inserter(draft.statements),
                             [&](const RegionStatement& statement)
                             { return statement.name == region.name; });
        }
        return drafts;
    }

    /// Takes samples away from all regions but one, if it prescribes where they go.
    static void take_from_others(std::vector<Draft>& drafts,
                                 const std::vector<std::uint32_t>& samples, Role role,
                                 const std::string& but)
    {
        if (!prescribes(role))
            return;
        for (Draft& draft : drafts)
        {
            const EditedRegion& region = *draft.region;
            if (region.name == but || !prescribes(region.role))
                continue;
            const std::vector<std::uint32_t> left = without(region.samples, samples);
            if (left.size() == region.samples.size())
                continue;
            draft.statements.clear();
            if (!left.empty())
                draft.statements = {
                    statement_of(region.name, region.role, region.factor, left)};
        }
    }

    /// One edit that makes these the regions, with other changes before.
    void push_regions(const std::string& name, const std::vector<Draft>& drafts,
                      const std::vector<RegionStatement>& more = {},
                      std::vector<Change> changes = {})
    {
        std::vector<RegionStatement> after;
        for (const Draft& draft : drafts)
            after.insert(after.end(), draft.statements.begin(), draft.statements.end());
        after.insert(after.end(), more.begin(), more.end());
        if (!frames().empty())
        {
            changes.push_back(StageAdded{after});
            push({name, changes});
            return;
        }
        const RegionChange change = change_between(statements(), after);
        if (change.before.empty() && change.after.empty())
            return;
        changes.push_back(change);
        push({name, changes});
    }

    std::vector<std::uint32_t> selected() const
    {
        if (edited.selection.empty())
            throw usage("nothing is selected");
        return ground().twins.of(edited.selection.samples());
    }

    void check_new_name(const std::string& name) const
    {
        if (name.empty() || !is_handle_name(name))
            throw usage("a region cannot be called " + in_quotes(name));
        if (std::any_of(regions.begin(), regions.end(),
                        [&](const EditedRegion& region) { return region.name == name; }))
            throw usage("there is a region " + in_quotes(name) + " already");
    }

    std::string free_name(Role role) const
    {
        const std::string word = role_name(role);
        for (int number = 1;; ++number)
        {
            const std::string name = number == 1 ? word : word + std::to_string(number);
            if (std::none_of(regions.begin(), regions.end(),
                             [&](const EditedRegion& region)
                             { return region.name == name; }))
                return name;
        }
    }

    JournalHeader header() const
    {
        return {path,
                scene_text(with_settings(scene, edited.settings)),
                handle_text(edited.handles),
                edited.handles.path,
                model->bytes.size(),
                checksum_of(model->bytes)};
    }

    void start_history()
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

    /// Keeps a journal that cannot be read, under another name.
    void set_aside(const Error& error)
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

    /// Looks for what an earlier run has left; true if there is something.
    bool find_left()
    {
        std::error_code none;
        if (journal.empty() || !std::filesystem::exists(journal, none))
            return false;
        JournalContents contents;
        try
        {
            Journal opened = Journal::open(journal, contents);
            if (contents.starts.empty())
                return false;
            left.emplace(Left{std::move(opened), std::move(contents)});
            return true;
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
};

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
        s.scene = read_scene(path);
        s.scene_path = path;
        s.warnings = s.scene.warnings;
        s.edited.settings = settings_in(s.scene);
        if (!s.scene.handles.empty())
            s.edited.handles = read_handles(s.scene.handles);
    }
    else
    {
        s.scene.path = path;
        s.scene.model = path;
    }
    s.model = std::make_shared<const GeometryFile>(read_geometry(s.scene.model));
    s.box = bounding_box(s.model->geometry.samples);
    s.frame = s.scene.frame ? given_frame(*s.scene.frame, s.scene.path)
                            : automatic_frame(s.box);
    s.edited.selection = Selection(s.model->geometry.samples.size());
    s.find_regions();
    s.journal_folder = journal_folder;
    s.journal = journal_path(journal_folder, path);
    if (!s.find_left())
        s.start_history();
}

std::size_t Document::num_recoverable() const
{
    return state_->left ? state_->left->contents.starts.size() : 0;
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
        Edited edited;
        edited.settings = settings_in(parse_scene(header.document, header.scene));
        edited.handles = parse_handles(header.handles_path, header.handles);
        edited.selection = Selection(s.model->geometry.samples.size());
        const std::uint32_t checksum = checksum_of(s.model->bytes);
        if (header.model_bytes != s.model->bytes.size() ||
            header.model_checksum != checksum)
            warnings.push_back(s.model->path +
                               ": has changed since then (its checksum was " +
                               std::to_string(header.model_checksum) + ", and is " +
                               std::to_string(checksum) + " now)");
        History history(std::move(left.journal), left.contents);
        for (std::size_t k = 0; k < history.position(); ++k)
            apply(history.edit(k), edited);
        s.edited = std::move(edited);
        s.stage_prints.clear();
        s.find_regions();
        s.history = std::move(history);
    }
    catch (const Error& error)
    {
        s.set_aside(error);
        s.start_history();
        throw;
    }
    s.saved_content.reset();
    ++s.revision;
    ++s.result_revision;
    return warnings;
}

void Document::drop_recoverable()
{
    if (!state_->left)
        return;
    state_->left->journal.remove();
    state_->left.reset();
    state_->start_history();
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

const EditSettings& Document::settings() const
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

std::uint64_t Document::stage_print() const
{
    return state_->stage_prints.back();
}

void Document::set_rest(std::uint64_t stage_print,
                        std::shared_ptr<const std::vector<Eigen::Vector3d>> samples)
{
    State& s = *state_;
    if (s.rest && s.rest_print == stage_print)
        return;
    s.rest = std::move(samples);
    s.rest_print = stage_print;
    s.twins.reset(); // another rest may come to lie where the last one was
    s.rest_box = bounding_box(*s.rest);
    if (s.edited.handles.stages.size() > 1 && s.stage_prints.back() == stage_print)
    {
        s.find_regions();
        ++s.revision;
    }
}

void Document::select(const Selection& selection, const std::string& name)
{
    const Selection toggled = state_->edited.selection.difference(selection);
    if (!toggled.empty())
        state_->push({name, {Toggled{toggled.runs()}}});
}

std::string Document::add_region(Role role, const std::string& name)
{
    State& s = *state_;
    const std::vector<std::uint32_t> samples = s.selected();
    const std::string given = name.empty() ? s.free_name(role) : name;
    s.check_new_name(given);
    std::vector<Draft> drafts = s.drafts();
    State::take_from_others(drafts, samples, role, given);
    // The selection has done its work: the colour of the region is to be seen.
    const std::string word = role_name(role);
    s.push_regions("Make " + (given == word ? word : word + " " + given), drafts,
                   {statement_of(given, role, kUsualStiffness, samples)},
                   {Toggled{s.edited.selection.runs()}});
    return given;
}

void Document::set_samples(const std::string& region)
{
    State& s = *state_;
    const EditedRegion& old = s.find(region);
    const std::vector<std::uint32_t> samples = s.selected();
    std::vector<Draft> drafts = s.drafts();
    for (Draft& draft : drafts)
        if (draft.region == &old)
            draft.statements = {statement_of(old.name, old.role, old.factor, samples)};
    State::take_from_others(drafts, samples, old.role, old.name);
    s.push_regions("Change " + region, drafts);
}

void Document::remove_region(const std::string& region)
{
    State& s = *state_;
    const EditedRegion& old = s.find(region);
    std::vector<Draft> drafts = s.drafts();
    std::erase_if(drafts, [&](const Draft& draft) { return draft.region == &old; });
    s.push_regions("Remove " + region, drafts);
}

void Document::rename_region(const std::string& region, const std::string& name)
{
    State& s = *state_;
    s.find(region);
    if (name == region)
        return;
    s.check_new_name(name);
    s.push({"Rename " + region, {Renamed{region, name}}});
}

void Document::set_role(const std::string& region, Role role, double factor)
{
    State& s = *state_;
    const EditedRegion& old = s.find(region);
    if (!(factor > 0) || !std::isfinite(factor))
        throw usage("stiffness: need a factor above 0 (got " + shortest(factor) + ")");
    if (old.role == role && (role != Role::Stiff || old.factor == factor))
        return;
    std::vector<Draft> drafts = s.drafts();
    for (Draft& draft : drafts)
        if (draft.region == &old)
            for (RegionStatement& statement : draft.statements)
            {
                statement.role = role;
                statement.factor = role == Role::Stiff ? factor : 1.0;
            }
    State::take_from_others(drafts, old.samples, role, old.name);
    s.push_regions("Make " + region + " " + role_name(role), drafts);
}

void Document::move_region(const std::string& region, const Placement& placement)
{
    State& s = *state_;
    const EditedRegion& old = s.find(region);
    if (!old.moves())
        throw usage(in_quotes(region) + " is " + role_name(old.role) +
                    ": only handles and pins move");
    if (!placement.translation.allFinite() || !placement.axis.allFinite() ||
        !std::isfinite(placement.degrees) || !(placement.axis.norm() > 0))
        throw usage("a place needs finite numbers");
    Placement to = placement;
    if (old.role == Role::Pin)
        to.degrees = 0.0; // it turns as it likes
    if (to.degrees == 0.0)
        to.axis = old.placement.axis;
    if (to == old.placement)
        return;
    std::int64_t number = 1;
    for (const Stage& stage : s.edited.handles.stages)
        if (!stage.frames.empty())
            number = stage.frames.back().number + 1;
    if (number >= kLastFrame)
        throw usage("a handle file has no frame after " + std::to_string(kLastFrame));
    const bool turns = to.degrees != old.placement.degrees;
    s.push({(turns ? "Turn " : "Move ") + region,
            {FramesAdded{frames_to(old, to, number, s.ground())}}});
}

void Document::change_settings(const EditSettings& settings)
{
    State& s = *state_;
    if (settings == s.edited.settings)
        return;
    const SceneFile scene = with_settings(s.scene, settings);
    parse_scene(scene.path, scene_text(scene)); // throws for what a file may not say
    s.push({"Change settings", {SettingsChange{s.edited.settings, settings}}});
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

bool Document::is_saved() const
{
    return state_->saved_content == history().content();
}

void Document::save(const std::string& scene_path, Overwrite overwrite)
{
    State& s = *state_;
    s.check_open();
    if (extension_of(scene_path) != "json")
        throw usage("a scene's name ends in .json (got " + in_quotes(scene_path) + ")");
    const bool is_own = scene_path == s.scene_path;
    SceneFile scene = with_settings(s.scene, s.edited.settings);
    scene.path = scene_path;
    if (!is_own || scene.handles.empty())
        scene.handles = scene_path.substr(0, scene_path.size() - 5) + ".handles";
    HandleFile handles = s.edited.handles;
    handles.path = scene.handles;
    if (is_own)
        overwrite = Overwrite::Yes;
    const std::string scene_bytes = scene_text(scene),
                      handle_bytes = handle_text(handles);
    check_output(scene.path, overwrite);
    check_output(scene.handles, overwrite);
    const std::string journal = journal_path(s.journal_folder, scene_path);
    if (!is_own && journal != s.journal)
        Journal::check_free(journal);
    write_file(scene.handles, handle_bytes, overwrite);
    write_file(scene.path, scene_bytes, overwrite);
    if (!is_own)
    {
        // Whoever opens the new scene finds the edits under its name.
        s.history.move_journal(journal);
        s.journal = journal;
    }
    s.scene_path = scene_path;
    s.scene = scene;
    s.edited.handles.path = scene.handles;
    s.saved_content = s.history.content();
    ++s.revision;
}

void Document::close()
{
    state_->history.remove();
}

} // namespace cellwarp
