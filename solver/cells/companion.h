// SPDX-License-Identifier: GPL-3.0-or-later
// What is solved for together with cells, in one minimum.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "solver/cells/cell_state.h"
#include "solver/cells/glue_term.h"
#include "solver/cells/unknown_body.h"
#include "solver/minimize/state.h"
#include "solver/minimize/term.h"

namespace cellwarp::core
{

/// Unknowns beside those of the cells, and what depends on them.
class Companion
{
public:
    virtual ~Companion() = default;
    /// Begins where that of the cells ends.
    virtual State& state() = 0;
    virtual Term& term() = 0;
    /// What its unknowns move, at the current state. \p places: of all cells.
    virtual void add_bodies(std::span<const GridPlace> places,
                            std::vector<UnknownBody>& out) const = 0;
    /// Whether a preconditioner of its last bodies no longer is one.
    virtual bool has_other_bodies() const = 0;
};

/// Makes one for cells whose state and term keep their addresses; null: none.
using MakeCompanion =
    std::function<std::unique_ptr<Companion>(CellState&, const GlueTerm&)>;

} // namespace cellwarp::core
