// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/document/edit.h"

#include <algorithm>
#include <array>
#include <limits>

#include <nlohmann/json.hpp>

#include "io/error.h"
#include "io/number.h"

namespace cellwarp
{

namespace
{

using Json = nlohmann::ordered_json;

/// What an edit asks of the document and is not so: a journal of another document.
[[noreturn]] void misfit(const Edit& edit, const char* what)
{
    throw Error(Fault::Malformed,
                "the edit " + in_quotes(edit.name) + " does not fit: " + what);
}

Stage& last_stage(Edited& edited)
{
    return edited.handles.stages.back();
}

/// Does changes of one edit, forth or back.
class Applying
{
public:
    Applying(const Edit& edit, Edited& edited, bool is_back)
        : edit_(edit), edited_(edited), is_back_(is_back)
    {
    }

    void operator()(const Toggled& change)
    {
        const std::size_t count = edited_.selection.num_samples();
        if (std::any_of(change.runs.begin(), change.runs.end(),
                        [&](const SampleRun& run)
                        {
                            return run.first < 0 || run.second < run.first ||
                                   run.second >= static_cast<std::int64_t>(count);
                        }))
            misfit(edit_, "the model has other samples");
        edited_.selection = edited_.selection.difference(Selection(count, change.runs));
    }

    void operator()(const RegionChange& change)
    {
        const std::vector<RegionStatement>& old = is_back_ ? change.after : change.before;
        const std::vector<RegionStatement>& now = is_back_ ? change.before : change.after;
        std::vector<RegionStatement>& regions = last_stage(edited_).regions;
        if (change.index > regions.size() || old.size() > regions.size() - change.index)
            misfit(edit_, "the regions are others");
        const auto at = regions.begin() + static_cast<std::ptrdiff_t>(change.index);
        const auto next = regions.erase(at, at + static_cast<std::ptrdiff_t>(old.size()));
        regions.insert(next, now.begin(), now.end());
    }

    void operator()(const Renamed& change)
    {
        const std::string& old = is_back_ ? change.after : change.before;
        const std::string& now = is_back_ ? change.before : change.after;
        for (RegionStatement& region : last_stage(edited_).regions)
            if (region.name == old)
                region.name = now;
        for (FrameStatement& frame : last_stage(edited_).frames)
            for (Move& move : frame.moves)
                if (move.region == old)
                    move.region = now;
        for (OnStatement& on : last_stage(edited_).ons)
            for (std::string* const name : {&on.pin, &on.guide})
                if (*name == old)
                    *name = now;
        for (RegionStatement& region : last_stage(edited_).regions)
            if (region.spline && region.spline->near == old)
            {
                SplineStatement spline = *region.spline;
                spline.near = now;
                region.spline = std::make_shared<const SplineStatement>(spline);
            }
    }

    void operator()(const FramesAdded& change)
    {
        std::vector<FrameStatement>& frames = last_stage(edited_).frames;
        if (!is_back_)
            frames.insert(frames.end(), change.frames.begin(), change.frames.end());
        else if (frames.size() < change.frames.size())
            misfit(edit_, "its frames are not there");
        else
            frames.resize(frames.size() - change.frames.size());
    }

    void operator()(const StageAdded& change)
    {
        if (!is_back_)
            edited_.handles.stages.push_back({change.regions, {}});
        else if (edited_.handles.stages.size() < 2)
            misfit(edit_, "its commit is not there");
        else
            edited_.handles.stages.pop_back();
    }

    void operator()(const OnsChange& change)
    {
        last_stage(edited_).ons = is_back_ ? change.before : change.after;
    }

