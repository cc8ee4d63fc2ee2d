// SPDX-License-Identifier: GPL-3.0-or-later
// The softness of flesh beside its weight: whether there is a rest worth finding.
#pragma once

#include <string>

#include "library/time/flesh_body.h"

namespace cellwarp::core
{

/// The place where the weight of the flesh beyond the held points is largest beside its
/// stiffness.
struct Softness
{
    double weight = 0.0; ///< density gravity reach / E
    double reach = 0.0;  ///< distance from the nearest held point [m]
    double young = 0.0;  ///< E that makes `weight` 1, rounded up to two digits [Pa]
    std::string field;   ///< the material's, of the scene
};

/// All zero without gravity, where nothing is held, or where the drawn shape is at rest.
Softness softness_of(const FleshBody& body);

/// Flesh that is softer than this ends inside out, if it comes to rest at all.
inline constexpr double kSoftest = 3.0;

/// The stiffness of all material for which the scene tells none, such that a sample sags
/// by kSag of the diagonal at the most, by small strain, where gravity is 9.81 m/s^2
/// against y, whatever the scene's; rounded up to two digits [Pa]. 0: nothing sags.
/// \pre that material has kFirstYoung
double holding_stiffness(const FleshBody& body);
inline constexpr double kSag = 0.02;

/// Adds a warning, with the stiffness that would do, if a sample sags by more than
/// kMuchOfSize of the diagonal in the scene's gravity, by small strain, or by more than
/// kMuchOfThickness of the flesh between it and what holds it (a cell at the least).
void warn_of_sag(FleshBody& body);
inline constexpr double kMuchOfSize = 0.1;
inline constexpr double kMuchOfThickness = 1.0 / 3.0;

/// Whether the flesh hangs in its weight from the first frame on: as the scene says, else
/// where it has a rest (no obstacle, no part without a bone, not softer than kSoftest);
/// with blended regions not, as they would make factors for it.
bool settles(const FleshBody& body);

/// Throws Fault::Malformed where the flesh is softer than kSoftest.
void refuse_without_rest(const FleshBody& body);

} // namespace cellwarp::core
