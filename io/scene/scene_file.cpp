// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/scene/scene_file.h"

#include <algorithm>
#include <string_view>

#include "io/base/bytes.h"
#include "io/base/error.h"
#include "io/base/near_word.h"
#include "io/base/number.h"
#include "io/base/relative_name.h"
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

FrameBox read_frame(const Json& json, SceneFile& scene)
{
    JsonObject object(json, scene.path, "cells.frame.", scene.warnings);
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

SceneFile scene_of(const std::string& path, const std::string& text)
{
    SceneFile scene;
    scene.path = path;
    scene.text = text;
    const Json json = parse_json(path, text, &scene.warnings);
    JsonObject root(json, path, "", scene.warnings);
    const Json* version = root.find("cellwarp");
    if (!version || !version->is_number_integer())
        root.fail("cellwarp", "is missing (need \"cellwarp\": 1)");
    if (version->get<std::int64_t>() != 1)
        root.fail("cellwarp", "made by version " + version->dump() + ", need 1");
    std::optional<std::string> model, handles;
    root.read("model", model);
    root.read("handles", handles);
    if (!model)
    {
        std::vector<std::string> keys;
        for (const auto& [key, value] : json.items())
            keys.push_back(key);
        const std::string near = nearest_word("model", keys);
        root.fail("model",
                  "is missing" +
                      (near.empty() ? "" : " (there is " + in_quotes(near) + ")"));
    }
    if (model->empty())
        root.fail("model", "names no file");
    scene.model = resolved_name(path, *model);
    scene.handles = handles ? resolved_name(path, *handles) : "";
    root.read("save", scene.save);
    read_settings(root, "", scene.settings);
    if (const Json* cells = root.find("cells"))
    {
        JsonObject object(*cells, path, "cells.", scene.warnings);
        read_settings(object, "cells", scene.settings);
        if (const Json* frame = object.find("frame"))
            scene.frame = read_frame(*frame, scene);
        object.warn_of_the_rest();
    }
    if (const Json* field = root.find("field"))
    {
        JsonObject object(*field, path, "field.", scene.warnings);
        read_settings(object, "field", scene.settings);
        object.warn_of_the_rest();
    }
    const auto leave_out = [&](const char* key, const char* why)
    {
        if (const Json* part = root.find(key); part && !part->empty())
            scene.left_out.push_back(at({path, 0, key}, why));
    };
    if (const Json* rods = root.find("rods"); rods && rods->is_array())
        for (const Json& rod : *rods)
            scene.has_carriers |= rod.is_object() && rod.value("carries", Json()) == true;
    for (const char* key : {"rods", "bodies", "nets", "sheets", "joints", "obstacles",
                            "contact", "unit", "simulate"})
        leave_out(key, "is for cellwarp simulate, ignored");
    if (const Json* skeleton = root.find("skeleton"))
    {
        JsonObject object(*skeleton, path, "skeleton.", scene.warnings);
        scene.skeleton =
            parse_skeleton_scene(object, path, scene.warnings, scene.left_out);
    }
    scene.has_rods = json.contains("rods") || json.contains("sheets") ||
                     json.contains("bodies") || json.contains("nets");
    if (scene.skeleton && json.contains("simulate"))
    {
        scene.time.emplace().dt = kStepOfFlesh;
        if (!scene.has_rods)
            scene.time->integrator = "bdf2";
        read_time_settings(root, path, *scene.time, scene.warnings);
    }
    root.warn_of_the_rest();
    return scene;
}

} // namespace

SceneFile parse_scene(const std::string& path, const std::string& text)
{
    return with_lines(path, text, [&] { return scene_of(path, text); });
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
    json["model"] = relative_name(scene.path, scene.model);
    if (scene.handles.empty())
        json.erase("handles");
    else
        json["handles"] = relative_name(scene.path, scene.handles);
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
        if (json.contains("skeleton") && !scene.has_rods)
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

std::string moved_scene_text(const std::string& text, const std::string& from,
                             const std::string& to)
{
    using Ordered = nlohmann::ordered_json;
    if (text.empty() || from == to)
        return text;
    Ordered json = Ordered::parse(text);
    const auto move_name = [&](Ordered& of, const char* key)
    {
        if (of.is_object() && of.contains(key) && of[key].is_string())
            of[key] = relative_name(to, resolved_name(from, of[key].get<std::string>()));
    };
    if (json.contains("skeleton") && json["skeleton"].is_object())
    {
        Ordered& skeleton = json["skeleton"];
        for (const char* key : {"file", "animation_file", "weights"})
            move_name(skeleton, key);
        if (skeleton.contains("lattice") && skeleton["lattice"] != "octree")
            move_name(skeleton, "lattice");
        if (skeleton.contains("motion"))
            move_name(skeleton["motion"], "file");
    }
    for (const char* key : {"obstacles", "contact"})
        if (json.contains(key) && json[key].is_array())
            for (Ordered& obstacle : json[key])
                move_name(obstacle, "mesh");
    return json.dump(2) + "\n";
}

bool has_model(const std::string& path)
{
    return parse_json(path, read_file(path)).contains("model");
}

SceneFile read_scene(const std::string& path)
{
    return parse_scene(path, read_file(path));
}

} // namespace cellwarp::core
