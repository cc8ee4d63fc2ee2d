// SPDX-License-Identifier: GPL-3.0-or-later
// A scene in time, frame by frame: rods, bodies, nets and sheets with the model that rods
// carry, flesh that follows a skeleton, or both. The same bits whatever is watched, and
// for any number of threads. [Lenoir04], [Capell02]
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "io/formats/geometry_file.h"
#include "io/scene/handle_file.h"
#include "io/scene/scene_file.h"
#include "library/session/session.h"
#include "library/time/carried_model.h"
#include "library/time/flesh_simulation.h"
#include "library/time/joined_flesh.h"
#include "library/time/object_simulation.h"
#include "library/time/simulation_report.h"

namespace cellwarp::core
{

/// A scene and all that it names.
struct SimulationInput
{
    SceneFile scene;
    std::shared_ptr<const GeometryFile> model = {}; ///< null: nothing moves one
    HandleFile handles = {};
    SessionSettings settings = {}; ///< of cells that rods carry; those of flesh are cells
    std::vector<std::string> warnings = {}; ///< of what was read
    bool is_tight = false; ///< linear systems of flesh are solved to 1e-10
};

/// Reads the handle file of a scene, and its model unless \p model stands for it. Throws
/// what their readers throw, and Fault::Malformed for a scene in which nothing moves in
/// time.
SimulationInput read_simulation(SceneFile scene,
                                std::shared_ptr<const GeometryFile> model = nullptr);

/// The shapes of a scene in time at one moment, in one unit.
struct ShapesInTime
{
    std::vector<Geometry> parts;
    std::vector<PosedJoint> joints; ///< of a skeleton
    /// Cells of a lattice: corner k is at the upper end of axis a if bit a of k is set.
    std::vector<std::array<Eigen::Vector3d, 8>> cells;
};

class Simulation
{
public:
    /// Begins at frame 0. Throws what FleshSimulation, ObjectSimulation and CarriedModel
    /// throw, and Fault::Malformed for what flesh cannot have where joints hold it.
    explicit Simulation(SimulationInput input);
    ~Simulation();

    /// So far.
    std::vector<std::string> warnings() const;
    /// An equilibrium has one step, whose end is frame 0.
    bool is_static() const { return !flesh_ && time().is_static(); }
    /// The first is 0.
    std::int64_t last_frame() const { return is_static() ? 0 : time().last_frame(); }
    std::int64_t num_steps() const { return time().num_steps(); }
    std::int64_t steps_done() const;
    const TimeSettings& time() const { return input_.scene.time; }

    void step();
    /// To the end of the next frame. \p watch: called after each step; \p wants_samples:
    /// of the model that rods carry, which deformed() keeps else as they were.
    void next_frame(const std::function<void()>& watch = {}, bool wants_samples = true);
    /// Of now, and of the steps since the last call.
    SimulationReport report();

    const std::shared_ptr<const GeometryFile>& model() const { return input_.model; }
    /// The model's samples. \pre model()
    const DeformedSamples& deformed();
    /// Length of the files' unit: that of the model; metres without one [m].
    double unit() const { return input_.model ? time().unit : 1.0; }
    ShapesInTime shapes(int around);

    FleshSimulation* flesh() { return flesh_.get(); } ///< null: there is none
    const FleshSimulation* flesh() const { return flesh_.get(); }
    /// Null: there are none.
    const ObjectSimulation* objects() const { return objects_.get(); }
    /// Of the model that rods carry; null: they carry none.
    const Session* carried() const { return carried_ ? &carried_->session() : nullptr; }

private:
    const SimulationInput input_;
    std::unique_ptr<FleshSimulation> flesh_;
    std::unique_ptr<JoinedFlesh> joined_; ///< null: no joint holds the flesh
    std::unique_ptr<ObjectSimulation> objects_;
    std::unique_ptr<CarriedModel> carried_;
    DeformedSamples deformed_; ///< of flesh
    bool is_drawn_ = false;    ///< deformed_ is of now
    std::int64_t limited_ = 0; ///< turns of joints that were cut to their limits
    std::size_t inverted_ = 0; ///< cells, at the most
};

} // namespace cellwarp::core
