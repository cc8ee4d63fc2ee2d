// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/scene_file.h"

#include <algorithm>
#include <cmath>
#include <string_view>

#include <nlohmann/json.hpp>

#include "io/bytes.h"
#include "io/error.h"
#include "io/number.h"
#include "io/relative_name.h"

namespace cellwarp
{

namespace
{

using Json = nlohmann::json;

constexpr int kMaxNesting = 128;

/// Reads the keys of one JSON object and complains about the others.
class Object
{
public:
    Object(const Json& json, SceneFile& scene, std::string prefix)
        : json_(json), scene_(scene), prefix_(std::move(prefix))
    {
        if (!json.is_object())
            fail("", "need an object");
    }

    const Json* find(const std::string& key)
    {
        known_.push_back(key);
        const auto found = json_.find(key);
        return found == json_.end() ? nullptr : &*found;
    }
    void read(const std::string& key, std::optional<std::string>& out)
    {
        const Json* value = find(key);
        if (!value)
            return;
        if (!value->is_string())
            fail(key, "need a text");
        out = value->get<std::string>();
    }
    void read(const std::string& key, const OneOf& allowed,
              std::optional<std::string>& out)
    {
        read(key, out);
        if (!out || allowed.has(*out))
            return;
        std::string words;
        for (const char* word : allowed.words)
            words += (words.empty() ? "" : ", ") + std::string(word);
        fail(key, "got " + in_quotes(*out) + ", need one of " + words);
    }
    void read(const std::string& key, const Between<std::int64_t>& allowed,
              std::optional<std::int64_t>& out)
    {
        const Json* value = find(key);
        if (!value)
            return;
        if (!value->is_number_integer() ||
            value->get<double>() < static_cast<double>(allowed.low) ||
            value->get<double>() > static_cast<double>(allowed.high))
            fail(key, "got " + value->dump().substr(0, 40) + ", need an integer from " +
                          std::to_string(allowed.low) + " to " +
                          std::to_string(allowed.high));
        out = value->get<std::int64_t>();
    }
    void read(const std::string& key, const Between<double>& allowed,
              std::optional<double>& out)
    {
        const Json* value = find(key);
        if (!value)
            return;
        if (!value->is_number() || !(value->get<double>() >= allowed.low) ||
            !(value->get<double>() <= allowed.high))
            fail(key, "got " + value->dump().substr(0, 40) + ", need a number from " +
                          shortest(allowed.low) + " to " + shortest(allowed.high));
        out = value->get<double>();
    }
    /// The settings of one section.
    void read_settings(std::string_view section)
    {
        visit_settings(
            [&](std::string_view in, const char* key, const auto& allowed, auto& value)
            {
                if (in == section)
                    read(key, allowed, value);
            },
            scene_.settings);
    }
    std::array<double, 3> vector(const std::string& key, const Json& value) const
    {
        std::array<double, 3> out{};
        if (!value.is_array() || value.size() != 3)
            fail(key, "need three numbers");
        for (std::size_t k = 0; k < 3; ++k)
        {
            if (!value[k].is_number() || !std::isfinite(value[k].get<double>()))
                fail(key, "need three finite numbers");
            out[k] = value[k].get<double>();
        }
        return out;
    }
    void warn_of_the_rest() const
    {
        for (const auto& [key, value] : json_.items())
            if (std::find(known_.begin(), known_.end(), key) == known_.end())
                scene_.warnings.push_back(
                    at({scene_.path, 0, prefix_ + key}, "unknown key, ignored"));
    }
    [[noreturn]] void fail(const std::string& key, const std::string& what) const
    {
        throw malformed({scene_.path, 0, prefix_ + key}, what);
    }

private:
    const Json& json_;
    SceneFile& scene_;
    std::string prefix_;
    std::vector<std::string> known_;
};

FrameBox read_frame(const Json& json, SceneFile& scene)
{
    Object object(json, scene, "cells.frame.");
    FrameBox frame;
    const Json* origin = object.find("origin");
    const Json* axes = object.find("axes");
    const Json* size = object.find("size");
    if (!origin || !size)
        object.fail("", "needs origin and size");
    frame.origin = object.vector("origin", *origin);
    frame.size = object.vector("size", *size);
    for (std::size_t k = 0; k < 3; ++k)
        frame.axes[k][k] = 1.0;
    if (axes)
    {
        if (!axes->is_array() || axes->size() != 3)
            object.fail("axes", "need three vectors");
        for (std::size_t k = 0; k < 3; ++k)
            frame.axes[k] = object.vector("axes", (*axes)[k]);
    }
    if (std::any_of(frame.size.begin(), frame.size.end(),
                    [](double s) { return !(s >= 0); }) ||
        std::all_of(frame.size.begin(), frame.size.end(),
                    [](double s) { return s == 0; }))
        object.fail("size", "need lengths >= 0, not all of them 0");
    object.warn_of_the_rest();
    return frame;
}

std::int64_t line_of(const std::string& text, std::size_t byte)
{
    const std::size_t end = std::min(byte, text.size());
    return 1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(end),
                          '\n');
}

} // namespace

