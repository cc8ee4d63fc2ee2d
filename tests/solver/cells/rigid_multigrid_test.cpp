// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/cells/rigid_multigrid.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include "octree/base/parallel.h"
#include "solver/linear/conjugate_gradients.h"
#include "solver/minimize/newton.h"
#include "tests/support/allocations.h"
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

/// The first layer of cells is held.
HeldBody held_at_one_end(const Cells& cells, const std::vector<double>& factors = {})
{
    HeldBody body(cells, factors);
    double least = INFINITY;
    for (const Cell& cell : cells.cells)
        least = std::min(least, cell.box_centre.x() - 0.5 * cell.edge);
    body.prescribe([&](const Cell& cell)
                   { return cell.box_centre.x() - 0.5 * cell.edge < least + 1e-9; });
    return body;
}

Eigen::VectorXd random_numbers(Eigen::Index count, unsigned seed)
{
    std::mt19937 rng(seed);
    Eigen::VectorXd x(count);
    for (Eigen::Index i = 0; i < count; ++i)
        x[i] = support::random_number(rng, -1.0, 1.0);
    return x;
}

/// An energy at rest and what the multigrid made of it there.
struct Prepared
{
    CellEnergy energy;
    RigidMultigrid multigrid;
    Eigen::Index count = 0;

    explicit Prepared(HeldBody& body) : energy(body.energy()), multigrid(made(body))
    {
        for (const int size : energy.total.block_sizes())
            count += size;
    }
    /// Steps of conjugate gradients that reduce a random residual to 1e-6.
    int steps(unsigned seed = 1)
    {
        ConjugateGradients conjugate_gradients;
        Eigen::VectorXd x;
        const LinearReport report = conjugate_gradients.solve(
            energy.total, multigrid, random_numbers(count, seed), {.max_steps = 500}, x);
        EXPECT_LE(report.residual, 1e-6);
        EXPECT_FALSE(report.has_negative_curvature);
        return report.steps;
    }
    Eigen::VectorXd applied(const Eigen::VectorXd& r)
    {
        Eigen::VectorXd z;
        multigrid.apply(r, z);
        return z;
    }

private:
    RigidMultigrid made(const HeldBody& body)
    {
        energy.total.linearise(kGaussNewton);
        return RigidMultigrid(energy.total, energy.bodies(grid_places(body.cells)));
    }
};

int steps_at_rest(HeldBody body)
{
    return Prepared(body).steps();
}

HeldBody bar_of_length(int n)
{
    return held_at_one_end(support::bar(4 * n, n, n).cells);
}

/// Two boxes through each other, some of whose cells are filled in part.
Shape crossed_boxes()
{
    return support::joined(support::box_shape({0, 0, 0}, {16, 4, 4}),
                           support::box_shape({6, 2, 2}, {9.7, 16, 12}));
}

/// Prongs so close that leaves hold pieces of two of them.
Cells fork()
{
    Shape shape = support::box_shape({0, 0, 0}, {4, 4, 4});
    for (const double z : {0.0, 1.1, 2.2, 3.3})
        shape = support::joined(shape, support::box_shape({3.9, 0, z}, {24, 4, z + 0.7}));
    const support::Built built = support::built(shape, 12, 0, Fill::Solid, 0.1);
    EXPECT_GT(built.cells.size(), built.octree.leaves().size() + 20);
    return built.cells;
}

/// Leaves of three sizes.
Cells graded_cells()
{
    constexpr int kDepth = 2;
    const support::Built built = support::built(crossed_boxes(), 12, kDepth);
    const MaterialTest test = material_test(built.material.grid);
    Octree octree(built.material.grid.shape(), test);
    for (int level = 0; level < kDepth; ++level)
    {
        std::vector<LeafNumber> some;
        for (std::size_t l = 0; l < octree.leaves().size(); ++l)
            if (octree.leaves()[l].corner.x() < (level == 0 ? 24 : 12))
                some.push_back(LeafNumber(l));
        octree = octree.split(some, test);
    }
    return build_cells(built.material.grid, octree,
                       find_pieces(built.material.grid, octree));
}

