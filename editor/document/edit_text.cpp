// SPDX-License-Identifier: GPL-3.0-or-later
// Edits as records of a journal. Each change is an object whose one key tells its kind;
// statements stand in it as lines of a handle file.
#include <nlohmann/json.hpp>

#include "editor/document/edit.h"
#include "io/base/error.h"
#include "io/base/number.h"

namespace cellwarp::core
{

namespace
{

using Json = nlohmann::ordered_json;

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
    visit_settings([&](const SettingText& text, const auto&, const auto&,
                       const auto& value) { put(json, text.key, value); },
                   settings);
    return json;
}

SceneSettings settings_of(const Json& json)
{
    SceneSettings settings;
    visit_settings([&](const SettingText& text, const auto&, const auto&, auto& value)
                   { get(json, text.key, value); },
                   settings);
    return settings;
}

std::string lines_of(const std::vector<RegionStatement>& regions)
{
    Stage part;
    part.regions = regions;
    return statements_text(part);
}
std::string lines_of(const std::vector<FrameStatement>& frames)
{
    Stage part;
    part.frames = frames;
    return statements_text(part);
}
std::string lines_of(const std::vector<OnStatement>& ons)
{
    Stage part;
    part.ons = ons;
    return statements_text(part);
}

Stage statements_of(const Json& lines)
{
    return parse_statements("statements", lines.get<std::string>());
}

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
                  {"before", lines_of(change.before)},
                  {"after", lines_of(change.after)}}}};
    }
    Json operator()(const Renamed& change) const
    {
        return {{"rename", {{"before", change.before}, {"after", change.after}}}};
    }
    Json operator()(const FramesAdded& change) const
    {
        return {{"frames", lines_of(change.frames)}};
    }
    Json operator()(const StageAdded& change) const
    {
        return {{"commit", lines_of(change.regions)}};
    }
    Json operator()(const OnsChange& change) const
    {
        return {
            {"on",
             {{"before", lines_of(change.before)}, {"after", lines_of(change.after)}}}};
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
                            statements_of(value.at("before")).regions,
                            statements_of(value.at("after")).regions};
    if (kind == "rename")
        return Renamed{value.at("before").get<std::string>(),
                       value.at("after").get<std::string>()};
    if (kind == "frames")
        return FramesAdded{statements_of(value).frames};
    if (kind == "commit")
        return StageAdded{statements_of(value).regions};
    if (kind == "on")
        return OnsChange{statements_of(value.at("before")).ons,
                         statements_of(value.at("after")).ons};
    if (kind == "settings")
        return SettingsChange{settings_of(value.at("before")),
                              settings_of(value.at("after"))};
    throw std::invalid_argument("unknown change " + in_quotes(kind));
}

} // namespace

std::string edit_text(const Edit& edit)
{
    try
    {
        Json json = {{"name", edit.name}, {"changes", Json::array()}};
        for (const Change& change : edit.changes)
            json["changes"].push_back(std::visit(ChangeJson(), change));
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

} // namespace cellwarp::core
