// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/flesh/flesh.h"

#include <cmath>
#include <numbers>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "octree/base/parallel.h"
#include "tests/support/flesh.h"
#include "tests/support/random.h"
#include "tests/support/random_poses.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

const auto kEverywhere = [](int, const Vector3d&) { return true; };

bool is_at_begin(const Vector3d& x)
{
    return x.x() < 1e-9;
}

FleshSettings tight(FleshLaw law)
{
    FleshSettings settings;
    settings.law = law;
    settings.tolerance = 1e-12;
    return settings;
}

int zero_modes(const Flesh& flesh)
{
    return support::count_zero(
        Eigen::SelfAdjointEigenSolver<MatrixXd>(support::reduced(flesh, 0, 1, 1))
            .eigenvalues());
}

struct Bar
{
    std::vector<BoneLine> bones;
    double tube_radius = 0.5, chi = 10.0;
    FleshMaterial material = {1.0, 0.4, 1.0};
    FleshSettings settings = tight(FleshLaw::Cells);
};

/// 8 x 2 x 2 about the x axis, in cubes of \p edge, with bones.
Flesh bar_with_bones(const Bar& bar, double edge)
{
    const int along = static_cast<int>(std::lround(8 / edge)),
              across = static_cast<int>(std::lround(2 / edge));
    const support::Built body = support::bar(along, across, across);
    Lattice lattice = octree_lattice(body.octree, body.cells, edge);
    const Vector3d shift(0, -1, -1);
    for (Vector3d& x : lattice.places)
        x += shift;
    for (LatticePart& part : lattice.parts)
        part.centre += shift;
    std::vector<TubeBone> tubes;
    for (const BoneLine& bone : bar.bones)
        tubes.push_back({bone, bar.tube_radius});
    Lattice drawn = lattice; // cells cut finely, for the tubes' integrals
    const std::vector<FleshMaterial> materials = {bar.material};
    std::vector<TubePart> parts = bar.chi > 0
                                      ? tube_parts(lattice, materials, tubes,
                                                   points_in_tubes(drawn, tubes), bar.chi)
                                      : std::vector<TubePart>();
    std::vector<HeldPoint> points = points_on_bones(lattice, bar.bones, kEverywhere);
    return Flesh(std::move(lattice), materials, std::move(points), std::move(parts),
                 bar.settings);
}

Motion about_z(double angle)
{
    return {rotation_about(Vector3d::UnitZ(), angle), Vector3d::Zero()};
}

/// Two bones that meet in the middle; the second turns about the joint there.
std::vector<BoneLine> elbow()
{
    return {{{0, 0, 0}, {4, 0, 0}, 0}, {{4, 0, 0}, {8, 0, 0}, 1}};
}
Motion elbow_turn(double angle)
{
    Motion T = about_z(angle);
    T.t = Vector3d(4, 0, 0) - T.R * Vector3d(4, 0, 0);
    return T;
}

} // namespace

TEST(Flesh, cantilever_sags_and_swings_as_known)
{
    // [known-answers 8], rows "incompatible" of theory-skeleton 12.
    for (const auto& [across, poisson, tip, frequency] :
         {std::tuple{1, 0.0, 4010.0, .010104}, {1, 0.3, 3972.639, .010163}})
    {
        const Lattice lattice = support::bar_lattice(across);
        const std::vector<HeldPoint> held = support::held_nodes(lattice, is_at_begin);
        const VectorXd load = support::load_on_end(lattice, 10.0, {0, 0, 1});
        Flesh flesh(lattice, {{1.0, poisson, 1.0}}, held, {}, tight(FleshLaw::Linear));
        flesh.load(load);
        FleshState state = flesh.rest();
        const std::vector<Motion> still(1);
        EXPECT_TRUE(flesh.settle(state, still).is_converged);
        EXPECT_NEAR(load.dot(state.u), tip, 2e-3);
        const Eigen::GeneralizedSelfAdjointEigenSolver<MatrixXd> modes(
            support::reduced(flesh, 0, 1, 0), support::reduced(flesh, 1, 0, 0));
        EXPECT_NEAR(std::sqrt(modes.eigenvalues()[0]), frequency, 6e-7);
    }
}

