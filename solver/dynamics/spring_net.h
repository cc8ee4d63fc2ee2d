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

#include "solver/dynamics/spring_object.h"

namespace cellwarp::core
{

struct NetSpring
{
    std::array<int, 2> node = {};
    double stiffness = 0.0; ///< [N/m]
};

class SpringNet : public SpringObject
{
public:
    /// \p points [m], the \p mass of each [kg], above 0. The lengths at rest are those
    /// between the points.
    SpringNet(std::vector<Eigen::Vector3d> points, Eigen::VectorXd mass,
              const std::vector<NetSpring>& springs);

    /// It stays where it is.
    void hold(int point) { is_fast_[idx(point)] = 1; }

    int num_points() const { return static_cast<int>(weights_.size()); }
    Eigen::Vector3d point(int k) const { return x.segment<3>(3 * k); }
    double kinetic() const override;
    double mass(int k) const { return weights_[k]; }

    // Places are numbers of points; a point has no frame.

    Eigen::Vector3d place(int place, bool of_trial) const override;
    void add_moved(int place, const Eigen::Vector3d& n, SparseRow& out) const override;
    void measure(bool of_trial, Measure& out) override;
    double linearise(Eigen::VectorXd& gradient, Measure& here) override;
    SaddleSolver::Report factorize(const Eigen::VectorXd& lambda, int& level) override;
    void solve(Eigen::VectorXd& r, Eigen::VectorXd& g) const override;
    double stiffness_of(int unknown) const override { return diagonal_[unknown]; }
    void add_correction(const Eigen::VectorXd& part, Eigen::VectorXd& out) const override;

private:
    void let_go_of_fast(Eigen::VectorXd& forces) const;

    std::vector<char> is_fast_; ///< points that stay
    Eigen::VectorXd diagonal_;
    Eigen::SparseMatrix<double> matrix_;
    std::unique_ptr<Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>> factor_;
};

} // namespace cellwarp::core
