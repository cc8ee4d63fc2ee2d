// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/flesh/bound_nodes.h"

#include <algorithm>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <gtest/gtest.h>

#include "solver/flesh/bone_points.h"
#include "tests/support/flesh.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

const auto kEverywhere = [](int, const Vector3d&) { return true; };

/// Displacements of all nodes from those of the free ones and of the points.
MatrixXd dense(const BoundNodes& nodes, std::size_t num_nodes, std::size_t num_points)
{
    MatrixXd W = MatrixXd::Zero(Eigen::Index(num_nodes),
                                Eigen::Index(nodes.free.size() + num_points));
    for (std::size_t k = 0; k < nodes.free.size(); ++k)
        W(nodes.free[k], Eigen::Index(k)) = 1.0;
    for (std::size_t k = 0; k < nodes.bound.size(); ++k)
    {
        for (const NodeShare& share : nodes.by_free[k])
            W(nodes.bound[k], share.node) += share.share;
        for (const NodeShare& share : nodes.by_points[k])
            W(nodes.bound[k], Eigen::Index(nodes.free.size()) + share.node) +=
                share.share;
    }
    return W;
}

std::vector<BoneLine> random_bones(std::mt19937& rng)
{
    Vector3d at(0.6, 1.1, 0.9);
    std::vector<BoneLine> bones;
    for (int k = 0; k < 4; ++k)
    {
        const Vector3d next(at.x() + support::random_number(rng, 0.8, 1.5),
                            support::random_number(rng, 0.3, 1.7),
                            support::random_number(rng, 0.3, 1.7));
        bones.push_back({at, next, k});
        at = next;
    }
    return bones;
}

} // namespace

TEST(BoundNodes, held_points_are_where_they_should_be_whatever_the_free_nodes_do)
{
    std::mt19937 rng(3);
    const support::Built body =
        support::built_mixed(support::box_shape({0, 0, 0}, {7, 2, 2}), 14, 1, 5);
    const Lattice lattice = octree_lattice(body.octree, body.cells, 1.0);
    for (int trial = 0; trial < 20; ++trial)
    {
        const std::vector<HeldPoint> points =
            points_on_bones(lattice, random_bones(rng), kEverywhere);
        ASSERT_GT(points.size(), 10u);
        const BoundNodes nodes = bind_nodes(lattice.hanging, points);
        const MatrixXd W = dense(nodes, lattice.places.size(), points.size());
        // Shares stay small: no row is solved for a node that hardly counts in it.
        EXPECT_LT(W.cwiseAbs().maxCoeff(), 20.0);
        std::size_t held = 0;
        for (std::size_t p = 0; p < points.size(); ++p)
        {
            Eigen::RowVectorXd J = Eigen::RowVectorXd::Zero(W.rows());
            for (const NodeShare& share : points[p].shares)
                J[share.node] = share.share;
            Eigen::RowVectorXd row = J * W;
            row[Eigen::Index(nodes.free.size() + p)] -= 1.0;
            held += row.norm() < 1e-12;
        }
        EXPECT_EQ(held + nodes.dropped.size(), points.size());
        // Bones that clip the corners of cells tell the same twice.
        EXPECT_LE(nodes.dropped.size(), points.size() / 2);
    }
}

TEST(BoundNodes, rigid_motions_are_kept)
{
    std::mt19937 rng(4);
    const Lattice lattice = support::bar_lattice(2, 4);
    const std::vector<HeldPoint> points = points_on_bones(
        lattice, std::vector<BoneLine>{{{0.3, 0.4, 0.7}, {3.6, 0.6, 0.2}, 0}},
        kEverywhere);
    const BoundNodes nodes = bind_nodes(lattice.hanging, points);
    const MatrixXd W = dense(nodes, lattice.places.size(), points.size());
    const Eigen::Vector4d affine(0.3, -0.2, 0.7, 0.1);
    VectorXd in(W.cols());
    for (std::size_t k = 0; k < nodes.free.size(); ++k)
        in[Eigen::Index(k)] =
            affine.dot(lattice.places[idx(nodes.free[k])].homogeneous());
    for (std::size_t p = 0; p < points.size(); ++p)
        in[Eigen::Index(nodes.free.size() + p)] =
            affine.dot(points[p].place.homogeneous());
    const VectorXd out = W * in;
    for (std::size_t n = 0; n < lattice.places.size(); ++n)
        EXPECT_NEAR(out[Eigen::Index(n)], affine.dot(lattice.places[n].homogeneous()),
                    1e-13);
}

