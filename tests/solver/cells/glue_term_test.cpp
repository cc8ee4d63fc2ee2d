// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/cells/glue_term.h"

#include <algorithm>
#include <numeric>
#include <tuple>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include "octree/base/parallel.h"
#include "tests/support/energy_checks.h"
#include "tests/support/held_body.h"
#include "tests/support/random.h"
#include "tests/support/random_poses.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

using support::HeldBody;
using support::Helix;
using support::random_vector;

namespace
{

bool is_in_first_layer(const Cell& cell)
{
    return cell.centre.x() < 1.0;
}

/// Every cell somewhere else and turned by some other rotation; pins are kept.
std::vector<Pose> random_poses(const HeldBody& body, std::mt19937& rng)
{
    std::vector<Pose> poses = body.rest();
    for (std::size_t i = 0; i < poses.size(); ++i)
    {
        poses[i] = {support::random_rotation(rng), poses[i].p + random_vector(rng, 0.5)};
        if (body.constraints[i].hold == Hold::Pinned ||
            body.constraints[i].hold == Hold::Sliding)
            poses[i] =
                held_at_pin(poses[i], body.constraints[i], body.cells.cells[i].centre);
    }
    return poses;
}

/// A small bar: one end prescribed, pins in two corners of the other.
HeldBody bar_with_pins()
{
    HeldBody body(support::bar(3, 2, 2).cells);
    body.prescribe(is_in_first_layer);
    std::size_t pins = 0;
    for (std::size_t i = 0; i < body.cells.size(); ++i)
    {
        const Eigen::Vector3d& centre = body.cells.cells[i].centre;
        if (centre.x() > 2.0 && centre.y() < 1.0 && ++pins)
            body.pin(i, centre + Eigen::Vector3d(0.5, -0.25, 0.375));
    }
    EXPECT_EQ(pins, 2u);
    return body;
}

/// A thin sheet that lies askew, in a few cells of its own thickness.
HeldBody sheet()
{
    Shape shape = support::sheet_shape(2.0, 1.0, 8);
    const Eigen::Matrix3d R = rotation_about(Eigen::Vector3d(1, -1, 0).normalized(), 0.5);
    for (Eigen::Vector3d& x : shape.samples)
        x = R * x + Eigen::Vector3d(0.2, 0.0, 1.0);
    const GridShape grid = grid_shape({2, 2, 2}, 4, 0, 0.0);
    const Material material =
        find_material(shape, bounding_surface(shape), grid, Fill::Shell);
    const Octree octree(grid, material_test(material.grid));
    HeldBody body(build_cells(
        material.grid, octree, find_pieces(material.grid, octree), material.is_sheet,
        find_sheets(shape, bounding_surface(shape), material, 0.02)));
    body.prescribe([](const Cell& cell) { return cell.centre.x() < 0.6; });
    return body;
}

/// Of what moves: the smallest curvature of the energy, over the largest.
double least_curvature(CellEnergy& energy)
{
    energy.total.linearise(kExact);
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
        support::dense_hessian(energy.total), Eigen::EigenvaluesOnly);
    return eigen.eigenvalues().minCoeff() / eigen.eigenvalues().maxCoeff();
}

/// A row of \p n cells of edge 1, its ends held at their centres by pins or prescribed,
/// and by how much it is compressed.
struct Column
{
    HeldBody body;

    Column(int n, bool is_first_pinned, bool is_last_pinned)
        : body(support::bar(n, 1, 1).cells)
    {
        for (std::size_t i = 0; i < body.cells.size(); ++i)
        {
            const Eigen::Vector3d& centre = body.cells.cells[i].centre;
            const bool is_first = centre.x()<1.0, is_last = centre.x()> n - 1.0;
            if ((is_first && is_first_pinned) || (is_last && is_last_pinned))
                body.pin(i, centre);
            else if (is_first || is_last)
                body.constraints[i].hold = Hold::Prescribed;
        }
    }
    bool is_stable(double strain)
    {
        std::vector<Pose> poses = body.rest();
        for (std::size_t i = 0; i < poses.size(); ++i)
        {
            poses[i].p.x() *= 1.0 - strain;
            body.constraints[i].held_now = poses[i].p;
        }
        CellEnergy energy = body.energy();
        energy.state.set_held_points(body.constraints);
        energy.state.set_poses(poses);
        return least_curvature(energy) > 0;
    }
    /// The strain at which it buckles.
    double critical_strain()
    {
        double stable = 0.0, buckled = 0.5;
        for (int k = 0; k < 20; ++k)
        {
            const double strain = 0.5 * (stable + buckled);
            (is_stable(strain) ? stable : buckled) = strain;
        }
        return 0.5 * (stable + buckled);
    }
};

