// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/cells/initial_guess.h"

#include <cmath>
#include <numbers>
#include <numeric>

#include <gtest/gtest.h>

#include "octree/base/index.h"
#include "solver/cells/cell_minimizer.h"
#include "tests/support/held_body.h"
#include "tests/support/random.h"
#include "tests/support/random_poses.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

using support::HeldBody;

namespace
{

/// Shares are a guess: they are found no better than this.
constexpr double kShareError = 0.01;

/// A bar along x that region 0 holds at its beginning and region 1 at its end.
struct Bar
{
    HeldBody body;
    std::vector<int> region_of_cell, free_cells, all_cells;

    Bar(int nx, int ny, int nz, int layers = 1) : body(support::bar(nx, ny, nz).cells)
    {
        for (std::size_t i = 0; i < body.cells.size(); ++i)
        {
            const double x = body.cells.cells[i].centre.x();
            const int region = x < layers ? 0 : x > nx - layers ? 1 : -1;
            region_of_cell.push_back(region);
            body.constraints[i].hold = region >= 0 ? Hold::Prescribed : Hold::Free;
            if (region < 0)
                free_cells.push_back(static_cast<int>(i));
            all_cells.push_back(static_cast<int>(i));
        }
        body.components = find_components(body.cells, body.constraints);
    }
    InitialGuess spread() const
    {
        return {body.cells, body.glue, body.constraints,
                std::vector<Driving>(region_of_cell.begin(), region_of_cell.end()), 2};
    }
    const Cell& cell(int i) const { return body.cells.cells[idx(i)]; }
};

Motion turn_about_axis(double angle, const Eigen::Vector3d& centre)
{
    const Eigen::Matrix3d R = rotation_about(Eigen::Vector3d::UnitX(), angle);
    return {R, centre - R * centre};
}

} // namespace

TEST(InitialGuess, shares_are_whole_in_their_regions_and_linear_between)
{
    const Bar bar(32, 3, 3);
    const InitialGuess spread = bar.spread();
    for (const int i : bar.all_cells)
    {
        const double first = spread.share(i, 0), second = spread.share(i, 1);
        if (bar.region_of_cell[idx(i)] == 0)
        {
            EXPECT_EQ(first, 1.0);
            EXPECT_EQ(second, 0.0);
            continue;
        }
        if (bar.region_of_cell[idx(i)] == 1)
        {
            EXPECT_EQ(first, 0.0);
            EXPECT_EQ(second, 1.0);
            continue;
        }
        EXPECT_NEAR(first + second, 1.0, kShareError);
        EXPECT_NEAR(second, (bar.cell(i).centre.x() - 0.5) / 31.0, kShareError);
    }
}

TEST(InitialGuess, shares_are_harmonic_where_glue_is_not_even)
{
    // Stiff glue lets little of a difference pass: shares change where it is soft.
    Bar bar(12, 1, 1);
    std::vector<double> factors(12, 100.0);
    bar.body.glue = build_glue(bar.body.cells, factors);
    for (GlueFace& face : bar.body.glue.faces)
        if (std::abs(bar.cell(face.a).centre.x() - 6.0) < 1.0 &&
            std::abs(bar.cell(face.b).centre.x() - 6.0) < 1.0)
            face.stiffness = 1.0;
    const InitialGuess spread = bar.spread();
    for (const int i : bar.free_cells)
    {
        const bool is_first_half = bar.cell(i).centre.x() < 6.0;
        EXPECT_NEAR(spread.share(i, is_first_half ? 0 : 1), 1.0, 0.1);
    }
}

TEST(InitialGuess, equal_steps_are_made_exactly)
{
    const Bar bar(16, 3, 3);
    std::mt19937 rng(1);
    const Motion step{support::random_rotation(rng), support::random_vector(rng, 5.0)};
    std::vector<Pose> poses;
    for (const int i : bar.all_cells)
        poses.push_back(support::random_pose(rng, static_cast<double>(i)));
    const std::vector<Pose> before = poses;
    bar.spread().carry(std::vector{step, step}, bar.free_cells, poses);
    for (const int cell : bar.all_cells)
    {
        const std::size_t i = idx(cell);
        const bool is_free = bar.region_of_cell[i] < 0;
        EXPECT_EQ(poses[i].R, is_free ? step.R * before[i].R : before[i].R);
        EXPECT_EQ(poses[i].p, is_free ? step(before[i].p) : before[i].p);
    }
}

TEST(InitialGuess, a_turned_end_gives_the_linear_twist)
{
    const Bar bar(32, 3, 3);
    const double angle = std::numbers::pi / 4;
    std::vector<Pose> poses = bar.body.rest();
    const Eigen::Vector3d centre(32.0, 1.5, 1.5);
    bar.spread().carry(std::vector{Motion(), turn_about_axis(angle, centre)},
                       bar.free_cells, poses);
    for (const int i : bar.free_cells)
    {
        const Eigen::Vector3d& rest = bar.cell(i).centre;
        const double share = (rest.x() - 0.5) / 31.0;
        const Pose wanted = carried(turn_about_axis(share * angle, centre), rest);
        const Pose& found = poses[idx(i)];
        EXPECT_LT((found.R - wanted.R).norm(), 0.03);
        EXPECT_LT((found.p - wanted.p).norm(), 0.03);
        EXPECT_NEAR(found.R.determinant(), 1.0, 1e-12);
    }
}

