// SPDX-License-Identifier: GPL-3.0-or-later
// Samples, faces and normals written anew: for models of formats that can only be read,
// and where another format is asked for. Everything else is patched, see geometry.h.
#pragma once

#include <string>
#include <string_view>

#include "io/formats/geometry.h"

namespace cellwarp::core
{

/// Whether that is what becomes of a format that can only be read: "obj" or "ply".
bool is_plain_format(std::string_view extension);

/// Whether that is an extension of plain_mesh_bytes(): those, or "off", "stl", "xyz".
bool is_converted_format(std::string_view extension);

/// Whether every sample has a normal: others are left out.
bool has_all_normals(const Geometry& geometry);

/// The file's bytes; normals only where every sample has one, groups of faces in OBJ. PLY
/// is binary with coordinates in doubles. STL is binary: the triangles that the
/// faces are cut into at rest, in single precision. XYZ has no faces.
std::string plain_mesh_bytes(const Geometry& geometry, const DeformedSamples& patch,
                             std::string_view extension);

} // namespace cellwarp::core
