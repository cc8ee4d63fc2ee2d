// SPDX-License-Identifier: GPL-3.0-or-later
// Flags of the subcommands that solve an edit, and the request that they make.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "editor/cli/flag_script.h"
#include "io/scene/scene_settings.h"
#include "library/session/session_request.h"

namespace CLI
{
class App;
}

namespace cellwarp::core
{

/// Flags about cells and solving, as given: what is left out falls to the scene,
/// then to the defaults of SessionSettings.
struct SessionFlags
{
    std::string model;
    std::string columns;
    std::string handles, sel, def;
    FlagScript script;
    SceneSettings settings;
    std::optional<double> time;
    std::optional<std::int64_t> max_iterations;
    std::optional<std::string> solver, max_memory;
    bool is_preview = false, is_tight = false;

    void add_to(CLI::App& app);
    bool has_session() const; ///< a scene, or a model with handles
};

/// The request of flags and their model, which may be a scene; flags win. \p scene: the
/// model, if it has been read already. Throws Error.
SessionRequest read_request(const SessionFlags& flags, ForTime for_time = ForTime::No,
                            std::optional<SceneFile> scene = {});

} // namespace cellwarp::core