    void operator()(const SettingsChange& change)
    {
        // Journals of older versions leave out energy and thickness, which then stay.
        visit_settings(
            [](const char*, const char*, const auto&, const auto& from, const auto& to,
               auto& setting)
            {
                if (from != to)
                    setting = to;
            },
            is_back_ ? change.after : change.before,
            is_back_ ? change.before : change.after, edited_.settings);
    }

private:
    const Edit& edit_;
    Edited& edited_;
    bool is_back_;
};

// --- as text -------------------------------------------------------------------------

constexpr std::array kRoles = {"fixed", "handle", "pin", "stiff", "rod", "curve"};
constexpr std::array kSelectors = {"box",    "sphere", "capsule", "halfspace", "indices",
                                   "labels", "group",  "all",     "spline"};
constexpr std::array kOperations = {"translate", "rotate", "matrix",
                                    "to",        "turn",   "tangent"};
constexpr std::array kPlaces = {"whole", "point", "start", "end"};

template <class Kind, std::size_t n>
const char* word_of(Kind kind, const std::array<const char*, n>& words)
{
    return words[static_cast<std::size_t>(kind)];
}

template <class Kind, std::size_t n>
Kind kind_of(const Json& word, const std::array<const char*, n>& words)
{
    const std::string text = word.get<std::string>();
    const auto found = std::find(words.begin(), words.end(), text);
    if (found == words.end())
        throw std::invalid_argument("unknown word " + in_quotes(text));
    return static_cast<Kind>(found - words.begin());
}

Json json_of(const Eigen::Vector3d& v)
{
    return {v.x(), v.y(), v.z()};
}

Eigen::Vector3d vector_of(const Json& json)
{
    const auto v = json.get<std::array<double, 3>>();
    return {v[0], v[1], v[2]};
}

/// First and last of every run, one after the other.
Json json_of(const std::vector<SampleRun>& runs)
{
    Json json = Json::array();
    for (const auto& [first, last] : runs)
    {
        json.push_back(first);
        json.push_back(last);
    }
    return json;
}

std::vector<SampleRun> runs_of(const Json& json)
{
    if (json.size() % 2 != 0)
        throw std::invalid_argument("runs come in pairs");
    std::vector<SampleRun> runs;
    for (std::size_t k = 0; k + 1 < json.size(); k += 2)
        runs.emplace_back(json.at(k).get<std::int64_t>(),
                          json.at(k + 1).get<std::int64_t>());
    return runs;
}

Json json_of(const RegionStatement& region)
{
    const Selector& selector = region.selector;
    Json json = {{"role", word_of(region.role, kRoles)},
                 {"name", region.name},
                 {"factor", region.factor},
                 {"by", word_of(selector.kind, kSelectors)}};
    if (!selector.numbers.empty())
        json["numbers"] = selector.numbers;
    if (!selector.ranges.empty())
        json["runs"] = json_of(selector.ranges);
    if (!selector.name.empty())
        json["of"] = selector.name;
    if (selector.label != 0)
        json["label"] = selector.label;
    // Rods and curves as a handle file has them.
    if (region.spline)
        json["line"] = region_text(region, "");
    return json;
}

RegionStatement region_of(const Json& json)
{
    RegionStatement region;
    if (json.contains("line"))
    {
        const HandleFile file = parse_handles(
            "line", "cellwarp-handles 1\n" + json["line"].get<std::string>());
        if (file.stages[0].regions.size() != 1 || !file.stages[0].regions[0].spline)
            throw std::invalid_argument("the line is no rod and no curve");
        region = file.stages[0].regions[0];
        region.line = 0;
        return region;
    }
    region.role = kind_of<Role>(json.at("role"), kRoles);
    region.name = json.at("name").get<std::string>();
    region.factor = json.at("factor").get<double>();
    region.selector.kind = kind_of<Selector::Kind>(json.at("by"), kSelectors);
    if (json.contains("numbers"))
        region.selector.numbers = json["numbers"].get<std::vector<double>>();
    if (json.contains("runs"))
        region.selector.ranges = runs_of(json["runs"]);
    region.selector.name = json.value("of", std::string());
    region.selector.label = json.value("label", std::int64_t(0));
    return region;
}

Json json_of(const std::vector<RegionStatement>& regions)
{
    Json json = Json::array();
    for (const RegionStatement& region : regions)
        json.push_back(json_of(region));
    return json;
}

std::vector<RegionStatement> regions_of(const Json& json)
{
    std::vector<RegionStatement> regions;
    for (const Json& region : json)
        regions.push_back(region_of(region));
    return regions;
}

Json json_of(const Operation& operation)
{
    Json json = {{"kind", word_of(operation.kind, kOperations)}};
    if (operation.kind == Operation::Kind::Matrix)
    {
        for (int i = 0; i < 4; ++i)
            for (int j = 0; j < 4; ++j)
                json["rows"].push_back((*operation.matrix)(i, j));
        return json;
    }
    json["vector"] = json_of(operation.vector);
    if (operation.kind == Operation::Kind::Rotate ||
        operation.kind == Operation::Kind::Turn)
        json["degrees"] = operation.degrees;
    if (operation.about)
        json["about"] = json_of(*operation.about);
    return json;
}

Operation operation_of(const Json& json)
{
    Operation operation;
    operation.kind = kind_of<Operation::Kind>(json.at("kind"), kOperations);
    if (operation.kind == Operation::Kind::Matrix)
    {
        const auto rows = json.at("rows").get<std::array<double, 16>>();
        operation.matrix = std::make_shared<const Eigen::Matrix4d>(
            Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(rows.data()));
        return operation;
    }
    operation.vector = vector_of(json.at("vector"));
    operation.degrees = json.value("degrees", 0.0);
    if (json.contains("about"))
        operation.about = vector_of(json["about"]);
    return operation;
}

Json json_of(const FrameStatement& frame)
{
    Json moves = Json::array();
    for (const Move& move : frame.moves)
    {
        Json operations = Json::array();
        for (const Operation& operation : move.operations)
            operations.push_back(json_of(operation));
        Json& json =
            moves.emplace_back(Json{{"region", move.region}, {"do", operations}});
        if (move.place.kind != MovePlace::Kind::Whole)
            json["at"] = {word_of(move.place.kind, kPlaces), move.place.point};
        if (!move.chain.empty())
            json["chain"] = move.chain;
        if (move.released)
            json["released"] = {move.released->place, move.released->tangent,
                                move.released->twist};
    }
    return {{"number", frame.number}, {"moves", moves}};
}

FrameStatement frame_of(const Json& json)
{
    FrameStatement frame;
    frame.number = json.at("number").get<std::int64_t>();
    for (const Json& move_json : json.at("moves"))
    {
        Move& move = frame.moves.emplace_back();
        move.region = move_json.at("region").get<std::string>();
        if (move_json.contains("at"))
        {
            move.place.kind = kind_of<MovePlace::Kind>(move_json["at"].at(0), kPlaces);
            move.place.point = move_json["at"].at(1).get<std::int64_t>();
        }
        move.chain = move_json.value("chain", std::string());
        if (move_json.contains("released"))
        {
            const auto parts = move_json["released"].get<std::array<bool, 3>>();
            move.released = HoldParts{parts[0], parts[1], parts[2]};
        }
        for (const Json& operation : move_json.at("do"))
            move.operations.push_back(operation_of(operation));
    }
    return frame;
}

template <class Value>
void put(Json& json, const char* key, const std::optional<Value>& value)
{
    if (value)
        json[key] = *value;
}

template <class Value>
void get(const Json& json, const char* key, std::optional<Value>& value)
{
    if (json.contains(key))
        value = json[key].get<Value>();
}

Json json_of(const SceneSettings& settings)
{
    Json json = Json::object();
    visit_settings([&](const char*, const char* key, const auto&, const auto& value)
                   { put(json, key, value); },
                   settings);
    return json;
}

SceneSettings settings_of(const Json& json)
{
    SceneSettings settings;
    visit_settings([&](const char*, const char* key, const auto&, auto& value)
                   { get(json, key, value); },
                   settings);
    return settings;
}

Json json_of(const std::vector<OnStatement>& ons)
{
    Json json = Json::array();
    for (const OnStatement& on : ons)
    {
        Json& one = json.emplace_back(Json{{"pin", on.pin}, {"guide", on.guide}});
        put(one, "at", on.at);
    }
    return json;
}

std::vector<OnStatement> ons_of(const Json& json)
{
    std::vector<OnStatement> ons;
    for (const Json& one : json)
    {
        OnStatement& on = ons.emplace_back();
        on.pin = one.at("pin").get<std::string>();
        on.guide = one.at("guide").get<std::string>();
        get(one, "at", on.at);
    }
    return ons;
}

/// Each change is an object whose one key tells its kind.
struct ChangeJson
{
    Json operator()(const Toggled& change) const
    {
        return {{"toggle", json_of(change.runs)}};
    }
    Json operator()(const RegionChange& change) const
    {
        return {{"region",
                 {{"index", change.index},
                  {"before", json_of(change.before)},
                  {"after", json_of(change.after)}}}};
    }
    Json operator()(const Renamed& change) const
    {
        return {{"rename", {{"before", change.before}, {"after", change.after}}}};
    }
    Json operator()(const FramesAdded& change) const
    {
        Json frames = Json::array();
        for (const FrameStatement& frame : change.frames)
            frames.push_back(json_of(frame));
        return {{"frames", frames}};
    }
    Json operator()(const StageAdded& change) const
    {
        return {{"commit", json_of(change.regions)}};
    }
    Json operator()(const OnsChange& change) const
    {
        return {{"on",
                 {{"before", json_of(change.before)}, {"after", json_of(change.after)}}}};
    }
    Json operator()(const SettingsChange& change) const
    {
        return {{"settings",
                 {{"before", json_of(change.before)}, {"after", json_of(change.after)}}}};
    }
};

Change change_of(const Json& json)
{
    const std::string kind = json.begin().key();
    const Json& value = json.begin().value();
    if (kind == "toggle")
        return Toggled{runs_of(value)};
    if (kind == "region")
        return RegionChange{value.at("index").get<std::size_t>(),
                            regions_of(value.at("before")),
                            regions_of(value.at("after"))};
    if (kind == "rename")
        return Renamed{value.at("before").get<std::string>(),
                       value.at("after").get<std::string>()};
    if (kind == "frames")
    {
        FramesAdded added;
        for (const Json& frame : value)
            added.frames.push_back(frame_of(frame));
        return added;
    }
    if (kind == "commit")
        return StageAdded{regions_of(value)};
    if (kind == "on")
        return OnsChange{ons_of(value.at("before")), ons_of(value.at("after"))};
    if (kind == "settings")
        return SettingsChange{settings_of(value.at("before")),
                              settings_of(value.at("after"))};
    throw std::invalid_argument("unknown change " + in_quotes(kind));
}

} // namespace

void apply(const Edit& edit, Edited& edited)
{
    for (const Change& change : edit.changes)
        std::visit(Applying(edit, edited, false), change);
}

void take_back(const Edit& edit, Edited& edited)
{
    for (auto change = edit.changes.rbegin(); change != edit.changes.rend(); ++change)
        std::visit(Applying(edit, edited, true), *change);
}

std::string edit_text(const Edit& edit)
{
    Json json = {{"name", edit.name}, {"changes", Json::array()}};
    for (const Change& change : edit.changes)
        json["changes"].push_back(std::visit(ChangeJson(), change));
    try
    {
        return json.dump();
    }
    catch (const Json::exception&)
    {
        throw Error(Fault::Usage, "a name is no UTF-8 text: " + in_quotes(edit.name));
    }
}

Edit parse_edit(std::string_view text, const std::string& where)
{
    try
    {
        const Json json = Json::parse(text);
        Edit edit;
        edit.name = json.at("name").get<std::string>();
        for (const Json& change : json.at("changes"))
        {
            if (!change.is_object() || change.size() != 1)
                throw std::invalid_argument("a change needs one key");
            edit.changes.push_back(change_of(change));
        }
        return edit;
    }
    catch (const std::exception& error)
    {
        throw malformed({where, 0, "edit"}, error.what());
    }
}

} // namespace cellwarp
