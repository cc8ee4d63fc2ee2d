// SPDX-License-Identifier: GPL-3.0-or-later
// Obstacles of a scene: rods and flesh are kept out of them.
#pragma once

#include <array>
#include <optional>
#include <string>

#include "octree/base/rigid_move.h"

namespace cellwarp::core
{

class JsonObject;

/// One of plane, sphere and mesh, in metres for rods and in the model's unit for flesh.
struct ObstacleStatement
{
    std::optional<std::array<double, 4>> plane;  ///< all with normal . x < d, the last
    std::optional<std::array<double, 4>> sphere; ///< centre, radius
    std::string mesh;                            ///< file, resolved; empty: none
    double friction = 0.0;
    MoveKeys keys;     ///< of its motion; empty: it stays
    std::string field; ///< of the scene, for messages
};

/// Throws Fault::Malformed with the key that is wrong.
ObstacleStatement read_obstacle(JsonObject& object);

} // namespace cellwarp::core