/// The leaf in a corner of the box is split, and so are its parts, \p times in all.
Cells smaller_at_a_corner(const support::Built& built, int times)
{
    const MaterialTest test = material_test(built.material.grid);
    Octree octree(built.material.grid.shape(), test);
    for (int level = 0; level < times; ++level)
    {
        std::vector<LeafNumber> some;
        for (std::size_t l = 0; l < octree.leaves().size(); ++l)
            if (octree.leaves()[l].corner.maxCoeff() == 0)
                some.push_back(LeafNumber(l));
        octree = octree.split(some, test);
    }
    return build_cells(built.material.grid, octree,
                       find_pieces(built.material.grid, octree));
}

void expect_symmetric_and_definite(Prepared& p)
{
    Eigen::MatrixXd M(p.count, p.count);
    for (Eigen::Index i = 0; i < p.count; ++i)
        M.col(i) = p.applied(Eigen::VectorXd::Unit(p.count, i));
    EXPECT_LT((M - M.transpose()).norm(), 1e-5 * M.norm());
    // Against A, whose square root is L: all of M^-1 A, not only what is large in M.
    const Eigen::MatrixXd A = support::dense_hessian(p.energy.total);
    const Eigen::LLT<Eigen::MatrixXd> factor(A);
    ASSERT_EQ(factor.info(), Eigen::Success);
    const Eigen::MatrixXd L = factor.matrixL();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(L.transpose() * M * L);
    EXPECT_GT(eigen.eigenvalues().minCoeff(), 0.1);
    EXPECT_LT(eigen.eigenvalues().maxCoeff(), 3.0);
    testing::Test::RecordProperty(
        "condition",
        std::to_string(eigen.eigenvalues().maxCoeff() / eigen.eigenvalues().minCoeff()));
}

/// Twists the whole bar along its axis by an angle in all.
std::vector<Pose> twisted(const HeldBody& body, double angle)
{
    std::vector<Pose> poses = body.rest();
    const Eigen::Vector3d last = poses.back().p,
                          centre(0, 0.5 * last.y(), 0.5 * last.z());
    for (Pose& pose : poses)
    {
        const Eigen::Matrix3d R =
            rotation_about(Eigen::Vector3d::UnitX(), angle * pose.p.x() / last.x());
        pose = {R, centre + R * (pose.p - centre)};
    }
    return poses;
}

} // namespace

TEST(RigidMultigrid, takes_as_many_steps_for_many_cells_as_for_few)
{
    int few = 0;
    for (const int n : {4, 8, 16})
    {
        const int steps = steps_at_rest(bar_of_length(n));
        RecordProperty("steps_" + std::to_string(4 * n * n * n), steps);
        EXPECT_LE(steps, 15);
        few = few == 0 ? steps : few;
        EXPECT_LE(steps, few + 4);
    }
}

/// What bends is soft in a way that small groups do not have: with four times the cells a
/// plate one cell thick takes 2.1 and 2.4 times the steps, a sheet, with what thickness
/// it has, 1.2 times.
TEST(RigidMultigrid, takes_more_steps_for_more_cells_of_a_plate_and_hardly_of_a_sheet)
{
    const auto expect_growth = [](const std::string& name, double most, auto&& cells_of)
    {
        int fewer = 0;
        for (const int n : {16, 32, 64})
        {
            const int steps = steps_at_rest(held_at_one_end(cells_of(n)));
            RecordProperty(name + std::to_string(n), steps);
            EXPECT_TRUE(fewer == 0 || steps <= most * fewer)
                << name << n << ": " << steps;
            fewer = steps;
        }
    };
    expect_growth("plate_", 2.6, [](int n) { return support::bar(n, n, 1).cells; });
    expect_growth(
        "sheet_", 1.3,
        [](int n)
        { return support::built(support::sheet_shape(1, 1), n, 0, Fill::Shell).cells; });
}

TEST(RigidMultigrid, makes_levels_of_an_eighth_each)
{
    HeldBody body = bar_of_length(16);
    const std::vector<int> sizes = Prepared(body).multigrid.sizes();
    ASSERT_EQ(sizes.size(), 4u);
    EXPECT_EQ(sizes[0], 63 * 16 * 16);
    EXPECT_EQ(sizes[1], 32 * 8 * 8);
    EXPECT_EQ(sizes[2], 16 * 4 * 4);
    EXPECT_EQ(sizes[3], 8 * 2 * 2);
}

