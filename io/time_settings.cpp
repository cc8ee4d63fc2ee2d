// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/time_settings.h"

#include <algorithm>
#include <cmath>

#include "io/bytes.h"
#include "io/json_object.h"
#include "io/text.h"

namespace cellwarp
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
    read(simulate, "every", 1e-12, 1e9, out.every);
    std::optional<std::string> integrator;
    simulate.read("integrator", OneOf{{"implicit-euler", "midpoint", "rk4", "static"}},
                  integrator);
    out.integrator = integrator.value_or(out.integrator);
    if (const Json* gravity = simulate.find("gravity"))
        out.gravity = simulate.vector("gravity", *gravity);
    read(simulate, "viscosity", 0.0, 1e30, out.viscosity);
    simulate.warn_of_the_rest();
    if (out.duration / out.dt > 1e9)
        simulate.fail("duration", "takes more than 1e9 steps of dt");
}

TimeScene time_scene_of(const std::string& path)
{
    if (extension_of(path) != "json")
        return TimeScene::None;
    const Json json = parse_json(path, read_file(path));
    const bool has_rods = json.contains("rods") || json.contains("sheets");
    if (json.contains("simulate") && json.contains("skeleton"))
        return has_rods || json.contains("bodies") || json.contains("nets")
                   ? TimeScene::FleshAndRods
                   : TimeScene::Flesh;
    if (json.contains("simulate"))
        return TimeScene::Rods;
    return has_rods && !json.contains("model") ? TimeScene::Rods : TimeScene::None;
}

} // namespace cellwarp
