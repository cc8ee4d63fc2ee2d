// SPDX-License-Identifier: GPL-3.0-or-later
// Smaller cells where flesh bends, touches or is pulled, and larger ones again where it
// comes to rest: what is split and what is put together, by the state alone, and how a
// state goes from one lattice to the next. [theory-skeleton 2]
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "library/time/flesh_body.h"
#include "octree/octree.h"
#include "solver/flesh/flesh.h"
#include "solver/flesh/leaving_nodes.h"

namespace cellwarp::core
{

/// How long detail takes to leave, and has to be idle before [s].
inline constexpr double kFade = 0.25;

/// How often it is looked whether detail comes or goes [s].
inline constexpr double kDetailEvery = 1.0 / 30.0;

/// A part of the state of flesh in time.
struct FleshDetail
{
    /// Now, and what it is about to become.
    std::shared_ptr<const Octree> octree, coarser;
    /// A box whose parts are all undivided, and since when it is idle, or leaves [step].
    struct Family
    {
        Leaf box;
        std::int64_t since = 0;
    };
    std::vector<Family> idle, leaving; ///< in the order of the octree
    std::vector<Fading> fading;        ///< of the own motions of the body
    /// Of joints and of what is held, at the begin of the last step and at its end: how
    /// fast they are; and a step earlier, where that one was of BDF2.
    std::vector<Motion> before, now, earlier;

    bool has_lattice_of(const FleshDetail& other) const
    {
        return octree == other.octree && coarser == other.coarser;
    }
};

/// Of each cell, how far its strain is from even: the largest difference of Green's mean
/// strains of it and a neighbour, as a slope, times the square of its width across their
/// side [m]. Four times less
/// in halved cells where flesh bends.
std::vector<double> uneven_strains(const FleshBody& body, const FleshState& state);

/// What a look at the flesh leads to.
struct DetailLook
{
    std::span<const double> errors;  ///< of the cells, as uneven_strains() has them [m]
    std::span<const char> is_wanted; ///< cells that are to be small anyway
    double threshold = 0.0;          ///< cells of larger errors are split [m]
    double time = 0.0;               ///< now, as `fading` has it [s]
    std::int64_t step = 0;           ///< the same
    std::int64_t steps_of_fade = 1;
    std::int64_t most_cells = 0; ///< the octree is not split beyond
};

struct DetailChange
{
    bool has_changed = false;          ///< the octree, or the coarser one
    std::size_t split = 0, merged = 0; ///< leaves; boxes
    bool is_full = false;              ///< for want of most_cells something was not split
};
/// Splits, lets leave, and takes what has left. Where it has changed something `fading`
/// is still that of before. \p body: of \p detail.
DetailChange change_detail(const FleshBody& body, const DetailLook& look,
                           FleshDetail& detail);

/// The state of flesh in another lattice.
struct CarriedState
{
    FleshState state;
    std::vector<int> old_node; ///< of each node the one that it was, or -1
};
/// Displacements and velocities stay as they are. Cells of \p to are cells of \p from, or
/// of its coarser lattice, or parts of those.
CarriedState carried_to(const FleshBody& to, const FleshBody& from,
                        const FleshState& state);

} // namespace cellwarp::core
