// SPDX-License-Identifier: GPL-3.0-or-later
// One object of a scene in time: a rod, body, net or sheet, or the flesh. A new kind is a
// statement with its reader, a class from ObjectInTime, and its line in the constructor
// of ObjectSimulation.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "io/formats/geometry.h"
#include "io/scene/rod_scene.h"
#include "library/time/simulation_report.h"
#include "solver/dynamics/articulable_object.h"

namespace cellwarp::core
{

/// One rod, or a piece of one that was cut.
struct SimulatedRod
{
    std::string name;                   ///< pieces are "rope.1", "rope.2", ...
    double length = 0.0;                ///< now [m]
    std::vector<Eigen::Vector3d> curve; ///< at equal shares of the rest length
    int knots = 0;
    std::vector<double> sliding; ///< of what slides, shares of the whole rest length
};

struct SimulatedBody
{
    std::string name;
    Eigen::Vector3d at; ///< centre [m]
    Eigen::Matrix3d R;  ///< from its own axes
};

struct SimulatedNet
{
    std::string name;
    std::vector<Eigen::Vector3d> points; ///< [m]
};

struct SimulatedSheet
{
    std::string name;
    std::vector<Eigen::Vector3d> points;  ///< at equal shares, the first side fastest [m]
    std::vector<Eigen::Vector3d> sliding; ///< shares; of what has left NaN
};

struct SimulatedObjects
{
    std::vector<SimulatedRod> rods;
    std::vector<SimulatedBody> bodies;
    std::vector<SimulatedNet> nets;
    std::vector<SimulatedSheet> sheets;
};

/// A moment of keys: a time [s], and the share of the values of keys that holds then.
struct KeyTime
{
    double time = 0.0, share = 1.0;
};

class ObjectInTime
{
public:
    virtual ~ObjectInTime() = default;

    virtual JointEnd::Kind kind() const = 0;
    virtual std::string name() const = 0;

    /// The object in a system of joints.
    virtual ArticulableObject& articulable() = 0;
    /// The place of a joint's end now, from the simulation's origin. \p where: the key of
    /// the joint, for errors.
    virtual Eigen::Vector3d place_of(const JointEnd& end,
                                     const std::string& where) const = 0;
    /// The number of that place in articulable(). \p other: the place of the other end.
    virtual int add_place(const JointEnd& end, const SlideStatement& slide,
                          const std::string& where, const Eigen::Vector3d& other) = 0;
    /// Whether an equilibrium needs no other object to hold it.
    virtual bool is_held() const = 0;

    // Keys. Turns are in degrees.

    /// By which keys turn it between two times, at the most; from rest to the first key;
    /// from rest to any key.
    virtual double turned(double /*begin*/, double /*end*/) const { return 0.0; }
    virtual double first_turn() const { return 0.0; }
    virtual double largest_turn() const { return 0.0; }
    /// Brings what keys hold to its place at a time, at rest.
    virtual void hold_at(double /*time*/, double /*share*/) {}
    /// In the next steps what keys hold goes evenly from one moment to the other, \p
    /// duration later [s]; they are less than half a turn apart.
    virtual void lead(const KeyTime& /*from*/, const KeyTime& /*to*/, double /*duration*/)
    {
    }

    /// Adds its energies and momenta.
    virtual void add_to(SimulationReport& report) const = 0;
    /// \p places: of a rod's curve, and along each side of a sheet.
    virtual void add_to(int places, SimulatedObjects& out) const = 0;
    /// Its surface, \p around corners on each ring, as a group or several [m].
    virtual void add_surface(int around, Geometry& out) const = 0;
    /// The space that it needs, about.
    virtual void add_to(Eigen::AlignedBox3d& box) const = 0;
};

// Objects of a scene by their numbers, seen from \p origin. They throw Fault::Malformed
// with the key that cannot be. The scene must outlive them.

std::unique_ptr<ObjectInTime> body_in_time(const RodScene& scene, std::size_t index,
                                           const Eigen::Vector3d& origin);
std::unique_ptr<ObjectInTime> net_in_time(const RodScene& scene, std::size_t index,
                                          const Eigen::Vector3d& origin);
std::unique_ptr<ObjectInTime> sheet_in_time(const RodScene& scene, std::size_t index,
                                            const Eigen::Vector3d& origin);

/// Adds the gravity of a mass at the origin, and momenta that count from there.
inline void add_from_origin(double mass, const Eigen::Vector3d& momentum,
                            const Eigen::Vector3d& turning, const Eigen::Vector3d& origin,
                            const Eigen::Vector3d& gravity, SimulationReport& report)
{
    report.gravity -= mass * gravity.dot(origin);
    report.momentum += momentum;
    report.angular_momentum += turning + origin.cross(momentum);
}

} // namespace cellwarp::core
