// SPDX-License-Identifier: GPL-3.0-or-later
// Built instead of render.cpp where pictures are left out.
#include "editor/cli/command.h"
#include "editor/cli/pictures.h"

namespace cellwarp::core
{

void add_render(CLI::App&, CommonFlags&, int&) {}

std::optional<Pictures> make_pictures()
{
    return std::nullopt;
}

} // namespace cellwarp::core
