// SPDX-License-Identifier: GPL-3.0-or-later
// What a newcomer does next.
#pragma once

#include <string>

#include "editor/document/document.h"
#include "editor/tools/events.h"

namespace cellwarp::core
{

/// How far a user has come with a document.
struct Progress
{
    bool is_dragging = false;
    int num_drags = 0;     ///< that changed something, in this session
    Tool tool = Tool::Box; ///< in use
};

/// Empty for who has bent a shape before, or opened one that is bent.
std::string next_step(const Document& document, const Progress& progress);

} // namespace cellwarp::core
