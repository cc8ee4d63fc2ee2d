// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/cli/session_flags.h"

#include <algorithm>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "editor/cli/command.h"
#include "io/base/error.h"
#include "io/base/text.h"

namespace cellwarp::core
{

namespace
{

/// A flag's number in its range; usage errors name the flag.
template <class Number>
Number in_range(const char* flag, Number value, Number low, Number high)
{
    if (!(value >= low) || !(value <= high))
        throw wrong_flag(flag, fmt::format("got {}, need {} to {}", value, low, high));
    return value;
}

template <class Number>
void check_flag(const std::string& flag, Number given, const Between<Number>& allowed)
{
    in_range(flag.c_str(), given, allowed.low, allowed.high);
}

void check_flag(const std::string& flag, const std::string& given, const OneOf& allowed)
{
    if (allowed.has(given))
        return;
    throw wrong_flag(flag, fmt::format("got {}, need {}", in_quotes(given),
                                       fmt::join(allowed.words, " or ")));
}

void check_flag(const std::string&, bool, YesOrNo) {}

/// "--max-depth" of "max_depth".
std::string flag_of(std::string key)
{
    std::replace(key.begin(), key.end(), '_', '-');
    return "--" + key;
}

} // namespace

void SessionFlags::add_to(CLI::App& app)
{
    const SessionSettings defaults;
    app.add_option(
           "MODEL", model,
           "scene (json) or geometry file: obj, ply, stl, off, pcd, gltf, glb, text in "
           "columns, or what can only be read (fbx, dae, 3ds, ...)")
        ->required();
    add_columns(app, columns);
    app.add_option("--handles", handles, "handle file: regions and frames");
    script.add_to(app);
    app.footer(
        R"(Selectors: box X0 Y0 Z0 X1 Y1 Z1, sphere X Y Z R, capsule X0 Y0 Z0 X1 Y1 Z1 R,
halfspace NX NY NZ D (n.x >= D), indices I J K-L, labels FILE VALUE, group NAME, all.
Moves, from the rest shape, in the order written: translate X Y Z,
rotate X Y Z DEGREES [about X Y Z | about border], matrix and 16 numbers row by row,
to X Y Z (a pin). A region turns about the middle of its box; 'about X Y Z' names
another pivot, 'about border' is where it is attached. Positive degrees turn
counterclockwise, seen with the axis pointing at you.
)");
    app.add_option("--sel", sel, "region labels of the deformation survey (with --def)");
    app.add_option("--def", def, "handle matrix of the deformation survey (with --sel)");
    app.add_flag("--preview", is_preview,
                 "stop at the drag-quality field (closest-cell blend)");
    app.add_option(
        "--across", settings.cells.across,
        "coarsest cells along the longest side (default: so many that there are "
        "1,000 to 2,500 cells)");
    app.add_option("--max-depth", settings.cells.max_depth,
                   fmt::format("splits below the coarsest cells, at the most (default "
                               "{})",
                               kUsualDepth));
    app.add_option(
        "--threshold", settings.cells.threshold,
        fmt::format(
            "cells whose error is larger are split, of the diagonal; 0: all, down "
            "to --max-depth (default {}; {} with --energy botsch07)",
            kUsualThreshold, kUsualGap));
    app.add_option(
        "--fill", settings.cells.fill,
        "solid, shell, or closed: solid, with lids over all openings of a mesh "
        "(default solid, which closes narrow ones)");
    app.add_option(
        "--gap", settings.cells.gap,
        fmt::format("parts farther apart than this, of the diagonal, are never "
                    "glued (default {})",
                    defaults.cells.gap));
    app.add_option(
        "--thickness", settings.cells.thickness,
        fmt::format("of shells and open sheets, of the diagonal; solids ignore "
                    "it (default {})",
                    defaults.cells.thickness));
    app.add_option(
        "--loose", settings.cells.loose,
        "follow or stay: a part that no region holds goes with the part nearest to it, "
        "or keeps its place (default follow; stay with --energy botsch07)");
    app.add_flag_function(
        "--join", [this](std::int64_t) { settings.cells.join = true; },
        "closed parts of a mesh that touch or overlap at rest are one material (default: "
        "each is its own)");
    app.add_flag_function(
           "--flat", [this](std::int64_t) { settings.cells.flat = true; },
           "all samples lie in a plane and all moves keep it: cells have three unknowns, "
           "and nothing leaves the plane (default: where the samples lie in a plane that "
           "the first frame that moves something keeps; not with --energy botsch07)")
        ->excludes(app.add_flag_function(
            "--no-flat", [this](std::int64_t) { settings.cells.flat = false; },
            "a flat model bends in space, like a sheet of paper"));
    app.add_flag_function(
        "--contact", [this](std::int64_t) { settings.cells.contact = true; },
        "parts that come to touch do not pass through each other: the cells of one stay "
        "out of those of the other");
    app.add_option("--max-cells", settings.cells.max_cells,
                   fmt::format("most cells (default {})", defaults.cells.max_cells));
    app.add_option("--energy", settings.energy,
                   "cellwarp, or botsch07: the paper's own method as a whole, its "
                   "fields and solver among it (default cellwarp)");
    app.add_option(
        "--solver", solver,
        "newton, gauss-newton or gauss-newton-direct, which factorises in each "
        "iteration (default newton; gauss-newton with --energy botsch07)");
    app.add_option("--max-iterations", max_iterations,
                   fmt::format("of one frame (default {})", defaults.max_iterations));
    app.add_flag("--tight", is_tight, "solve to a gradient of 1e-10 instead of 1e-6");
    app.add_option(
        "--time", time,
        "seconds that the solve of one frame may take, other cells for it included");
    add_max_memory(app, max_memory);
}

bool SessionFlags::has_session() const
{
    return extension_of(model) == "json" || !handles.empty() || !sel.empty() ||
           script.is_given();
}

SessionRequest read_request(const SessionFlags& flags, ForTime for_time)
{
    if (flags.sel.empty() != flags.def.empty())
        throw Error(Fault::Usage, "--sel and --def go together");
    if (!flags.sel.empty() && !flags.handles.empty())
        throw Error(Fault::Usage, "--handles and --sel with --def exclude each other");
    if (flags.script.is_given() && !(flags.handles.empty() && flags.sel.empty()))
        throw Error(Fault::Usage, "--fix, --handle and --move say what --handles, or "
                                  "--sel with --def, say: they exclude each other");
    if (flags.script.is_lost())
        throw Error(Fault::Usage, "--relative goes with --fix, --handle and --move");
    visit_settings(
        [](const char*, const char* key, const auto& allowed, const auto& given)
        {
            if (given)
                check_flag(flag_of(key), *given, allowed);
        },
        flags.settings);
    SceneChanges changes;
    changes.columns = flags.columns;
    changes.handle_file = flags.handles;
    changes.settings = flags.settings;
    changes.is_preview = flags.is_preview;
    changes.max_memory = memory_limit(flags.max_memory);
    if (flags.script.is_given())
        changes.script = flags.script.handles();
    else if (!flags.sel.empty())
        changes.script = read_survey_pair(flags.sel, flags.def);
    SessionRequest request = request_of(flags.model, for_time, changes);
    if (flags.script.is_given() && request.scene.skeleton)
        throw Error(Fault::Usage, "--fix, --handle and --move do not know the skeleton "
                                  "of a scene: write a handle file");
    SessionSettings& settings = request.settings;
    if (flags.max_iterations)
        settings.max_iterations =
            static_cast<int>(in_range("--max-iterations", *flags.max_iterations,
                                      std::int64_t(0), std::int64_t(1000000)));
    if (flags.time)
        settings.time_budget = in_range("--time", *flags.time, 0.0, 1e9);
    const std::string solver = flags.solver.value_or("");
    if (solver == "newton")
        settings.method = Method::Newton;
    else if (solver == "gauss-newton")
        settings.method = Method::GaussNewton;
    else if (solver == "gauss-newton-direct")
        settings.method = Method::GaussNewtonDirect;
    else if (flags.solver)
        throw wrong_flag("--solver",
                         "got " + in_quotes(solver) +
                             ", need newton, gauss-newton or gauss-newton-direct");
    if (flags.is_tight)
        settings.gradient_tolerance = 1e-10;
    return request;
}

} // namespace cellwarp::core
