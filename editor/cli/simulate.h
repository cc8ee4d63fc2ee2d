// SPDX-License-Identifier: GPL-3.0-or-later
// cellwarp simulate: rods in time. Only in builds with solver/rods.
#pragma once

#include "editor/cli/command.h"

namespace cellwarp
{

/// See film_of(). Of a scene file without rods nothing.
std::optional<Film> film_of_rods(const std::string& scene);

/// See rods_in_time().
Json rods_of_scene(const std::string& scene);

void add_simulate(CLI::App& app, CommonFlags& common, int& exit_code);

} // namespace cellwarp