/// Only one of its points is given, and that has moved.
HeldBody bar_on_one_pin()
{
    HeldBody body(support::bar(3, 1, 1).cells);
    body.pin(0, {0.0, 0.25, 0.5});
    body.constraints[0].held_now = {0.5, 1.0, -0.5};
    return body;
}

} // namespace

TEST(GlueTerm, has_the_derivatives_of_its_value_in_a_sheet)
{
    std::mt19937 rng(11);
    HeldBody body = sheet();
    CellEnergy energy = body.energy();
    ASSERT_GT(energy.state.num_unknown_cells(), 6);
    for (int trial = 0; trial < 3; ++trial)
    {
        SCOPED_TRACE(trial);
        energy.state.set_poses(random_poses(body, rng));
        support::check_energy(energy.total, rng);
    }
}

TEST(GlueTerm, of_thin_material_has_no_mechanism)
{
    // Films, needles and combs that a cell holds only a voxel of, and a sheet.
    Shape comb = support::box_shape({0, 0, 0}, {4, 1, 0.3}, 1);
    for (int tooth = 0; tooth < 4; ++tooth)
        comb = support::joined(
            comb, support::box_shape({tooth + 0.3, 0.9, 0}, {tooth + 0.6, 2.5, 0.2}, 1));
    std::vector<HeldBody> bodies;
    for (const Shape& shape : {support::box_shape({0, 0, 0}, {4, 3, 0.05}, 1),
                               support::box_shape({0, 0, 0}, {4, 0.05, 0.05}, 1), comb})
        bodies.emplace_back(support::built(shape, 8, 0, Fill::Solid, 0.1).cells);
    bodies.push_back(sheet());
    for (HeldBody& body : bodies)
    {
        body.prescribe([](const Cell& cell) { return cell.centre.x() < 0.6; });
        CellEnergy energy = body.energy();
        ASSERT_GT(energy.state.num_unknown_cells(), 5);
        EXPECT_GT(least_curvature(energy), 1e-9);
    }
}

TEST(GlueTerm, of_a_compressed_column_buckles_at_eulers_load)
{
    // E = 2: a strain e is a force of 2 A e, and I = A / 12. The clamped-free column of
    // half the length is the pinned one.
    const double length = 24.0, bending = 1.0 / 12.0;
    for (const auto& [load, first, last] :
         {std::tuple(9.8696044, true, true), std::tuple(20.1907286, true, false),
          std::tuple(39.4784176, false, false)})
    {
        Column column(25, first, last);
        const double euler = load * bending / (length * length);
        // Shear takes part: 1 / P = 1 / P_euler + 1 / (G A), G = 1.
        EXPECT_NEAR(column.critical_strain(), euler / (1.0 + 2.0 * euler), 0.05 * euler);
    }
}

TEST(GlueTerm, has_the_derivatives_of_its_value_in_free_cells)
{
    std::mt19937 rng(1);
    HeldBody body(support::bar(3, 2, 2).cells);
    body.prescribe(is_in_first_layer);
    CellEnergy energy = body.energy();
    EXPECT_EQ(energy.state.num_unknown_cells(), 8);
    for (int trial = 0; trial < 5; ++trial)
    {
        SCOPED_TRACE(trial);
        energy.state.set_poses(random_poses(body, rng));
        support::check_energy(energy.total, rng);
    }
}

