// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/cells/cell_minimizer.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "octree/base/parallel.h"
#include "octree/base/stop_scope.h"
#include "tests/support/held_body.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

using support::Built;

namespace
{

/// A bar along x whose ends are prescribed: the first layers of cells rest, the
/// last ones make a motion.
struct Problem
{
    Built bar;
    Glue glue;
    std::vector<Constraint> constraints;
    std::vector<Component> components;
    std::vector<Pose> poses;

    Problem(int nx, int ny, int nz, const Motion& motion, int layers = 1)
        : bar(support::bar(nx, ny, nz)), glue(build_glue(bar.cells, {}))
    {
        for (const Cell& cell : bar.cells.cells)
        {
            Constraint constraint;
            const bool is_last = cell.centre.x() > nx - layers;
            if (is_last || cell.centre.x() < layers)
                constraint.hold = Hold::Prescribed;
            constraints.push_back(constraint);
            poses.push_back(carried(is_last ? motion : Motion(), cell.centre));
        }
        components = find_components(bar.cells, constraints);
    }
    CellMinimizer minimizer() const { return {bar.cells, glue, constraints, components}; }
};

Motion turned_end(double angle, int nx, int ny, int nz)
{
    const Eigen::Vector3d centre(nx, 0.5 * ny, 0.5 * nz);
    const Eigen::Matrix3d R = rotation_about(Eigen::Vector3d::UnitX(), angle);
    return {R, centre - R * centre};
}

} // namespace

TEST(CellMinimizer, at_rest_there_is_nothing_to_do)
{
    Problem p(6, 2, 2, Motion());
    CellMinimizer minimizer = p.minimizer();
    const SolveReport report = minimizer.minimize(p.poses, {});
    EXPECT_EQ(report.stop, Stop::Converged);
    EXPECT_EQ(report.iterations, 0);
    EXPECT_LT(report.energy_after, 1e-28);
}

TEST(CellMinimizer, all_methods_find_the_same_twist)
{
    const Motion motion = turned_end(1.5, 12, 3, 3);
    std::vector<Pose> first;
    for (const Method method :
         {Method::GaussNewtonDirect, Method::GaussNewton, Method::Newton})
    {
        Problem p(12, 3, 3, motion);
        CellMinimizer minimizer = p.minimizer();
        const SolveReport report = minimizer.minimize(
            p.poses,
            {.method = method, .max_iterations = 200, .gradient_tolerance = 1e-10});
        EXPECT_EQ(report.stop, Stop::Converged);
        EXPECT_LE(report.gradient, 1e-10);
        EXPECT_LT(report.energy_after, report.energy_before);
        // Above 0: it was measured.
        EXPECT_EQ(report.backward_error > 0, method == Method::GaussNewtonDirect);
        EXPECT_LE(report.backward_error, 1e-13);
        if (first.empty())
            first = p.poses;
        for (std::size_t i = 0; i < first.size(); ++i)
        {
            EXPECT_LT((p.poses[i].p - first[i].p).norm(), 1e-8);
            EXPECT_LT((p.poses[i].R - first[i].R).norm(), 1e-8);
        }
    }
}

TEST(CellMinimizer, the_minimum_has_no_gradient_by_finite_differences)
{
    Problem p(8, 2, 2, turned_end(1.0, 8, 2, 2));
    CellMinimizer minimizer = p.minimizer();
    minimizer.minimize(p.poses, {.gradient_tolerance = 1e-10});
    const double least = glue_energy(p.glue, p.poses);
    std::mt19937 rng(1);
    for (int trial = 0; trial < 30; ++trial)
    {
        std::vector<Pose> near = p.poses;
        for (std::size_t i = 0; i < near.size(); ++i)
            if (p.constraints[i].hold == Hold::Free)
            {
                Twist twist;
                twist << support::random_vector(rng, 1e-3),
                    support::random_vector(rng, 1e-3);
                near[i] = moved(near[i], twist);
            }
        EXPECT_GT(glue_energy(p.glue, near), least);
    }
}

