// SPDX-License-Identifier: GPL-3.0-or-later
// Newton's method for the equilibrium of one rod.
#pragma once

#include <Eigen/Core>

#include "solver/dynamics/articulation.h"
#include "solver/rods/rod_object.h"

namespace cellwarp::core
{

class RodNewton
{
public:
    /// The model must outlive it.
    explicit RodNewton(RodModel& model) : object_(model), alone_({&object_}) {}
    RodNewton(const RodNewton&) = delete;
    RodNewton& operator=(const RodNewton&) = delete;

    /// From \p state on, which is the best found at the end.
    MotionReport solve(RodState& state, const MotionOptions& options = {})
    {
        object_.aim(state);
        return alone_.solve(options);
    }

    /// Multipliers of the last solve, a row; as forces on the rod, L^T lambda.
    const Eigen::VectorXd& multipliers() const { return alone_.multipliers(0); }

private:
    RodObject object_;
    Articulation alone_;
};

} // namespace cellwarp::core
