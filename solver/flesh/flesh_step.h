// SPDX-License-Identifier: GPL-3.0-or-later
// One implicit step of flesh as the minimum of a function of its free nodes, with its
// second derivatives in full: for solvers of more than flesh. flesh_step.cpp has the
// formulas.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "solver/flesh/flesh.h"
#include "solver/flesh/step_matrix.h"
#include "solver/linear/cholesky.h"

namespace cellwarp::core
{

/// Displacements \p u are of all nodes, in the places that the motions of begin() allow.
class FleshStep
{
public:
    /// It must outlive this. Throws std::invalid_argument for blended regions, which are
    /// the minimum of nothing.
    explicit FleshStep(Flesh& flesh);

    std::size_t num_free() const; ///< nodes

    /// A step of \p dt [s] from a state begins; \p u: where it would go without forces,
    /// with held points where the motions have them.
    void begin(const FleshState& from, double dt, std::span<const Motion> motions,
               Eigen::VectorXd& u);
    /// u = from + length * step of the free nodes.
    void move(const Eigen::VectorXd& from, const Eigen::VectorXd& step, double length,
              Eigen::VectorXd& u) const;
    /// What is minimised [J].
    double value(const Eigen::VectorXd& u) const;
    /// Of the free nodes. Returns the largest force at work [N].
    double gradient(const Eigen::VectorXd& u, Eigen::VectorXd& out) const;
    /// Of the second derivatives at \p u, which are made positive. False: there is none.
    [[nodiscard]] bool factorize(const Eigen::VectorXd& u);
    /// Of the last factorize(): in place.
    void solve(Eigen::VectorXd& r) const;
    double diagonal(Eigen::Index unknown) const { return diagonal_[unknown]; }
    double stiffest() const { return diagonal_.size() ? diagonal_.maxCoeff() : 0.0; }
    /// How much a step strains and turns a cell, at the most; none where the function is
    /// quadratic.
    double turn(const Eigen::VectorXd& step) const;
    /// After the step.
    FleshState end(const Eigen::VectorXd& u) const;

private:
    Flesh::Parts& parts_;
    StepMatrix matrix_;
    std::unique_ptr<SparseCholesky> factor_;
    bool is_factorized_ = false; ///< of what does not change in the step
    Eigen::VectorXd diagonal_;
    FleshState from_;
    double dt_ = 1.0;
    std::vector<Motion> motions_;
    mutable Eigen::VectorXd way_, image_, all_, solved_; // scratch
};

} // namespace cellwarp::core
