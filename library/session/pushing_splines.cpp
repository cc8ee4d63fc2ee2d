// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/pushing_splines.h"

#include "solver/coupled/rod_motion.h"

namespace cellwarp::core
{

namespace
{

/// Holds that are violated by no more are kept [work], [rad].
constexpr double kHeld = 1e-11;

std::vector<CoupledRod> coupled(const std::vector<PushingSpline>& rods)
{
    std::vector<CoupledRod> out;
    for (const PushingSpline& rod : rods)
    {
        CoupledRod& one = out.emplace_back();
        one.rest = rod.spline->rest()->rod();
        one.stiffness = rod.spline->stiffness();
        for (std::size_t k = 0; k < rod.cells.size(); ++k)
            one.cells.push_back({rod.cells[k], rod.at[k], rod.centres[k]});
    }
    return out;
}

} // namespace

PushingSplines::PushingSplines(CellState& cells, const GlueTerm& glue,
                               std::vector<PushingSpline> splines)
    : PushingRods(cells, glue, coupled(splines)), splines_(std::move(splines)),
      states_(splines_.size())
{
}

void PushingSplines::set(std::size_t rod, const std::shared_ptr<const SplineState>& state,
                         const Motion& motion)
{
    states_[rod] = state;
    rods().set(rod, *state->rod(), motion, holds_of(rod, *state->rod()));
}

std::shared_ptr<const SplineState> PushingSplines::solved(std::size_t rod) const
{
    const Eigen::VectorXd gradient = coupling().gradient_by_steps();
    const int first = rods().first(rod);
    return splines_[rod].spline->solved(
        *states_[rod], rods().state(rod),
        rods().multipliers(rod, gradient.segment(first, rods().first(rod + 1) - first)));
}

bool PushingSplines::bring_back()
{
    bool has_left = false;
    for (std::size_t rod = 0; rod < size(); ++rod)
    {
        if (rods().leads(rod))
            continue;
        RodState now = rods().state(rod);
        const std::vector<RodConstraint> holds = holds_of(rod, now);
        const Eigen::VectorXd violation = hold_rows(now, holds).violation;
        if (violation.size() == 0 || violation.lpNorm<Eigen::Infinity>() <= kHeld)
            continue;
        has_left = true;
        bring_to(now, holds);
        rods().set(rod, now, rods().motion(rod), holds);
    }
    return has_left;
}

std::vector<RodConstraint> PushingSplines::holds_of(std::size_t rod,
                                                    const RodState& now) const
{
    return splines_[rod].spline->constraints(*states_[rod], now, splines_[rod].is_alone);
}

} // namespace cellwarp::core
