// SPDX-License-Identifier: GPL-3.0-or-later
// cellwarp info: what files hold.
#include <memory>
#include <optional>

#include <CLI/CLI.hpp>
#include <Eigen/Geometry>
#include <fmt/format.h>

#include "editor/cli/command.h"
#include "editor/cli/simulation_json.h"
#include "io/base/error.h"
#include "io/base/number.h"
#include "io/base/text.h"
#include "io/formats/field_file.h"
#include "io/formats/geometry_file.h"
#include "io/scene/handle_file.h"
#include "io/scene/scene_file.h"
#include "library/session/deformation.h"
#include "library/session/json.h"
#include "library/session/limbs.h"
#include "library/session/scene_script.h"
#include "library/session/session_json.h"
#include "library/study/sweep.h"

namespace cellwarp::core
{

namespace
{

Json describe(const GeometryFile& file, const std::optional<Parts>& parts)
{
    const Geometry& geometry = file.geometry;
    const ModelBox box = bounding_box(geometry.samples);
    Json json = Json::object();
    json["format"] = geometry.format;
    json["samples"] = geometry.samples.size();
    json["faces"] = geometry.num_faces();
    json["triangles"] = geometry.num_triangles();
    json["lines"] = geometry.lines.size();
    json["box"] = {{box.low.x(), box.low.y(), box.low.z()},
                   {box.high.x(), box.high.y(), box.high.z()}};
    if (!geometry.columns.empty())
        json["columns"] = geometry.columns;
    json["attributes"] = geometry.attributes;
    json["writable"] = geometry.not_writable.empty();
    json["parts"] = parts_json(parts);
    return json;
}

/// "x y z" of three numbers.
std::string corner_text(const Json& corner)
{
    std::string line;
    for (const Json& x : corner)
        line += (line.empty() ? "" : " ") + shortest(x.get<double>());
    return line;
}

std::string as_text(const Json& json)
{
    std::string text = fmt::format(
        "  format      {}\n  samples     {}\n  faces       {} ({} "
        "triangles)\n",
        json["format"].get<std::string>(), json["samples"].get<std::size_t>(),
        json["faces"].get<std::size_t>(), json["triangles"].get<std::size_t>());
    if (const auto lines = json["lines"].get<std::size_t>(); lines > 0)
        text += fmt::format("  lines       {}\n", lines);
    text += "  box         " + corner_text(json["box"][0]) + " to " +
            corner_text(json["box"][1]) + "\n";
    const auto names = [&](const char* key)
    {
        std::string list;
        for (const Json& name : json[key])
            list += (list.empty() ? "" : ", ") + name.get<std::string>();
        return list;
    };
    if (json.contains("columns"))
        text += "  columns     " + names("columns") + "\n";
    const std::string attributes = names("attributes");
    text += "  attributes  " + (attributes.empty() ? "none" : attributes) + "\n";
    return text + "  writable    " + (json["writable"].get<bool>() ? "yes" : "no") + "\n";
}

Json corners_json(const Eigen::AlignedBox3d& box)
{
    return {{box.min().x(), box.min().y(), box.min().z()},
            {box.max().x(), box.max().y(), box.max().z()}};
}

/// What a saved deformation holds; its box is that of the first stage's frame.
Json describe(const FieldFile& file)
{
    const WorkFrame frame = frame_of(file.stages.front());
    const Eigen::AlignedBox3d own(Eigen::Vector3d::Zero().eval(), frame.size);
    Eigen::AlignedBox3d box;
    for (int k = 0; k < 8; ++k)
        box.extend(
            frame.to_model(own.corner(static_cast<Eigen::AlignedBox3d::CornerType>(k))));
    Json json = {{"format", "cwf"},
                 {"box", corners_json(box)},
                 {"checksum", fmt::format("{:08x}", file.checksum)},
                 {"stages", Json::array()}};
    for (const StoredField& stage : file.stages)
        json["stages"].push_back(
            {{"field", field_name(static_cast<FieldKind>(stage.kind))},
             {"cells", stage.edges.size()},
             {"centres", stage.num_centres},
             {"regions", stage.regions.size()}});
    return json;
}

std::string text_of_field(const Json& json)
{
    std::string text =
        fmt::format("  format      cwf, a saved deformation (cellwarp apply)\n"
                    "  box         {} to {}, of the model\n  checksum    {}\n",
                    corner_text(json["box"][0]), corner_text(json["box"][1]),
                    json["checksum"].get<std::string>());
    for (const Json& stage : json["stages"])
        text += fmt::format("  stage       {}, {} cells, {} moved regions\n",
                            stage["field"].get<std::string>(),
                            stage["cells"].get<std::size_t>(),
                            stage["regions"].get<std::size_t>());
    return text;
}

Json describe(const std::vector<LimbEnd>& ends)
{
    Json all = Json::array();
    for (const LimbEnd& end : ends)
        all.push_back(
            {{"samples", end.num_samples}, {"relative_box", corners_json(end.box)}});
    return all;
}

std::string text_of_extremities(const Json& ends)
{
    std::string text;
    for (const Json& end : ends)
        text +=
            fmt::format("  extremity   box {}  {}\n", corner_text(end["relative_box"][0]),
                        corner_text(end["relative_box"][1]));
    if (text.empty())
        return "  extremity   none: every limb holds more than a quarter of the "
               "samples\n";
    return text + "              (selectors for --fix and --handle with --relative)\n";
}

/// A region's statement; of a rod or curve how it is told.
Json describe(const RegionStatement& region)
{
    Json json = {{"name", region.name}, {"role", role_name(region.role)}};
    if (!region.spline)
        return json;
    const SplineStatement& line = *region.spline;
    json["told"] = line.form == SplineStatement::Form::Through  ? "through"
                   : line.form == SplineStatement::Form::Points ? "points"
                                                                : "skeleton";
    json["points"] = line.points.size();
    json["closed"] = line.is_closed;
    if (!line.radii.empty())
        json["radius"] = line.radii.front();
    if (line.stiffness)
        json["stiffness"] = *line.stiffness;
    return json;
}

/// What a scene holds beside its model.
struct SceneContents
{
    std::string model; ///< empty: none
    Json json = Json::object();
};

SceneContents contents_of(const std::string& path)
{
    SceneContents out;
    Json regions = Json::array(), joints = Json::array();
    std::size_t frames = 0;
    const SceneFile scene = read_scene(path);
    out.model = scene.model;
    if (!scene.model.empty())
    {
        std::vector<std::string> warnings; // those of the scene are for other commands
        if (const std::optional<HandleFile> script =
                script_of(scene, scene.handles, warnings))
            for (const Stage& stage : script->stages)
            {
                for (const RegionStatement& region : stage.regions)
                    regions.push_back(describe(region));
                for (const SkeletonJoint& joint : stage.joints)
                    joints.push_back(joint.name);
                frames += stage.frames.size();
            }
    }
    out.json["regions"] = std::move(regions);
    out.json["joints"] = std::move(joints);
    out.json["frames"] = frames;
    Json time = objects_json(scene);
    out.json["rods_in_time"] = time.is_null() ? Json::array() : time["rods"];
    out.json["time"] = std::move(time);
    return out;
}

std::string text_of(const SceneContents& scene)
{
    std::string text;
    const auto add = [&](const std::string& what, const std::string& name)
    { text += fmt::format("  {:<11} {}\n", what, name); };
    const auto told = [](const Json& line, const std::string& by)
    {
        return fmt::format("{}{} {} points{}", line["name"].get<std::string>(), by,
                           line["points"].get<std::size_t>(),
                           line["closed"].get<bool>() ? ", closed" : "");
    };
    for (const Json& region : scene.json["regions"])
    {
        std::string name = region["name"].get<std::string>();
        if (region.contains("told"))
            name = region["told"] == "skeleton" ? name + ", from the shape's skeleton"
                   : region["told"] == "points" ? told(region, ", by control points:")
                                                : told(region, ", through");
        if (region.contains("radius"))
            name += ", radius " + shortest(region["radius"].get<double>());
        if (region.contains("stiffness"))
            name += ", pushes back with stiffness " +
                    shortest(region["stiffness"].get<double>());
        add(region["role"].get<std::string>(), name);
    }
    for (const Json& rod : scene.json["rods_in_time"])
        add("rod in time",
            told(rod, ",") + (rod["carries"].get<bool>() ? ", carries the model" : ""));
    if (!scene.json["joints"].empty())
        add("joints", std::to_string(scene.json["joints"].size()));
    const Json& time = scene.json["time"];
    if (time.is_null())
    {
        add("frames", std::to_string(scene.json["frames"].get<std::size_t>()));
        return text;
    }
    for (const Json& sheet : time["sheets"])
    {
        const std::vector<int> counts = sheet["counts"].get<std::vector<int>>();
        add(counts.size() == 3 ? "block" : "sheet",
            fmt::format("{}, {} control points", sheet["name"].get<std::string>(),
                        fmt::join(counts, " x ")));
    }
    for (const Json& net : time["nets"])
        add("net",
            fmt::format("{}, points: {}, springs: {}", net["name"].get<std::string>(),
                        net["points"].get<std::size_t>(),
                        net["springs"].get<std::size_t>()));
    for (const Json& body : time["bodies"])
        add("body", fmt::format("{}, {} kg", body["name"].get<std::string>(),
                                shortest(body["mass"].get<double>())));
    for (const char* what : {"joints", "obstacles"})
        if (const auto count = time[what].get<std::size_t>(); count > 0)
            add(what, std::to_string(count));
    add("in time", time["seconds"].is_null()
                       ? std::string("an equilibrium")
                       : fmt::format("{} frames, {} s", time["frames"].get<std::size_t>(),
                                     shortest(time["seconds"].get<double>())));
    return text;
}

struct InfoFlags
{
    std::vector<std::string> files;
    std::string columns;
    bool tells_extremities = false;
};

int run(const InfoFlags& flags, const CommonFlags& common)
{
    Json all = Json::array();
    std::string text;
    int exit_code = 0;
    for (const std::string& path : flags.files)
        try
        {
            std::optional<SceneContents> scene;
            if (extension_of(path) == "json")
                scene = contents_of(path);
            text += path + "\n";
            if (extension_of(path) == "cwf")
            {
                all.push_back(describe(read_field(path)));
                text += text_of_field(all.back());
                continue;
            }
            if (scene && scene->model.empty())
            {
                all.push_back(scene->json);
                text += text_of(*scene);
                continue;
            }
            const GeometryFile file =
                read_geometry(scene ? scene->model : path, {flags.columns});
            print_warnings(file.geometry.warnings, common);
            const std::optional<Parts> parts = mesh_parts(file.geometry);
            all.push_back(describe(file, parts));
            if (scene)
                all.back().update(scene->json);
            text +=
                as_text(all.back()) + parts_text(parts) + (scene ? text_of(*scene) : "");
            if (!file.geometry.not_writable.empty())
                text += "              " + file.geometry.not_writable + "\n";
            if (flags.tells_extremities)
            {
                all.back()["extremities"] =
                    describe(limb_ends(limbs_of(path, file.geometry), file.geometry));
                text += text_of_extremities(all.back()["extremities"]);
            }
        }
        catch (const Error& error)
        {
            // The others are still told; alone, or in JSON, there is nothing to tell.
            if (flags.files.size() == 1 || common.is_json)
                throw;
            say(fmt::format("error: {}\n", error.what()));
            exit_code = static_cast<int>(error.fault());
        }
    if (common.is_json)
    {
        Json json = {{"files", all}};
        if (all.size() == 1)
            json.update(all[0]); // scripts find the keys of a single file here, too
        text = json_text(json);
    }
    write_file("-", text, Overwrite::Yes);
    return exit_code;
}

} // namespace

void add_info(CLI::App& app, CommonFlags& common, int& exit_code)
{
    const auto flags = std::make_shared<InfoFlags>();
    CLI::App* command = app.add_subcommand(
        "info", "What geometry files, scenes and saved fields hold.\n\n"
                "  cellwarp info bunny.obj\n"
                "  cellwarp info --extremities creature.obj\n"
                "  cellwarp info --json a.ply b.ply\n"
                "  cellwarp info samples/tail.json\n");
    command
        ->add_option("FILE", flags->files,
                     "geometry files: obj, ply, stl, off, pcd, gltf, glb, text in "
                     "columns, or what can only be read (fbx, dae, 3ds, ...); scenes "
                     "(json); saved "
                     "fields (cwf)")
        ->required();
    command->add_flag("--extremities", flags->tells_extremities,
                      "where limbs end: boxes to fix and to grab, for --relative");
    add_columns(*command, flags->columns);
    command->callback([flags, &common, &exit_code] { exit_code = run(*flags, common); });
}

} // namespace cellwarp::core
