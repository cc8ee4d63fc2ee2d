// SPDX-License-Identifier: GPL-3.0-or-later
// What a scene file says of rods and of their simulation, as plain values in SI units.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace cellwarp
{

using Triple = std::array<double, 3>;

/// Where a held place has come to at a time.
struct RodKey
{
    double time = 0.0;                        ///< [s]
    Triple translate{};                       ///< from rest [m]
    std::array<double, 4> rotate{0, 0, 1, 0}; ///< axis, [degree], about the place at rest
};

/// A place that is held as it is at rest, or moved by keys.
struct RodHold
{
    double at = 0.0; ///< share of the rest length
    bool has_point = false, has_tangent = false, has_twist = false, has_curvature = false;
    std::vector<RodKey> keys;
};

/// A place that stays on something.
struct RodOn
{
    double at = 0.0;
    enum class Kind
    {
        Point,
        Plane,
        Axis
    } kind = Kind::Point;
    Triple point{};      ///< [m]; of an axis, one of its points
    Triple direction{};  ///< of a plane its normal, of an axis its direction
    double offset = 0.0; ///< of a plane: normal . x = offset
};

struct RodPull
{
    double at = 1.0;
    Triple force{}, moment{}; ///< [N], [N m]
};

/// From a place of the rod to one of the world.
struct RodSpringTo
{
    double at = 1.0;
    Triple point{};
    double stiffness = 0.0;       ///< [N/m]
    std::optional<double> length; ///< [m]; as at the start
    double damping = 0.0;         ///< of the place, in every direction [N s/m]
};

struct RodStatement
{
    std::string name;
    std::vector<Triple> through, points; ///< one of them [m]
    std::int64_t spans = 4, degree = 3;
    std::string spline = "nonuniform";
    bool is_closed = false;
    std::vector<double> radius = {0.01}; ///< [m]; several: evenly along the rod, linear
    double young = 1e6, poisson = 0.3, density = 1000.0; ///< [Pa], [kg/m^3]
    std::optional<std::array<double, 2>> bending;        ///< [N m^2]
    std::optional<double> twisting;                      ///< [N m^2]
    std::string energy = "exact";
    bool is_straight_at_rest = false;
    double rest_twist = 0.0, link = 0.0; ///< [rad/m], turns
    Triple velocity{};                   ///< [m/s]
    std::vector<RodHold> holds;
    std::vector<RodOn> on;
    std::vector<RodPull> loads;
    std::vector<RodSpringTo> springs;
};

struct RodScene
{
    std::string path;
    std::vector<RodStatement> rods;
    double dt = 1e-3, duration = 1.0, every = 1.0 / 30.0; ///< [s]
    std::string integrator = "implicit-euler";
    Triple gravity{0.0, -9.81, 0.0}; ///< [m/s^2]
    double viscosity = 0.0;          ///< [N s/m^2]
    std::vector<std::string> warnings;
};

/// Whether a scene file has rods in time, and is not one of edits alone. Throws what
/// reading it throws.
bool has_simulation(const std::string& path);

/// Of a scene file with "rods" and "simulate". Throws Fault::File, Fault::Malformed with
/// the key that is wrong: "rods[1].fixed[0].at".
RodScene read_rod_scene(const std::string& path);
RodScene parse_rod_scene(const std::string& path, const std::string& text);

} // namespace cellwarp
