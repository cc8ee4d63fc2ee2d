// SPDX-License-Identifier: GPL-3.0-or-later
// Formats that are only read, through a library that drops much of what they hold.
// Optional: a build without it has no_import.cpp in its place.
#pragma once

#include <string>
#include <string_view>

#include "io/formats/geometry.h"

namespace cellwarp::core
{

/// Whether files with that lower-case extension are read by import_geometry(), in a
/// build that has it.
bool is_import_format(std::string_view extension);

/// Samples (of every instance of a mesh, in the world's space), faces and normals of the
/// file \p path that holds \p bytes. No other file is opened. What the library does to
/// itself on the way ends in Fault::Malformed.
Geometry import_geometry(const std::string& path, const std::string& bytes);

} // namespace cellwarp::core
