// SPDX-License-Identifier: GPL-3.0-or-later
// What simulate tells of a frame of rods and of one of flesh, apart or together.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "io/scene/scene_file.h"
#include "library/session/body.h"
#include "library/time/in_time.h"

namespace cellwarp::core
{

class FleshSimulation;
class Simulation;
struct FleshFrame;
struct SimulationReport;

// Rods: rods_in_time.cpp.

Json told_of_rods(std::int64_t frame, const SimulationReport& report,
                  const Simulation& simulation);
/// Why they did not converge.
std::string problem_of_rods(const SimulationReport& report);
/// As a file of a name. \p unit: of the file [m].
std::string bytes_of(const Simulation& rods, const std::string& name, double unit,
                     const InTime::Drawing& drawing);

// Flesh: flesh_in_time.cpp.

/// A scene of flesh and what it names.
struct FleshRequest
{
    SceneFile scene;
    HandleFile handles;
    std::shared_ptr<const GeometryFile> file;
    CellSettings cells;
    std::vector<std::string> warnings;
};
FleshRequest read_flesh_request(const SceneFile& scene);

/// What of all frames is told in the end.
struct SeenFlesh
{
    std::int64_t limited = 0; ///< turns of joints that were cut to their limits
    std::size_t inverted = 0; ///< cells, at the most

    void add(const FleshFrame& frame);
    void add_warnings(const FleshSimulation& simulation,
                      std::vector<std::string>& out) const;
};

/// \p samples: where they are now.
Json told_of_flesh(std::int64_t number, const FleshFrame& frame,
                   const FleshSimulation& simulation,
                   const std::vector<Eigen::Vector3d>& samples);
/// What a picture shows of it.
FilmFrame seen_of_flesh(const FleshSimulation& simulation,
                        const std::vector<Eigen::Vector3d>& samples);
PartCounts parts_of_flesh(const FleshSimulation& simulation);

} // namespace cellwarp::core
