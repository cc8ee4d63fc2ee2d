// SPDX-License-Identifier: GPL-3.0-or-later
// cellwarp render: pictures without a display. Only in builds with library/picture.
#pragma once

#include "editor/cli/command.h"
#include "editor/cli/pictures.h"

namespace cellwarp::core
{

void add_render(CLI::App& app, CommonFlags& common, int& exit_code);

/// Figures of reports: see make_pictures().
Pictures rendered_pictures();

} // namespace cellwarp::core
