// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/pushing_splines.h"

#include "octree/base/index.h"
#include "solver/coupled/pushing_rods.h"

namespace cellwarp::core
{

namespace
{

/// Holds that are violated by no more are kept [work], [rad].
constexpr double kKept = 1e-11;

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

class Pushing final : public PushingSplines
{
public:
    Pushing(CellState& cells, const GlueTerm& glue, std::vector<PushingSpline> rods)
        : splines_(std::move(rods)), states_(splines_.size()),
          own_(cells, glue, coupled(splines_))
    {
    }

    State& state() override { return own_.state(); }
    Term& term() override { return own_.term(); }
    void add_bodies(std::span<const GridPlace> places,
                    std::vector<UnknownBody>& out) const override
    {
        own_.add_bodies(places, out);
    }
    bool has_other_bodies() const override { return own_.has_other_bodies(); }

    std::size_t size() const override { return splines_.size(); }
    void lead(std::size_t rod, bool it_leads) override
    {
        own_.rods().lead(rod, it_leads);
    }
    void set(std::size_t rod, const std::shared_ptr<const SplineState>& state,
             const Motion& motion) override
    {
        states_[rod] = state;
        own_.rods().set(rod, *state->rod(), motion, holds_of(rod, *state->rod()));
    }
    std::shared_ptr<const SplineState> solved(std::size_t rod) const override
    {
        const RodUnknowns& rods = own_.rods();
        const Eigen::VectorXd gradient = own_.coupling().gradient_by_steps();
        return splines_[rod].spline->solved(
            *states_[rod], rods.state(rod),
            rods.multipliers(rod,
                             gradient.segment(rods.first(rod),
                                              rods.first(rod + 1) - rods.first(rod))));
    }
    bool bring_back() override
    {
        bool has_left = false;
        RodUnknowns& rods = own_.rods();
        for (std::size_t rod = 0; rod < size(); ++rod)
        {
            if (rods.leads(rod))
                continue;
            RodState now = rods.state(rod);
            const std::vector<RodConstraint> holds = holds_of(rod, now);
            const Eigen::VectorXd violation = hold_rows(now, holds).violation;
            if (violation.size() == 0 || violation.lpNorm<Eigen::Infinity>() <= kKept)
                continue;
            has_left = true;
            bring_to(now, holds);
            rods.set(rod, now, rods.motion(rod), holds);
        }
        return has_left;
    }

private:
    std::vector<RodConstraint> holds_of(std::size_t rod, const RodState& now) const
    {
        return splines_[rod].spline->constraints(*states_[rod], now,
                                                 splines_[rod].is_alone);
    }

    std::vector<PushingSpline> splines_;
    std::vector<std::shared_ptr<const SplineState>> states_; ///< as set
    PushingRods own_;
};

} // namespace

std::unique_ptr<PushingSplines> make_pushing_splines(CellState& cells,
                                                     const GlueTerm& glue,
                                                     std::vector<PushingSpline> rods)
{
    return std::make_unique<Pushing>(cells, glue, std::move(rods));
}

} // namespace cellwarp::core
