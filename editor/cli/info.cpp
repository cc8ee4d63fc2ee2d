// SPDX-License-Identifier: GPL-3.0-or-later
// cellwarp info: what files hold.
#include <memory>

#include <fmt/format.h>

#include "editor/cli/command.h"
#include "io/error.h"
#include "io/geometry_file.h"
#include "io/number.h"

namespace cellwarp
{

namespace
{

Json describe(const GeometryFile& file)
{
    const Geometry& geometry = file.geometry;
    const ModelBox box = bounding_box(geometry.samples);
    Json json;
    json["format"] = geometry.format;
    json["samples"] = geometry.samples.size();
    json["faces"] = geometry.num_faces();
    json["triangles"] = geometry.num_triangles();
    json["box"] = {{box.low.x(), box.low.y(), box.low.z()},
                   {box.high.x(), box.high.y(), box.high.z()}};
    json["attributes"] = geometry.attributes;
    json["writable"] = geometry.not_writable.empty();
    return json;
}

std::string as_text(const Json& json)
{
    std::string text = fmt::format(
        "  format      {}\n  samples     {}\n  faces       {} ({} "
        "triangles)\n",
        json["format"].get<std::string>(), json["samples"].get<std::size_t>(),
        json["faces"].get<std::size_t>(), json["triangles"].get<std::size_t>());
    const auto corner = [&](std::size_t k)
    {
        std::string line;
        for (const Json& x : json["box"][k])
            line += " " + shortest(x.get<double>());
        return line;
    };
    text += "  box        " + corner(0) + " to" + corner(1) + "\n";
    std::string attributes;
    for (const Json& name : json["attributes"])
        attributes += (attributes.empty() ? "" : ", ") + name.get<std::string>();
    text += "  attributes  " + (attributes.empty() ? "none" : attributes) + "\n";
    return text + "  writable    " + (json["writable"].get<bool>() ? "yes" : "no") + "\n";
}

struct InfoFlags
{
    std::vector<std::string> files;
    std::string columns;
};

int run(const InfoFlags& flags, const CommonFlags& common)
{
    Json all = Json::array();
    std::string text;
    int exit_code = 0;
    for (const std::string& path : flags.files)
        try
        {
            const GeometryFile file = read_geometry(path, {flags.columns});
            print_warnings(file.geometry.warnings, common);
            all.push_back(describe(file));
            text += path + "\n" + as_text(all.back());
            if (!file.geometry.not_writable.empty())
                text += "              " + file.geometry.not_writable + "\n";
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
        text = (flags.files.size() == 1 ? all[0] : Json{{"files", all}}).dump(2) + "\n";
    write_file("-", text, Overwrite::Yes);
    return exit_code;
}

} // namespace

void add_info(CLI::App& app, CommonFlags& common, int& exit_code)
{
    const auto flags = std::make_shared<InfoFlags>();
    CLI::App* command =
        app.add_subcommand("info", "What geometry files hold.\n\n"
                                   "  cellwarp info bunny.obj\n"
                                   "  cellwarp info --json a.ply b.ply\n");
    command
        ->add_option("FILE", flags->files,
                     "geometry files: obj, ply, stl, off, pcd, gltf, glb, text in "
                     "columns, or what can only be read (fbx, dae, 3ds, ...)")
        ->required();
    add_columns(*command, flags->columns);
    command->callback([flags, &common, &exit_code] { exit_code = run(*flags, common); });
}

} // namespace cellwarp
