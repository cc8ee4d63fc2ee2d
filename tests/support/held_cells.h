// SPDX-License-Identifier: GPL-3.0-or-later
// Cells of a region, by where they are.
#pragma once

#include <initializer_list>
#include <vector>

#include <gtest/gtest.h>

#include "solver/cells/constraints.h"
#include "tests/support/shapes.h"

namespace cellwarp::core::support
{

/// The cell whose box has its middle near a point [edges].
inline std::size_t cell_at(const Built& bar, const Eigen::Vector3d& middle)
{
    for (std::size_t i = 0; i < bar.cells.size(); ++i)
        if ((bar.cells.cells[i].box_centre - middle).norm() < 0.1)
            return i;
    ADD_FAILURE() << "no cell there";
    return 0;
}

/// Some cells prescribed, all others free.
inline std::vector<Constraint> holding(const Built& bar,
                                       std::initializer_list<std::size_t> held)
{
    std::vector<Constraint> constraints(bar.cells.size());
    for (const std::size_t cell : held)
        constraints[cell].hold = Hold::Prescribed;
    return constraints;
}

} // namespace cellwarp::core::support
