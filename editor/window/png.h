// SPDX-License-Identifier: GPL-3.0-or-later
// Pictures of the window as files.
#pragma once

#include <string>

#include "editor/window/window.h"

namespace cellwarp
{

/// A PNG file's bytes.
std::string png_of(const Pixels& pixels);
/// A binary PPM file's bytes: what programs read without a library.
std::string ppm_of(const Pixels& pixels);

} // namespace cellwarp
