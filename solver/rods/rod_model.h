// SPDX-License-Identifier: GPL-3.0-or-later
// A rod with all that acts on it: energies, loads, constraints.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "solver/dynamics/saddle.h"
#include "solver/dynamics/wrench.h"
#include "solver/rods/rod_constraint.h"
#include "solver/rods/rod_mass.h"
#include "solver/rods/rod_term.h"
#include "solver/rods/slide.h"

namespace cellwarp::core
{

/// A force and a couple of fixed directions.
struct RodLoad
{
    double s = 0.0;                                   ///< parameter of the curve
    Eigen::Vector3d force = Eigen::Vector3d::Zero();  ///< [N]
    Eigen::Vector3d moment = Eigen::Vector3d::Zero(); ///< [N m]
};

/// What a place of the rod moves against: a force -damping P'.
struct RodDrag
{
    double s = 0.0;
    double damping = 0.0; ///< [N s/m]
};

/// Two slides that stay at least so far apart along the rod, such as beads in a row.
struct RodGap
{
    int first = 0, second = 0; ///< slides; the second is ahead
    double least = 0.0;        ///< [m] of the rod at rest
    bool is_around = false;    ///< the second is ahead by the seam of a closed rod
};

class RodModel
{
public:
    /// The rod must outlive it.
    explicit RodModel(const Rod& rod);

    const Rod& rod() const { return *rod_; }
    const RodMass& mass() const { return mass_; }
    /// The rod has another knot: mass and terms follow, all that stands at a parameter
    /// stays there.
    void follow(const RodChange& change);
    /// How often it has followed.
    int revision() const { return revision_; }

    std::vector<std::unique_ptr<RodTerm>> terms;
    Eigen::Vector3d gravity = Eigen::Vector3d::Zero(); ///< [m/s^2]
    double viscosity = 0.0;                            ///< ambient, of the velocity [1/s]
    double damping = 0.0; ///< of the material, beta of RodTerm [s]
    std::vector<RodLoad> loads;
    std::vector<RodDrag> drags;
    std::vector<RodConstraint> constraints;
    std::vector<RodSlide> slides; ///< RodState::sliding has one each, by begun()

    Eigen::VectorXd pushed; ///< forces on the unknowns from outside [N]; empty: none

    std::vector<RodGap> gaps; ///< RodState::touches has one each

    bool is_free() const; ///< nothing holds it
    /// Those of the rod, and the parameter of each slide.
    int num_unknowns() const
    {
        return rod_->layout().num_unknowns + static_cast<int>(slides.size());
    }
    double elastic_energy(const RodState& state) const;
    /// -(weight . x), zero at the origin.
    double gravity_energy(const RodState& state) const;
    /// What the loads and gravity can still do: elastic energy less their work. Couples
    /// are not counted: they have no potential.
    double potential(const RodState& state) const;
    /// The same, and what material damping takes in the step.
    double step_potential(const RodState& state) const;
    /// RodTerm::damp() of all terms.
    void damp(const RodState& begin, double gain);
    bool has_couples() const;
    /// The couples of the loads, as forces on the unknowns.
    Eigen::VectorXd couples(const RodState& state) const;
    /// Gradient of the potential, less the couples; a positive entry pulls back.
    void gradient(const RodState& state, Eigen::VectorXd& out) const;
    /// out = second derivatives.
    void hessian(const RodState& state, RodHessian how, BandMatrix& out) const;

    /// Adds those of material damping to the gradient.
    void add_damping_forces(const RodState& state, const Eigen::VectorXd& velocity,
                            Eigen::VectorXd& out) const;
    /// out += D v of the drags
    void add_drag_forces(const Eigen::VectorXd& velocity, Eigen::VectorXd& out) const;
    /// out += scale * D
    void add_drags(double scale, BandMatrix& out) const;

    /// \p hold sets points and directions of constraints, and their speeds, for a share
    /// of the way that they go in the next \p duration [s], evenly; steps call it for
    /// each moment that they look at. It is called for the begin at once. Steps beyond
    /// the duration need another lead, or none.
    /// \p set_loads sets loads likewise; none: they stay.
    void lead(std::function<void(double share)> hold, double duration,
              std::function<void(double share)> set_loads = {});
    bool changes_loads() const { return set_loads_ != nullptr; }
    /// Constraints stay where they are.
    void stop_leading();
    /// How much of duration is over [s]; without a lead 0.
    double time_led() const { return time_led_; }
    /// Brings constraints to where they are at a moment of duration [s].
    void lead_to(double time);
    /// Sets loads alone to what they are at a moment of duration [s].
    void load_as_at(double time);
    /// Constraints move in the next step.
    bool is_led() const;
    /// A step begins from \p state: what goes with the curve goes on from there.
    void carry(const RodState& state);

    /// Rows of all constraints, then of the gaps that are closed, the violations, how
    /// fast these change by what moves constraints, and how many rows each has.
    struct Rows
    {
        std::vector<SparseRow> rows;
        Eigen::VectorXd violation, rate;
        std::vector<int> groups;
    };
    Rows rows(const RodState& state) const;
    /// The slides that a gap keeps apart: of what was released the next one takes the
    /// place. Nothing: there is none.
    std::optional<std::pair<int, int>> ends(const RodState& state,
                                            const RodGap& gap) const;
    /// How much room a gap has left; below 0 it is passed [m].
    double room(const RodState& state, const RodGap& gap) const;
    /// What friction and inertia of sliding hold [J].
    double sliding_energy(const RodState& state) const;
    /// What the \p multipliers of rows() press each slide with [N].
    std::vector<SlidePress> pressed(const RodState& state,
                                    const Eigen::VectorXd& multipliers) const;
    /// The force and couple that the \p multipliers of rows() exert on the rod at each
    /// constraint, about its place.
    std::vector<Wrench> reactions(const RodState& state,
                                  const Eigen::VectorXd& multipliers) const;
    /// Those of rows() alone.
    Eigen::VectorXd violations(const RodState& state) const;

private:
    double potential(const RodState& state, double elastic) const;
    void add_constant_force(double scale, Eigen::VectorXd& out) const;
    const HeldBasis& held(std::size_t constraint) const;
    std::vector<ConstraintRow> rows_of_constraint(std::size_t k, const RodState& state,
                                                  bool with_entries) const;

    const Rod* rod_;
    RodMass mass_;
    int revision_ = 0;
    mutable std::vector<HeldBasis> held_; ///< of constraints that were asked for
    std::function<void(double)> hold_;    ///< of a lead
    double duration_ = 0.0, time_led_ = 0.0;
    std::function<void(double)> set_loads_;
};

/// out += scale * L^T lambda
void add_forces(const std::vector<SparseRow>& rows, const Eigen::VectorXd& lambda,
                double scale, Eigen::VectorXd& out);

} // namespace cellwarp::core
