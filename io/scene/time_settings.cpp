// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/scene/time_settings.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "io/scene/json_object.h"

namespace cellwarp::core
{

namespace
{

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

bool read_time_settings(JsonObject& scene, TimeSettings& out)
{
    using Real = Between<double>;
    scene.read("unit", Real{1e-30, 1e30}, out.unit);
    return scene.read_object(
        "simulate",
        [&](JsonObject& simulate)
        {
            simulate.read("dt", Real{1e-12, 1e6}, out.dt);
            simulate.read("duration", Real{0.0, 1e9}, out.duration);
            const bool has_every = simulate.read("every", Real{1e-12, 1e9}, out.every);
            simulate.read("integrator",
                          OneOf{{"implicit-euler", "bdf2", "midpoint", "rk4", "static"}},
                          out.integrator);
            simulate.read("gravity", out.gravity);
            simulate.read("viscosity", Real{0.0, 1e30}, out.viscosity);
            simulate.read("report", {{"forces", &out.reports_forces},
                                     {"sections", &out.reports_sections}});
            const double steps = out.every / out.dt,
                         whole = std::max(std::round(steps), 1.0);
            constexpr double kWhole = 1e-6; // of them
            if (has_every && !out.is_static() && std::abs(steps - whole) > kWhole * whole)
                simulate.fail("every",
                              fmt::format("got {} s, which is no whole number of steps "
                                          "of {} s: the nearest is {:.12g} s",
                                          out.every, out.dt, whole * out.dt));
            out.every = whole * out.dt;
            if (!out.is_static() && out.duration > 0.0 && out.num_steps() == 0)
                simulate.warn("duration",
                              fmt::format("{} s is less than half a step of {} s: "
                                          "nothing moves",
                                          out.duration, out.dt));
            if (out.duration / out.dt > 1e9)
                simulate.fail("duration", "takes more than 1e9 steps of dt");
        });
}

} // namespace cellwarp::core
