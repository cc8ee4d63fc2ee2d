// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/cells/constraints.h"

#include <algorithm>
#include <numeric>

#include <Eigen/Geometry>

#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

/// Rotations that keep all held points: 3 about one place, 1 about a line, else 0.
int rotations_about(const std::vector<Eigen::Vector3d>& points)
{
    // Places closer than this, relative to their extent, count as one.
    constexpr double kSame = 1e-9;
    double extent = 0.0;
    Eigen::Vector3d far = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& point : points)
    {
        const Eigen::Vector3d d = point - points.front();
        if (d.norm() > extent)
        {
            extent = d.norm();
            far = d;
        }
    }
    if (!(extent > kSame))
        return 3;
    for (const Eigen::Vector3d& point : points)
        if ((point - points.front()).cross(far).norm() > kSame * extent * extent)
            return 0;
    return 1;
}

/// Of each cell the number of its component, in the order of their first cells.
std::vector<int> numbers_of_components(const Cells& cells,
                                       const std::vector<Constraint>& constraints)
{
    std::vector<int> number = connected_components(cells);
    std::vector<int> joined(number.size()); // to one with a lower number, or itself
    std::iota(joined.begin(), joined.end(), 0);
    const auto root = [&](int component)
    {
        while (joined[idx(component)] != component)
            component = joined[idx(component)];
        return component;
    };
    for (std::size_t i = 0; i < number.size(); ++i)
        if (constraints[i].hold == Hold::Grouped)
        {
            const int a = root(number[i]), b = root(number[idx(constraints[i].leader)]);
            joined[idx(std::max(a, b))] = std::min(a, b);
        }
    int count = 0;
    std::vector<int> renumbered(number.size(), -1);
    for (int& component : number)
    {
        int& now = renumbered[idx(root(component))];
        if (now < 0)
            now = count++;
        component = now;
    }
    return number;
}

} // namespace

std::vector<Component> find_components(const Cells& cells,
                                       std::vector<Constraint>& constraints)
{
    const std::vector<int> number = numbers_of_components(cells, constraints);
    std::vector<Component> components;
    for (std::size_t i = 0; i < number.size(); ++i)
    {
        const std::size_t c = idx(number[i]);
        components.resize(std::max(components.size(), c + 1));
        components[c].cells.push_back(static_cast<int>(i));
    }
    for (Component& component : components)
    {
        bool has_prescribed = false;
        std::vector<Eigen::Vector3d> pins;
        for (const int cell : component.cells)
        {
            const Constraint& constraint = constraints[idx(cell)];
            has_prescribed |= constraint.hold == Hold::Prescribed;
            if (constraint.hold == Hold::Pinned || constraint.hold == Hold::Sliding ||
                constraint.hold == Hold::Grouped)
                pins.push_back(constraint.held_rest);
        }
        component.is_held = has_prescribed || !pins.empty();
        if (!component.is_held)
        {
            for (const int cell : component.cells)
                if (constraints[idx(cell)].hold == Hold::Free)
                    constraints[idx(cell)].hold = Hold::Idle;
        }
        else if (!has_prescribed)
        {
            component.free_rotations = rotations_about(pins);
            // In a plane it turns about one place, and not about a line.
            if (constraints[idx(component.cells.front())].flat_axis >= 0)
                component.free_rotations = component.free_rotations == 3;
        }
    }
    return components;
}

Pose held_at_pin(const Pose& pose, const Constraint& pin, const Eigen::Vector3d& centre)
{
    return {pose.R,
            centre + (pin.held_now - pin.held_rest) -
                (pose.R - Eigen::Matrix3d::Identity()) * (pin.held_rest - centre)};
}

} // namespace cellwarp::core
