// SPDX-License-Identifier: GPL-3.0-or-later
// Where the corners of a model's faces lie on its picture. No deformation changes that:
// only files that are written anew ask for it.
#pragma once

#include <array>
#include <vector>

#include "io/geometry.h"

namespace cellwarp
{

/// As glTF counts them, from the picture's upper left corner to the right and down.
using TextureCoordinate = std::array<float, 2>;

/// One for each corner of the faces of an OBJ or a glTF (its first set); where a face has
/// none, (0, 0). Empty: the model has none, or several at one place of a glTF.
std::vector<TextureCoordinate> texture_coordinates(const GeometryFile& file);

} // namespace cellwarp
