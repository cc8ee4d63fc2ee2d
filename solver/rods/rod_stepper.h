// SPDX-License-Identifier: GPL-3.0-or-later
// A rod in time, by itself.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include <Eigen/Core>

#include "solver/dynamics/implicit_stepper.h"
#include "solver/rods/rod_model.h"
#include "solver/rods/rod_object.h"
#include "solver/rods/rod_response.h"

namespace cellwarp::core
{

enum class Integrator
{
    ImplicitEuler,
    Midpoint,  ///< implicit; keeps energy and momentum
    RungeKutta ///< of order 4, explicit; up to largest_step()
};

class RodStepper
{
public:
    /// The model must outlive it; it may change its loads and constraints between steps.
    RodStepper(RodModel& model, Integrator integrator);

    /// Goes on from \p state and \p velocity by \p step [s]. Throws
    /// std::invalid_argument where slides are to go by the midpoint rule, or gaps
    /// by RK4.
    StepReport step(RodState& state, Eigen::VectorXd& velocity, double step);

    /// The multipliers of the model's rows after a step to this state.
    Eigen::VectorXd multipliers(const RodState& state,
                                const Eigen::VectorXd& velocity) const;

    /// The largest step that RK4 stays stable with, from the fastest vibration of the
    /// state and the viscosity [s].
    double largest_step(const RodState& state) const;

    /// Kinetic energy and what the elastic energy and the loads hold [J].
    double energy(const RodState& state, const Eigen::VectorXd& velocity) const;

private:
    /// Whether the constraints, as they are now, are met by \p state.
    bool keeps_constraints(const RodState& state) const;
    void step_explicit(RodState& state, Eigen::VectorXd& velocity, double step,
                       StepReport& report);
    /// Rows of constraints by the rod's own unknowns, and by the parameter of each slide
    /// that is free, a column each.
    struct Held
    {
        RodModel::Rows rows;
        Eigen::MatrixXd eta;
        std::vector<int> slides;
    };
    Held held(const RodState& state) const;
    Eigen::MatrixXd mass_of_slides(const Held& held, const RodResponse& holds) const;
    Eigen::VectorXd least_change(const Held& held,
                                 const Eigen::VectorXd& violation) const;
    void loosen(RodState& state, const Eigen::VectorXd& velocity) const;
    void stop_slides(RodState& state, Eigen::VectorXd& velocity) const;
    /// Of the rod and of what slides, as velocities are.
    Eigen::VectorXd acceleration(const RodState& state, const Eigen::VectorXd& velocity,
                                 Eigen::VectorXd* multipliers) const;
    void project(RodState& state, Eigen::VectorXd& velocity, StepReport& report) const;
    void project_velocity(const RodState& state, Eigen::VectorXd& velocity) const;

    const RodResponse& response(const RodModel::Rows& rows) const;

    RodModel& model_;
    Integrator integrator_;
    std::unique_ptr<RodObject> object_; ///< its place does not change
    ImplicitStepper implicit_;
    mutable std::optional<RodResponse> response_; ///< to the rows asked for last
    mutable int revision_ = 0;                    ///< of the model, then
    int num_explicit_ = 0;                        ///< steps
};

} // namespace cellwarp::core
