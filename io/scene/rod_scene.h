// SPDX-License-Identifier: GPL-3.0-or-later
// What a scene file says of rods and of their simulation, as plain values in SI units.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "io/scene/obstacle_statement.h"
#include "io/scene/spline_line.h"
#include "io/scene/time_settings.h"
#include "octree/base/rigid_move.h"

namespace cellwarp::core
{

/// When something acts.
struct TimeWindow
{
    double from = 0.0;           ///< [s]
    std::optional<double> until; ///< [s]

    bool is_open(double time) const { return from <= time && !(until && time > *until); }
};

/// A size at a time; between two of them it is linear.
struct SizeKey
{
    double time = 0.0, size = 1.0; ///< [s], a share
};

struct SizeInTime : TimeWindow
{
    std::vector<SizeKey> keys; ///< none: 1
};

/// A place that is held as it is at rest, or where it is when its window opens, or moved
/// by keys.
struct RodHold : TimeWindow
{
    double at = 0.0; ///< share of the rest length
    bool has_point = false, has_tangent = false, has_twist = false;
    bool has_curvature = false; ///< the second derivative of the curve
    bool has_bend = false;      ///< its curvature [1/m]
    MoveKeys keys;              ///< about the place at rest [m]
};

/// How a place slides that is unknown in advance.
struct SlideStatement
{
    std::optional<double> start;              ///< share of the rest length; the nearest
    std::array<double, 2> range = {0.0, 1.0}; ///< shares it may slide between
    bool leaves = false;                      ///< where it arrives at an end of it
    std::array<double, 2> friction = {};      ///< at rest, in motion
    double inertia = 0.0;                     ///< of the sliding itself [kg]
    /// Stays at least so far along the rod from the next that slides, in the order in
    /// which they stand in the scene [m].
    std::optional<double> apart;
};

/// A place of a rod that stays on something.
struct RodOn
{
    double at = 0.0;                     ///< share of the rest length
    std::optional<SlideStatement> slide; ///< the place is not `at` but slides
    enum class Kind
    {
        Point,
        Plane,
        Axis,
        Rod
    } kind = Kind::Point;
    Triple point{};      ///< [m]; of an axis, one of its points
    Triple direction{};  ///< of a plane its normal, of an axis its direction
    double offset = 0.0; ///< of a plane: normal . x = offset
    MoveKeys keys;       ///< of a point, plane or axis that moves
    std::size_t rod = 0; ///< of the scene
    double other = 0.0;  ///< share of that rod's rest length
    std::optional<SlideStatement> other_slide;
};

struct RodPull : SizeInTime
{
    double at = 1.0;
    Triple force{}, moment{}; ///< [N], [N m]
};

/// From a place of the rod to one of the world. The size is that of stiffness and
/// damping.
struct RodSpringTo : SizeInTime
{
    double at = 1.0;
    Triple point{};
    double stiffness = 0.0;       ///< [N/m]
    std::optional<double> length; ///< [m]; as at the start
    double damping = 0.0;         ///< of the place, in every direction [N s/m]
};

/// Knots that come where a rod bends and go again.
struct RefineStatement
{
    double insert = 0.5, remove = 0.3; ///< turn of a span [rad]
    double tolerance = 1e-3;           ///< by which the curve may move, of a span
    double shortest = 0.0;             ///< span that is still halved [m]; 0: its radius
};

/// Where a rod is cut: one of these.
struct CutStatement
{
    std::optional<double> at;               ///< share of the rest length, at `time`
    double time = 0.0;                      ///< [s]
    std::optional<double> curvature, force; ///< limits [1/m], [N]
};

struct RodStatement
{
    std::string name;
    SplineLine line = {.radii = {0.01}};                 ///< [m]; with a radius at least
    double young = 1e6, poisson = 0.3, density = 1000.0; ///< [Pa], [kg/m^3]
    double damping = 0.0; ///< of the material: time by which rates count as strains [s]
    std::optional<std::array<double, 2>> bending; ///< [N m^2]
    std::optional<Triple> normal; ///< direction 1 of the section at the begin of the rod
    std::optional<double> twisting; ///< [N m^2]
    std::string elasticity = "exact";
    bool is_straight_at_rest = false;
    double rest_twist = 0.0, link = 0.0; ///< [rad/m], turns
    Triple velocity{};                   ///< [m/s]
    std::vector<RodHold> holds;
    std::vector<RodOn> on;
    std::vector<RodPull> loads;
    std::vector<RodSpringTo> springs;
    std::vector<CutStatement> cuts;
    std::optional<RefineStatement> refine;
    std::optional<double> contact_radius; ///< [m]; that of the rod
    bool has_skin = false;                ///< drawn as an implicit surface, not as a tube
    bool carries = false;                 ///< the model's cells that it passes through
};

/// A rigid body.
struct BodyStatement
{
    std::string name;
    double mass = 1.0;         ///< [kg]
    Triple inertia{};          ///< about the centre, along its axes [kg m^2]
    RigidMove place;           ///< its centre and how it is turned about that [m]
    Triple velocity{}, spin{}; ///< [m/s], [rad/s]
    MoveKeys keys;             ///< it goes where they say, if there are any
};

/// Points with mass, and springs.
struct NetStatement
{
    struct Spring
    {
        std::array<std::size_t, 2> node{};
        double stiffness = 0.0; ///< [N/m]
    };
    std::string name;
    std::vector<Triple> points; ///< [m]
    std::vector<double> masses; ///< of each [kg]
    std::vector<Spring> springs;
    double damping = 0.0;           ///< of the springs, as of a rod [s]
    std::vector<std::size_t> fixed; ///< points that stay
};

/// A surface of two sides, or a block of three, that is a spline.
struct SheetStatement
{
    std::string name;
    Triple corner{};           ///< [m]
    std::vector<Triple> sides; ///< two or three [m]
    std::vector<int> counts;   ///< of control points along each
    std::int64_t degree = 3;
    double young = 1e5, thickness = 1e-3, density = 1000.0; ///< [Pa], [m], [kg/m^3]
    double viscosity = 0.0;                                 ///< of the velocity [1/s]
    double damping = 0.0;                                   ///< as of a rod [s]
    Triple velocity{};                                      ///< [m/s]
    std::vector<Triple> fixed; ///< places that stay, shares of the sides
    std::vector<Triple> over;  ///< points that it slides over [m]
};

struct JointEnd
{
    enum class Kind
    {
        Rod,
        Body,
        Net,
        Sheet,
        Flesh
    } kind = Kind::Rod;
    std::size_t index = 0; ///< of the scene's rods, bodies, nets or sheets
    double at = 0.0;       ///< of a rod: share of the rest length
    bool slides = false;   ///< of a rod: as the joint says
    /// Of a body, in its axes [m]; of a sheet, shares; of flesh, at rest [m].
    Triple point{};
    std::size_t node = 0; ///< of a net
};

struct JointStatement
{
    std::array<JointEnd, 2> ends;
    bool has_point = false, has_frame = false, has_distance = false;
    SlideStatement slide;              ///< of ends that slide
    std::optional<double> other_start; ///< of the second, where both do
    std::string field;                 ///< of the scene, for messages
};

/// How rods touch.
struct ContactStatement
{
    double friction = 0.0;
    double damping = 1.0;            ///< of the bounce; 1: critical
    std::optional<double> stiffness; ///< [N/m]; that of the material
    bool between_rods = true, with_itself = true;
};

/// All that a scene says of time: its settings, and the objects that move.
struct RodScene : TimeSettings
{
    std::string path; ///< of the scene, for messages
    std::vector<RodStatement> rods;
    std::vector<BodyStatement> bodies;
    std::vector<NetStatement> nets;
    std::vector<SheetStatement> sheets;
    std::vector<JointStatement> joints;
    std::vector<ObstacleStatement> obstacles;
    std::optional<ContactStatement> contact; ///< nothing: rods pass through everything

    bool has_objects() const; ///< rods, bodies, nets or sheets
    bool carries() const;     ///< whether a rod carries the model's cells
};

/// Reads the objects of a scene and what they are joined to and touch. \p has_flesh: the
/// scene has a skeleton, whose flesh joints may hold. \pre The settings of \p scene are
/// read. Throws Fault::Malformed with the key that is wrong: "rods[1].fixed[0].at".
void read_objects_in_time(JsonObject& root, bool has_flesh, RodScene& scene);

} // namespace cellwarp::core