TEST(Flesh, a_cantilever_bends_alike_by_all_laws_however_few_cells_thick)
{
    // Known: the same with modes, 40 cells long, of docs/flesh-answers.md.
    for (const auto& [poisson, known] :
         {std::pair{0.0, 4022.177}, {0.3, 3992.435}, {0.45, 3937.183}})
        for (const int across : {1, 2})
            for (const FleshLaw law :
                 {FleshLaw::Linear, FleshLaw::Cells, FleshLaw::Regions,
                  FleshLaw::StVenantKirchhoff, FleshLaw::NeoHookean})
            {
                const Lattice lattice = support::bar_lattice(across);
                const VectorXd load = support::load_on_end(lattice, 10.0, {0, 0, 1});
                std::vector<FleshRegionShares> regions;
                if (law == FleshLaw::Regions)
                    regions = shares_by_distance(
                        lattice, std::vector(1, std::vector(lattice.places.size(), 1.0)),
                        std::vector<int>(1, 0), 1.0);
                Flesh flesh(lattice, {{1.0, poisson, 1.0}},
                            support::held_nodes(lattice, is_at_begin), {}, tight(law),
                            regions);
                flesh.load(1e-7 * load);
                FleshState state = flesh.rest();
                EXPECT_TRUE(flesh.settle(state, std::vector<Motion>(1)).is_converged);
                EXPECT_NEAR(1e7 * load.dot(state.u) / known, 1.0, 0.02)
                    << poisson << " " << across << " law " << static_cast<int>(law);
            }
}

TEST(Flesh, bones_leave_the_rigid_motions_that_they_should)
{
    Bar bar;
    bar.chi = 0.0;
    EXPECT_EQ(zero_modes(bar_with_bones(bar, 1.0)), 6);
    for (const bool is_slanted : {false, true})
    {
        bar.bones = {is_slanted ? BoneLine{{0.4, 0.3, -0.6}, {7.3, 0.5, 0.7}, 0}
                                : BoneLine{{0, 0, 0}, {8, 0, 0}, 0}};
        bar.chi = 0.0;
        EXPECT_EQ(zero_modes(bar_with_bones(bar, 1.0)), 1);
        bar.chi = 10.0;
        EXPECT_EQ(zero_modes(bar_with_bones(bar, 1.0)), 0);
        bar.bones.push_back({bar.bones[0].from, {1.2, 0.9, 0.8}, 0});
        bar.chi = 0.0;
        EXPECT_EQ(zero_modes(bar_with_bones(bar, 1.0)), 0);
    }
}

TEST(Flesh, a_bone_that_turns_carries_all_along_without_force)
{
    Bar bar;
    bar.bones = {{{0, 0, 0}, {8, 0, 0}, 0}};
    Flesh flesh = bar_with_bones(bar, 1.0);
    std::mt19937 rng(3);
    for (int trial = 0; trial < 3; ++trial)
    {
        const std::vector<Motion> motions = {
            {support::random_rotation(rng), support::random_vector(rng, 2.0)}};
        FleshState state = flesh.rest();
        state.u = support::field_of(flesh.lattice(),
                                    [&](const Vector3d& x) -> Vector3d
                                    { return motions[0](x) - x; });
        const VectorXd before = state.u;
        flesh.step(state, 0.01, motions);
        EXPECT_LT((state.u - before).cwiseAbs().maxCoeff(), 1e-12);
        EXPECT_LT(flesh.energies(state, motions).elastic, 1e-20);
    }
}

TEST(Flesh, free_flesh_falls_by_the_formula_of_implicit_euler)
{
    FleshSettings settings = tight(FleshLaw::Cells);
    settings.gravity = {0, 0, -9.81};
    Flesh flesh(support::bar_lattice(1, 3), {{1e4, 0.4, 1000}}, {}, {}, settings);
    FleshState state = flesh.rest();
    for (int k = 0; k < 100; ++k)
        flesh.step(state, 0.01, {});
    for (Eigen::Index n = 2; n < state.u.size(); n += 3)
        EXPECT_NEAR(state.u[n], -4.95405, 1e-9);
    EXPECT_LT((flesh.momentum(state) - Vector3d(0, 0, -9.81 * 3000)).norm(), 1e-6);
}

TEST(Flesh, an_unforced_mode_loses_its_share_and_no_more)
{
    const Lattice lattice = support::bar_lattice(1, 4);
    Flesh flesh(lattice, {{1e4, 0.3, 1000}}, support::held_nodes(lattice, is_at_begin),
                {}, tight(FleshLaw::Linear));
    const support::Modes modes = support::modes_of(flesh);
    for (const int mode : {0, 3, 20})
        for (const double dt : {1e-3, 1e-2})
            EXPECT_NEAR(support::energy_left(flesh, modes, mode, dt),
                        1.0 / (1.0 + dt * dt * modes.eigenvalues()[mode]), 1e-9);
}