SceneFile parse_scene(const std::string& path, const std::string& text)
{
    SceneFile scene;
    scene.path = path;
    scene.text = text;
    Json json;
    try
    {
        json = Json::parse(
            text,
            [&](int depth, Json::parse_event_t, Json&)
            {
                if (depth > kMaxNesting)
                    throw malformed({path, 0, ""}, "is nested deeper than 128");
                return true;
            });
    }
    catch (const Json::parse_error& error)
    {
        throw malformed({path, line_of(text, error.byte > 0 ? error.byte - 1 : 0), ""},
                        "is no JSON (byte " + std::to_string(error.byte) + ")");
    }
    catch (const Json::out_of_range&)
    {
        throw malformed({path, 0, ""}, "holds a number that is out of range");
    }
    Object root(json, scene, "");
    const Json* version = root.find("cellwarp");
    if (!version || !version->is_number_integer())
        root.fail("cellwarp", "is missing (need \"cellwarp\": 1)");
    if (version->get<std::int64_t>() != 1)
        root.fail("cellwarp", "made by version " + version->dump() + ", need 1");
    std::optional<std::string> model, handles;
    root.read("model", model);
    root.read("handles", handles);
    if (!model || model->empty())
        root.fail("model", "is missing");
    scene.model = resolved_name(path, *model);
    scene.handles = handles ? resolved_name(path, *handles) : "";
    root.read("save", scene.save);
    root.read_settings("");
    if (const Json* cells = root.find("cells"))
    {
        Object object(*cells, scene, "cells.");
        object.read_settings("cells");
        if (const Json* frame = object.find("frame"))
            scene.frame = read_frame(*frame, scene);
        object.warn_of_the_rest();
    }
    if (const Json* field = root.find("field"))
    {
        Object object(*field, scene, "field.");
        object.read_settings("field");
        object.warn_of_the_rest();
    }
    for (const char* later : {"rods", "skeleton", "simulate"})
        if (const Json* part = root.find(later); part && !part->empty())
            scene.warnings.push_back(
                at({path, 0, later}, "is not supported by this version, ignored"));
    root.warn_of_the_rest();
    return scene;
}

std::string scene_text(const SceneFile& scene)
{
    using Ordered = nlohmann::ordered_json;
    Ordered json = scene.text.empty() ? Ordered::object() : Ordered::parse(scene.text);
    json["cellwarp"] = 1;
    json["model"] = relative_name(scene.path, scene.model);
    if (scene.handles.empty())
        json.erase("handles");
    else
        json["handles"] = relative_name(scene.path, scene.handles);
    visit_settings(
        [&](const std::string& section, const char* key, const auto&, const auto& value)
        {
            if (value)
                (section.empty() ? json : json[section])[key] = *value;
            else if (section.empty())
                json.erase(key);
            else if (json.contains(section))
                json[section].erase(key);
        },
        scene.settings);
    if (scene.frame)
    {
        Ordered& frame = json["cells"]["frame"];
        frame["origin"] = scene.frame->origin;
        frame["axes"] = scene.frame->axes;
        frame["size"] = scene.frame->size;
    }
    else if (json.contains("cells"))
        json["cells"].erase("frame");
    if (scene.save)
        json["save"] = *scene.save;
    else
        json.erase("save");
    try
    {
        return json.dump(2) + "\n";
    }
    catch (const Ordered::type_error&)
    {
        throw Error(Fault::Usage,
                    at({scene.path, 0, ""},
                       "cannot name its model or handles: a name is no UTF-8 text"));
    }
}

SceneFile read_scene(const std::string& path)
{
    return parse_scene(path, read_file(path));
}

} // namespace cellwarp
