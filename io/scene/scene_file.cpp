// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/scene/scene_file.h"

#include <algorithm>
#include <limits>
#include <string_view>

#include "io/base/bytes.h"
#include "io/base/error.h"
#include "io/base/near_word.h"
#include "io/base/number.h"
#include "io/base/relative_name.h"
#include "io/base/text.h"
#include "io/scene/json_object.h"

namespace cellwarp::core
{

namespace
{
/// The settings of one section.
void read_settings(JsonObject& object, std::string_view section, SceneSettings& settings)
{
    visit_settings(
        [&](const SettingText& text, const auto& allowed, const auto&, auto& value)
        {
            if (text.section == section)
                object.read(text.key, allowed, value);
        },
        settings);
}

FrameBox read_frame(JsonObject& object)
{
    constexpr double kAnySize = std::numeric_limits<double>::max();
    FrameBox frame;
    const bool has_origin = object.read("origin", frame.origin, kAnySize);
    if (!object.read("size", frame.size, kAnySize) || !has_origin)
        object.fail("", "needs origin and size");
    for (std::size_t k = 0; k < 3; ++k)
        frame.axes[k][k] = 1.0;
    const Json* const given = object.find("axes");
    if (given && (!given->is_array() || given->size() != 3))
        object.fail("axes", "need three vectors");
    std::vector<Triple> axes;
    if (object.read("axes", axes, kAnySize))
        std::copy(axes.begin(), axes.end(), frame.axes.begin());
    if (std::any_of(frame.size.begin(), frame.size.end(),
                    [](double s) { return !(s >= 0); }) ||
        std::all_of(frame.size.begin(), frame.size.end(),
                    [](double s) { return s == 0; }))
        object.fail("size", "need lengths >= 0, not all of them 0");
    return frame;
}

/// Whether a scene has objects that move in time.
bool has_objects(const Json& json)
{
    for (const char* key : {"rods", "bodies", "nets", "sheets"})
        if (json.contains(key) && !json[key].empty())
            return true;
    return false;
}

/// Reads all that is for simulate.
void read_time(JsonObject& root, const Json& json, SceneFile& scene)
{
    RodScene& time = scene.time;
    time.path = scene.path;
    if (scene.skeleton)
        time.dt = kStepOfFlesh;
    if (scene.skeleton && !has_objects(json))
        time.integrator = "bdf2";
    scene.is_simulated = read_time_settings(root, time);
    read_objects_in_time(root, scene.skeleton.has_value(), time);
    if (time.carries() && scene.model.empty())
        root.fail("model", "is missing: rods carry its cells");
}

void read_model(JsonObject& root, const Json& json, SceneFile& scene)
{
    if (root.read_file_name("model", scene.model) || !scene.model.empty() ||
        has_objects(json))
        return;
    std::vector<std::string> keys;
    for (const auto& [key, value] : json.items())
        keys.push_back(key);
    const std::string near = nearest_word("model", keys);
    root.fail("model",
              "is missing" + (near.empty() ? "" : " (there is " + in_quotes(near) + ")"));
}

void read_root(JsonObject& root, const Json& json, SceneFile& scene)
{
    const Json* const version = root.find("cellwarp");
    if (!version || !version->is_number_integer())
        root.fail("cellwarp", "is missing (need \"cellwarp\": 1)");
    if (version->get<std::int64_t>() != 1)
        root.fail("cellwarp", "made by version " + version->dump() + ", need 1");
    read_model(root, json, scene);
    root.read_file_name("handles", scene.handles);
    root.read("save", scene.save);
    read_settings(root, "", scene.settings);
    root.read_object("cells",
                     [&](JsonObject& cells)
                     {
                         read_settings(cells, "cells", scene.settings);
                         cells.read_object("frame", [&](JsonObject& frame)
                                           { scene.frame = read_frame(frame); });
                     });
    root.read_object("field", [&](JsonObject& field)
                     { read_settings(field, "field", scene.settings); });
    std::vector<std::string> of_flesh;
    root.read_object("skeleton", [&](JsonObject& skeleton)
                     { scene.skeleton = parse_skeleton_scene(skeleton, of_flesh); });
    const std::size_t num_of_edits = root.known().size();
    read_time(root, json, scene);
    scene.left_out = root.left_out(num_of_edits, "is for cellwarp simulate, ignored");
    scene.left_out.insert(scene.left_out.end(), of_flesh.begin(), of_flesh.end());
    root.warn_of_the_rest();
}

/// The JSON pointer of a key: "/rods/2/points" of "rods[2].points".
std::string pointer_of(const std::string& key)
{
    std::string pointer = "/";
    for (const char c : key)
        if (c == '.' || c == '[')
            pointer += '/';
        else if (c != ']')
            pointer += c;
    return pointer;
}

} // namespace

SceneFile parse_scene(const std::string& path, const std::string& text,
                      const std::string& model)
{
    SceneFile scene;
    scene.path = path;
    scene.model = model;
    scene.text = text;
    JsonReading reading{path, text};
    const Json json = parse_json(reading);
    JsonObject root(json, reading, "");
    read_root(root, json, scene);
    scene.warnings = std::move(reading.warnings);
    scene.unknown_keys = std::move(reading.unknown_keys);
    scene.file_keys = std::move(reading.file_keys);
    return scene;
}

void need_model(const SceneFile& scene)
{
    if (scene.model.empty())
        throw malformed({scene.path, 0, "model"}, "is missing");
}

std::string scene_text(const SceneFile& scene)
{
    using Ordered = nlohmann::ordered_json;
    Ordered json = scene.text.empty() ? Ordered::object() : Ordered::parse(scene.text);
    // Null that becomes an object by its first key is not destroyed well where memory
    // ends (nlohmann 3.11.2).
    const auto object_in = [](Ordered& of, const std::string& name) -> Ordered&
    {
        if (!of.contains(name))
            of[name] = Ordered::object();
        return of[name];
    };
    json["cellwarp"] = 1;
    for (const auto& [key, file] :
         {std::pair{"model", scene.model}, std::pair{"handles", scene.handles}})
        if (file.empty())
            json.erase(key);
        else
            json[key] = relative_name(scene.path, file);
    visit_settings(
        [&](const SettingText& text, const auto&, const auto&, const auto& value)
        {
            const std::string section = text.section, key = text.key;
            if (value)
                (section.empty() ? json : object_in(json, section))[key] = *value;
            else if (section.empty())
                json.erase(key);
            else if (json.contains(section))
                json[section].erase(key);
        },
        scene.settings);
    if (scene.frame)
    {
        Ordered& frame = object_in(object_in(json, "cells"), "frame");
        frame["origin"] = scene.frame->origin;
        frame["axes"] = scene.frame->axes;
        frame["size"] = scene.frame->size;
    }
    else if (json.contains("cells"))
        json["cells"].erase("frame");
    if (!scene.skeleton)
    {
        // What followed it in time goes with it.
        if (json.contains("skeleton") && !scene.time.has_objects())
            json.erase("simulate");
        json.erase("skeleton");
    }
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

std::string moved_scene_text(const SceneFile& scene, const std::string& to)
{
    if (scene.text.empty() || scene.path == to)
        return scene.text;
    using Ordered = nlohmann::ordered_json;
    Ordered json = Ordered::parse(scene.text);
    for (const std::string& key : scene.file_keys)
    {
        Ordered& name = json[Ordered::json_pointer(pointer_of(key))];
        name = relative_name(to, resolved_name(scene.path, name.get<std::string>()));
    }
    return json.dump(2) + "\n";
}

SceneFile read_scene(const std::string& path)
{
    return parse_scene(path, read_file(path));
}

SceneFile scene_or_model(const std::string& path)
{
    if (extension_of(path) == "json")
        return read_scene(path);
    SceneFile scene;
    scene.path = scene.model = path;
    return scene;
}

} // namespace cellwarp::core