TEST(GlueTerm, has_the_derivatives_of_its_value_in_pinned_cells)
{
    std::mt19937 rng(2);
    HeldBody body = bar_with_pins();
    CellEnergy energy = body.energy();
    EXPECT_EQ(std::count(energy.total.block_sizes().begin(),
                         energy.total.block_sizes().end(), 3),
              2);
    for (int trial = 0; trial < 5; ++trial)
    {
        SCOPED_TRACE(trial);
        for (Constraint& constraint : body.constraints)
            constraint.held_now = constraint.held_rest + random_vector(rng, 1.0);
        energy.state.set_held_points(body.constraints);
        energy.state.set_poses(random_poses(body, rng));
        support::check_energy(energy.total, rng);
    }
}

TEST(GlueTerm, has_the_derivatives_of_its_value_in_cells_that_are_one_body)
{
    // The L of three of four cells of a layer: the fourth, and the next layer, touch it
    // more than once.
    std::mt19937 rng(12);
    HeldBody body(support::bar(3, 2, 2).cells);
    body.prescribe(is_in_first_layer);
    std::vector<std::size_t> members;
    for (std::size_t i = 0; i < body.cells.size(); ++i)
        if (body.cells.cells[i].centre.x() > 2.0 && members.size() < 3)
            members.push_back(i);
    const std::vector<Pose> rest = body.rest();
    const Glue before = body.glue;
    body.group(members, {2.25, 1.125, 0.75});
    CellEnergy energy = body.energy();
    EXPECT_EQ(energy.state.num_unknown_cells(), 6u);
    for (int trial = 0; trial < 5; ++trial)
    {
        SCOPED_TRACE(trial);
        for (Constraint& constraint : body.constraints)
            constraint.held_now = constraint.held_rest + random_vector(rng, 0.5);
        energy.state.set_held_points(body.constraints);
        std::vector<Pose> poses = random_poses(body, rng);
        const Constraint& held = body.constraints[members[0]];
        poses[members[0]] =
            held_at_pin(poses[members[0]], held, body.cells.cells[members[0]].centre);
        const Eigen::Matrix3d R = poses[members[0]].R;
        for (const std::size_t i : members)
            poses[i] = carried({R, held.held_now - R * held.held_rest},
                               body.cells.cells[i].centre);
        energy.state.set_poses(poses);
        support::check_energy(energy.total, rng);
        EXPECT_NEAR(energy.total.value(), glue_energy(before, poses),
                    1e-12 * energy.total.value());
    }
}

