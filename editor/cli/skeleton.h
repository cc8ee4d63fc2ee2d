// SPDX-License-Identifier: GPL-3.0-or-later
// cellwarp skeleton: joints and bones from the shape itself. Only in builds with
// solver/skeleton.
#pragma once

#include "editor/cli/command.h"

namespace cellwarp::core
{

void add_skeleton(CLI::App& app, CommonFlags& common, int& exit_code);

} // namespace cellwarp::core
