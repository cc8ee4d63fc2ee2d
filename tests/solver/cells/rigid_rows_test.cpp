// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/cells/rigid_rows.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "tests/support/energy_checks.h"
#include "tests/support/held_body.h"
#include "tests/support/random.h"
#include "tests/support/random_poses.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

using support::HeldBody;

namespace
{

/// The finest rows of a body that is held at one end, at rest or as its cells are then.
struct FinestRows
{
    HeldBody body;
    CellEnergy energy;
    std::vector<UnknownBody> unknowns;
    RigidRows rows;

    explicit FinestRows(HeldBody of, bool is_strained = false)
        : body(std::move(of)), energy(body.energy())
    {
        energy.state.set_held_points(body.constraints);
        if (is_strained)
        {
            std::mt19937 rng(1);
            std::vector<Pose> poses = body.rest();
            for (std::size_t i = 0; i < poses.size(); ++i)
                if (body.constraints[i].hold == Hold::Free)
                    poses[i] = {support::random_rotation(rng),
                                poses[i].p + support::random_vector(rng, 0.2)};
            energy.state.set_poses(poses);
        }
        energy.total.linearise(kGaussNewton);
        unknowns = energy.bodies(grid_places(body.cells));
        rows = rows_of(energy.total, unknowns);
    }
    /// All blocks, in true unknowns.
    Eigen::MatrixXd dense() const { return dense_of(rows); }
    static Eigen::MatrixXd dense_of(const RigidRows& A)
    {
        Eigen::MatrixXd all = Eigen::MatrixXd::Zero(6 * A.count(), 6 * A.count());
        for (std::size_t i = 0; i < idx(A.count()); ++i)
            for (std::size_t k = A.begin(i); k < A.end(i); ++k)
                all.block<6, 6>(6 * static_cast<Eigen::Index>(i), 6 * A.column[k]) =
                    A.scale[i].cwiseInverse().asDiagonal() * A.block(k) *
                    A.scale[idx(A.column[k])].cwiseInverse().asDiagonal();
        return all;
    }
    std::size_t num_of_other_form() const
    {
        return static_cast<std::size_t>(std::count_if(rows.rest.begin(), rows.rest.end(),
                                                      [](const auto& rest)
                                                      { return rest != nullptr; }));
    }
};

HeldBody bar_held_at_one_end()
{
    HeldBody body(support::bar(8, 3, 2).cells);
    body.prescribe([](const Cell& cell) { return cell.centre.x() < 1.0; });
    return body;
}

const support::Helix& rail()
{
    static const support::Helix helix;
    return helix;
}

HeldBody with_a_sliding_cell()
{
    HeldBody body = bar_held_at_one_end();
    body.slide(30, body.cells.cells[30].centre + Eigen::Vector3d(0.1, 0.2, 0.3), rail(),
               0.4);
    return body;
}

HeldBody in_a_plane()
{
    HeldBody body = bar_held_at_one_end();
    for (Constraint& constraint : body.constraints)
        constraint.flat_axis = 2;
    return body;
}

/// All cells of each block of 2 x 2 x 2 joined.
struct Joined
{
    RigidBodies bodies;
    Grouping grouping;
    RigidBodies next_bodies;
    RigidRows next;

    explicit Joined(const FinestRows& of) : bodies(finest_bodies(of.unknowns))
    {
        std::vector<GridPlace> places;
        for (const UnknownBody& body : of.unknowns)
            places.push_back(body.grid);
        OctreeBlocks blocks(places);
        grouping = blocks.join(of.rows, [](std::size_t, std::size_t) { return true; });
        next_bodies = joined_bodies(bodies, grouping.members);
        next = joined_rows(of.rows, bodies, grouping, next_bodies);
    }
};

/// Second derivatives by the unknowns that a body has, in common axes.
Eigen::MatrixXd expected(const FinestRows& of)
{
    const Eigen::MatrixXd H = support::dense_hessian(of.energy.total);
    std::vector<int> first = {0};
    for (const int size : of.energy.total.block_sizes())
        first.push_back(first.back() + size);
    Eigen::MatrixXd to_common = Eigen::MatrixXd::Zero(
        6 * static_cast<Eigen::Index>(of.unknowns.size()), H.rows());
    for (std::size_t i = 0; i < of.unknowns.size(); ++i)
    {
        const UnknownBody& body = of.unknowns[i];
        const Eigen::Index row = 6 * static_cast<Eigen::Index>(i),
                           column = first[idx(body.block)] + body.first;
        to_common.block(row, column, 3, body.turns) = body.turn.leftCols(body.turns);
        to_common.block(row + 3, column + body.turns, 3, body.shifts) =
            body.shift.leftCols(body.shifts);
    }
    return to_common * H * to_common.transpose();
}

} // namespace

