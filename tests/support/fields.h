// SPDX-License-Identifier: GPL-3.0-or-later
// Saved deformations made by real sessions.
#pragma once

#include <string>

#include "solver/field/field.h"

namespace cellwarp::core::support
{

/// The bytes of a field file: a bar along x, 6 long and 2 thick around the axis y = z =
/// 1, its low end held, its high end turned by 60 degrees.
std::string twisted_bar_field(FieldKind kind);

} // namespace cellwarp::core::support
