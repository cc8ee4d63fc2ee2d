// SPDX-License-Identifier: GPL-3.0-or-later
// What a scene says of its time: steps, frames, gravity. The same for all that moves.
#pragma once

#include <array>
#include <cstdint>
#include <string>

namespace cellwarp::core
{

class JsonObject;

using Triple = std::array<double, 3>;

/// A step of flesh where a scene tells none [s].
inline constexpr double kStepOfFlesh = 1.0 / 120.0;

struct TimeSettings
{
    double dt = 1e-3, duration = 1.0, every = 1.0 / 30.0; ///< [s]; every: whole steps
    std::string integrator = "implicit-euler";
    Triple gravity{0.0, -9.81, 0.0}; ///< [m/s^2]
    double viscosity = 0.0;          ///< [N s/m^2]
    double unit = 1.0;               ///< of the model [m]
    /// Additions to --json of rods in each frame: forces of holds, joints and contacts;
    /// forces of sections.
    bool reports_forces = false, reports_sections = false;

    bool is_static() const { return integrator == "static"; }
    std::int64_t num_steps() const; ///< an equilibrium is one
    std::int64_t steps_a_frame() const;
    /// The first is 0. The last one ends with the last step, however short that makes it.
    std::int64_t last_frame() const;
    double time_of(std::int64_t frame) const; ///< [s]
};

/// Reads the keys "unit" and "simulate" of a scene; what they leave out stays as it is,
/// but for frames, which are whole steps then. Returns whether the scene has "simulate".
/// Throws Fault::Malformed.
bool read_time_settings(JsonObject& scene, TimeSettings& out);

} // namespace cellwarp::core
