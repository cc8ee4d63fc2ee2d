// SPDX-License-Identifier: GPL-3.0-or-later
// What is solved for: blocks of unknowns, and how a step moves them.
#pragma once

#include <span>

#include <Eigen/Core>

namespace cellwarp::core
{

/// Where something stands among all unknowns of a minimisation.
struct UnknownPlace
{
    int block = 0;   ///< blocks before it
    int unknown = 0; ///< numbers before it
};

/// A state is changed by steps: vectors of blocks of any size (a free cell has 6
/// unknowns, a pinned cell 3, a control point 3, an angle 1). How a step moves it, along
/// rotations too, is the state's business. Several states can be solved for together:
/// each takes its part of one common step.
class State
{
public:
    /// \p begin: where its unknowns begin; that is where another state's end.
    explicit State(UnknownPlace begin) : begin_(begin) {}
    virtual ~State() = default;

    UnknownPlace begin() const { return begin_; }
    UnknownPlace end() const;
    /// Of its own blocks.
    virtual std::span<const int> block_sizes() const = 0;

    /// Current state = base state, moved by length times its part of \p step, which is
    /// the step of all unknowns.
    virtual void move(const Eigen::VectorXd& step, double length) = 0;
    /// Makes the current state the base of the next steps.
    virtual void settle() = 0;
    /// The largest distance between a point of a body in the base and in the current
    /// state [length of the state].
    virtual double largest_move() const = 0;

protected:
    State(const State&) = default;
    State(State&&) = default;
    State& operator=(const State&) = default;
    State& operator=(State&&) = default;

private:
    UnknownPlace begin_;
};

} // namespace cellwarp::core
