// SPDX-License-Identifier: GPL-3.0-or-later
// Samples, faces and normals written anew, as OBJ or PLY: for models of formats that
// can only be read. Everything else is patched, see geometry.h.
#pragma once

#include <string>
#include <string_view>

#include "io/geometry.h"

namespace cellwarp
{

/// Whether that is an extension of plain_mesh_bytes(): "obj" or "ply".
bool is_plain_format(std::string_view extension);

/// The file's bytes; normals only where every sample has one, groups of faces in OBJ. PLY
/// is binary with coordinates in doubles.
std::string plain_mesh_bytes(const Geometry& geometry, const DeformedSamples& patch,
                             std::string_view extension);

} // namespace cellwarp
