// SPDX-License-Identifier: GPL-3.0-or-later
// Solves for cells that do not pass through each other.
#pragma once

#include <functional>
#include <vector>

#include "library/session/contact_finder.h"
#include "solver/minimize/newton.h"

namespace cellwarp::core
{

/// The objects that a solve in contact works on.
struct SolvedInContact
{
    const ContactFinder& finder;
    double voxel = 0.0; ///< of the boundary's material
    const std::vector<Pose>& poses;
    std::vector<FoundContact>& contacts; ///< that solve() knows of
    std::function<void()> has_changed;   ///< after these have
    /// From the poses, which it moves.
    std::function<SolveReport(const SolveOptions&)> solve;
};

/// Contacts are found at the poses, solved with and found again, until none is new, at
/// most eight times: then it is as at the limit of iterations.
SolveReport solve_in_contact(const SolvedInContact& of, const SolveOptions& options);

} // namespace cellwarp::core
