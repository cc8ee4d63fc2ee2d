// SPDX-License-Identifier: GPL-3.0-or-later
// Flesh that follows a skeleton in time: steps of a fixed length from the keys of a scene
// or from the hand. A step depends on its snapshot alone, so that what is played live is
// what was baked, to the bit.
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
#include "io/scene/scene_file.h"
#include "library/session/apply_field.h"
#include "library/session/skeleton_handle.h"
#include "library/time/flesh_body.h"
#include "library/time/flesh_detail.h"
#include "library/time/simulation_report.h"
#include "library/time/smooth_samples.h"

namespace cellwarp::core
{

/// A sample that a hand pulls.
struct FleshPull
{
    std::size_t sample = 0;
    Eigen::Vector3d place; ///< where it is to go [model unit]
};

class FleshSimulation
{
public:
    /// Begins at frame 0, in the pose of the keys there and at rest; it hangs in its
    /// weight if settles() of its body. \p handles: its frames move the skeleton, see
    /// played_skeleton(). Throws what build_flesh() and played_skeleton() throw.
    FleshSimulation(std::shared_ptr<const Geometry> geometry, const SceneFile& scene,
                    const CellSettings& cells, bool is_tight = false,
                    const HandleFile& handles = {});
    ~FleshSimulation();

    const std::vector<std::string>& warnings() const { return warnings_; }
    const Geometry& geometry() const { return *geometry_; }
    const FleshBody& body() const { return body_; }
    const TimeSettings& time() const { return time_; }

    std::int64_t num_steps() const;
    std::int64_t steps_a_frame() const;
    std::int64_t last_frame() const;
    std::int64_t steps_done() const { return snapshot_.steps; }
    void step();
    /// For those who step it together with other things: where the bones, and what is
    /// held, are at the end of a step, of numbers from 1.
    std::vector<Motion> motions_at(std::int64_t step) const;
    /// They have, to \p state, in \p ms.
    void take_step(FleshState state, const FleshReport& report, double ms);
    /// To the end of the next frame. \p watch: after each step.
    void next_frame(const std::function<void()>& watch = {});
    SimulationReport report();
    /// Else the last step has left the state as it was.
    bool is_finite() const { return is_finite_; }
    double time_of(std::int64_t frame) const { return time_.time_of(frame); } ///< [s]

    /// All that comes after depends on.
    struct Snapshot
    {
        FleshState state;
        std::int64_t steps = 0;
        /// What a hand has done to joints since the keys: it stays. Empty: nothing.
        std::vector<Move> by_hand;
        std::optional<FleshPull> pull = {};
        FleshDetail detail; ///< of a lattice without detail empty
        /// A step earlier, of BDF2; none: the next step is of implicit Euler.
        std::optional<FleshState> before = {};
    };
    const Snapshot& snapshot() const { return snapshot_; }
    void go_to(Snapshot snapshot);
    /// Joints that do not go by their keys from the next step on, as moves of a frame
    /// do; of those that are not named the keys go on.
    void lead(std::vector<Move> moves) { snapshot_.by_hand = std::move(moves); }

    /// A sample goes towards a place from the next step on; nothing: it is let go.
    void pull(std::optional<FleshPull> pull) { snapshot_.pull = pull; }

    /// The move by which the bone to a joint points at a place, as the skeleton stands
    /// now; of a root, by which it goes there [model unit]. Nothing for a joint that is
    /// not there, or a place that is where the bone begins.
    std::optional<Move> pointed(const std::string& joint,
                                const Eigen::Vector3d& place) const;

    /// As they are drawn: balls, and of planes a square below the shape [model unit].
    Geometry obstacles() const;
    /// Where the skeleton is now.
    std::vector<PosedJoint> joints() const;
    /// The shape as the lattice has it: at once, exact at bones, with creases in its
    /// slopes where cells meet.
    DeformedSamples deformed_live() const;
    /// The same, smooth, and exact at bones as well; of a lattice that was drawn it is
    /// deformed_live().
    DeformedSamples deformed();
    /// Nodes of the lattice now [model unit].
    std::vector<Eigen::Vector3d> nodes() const;
    /// Corners of its cells, but of those that hold next to nothing: corners that no
    /// other cell has fly about there.
    std::vector<std::array<Eigen::Vector3d, 8>> drawn_cells() const;

private:
    SkeletonAim aim_at(double time, const std::vector<Move>& by_hand) const;
    std::vector<Motion> motions_between(const SkeletonAim& from, const SkeletonAim& to,
                                        double share, double time) const;
    std::vector<FleshObstacle> obstacles_at(double time) const;
    std::vector<PulledPoint> pulled_at(double time, double share) const;
    std::vector<Motion> motions_now() const;
    SkeletonAim carried_by_root(const SkeletonAim& pose, FleshState& state);
    void begin();
    bool has_detail() const { return snapshot_.detail.octree != nullptr; }
    bool look_for_detail();
    std::vector<char> wanted_cells() const;
    std::int64_t steps_of_fade() const;
    std::vector<Fading> fading_in(const FleshBody& body, const CarriedState& carried,
                                  const FleshDetail& next) const;
    void stopped(const char* why);
    DeformedSamples rest_samples() const;
    Carried carried_of(DeformedSamples& samples) const;

    std::shared_ptr<const Geometry> geometry_;
    const TimeSettings time_;
    const bool is_of_second_order_;
    SkeletonValues skeleton_;
    std::shared_ptr<const FleshModel> model_;
    FleshBody body_; ///< of snapshot_.detail
    const bool settles_;
    std::vector<std::string> warnings_;
    std::optional<KeyedJoints> keys_;
    std::vector<std::uint32_t> use_samples_; ///< of the direction uses
    std::unique_ptr<SmoothSamples> smooth_;  ///< null until they are wanted
    Snapshot snapshot_;
    SimulationReport since_; ///< the last report; its flesh is there
    bool is_finite_ = true, has_told_of_most_ = false;
};

} // namespace cellwarp::core