TEST(CellMinimizer, energy_never_rises)
{
    Problem p(16, 3, 3, turned_end(std::numbers::pi, 16, 3, 3));
    CellMinimizer minimizer = p.minimizer();
    double energy = glue_energy(p.glue, p.poses);
    for (int iteration = 0; iteration < 40; ++iteration)
    {
        const SolveReport report = minimizer.minimize(p.poses, {.max_iterations = 1});
        EXPECT_LE(report.energy_after, energy * (1 + 1e-12));
        energy = report.energy_after;
    }
}

TEST(CellMinimizer, every_stop_has_its_reason)
{
    const Motion motion = turned_end(2.0, 8, 2, 2);
    {
        Problem p(8, 2, 2, motion);
        const std::vector<Pose> before = p.poses;
        CellMinimizer minimizer = p.minimizer();
        const SolveReport report = minimizer.minimize(p.poses, {.max_iterations = 0});
        EXPECT_EQ(report.stop, Stop::IterationLimit);
        EXPECT_EQ(report.energy_after, report.energy_before);
    }
    {
        Problem p(8, 2, 2, motion);
        CellMinimizer minimizer = p.minimizer();
        EXPECT_EQ(minimizer.minimize(p.poses, {.time_budget = 1e-12}).stop,
                  Stop::TimeLimit);
    }
    {
        Problem p(8, 2, 2, motion);
        CellMinimizer minimizer = p.minimizer();
        std::stop_source source;
        source.request_stop();
        {
            const StopOnRequest scope(source.get_token());
            EXPECT_EQ(minimizer.minimize(p.poses, {}).stop, Stop::Stopped);
        }
        EXPECT_EQ(minimizer.minimize(p.poses, {}).stop, Stop::Converged);
    }
    {
        // A tolerance of zero ends where rounding does, not at the limit.
        Problem p(8, 2, 2, motion);
        CellMinimizer minimizer = p.minimizer();
        const SolveReport report = minimizer.minimize(
            p.poses, {.max_iterations = 500, .gradient_tolerance = 0.0});
        EXPECT_EQ(report.stop, Stop::Converged);
        EXPECT_LT(report.iterations, 100);
    }
    EXPECT_EQ(SolveReport().stop, Stop::NotRun);
    EXPECT_EQ(stop_name(Stop::IterationLimit), "iteration limit");
}

TEST(CellMinimizer, a_stiff_part_turns_as_one_and_hides_nothing)
{
    // Half-way along the bar the glue is stiffer or softer, by up to 1e8; by 1e16 the
    // digits are gone, but no state may pass for a solution.
    for (const double factor : {1e-16, 1e-8, 1e8, 1e16})
        for (const Method method : {Method::GaussNewton, Method::Newton})
        {
            Problem p(12, 3, 3, turned_end(1.0, 12, 3, 3));
            std::vector<double> factors;
            for (const Cell& cell : p.bar.cells.cells)
                factors.push_back(std::abs(cell.centre.x() - 6.0) < 1.5 ? factor : 1.0);
            p.glue = build_glue(p.bar.cells, factors);
            CellMinimizer minimizer = p.minimizer();
            const SolveReport report =
                minimizer.minimize(p.poses, {.method = method, .max_iterations = 100});
            EXPECT_GT(report.iterations, 0);
            EXPECT_LE(report.energy_after, report.energy_before);
            if (factor <= 1e8)
            {
                EXPECT_EQ(report.stop, Stop::Converged) << factor;
                EXPECT_LE(report.iterations, 12) << factor;
            }
        }
}

TEST(CellMinimizer, threads_do_not_change_a_bit)
{
    std::vector<Pose> first;
    for (const int threads : {1, 2, 4})
    {
        const ThreadLimit limit(threads);
        Problem p(12, 4, 4, turned_end(2.0, 12, 4, 4));
        CellMinimizer minimizer = p.minimizer();
        minimizer.minimize(p.poses, {});
        if (first.empty())
            first = p.poses;
        for (std::size_t i = 0; i < first.size(); ++i)
        {
            ASSERT_EQ(p.poses[i].p, first[i].p);
            ASSERT_EQ(p.poses[i].R, first[i].R);
        }
    }
}