TEST(GlueTerm, has_the_derivatives_of_its_value_in_flat_cells)
{
    // Free, pinned, sliding and grouped ones, across each axis.
    for (const int axis : {0, 1, 2})
    {
        std::mt19937 rng(13);
        Eigen::Vector3i counts = Eigen::Vector3i::Constant(3);
        counts[axis] = 1;
        HeldBody body(support::bar(counts.x(), counts.y(), counts.z()).cells);
        const int u = (axis + 1) % 3, v = (axis + 2) % 3;
        body.prescribe([&](const Cell& cell) { return cell.centre[u] < 1.0; });
        struct InPlane final : Rail
        {
            int u = 0, v = 0;
            double level = 0.5;
            RailPlace at(double s) const override
            {
                RailPlace place{Eigen::Vector3d::Constant(level), Eigen::Vector3d::Zero(),
                                Eigen::Vector3d::Zero()};
                place.place[u] = 2.0 + std::cos(s);
                place.place[v] = 1.0 + std::sin(s);
                place.first[u] = place.second[v] = -std::sin(s);
                place.first[v] = std::cos(s);
                place.second[u] = -std::cos(s);
                return place;
            }
            double begin() const override { return -9.0; }
            double end() const override { return 9.0; }
            bool is_closed() const override { return false; }
        } circle;
        circle.u = u;
        circle.v = v;
        std::vector<std::size_t> free;
        for (std::size_t i = 0; i < body.cells.size(); ++i)
            if (body.constraints[i].hold == Hold::Free)
                free.push_back(i);
        ASSERT_EQ(free.size(), 6u);
        body.pin(free[0],
                 body.cells.cells[free[0]].centre + 0.3 * Eigen::Vector3d::Unit(u));
        body.slide(free[1], circle.at(0.7).place, circle, 0.7);
        body.group({free[2], free[3]}, body.cells.cells[free[3]].centre);
        for (Constraint& constraint : body.constraints)
            constraint.flat_axis = axis;
        CellEnergy energy = body.energy();
        const std::span<const int> sizes = energy.total.block_sizes();
        EXPECT_EQ(std::vector<int>(sizes.begin(), sizes.end()).size(), 5u);
        EXPECT_EQ(std::accumulate(sizes.begin(), sizes.end(), 0), 1 + 2 + 1 + 3 + 3);
        energy.state.set_held_points(body.constraints);
        for (int trial = 0; trial < 3; ++trial)
        {
            SCOPED_TRACE(trial);
            std::vector<Pose> poses = body.rest();
            for (std::size_t i = 0; i < poses.size(); ++i)
            {
                const double angle = support::random_number(rng, -1.0, 1.0);
                poses[i].R(u, u) = poses[i].R(v, v) = std::cos(angle);
                poses[i].R(v, u) = std::sin(angle);
                poses[i].R(u, v) = -std::sin(angle);
                Eigen::Vector3d shift = random_vector(rng, 0.4);
                shift[axis] = 0.0;
                poses[i].p += shift;
                const Hold hold = body.constraints[i].hold;
                if (hold == Hold::Pinned || hold == Hold::Sliding ||
                    hold == Hold::Grouped)
                    poses[i] = held_at_pin(poses[i], body.constraints[i],
                                           body.cells.cells[i].centre);
            }
            energy.state.set_poses(poses);
            support::check_energy(energy.total, rng);
            // A step of any size leaves the plane to no bit.
            Eigen::VectorXd gradient;
            energy.total.gradient(gradient);
            energy.total.move(gradient.normalized(), 0.7);
            for (std::size_t i = 0; i < poses.size(); ++i)
            {
                const Pose& now = energy.state.poses()[i];
                EXPECT_EQ(now.p[axis], poses[i].p[axis]);
                EXPECT_EQ((now.R * Eigen::Vector3d::Unit(axis)).eval(),
                          Eigen::Vector3d::Unit(axis));
            }
            energy.total.move(gradient.normalized(), 0.0);
        }
    }
}

TEST(GlueTerm, holds_a_little_what_turns_about_one_pin)
{
    std::mt19937 rng(3);
    HeldBody body = bar_on_one_pin();
    CellEnergy energy = body.energy();
    energy.state.set_held_points(body.constraints);
    energy.state.set_poses(random_poses(body, rng));
    support::check_structure(energy.total);
    support::check_gradient(energy.total);
    for (const Curvature curvature : {kGaussNewton, kExact})
        support::check_blocks(energy.total, curvature);
    // The second derivatives, and in the pinned cell alone a multiple of the identity.
    const Eigen::MatrixXd by_values = support::hessian_by_values(energy.total);
    Eigen::MatrixXd added = support::dense_hessian(energy.total) - by_values;
    const double held = added(0, 0);
    EXPECT_GT(held, 1e-5 * by_values.norm());
    EXPECT_LT(held, 1e-2 * by_values.norm());
    added.diagonal().head<3>().array() -= held;
    EXPECT_LT(added.norm(), 1e-6 * by_values.norm());
}

TEST(GlueTerm, on_one_pin_is_positive_definite_at_rest)
{
    HeldBody body = bar_on_one_pin();
    CellEnergy energy = body.energy();
    energy.total.linearise(kGaussNewton);
    const Eigen::MatrixXd H = support::dense_hessian(energy.total);
    EXPECT_EQ(H.llt().info(), Eigen::Success);
}

TEST(GlueTerm, at_rest_all_curvature_is_that_of_gauss_newton)
{
    HeldBody body = bar_with_pins();
    CellEnergy energy = body.energy();
    support::check_zero_residuals(energy.total);
    Eigen::VectorXd gradient;
    energy.total.gradient(gradient);
    EXPECT_LT(gradient.norm(), 1e-12);
}

