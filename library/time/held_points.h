// SPDX-License-Identifier: GPL-3.0-or-later
// Points of flesh that a scene holds, wholly or along a normal, in one lattice.
#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "library/time/flesh_model.h"
#include "solver/flesh/flesh.h"

namespace cellwarp::core
{

struct HeldPoints
{
    /// What moves points that are held wholly, as motions after those of the joints [m].
    std::vector<MoveKeys> holds;
    /// Those, in the order of the scene.
    std::vector<HeldPoint> whole;
    /// Held along a normal alone, or wholly where no node can be solved for.
    struct Guided
    {
        PulledPoint point;
        MoveKeys keys;  ///< where it is to go [m]
        int whole = -1; ///< number of those that are held wholly
    };
    std::vector<Guided> guided;
    std::size_t num_whole_guided = 0;
};

/// The cell of a lattice that holds a point; negative: none.
using CellOf = std::function<int(const Eigen::Vector3d& metres)>;

/// Throws Fault::Malformed for a point outside of the material.
HeldPoints held_points(const FleshModel& model, const Lattice& lattice,
                       const CellOf& cell_of);

/// Points that could not be eliminated, as in the middle of a cell, become guided ones;
/// those that bones have are told. The last points of \p flesh are held.whole.
void guide_what_is_not_bound(const FleshModel& model, const Flesh& flesh,
                             HeldPoints& held, std::vector<std::string>& warnings);

/// A point this far beside a cell lies in it [edge].
inline constexpr double kBeside = 1e-6;

} // namespace cellwarp::core