TEST(RigidRows, are_the_second_derivatives_in_common_axes)
{
    const auto expect_rows = [](const FinestRows& of)
    {
        const Eigen::MatrixXd should_be = expected(of);
        Eigen::MatrixXd rows = of.dense();
        // What no unknown leads has a stiffness of its own.
        for (std::size_t i = 0; i < of.unknowns.size(); ++i)
            if (of.unknowns[i].turns < 3 || of.unknowns[i].shifts < 3)
                for (const Eigen::Index half : {0, 3})
                {
                    const Eigen::Index at = 6 * static_cast<Eigen::Index>(i) + half;
                    const UnknownBody& body = of.unknowns[i];
                    const Eigen::Matrix3d led =
                        half == 0
                            ? Eigen::Matrix3d(body.turn.leftCols(body.turns) *
                                              body.turn.leftCols(body.turns).transpose())
                            : Eigen::Matrix3d(
                                  body.shift.leftCols(body.shifts) *
                                  body.shift.leftCols(body.shifts).transpose());
                    rows.block<3, 3>(at, at) =
                        (led * rows.block<3, 3>(at, at) * led).eval();
                }
        EXPECT_LT((rows - should_be).norm(), 1e-12 * should_be.norm());
    };
    expect_rows(FinestRows(bar_held_at_one_end()));
    expect_rows(FinestRows(bar_held_at_one_end(), true));
    expect_rows(FinestRows(with_a_sliding_cell()));
    expect_rows(FinestRows(in_a_plane()));
    HeldBody pinned = bar_held_at_one_end();
    pinned.pin(30, pinned.cells.cells[30].centre + Eigen::Vector3d(0.5, 0.1, 0.0));
    expect_rows(FinestRows(pinned));
}

TEST(RigidRows, have_the_form_of_glue_wherever_free_cells_are)
{
    EXPECT_EQ(FinestRows(bar_held_at_one_end()).num_of_other_form(), 0u);
    EXPECT_EQ(FinestRows(bar_held_at_one_end(), true).num_of_other_form(), 0u);
    // Its own block, and those of its neighbours on both sides of the diagonal.
    const FinestRows sliding(with_a_sliding_cell());
    const std::size_t others = sliding.num_of_other_form();
    EXPECT_GT(others, 0u);
    EXPECT_LE(others, 1u + 2u * 6u);
}

/// Bodies that move with their group as T says: A_C = T^T A T.
TEST(RigidRows, of_groups_are_those_of_cells_that_move_with_them)
{
    const auto expect_joined = [](const FinestRows& of)
    {
        const RigidRows& A = of.rows;
        const Joined joined(of);
        const auto& [bodies, grouping, next_bodies, next] = joined;
        ASSERT_LT(next.count(), A.count() / 3);
        Eigen::MatrixXd T = Eigen::MatrixXd::Zero(6 * A.count(), 6 * next.count());
        for (std::size_t i = 0; i < idx(A.count()); ++i)
        {
            const int b = grouping.group_of_node[i];
            Matrix6 own = Matrix6::Identity();
            own.bottomLeftCorner<3, 3>() =
                -cross_matrix(bodies.centre[i] - next_bodies.centre[idx(b)]);
            if (!bodies.is_free(i))
                own = (bodies.own_limit(i) * own).eval();
            T.block<6, 6>(6 * static_cast<Eigen::Index>(i), 6 * b) = own;
        }
        const Eigen::MatrixXd should_be = T.transpose() * of.dense() * T;
        EXPECT_LT((FinestRows::dense_of(next) - should_be).norm(),
                  1e-12 * should_be.norm());
    };
    expect_joined(FinestRows(bar_held_at_one_end()));
    expect_joined(FinestRows(bar_held_at_one_end(), true));
    expect_joined(FinestRows(with_a_sliding_cell()));
}

/// Cells in a plane make groups that cannot do all motions either: those have a stiffness
/// of their own, and the others are those of the cells.
TEST(RigidRows, of_groups_in_a_plane_are_those_of_cells_there)
{
    const FinestRows of(in_a_plane());
    EXPECT_GT(of.num_of_other_form(), 0u);
    const Joined joined(of);
    const auto& [bodies, grouping, next_bodies, next] = joined;
    // x = (turn about z, shift along x and y) of every group.
    Eigen::VectorXd x = Eigen::VectorXd::Zero(6 * next.count());
    std::mt19937 rng(5);
    for (int b = 0; b < next.count(); ++b)
        for (const int unknown : {2, 3, 4})
            x[6 * b + unknown] = support::random_number(rng, -1.0, 1.0);
    Eigen::VectorXd of_cells = Eigen::VectorXd::Zero(6 * of.rows.count());
    for (std::size_t i = 0; i < idx(of.rows.count()); ++i)
    {
        const int b = grouping.group_of_node[i];
        const Eigen::Vector3d turn = x.segment<3>(6 * b);
        const Eigen::Index at = 6 * static_cast<Eigen::Index>(i);
        of_cells.segment<3>(at) = turn;
        Eigen::Vector3d shift = x.segment<3>(6 * b + 3) +
                                turn.cross(bodies.centre[i] - next_bodies.centre[idx(b)]);
        shift.z() = 0.0;
        of_cells.segment<3>(at + 3) = shift;
    }
    const double energy = x.dot(FinestRows::dense_of(next) * x);
    EXPECT_NEAR(energy, of_cells.dot(of.dense() * of_cells), 1e-12 * energy);
}

} // namespace cellwarp::core
