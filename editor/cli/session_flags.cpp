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

/// The flag of a setting.
template <class Value>
void add_setting(CLI::App& app, const SettingText& text, const Usual<Value>& usual,
                 std::optional<Value>& value)
{
    const std::string help =
        fmt::format("{} (default {})", text.help_with_unit(), usual.in_words());
    if constexpr (std::is_same_v<Value, bool>)
    {
        const auto flag_to =
            [&](const std::string& flag, const std::string& what, bool to)
        {
            return app.add_flag_function(
                flag, [&value, to](std::int64_t) { value = to; }, what);
        };
        CLI::Option* const yes = flag_to(text.flag(), help, true);
        if (*text.help_of_no != 0)
            yes->excludes(flag_to(text.flag("--no-"), text.help_of_no, false));
    }
    else
        app.add_option(text.flag(), value, help);
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
    visit_settings(
        [&](const SettingText& text, const auto&, const auto& usual, auto& value)
        {
            if (text.has_flag)
                add_setting(app, text, usual, value);
        },
        settings);
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

SessionRequest read_request(const SessionFlags& flags, ForTime for_time,
                            std::optional<SceneFile> scene)
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
        [](const SettingText& text, const auto& allowed, const auto&, const auto& given)
        {
            if (given)
                check_flag(text.flag(), *given, allowed);
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
    SessionRequest request = request_of(
        scene ? std::move(*scene) : scene_or_model(flags.model), for_time, changes);
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