TEST(Flesh, stays_bounded_for_stiff_and_soft_flesh_and_all_steps)
{
    for (const double young : {1e-2, 1e4, 1e10})
        for (const double dt : {1e-4, 1.0 / 120, 5e-2})
            for (const double poisson : {0.0, 0.4, 0.499})
            {
                Bar bar;
                bar.bones = elbow();
                bar.material = {young, poisson, 1000.0};
                bar.settings.tolerance = 1e-6;
                bar.settings.gravity = {0, -9.81, 0};
                Flesh flesh = bar_with_bones(bar, 1.0);
                FleshState state = flesh.rest();
                double largest = 0.0;
                for (int k = 0; k < 60; ++k)
                {
                    const std::vector<Motion> motions = {
                        {}, elbow_turn(std::min(1.0, k / 20.0) * std::numbers::pi / 2)};
                    ASSERT_TRUE(flesh.step(state, dt, motions).is_finite);
                    largest = std::max(largest, state.u.cwiseAbs().maxCoeff());
                    EXPECT_LT(flesh.largest_miss(state, motions), 1e-11);
                }
                EXPECT_LT(largest, 60 * 60 * dt * dt * 10 + 40)
                    << young << " " << dt << " " << poisson;
            }
}

TEST(Flesh, a_joint_of_120_degrees_neither_swells_nor_collapses)
{
    // theory-skeleton 4, row "cell frames": volume over rest 0.995 0.981 0.980 0.972.
    Bar bar;
    bar.bones = elbow();
    bar.settings.tolerance = 1e-6;
    Flesh flesh = bar_with_bones(bar, 0.5);
    FleshState state = flesh.rest();
    const auto volume = [&]
    {
        double sum = 0.0;
        const std::vector<Eigen::Matrix3d> F = flesh.deformations(state);
        for (const LatticePart& part : flesh.lattice().parts)
            sum += part.volume * F[idx(part.cell)].determinant();
        return sum / 32.0;
    };
    for (const auto& [degree, wanted] :
         {std::pair{30, 0.995}, {60, 0.981}, {90, 0.980}, {120, 0.972}})
    {
        for (int part = 1; part <= 8; ++part)
        {
            const std::vector<Motion> motions = {
                {}, elbow_turn((degree - 30 + 30 * part / 8.0) * std::numbers::pi / 180)};
            flesh.settle(state, motions);
        }
        EXPECT_NEAR(volume(), wanted, 6e-3) << degree;
    }
}

TEST(Flesh, steady_spin_is_followed_without_lag)
{
    // Step 6.2: 0.0005, 0.0003, 0.0001 lengths at omega h = 0.2, 0.1, 0.05.
    for (const auto& [turn, error] : {std::pair{0.2, 6e-4}, {0.1, 4e-4}, {0.05, 2e-4}})
    {
        Bar bar;
        bar.bones = {{{0, 0, 0}, {8, 0, 0}, 0}};
        bar.material = {1e6, 0.4, 1.0};
        bar.settings.tolerance = 1e-9;
        Flesh flesh = bar_with_bones(bar, 1.0);
        FleshState state = flesh.rest();
        const double omega = 1.0, dt = turn / omega;
        state.v = support::field_of(flesh.lattice(),
                                    [&](const Vector3d& x) -> Vector3d
                                    { return omega * Vector3d::UnitZ().cross(x); });
        std::vector<Motion> motions(1);
        const int steps = static_cast<int>(std::lround(2 * std::numbers::pi / turn));
        for (int k = 1; k <= steps; ++k)
        {
            motions[0] = about_z(turn * k);
            flesh.step(state, dt, motions);
        }
        const VectorXd rigid = support::field_of(flesh.lattice(),
                                                 [&](const Vector3d& x) -> Vector3d
                                                 { return motions[0](x) - x; });
        double worst = 0.0;
        for (Eigen::Index n = 0; n < rigid.size(); n += 3)
            worst = std::max(worst, (state.u - rigid).segment<3>(n).norm());
        EXPECT_LT(worst / 8.0, error) << turn;
    }
}