TEST(BoundNodes, a_bone_along_lattice_lines_takes_its_nodes_with_coefficient_one)
{
    const Lattice lattice = support::bar_lattice(2, 4);
    const std::vector<HeldPoint> points =
        points_on_bones(lattice,
                        std::vector<BoneLine>{{{0, 0.5, 0.5}, {2, 0.5, 0.5}, 0},
                                              {{2, 0.5, 0.5}, {4, 0.5, 0.5}, 1}},
                        kEverywhere);
    EXPECT_EQ(points.size(), 9u);
    const BoundNodes nodes = bind_nodes(lattice.hanging, points);
    EXPECT_TRUE(nodes.dropped.empty());
    EXPECT_EQ(nodes.bound.size(), 9u);
    for (std::size_t k = 0; k < nodes.bound.size(); ++k)
    {
        EXPECT_TRUE(nodes.by_free[k].empty());
        ASSERT_EQ(nodes.by_points[k].size(), 1u);
        EXPECT_EQ(nodes.by_points[k][0].share, 1.0);
    }
}

TEST(BoundNodes, elimination_solves_what_multipliers_solve)
{
    std::mt19937 rng(6);
    const support::Built body =
        support::built_mixed(support::box_shape({0, 0, 0}, {6, 2, 2}), 6, 1, 9);
    const Lattice lattice = octree_lattice(body.octree, body.cells, 1.0);
    const std::vector<HeldPoint> points =
        points_on_bones(lattice, random_bones(rng), kEverywhere);
    const BoundNodes nodes = bind_nodes(lattice.hanging, points);
    // Any positive definite matrix over the nodes, and hanging ones as rows as well.
    const Eigen::Index n = Eigen::Index(lattice.places.size());
    MatrixXd A(n, n);
    for (double& a : A.reshaped())
        a = support::random_number(rng, -1, 1);
    A = (A * A.transpose() + n * MatrixXd::Identity(n, n)).eval();
    VectorXd b(n), gamma(Eigen::Index(points.size()));
    for (double& x : b)
        x = support::random_number(rng, -1, 1);
    for (double& x : gamma)
        x = support::random_number(rng, -1, 1);
    const MatrixXd W = dense(nodes, lattice.places.size(), points.size());
    const MatrixXd Z = W.leftCols(Eigen::Index(nodes.free.size())),
                   G = W.rightCols(gamma.size());
    const VectorXd free =
        (Z.transpose() * A * Z).llt().solve(Z.transpose() * (b - A * G * gamma));
    const VectorXd u = Z * free + G * gamma;

    std::vector<Eigen::RowVectorXd> rows;
    std::vector<double> right;
    for (std::size_t p = 0; p < points.size(); ++p)
    {
        if (std::find(nodes.dropped.begin(), nodes.dropped.end(), static_cast<int>(p)) !=
            nodes.dropped.end())
            continue;
        rows.push_back(Eigen::RowVectorXd::Zero(n));
        for (const NodeShare& share : points[p].shares)
            rows.back()[share.node] = share.share;
        right.push_back(gamma[Eigen::Index(p)]);
    }
    for (Eigen::Index k = 0; k < n; ++k)
        if (!lattice.hanging[idx(k)].empty())
        {
            rows.push_back(Eigen::RowVectorXd::Zero(n));
            rows.back()[k] = 1.0;
            for (const NodeShare& share : lattice.hanging[idx(k)])
                rows.back()[share.node] -= share.share;
            right.push_back(0.0);
        }
    const Eigen::Index m = Eigen::Index(rows.size());
    MatrixXd saddle = MatrixXd::Zero(n + m, n + m);
    VectorXd of(n + m);
    saddle.topLeftCorner(n, n) = A;
    of.head(n) = b;
    for (Eigen::Index r = 0; r < m; ++r)
    {
        saddle.row(n + r).head(n) = rows[idx(r)];
        saddle.col(n + r).head(n) = rows[idx(r)].transpose();
        of[n + r] = right[idx(r)];
    }
    const VectorXd wanted = saddle.fullPivLu().solve(of).head(n);
    EXPECT_LT((u - wanted).norm(), 1e-12 * wanted.norm());
}

TEST(BoundNodes, equations_that_others_tell_are_dropped)
{
    const Lattice lattice = support::bar_lattice(1, 1);
    std::vector<HeldPoint> points;
    for (const double x : {0.0, 1.0, 0.5, 0.25})
        points.push_back({shares_at(lattice, 0, {x, 0.5, 0.5}), {x, 0.5, 0.5}, 0});
    EXPECT_EQ(bind_nodes(lattice.hanging, points).dropped, (std::vector<int>{2, 3}));
}

} // namespace cellwarp::core