TEST(GlueTerm, is_not_changed_by_a_rigid_motion_of_all)
{
    // Unknowns are in the cells' own axes: not even the derivatives change.
    std::mt19937 rng(4);
    HeldBody body = bar_with_pins();
    CellEnergy energy = body.energy();
    const auto derivatives =
        [&](const std::vector<Pose>& poses, Eigen::VectorXd& gradient)
    {
        energy.state.set_held_points(body.constraints);
        energy.state.set_poses(poses);
        energy.total.gradient(gradient);
        energy.total.linearise(kExact);
        return support::dense_hessian(energy.total);
    };
    std::vector<Pose> poses = random_poses(body, rng);
    Eigen::VectorXd before, after;
    const Eigen::MatrixXd H = derivatives(poses, before);
    const double value = energy.total.value();
    const Motion motion{support::random_rotation(rng), random_vector(rng, 2.0)};
    for (Pose& pose : poses)
        pose = {motion.R * pose.R, motion(pose.p)};
    for (Constraint& constraint : body.constraints)
        constraint.held_now = motion(constraint.held_now);
    EXPECT_LT((derivatives(poses, after) - H).norm(), 1e-12 * H.norm());
    EXPECT_NEAR(energy.total.value(), value, 1e-12 * value);
    EXPECT_LT((after - before).norm(), 1e-12 * before.norm());
    EXPECT_GT(before.norm(), 1.0);

    std::vector<Pose> rigid;
    for (const Cell& cell : body.cells.cells)
        rigid.push_back(carried(motion, cell.centre));
    energy.state.set_poses(rigid);
    EXPECT_LT(energy.total.value(), 1e-24);
}

TEST(GlueTerm, gives_back_the_poses_that_it_was_given)
{
    std::mt19937 rng(5);
    HeldBody body = bar_with_pins();
    CellEnergy energy = body.energy();
    const std::vector<Pose> poses = random_poses(body, rng);
    energy.state.set_poses(poses);
    ASSERT_EQ(energy.state.poses().size(), poses.size());
    for (std::size_t i = 0; i < poses.size(); ++i)
    {
        EXPECT_EQ(energy.state.poses()[i].R, poses[i].R);
        EXPECT_EQ(energy.state.poses()[i].p, poses[i].p);
    }
    EXPECT_NEAR(energy.total.value(), glue_energy(body.glue, poses), 1e-12);
}

TEST(GlueTerm, moves_unknown_cells_from_the_base_and_pinned_ones_about_their_points)
{
    std::mt19937 rng(6);
    HeldBody body = bar_with_pins();
    CellEnergy energy = body.energy();
    const std::vector<Pose> poses = random_poses(body, rng);
    energy.state.set_poses(poses);
    Eigen::VectorXd gradient;
    energy.total.gradient(gradient);
    const Eigen::VectorXd step = gradient.normalized();
    energy.total.move(step, 0.7);
    const double once = energy.total.value();
    energy.total.move(step, -2.0);
    energy.total.move(step, 0.7);
    EXPECT_EQ(energy.total.value(), once);
    energy.total.settle();
    energy.total.move(step, 0.7);
    EXPECT_NE(energy.total.value(), once);
    for (std::size_t i = 0; i < poses.size(); ++i)
    {
        const Constraint& constraint = body.constraints[i];
        const Pose& now = energy.state.poses()[i];
        if (constraint.hold == Hold::Prescribed)
        {
            EXPECT_EQ(now.p, poses[i].p);
        }
        if (constraint.hold == Hold::Pinned)
        {
            EXPECT_LT((image(now, body.cells.cells[i].centre, constraint.held_rest) -
                       constraint.held_now)
                          .norm(),
                      1e-14);
        }
    }
}

