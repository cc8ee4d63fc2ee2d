// SPDX-License-Identifier: GPL-3.0-or-later
#include <cellwarp/settings.h>

#include <cmath>
#include <limits>
#include <string>

#include "io/base/error.h"
#include "io/base/number.h"
#include "io/scene/scene_file.h"
#include "library/calls.h"
#include "library/convert.h"
#include "library/session/memory_limit.h"
#include "library/session/scene_settings.h"

namespace cellwarp
{

namespace
{

constexpr double kEndless = std::numeric_limits<double>::infinity();

const char* word_of(Fill fill)
{
    return fill == Fill::Shell ? "shell" : fill == Fill::Closed ? "closed" : "solid";
}

core::SceneSettings stated(const Settings& settings)
{
    core::SceneSettings out;
    if (settings.is_botsch07)
        out.energy = "botsch07";
    const CellSettings& cells = settings.cells;
    out.cells.fill = word_of(cells.fill);
    if (cells.across != 0)
        out.cells.across = cells.across;
    out.cells.max_depth = cells.max_depth;
    if (cells.threshold != kEndless)
        out.cells.threshold = cells.threshold;
    out.cells.gap = cells.gap;
    out.cells.thickness = cells.thickness;
    if (cells.loose)
        out.cells.loose = *cells.loose == Loose::Follow ? "follow" : "stay";
    out.cells.join = cells.join;
    out.cells.flat = cells.flat;
    out.cells.contact = cells.contact;
    out.cells.max_cells = cells.max_cells;
    if (settings.field)
        switch (*settings.field)
        {
        case FieldKind::Rbf:
            out.field.release = "rbf";
            break;
        case FieldKind::RbfGlobal:
            out.field.release = "rbf-global";
            break;
        case FieldKind::Blend:
        case FieldKind::Closest4:
            out.field.release = "blend";
            out.field.drag = *settings.field == FieldKind::Blend ? "blend" : "closest4";
            break;
        }
    return out;
}

void check_number(const char* field, double value, double low, double high)
{
    if (!(value >= low && value <= high))
        throw wrong_argument(field, "got " + core::shortest(value) + ", need " +
                                        core::shortest(low) + " to " +
                                        core::shortest(high));
}

void check_frame(const Frame& frame)
{
    constexpr double kLargest = 1e150;
    double longest = 0.0;
    for (std::size_t k = 0; k < 3; ++k)
    {
        check_number("frame.origin", frame.origin[k], -kLargest, kLargest);
        check_number("frame.size", frame.size[k], 0.0, kLargest);
        longest = std::max(longest, frame.size[k]);
        for (const double number : frame.axes[k])
            check_number("frame.axes", number, -2.0, 2.0);
    }
    if (longest == 0.0)
        throw wrong_argument("frame.size", "all of it is 0");
}

} // namespace

double memory_limit(double max_memory)
{
    check_number("max_memory", max_memory, 0.0, kEndless);
    if (max_memory == kEndless)
        return 0.0;
    return max_memory > 0.0 ? max_memory : core::default_memory_limit();
}

core::FieldKind to_core(FieldKind kind)
{
    switch (kind)
    {
    case FieldKind::Rbf:
        return core::FieldKind::Rbf;
    case FieldKind::RbfGlobal:
        return core::FieldKind::RbfGlobal;
    case FieldKind::Blend:
        return core::FieldKind::Blend;
    case FieldKind::Closest4:
        return core::FieldKind::Closest4;
    }
    throw wrong_argument("field", "its kind is not known");
}

FieldKind from_core(core::FieldKind kind)
{
    switch (kind)
    {
    case core::FieldKind::Rbf:
        return FieldKind::Rbf;
    case core::FieldKind::Blend:
        return FieldKind::Blend;
    case core::FieldKind::Closest4:
        return FieldKind::Closest4;
    case core::FieldKind::RbfGlobal:
    case core::FieldKind::RbfCentres:
        break;
    }
    return FieldKind::RbfGlobal;
}

core::SessionSettings to_core(const Settings& settings)
{
    settings.check();
    core::SceneFile scene;
    scene.settings = stated(settings);
    if (settings.frame)
        scene.frame = {settings.frame->origin, settings.frame->axes,
                       settings.frame->size};
    core::SessionSettings out = settings_of(scene);
    if (settings.cells.threshold == kEndless)
        out.cells.threshold = kEndless;
    out.max_iterations = settings.max_iterations;
    out.gradient_tolerance = settings.gradient_tolerance;
    out.time_budget = settings.time_budget;
    out.cells.max_memory = memory_limit(settings.max_memory);
    return out;
}

Settings Settings::parse(std::string_view text)
{
    return run_call(
        [&]
        {
            const core::SceneFile scene = core::parse_scene("", std::string(text));
            const core::SceneSettings stated = with_usual_values(scene.settings);
            const core::SessionSettings session = settings_of(scene);
            Settings out;
            out.is_botsch07 = stated.energy == "botsch07";
            out.cells.fill = stated.cells.fill == "shell"    ? Fill::Shell
                             : stated.cells.fill == "closed" ? Fill::Closed
                                                             : Fill::Solid;
            out.cells.across = static_cast<int>(stated.cells.across.value_or(0));
            out.cells.max_depth = static_cast<int>(*stated.cells.max_depth);
            out.cells.threshold = session.cells.threshold;
            out.cells.gap = *stated.cells.gap;
            out.cells.thickness = *stated.cells.thickness;
            out.cells.loose = session.cells.loose_follow ? Loose::Follow : Loose::Stay;
            out.cells.join = *stated.cells.join;
            out.cells.flat = scene.settings.cells.flat;
            out.cells.contact = *stated.cells.contact;
            out.cells.max_cells = *stated.cells.max_cells;
            if (scene.settings.field.release)
                out.field = from_core(session.field.kind);
            if (scene.frame)
                out.frame = {scene.frame->origin, scene.frame->axes, scene.frame->size};
            return out;
        });
}

void Settings::check() const
{
    run_call(
        [&]
        {
            constexpr int kMostIterations = 1000000, kMostThreads = 4096;
            constexpr double kLongest = 1e9; // [s]
            for (const auto& [name, value, last] :
                 {std::tuple{"cells.fill", static_cast<int>(cells.fill), 2},
                  std::tuple{"cells.loose",
                             static_cast<int>(cells.loose.value_or(Loose::Follow)), 1},
                  std::tuple{"field", static_cast<int>(field.value_or(FieldKind::Rbf)),
                             3}})
                check_number(name, value, 0, last);
            check_settings(stated(*this));
            check_number("max_iterations", max_iterations, 1, kMostIterations);
            check_number("gradient_tolerance", gradient_tolerance, 0.0, 1.0);
            check_number("time_budget", time_budget, 0.0, kLongest);
            check_number("max_memory", max_memory, 0.0, kEndless);
            check_number("threads", threads, 0, kMostThreads);
            if (frame)
                check_frame(*frame);
        });
}

} // namespace cellwarp