TEST(RigidMultigrid, is_symmetric_and_positive_definite)
{
    HeldBody body = held_at_one_end(support::bar(10, 3, 3).cells);
    body.pin(60, body.cells.cells[60].centre + Eigen::Vector3d(0.5, 0.5, 0.0));
    Prepared p(body);
    ASSERT_GT(p.multigrid.sizes().size(), 1u);
    expect_symmetric_and_definite(p);
}

TEST(RigidMultigrid, is_symmetric_and_positive_definite_for_many_cells)
{
    HeldBody body = bar_of_length(8);
    Prepared p(body);
    for (unsigned seed = 1; seed <= 5; ++seed)
    {
        const Eigen::VectorXd x = random_numbers(p.count, seed);
        const Eigen::VectorXd y = random_numbers(p.count, seed + 100);
        const Eigen::VectorXd Mx = p.applied(x), My = p.applied(y);
        EXPECT_NEAR(y.dot(Mx), x.dot(My), 1e-5 * Mx.norm() * y.norm());
        EXPECT_GT(x.dot(Mx), 0.0);
        // Linear, to single precision.
        EXPECT_LT((p.applied(x + y) - Mx - My).norm(), 1e-5 * (Mx + My).norm());
    }
}

TEST(RigidMultigrid, is_symmetric_and_positive_definite_where_few_cells_are_small)
{
    const support::Built built =
        support::built(support::box_shape({0, 0, 0}, {8, 3, 3}), 8, 2);
    HeldBody body = held_at_one_end(smaller_at_a_corner(built, 2));
    Prepared p(body);
    const std::vector<int> sizes = p.multigrid.sizes();
    ASSERT_GT(sizes.size(), 2u);
    EXPECT_GT(sizes[1], 0.8 * sizes[0]);
    expect_symmetric_and_definite(p);
}

/// Cells that wait for small ones to grow to their size cost little meanwhile: on each
/// level their vectors alone, less than a fifth of what smoothed cells cost. A smoothed
/// one has some seven blocks, of 64 bytes each, 144 bytes of an inverse, and its vectors.
TEST(RigidMultigrid, costs_hardly_more_where_few_cells_are_small)
{
    const support::Built built =
        support::built(support::box_shape({0, 0, 0}, {32, 8, 8}), 32, 2);
    HeldBody alike = held_at_one_end(smaller_at_a_corner(built, 0)),
             mixed = held_at_one_end(smaller_at_a_corner(built, 2));
    Prepared of_alike(alike), of_mixed(mixed);
    ASSERT_EQ(of_mixed.multigrid.sizes().size(), of_alike.multigrid.sizes().size() + 2);
    EXPECT_LT(of_mixed.multigrid.bytes(), 1.35 * of_alike.multigrid.bytes());
    EXPECT_LT(of_mixed.multigrid.bytes(),
              1150.0 * static_cast<double>(mixed.cells.size()));
    EXPECT_LE(of_mixed.steps(), of_alike.steps() + 3);
}

TEST(RigidMultigrid, solves_for_few_cells_exactly)
{
    HeldBody body = held_at_one_end(support::bar(8, 3, 2).cells);
    Prepared p(body);
    ASSERT_EQ(p.multigrid.sizes(), std::vector<int>{42});
    EXPECT_LE(p.steps(), 2);
}

TEST(RigidMultigrid, made_at_rest_serves_a_body_that_was_turned)
{
    // In the cells' own axes nothing changes.
    HeldBody body = bar_of_length(8);
    Prepared p(body);
    const int at_rest = p.steps();
    std::mt19937 rng(1);
    const Motion motion{support::random_rotation(rng), support::random_vector(rng, 9.0)};
    std::vector<Pose> poses;
    for (const Cell& cell : body.cells.cells)
        poses.push_back(carried(motion, cell.centre));
    p.energy.state.set_poses(poses);
    p.energy.total.linearise(kExact);
    EXPECT_NEAR(p.steps(), at_rest, 1);
}

