// SPDX-License-Identifier: GPL-3.0-or-later
// Scenes in time as --json and `check` describe them.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "io/formats/geometry.h"
#include "io/scene/handle_file.h"
#include "io/scene/scene_file.h"
#include "library/session/body.h"
#include "library/session/json.h"
#include "library/time/simulation.h"

namespace cellwarp::core
{

/// Places of a rod's curve in --json, and of its line in files.
inline constexpr int kPlacesOfCurve = 33;

/// A frame: its number, its report, and where all objects are.
Json moment_json(std::int64_t frame, const SimulationReport& report,
                 Simulation& simulation);
/// Adds facts of the whole simulation: mass, carriers, unused parts.
void add_summary(const Simulation& simulation, Json& json);

/// Objects of a scene in time by their kinds, and its duration; null for other scenes.
Json objects_json(const SceneFile& scene);
/// Rods of a scene, an object each.
Json rods_in_time_json(const SceneFile& scene);
/// "2 rods, 1 sheet, 61 frames, 600 steps". \pre scene.has_moving_objects()
std::string objects_text(const SceneFile& scene);

/// Facts of flesh for `check`.
struct FleshFacts
{
    Json json;
    std::string text;
    std::vector<std::string> warnings;
};
/// Nothing for scenes without flesh.
std::optional<FleshFacts> facts_of_flesh(const SceneFile& scene,
                                         const HandleFile& handles,
                                         const Geometry& geometry,
                                         const CellSettings& cells);

} // namespace cellwarp::core
