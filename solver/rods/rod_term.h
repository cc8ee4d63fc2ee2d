// SPDX-License-Identifier: GPL-3.0-or-later
// What acts on a rod and can be written as an energy: a whole kind at a time, so that no
// call is virtual for an element.
#pragma once

#include <Eigen/Core>

#include "solver/linear/band_matrix.h"
#include "solver/rods/rod.h"
#include "solver/rods/rod_hessian.h"

namespace cellwarp::core
{

/// Vectors are of RodLayout. Derivatives are in steps from the state.
class RodTerm
{
public:
    virtual ~RodTerm() = default;

    /// The rod has another knot.
    virtual void follow(const RodChange& change) = 0;
    virtual double value(const RodState& state) const = 0; ///< [J]
    /// What a small step pulls back with, at the most, but for the rod's own [N/m].
    virtual double stiffness() const { return 0.0; }
    /// Size of what cancels in value(): its rounding is a share of that [J].
    virtual double cancelled() const { return 0.0; }
    virtual void add_gradient(const RodState& state, Eigen::VectorXd& out) const = 0;
    /// \pre \p out is of the rod's layout: its rows, its band.
    virtual void add_hessian(const RodState& state, RodHessian how,
                             BandMatrix& out) const = 0;

    // Material damping: a strain e of stiffness k has the stress k (e + beta e'), e' its
    // rate.

    /// From here on step_value(), gradients and second derivatives have
    /// 1/2 gain k (e - e(\p begin))^2 beside the energy, but for a constant in the value;
    /// with \p gain 0 they do not.
    virtual void damp(const RodState& begin, double gain)
    {
        static_cast<void>(begin);
        static_cast<void>(gain);
    }
    virtual double step_value(const RodState& state) const { return value(state); }
    /// Adds the sum of \p time k e' grad e, the rates of \p velocity, to the gradient.
    virtual void add_damping_forces(const RodState& state,
                                    const Eigen::VectorXd& velocity, double time,
                                    Eigen::VectorXd& out) const
    {
        static_cast<void>(state);
        static_cast<void>(velocity);
        static_cast<void>(time);
        static_cast<void>(out);
    }

    // Slender rods are so much stiffer along themselves than across that the stretch
    // force of a state on the way to equilibrium is noise. Newton's method asks for the
    // force that its last step leads to, to first order, instead.

    /// The next add_hessian() takes the stretch force that \p step, from \p state, was to
    /// lead to; null: that of its own state.
    virtual void predict(const RodState& state, const Eigen::VectorXd* step)
    {
        static_cast<void>(state);
        static_cast<void>(step);
    }
    /// Adds -sum YA grad eps [eps(after) - eps(before) - grad eps . step], the gradients
    /// of \p before: what is left of the stretch by its curvature along the step.
    virtual void add_correction(const RodState& before, const RodState& after,
                                const Eigen::VectorXd& step, Eigen::VectorXd& out) const
    {
        static_cast<void>(before);
        static_cast<void>(after);
        static_cast<void>(step);
        static_cast<void>(out);
    }
};

} // namespace cellwarp::core