TEST(RigidMultigrid, made_at_rest_serves_a_body_that_was_twisted_by_half_a_turn)
{
    for (const int n : {4, 8, 16})
    {
        HeldBody body = bar_of_length(n);
        body.prescribe([&](const Cell& cell) { return cell.centre.x() > 4 * n - 1; });
        Prepared p(body);
        p.energy.state.set_poses(twisted(body, std::numbers::pi));
        // Where the energy is least, for elsewhere it may curve down.
        NewtonSolver newton(p.energy.total, p.multigrid);
        EXPECT_EQ(newton.minimize({}).stop, Stop::Converged);
        for (const Curvature curvature : {kExact, kGaussNewton})
        {
            p.energy.total.linearise(curvature);
            EXPECT_LE(p.steps(), 35);
        }
        p.energy.total.linearise(kExact);
        RecordProperty("steps_" + std::to_string(4 * n * n * n), p.steps());
    }
}

TEST(RigidMultigrid, bears_stiff_and_soft_parts)
{
    // A layer, a ball and a core, none in step with the groups of 2 x 2 x 2.
    const Cells cells = support::bar(24, 6, 6).cells;
    for (const double factor : {1e-8, 1e-4, 1e4, 1e8})
    {
        std::vector<double> layer, ball, core;
        for (const Cell& cell : cells.cells)
        {
            const Eigen::Vector3d d = cell.centre - Eigen::Vector3d(12, 3, 3);
            const bool is_in_core = std::abs(d.x()) < 9 && std::abs(d.y() + 0.5) < 1.5 &&
                                    std::abs(d.z() + 0.5) < 1.5;
            layer.push_back(std::abs(d.x()) < 3.5 ? factor : 1.0);
            ball.push_back(d.norm() < 2.6 ? factor : 1.0);
            core.push_back(is_in_core ? factor : 1.0);
        }
        for (const std::vector<double>& factors : {layer, ball, core})
            EXPECT_LE(steps_at_rest(held_at_one_end(cells, factors)), 22) << factor;
    }
}

TEST(RigidMultigrid, bears_glue_that_differs_from_face_to_face)
{
    for (const auto& [orders, most] : {std::pair(1.0, 25), {2.0, 60}})
    {
        HeldBody body = bar_of_length(6);
        std::mt19937 rng(1);
        for (GlueFace& face : body.glue.faces)
            face.stiffness *=
                std::pow(10.0, support::random_number(rng, -orders, orders));
        EXPECT_LE(steps_at_rest(body), most);
    }
}

TEST(RigidMultigrid, serves_pinned_cells_and_what_turns_about_one_pin)
{
    const Cells cells = support::bar(16, 4, 4).cells;
    HeldBody between = held_at_one_end(cells);
    int pins = 0;
    for (std::size_t i = 1; i < cells.size(); i += 17)
        if (between.constraints[i].hold == Hold::Free && ++pins)
            between.pin(i, cells.cells[i].centre + Eigen::Vector3d(0, 0.5, 0.5));
    EXPECT_GT(pins, 10);
    EXPECT_LE(steps_at_rest(between), 15);
    HeldBody on_one(cells);
    on_one.pin(0, {0, 0, 0});
    EXPECT_LE(steps_at_rest(on_one), 20);
    HeldBody on_three(cells);
    on_three.pin(0, {0, 0, 0});
    on_three.pin(9, {0, 4, 0});
    on_three.pin(250, {16, 4, 4});
    EXPECT_LE(steps_at_rest(on_three), 20);
}

