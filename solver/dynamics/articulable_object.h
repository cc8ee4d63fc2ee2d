// SPDX-License-Identifier: GPL-3.0-or-later
// What an object must offer to be joined to others: a rod, a rigid body, a net of
// springs. [Lenoir04]
#pragma once

#include <span>

#include <Eigen/Core>

#include "solver/dynamics/saddle.h"

namespace cellwarp::core
{

/// An object keeps a state, and a trial that may become the state. Its unknowns are those
/// of a step from the state, of any kind: displacements, or what velocities change by, as
/// long as rows, gradient and factor are by them. It may hold itself by rows of its own,
/// whose multipliers come with its unknowns; rows of joints come from outside. Each call
/// is for a whole object. The functions that have a body here suit an object without
/// frames, rows of its own, friction and a drive; any other object overrides them.
class ArticulableObject
{
public:
    virtual ~ArticulableObject() = default;

    virtual int num_unknowns() const = 0;
    virtual double size() const = 0;   ///< [m]
    virtual double extent() const = 0; ///< from the origin, at least its size [m]
    /// The largest violation of its own rows [m, rad].
    virtual double own_violation() const { return 0.0; }

    // Where joints hold it: places that the object has numbers for.

    /// False: it was released there, and a joint has no rows.
    virtual bool is_held(int /*place*/) const { return true; }
    virtual Eigen::Vector3d place(int place, bool of_trial) const = 0;
    virtual Eigen::Matrix3d frame(int /*place*/, bool /*of_trial*/) const
    {
        return Eigen::Matrix3d::Identity();
    }
    /// Adds how n . place changes with the unknowns of the state, unsorted.
    virtual void add_moved(int place, const Eigen::Vector3d& n, SparseRow& out) const = 0;
    /// The same of axis . (turn of the frame).
    virtual void add_turned(int /*place*/, const Eigen::Vector3d& /*axis*/,
                            SparseRow& /*out*/) const
    {
    }
    /// The forces [N] of joints at their places, for second derivatives and friction:
    /// first none, then one by one.
    virtual void forget_presses() {}
    virtual void press(int /*place*/, const Eigen::Vector3d& /*force*/) {}

    // One solve.

    struct Measure
    {
        double value = 0.0;        ///< what is minimised [J]
        double work = 0.0;         ///< of couples on the way from the state [J]
        Eigen::VectorXd violation; ///< of its own rows
    };
    /// The next solve begins, from the state.
    virtual void begin() {}
    virtual void measure(bool of_trial, Measure& out) = 0;
    /// Gradient at the state, and its own rows, whose violations, all of them, go to \p
    /// here. Returns the largest force at work [N].
    virtual double linearise(Eigen::VectorXd& gradient, Measure& here) = 0;
    /// out += scale * L^T lambda of its own rows
    virtual void add_own_forces(const Eigen::VectorXd& /*lambda*/, double /*scale*/,
                                Eigen::VectorXd& /*out*/) const
    {
    }
    /// What rounding of its places leaves of the forces [N].
    virtual double noise_of_forces() const = 0;
    /// Size of what cancels in the values: their rounding is a share of that [J].
    virtual double cancelled() const = 0;
    /// Of the state's second derivatives, with its own multipliers \p lambda and what
    /// presses it; not less definite than \p level says, which becomes what it was: 0
    /// exact.
    virtual SaddleSolver::Report factorize(const Eigen::VectorXd& lambda, int& level) = 0;
    static constexpr int kMostLevel = 12;
    /// Its own rows contradict: what cannot be met is no violation any more. Changes
    /// those of \p here.
    virtual void take_off_contradiction(Measure& /*here*/) {}
    /// A x - L^T lambda = r, L x = -g: r becomes x, g becomes lambda.
    virtual void solve(Eigen::VectorXd& r, Eigen::VectorXd& g) const = 0;
    /// Diagonal of the second derivatives.
    virtual double stiffness_of(int unknown) const = 0;
    /// An unknown whose diagonal was made larger by `stiffness` than it is, since joints
    /// alone hold it.
    struct Added
    {
        int unknown;
        double stiffness;
    };
    virtual std::span<const Added> added() const { return {}; }

    /// How far a step turns it; at most kTurn are taken at once [rad].
    virtual double turn(const Eigen::VectorXd& step) const = 0;
    static constexpr double kTurn = 0.5;
    /// The trial is the state and a part of a step.
    virtual void try_step(const Eigen::VectorXd& step, double length) = 0;
    virtual void try_more(const Eigen::VectorXd& step) = 0;
    /// Adds the forces that take back what \p part of a step has stretched to second
    /// order.
    virtual void add_correction(const Eigen::VectorXd& /*part*/,
                                Eigen::VectorXd& /*out*/) const
    {
    }
    /// The trial becomes the state. \p step: the whole step, if it was taken.
    virtual void accept(const Eigen::VectorXd* step) = 0;

    /// Whether what sticks, slips or rubs must be another: the solve goes on from the
    /// state, or from where it began. \p is_last: only what must change does.
    enum class Again
    {
        No,
        FromHere,
        FromBegin
    };
    virtual Again again(const Eigen::VectorXd& /*lambda*/, bool /*is_last*/)
    {
        return Again::No;
    }
    /// The state is so far beyond what it may be that again() is to be asked at once.
    virtual bool is_beyond() const { return false; }
    /// The state becomes that of the begin of the solve, with what again() has changed.
    virtual void go_back() = 0;

    // Time.

    /// A step begins: the next solve is that of \p step [s] by implicit Euler, unless the
    /// object says otherwise.
    virtual void start(double step) = 0;
    /// The solve of the step has ended: velocities follow from the way.
    virtual void finish() = 0;
    /// Takes the step back.
    virtual void undo() = 0;
    /// How far it went in the step, at the most [m].
    virtual double way() const = 0;
    struct Energy
    {
        double sum = 0.0;  ///< kinetic, and what may still be done [J]
        double size = 0.0; ///< of what it is made of [J]
    };
    virtual Energy energy() const = 0;
    /// Something from outside does work on it, which the energy does not tell of.
    virtual bool is_driven() const { return false; }
    virtual void rest() = 0; ///< Its velocity becomes 0.
};

} // namespace cellwarp::core
