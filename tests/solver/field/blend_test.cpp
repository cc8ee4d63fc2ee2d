// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/field/blend.h"

#include <cmath>

#include <gtest/gtest.h>

#include "octree/base/index.h"
#include "tests/support/bodies.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

using support::Built;
using support::random_number;
using support::random_vector;

namespace
{

int own_cell(const Built& built, const Eigen::Vector3d& x)
{
    const VoxelGrid& grid = built.material.grid;
    return built.pieces.at(grid, grid.locate(x));
}

/// Of all cells, 0 where one does not count.
Eigen::VectorXd weights_of(const ClosestCells& closest, const Cells& cells,
                           const Eigen::Vector3d& x, int own)
{
    std::vector<Influence> found;
    closest.influences(x, own, found);
    Eigen::VectorXd weights = Eigen::VectorXd::Zero(static_cast<int>(cells.size()));
    for (const Influence& influence : found)
        weights[influence.cell] = influence.weight;
    return weights;
}

/// (1 - d/s)^2 of all cells that are as near as that, divided by the sum.
Eigen::VectorXd plain_weights(const Cells& cells, const Eigen::Vector3d& x)
{
    Eigen::VectorXd weights(static_cast<int>(cells.size()));
    for (int i = 0; i < weights.size(); ++i)
    {
        const Cell& cell = cells.cells[idx(i)];
        const double rest = 1.0 - (x - cell.box_centre).norm() / cell.edge;
        weights[i] = rest > 0 ? rest * rest : 0.0;
    }
    return weights / weights.sum();
}

Eigen::Vector3d point_in(std::mt19937& rng, const Cell& cell)
{
    return cell.box_centre + random_vector(rng, 0.5 * cell.edge);
}

/// Fingers that share leaves, in cells of several sizes.
std::vector<Built> narrow_bodies()
{
    std::vector<Built> bodies;
    bodies.push_back(support::built(support::comb(), 4, 0, Fill::Solid, 0.02));
    bodies.push_back(support::built_mixed(support::comb(), 4, 2, 1, 0.02));
    bodies.push_back(support::built_mixed(support::comb(), 9, 1, 2, 0.02));
    bodies.push_back(support::built_mixed(support::angle(), 4, 2, 3));
    return bodies;
}

} // namespace

TEST(ClosestCells, on_a_regular_grid_distances_alone_tell_the_weights)
{
    const Built bar = support::bar(4, 3, 5);
    const ClosestCells closest(bar.cells);
    std::mt19937 rng(1);
    for (int trial = 0; trial < 20000; ++trial)
    {
        Eigen::Vector3d x(random_number(rng, 0, 4), random_number(rng, 0, 3),
                          random_number(rng, 0, 5));
        if (trial % 4 == 0) // on faces, edges and corners as well
            for (int k = 0; k < 3; ++k)
                x[k] = rng() % 2 ? std::round(x[k]) : x[k];
        EXPECT_LT((weights_of(closest, bar.cells, x, own_cell(bar, x)) -
                   plain_weights(bar.cells, x))
                      .lpNorm<Eigen::Infinity>(),
                  1e-14);
    }
}

TEST(ClosestCells, around_an_inner_edge_distances_alone_tell_the_weights)
{
    // Of the four cells around the edge one is missing.
    const Built angle = support::built(support::angle(0.97), 4);
    ASSERT_EQ(angle.cells.size(), 6u);
    const ClosestCells closest(angle.cells);
    std::mt19937 rng(2);
    for (int trial = 0; trial < 5000; ++trial)
        for (const Cell& cell : angle.cells.cells)
        {
            const Eigen::Vector3d x = point_in(rng, cell);
            EXPECT_LT((weights_of(closest, angle.cells, x, own_cell(angle, x)) -
                       plain_weights(angle.cells, x))
                          .lpNorm<Eigen::Infinity>(),
                      1e-14);
        }
}

