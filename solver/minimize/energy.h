// SPDX-License-Identifier: GPL-3.0-or-later
// The sum of terms over states: what is minimised, with its second derivatives as a
// linear operator.
#pragma once

#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "solver/linear/linear_operator.h"
#include "solver/minimize/state.h"
#include "solver/minimize/term.h"

namespace cellwarp::core
{

/// Owns neither states nor terms, which must outlive it and keep their addresses. What
/// multiply() and the blocks give is of the last linearise().
class Energy : public BlockOperator
{
public:
    /// \p states one after the other: each begins where the one before ends, the first at
    /// 0. Throws std::invalid_argument.
    Energy(std::vector<State*> states, std::vector<Term*> terms);

    int num_unknowns() const { return num_unknowns_; }

    double value() const;
    void gradient(Eigen::VectorXd& out) const;
    /// For each block what rounding of the states alone may leave of its gradient (norm).
    void rounding(std::span<double> out) const;
    /// Prepares the second derivatives at the current states.
    void linearise(Curvature curvature);

    /// All states at once; see State.
    void move(const Eigen::VectorXd& step, double length);
    void settle();
    double largest_move() const;

    void multiply(const Eigen::VectorXd& x, Eigen::VectorXd& y) const override;
    std::span<const int> block_sizes() const override { return sizes_; }
    std::span<const std::pair<int, int>> pairs() const override { return pairs_; }
    void diagonal_block(int block, Eigen::Ref<Eigen::MatrixXd> out) const override;
    void pair_block(int pair, Eigen::Ref<Eigen::MatrixXd> out) const override;

private:
    /// What one term has to say of a pair.
    struct Part
    {
        const Term* term = nullptr;
        int pair = 0; ///< of its own pairs
    };

    std::vector<State*> states_;
    std::vector<Term*> terms_;
    int num_unknowns_ = 0;
    std::vector<int> sizes_;
    std::vector<std::pair<int, int>> pairs_;
    std::vector<int> first_part_; ///< pairs + 1 offsets into parts
    std::vector<Part> parts_;
};

} // namespace cellwarp::core
