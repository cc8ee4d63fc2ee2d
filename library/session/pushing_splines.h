// SPDX-License-Identifier: GPL-3.0-or-later
// The rods of a session that push back: solved for in one minimum with the cells.
#pragma once

#include <memory>
#include <vector>

#include <Eigen/Core>

#include "library/session/spline_handle.h"
#include "octree/base/rigid_motion.h"
#include "solver/coupled/pushing_rods.h"

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
    std::size_t region = 0;               ///< of the session
};

class PushingSplines final : public PushingRods
{
public:
    /// For cells whose state and term keep their addresses.
    PushingSplines(CellState& cells, const GlueTerm& glue,
                   std::vector<PushingSpline> splines);

    std::size_t size() const { return splines_.size(); }
    /// Whether a rod stays where it is while others and the cells are solved for.
    void lead(std::size_t rod, bool it_leads) { rods().lead(rod, it_leads); }
    /// A rod from here on, then moved as a whole.
    void set(std::size_t rod, const std::shared_ptr<const SplineState>& state,
             const Motion& motion);
    /// Where the last solve has left it.
    std::shared_ptr<const SplineState> solved(std::size_t rod) const;
    /// Holds are kept to first order in a solve: brings the rods back to where they hold
    /// exactly. Returns whether one had left.
    bool bring_back();

private:
    std::vector<RodConstraint> holds_of(std::size_t rod, const RodState& now) const;

    std::vector<PushingSpline> splines_;
    std::vector<std::shared_ptr<const SplineState>> states_; ///< as set
};

} // namespace cellwarp::core
