// SPDX-License-Identifier: GPL-3.0-or-later
// The rods of a session that push back: solved for in one minimum with the cells.
#pragma once

#include <memory>
#include <vector>

#include <Eigen/Core>

#include "library/session/spline_handle.h"
#include "octree/base/rigid_motion.h"
#include "solver/cells/companion.h"

namespace cellwarp::core
{

/// A rod and its cells.
struct PushingSpline
{
    std::shared_ptr<const SplineHandle> spline;
    std::vector<int> cells;
    std::vector<double> at;               ///< parameter of each
    std::vector<Eigen::Vector3d> centres; ///< of each, at rest
    bool is_alone = false;                ///< nothing else holds its body
};

class PushingSplines : public Companion
{
public:
    virtual std::size_t size() const = 0;
    /// Whether a rod stays where it is while others and the cells are solved for.
    virtual void lead(std::size_t rod, bool it_leads) = 0;
    /// A rod from here on, then moved as a whole.
    virtual void set(std::size_t rod, const std::shared_ptr<const SplineState>& state,
                     const Motion& motion) = 0;
    /// Where the last solve has left it.
    virtual std::shared_ptr<const SplineState> solved(std::size_t rod) const = 0;
    /// Holds are kept to first order in a solve: brings the rods back to where they hold
    /// exactly. Returns whether one had left.
    virtual bool bring_back() = 0;
};

/// For cells whose state and term keep their addresses.
std::unique_ptr<PushingSplines> make_pushing_splines(CellState& cells,
                                                     const GlueTerm& glue,
                                                     std::vector<PushingSpline> rods);

} // namespace cellwarp::core
