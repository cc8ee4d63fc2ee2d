// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/minimize/energy.h"

#include <algorithm>
#include <stdexcept>

#include "octree/base/index.h"

namespace cellwarp::core
{

Energy::Energy(std::vector<State*> states, std::vector<Term*> terms)
    : states_(std::move(states)), terms_(std::move(terms))
{
    if (states_.empty())
        throw std::invalid_argument("an energy is a function of a state");
    UnknownPlace place;
    for (const State* state : states_)
    {
        if (state->begin().block != place.block ||
            state->begin().unknown != place.unknown)
            throw std::invalid_argument("a state begins where the one before it ends");
        place = state->end();
        const std::span<const int> sizes = state->block_sizes();
        sizes_.insert(sizes_.end(), sizes.begin(), sizes.end());
    }
    num_unknowns_ = place.unknown;
    // Terms may share pairs: those of one pair in the order of the terms.
    std::vector<std::pair<std::pair<int, int>, Part>> all;
    for (const Term* term : terms_)
        for (std::size_t p = 0; p < term->pairs().size(); ++p)
            all.push_back({term->pairs()[p], {term, static_cast<int>(p)}});
    std::stable_sort(all.begin(), all.end(),
                     [](const auto& one, const auto& other)
                     { return one.first < other.first; });
    for (const auto& [pair, part] : all)
    {
        if (pairs_.empty() || pairs_.back() != pair)
        {
            first_part_.push_back(static_cast<int>(parts_.size()));
            pairs_.push_back(pair);
        }
        parts_.push_back(part);
    }
    first_part_.push_back(static_cast<int>(parts_.size()));
}

double Energy::value() const
{
    double sum = 0.0;
    for (const Term* term : terms_)
        sum += term->value();
    return sum;
}

void Energy::gradient(Eigen::VectorXd& out) const
{
    out.setZero(num_unknowns_);
    for (const Term* term : terms_)
        term->add_gradient(out);
}

void Energy::rounding(std::span<double> out) const
{
    std::fill(out.begin(), out.end(), 0.0);
    for (const Term* term : terms_)
        term->add_rounding(out);
}

void Energy::linearise(Curvature curvature)
{
    for (Term* term : terms_)
        term->linearise(curvature);
}

void Energy::move(const Eigen::VectorXd& step, double length)
{
    for (State* state : states_)
        state->move(step, length);
}

void Energy::settle()
{
    for (State* state : states_)
        state->settle();
}

double Energy::largest_move() const
{
    double largest = 0.0;
    for (const State* state : states_)
        largest = std::max(largest, state->largest_move());
    return largest;
}

void Energy::multiply(const Eigen::VectorXd& x, Eigen::VectorXd& y) const
{
    y.setZero(num_unknowns_);
    for (const Term* term : terms_)
        term->add_product(x, y);
}

void Energy::diagonal_block(int block, Eigen::Ref<Eigen::MatrixXd> out) const
{
    out.setZero();
    for (const Term* term : terms_)
        term->add_diagonal_block(block, out);
}

void Energy::pair_block(int pair, Eigen::Ref<Eigen::MatrixXd> out) const
{
    out.setZero();
    const std::size_t p = idx(pair);
    for (int k = first_part_[p]; k < first_part_[p + 1]; ++k)
    {
        const Part& part = parts_[idx(k)];
        part.term->add_pair_block(part.pair, out);
    }
}

} // namespace cellwarp::core
