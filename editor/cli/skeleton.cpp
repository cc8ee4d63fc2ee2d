// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/cli/skeleton.h"

#include <map>
#include <memory>

#include <fmt/format.h>

#include "editor/cli/limbs.h"
#include "io/error.h"
#include "io/geometry_file.h"
#include "io/number.h"
#include "io/relative_name.h"
#include "io/skeleton_file.h"
#include "io/text.h"
#include "octree/base/index.h"

namespace cellwarp
{

namespace
{

struct SkeletonFlags
{
    std::string model, output, columns;
    LimbOptions options;
};

/// "root", then "limb3.2": the second joint of the third limb.
std::vector<SkeletonJoint> statements_of(const std::vector<LimbJoint>& joints)
{
    std::vector<SkeletonJoint> out;
    std::map<int, int> count;
    for (const LimbJoint& joint : joints)
    {
        SkeletonJoint& statement = out.emplace_back();
        statement.name = joint.parent < 0
                             ? "root"
                             : fmt::format("limb{}.{}", joint.limb, ++count[joint.limb]);
        if (joint.parent >= 0)
            statement.parent = out[idx(joint.parent)].name;
        statement.at = joint.at;
    }
    return out;
}

Json joints_json(const std::vector<SkeletonJoint>& joints)
{
    Json out = Json::array();
    for (const SkeletonJoint& joint : joints)
        out.push_back(
            {{"name", joint.name},
             {"parent", joint.parent.empty() ? Json(nullptr) : Json(joint.parent)},
             {"at", {joint.at.x(), joint.at.y(), joint.at.z()}}});
    return out;
}

std::string text_of(const SkeletonFlags& flags, const std::vector<SkeletonJoint>& joints)
{
    if (extension_of(flags.output) == "tgf")
        return tgf_text(joints);
    const Json scene = {{"cellwarp", 1},
                        {"model", relative_name(flags.output, flags.model)},
                        {"skeleton", {{"joints", joints_json(joints)}}}};
    return scene.dump(2) + "\n";
}

int run(const SkeletonFlags& flags, const CommonFlags& common)
{
    check_stdout(flags.output, common);
    if (const std::string extension = extension_of(flags.output);
        flags.output != "-" && extension != "tgf" && extension != "json")
        throw wrong_flag("--output", "got " + in_quotes(flags.output) +
                                         ", need a skeleton (.tgf) or a scene (.json)");
    if (flags.options.bones < 1 || flags.options.bones > 64)
        throw wrong_flag("--bones",
                         fmt::format("got {}, need 1 to 64", flags.options.bones));
    if (!(flags.options.bend >= 0.01 && flags.options.bend <= 100.0))
        throw wrong_flag("--bend",
                         fmt::format("got {}, need 0.01 to 100", flags.options.bend));
    check_output(flags.output, common.overwrite());
    const GeometryFile file = read_geometry(flags.model, {flags.columns});
    print_warnings(file.geometry.warnings, common);
    const std::vector<LimbJoint> found =
        limbs_of(flags.model, file.geometry, flags.options);
    const std::vector<SkeletonJoint> joints = statements_of(found);
    OutputSet outputs(common.overwrite());
    outputs.write(flags.output, text_of(flags, joints));
    if (common.is_json)
    {
        Json json = {{"model", flags.model}, {"joints", joints_json(joints)}};
        for (std::size_t k = 0; k < found.size(); ++k)
            json["joints"][k]["radius"] = found[k].radius;
        outputs.write("-", json_text(json));
    }
    outputs.commit();
    return 0;
}

} // namespace

void add_skeleton(CLI::App& app, CommonFlags& common, int& exit_code)
{
    const auto flags = std::make_shared<SkeletonFlags>();
    CLI::App* command = app.add_subcommand(
        "skeleton",
        "Joints and bones from the shape itself: where its limbs branch, bend and "
        "end.\n\n"
        "  cellwarp skeleton samples/creature.obj -o creature.tgf\n"
        "  cellwarp skeleton scan.ply -o scan.json && cellwarp render scan.json -o "
        "scan.png\n");
    command
        ->add_option("MODEL", flags->model,
                     "geometry file: a closed surface, or samples of one")
        ->required();
    command
        ->add_option("-o,--output", flags->output,
                     "FILE.tgf, or FILE.json: a scene of the model with these joints; -: "
                     "the scene on stdout")
        ->required();
    command->add_option(
        "--bend", flags->options.bend,
        fmt::format(
            "a limb has a joint where its line leaves straight bones by more than "
            "this share of its radius (default {})",
            flags->options.bend));
    command->add_option(
        "--bones", flags->options.bones,
        fmt::format("least bones of a limb that is longer than {} of its radii (default "
                    "{})",
                    kLongLimb, flags->options.bones));
    add_columns(*command, flags->columns);
    command->callback([flags, &common, &exit_code] { exit_code = run(*flags, common); });
}

} // namespace cellwarp