TEST(CellMinimizer, the_prototype_cases_take_the_prototypes_iterations)
{
    // 2,048 cells, both ends clamped two layers deep, one turned, in one jump: the
    // prototype took 15 Gauss-Newton and 10 Newton iterations to 1e-9 of energy, with all
    // second moments; without those across the faces Newton's method takes two more.
    const Motion motion = turned_end(0.75 * std::numbers::pi, 32, 8, 8);
    for (const auto& [method, most] :
         {std::pair(Method::GaussNewton, 20), {Method::Newton, 16}})
    {
        Problem p(32, 8, 8, motion, 2);
        CellMinimizer minimizer = p.minimizer();
        const SolveReport report = minimizer.minimize(p.poses, {.method = method});
        EXPECT_EQ(report.stop, Stop::Converged);
        EXPECT_LE(report.iterations, most);
        RecordProperty(method == Method::Newton ? "newton" : "gauss_newton",
                       report.iterations);
    }
}

TEST(CellMinimizer, a_pinned_cell_stays_at_its_point_and_turns)
{
    Problem p(8, 1, 1, Motion());
    for (std::size_t i = 0; i < p.constraints.size(); ++i)
        if (p.bar.cells.cells[i].centre.x() > 7)
        {
            p.constraints[i].hold = Hold::Pinned;
            p.constraints[i].held_rest = {8.0, 0.5, 0.5};
            p.constraints[i].held_now = {6.0, 0.5, 4.0};
            p.poses[i] =
                held_at_pin(p.poses[i], p.constraints[i], p.bar.cells.cells[i].centre);
        }
    p.components = find_components(p.bar.cells, p.constraints);
    std::vector<double> energies;
    for (const Method method : {Method::GaussNewton, Method::Newton})
    {
        std::vector<Pose> poses = p.poses;
        CellMinimizer minimizer = p.minimizer();
        const SolveReport report = minimizer.minimize(
            poses, {.method = method, .max_iterations = 300, .gradient_tolerance = 1e-9});
        EXPECT_EQ(report.stop, Stop::Converged);
        energies.push_back(report.energy_after);
        for (std::size_t i = 0; i < poses.size(); ++i)
            if (p.constraints[i].hold == Hold::Pinned)
            {
                EXPECT_LT((image(poses[i], p.bar.cells.cells[i].centre, {8.0, 0.5, 0.5}) -
                           Eigen::Vector3d(6.0, 0.5, 4.0))
                              .norm(),
                          1e-12);
                EXPECT_GT(rotation_vector(poses[i].R).norm(), 0.3);
            }
    }
    EXPECT_NEAR(energies[0], energies[1], 1e-9 * energies[0]);
}

TEST(CellMinimizer, a_cell_on_a_curve_slides_until_nothing_pulls_along_it)
{
    // Straight across the bar's end, askew: from the first place it is drawn back along
    // the line to where the bar is least strained.
    struct Askew final : Rail
    {
        RailPlace at(double s) const override
        {
            const Eigen::Vector3d d(0.6, 0.0, 0.8);
            return {Eigen::Vector3d(7.0, 0.5, 2.0) + s * d, d, Eigen::Vector3d::Zero()};
        }
        double begin() const override { return -9.0; }
        double end() const override { return 9.0; }
        bool is_closed() const override { return false; }
    } askew;
    Problem p(8, 1, 1, Motion());
    std::size_t last = 0;
    for (std::size_t i = 0; i < p.constraints.size(); ++i)
        if (p.bar.cells.cells[i].centre.x() > 7)
            last = i;
    const Eigen::Vector3d point(8.0, 0.5, 0.5);
    p.constraints[last] = {Hold::Sliding, point, askew.at(0.0).place, &askew, 0.0};
    p.poses[last] =
        held_at_pin(p.poses[last], p.constraints[last], p.bar.cells.cells[last].centre);
    p.components = find_components(p.bar.cells, p.constraints);
    std::vector<double> energies;
    for (const Method method : {Method::GaussNewton, Method::Newton})
    {
        std::vector<Pose> poses = p.poses;
        CellMinimizer minimizer = p.minimizer();
        const SolveReport report = minimizer.minimize(
            poses,
            {.method = method, .max_iterations = 300, .gradient_tolerance = 1e-10});
        EXPECT_EQ(report.stop, Stop::Converged);
        EXPECT_FALSE(report.is_saddle);
        energies.push_back(report.energy_after);
        const Eigen::Vector3d place =
            image(poses[last], p.bar.cells.cells[last].centre, point);
        EXPECT_LT((place - askew.at(minimizer.constraint(int(last)).s).place).norm(),
                  1e-12);
        // No other place of the line is better: held there the energy is larger.
        for (const double away : {-0.2, 0.2})
        {
            Problem held = p;
            Constraint& constraint = held.constraints[last];
            constraint.hold = Hold::Pinned;
            constraint.held_now =
                askew.at(minimizer.constraint(int(last)).s + away).place;
            held.poses[last] = held_at_pin(held.poses[last], constraint,
                                           held.bar.cells.cells[last].centre);
            held.components = find_components(held.bar.cells, held.constraints);
            CellMinimizer other = held.minimizer();
            EXPECT_GT(other.minimize(held.poses, {.max_iterations = 300}).energy_after,
                      report.energy_after);
        }
    }
    EXPECT_NEAR(energies[0], energies[1], 1e-9 * energies[0]);
}

