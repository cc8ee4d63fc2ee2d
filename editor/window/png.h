// SPDX-License-Identifier: GPL-3.0-or-later
// Pictures of the window as files.
#pragma once

#include <string>

#include "editor/window/window.h"

namespace cellwarp
{

/// A PNG file's bytes.
std::string png_of(const Pixels& pixels);

} // namespace cellwarp
