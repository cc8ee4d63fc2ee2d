// SPDX-License-Identifier: GPL-3.0-or-later
// An edit session as files ask for it: the model, the handles and the settings of a
// scene.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "io/formats/geometry_file.h"
#include "io/scene/scene_file.h"
#include "library/session/session.h"

namespace cellwarp::core
{

/// Values that replace a scene's own statements.
struct SceneChanges
{
    std::string columns;              ///< of text in columns, see ReadOptions
    std::string handle_file;          ///< empty: the scene's
    std::optional<HandleFile> script; ///< in the place of a handle file
    SceneSettings settings;           ///< those that are set
    bool is_preview = false;          ///< the field of drags
    std::optional<double> max_memory; ///< [byte]; default_memory_limit() without
};

struct SessionRequest
{
    SceneFile scene;
    ReadOptions read;
    std::optional<HandleFile> handles;
    SessionSettings settings;
    std::vector<std::string> warnings;
};

/// Whether a simulation reads a scene, which may have rods that carry the model.
enum class ForTime
{
    No,
    Yes
};

/// The request of a scene; reads its handle file. Throws what the reader throws,
/// Fault::Malformed for a scene without a model, and Fault::Budget if the model is too
/// large for the memory.
SessionRequest request_of(SceneFile scene, ForTime for_time,
                          const SceneChanges& changes = {});

} // namespace cellwarp::core