TEST(RigidMultigrid, serves_cells_that_slide_along_curves)
{
    // A row of places of the top slides along curves: as many steps as if it were held.
    const auto body = [](bool slides, const std::vector<support::Helix>& rails)
    {
        HeldBody of(support::bar(20, 6, 6).cells);
        of.prescribe([](const Cell& cell) { return cell.centre.x() < 1.0; });
        std::size_t k = 0;
        for (std::size_t i = 0; i < of.cells.size(); ++i)
        {
            const Eigen::Vector3d& c = of.cells.cells[i].centre;
            if (c.z() < 5.0 || c.y() < 5.0 || c.x() < 1.0)
                continue;
            const Eigen::Vector3d place = c + Eigen::Vector3d(0.2, -0.1, 0.5);
            if (!slides)
                of.pin(i, place);
            else if (k < rails.size())
                of.slide(i, place, rails[k], 0.3);
            ++k;
        }
        return of;
    };
    std::vector<support::Helix> rails(19);
    for (std::size_t k = 0; k < rails.size(); ++k)
    {
        rails[k].radius = 0.5 + 0.1 * static_cast<double>(k % 5);
        rails[k].pitch = 1.0;
        rails[k].shift = Eigen::Vector3d(static_cast<double>(k), 5, 6);
    }
    HeldBody held = body(false, rails), sliding = body(true, rails);
    const int of_held = Prepared(held).steps();
    Prepared prepared(sliding);
    // In a state where the curves are what they are.
    prepared.energy.state.set_held_points(sliding.constraints);
    prepared.energy.total.linearise(kGaussNewton);
    prepared.multigrid = RigidMultigrid(
        prepared.energy.total, prepared.energy.bodies(grid_places(sliding.cells)));
    const int of_sliding = prepared.steps();
    EXPECT_LE(of_sliding, 1.5 * of_held);
    RecordProperty("held", of_held);
    RecordProperty("sliding", of_sliding);
}

TEST(RigidMultigrid, serves_components_held_in_different_ways)
{
    // The first by prescribed cells, the second by nothing, the third by one pin.
    const auto box_at = [](double y) {
        return support::box_shape({0, y, 0}, {16, y + 4, 4});
    };
    HeldBody body(
        support::built(support::joined(support::joined(box_at(0), box_at(8)), box_at(16)),
                       20)
            .cells);
    std::size_t pinned = body.cells.size();
    for (std::size_t i = 0; i < body.cells.size(); ++i)
        if (body.cells.cells[i].centre.y() > 14)
            pinned = i;
    body.pin(pinned, body.cells.cells[pinned].centre);
    body.prescribe([](const Cell& cell)
                   { return cell.centre.x() < 1 && cell.centre.y() < 6; });
    Prepared p(body);
    ASSERT_EQ(body.components.size(), 3u);
    EXPECT_FALSE(body.components[1].is_held);
    EXPECT_EQ(body.components[2].free_rotations, 3);
    EXPECT_LE(p.steps(), 20);
}

TEST(RigidMultigrid, serves_every_shape)
{
    EXPECT_LE(steps_at_rest(held_at_one_end(support::bar(13, 5, 3).cells)), 15);
    // Bending: rods and plates are soft in a way that small groups do not have, and what
    // is a cell wide has nothing across its faces.
    EXPECT_LE(steps_at_rest(held_at_one_end(support::bar(40, 1, 1).cells)), 3);
    EXPECT_LE(steps_at_rest(held_at_one_end(support::bar(200, 1, 1).cells)), 50);
    HeldBody upright(support::bar(1, 1, 40).cells);
    upright.prescribe([](const Cell& cell) { return cell.centre.z() < 1; });
    EXPECT_LE(steps_at_rest(upright), 3);
    EXPECT_LE(steps_at_rest(held_at_one_end(support::bar(40, 40, 1).cells)), 66);
    EXPECT_LE(steps_at_rest(held_at_one_end(fork())), 40);
    EXPECT_LE(
        steps_at_rest(held_at_one_end(support::built(crossed_boxes(), 17, 1).cells)), 40);
}

TEST(RigidMultigrid, serves_cells_of_different_sizes)
{
    const Cells cells = graded_cells();
    double least = INFINITY, most = 0.0;
    for (const Cell& cell : cells.cells)
    {
        least = std::min(least, cell.edge);
        most = std::max(most, cell.edge);
    }
    ASSERT_NEAR(most, 4.0 * least, 1e-9);
    EXPECT_LE(steps_at_rest(held_at_one_end(cells)), 22);
}

