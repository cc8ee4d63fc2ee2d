// SPDX-License-Identifier: GPL-3.0-or-later
// Rods that push back on the cells that they carry: rods and glue in one minimum.
#pragma once

#include <vector>

#include "solver/cells/companion.h"
#include "solver/coupled/rod_coupling.h"
#include "solver/coupled/rod_unknowns.h"

namespace cellwarp::core
{

class PushingRods : public Companion
{
public:
    /// Both must outlive it.
    PushingRods(CellState& cells, const GlueTerm& glue, std::vector<CoupledRod> rods)
        : rods_(cells, std::move(rods)), coupling_(cells, glue, rods_)
    {
    }

    RodUnknowns& rods() { return rods_; }
    const RodUnknowns& rods() const { return rods_; }
    const RodCoupling& coupling() const { return coupling_; }

    State& state() override { return rods_; }
    Term& term() override { return coupling_; }
    void add_bodies(std::span<const GridPlace> places,
                    std::vector<UnknownBody>& out) const override
    {
        rods_.add_bodies(places, out);
    }
    bool has_other_bodies() const override { return rods_.has_other_bodies(); }

private:
    RodUnknowns rods_;
    RodCoupling coupling_;
};

} // namespace cellwarp::core