TEST(CellMinimizer, one_pin_alone_carries_its_component_along)
{
    Problem p(4, 1, 1, Motion());
    for (Constraint& constraint : p.constraints)
        constraint.hold = Hold::Free;
    p.constraints[0].hold = Hold::Pinned;
    p.constraints[0].held_rest = {0, 0.5, 0.5};
    p.constraints[0].held_now = {0, 2.5, 0.5};
    p.components = find_components(p.bar.cells, p.constraints);
    ASSERT_EQ(p.components.size(), 1u);
    EXPECT_EQ(p.components[0].free_rotations, 3);
    p.poses[0] = held_at_pin(p.poses[0], p.constraints[0], p.bar.cells.cells[0].centre);
    CellMinimizer minimizer = p.minimizer();
    const SolveReport report = minimizer.minimize(p.poses, {.gradient_tolerance = 1e-9});
    EXPECT_EQ(report.stop, Stop::Converged);
    EXPECT_LT(report.energy_after, 1e-12);
}

TEST(Constraints, count_the_rotations_that_pins_leave_free)
{
    const Built bar = support::bar(3, 3, 1);
    const auto rotations = [&](const std::vector<std::size_t>& pinned)
    {
        std::vector<Constraint> constraints(bar.cells.size());
        for (const std::size_t i : pinned)
        {
            constraints[i].hold = Hold::Pinned;
            constraints[i].held_rest = bar.cells.cells[i].centre;
        }
        return find_components(bar.cells, constraints)[0].free_rotations;
    };
    EXPECT_EQ(rotations({0}), 3);
    EXPECT_EQ(rotations({0, 1}), 1);
    EXPECT_EQ(rotations({0, 8}), 1);
    int none = 0;
    for (std::size_t third = 2; third < 9; ++third)
        none += rotations({0, 1, third}) == 0;
    EXPECT_GE(none, 6);
}

TEST(Constraints, a_group_joins_the_components_that_it_has_cells_in)
{
    const Built two =
        support::built(support::joined(support::box_shape({0, 0, 0}, {1, 1, 1}),
                                       support::box_shape({2, 0, 0}, {3, 1, 1})),
                       6);
    std::vector<Constraint> constraints(two.cells.size());
    constraints.front() = constraints.back() = {
        Hold::Grouped, {1.5, 0.5, 0.5}, {1.5, 0.5, 0.5}, nullptr, 0.0, 0};
    const std::vector<Component> components = find_components(two.cells, constraints);
    ASSERT_EQ(components.size(), 1u);
    EXPECT_TRUE(components[0].is_held);
    EXPECT_EQ(components[0].cells.size(), two.cells.size());
    EXPECT_EQ(components[0].free_rotations, 3);
}

TEST(Constraints, a_component_that_nothing_holds_is_idle)
{
    const Built two =
        support::built(support::joined(support::box_shape({0, 0, 0}, {1, 1, 1}),
                                       support::box_shape({2, 0, 0}, {3, 1, 1})),
                       3);
    std::vector<Constraint> constraints(two.cells.size());
    constraints[0].hold = Hold::Prescribed;
    const std::vector<Component> components = find_components(two.cells, constraints);
    ASSERT_EQ(components.size(), 2u);
    EXPECT_TRUE(components[0].is_held);
    EXPECT_FALSE(components[1].is_held);
    EXPECT_EQ(constraints.back().hold, Hold::Idle);
}

} // namespace cellwarp::core
