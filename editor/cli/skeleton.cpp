// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/cli/command.h"

#include <algorithm>
#include <memory>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "editor/cli/skin_shares.h"
#include "io/base/error.h"
#include "io/base/number.h"
#include "io/base/output_set.h"
#include "io/base/relative_name.h"
#include "io/base/text.h"
#include "io/formats/geometry_file.h"
#include "io/scene/skeleton_file.h"
#include "io/scene/skinned_file.h"
#include "library/session/json.h"
#include "library/session/limbs.h"
#include "library/session/retargeted_motion.h"
#include "octree/base/index.h"
#include "octree/limb_names.h"

namespace cellwarp::core
{

namespace
{

struct SkeletonFlags
{
    std::string model, output, columns, motion, up = "y";
    LimbOptions options;
    std::vector<std::string> without, soft; ///< names of limbs or joints
};

/// Between the dots.
std::vector<std::string> words_of_name(const std::string& name)
{
    std::vector<std::string> out(1);
    for (const char c : name)
        if (c == '.')
            out.emplace_back();
        else
            out.back() += c;
    return out;
}

std::string joined_names(const std::vector<std::string>& names)
{
    std::string out;
    for (const std::string& name : names)
        out += (out.empty() ? "" : ", ") + name;
    return out;
}

/// Whether a name, "leg" or "leg.L" or "leg.2.L", is that of a joint or of its limb: its
/// parts between the dots are there in the same order, the first one first.
bool is_named(const std::string& joint, const std::string& name)
{
    const std::vector<std::string> of_joint = words_of_name(joint),
                                   of_name = words_of_name(name);
    if (of_name.front() != of_joint.front())
        return false;
    std::size_t k = 0;
    for (const std::string& part : of_joint)
        if (k < of_name.size() && part == of_name[k])
            ++k;
    return k == of_name.size();
}

/// Marks the joints that a flag names. Throws where it names none, or the root.
std::vector<char> named_by(const std::string& flag, const std::vector<std::string>& names,
                           const std::vector<std::string>& joints)
{
    std::vector<char> out(joints.size(), 0);
    for (const std::string& name : names)
    {
        bool is_there = false;
        for (std::size_t k = 0; k < joints.size(); ++k)
            if (is_named(joints[k], name))
                out[k] = is_there = true;
        if (!is_there)
            throw wrong_flag(flag, "got " + in_quotes(name) +
                                       ", which is neither a joint nor a limb of this "
                                       "shape (there are " +
                                       joined_names(joints) + ")");
    }
    if (out[0])
        throw wrong_flag(flag, "the root cannot be left out");
    return out;
}

/// The joints that stay: what is named by --without is not there, nor is of --soft what
/// comes after its first bone, from a joint that is named on; neither is what hangs on
/// them.
std::vector<char> staying(const SkeletonFlags& flags,
                          const std::vector<LimbJoint>& joints,
                          const std::vector<std::string>& names)
{
    const std::vector<char> without = named_by("--without", flags.without, names);
    std::vector<char> soft = named_by("--soft", flags.soft, names);
    std::vector<char> stays(joints.size(), 1);
    for (std::size_t k = 1; k < joints.size(); ++k)
    {
        const std::size_t parent = idx(joints[k].parent);
        const bool begins = !soft[parent];
        const bool goes_on = std::any_of(joints.begin(), joints.end(),
                                         [&](const LimbJoint& other)
                                         { return other.parent == static_cast<int>(k); });
        soft[k] = soft[k] || soft[parent];
        stays[k] = stays[parent] && !without[k] && (!soft[k] || (begins && goes_on));
    }
    return stays;
}

std::vector<SkeletonJoint> statements_of(const SkeletonFlags& flags,
                                         const std::vector<LimbJoint>& joints,
                                         const std::vector<std::string>& names,
                                         const std::vector<char>& stays)
{
    std::vector<SkeletonJoint> out;
    for (std::size_t k = 0; k < joints.size(); ++k)
    {
        if (!stays[k])
            continue;
        SkeletonJoint& statement = out.emplace_back();
        statement.name = names[k];
        if (joints[k].parent >= 0)
            statement.parent = names[idx(joints[k].parent)];
        statement.at = joints[k].at;
    }
    if (out.size() < 2)
        throw wrong_flag(flags.without.empty() ? "--soft" : "--without",
                         "no bone is left");
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

std::string text_of(const SkeletonFlags& flags, const Geometry& geometry,
                    const std::vector<SkeletonJoint>& joints, const CommonFlags& common)
{
    const std::string extension = extension_of(flags.output);
    MotionStatement motion;
    motion.file = flags.motion;
    if (extension == "glb")
    {
        SkeletonScene scene;
        scene.joints = joints;
        scene.motion = motion;
        const SkeletonValues moving = moving_skeleton(scene, flags.model);
        print_warnings(moving.warnings, common);
        return skinned_glb(flags.output, geometry, moving,
                           skin_shares(geometry.samples, joints));
    }
    if (extension == "tgf")
        return tgf_text(joints);
    Json scene = {{"cellwarp", 1},
                  {"model", relative_name(flags.output, flags.model)},
                  {"skeleton", {{"joints", joints_json(joints)}}}};
    if (!flags.motion.empty())
        scene["skeleton"]["motion"] = {
            {"file", relative_name(flags.output, flags.motion)}};
    return scene.dump(2) + "\n";
}

int run(const SkeletonFlags& flags, const CommonFlags& common)
{
    check_stdout(flags.output, common);
    if (const std::string extension = extension_of(flags.output);
        flags.output != "-" && extension != "tgf" && extension != "json" &&
        extension != "glb")
        throw wrong_flag("--output", "got " + in_quotes(flags.output) +
                                         ", need a skeleton (.tgf), a scene (.json) or a "
                                         "model with a skin (.glb)");
    if (!flags.motion.empty() && extension_of(flags.output) == "tgf")
        throw wrong_flag("--motion", "a .tgf holds no motion");
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
    const std::vector<std::string> names = limb_names(found, flags.up[0]);
    const std::vector<char> stays = staying(flags, found, names);
    const std::vector<SkeletonJoint> joints = statements_of(flags, found, names, stays);
    OutputSet outputs(common.overwrite());
    outputs.write(flags.output, text_of(flags, file.geometry, joints, common));
    if (common.is_json)
    {
        Json json = {{"model", flags.model}, {"joints", joints_json(joints)}};
        std::size_t at = 0;
        for (std::size_t k = 0; k < found.size(); ++k)
            if (stays[k])
                json["joints"][at++]["radius"] = found[k].radius;
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
                     "FILE.tgf; FILE.json: a scene of the model with these joints; "
                     "FILE.glb: the model with a skin, for engines; -: the scene on "
                     "stdout")
        ->required();
    command->add_option(
        "--bend", flags->options.bend,
        fmt::format(
            "a limb has a joint where its line leaves straight bones by more than "
            "this share of its radius (default {})",
            flags->options.bend));
    command->add_option(
        "--bones", flags->options.bones,
        fmt::format(
            "bones that a straight piece of a limb is divided into if it is longer "
            "than {} of its radii (default {})",
            kLongBone, flags->options.bones));
    command
        ->add_option("--without", flags->without,
                     "NAME: without the bones of this limb (leg, leg.L, limb7) or from "
                     "this joint on (leg.2.L), so that flesh there swings; repeatable")
        ->allow_extra_args(false);
    command
        ->add_option("--soft", flags->soft,
                     "NAME: the same, but the first bone of several stays, so that the "
                     "limb begins where the body is; repeatable")
        ->allow_extra_args(false);
    command->add_option(
        "--motion", flags->motion,
        "FILE.bvh, .gltf or .glb, y up: its motion moves these joints, in a "
        "scene or as the animation of a .glb");
    command->add_option("--up", flags->up, "axis that points up, for names (default y)")
        ->check(CLI::IsMember({"x", "y", "z"}));
    add_columns(*command, flags->columns);
    command->callback([flags, &common, &exit_code] { exit_code = run(*flags, common); });
}

} // namespace cellwarp::core
