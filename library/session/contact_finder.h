// SPDX-License-Identifier: GPL-3.0-or-later
// Where cells have come into each other: points on the boundary of the material that lie
// in a cell of another part of it, and the plane on its boundary that is to keep them
// out.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "library/session/body.h"
#include "solver/cells/constraints.h"
#include "solver/cells/contact_term.h"

namespace cellwarp::core
{

struct FoundContact
{
    std::size_t point; ///< of BoundaryPoints::all()
    CellContact contact;
    double depth; ///< by which the point is behind the plane, negative: before it [work]
};

class ContactFinder
{
public:
    /// \p body of a rest shape with boundary points; \p factors: stiffness of its cells;
    /// empty: all 1.
    /// Of a group of \p constraints, which is one rigid body, the leader takes part.
    ContactFinder(std::shared_ptr<const Body> body, std::span<const double> factors,
                  std::span<const Constraint> constraints);

    /// At these poses, in the order of the points, at most one of each; those that are
    /// just before the boundary as well. A point counts for no cell that is less than
    /// four steps from neighbour to neighbour away from its own: what is so near is
    /// pressed together by its glue.
    std::vector<FoundContact> find(std::span<const Pose> poses) const;

private:
    bool is_near(int cell, int other) const;
    std::vector<std::vector<int>> cells_that_meet(std::span<const Pose> poses) const;
    void find_of(int cell, std::span<const int> others, std::span<const Pose> poses,
                 std::vector<FoundContact>& found) const;

    std::shared_ptr<const Body> body_;
    std::vector<double> factors_;
    std::vector<int> leaders_;           ///< of each cell; itself where there is none
    std::vector<std::vector<int>> near_; ///< of each cell, ascending
    std::vector<std::uint8_t> material_; ///< of each cell
    std::vector<char> can_move_;         ///< of each cell
    std::vector<std::vector<std::size_t>> points_; ///< of each cell
};

} // namespace cellwarp::core
