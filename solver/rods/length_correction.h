// SPDX-License-Identifier: GPL-3.0-or-later
// Takes back what the step of a rod stretches to second order.
#pragma once

#include <memory>
#include <span>

#include <Eigen/Core>

#include "solver/dynamics/saddle.h"
#include "solver/linear/band_matrix.h"
#include "solver/rods/rod_constraint.h"
#include "solver/rods/rod_term.h"

namespace cellwarp::core
{

/// A slender rod is far stiffer along itself than across, and what turns it stretches it
/// to second order: energies tell of that alone, and a step would be cut to where it is
/// small. The correction is what takes it back with the least elastic energy,
/// K d = -(what of the stretch is left), L d = 0, L the rows of what holds the rod. It is
/// of second order in the step: gradients do not change.
class LengthCorrection
{
public:
    /// The rod must outlive it.
    explicit LengthCorrection(const Rod& rod);

    /// The next step is from another base, or held by others.
    void forget() { is_of_base_ = false; }
    /// Corrects \p moved, which is \p base after \p step. \p holds hold at the base.
    void correct(const RodState& base, std::span<const RodConstraint> holds,
                 const Eigen::VectorXd& step, RodState& moved);

private:
    void factorize(const RodState& base, std::span<const RodConstraint> holds);

    std::unique_ptr<RodTerm> elasticity_;
    BandMatrix matrix_;
    SaddleSolver solver_;
    Eigen::Index num_rows_ = 0;
    bool is_of_base_ = false;
};

} // namespace cellwarp::core
