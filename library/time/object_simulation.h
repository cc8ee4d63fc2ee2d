// SPDX-License-Identifier: GPL-3.0-or-later
// Rods, bodies, nets and sheets in time, and their joints: steps of a fixed length. The
// same bits whatever is watched, and for any number of threads.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "io/formats/geometry.h"
#include "io/scene/rod_scene.h"
#include "library/time/object_in_time.h"

namespace cellwarp::core
{

class JoinedFlesh;
class RodPart;
struct StepReport;

/// A force and couple that a hold, joint or contact exerts.
struct SimulatedForce
{
    std::string key; ///< of the scene, "rods[0].fixed[1]"; empty: a contact
    Eigen::Vector3d at, force, couple; ///< [m], [N], about the place [N m]
    // Contacts only; the force acts on the first rod.
    std::string rod, other;                ///< other: empty where it is an obstacle
    double share = 0.0, other_share = 0.0; ///< of the whole rest length
};

/// Section forces of a rod at the places of SimulatedRod::curve: the part ahead acts on
/// the part behind.
struct SimulatedSections
{
    std::vector<double> tension, torque;        ///< [N], [N m]
    std::vector<Eigen::Vector3d> shear, moment; ///< [N], [N m]
    std::vector<Eigen::Matrix3d> frame; ///< directions of the section, tangent: columns
};

class ObjectSimulation
{
public:
    /// Builds all that moves. Throws Fault::Malformed with the key that cannot be, such
    /// as a step beyond what `rk4` is stable with.
    /// \p flesh: what joints call so, which must outlive it; null: there is none.
    explicit ObjectSimulation(const RodScene& scene, JoinedFlesh* flesh = nullptr);
    ~ObjectSimulation();

    /// What all of its objects' places count from [m].
    static Eigen::Vector3d origin_of(const RodScene& scene);
    /// Whether joints hold the flesh: then steps move it, too.
    bool moves_flesh() const { return moves_flesh_; }

    /// What a user may not expect of the start.
    const std::vector<std::string>& warnings() const { return warnings_; }
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
    std::vector<SimulatedRod> rods(int places) const
    {
        return seen(JointEnd::Kind::Rod, places).rods;
    }
    /// Whether the scene asks for these reports.
    bool reports_forces() const { return scene_.reports_forces; }
    bool reports_sections() const { return scene_.reports_sections; }
    /// Forces of holds on their rods, of joints on `a`, and of contacts, after the last
    /// solve. Empty before the first one.
    std::vector<SimulatedForce> forces() const;
    /// In the order of rods().
    std::vector<SimulatedSections> sections(int places) const;
    std::vector<SimulatedBody> bodies() const
    {
        return seen(JointEnd::Kind::Body, 0).bodies;
    }
    std::vector<SimulatedNet> nets() const { return seen(JointEnd::Kind::Net, 0).nets; }
    /// \p places along each side.
    std::vector<SimulatedSheet> sheets(int places) const
    {
        return seen(JointEnd::Kind::Sheet, places).sheets;
    }
    /// Those that carry the model's cells.
    std::vector<const RodPart*> carriers() const;
    /// Rods and springs as tubes, bodies as the boxes or balls that have their inertia,
    /// each a group: \p around corners on each ring.
    Geometry surface(int around) const;
    /// The same, and what rods may touch: of planes those that carry, as tiles.
    Geometry stage(int around) const;
    /// Frames behind the first; of equilibria the rest comes first.
    std::int64_t last_frame() const;
    /// Goes on to the end of the next frame: by steps_a_frame(), or less at the end.
    /// \p watch: after each step.
    void next_frame(const std::function<void()>& watch = {});

private:
    SimulatedObjects seen(JointEnd::Kind kind, int places) const;
    struct Group;
    struct Parts;
    void join();
    void keep_off_itself(std::size_t rod, double at, SlideStatement& slide) const;
    void group();
    void touch();
    void start_alone(Group& group, std::size_t index);
    void need_hold(const Group& group) const;
    void go_on(double begin, double dt);
    void advance(Group& group, double begin, double dt);
    bool change(Group& group, double time);
    void see_contacts();
    int explicit_parts(const Group& group) const;
    void settle(Group& group);
    void take(Group& group, const StepReport& report);

    const RodScene scene_;
    JoinedFlesh* const flesh_;
    bool moves_flesh_ = false;
    const Eigen::Vector3d origin_; ///< what all places count from
    std::unique_ptr<Parts> parts_;
    std::vector<std::unique_ptr<Group>> groups_; ///< what is joined goes together
    std::vector<std::string> warnings_;
    std::int64_t done_ = 0, iterations_ = 0, at_once_ = 0;
    std::string stop_ = "converged", stopped_;
    double stopped_violation_ = 0.0;
};

} // namespace cellwarp::core
