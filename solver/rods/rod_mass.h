// SPDX-License-Identifier: GPL-3.0-or-later
// The generalised mass of a rod: M_ij = int mu b_i b_j ds, the same matrix for x, y and
// z, and rho (I_1 + I_2) of the spin, linear between the stations. [Lenoir04]
#pragma once

#include <vector>

#include <Eigen/Core>

#include "solver/linear/band_matrix.h"
#include "solver/rods/rod.h"

namespace cellwarp::core
{

class RodMass
{
public:
    /// The rod must outlive it.
    explicit RodMass(const Rod& rod);
    /// Finds it again: the rod has another knot.
    void find();

    /// out += scale * M
    void add_to(BandMatrix& out, double scale) const;
    /// M v. Vectors are of RodLayout.
    Eigen::VectorXd times(const Eigen::VectorXd& v) const;
    /// M^-1 b: three systems with one factor, and one of the angles.
    Eigen::VectorXd solved(const Eigen::VectorXd& b) const;
    /// The first unknowns of the control points, ascending.
    const std::vector<int>& first_unknowns() const { return control_; }
    /// One of the three systems, with an entry a control point in that order: b becomes
    /// its solution.
    void solve_one(Eigen::VectorXd& b) const { place_factor_.solve(b); }
    double kinetic_energy(const Eigen::VectorXd& velocity) const
    {
        return 0.5 * velocity.dot(times(velocity));
    }
    /// int mu b_k ds: what a uniform acceleration pulls with, [kg] of each control point.
    const Eigen::VectorXd& weights() const { return weights_; }
    double total() const { return weights_.sum(); } ///< [kg]
    Eigen::Vector3d momentum(const Eigen::VectorXd& velocity) const;
    /// About the origin.
    Eigen::Vector3d angular_momentum(const RodState& state,
                                     const Eigen::VectorXd& velocity) const;

private:
    void lay_out();
    void add_span(std::size_t span);

    const Rod& rod_;
    std::vector<int> control_, station_; ///< first unknowns, in the order of the bands
    std::vector<int> rank_, spin_rank_;  ///< places of control points and stations there
    BandMatrix place_, spin_;
    BandFactor place_factor_, spin_factor_;
    Eigen::VectorXd weights_;
};

} // namespace cellwarp::core
