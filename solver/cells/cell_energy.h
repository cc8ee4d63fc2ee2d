// SPDX-License-Identifier: GPL-3.0-or-later
// The energy of cells that nothing but their glue acts on.
#pragma once

#include <span>

#include "octree/cells.h"
#include "solver/cells/cell_state.h"
#include "solver/cells/glue_term.h"
#include "solver/minimize/energy.h"

namespace cellwarp
{

/// A state, its one term and their sum, which refers to both: it stays where it is.
struct CellEnergy
{
    CellState state;
    GlueTerm glue;
    Energy total;

    /// \p components from find_components(); \p has_rigid_steps as in CellState.
    CellEnergy(const Cells& cells, const Glue& of,
               std::span<const Constraint> constraints,
               std::span<const Component> components, bool has_rigid_steps = true)
        : state(cells, constraints, has_rigid_steps), glue(state, of, components),
          total({&state}, {&glue})
    {
    }
    CellEnergy(const CellEnergy&) = delete;
    CellEnergy& operator=(const CellEnergy&) = delete;
};

} // namespace cellwarp