TEST(InitialGuess, half_turns_and_their_opposites_are_blended_along_the_short_way)
{
    // q and -q are one rotation: added as they come they would cancel.
    const Bar bar(9, 1, 1);
    const Eigen::Vector3d centre(0.0, 0.5, 0.5);
    std::vector<Pose> poses = bar.body.rest();
    const double most = 0.9 * std::numbers::pi;
    bar.spread().carry(
        std::vector{turn_about_axis(-most, centre), turn_about_axis(most, centre)},
        bar.free_cells, poses);
    for (const int i : bar.free_cells)
        if (std::abs(bar.cell(i).centre.x() - 4.5) < 0.1)
        {
            const Pose& middle = poses[idx(i)];
            EXPECT_LT(rotation_vector(middle.R).norm(), 0.2);
            EXPECT_LT((middle.p - bar.cell(i).centre).norm(), 1e-12);
        }
}

TEST(InitialGuess, a_component_follows_the_one_region_that_holds_it)
{
    // Of three boxes the first is held at both ends, the second pinned by another region
    // alone, and nothing holds the third.
    HeldBody body(
        support::built(
            support::joined(support::joined(support::box_shape({0, 0, 0}, {6, 1, 1}, 1),
                                            support::box_shape({0, 4, 0}, {6, 5, 1}, 1)),
                            support::box_shape({0, 8, 0}, {6, 9, 1}, 1)),
            9)
            .cells);
    const std::size_t n = body.cells.size();
    std::vector<int> region_of_cell(n, -1), all_cells(n);
    std::iota(all_cells.begin(), all_cells.end(), 0);
    for (std::size_t i = 0; i < n; ++i)
    {
        const Eigen::Vector3d& c = body.cells.cells[i].centre;
        if (c.y() < 2 && (c.x() < 1 || c.x() > 5))
        {
            body.constraints[i].hold = Hold::Prescribed;
            region_of_cell[i] = c.x() < 1 ? 0 : 1;
        }
        else if (c.y() > 2 && c.y() < 6 && c.x() < 1)
        {
            body.pin(i, c);
            region_of_cell[i] = 2;
        }
    }
    ASSERT_EQ(find_components(body.cells, body.constraints).size(), 3u);
    const InitialGuess spread(
        body.cells, body.glue, body.constraints,
        std::vector<Driving>(region_of_cell.begin(), region_of_cell.end()), 3);
    std::mt19937 rng(2);
    std::vector<Motion> steps(3);
    for (Motion& step : steps)
        step = {
            rotation_about(Eigen::Vector3d::UnitZ(), support::random_number(rng, -1, 1)),
            support::random_vector(rng, 3.0)};
    std::vector<Pose> poses = body.rest();
    spread.carry(steps, all_cells, poses);
    for (std::size_t i = 0; i < n; ++i)
    {
        const Eigen::Vector3d& c = body.cells.cells[i].centre;
        const int cell = static_cast<int>(i);
        EXPECT_EQ(spread.share(cell, 2) > 0.0, c.y() > 2 && c.y() < 6);
        EXPECT_EQ(spread.share(cell, 0) + spread.share(cell, 1) > 0.0, c.y() < 2);
        const Motion step = c.y() > 6 ? Motion() : steps[2];
        if (c.y() > 2)
        {
            EXPECT_EQ(poses[i].R, step.R);
            EXPECT_EQ(poses[i].p, step(c));
        }
        else
        {
            EXPECT_NE(poses[i].p, c);
        }
    }
}

TEST(InitialGuess, regions_without_cells_and_bodies_without_regions_do_no_harm)
{
    HeldBody body(support::bar(4, 1, 1).cells);
    find_components(body.cells, body.constraints);
    const std::vector<Driving> driving(4);
    const std::vector<int> all_cells = {0, 1, 2, 3};
    for (const int regions : {0, 2})
    {
        const InitialGuess spread(body.cells, body.glue, body.constraints, driving,
                                  regions);
        std::vector<Pose> poses = body.rest();
        spread.carry(std::vector<Motion>(idx(regions)), all_cells, poses);
        for (std::size_t i = 0; i < 4; ++i)
            EXPECT_EQ(poses[i].p, body.cells.cells[i].centre);
        EXPECT_EQ(spread.share(0, 0), 0.0);
    }
}

TEST(InitialGuess, newton_then_takes_as_many_iterations_for_many_cells_as_for_few)
{
    for (const int n : {1, 4})
    {
        const Bar bar(16 * n, 4 * n, 4 * n, n);
        const Motion step =
            turn_about_axis(std::numbers::pi / 4, Eigen::Vector3d(16, 2, 2) * n);
        std::vector<Pose> poses = bar.body.rest();
        for (const int i : bar.all_cells)
            if (bar.region_of_cell[idx(i)] == 1)
                poses[idx(i)] = carried(step, bar.cell(i).centre);
        bar.spread().carry(std::vector{Motion(), step}, bar.free_cells, poses);
        CellMinimizer minimizer(bar.body.cells, bar.body.glue, bar.body.constraints,
                                bar.body.components);
        const SolveReport report = minimizer.minimize(poses, {});
        EXPECT_EQ(report.stop, Stop::Converged);
        EXPECT_LE(report.iterations, 6);
        RecordProperty("iterations_" + std::to_string(bar.all_cells.size()),
                       report.iterations);
        RecordProperty("steps_" + std::to_string(bar.all_cells.size()),
                       report.linear_steps);
    }
}

} // namespace cellwarp::core
