// SPDX-License-Identifier: GPL-3.0-or-later
// Models and handle files from values, for sessions.
#pragma once

#include <string>

#include "io/formats/geometry_file.h"
#include "io/scene/handle_file.h"
#include "tests/support/shapes.h"

namespace cellwarp::core::support
{

inline Geometry model(const Shape& shape)
{
    return scan_geometry("model.obj", obj_text(shape)).geometry;
}

/// The statements that follow the first.
inline HandleFile handles(const std::string& text)
{
    return parse_handles("h.handles", "cellwarp-handles 1\n" + text);
}

/// 1 x 1 x 4, a sample in the middle of each end.
inline Shape long_bar()
{
    return box_shape({-0.5, -0.5, 0}, {0.5, 0.5, 4}, 4);
}

} // namespace cellwarp::core::support
