// SPDX-License-Identifier: GPL-3.0-or-later
// Names for the joints of a tree of limbs.
#pragma once

#include <string>
#include <vector>

#include "octree/limb_tree.h"

namespace cellwarp::core
{

/// "root", then "limb3.2": the second joint of the third limb; where the limb has a
/// counterpart on the other side of the body "limb3.2.L" and "limb3.2.R". Of a body with
/// legs, which is symmetric and whose paired limbs reach the ground, legs, arms, fingers,
/// toes, the spine and the head have these names instead of limb3. \p up: its axis that
/// points upwards, x, y or z. Left is the side to the left of where the feet point, or
/// where that is not clear the side of x; of y if x points upwards.
std::vector<std::string> limb_names(const std::vector<LimbJoint>& joints, char up = 'y');

} // namespace cellwarp::core
