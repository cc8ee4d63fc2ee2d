// SPDX-License-Identifier: GPL-3.0-or-later
// What nets and splines that springs hold together have in common: points that move by
// implicit Euler.
#pragma once

#include <algorithm>

#include <Eigen/Core>

#include "solver/dynamics/articulable_object.h"
#include "solver/dynamics/distance_springs.h"

namespace cellwarp::core
{

class SpringObject : public ArticulableObject
{
public:
    Eigen::VectorXd x, velocity;                       ///< 3 of each point [m], [m/s]
    Eigen::Vector3d gravity = Eigen::Vector3d::Zero(); ///< [m/s^2]
    double damping = 0.0; ///< of the springs: force follows length + damping * rate [s]

    virtual double kinetic() const = 0;                   ///< [J]
    double elastic() const { return springs_.energy(x); } ///< [J]

    int num_unknowns() const override { return static_cast<int>(x.size()); }
    double size() const override { return size_; }
    double extent() const override { return std::max(size_, x.cwiseAbs().maxCoeff()); }
    double noise_of_forces() const override;
    double cancelled() const override
    {
        return 1e-6 * springs_.stiffest() * size_ * size_;
    }
    double turn(const Eigen::VectorXd& step) const override
    {
        return springs_.turn(x, step);
    }
    void try_step(const Eigen::VectorXd& step, double length) override
    {
        trial_ = x + length * step;
    }
    void try_more(const Eigen::VectorXd& step) override { trial_ += step; }
    void add_correction(const Eigen::VectorXd& part, Eigen::VectorXd& out) const override
    {
        springs_.add_correction(x, trial_, part, out);
    }
    void accept(const Eigen::VectorXd*) override { x = trial_; }
    void go_back() override { x = start_; }
    void start(double step) override;
    void finish() override;
    void undo() override;
    double way() const override { return (x - start_).cwiseAbs().maxCoeff(); }
    Energy energy() const override;
    void rest() override { velocity.setZero(); }

protected:
    /// At rest there.
    void stand_at(Eigen::VectorXd points);
    /// What gravity can still do, zero at the origin [J].
    double weight(const Eigen::VectorXd& at) const;

    DistanceSprings springs_;
    Eigen::VectorXd weights_; ///< of each point [kg]
    double size_ = 0.0;       ///< [m]

    // One step.
    double step_ = 1.0, pull_ = 1.0; ///< [s], of the mass in second derivatives [1/s^2]
    Eigen::VectorXd start_, trial_, velocity_before_;
};

} // namespace cellwarp::core
