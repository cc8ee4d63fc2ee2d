// SPDX-License-Identifier: GPL-3.0-or-later
// Flesh with rods, bodies and nets in one scene: what joints hold together moves in one
// system. [Capell02], [Lenoir04]
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "io/formats/geometry.h"
#include "io/scene/scene_file.h"
#include "library/time/flesh_simulation.h"
#include "library/time/joined_flesh.h"
#include "library/time/simulation.h"

namespace cellwarp::core
{

class JoinedSimulation
{
public:
    /// Both stand at their start. Throws what FleshSimulation and Simulation throw, and
    /// Fault::Malformed for what flesh cannot have where joints hold it.
    JoinedSimulation(std::shared_ptr<const Geometry> geometry, const SceneFile& scene,
                     const CellSettings& cells, bool is_tight = false,
                     const HandleFile& handles = {});
    ~JoinedSimulation();

    FleshSimulation& flesh() { return flesh_; }
    const FleshSimulation& flesh() const { return flesh_; }
    Simulation& rods() { return *rods_; }
    const Simulation& rods() const { return *rods_; }
    std::vector<std::string> warnings() const;

    void step();
    /// To the end of the next frame. \p watch: after each step.
    void next_frame(const std::function<void()>& watch = {});

private:
    FleshSimulation flesh_;
    std::unique_ptr<JoinedFlesh> joined_; ///< null: no joint holds the flesh
    std::unique_ptr<Simulation> rods_;
};

} // namespace cellwarp::core