TEST(RigidMultigrid, takes_residuals_of_any_size)
{
    HeldBody body = bar_of_length(4);
    Prepared p(body);
    const Eigen::VectorXd r = random_numbers(p.count, 1);
    const Eigen::VectorXd z = p.applied(r);
    for (const double size : {1e-200, 1e-30, 1e30, 1e200})
        EXPECT_LT((p.applied(size * r) / size - z).norm(), 1e-5 * z.norm()) << size;
    EXPECT_EQ(p.applied(0.0 * r), 0.0 * r);
    const double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_FALSE(p.applied(nan * r).allFinite());
    EXPECT_EQ(p.applied(r), z);
}

TEST(RigidMultigrid, of_no_unknown_cell_does_nothing)
{
    HeldBody body(support::bar(3, 1, 1).cells);
    body.prescribe([](const Cell&) { return true; });
    Prepared p(body);
    EXPECT_EQ(p.count, 0);
    EXPECT_TRUE(p.multigrid.sizes().empty());
    EXPECT_EQ(p.multigrid.bytes(), 0.0);
    EXPECT_EQ(p.applied(Eigen::VectorXd(0)).size(), 0);
}

TEST(RigidMultigrid, memory_is_linear_in_the_cells_and_within_its_estimate)
{
    double few = 0.0;
    for (const int n : {4, 8, 16})
    {
        HeldBody body = bar_of_length(n);
        Prepared p(body);
        const double bytes = p.multigrid.bytes();
        const double a_cell = bytes / static_cast<double>(body.cells.size());
        few = few == 0.0 ? a_cell : few;
        EXPECT_LT(a_cell, 1.5 * few);
        EXPECT_LT(bytes, RigidMultigrid::memory_estimate(body.cells.size(),
                                                         body.cells.faces.size()));
    }
    for (const Cells& cells : {support::bar(40, 1, 1).cells,
                               support::bar(40, 40, 1).cells, fork(), graded_cells()})
    {
        HeldBody body = held_at_one_end(cells);
        Prepared p(body);
        EXPECT_LT(p.multigrid.bytes(),
                  RigidMultigrid::memory_estimate(cells.size(), cells.faces.size()));
    }
}

TEST(RigidMultigrid, is_built_within_its_estimate)
{
    for (const Cells& cells :
         {support::bar(64, 16, 16).cells, support::bar(32, 8, 8).cells,
          support::bar(100, 100, 1).cells, support::bar(1000, 1, 1).cells,
          support::bar(400, 2, 1).cells, graded_cells()})
    {
        HeldBody body = held_at_one_end(cells);
        CellEnergy energy = body.energy();
        energy.total.linearise(kGaussNewton);
        const std::vector<UnknownBody> bodies = energy.bodies(grid_places(body.cells));
        const support::MostMemory most;
        const RigidMultigrid multigrid(energy.total, bodies);
        const double bytes = static_cast<double>(most.bytes());
        EXPECT_LT(multigrid.bytes(), bytes);
        const double estimate =
            RigidMultigrid::memory_estimate(cells.size(), cells.faces.size());
        EXPECT_LT(bytes, estimate);
        EXPECT_LT(estimate, 3.0 * bytes);
    }
}

TEST(RigidMultigrid, allocates_nothing_in_a_cycle)
{
    // By operator new; the buffers of Eigen and of the sparse library, which come from
    // malloc, are not seen here.
    HeldBody body = bar_of_length(8);
    Prepared p(body);
    const Eigen::VectorXd r = random_numbers(p.count, 1);
    Eigen::VectorXd z;
    p.multigrid.apply(r, z);
    const std::size_t before = support::num_allocations();
    for (int cycle = 0; cycle < 10; ++cycle)
        p.multigrid.apply(r, z);
    EXPECT_EQ(support::num_allocations(), before);
    EXPECT_GT(before, 0u);
}

TEST(RigidMultigrid, threads_do_not_change_a_bit)
{
    HeldBody body = bar_of_length(8);
    Eigen::VectorXd first;
    for (const int threads : {1, 2, 4})
    {
        const ThreadLimit limit(threads);
        Prepared p(body);
        const Eigen::VectorXd z = p.applied(random_numbers(p.count, 1));
        if (first.size() == 0)
            first = z;
        EXPECT_EQ(z, first);
    }
}

} // namespace cellwarp::core
