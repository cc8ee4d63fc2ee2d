// SPDX-License-Identifier: GPL-3.0-or-later
// Which points touch, which of them stick and which slip, and what is pulled, in one
// step.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "solver/flesh/bound_nodes.h"
#include "solver/flesh/flesh_contact.h"
#include "solver/flesh/node_rows.h"

namespace cellwarp::core
{

/// Points of the material by the free nodes.
class FreeShares
{
public:
    FreeShares(const BoundNodes& nodes, std::size_t num_nodes);

    struct Shares
    {
        /// Of free nodes, by their places among those; none where bones have the point.
        NodeShares free;
        NodeShares points; ///< of held points
    };
    Shares of(std::span<const NodeShare> shares) const;

private:
    const BoundNodes& nodes_;
    std::vector<int> place_; ///< of a free node >= 0; of a bound one -1 - its place
};

/// The changing rows of one step; in its rounds of Newton's method they are those that
/// the round before found.
class StepRows
{
public:
    /// All must outlive it. \p size: of the body [m].
    StepRows(const FreeShares& shares, const FleshSurface& surface,
             const FleshSurroundings& around, double dt, double size);

    /// Solves with these rows and brakes for the change of the velocities, of which
    /// \p x is that of free nodes and \p change, see solve(), that of all. \p b has what
    /// brakes do to velocities that do not change.
    using Solve = std::function<void(NodeRows& rows, std::span<const NodeBrake> brakes,
                                     const Eigen::VectorXd& b, Eigen::VectorXd& x,
                                     Eigen::VectorXd& l)>;

    /// Solves until all that presses touches and nothing is held back that would leave.
    /// \p u: at the step's beginning; \p v: velocities so far; \p held: changes of the
    /// held points' velocities; \p b: right side, of free nodes; \p change: what \p solve
    /// finds.
    FleshContacts solve(const Eigen::VectorXd& u, const Eigen::VectorXd& v,
                        const Eigen::VectorXd& held, const Eigen::VectorXd& b,
                        const Eigen::VectorXd& scale, const Solve& solve,
                        const Eigen::VectorXd& change);

private:
    /// What a round finds to be other than the one before had it.
    enum class Change
    {
        None,
        Friction,
        Touches
    };
    struct Touch
    {
        FleshSurface::Candidate at;
        double depth = 0.0; ///< gap that it may have after the step; <= 0 [m]
        double speed = 0.0; ///< along the surface, before the step [m/s]
        bool slips = false;
        double brake = 0.0; ///< where it slips: impulse a speed [kg]
    };
    bool take(const FleshSurface::Candidate& candidate, const Eigen::VectorXd& u,
              const Eigen::VectorXd& v);
    Change look_at_forces(const Eigen::VectorXd& v, const Eigen::VectorXd& l,
                          std::span<const int> first_of_touch, bool may_release);
    bool find_rub(Touch& touch, const FleshObstacle& obstacle, const Eigen::VectorXd& v,
                  const Eigen::VectorXd& l, Eigen::Index first, bool may_stick) const;

    const FreeShares& shares_;
    const FleshSurface& surface_;
    const FleshSurroundings around_;
    double dt_, size_;
    std::vector<Touch> touches_; ///< ascending by obstacle and node
    Eigen::VectorXd scale_;      ///< of free nodes
    bool has_begun_ = false;
};

} // namespace cellwarp::core