TEST(Flesh, one_cell_law_is_the_linear_one_seen_from_a_turned_frame)
{
    Bar bar;
    bar.bones = {{{0, 0, 0}, {8, 0, 0}, 0}};
    Flesh cells = bar_with_bones(bar, 1.0);
    bar.settings.law = FleshLaw::Linear;
    Flesh linear = bar_with_bones(bar, 1.0);
    const Motion turn{rotation_about(Vector3d(1, 2, 3).normalized(), 1.0),
                      {0.3, 0.1, 0.2}};
    std::mt19937 rng(2);
    FleshState still = linear.rest();
    const VectorXd push = support::random_field(linear.lattice(), rng, 1e-6);
    for (std::size_t k = 0; k < linear.nodes().free.size(); ++k)
        still.v.segment<3>(3 * linear.nodes().free[k]) =
            push.segment<3>(3 * linear.nodes().free[k]);
    FleshState turned = cells.rest();
    for (Eigen::Index n = 0; n < still.v.size(); n += 3)
    {
        const Vector3d& x = cells.lattice().places[idx(n / 3)];
        turned.u.segment<3>(n) = turn(x) - x;
        turned.v.segment<3>(n) = turn.R * still.v.segment<3>(n);
    }
    linear.step(still, 0.5, std::vector<Motion>(1));
    cells.step(turned, 0.5, std::vector<Motion>{turn});
    for (Eigen::Index n = 0; n < still.v.size(); n += 3)
    {
        const Vector3d& x = cells.lattice().places[idx(n / 3)];
        const Vector3d wanted = turn.R * still.u.segment<3>(n) + turn(x) - x;
        // Frames feel the strain of 1e-6 in second order.
        EXPECT_LT((turned.u.segment<3>(n) - wanted).norm(), 1e-11);
    }
}

TEST(Flesh, newton_solves_the_step_that_one_linear_system_only_begins)
{
    Bar bar;
    bar.bones = elbow();
    bar.material = {1e3, 0.4, 1000.0};
    bar.settings.tolerance = 1e-8;
    double change_of_one = 0.0;
    FleshState by_five;
    for (const int newton : {1, 5})
    {
        bar.settings.newton = newton;
        Flesh flesh = bar_with_bones(bar, 1.0);
        FleshState state = flesh.rest();
        for (int k = 1; k <= 10; ++k)
            flesh.step(state, 0.02, std::vector<Motion>{{}, elbow_turn(0.15 * k)});
        if (newton == 1)
            by_five = state;
        else
            change_of_one = (state.u - by_five.u).cwiseAbs().maxCoeff();
    }
    EXPECT_GT(change_of_one, 1e-5);
    EXPECT_LT(change_of_one, 0.1);
}

TEST(Flesh, a_step_depends_on_its_state_alone)
{
    Bar bar;
    bar.bones = elbow();
    bar.settings.tolerance = 1e-3;
    bar.material = {1e4, 0.4, 1000.0};
    bar.settings.gravity = {0, -9.81, 0};
    const auto motions = [](int k) {
        return std::vector<Motion>{{}, elbow_turn(0.05 * k)};
    };
    const auto run = [&](int threads)
    {
        const ThreadLimit limit(threads);
        Flesh flesh = bar_with_bones(bar, 0.5);
        std::vector<FleshState> states = {flesh.rest()};
        for (int k = 1; k <= 10; ++k)
        {
            states.push_back(states.back());
            flesh.step(states.back(), 1.0 / 120, motions(k));
        }
        return states;
    };
    const std::vector<FleshState> all = run(1);
    EXPECT_TRUE(run(2).back() == all.back());
    // From a state in the middle, by another object that has done other things.
    Flesh flesh = bar_with_bones(bar, 0.5);
    FleshState other = flesh.rest();
    flesh.step(other, 0.003, motions(30));
    FleshState state = all[5];
    for (int k = 6; k <= 10; ++k)
    {
        flesh.energies(state, motions(k));
        flesh.step(state, 1.0 / 120, motions(k));
    }
    EXPECT_TRUE(state == all.back());
}

TEST(Flesh, damping_of_the_stiffness_lets_turning_flesh_turn)
{
    FleshSettings settings = tight(FleshLaw::Cells);
    settings.beta = 0.5;
    Flesh flesh(support::bar_lattice(1, 4), {{1e4, 0.3, 1000}}, {}, {}, settings);
    FleshState state = flesh.rest();
    const Vector3d centre(2, 0.5, 0.5), spin(0.0, 0.0, 0.05);
    state.v = support::field_of(flesh.lattice(),
                                [&](const Vector3d& x) -> Vector3d
                                { return spin.cross(x - centre); });
    const double before = flesh.angular_momentum(state).norm();
    for (int k = 0; k < 50; ++k)
        flesh.step(state, 0.01, {});
    EXPECT_NEAR(flesh.angular_momentum(state).norm() / before, 1.0, 1e-3);
    settings.alpha = 1.0;
    Flesh slow(support::bar_lattice(1, 4), {{1e4, 0.3, 1000}}, {}, {}, settings);
    state = slow.rest();
    state.v.setConstant(1.0);
    slow.step(state, 0.1, {});
    for (const double v : state.v)
        EXPECT_NEAR(v, 1.0 / 1.1, 1e-9);
}

} // namespace cellwarp::core
