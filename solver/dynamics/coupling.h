// SPDX-License-Identifier: GPL-3.0-or-later
// What acts between the objects of an articulation, or on them from outside, and is no
// joint: contacts.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "solver/dynamics/articulable_object.h"

namespace cellwarp::core
{

/// An energy of where the objects are. What of its second derivatives is of one place of
/// an object alone goes to that object's own factor; the rest is products.
class Coupling
{
public:
    virtual ~Coupling() = default;

    /// A step of \p step [s] begins, from the states. False: it is too long.
    virtual bool start(double step) = 0;
    virtual double value(bool of_trial) = 0; ///< [J]
    /// Adds its gradient at the states to those of the objects, and gives the objects
    /// what is theirs of the second derivatives. Returns the largest force [N].
    virtual double linearise(std::vector<Eigen::VectorXd>& gradient) = 0;
    /// Whether add_product() adds anything.
    virtual bool has_product() const = 0;
    /// out += (second derivatives that objects do not have) x
    virtual void add_product(const std::vector<Eigen::VectorXd>& x,
                             std::vector<Eigen::VectorXd>& out) const = 0;
    /// The solve has ended: whether it goes on with friction that agrees with what now
    /// presses. \p is_last: it does not.
    virtual ArticulableObject::Again again(bool is_last) = 0;
    /// The step was taken, or is taken back after that.
    virtual void finish() = 0;
    virtual void undo() = 0;
    /// The states are farther from the begin of the step than start() has looked.
    virtual bool is_beyond() = 0;
    /// What it holds, and gives back, at the states [J].
    virtual double energy() const = 0;
};

} // namespace cellwarp::core
