// SPDX-License-Identifier: GPL-3.0-or-later
// Texture coordinates of the corners of a model's faces. No deformation changes them:
// only files that are written anew need them.
#pragma once

#include <array>
#include <vector>

#include "io/formats/geometry.h"

namespace cellwarp::core
{

/// As glTF counts them, from the picture's upper left corner to the right and down.
using TextureCoordinate = std::array<float, 2>;

/// One for each corner of the faces of an OBJ or a glTF (its first set); where a face has
/// none, (0, 0). Empty: the model has none, or several at one place of a glTF.
std::vector<TextureCoordinate> texture_coordinates(const GeometryFile& file);

} // namespace cellwarp::core
