// SPDX-License-Identifier: GPL-3.0-or-later
// A scene in time: rods, a state, steps of a fixed length. The same bits whatever is
// watched, and for any number of threads.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "io/geometry.h"
#include "io/rod_scene.h"

namespace cellwarp
{

enum class RodStop;

/// One rod as it is seen.
struct SimulatedRod
{
    std::string name;
    double length = 0.0;                ///< now [m]
    std::vector<Eigen::Vector3d> curve; ///< at equal shares of the rest length
    int knots = 0;
};

/// What a moment of the simulation measures.
struct SimulationReport
{
    double time = 0.0;                                  ///< [s]
    double kinetic = 0.0, elastic = 0.0, gravity = 0.0; ///< [J]
    Eigen::Vector3d momentum = Eigen::Vector3d::Zero(); ///< [kg m/s]
    Eigen::Vector3d turning = Eigen::Vector3d::Zero();  ///< angular momentum [kg m^2/s]
    double violation = 0.0;         ///< largest of the constraints [m, rad]
    std::int64_t iterations = 0;    ///< since the last report
    std::string stop = "converged"; ///< the first that was not, since the last report
    std::string stopped;            ///< the rod that did
    bool is_converged = true;
};

class Simulation
{
public:
    /// Builds all rods. Throws Fault::Malformed with the key that cannot be, such as a
    /// step beyond what `rk4` is stable with.
    explicit Simulation(const RodScene& scene);
    ~Simulation();

    bool is_static() const;
    /// Of the whole simulation; of equilibria 1.
    std::int64_t num_steps() const;
    /// Steps from one frame to the next.
    std::int64_t steps_a_frame() const;
    /// Goes on by one step, or to equilibrium.
    void step();
    std::int64_t steps_done() const;
    /// What was measured, since the last call.
    SimulationReport report();
    /// \p places of each rod at equal shares of its rest length, both ends included.
    std::vector<SimulatedRod> rods(int places) const;
    /// The rods as tubes, each a group: \p around corners on each ring, coloured by which
    /// side of the material they are on.
    Geometry surface(int around) const;
    /// Frames behind the first; of equilibria the rest comes first.
    std::int64_t last_frame() const;
    /// Goes on to the end of the next frame: by steps_a_frame(), or less at the end.
    /// \p watch: after each step.
    void next_frame(const std::function<void()>& watch = {});

private:
    struct Body;
    /// \p share: of what the keys say.
    static void move_holds(Body& body, double time, double share);
    /// In how many parts holds turn by so much [degree].
    static int parts_of(double turn);
    void settle(Body& body);
    void advance(Body& body, double begin);
    void take_stop(const Body& body, RodStop stop);
    static void add_tube(const Body& body, const Eigen::Vector3d& origin, int around,
                         Geometry& out);

    const RodScene scene_;
    const Eigen::Vector3d origin_; ///< what the rods' places count from
    std::vector<std::unique_ptr<Body>> bodies_;
    std::int64_t done_ = 0, iterations_ = 0;
    std::string stop_ = "converged", stopped_;
    double stopped_violation_ = 0.0;
};

} // namespace cellwarp
