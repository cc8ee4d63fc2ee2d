// SPDX-License-Identifier: GPL-3.0-or-later
// The energy of cells: of their glue, and of what is solved for with them.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "octree/cells.h"
#include "solver/cells/cell_state.h"
#include "solver/cells/companion.h"
#include "solver/cells/contact_term.h"
#include "solver/cells/glue_term.h"
#include "solver/minimize/energy.h"

namespace cellwarp::core
{

/// A state, its term, what is solved for with them, and their sum, which refers to all:
/// it stays where it is.
struct CellEnergy
{
    CellState state;
    GlueTerm glue;
    std::unique_ptr<Companion> companion; ///< null: none
    std::optional<ContactTerm> contacts;
    Energy total;

    /// \p components from find_components(); \p has_rigid_steps as in CellState;
    /// \p in_contact: what does not pass through each other.
    CellEnergy(const Cells& cells, const Glue& of,
               std::span<const Constraint> constraints,
               std::span<const Component> components, bool has_rigid_steps = true,
               const MakeCompanion& make_companion = {},
               std::span<const CellContact> in_contact = {})
        : state(cells, constraints, has_rigid_steps), glue(state, of, components),
          companion(make_companion ? make_companion(state, glue) : nullptr),
          total(states(), terms(in_contact))
    {
    }
    CellEnergy(const CellEnergy&) = delete;
    CellEnergy& operator=(const CellEnergy&) = delete;

    /// All unknowns, as a multigrid sees them. \p places: of all cells.
    std::vector<UnknownBody> bodies(std::span<const GridPlace> places) const
    {
        std::vector<UnknownBody> bodies = unknown_bodies(state, places);
        if (companion)
            companion->add_bodies(places, bodies);
        return bodies;
    }

private:
    std::vector<State*> states()
    {
        return companion ? std::vector<State*>{&state, &companion->state()}
                         : std::vector<State*>{&state};
    }
    std::vector<Term*> terms(std::span<const CellContact> in_contact)
    {
        std::vector<Term*> terms = {&glue};
        if (companion)
            terms.push_back(&companion->term());
        if (!in_contact.empty())
            terms.push_back(&contacts.emplace(state, in_contact));
        return terms;
    }
};

} // namespace cellwarp::core
