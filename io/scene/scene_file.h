// SPDX-License-Identifier: GPL-3.0-or-later
// Scene files (*.json) as plain values: a model, its handle file, and settings.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "io/scene/scene_settings.h"
#include "io/scene/skeleton_scene.h"
#include "io/scene/time_settings.h"

namespace cellwarp::core
{

/// The octree's own frame: a point x has frame coordinates axes * (x - origin).
struct FrameBox
{
    std::array<double, 3> origin{};
    std::array<std::array<double, 3>, 3> axes{}; ///< rows: unit vectors, right-handed
    std::array<double, 3> size{};                ///< [model unit]; >= 0
};

/// What the scene says; what it leaves out stays empty.
struct SceneFile
{
    std::string path;
    std::string model;   ///< resolved against the scene file
    std::string handles; ///< resolved; empty if none
    SceneSettings settings;
    std::optional<FrameBox> frame;
    std::optional<std::string> save; ///< that wrote it, see saved_pair.h
    std::vector<std::string> warnings;
    std::vector<std::string> left_out; ///< warnings of what is for other commands
    bool has_carriers = false;         ///< rods carry the model: see rod_scene.h
    std::optional<SkeletonScene> skeleton;
    bool has_rods = false;            ///< or bodies, nets, sheets: see rod_scene.h
    std::optional<TimeSettings> time; ///< of flesh that follows the skeleton
    std::string text;                 ///< as it was read, with what the rest leaves out
};

/// Whether a scene is about a model: rods in time need none. Throws as read_scene() for
/// what is no JSON.
bool has_model(const std::string& path);

/// Throws Fault::File or Fault::Malformed with the line of a syntax error or the
/// path of a wrong value ("cells.gap").
SceneFile read_scene(const std::string& path);
SceneFile parse_scene(const std::string& path, const std::string& text);

/// The scene's text, for \p scene.path: parse_scene() gives the same values to the bit.
/// Model and handles are named relative to its folder where they can be. What
/// parse_scene() left out with a warning stands in scene.text and is written as it was.
/// Throws Fault::Usage for a file name that is no UTF-8 text. \pre All values are as
/// parse_scene() accepts them.
std::string scene_text(const SceneFile& scene);

/// The text of the scene at \p from as a scene at \p to says it: the files that it names
/// beside its model and handles are the same. \pre parse_scene() has accepted the text
std::string moved_scene_text(const std::string& text, const std::string& from,
                             const std::string& to);

} // namespace cellwarp::core
