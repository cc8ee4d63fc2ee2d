// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/scene/time_settings.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "io/base/bytes.h"
#include "io/base/error.h"
#include "io/base/text.h"
#include "io/scene/json_object.h"

namespace cellwarp::core
{

namespace
{

void read(JsonObject& object, const char* key, double low, double high, double& out)
{
    std::optional<double> value;
    object.read(key, Between<double>{low, high}, value);
    out = value.value_or(out);
}

std::int64_t steps_of(double time, double dt)
{
    constexpr double kMost = 1e15;
    return std::llround(std::min(time / dt, kMost));
}

} // namespace

std::int64_t TimeSettings::num_steps() const
{
    return is_static() ? 1 : steps_of(duration, dt);
}

std::int64_t TimeSettings::steps_a_frame() const
{
    return is_static() ? 1 : std::max<std::int64_t>(1, steps_of(every, dt));
}

std::int64_t TimeSettings::last_frame() const
{
    const std::int64_t each = steps_a_frame();
    return (num_steps() + each - 1) / each;
}

double TimeSettings::time_of(std::int64_t frame) const
{
    return static_cast<double>(std::min(frame * steps_a_frame(), num_steps())) * dt;
}

void read_time_settings(JsonObject& scene, const std::string& path, TimeSettings& out,
                        std::vector<std::string>& warnings)
{
    read(scene, "unit", 1e-30, 1e30, out.unit);
    const Json* const value = scene.find("simulate");
    if (!value)
        return;
    JsonObject simulate(*value, path, "simulate.", warnings);
    read(simulate, "dt", 1e-12, 1e6, out.dt);
    read(simulate, "duration", 0.0, 1e9, out.duration);
    std::optional<double> every;
    simulate.read("every", Between<double>{1e-12, 1e9}, every);
    std::optional<std::string> integrator;
    simulate.read("integrator",
                  OneOf{{"implicit-euler", "bdf2", "midpoint", "rk4", "static"}},
                  integrator);
    out.integrator = integrator.value_or(out.integrator);
    if (const Json* gravity = simulate.find("gravity"))
        out.gravity = simulate.vector("gravity", *gravity);
    read(simulate, "viscosity", 0.0, 1e30, out.viscosity);
    if (const Json* const report = simulate.find("report"))
    {
        bool is_right = report->is_array();
        for (const Json& one : *report)
        {
            out.reports_forces = out.reports_forces || one == "forces";
            out.reports_sections = out.reports_sections || one == "sections";
            is_right = is_right && (one == "forces" || one == "sections");
        }
        if (!is_right)
            simulate.fail("report", "need a list of forces and sections");
    }
    simulate.warn_of_the_rest();
    const double steps = every.value_or(out.every) / out.dt,
                 whole = std::max(std::round(steps), 1.0);
    constexpr double kWhole = 1e-6; // of them
    if (every && !out.is_static() && std::abs(steps - whole) > kWhole * whole)
        simulate.fail("every",
                      fmt::format("got {} s, which is no whole number of steps of "
                                  "{} s: the nearest is {:.12g} s",
                                  *every, out.dt, whole * out.dt));
    out.every = whole * out.dt;
    if (!out.is_static() && out.duration > 0.0 && out.num_steps() == 0)
        warnings.push_back(
            at({path, 0, "simulate.duration"},
               fmt::format("{} s is less than half a step of {} s: nothing "
                           "moves",
                           out.duration, out.dt)));
    if (out.duration / out.dt > 1e9)
        simulate.fail("duration", "takes more than 1e9 steps of dt");
}

TimeScene time_scene_of(const std::string& path)
{
    if (extension_of(path) != "json")
        return TimeScene::None;
    const Json json = parse_json(path, read_file(path));
    const bool has_rods = json.contains("rods") || json.contains("sheets") ||
                          json.contains("bodies") || json.contains("nets");
    if (json.contains("simulate") && json.contains("skeleton"))
        return has_rods ? TimeScene::FleshAndRods : TimeScene::Flesh;
    if (json.contains("simulate"))
        return TimeScene::Rods;
    return has_rods && !json.contains("model") ? TimeScene::Rods : TimeScene::None;
}

} // namespace cellwarp::core
