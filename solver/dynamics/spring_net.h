// SPDX-License-Identifier: GPL-3.0-or-later
// Points with mass, and springs between them: a net, a cloth, that can be joined to
// others.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include <Eigen/Core>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>

#include "solver/dynamics/articulable_object.h"
#include "solver/dynamics/distance_springs.h"

namespace cellwarp::core
{

struct NetSpring
{
    std::array<int, 2> node = {};
    double stiffness = 0.0; ///< [N/m]
};

class SpringNet : public ArticulableObject
{
public:
    /// \p points [m], the \p mass of each [kg], above 0. The lengths at rest are those
    /// between the points.
    SpringNet(std::vector<Eigen::Vector3d> points, Eigen::VectorXd mass,
              const std::vector<NetSpring>& springs);

    Eigen::VectorXd x, velocity;                       ///< 3 of each point [m], [m/s]
    Eigen::Vector3d gravity = Eigen::Vector3d::Zero(); ///< [m/s^2]
    double damping = 0.0; ///< of the springs: force follows length + damping * rate [s]

    /// It stays where it is.
    void hold(int point) { is_fast_[idx(point)] = 1; }

    int num_points() const { return static_cast<int>(mass_.size()); }
    Eigen::Vector3d point(int k) const { return x.segment<3>(3 * k); }
    double kinetic() const;
    double elastic() const { return springs_.energy(x); }
    double mass(int k) const { return mass_[k]; }

    // Places are numbers of points; a point has no frame.

    int num_unknowns() const override { return static_cast<int>(x.size()); }
    double size() const override { return size_; }
    double extent() const override { return std::max(size_, x.cwiseAbs().maxCoeff()); }
    Eigen::Vector3d place(int place, bool of_trial) const override;
    void add_moved(int place, const Eigen::Vector3d& n, SparseRow& out) const override;
    void measure(bool of_trial, Measure& out) override;
    double linearise(Eigen::VectorXd& gradient, Measure& here) override;
    double noise_of_forces() const override;
    double cancelled() const override
    {
        return 1e-6 * springs_.stiffest() * size_ * size_;
    }
    SaddleSolver::Report factorize(const Eigen::VectorXd& lambda, int& level) override;
    void solve(Eigen::VectorXd& r, Eigen::VectorXd& g) const override;
    double stiffness_of(int unknown) const override { return diagonal_[unknown]; }
    double turn(const Eigen::VectorXd& step) const override
    {
        return springs_.turn(x, step);
    }
    void try_step(const Eigen::VectorXd& step, double length) override;
    void try_more(const Eigen::VectorXd& step) override { trial_ += step; }
    void add_correction(const Eigen::VectorXd& part, Eigen::VectorXd& out) const override;
    void accept(const Eigen::VectorXd*) override { x = trial_; }
    void go_back() override { x = start_; }
    void start(double step) override;
    void finish() override;
    void undo() override;
    double way() const override { return (x - start_).cwiseAbs().maxCoeff(); }
    Energy energy() const override;
    void rest() override { velocity.setZero(); }

private:
    double weight(const Eigen::VectorXd& at) const;
    void let_go_of_fast(Eigen::VectorXd& forces) const;

    Eigen::VectorXd mass_;
    DistanceSprings springs_;
    std::vector<char> is_fast_; ///< points that stay
    double size_ = 0.0;

    // One step.
    double step_ = 1.0, pull_ = 1.0; ///< [s], of the mass in second derivatives [1/s^2]
    Eigen::VectorXd start_, trial_, velocity_before_, diagonal_;
    Eigen::SparseMatrix<double> matrix_;
    std::unique_ptr<Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>> factor_;
};

} // namespace cellwarp::core
