// SPDX-License-Identifier: GPL-3.0-or-later
// Stretch, bending and twist of a rod. elasticity.cpp has the derivation.
#pragma once

#include <memory>

#include "solver/rods/rod_term.h"

namespace cellwarp::core
{

struct ElasticParts
{
    bool has_stretch = true, has_bending = true, has_twist = true;
    /// False: the strains store nothing, but lose by RodTerm::damp().
    bool has_energy = true;
};

/// The whole energy of a C1 rod of degree 2 or more: axial strain, curvature about both
/// directions of the section, twist, each against its rest. The rod must outlive it.
std::unique_ptr<RodTerm> exact_elasticity(const Rod& rod, const ElasticParts& parts = {});

} // namespace cellwarp::core