TEST(GlueTerm, has_the_derivatives_of_cells_that_slide_along_curves)
{
    const Helix helix, other = []
    {
        Helix curve;
        curve.shift = {0.3, -0.2, 0.9};
        curve.radius = 0.7;
        return curve;
    }();
    for (const unsigned seed : {1u, 2u, 3u})
    {
        std::mt19937 rng(seed);
        HeldBody body(support::bar(3, 2, 2).cells);
        body.prescribe(is_in_first_layer);
        body.slide(body.cells.size() - 1, {2.9, 1.6, 1.2}, helix, 1.3);
        body.slide(body.cells.size() - 2, {2.2, 0.4, 1.7}, other, -0.6);
        CellEnergy energy = body.energy();
        energy.state.set_held_points(body.constraints);
        energy.state.set_poses(random_poses(body, rng));
        support::check_energy(energy.total, rng);
        // What moves stays on its curve.
        Eigen::VectorXd gradient;
        energy.total.gradient(gradient);
        energy.total.move(gradient.normalized(), 0.7);
        for (std::size_t i = body.cells.size() - 2; i < body.cells.size(); ++i)
        {
            const Constraint& now = energy.state.constraint(int(i));
            EXPECT_NE(now.s, body.constraints[i].s);
            EXPECT_LT((now.held_now - now.rail->at(now.s).place).norm(), 1e-15);
            EXPECT_LT((image(energy.state.poses()[i], body.cells.cells[i].centre,
                             now.held_rest) -
                       now.held_now)
                          .norm(),
                      1e-14);
        }
    }
}

TEST(GlueTerm, a_cell_at_the_end_of_its_curve_goes_no_farther_but_comes_back)
{
    Helix line;
    line.radius = 0.0;
    line.pitch = 1.0;
    line.first = 0.0;
    line.last = 3.5;
    line.shift = {0, 0.5, 0.5};
    HeldBody body(support::bar(4, 1, 1).cells);
    body.prescribe(is_in_first_layer);
    body.slide(3, {3.5, 0.5, 0.5}, line, 3.5);
    CellEnergy energy = body.energy();
    energy.state.set_held_points(body.constraints);
    std::vector<Pose> poses = body.rest();
    Eigen::VectorXd gradient;
    for (const double pull : {0.1, -0.1})
    {
        // Its neighbours stand off to one side: they draw it along.
        poses[1].p.x() = 1.5 + pull;
        poses[2].p.x() = 2.5 + pull;
        energy.state.set_poses(poses);
        energy.total.gradient(gradient);
        const int along = energy.state.first(energy.state.unknown_of_cell(3)) + 3;
        energy.total.linearise(kExact);
        Eigen::VectorXd x = Eigen::VectorXd::Unit(energy.total.num_unknowns(), along), y;
        energy.total.multiply(x, y);
        EXPECT_GT(y[along], 0.0);
        y[along] = 0.0;
        if (pull > 0)
        {
            EXPECT_EQ(gradient[along], 0.0);
            EXPECT_EQ(y.norm(), 0.0);
        }
        else
        {
            EXPECT_GT(gradient[along], 0.0);
            EXPECT_GT(y.norm(), 0.0);
        }
    }
}

TEST(GlueTerm, tells_how_large_the_forces_are_that_cancel)
{
    std::mt19937 rng(7);
    HeldBody body(support::bar(3, 2, 2).cells);
    body.prescribe(is_in_first_layer);
    CellEnergy energy = body.energy();
    EXPECT_LT(energy.glue.uncancelled(), 1e-12);
    energy.state.set_poses(random_poses(body, rng));
    Eigen::VectorXd gradient;
    energy.total.gradient(gradient);
    EXPECT_GE(energy.glue.uncancelled(), gradient.norm());
}

TEST(GlueTerm, threads_do_not_change_a_bit)
{
    HeldBody body(support::bar(12, 8, 8).cells);
    body.prescribe(is_in_first_layer);
    body.pin(700, body.cells.cells[700].centre);
    CellEnergy energy = body.energy();
    std::mt19937 rng(8);
    const std::vector<Pose> poses = random_poses(body, rng);
    Eigen::VectorXd first;
    for (const int threads : {1, 2, 4})
    {
        const ThreadLimit limit(threads);
        energy.state.set_poses(poses);
        energy.total.linearise(kExact);
        Eigen::VectorXd gradient, image;
        energy.total.gradient(gradient);
        energy.total.multiply(gradient, image);
        energy.total.move(gradient, 1e-3);
        Eigen::VectorXd all(gradient.size() + image.size() + 1);
        all << gradient, image, energy.total.value();
        if (first.size() == 0)
            first = all;
        EXPECT_EQ(all, first);
    }
}

} // namespace cellwarp::core
