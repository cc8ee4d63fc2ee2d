// SPDX-License-Identifier: GPL-3.0-or-later
// A rigid body that can be joined to others: 6 unknowns, the shift of its centre and the
// turn about it.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "octree/base/rigid_motion.h"
#include "solver/dynamics/articulable_object.h"

namespace cellwarp::core
{

/// Where a body is, and how it moves.
struct RigidBodyState
{
    Eigen::Matrix3d R = Eigen::Matrix3d::Identity();    ///< from its own axes
    Eigen::Vector3d p = Eigen::Vector3d::Zero();        ///< centre of mass [m]
    Eigen::Vector3d velocity = Eigen::Vector3d::Zero(); ///< [m/s]
    Eigen::Matrix3d turning = Eigen::Matrix3d::Zero();  ///< dR/dt [1/s]
};

class RigidBody : public ArticulableObject
{
public:
    /// \p mass [kg], \p inertia about the centre, along the body's axes [kg m^2]. Throws
    /// std::invalid_argument where no body has it: none may exceed the sum of the others.
    RigidBody(double mass, const Eigen::Vector3d& inertia);

    RigidBodyState state;
    Eigen::Vector3d gravity = Eigen::Vector3d::Zero(); ///< [m/s^2]

    /// It goes where it is told to, evenly, and nothing moves it: to a pose after a time
    /// [s].
    void lead(const Eigen::Matrix3d& R, const Eigen::Vector3d& p, double duration);

    /// About world axes, from the rotation per time.
    void spin(const Eigen::Vector3d& omega)
    {
        state.turning = cross_matrix(omega) * state.R;
    }
    Eigen::Vector3d angular_velocity() const;
    double mass() const { return mass_; }
    double kinetic() const;
    /// About the origin.
    Eigen::Vector3d angular_momentum() const;

    /// A number for joints: a point [m] in the body's own axes, and its frame there.
    int add_place(const Eigen::Vector3d& point);

    int num_unknowns() const override { return 6; }
    double size() const override { return size_; }
    double extent() const override
    {
        return std::max(size_, state.p.cwiseAbs().maxCoeff());
    }
    Eigen::Vector3d place(int place, bool of_trial) const override;
    Eigen::Matrix3d frame(int place, bool of_trial) const override;
    void add_moved(int place, const Eigen::Vector3d& n, SparseRow& out) const override;
    void add_turned(int place, const Eigen::Vector3d& axis,
                    SparseRow& out) const override;
    void forget_presses() override;
    void press(int place, const Eigen::Vector3d& force) override;
    void measure(bool of_trial, Measure& out) override;
    double linearise(Eigen::VectorXd& gradient, Measure& here) override;
    double noise_of_forces() const override;
    double cancelled() const override;
    SaddleSolver::Report factorize(const Eigen::VectorXd& lambda, int& level) override;
    void solve(Eigen::VectorXd& r, Eigen::VectorXd& g) const override;
    double stiffness_of(int unknown) const override;
    double turn(const Eigen::VectorXd& step) const override;
    void try_step(const Eigen::VectorXd& step, double length) override;
    void try_more(const Eigen::VectorXd& step) override;
    void accept(const Eigen::VectorXd*) override { state = trial_; }
    void go_back() override;
    void start(double step) override;
    void finish() override;
    void undo() override;
    double way() const override { return (state.p - start_.p).norm(); }
    Energy energy() const override;
    bool is_driven() const override;
    void rest() override;

private:
    Eigen::Matrix3d pulled(const RigidBodyState& at) const;

    double mass_;
    Eigen::Vector3d spread_; ///< int x^2 dm and so on, along its axes [kg m^2]
    double size_ = 0.0;      ///< of a box with that inertia, or of its places [m]
    std::vector<Eigen::Vector3d> places_;
    bool is_led_ = false;
    RigidBodyState goal_;                   ///< of what is led
    double left_ = 0.0, left_before_ = 0.0; ///< time to it, at the begin of the step [s]

    // One step.
    double step_ = 1.0; ///< [s]
    RigidBodyState start_, trial_;
    Eigen::Vector3d ahead_p_ = Eigen::Vector3d::Zero(); ///< where it goes by itself
    Eigen::Matrix3d ahead_R_ = Eigen::Matrix3d::Identity();
    Eigen::Matrix3d pressed_ = Eigen::Matrix3d::Zero(); ///< sum of force arm^T [N m]
    double largest_press_ = 0.0;
    Eigen::Matrix3d turns_ = Eigen::Matrix3d::Identity(); ///< second derivatives
    Eigen::Matrix3d turns_inverse_ = Eigen::Matrix3d::Identity();
};

} // namespace cellwarp::core
