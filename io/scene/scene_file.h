// SPDX-License-Identifier: GPL-3.0-or-later
// Scene files (*.json) as plain values: a model, its handle file, settings, a skeleton,
// and what moves in time.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "io/scene/rod_scene.h"
#include "io/scene/scene_settings.h"
#include "io/scene/skeleton_scene.h"

namespace cellwarp::core
{

/// The octree's own frame: a point x has frame coordinates axes * (x - origin).
struct FrameBox
{
    std::array<double, 3> origin{};
    std::array<std::array<double, 3>, 3> axes{}; ///< rows: unit vectors, right-handed
    std::array<double, 3> size{};                ///< [model unit]; >= 0
};

/// All that a scene says; what it leaves out stays empty.
struct SceneFile
{
    std::string path;
    std::string model;   ///< resolved against the scene file; empty: rods in time alone
    std::string handles; ///< resolved; empty if none
    SceneSettings settings;
    std::optional<FrameBox> frame;
    std::optional<std::string> save; ///< that wrote it, see saved_pair.h
    std::optional<SkeletonScene> skeleton;
    RodScene time;
    bool is_simulated = false;             ///< has "simulate"
    std::vector<std::string> warnings;     ///< with those of unknown keys
    std::vector<std::string> unknown_keys; ///< remarks about them alone
    std::vector<std::string> left_out;     ///< warnings of what is for other commands
    /// Keys, from the root on, whose values name files relative to the scene.
    std::vector<std::string> file_keys;
    std::string text; ///< as it was read, with what the rest leaves out

    /// Whether flesh follows the skeleton in time.
    bool has_flesh() const { return skeleton && is_simulated; }
    /// Whether rods, bodies, nets or sheets move in time.
    bool has_moving_objects() const
    {
        return time.has_objects() && (is_simulated || model.empty());
    }
    bool is_in_time() const { return has_flesh() || has_moving_objects(); }
};

/// Throws Fault::File or Fault::Malformed with the line of a syntax error or the
/// path of a wrong value ("cells.gap"), in whatever part of the scene.
SceneFile read_scene(const std::string& path);
/// \p model: stands for the model where the text names none; empty: it has to, if
/// something in it needs one.
SceneFile parse_scene(const std::string& path, const std::string& text,
                      const std::string& model = "");

/// The scene at \p path; another file is the model of a scene that says nothing else.
SceneFile scene_or_model(const std::string& path);

/// Throws Fault::Malformed for a scene without a model.
void need_model(const SceneFile& scene);

/// The scene's text, for \p scene.path: parse_scene() gives the same values to the bit.
/// Model and handles are named relative to its folder where they can be. What
/// parse_scene() left out with a warning stands in scene.text and is written as it was.
/// Throws Fault::Usage for a file name that is no UTF-8 text. \pre All values are as
/// parse_scene() accepts them.
std::string scene_text(const SceneFile& scene);

/// The text of \p scene as a scene at \p to: the names of files in it lead to the same
/// files. \pre parse_scene() has read the scene
std::string moved_scene_text(const SceneFile& scene, const std::string& to);

} // namespace cellwarp::core
