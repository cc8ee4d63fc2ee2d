// SPDX-License-Identifier: GPL-3.0-or-later
// Scenes at the ends of what numbers and settings allow, made by formula: files that any
// command of the program takes.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace cellwarp::core
{

/// A file of a scene, beside it.
struct SceneText
{
    std::string name, text;
};

/// A scene to be run.
struct StabilityCase
{
    std::string group; ///< "rotations", "teleports", ...
    std::string name;  ///< of its file, without ".json"
    std::string path;

    /// The scene whose result this one would have, but for rounding: it is that one times
    /// \ref scale, moved by \ref offset. Empty: none.
    std::string same_as;
    double scale = 1.0;
    Eigen::Vector3d offset = Eigen::Vector3d::Zero();
    /// The energy of what moves may not grow: nothing drives it.
    bool is_left_alone = false;
};

struct ExtremeScene
{
    StabilityCase of;  ///< its path is empty until it is a file
    std::string scene; ///< JSON
    std::vector<SceneText> files;
};

/// All, in groups; those that others are compared with first. Scenes of one group differ
/// in one thing. \p long_steps: of the longest run in time.
std::vector<ExtremeScene> extreme_scenes(std::int64_t long_steps);

} // namespace cellwarp::core