TEST(ClosestCells, weights_are_the_same_from_both_sides_of_a_face)
{
    for (const Built& built : narrow_bodies())
    {
        const Cells& cells = built.cells;
        const ClosestCells closest(cells);
        std::mt19937 rng(3);
        for (const Face& face : cells.faces)
            for (int trial = 0; trial < 10; ++trial)
            {
                const Cell& a = cells.cells[idx(face.a)];
                const Cell& b = cells.cells[idx(face.b)];
                const Cell& smaller = a.edge < b.edge ? a : b;
                Eigen::Vector3d x = point_in(rng, smaller);
                x[face.axis] = face.centre[face.axis];
                EXPECT_LT((weights_of(closest, cells, x, face.a) -
                           weights_of(closest, cells, x, face.b))
                              .lpNorm<Eigen::Infinity>(),
                          1e-7);
            }
    }
}

TEST(ClosestCells, sum_to_one_and_their_slopes_to_nothing)
{
    for (const Built& built : narrow_bodies())
    {
        const ClosestCells closest(built.cells);
        std::mt19937 rng(4);
        std::vector<Influence> found;
        for (std::size_t own = 0; own < built.cells.size(); ++own)
            for (int trial = 0; trial < 20; ++trial)
            {
                const Cell& cell = built.cells.cells[own];
                closest.influences(point_in(rng, cell), static_cast<int>(own), found);
                double sum = 0.0;
                Eigen::Vector3d slope = Eigen::Vector3d::Zero();
                for (const Influence& influence : found)
                {
                    EXPECT_GT(influence.weight, 0.0);
                    sum += influence.weight;
                    slope += influence.gradient;
                }
                EXPECT_NEAR(sum, 1.0, 1e-14);
                EXPECT_LT(slope.norm() * cell.edge, 1e-11);
            }
    }
}

TEST(ClosestCells, slopes_match_finite_differences_where_ways_are_narrow)
{
    int num_narrow = 0;
    for (const Built& built : narrow_bodies())
    {
        const Cells& cells = built.cells;
        const ClosestCells closest(cells);
        std::mt19937 rng(5);
        std::vector<Influence> found;
        for (std::size_t i = 0; i < cells.size(); ++i)
            for (int trial = 0; trial < 40; ++trial)
            {
                const int own = static_cast<int>(i);
                const double edge = cells.cells[i].edge, h = 1e-6 * edge;
                const Eigen::Vector3d x =
                    cells.cells[i].box_centre + random_vector(rng, 0.4999 * edge);
                closest.influences(x, own, found);
                Eigen::MatrixXd slopes =
                    Eigen::MatrixXd::Zero(static_cast<int>(cells.size()), 3);
                for (const Influence& influence : found)
                    slopes.row(influence.cell) = influence.gradient.transpose();
                for (int k = 0; k < 3; ++k)
                {
                    const Eigen::Vector3d e = h * Eigen::Vector3d::Unit(k);
                    const Eigen::VectorXd slope =
                        (weights_of(closest, cells, x + e, own) -
                         weights_of(closest, cells, x - e, own)) /
                        (2.0 * h);
                    EXPECT_LT((slopes.col(k) - slope).lpNorm<Eigen::Infinity>() * edge,
                              1e-3);
                }
                num_narrow +=
                    (weights_of(closest, cells, x, own) - plain_weights(cells, x))
                        .lpNorm<Eigen::Infinity>() > 1e-3;
            }
    }
    EXPECT_GT(num_narrow, 100);
}

TEST(ClosestCells, the_other_finger_of_a_leaf_counts_less_and_less)
{
    // Along the lower finger, away from the cell that joins it to the upper one.
    const Built comb = support::built(support::comb(), 4, 0, Fill::Solid, 0.02);
    const ClosestCells closest(comb.cells);
    const int upper = own_cell(comb, {2.5, 0.8, 0.5});
    ASSERT_NE(own_cell(comb, {2.5, 0.2, 0.5}), upper);
    const auto weight_at = [&](double x)
    {
        const Eigen::Vector3d place(x, 0.2, 0.5);
        return weights_of(closest, comb.cells, place, own_cell(comb, place))[upper];
    };
    EXPECT_GT(weight_at(2.16), 0.4);
    for (double x = 2.16; x < 2.46; x += 0.001)
    {
        EXPECT_LE(weight_at(x + 0.001), weight_at(x));
        EXPECT_GT(weight_at(x + 0.001), weight_at(x) - 0.003);
    }
    EXPECT_EQ(weight_at(2.46), 0.0);
}

} // namespace cellwarp::core
