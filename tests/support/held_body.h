// SPDX-License-Identifier: GPL-3.0-or-later
// Cells with their glue and what holds them: what every test of the solver begins with.
#pragma once

#include <cmath>
#include <vector>

#include "octree/cells.h"
#include "solver/cells/cell_energy.h"
#include "solver/cells/constraints.h"
#include "solver/cells/glue.h"

namespace cellwarp::core::support
{

/// x = (a + pitch s, r cos s, r sin s), shifted.
struct Helix final : Rail
{
    Eigen::Vector3d shift = Eigen::Vector3d::Zero();
    double radius = 1.0, pitch = 0.4, first = -10.0, last = 10.0;
    bool closed = false;

    RailPlace at(double s) const override
    {
        const double c = radius * std::cos(s), d = radius * std::sin(s);
        return {shift + Eigen::Vector3d(pitch * s, c, d), {pitch, -d, c}, {0.0, -c, -d}};
    }
    double begin() const override { return first; }
    double end() const override { return last; }
    bool is_closed() const override { return closed; }
};

struct HeldBody
{
    Cells cells;
    Glue glue;
    std::vector<Constraint> constraints;
    std::vector<Component> components;

    /// All free. \p factors as in build_glue().
    explicit HeldBody(const Cells& of, const std::vector<double>& factors = {})
        : cells(of), glue(build_glue(of, factors)), constraints(of.size())
    {
    }

    template <class Where>
    void prescribe(Where&& where)
    {
        for (std::size_t i = 0; i < cells.size(); ++i)
            if (where(cells.cells[i]))
                constraints[i].hold = Hold::Prescribed;
    }
    /// Pins the cell at one of its points.
    void pin(std::size_t cell, const Eigen::Vector3d& point)
    {
        constraints[cell] = {Hold::Pinned, point, point};
    }
    /// Makes cells one rigid body, the first the leader, that turns about a point; once
    /// all else is held.
    void group(const std::vector<std::size_t>& members, const Eigen::Vector3d& point)
    {
        std::vector<int> leaders(cells.size(), -1);
        for (const std::size_t cell : members)
        {
            leaders[cell] = static_cast<int>(members.front());
            constraints[cell] = {Hold::Grouped, point, point,
                                 nullptr,       0.0,   leaders[cell]};
        }
        glue = with_groups(glue, cells, leaders);
    }
    /// Lets the cell slide along a curve at one of its points.
    void slide(std::size_t cell, const Eigen::Vector3d& point, const Rail& rail, double s)
    {
        constraints[cell] = {Hold::Sliding, point, rail.at(s).place, &rail, s};
    }
    /// The energy at rest, when all is held that is to be.
    CellEnergy energy()
    {
        components = find_components(cells, constraints);
        return CellEnergy(cells, glue, constraints, components);
    }
    std::vector<Pose> rest() const
    {
        std::vector<Pose> poses;
        for (const Cell& cell : cells.cells)
            poses.push_back({Eigen::Matrix3d::Identity(), cell.centre});
        return poses;
    }
};

} // namespace cellwarp::core::support
