// SPDX-License-Identifier: GPL-3.0-or-later
// How soft flesh is for its weight: whether there is a rest worth finding.
#pragma once

#include <string>

#include "editor/flesh/flesh_body.h"

namespace cellwarp
{

/// Of the place where the weight of what hangs beyond the held points is largest for the
/// stiffness.
struct Softness
{
    double weight = 0.0; ///< density gravity reach / E
    double reach = 0.0;  ///< distance from the nearest held point [m]
    double young = 0.0;  ///< E that makes `weight` 1, rounded up to two digits [Pa]
    std::string field;   ///< the material's, of the scene
};

/// All zero without gravity, or where nothing is held.
Softness softness_of(const FleshBody& body);

/// Flesh that is softer than this ends inside out, if it comes to rest at all.
inline constexpr double kSoftest = 3.0;

/// Throws Fault::Malformed where the flesh is softer than kSoftest.
void refuse_without_rest(const FleshBody& body);

} // namespace cellwarp
