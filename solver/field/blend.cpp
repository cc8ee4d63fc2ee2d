// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/field/blend.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "octree/point_tree.h"

namespace cellwarp
{

Eigen::Vector3d nearest_in_box(const Eigen::Vector3d& centre, double edge,
                               const Eigen::Vector3d& x)
{
    constexpr double kSlack = 1e-9;
    const Eigen::Array3d half = Eigen::Array3d::Constant((0.5 + kSlack) * edge);
    const Eigen::Array3d from_centre = (x - centre).array();
    const Eigen::Array3d clamped = from_centre.max(-half).min(half);
    // What is not clamped stays itself to the bit.
    return (clamped == from_centre).select(x.array(), centre.array() + clamped).matrix();
}

ClosestCells::ClosestCells(const Cells& cells)
    : first_neighbour_(cells.first_neighbour), neighbours_(cells.neighbours)
{
    for (const Cell& cell : cells.cells)
    {
        box_centres_.push_back(cell.box_centre);
        edges_.push_back(cell.edge);
    }
}

void ClosestCells::influences(const Eigen::Vector3d& x, int own,
                              std::vector<Influence>& out) const
{
    out.clear();
    const Eigen::Vector3d place =
        nearest_in_box(box_centres_[static_cast<std::size_t>(own)],
                       edges_[static_cast<std::size_t>(own)], x);
    const Eigen::Array3d is_within = (place.array() == x.array()).cast<double>();
    // With u = (1 - d/s)^2: grad u = -2 (1 - d/s) / s * (x - c) / d.
    const auto weigh = [&](int cell)
    {
        const std::size_t c = static_cast<std::size_t>(cell);
        const Eigen::Vector3d arm = place - box_centres_[c];
        const double d = arm.norm(), rest = 1.0 - d / edges_[c];
        if (rest <= 0)
            return false;
        Influence influence{cell, rest * rest, Eigen::Vector3d::Zero()};
        if (d > 0)
            influence.gradient =
                (-2.0 * rest / (edges_[c] * d) * arm.array() * is_within).matrix();
        out.push_back(influence);
        return true;
    };
    weigh(own);
    for (std::size_t next = 0; next < out.size(); ++next)
    {
        const std::size_t c = static_cast<std::size_t>(out[next].cell);
        for (int k = first_neighbour_[c]; k < first_neighbour_[c + 1]; ++k)
        {
            const int other = neighbours_[static_cast<std::size_t>(k)];
            const bool is_known =
                std::any_of(out.begin(), out.end(),
                            [&](const Influence& i) { return i.cell == other; });
            if (!is_known)
                weigh(other);
        }
    }
    // The order of the sum must not depend on the cell the search began in.
    std::sort(out.begin(), out.end(),
              [](const Influence& a, const Influence& b) { return a.cell < b.cell; });
    double sum = 0.0;
    Eigen::Vector3d sum_gradient = Eigen::Vector3d::Zero();
    for (const Influence& influence : out)
    {
        sum += influence.weight;
        sum_gradient += influence.gradient;
    }
    for (Influence& influence : out)
    {
        influence.weight /= sum;
        influence.gradient = (influence.gradient - influence.weight * sum_gradient) / sum;
    }
}

struct Closest4::Tree
{
    PointTree points;
};

namespace
{

std::vector<Eigen::Vector3d> centres_of(const Cells& cells)
{
    std::vector<Eigen::Vector3d> centres;
    for (const Cell& cell : cells.cells)
        centres.push_back(cell.centre);
    return centres;
}

} // namespace

Closest4::Closest4(const Cells& cells)
    : tree_(std::make_unique<Tree>(Tree{PointTree(centres_of(cells))}))
{
}
Closest4::~Closest4() = default;
Closest4::Closest4(Closest4&&) noexcept = default;
Closest4& Closest4::operator=(Closest4&&) noexcept = default;

void Closest4::influences(const Eigen::Vector3d& x, std::vector<Influence>& out) const
{
    std::vector<PointTree::Neighbour> near;
    tree_->points.nearest(x, 5, near);
    out.clear();
    const double fifth = std::sqrt(near.back().distance_squared);
    double sum = 0.0;
    for (std::size_t i = 0; i < std::min<std::size_t>(4, near.size()); ++i)
    {
        const double rest = near.size() > 4 && fifth > 0
                                ? 1.0 - std::sqrt(near[i].distance_squared) / fifth
                                : 1.0;
        out.push_back(
            {static_cast<int>(near[i].index), rest * rest, Eigen::Vector3d::Zero()});
        sum += rest * rest;
    }
    for (Influence& influence : out)
        influence.weight =
            sum > 0 ? influence.weight / sum : 1.0 / static_cast<double>(out.size());
}

FieldValue blended(std::span<const Influence> influences, std::span<const Pose> poses,
                   const Cells& cells, const Eigen::Vector3d& x)
{
    FieldValue value;
    for (const Influence& influence : influences)
    {
        const std::size_t c = static_cast<std::size_t>(influence.cell);
        const Eigen::Vector3d d = displacement(poses[c], cells.cells[c].centre, x);
        value.displacement += influence.weight * d;
        value.gradient += influence.weight * (poses[c].R - Eigen::Matrix3d::Identity()) +
                          d * influence.gradient.transpose();
    }
    return value;
}

} // namespace cellwarp
