// SPDX-License-Identifier: GPL-3.0-or-later
// A rod in time. The step is fixed; where a step would add energy it is taken in smaller
// parts, by rules that know nothing of the clock: the same steps whatever is watched.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include <Eigen/Core>

#include "solver/rods/rod_model.h"
#include "solver/rods/rod_newton.h"

namespace cellwarp
{

enum class Integrator
{
    ImplicitEuler,
    Midpoint,  ///< implicit; keeps energy and momentum
    RungeKutta ///< of order 4, explicit; up to largest_step()
};

struct RodStepReport
{
    RodStop stop = RodStop::NotRun; ///< of the parts that could not be cut further
    int iterations = 0, parts = 0;
    double violation = 0.0;
    int num_dropped = 0;
};

/// How a rod moves where forces act along rows of constraints: by a dense system of as
/// many unknowns as there are rows, and where they are many by rows in the band of the
/// mass.
class RodResponse
{
public:
    RodResponse(const RodModel& model, const RodModel::Rows& of, int most_dense = 100);

    bool is_for(const std::vector<SparseRow>& rows) const { return rows_ == rows; }
    /// Some rows say nothing new.
    bool is_redundant() const { return is_redundant_; }
    /// L v
    Eigen::VectorXd along(const Eigen::VectorXd& v) const;
    /// The least x in the mass with L x = \p wanted, or what is nearest to it.
    Eigen::VectorXd change(const Eigen::VectorXd& wanted) const;
    /// Takes off v what L v is, by the least change in the mass.
    void project(Eigen::VectorXd& v) const { v -= change(along(v)); }

private:
    std::vector<SparseRow> rows_;
    int num_unknowns_ = 0;
    bool is_redundant_ = false;
    Eigen::MatrixXd moved_;   ///< M^-1 L^T, a column a row
    Eigen::MatrixXd inverse_; ///< of L M^-1 L^T, of least norm where rows are redundant
    std::unique_ptr<SaddleSolver> band_;
};

class RodStepper
{
public:
    /// The model must outlive it; it may change its loads and constraints between steps.
    RodStepper(RodModel& model, Integrator integrator);

    /// Goes on from \p state and \p velocity by \p step [s].
    RodStepReport step(RodState& state, Eigen::VectorXd& velocity, double step);

    /// The largest step that RK4 stays stable with, from the fastest vibration of the
    /// state and the viscosity [s].
    double largest_step(const RodState& state) const;

    /// Kinetic energy and what the elastic energy and the loads hold [J].
    double energy(const RodState& state, const Eigen::VectorXd& velocity) const;

private:
    /// One part of a step. False where it did not converge, or added energy.
    bool try_implicit(RodState& state, Eigen::VectorXd& velocity, double step,
                      RodStop& stop, RodStepReport& report);
    /// Whether the constraints, as they are now, are met by \p state.
    bool keeps_constraints(const RodState& state) const;
    void step_explicit(RodState& state, Eigen::VectorXd& velocity, double step,
                       RodStepReport& report);
    Eigen::VectorXd acceleration(const RodState& state, const Eigen::VectorXd& velocity,
                                 double step) const;
    void project(RodState& state, Eigen::VectorXd& velocity, RodStepReport& report) const;

    const RodResponse& response(const RodModel::Rows& rows) const;

    RodModel& model_;
    Integrator integrator_;
    RodNewton newton_;
    mutable std::optional<RodResponse> response_; ///< to the rows asked for last
    int parts_ = 1;                               ///< of a step, as a power of 2
    int num_explicit_ = 0;                        ///< steps
    int num_good_ = 0; ///< parts that went well since the last change
};

} // namespace cellwarp
