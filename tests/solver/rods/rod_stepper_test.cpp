// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/rods/rod_stepper.h"

#include <cmath>
#include <numbers>
#include <random>
#include <utility>
#include <vector>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "solver/rods/point_springs.h"
#include "tests/support/rods.h"

namespace cellwarp::core
{

namespace
{

/// A rod of rubber, 1 m, r = 1 cm.
Rod rubber(int spans)
{
    return support::straight_rod(1.0, spans, Section::round(0.01, 1e6, 0.3, 1000.0));
}

/// Flies, turns and swings.
Eigen::VectorXd thrown(const RodState& state)
{
    Eigen::VectorXd v = Eigen::VectorXd::Zero(state.x().size());
    const Rod& rod = state.rod();
    for (int k = 0; k < rod.num_controls(); ++k)
    {
        const Eigen::Vector3d p = state.control(k);
        v.segment<3>(rod.layout().control[idx(k)]) =
            Eigen::Vector3d(0.3, 1.0 + 0.5 * std::sin(5.0 * p.x()), 0.2) +
            Eigen::Vector3d(0, 0, 3).cross(p);
    }
    return v;
}

} // namespace

TEST(RodStepper, falls_freely_as_the_formula_of_its_rule_says)
{
    const Rod rod = rubber(6);
    for (const Integrator rule :
         {Integrator::ImplicitEuler, Integrator::Midpoint, Integrator::RungeKutta})
    {
        RodModel model(rod);
        model.terms.push_back(exact_elasticity(rod));
        model.gravity = {0, 0, -9.81};
        RodState state(rod);
        Eigen::VectorXd velocity = Eigen::VectorXd::Zero(state.x().size());
        RodStepper stepper(model, rule);
        const double h = rule == Integrator::RungeKutta ? 1e-3 : 1e-2;
        const int n = rule == Integrator::RungeKutta ? 1000 : 100;
        for (int k = 0; k < n; ++k)
            stepper.step(state, velocity, h);
        const double fallen =
            rule == Integrator::ImplicitEuler ? 9.81 * h * h * n * (n + 1) / 2 : 4.905;
        EXPECT_NEAR(state.at(0.3).place.z(), -fallen, 1e-9);
    }
}

TEST(RodStepper, modes_of_a_damped_material_decay_by_the_square_of_their_frequency)
{
    // Stretch, bending and twist of a free rod; curved rods mix them.
    std::vector<Eigen::Vector3d> arc;
    for (int k = 0; k <= 6; ++k)
        arc.emplace_back(std::sin(k / 6.0), 1.0 - std::cos(k / 6.0), 0.0);
    const Section section = support::section_of(40.0, 0.02, 1e-3);
    const Rod rods[] = {
        support::straight_rod(1.0, 6, section),
        Rod(spline_through(arc, false, 1), [&](double) { return section; }, {})};
    for (const Rod& rod : rods)
        for (const Integrator rule :
             {Integrator::ImplicitEuler, Integrator::Midpoint, Integrator::RungeKutta})
        {
            RodModel model(rod);
            model.terms.push_back(exact_elasticity(rod));
            const RodState rest(rod);
            BandMatrix stiffness, mass(rod.layout().num_unknowns, rod.layout().half_band);
            model.hessian(rest, RodHessian::Exact, stiffness);
            model.mass().add_to(mass, 1.0);
            const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd> modes(
                support::dense(stiffness), support::dense(mass));
            for (int mode = 6; mode < 14; ++mode)
            {
                SCOPED_TRACE(testing::Message() << int(rule) << " " << mode);
                const double omega = std::sqrt(modes.eigenvalues()[mode]);
                model.damping = 0.1 / omega;
                const double swings = omega * std::sqrt(1.0 - 0.05 * 0.05);
                constexpr int kHalfSwings = 6, kSteps = 100; // of half a swing each
                const double step = std::numbers::pi / swings / kSteps;
                RodState state = rest;
                Eigen::VectorXd velocity = 1e-5 * modes.eigenvectors().col(mode);
                RodStepper stepper(model, rule);
                const double start = stepper.energy(state, velocity);
                int parts = 1;
                if (rule == Integrator::RungeKutta)
                    while (step / parts > stepper.largest_step(state))
                        ++parts;
                for (int k = 0; k < kHalfSwings * kSteps * parts; ++k)
                    ASSERT_EQ(stepper.step(state, velocity, step / parts).stop,
                              MotionStop::Converged);
                // The energy goes with twice the rate beta omega^2 / 2.
                const double time = kHalfSwings * kSteps * step;
                EXPECT_NEAR(-std::log(stepper.energy(state, velocity) / start) /
                                (model.damping * omega * omega * time),
                            1.0, rule == Integrator::ImplicitEuler ? 5e-3 : 1e-3);
            }
        }
}

TEST(RodStepper, a_damped_material_does_not_hinder_rigid_motion)
{
    const Rod rod = support::straight_rod(1.0, 4, Section::round(0.01, 1e8, 0.3, 1000.0));
    for (const Integrator rule :
         {Integrator::ImplicitEuler, Integrator::Midpoint, Integrator::RungeKutta})
    {
        const auto thrown_with = [&](double damping)
        {
            RodModel model(rod);
            model.terms.push_back(exact_elasticity(rod));
            model.damping = damping;
            RodState state(rod);
            Eigen::VectorXd velocity = Eigen::VectorXd::Zero(state.x().size());
            for (int k = 0; k < rod.num_controls(); ++k)
                velocity.segment<3>(rod.layout().control[idx(k)]) =
                    Eigen::Vector3d(0.3, 1.0, 0.2) +
                    Eigen::Vector3d(0, 0.1, 0.5).cross(state.control(k));
            for (const int angle : rod.layout().angle)
                velocity[angle] = 0.7; // about itself
            RodStepper stepper(model, rule);
            const double step = rule == Integrator::RungeKutta ? 5e-5 : 1e-3;
            EXPECT_LT(step,
                      rule == Integrator::RungeKutta ? stepper.largest_step(state) : 1.0);
            for (int k = 0; k < 200; ++k)
                EXPECT_EQ(stepper.step(state, velocity, step).stop,
                          MotionStop::Converged);
            return std::pair(state.x(), model.mass().kinetic_energy(velocity));
        };
        const auto [place, energy] = thrown_with(0.0);
        const auto [damped, left] =
            thrown_with(rule == Integrator::RungeKutta ? 1e-5 : 0.5);
        EXPECT_LT((place - damped).norm(), 3e-5);
        EXPECT_NEAR(left, energy, 1e-5 * energy);
    }
}

TEST(RodStepper, may_be_moved_to_another_place)
{
    const Rod rod = rubber(6);
    RodModel model(rod);
    model.terms.push_back(exact_elasticity(rod));
    model.gravity = {0, 0, -9.81};
    std::vector<RodStepper> steppers;
    for (int k = 0; k < 5; ++k)
        steppers.emplace_back(model, Integrator::ImplicitEuler);
    for (RodStepper& stepper : steppers)
    {
        RodState state(rod);
        Eigen::VectorXd velocity = Eigen::VectorXd::Zero(state.x().size());
        EXPECT_EQ(stepper.step(state, velocity, 0.1).stop, MotionStop::Converged);
        EXPECT_NEAR(state.at(0.3).place.z(), -0.0981, 1e-9);
    }
}

TEST(RodStepper, keeps_the_momentum_of_a_free_rod_and_never_adds_energy)
{
    const Rod rod = rubber(10);
    for (const Integrator rule :
         {Integrator::ImplicitEuler, Integrator::Midpoint, Integrator::RungeKutta})
    {
        RodModel model(rod);
        model.terms.push_back(exact_elasticity(rod));
        RodState state(rod);
        Eigen::VectorXd velocity = thrown(state);
        const Eigen::Vector3d momentum = model.mass().momentum(velocity);
        const Eigen::Vector3d turning = model.mass().angular_momentum(state, velocity);
        RodStepper stepper(model, rule);
        const double start = stepper.energy(state, velocity);
        double energy = start;
        for (int k = 0; k < 300; ++k)
        {
            const StepReport report = stepper.step(
                state, velocity, rule == Integrator::RungeKutta ? 2e-4 : 1e-3);
            ASSERT_EQ(report.stop, MotionStop::Converged);
            const double now = stepper.energy(state, velocity);
            if (rule == Integrator::ImplicitEuler)
            {
                ASSERT_LE(now, energy * (1.0 + 1e-8));
            }
            energy = now;
        }
        EXPECT_LT((model.mass().momentum(velocity) - momentum).norm(),
                  1e-9 * momentum.norm());
        const double drift =
            (model.mass().angular_momentum(state, velocity) - turning).norm();
        if (rule != Integrator::ImplicitEuler)
        {
            EXPECT_LT(drift, 1e-4 * turning.norm());
            EXPECT_NEAR(energy, start, 1e-3 * start);
        }
    }
}

TEST(RodStepper, explicit_steps_are_stable_up_to_the_limit_and_not_beyond)
{
    const Rod rod = rubber(10);
    RodModel model(rod);
    model.terms.push_back(exact_elasticity(rod));
    const RodState rest(rod);
    RodStepper stepper(model, Integrator::RungeKutta);
    const double limit = stepper.largest_step(rest);
    const auto grows = [&](double step)
    {
        std::mt19937 rng(3);
        RodState state = rest;
        Eigen::VectorXd velocity =
            support::random_step(static_cast<int>(state.x().size()), 1e-6, rng);
        const double start = stepper.energy(state, velocity);
        for (int k = 0; k < 600; ++k)
        {
            if (stepper.step(state, velocity, step).stop != MotionStop::Converged)
                return true;
            if (stepper.energy(state, velocity) > 10.0 * start)
                return true;
        }
        return false;
    };
    EXPECT_FALSE(grows(0.98 * limit));
    EXPECT_TRUE(grows(1.1 * limit));
}

TEST(RodStepper, a_rope_from_a_nail_swings_the_same_by_all_rules)
{
    const Rod rod = rubber(12);
    std::vector<Eigen::Vector3d> tips;
    for (const Integrator rule : {Integrator::Midpoint, Integrator::RungeKutta})
    {
        RodModel model(rod);
        model.terms.push_back(exact_elasticity(rod));
        model.gravity = {0, -9.81, 0};
        model.constraints.push_back({});
        RodState state(rod);
        Eigen::VectorXd velocity = Eigen::VectorXd::Zero(state.x().size());
        RodStepper stepper(model, rule);
        const double h = rule == Integrator::RungeKutta ? 2e-4 : 1e-3;
        for (double t = 0.0; t < 0.4 - 0.5 * h; t += h)
            EXPECT_LT(stepper.step(state, velocity, h).violation, 1e-9);
        EXPECT_NEAR(stepper.energy(state, velocity), 0.0, 1e-4);
        tips.push_back(state.at(1.0).place);
    }
    EXPECT_LT((tips[0] - tips[1]).norm(), 1e-4);
}

TEST(RodStepper, stays_stable_from_soft_to_stiff_at_small_and_large_steps)
{
    for (const double young : {1e3, 1e6, 1e9, 1e12, 1e15})
        for (const double h : {1e-4, 1e-3, 5e-3, 1e-2, 3.3e-2})
        {
            SCOPED_TRACE(testing::Message() << young << " Pa, " << h << " s");
            const Rod rod =
                support::straight_rod(1.0, 8, Section::round(0.01, young, 0.3, 1000.0));
            RodModel model(rod);
            model.terms.push_back(exact_elasticity(rod));
            model.viscosity = 0.5;
            RodState state(rod);
            Eigen::VectorXd velocity = thrown(state);
            RodStepper stepper(model, Integrator::ImplicitEuler);
            double energy = stepper.energy(state, velocity);
            for (int k = 0; k < 10; ++k)
            {
                ASSERT_EQ(stepper.step(state, velocity, h).stop, MotionStop::Converged);
                const double now = stepper.energy(state, velocity);
                ASSERT_LE(now, energy * (1.0 + 1e-7));
                energy = now;
            }
        }
}

TEST(RodStepper, goes_on_between_holds_that_contradict)
{
    for (const Integrator rule :
         {Integrator::ImplicitEuler, Integrator::Midpoint, Integrator::RungeKutta})
    {
        SCOPED_TRACE(static_cast<int>(rule));
        const Rod rod =
            support::straight_rod(1.0, 8, support::section_of(10, 0.01, 0.01));
        RodModel model(rod);
        model.terms.push_back(exact_elasticity(rod));
        model.gravity = {0, -9.81, 0};
        RodConstraint hold;
        model.constraints.push_back(hold);
        hold.point = {0, 0.1, 0}; // the same end, elsewhere
        model.constraints.push_back(hold);
        RodState state(rod);
        Eigen::VectorXd velocity = Eigen::VectorXd::Zero(rod.layout().num_unknowns);
        RodStepper stepper(model, rule);
        StepReport report;
        for (int k = 0; k < 300; ++k)
            report = stepper.step(state, velocity, 1e-3);
        EXPECT_EQ(report.stop, MotionStop::Contradiction);
        EXPECT_EQ(report.parts, 1);
        EXPECT_NEAR(report.violation, 0.05, 1e-6);
        EXPECT_NEAR(state.at(0.0).place.y(), 0.05, 1e-6);
        EXPECT_LT(state.at(1.0).place.y(), -0.1); // it falls
    }
}

TEST(RodStepper, tells_where_explicit_steps_gain_energy)
{
    // A strong spring squeezes and whips it: its vibrations are faster than at first.
    const Rod rod =
        support::straight_rod(1.0, 11, Section::round(0.01, 1e7, 0.3, 1000.0));
    RodModel model(rod);
    model.terms.push_back(exact_elasticity(rod));
    model.terms.push_back(point_springs(rod, {{0.0, {0, 0.1, 0}, 1e6, 0.0}}));
    RodState state(rod);
    Eigen::VectorXd velocity = Eigen::VectorXd::Zero(state.x().size());
    RodStepper stepper(model, Integrator::RungeKutta);
    // The whip is chaotic: with this step it tells within some hundred steps, whatever
    // rounding does.
    const double step = 1.3e-5;
    ASSERT_LT(step, stepper.largest_step(state));
    MotionStop stop = MotionStop::Converged;
    for (int n = 0; n < 6000 && stop == MotionStop::Converged; ++n)
        stop = stepper.step(state, velocity, step).stop;
    EXPECT_EQ(stop, MotionStop::EnergyGrew);
}

TEST(RodResponse, is_the_same_by_a_dense_system_and_in_the_band)
{
    const Rod rod = support::straight_rod(1.0, 40, support::section_of(10, 0.01, 0.01));
    RodModel model(rod);
    for (int k = 0; k <= 12; ++k)
    {
        RodConstraint hold;
        hold.s = rod.basis().end() * k / 12.0;
        hold.hold = k % 2 == 0 ? HoldKind::Point : HoldKind::Tangent;
        hold.direction = {1, 0, 0};
        model.constraints.push_back(hold);
    }
    const RodState state(rod);
    const RodModel::Rows rows = model.rows(state);
    const RodResponse dense(model, rows), band(model, rows, 0);
    EXPECT_FALSE(dense.is_redundant());
    EXPECT_FALSE(band.is_redundant());
    // What is said twice is left to least squares.
    RodModel::Rows twice = rows;
    twice.rows.insert(twice.rows.end(), rows.rows.begin(), rows.rows.end());
    twice.groups.insert(twice.groups.end(), rows.groups.begin(), rows.groups.end());
    const RodResponse redundant(model, twice, 0);
    EXPECT_TRUE(redundant.is_redundant());
    std::mt19937 rng(3);
    const Eigen::VectorXd v = support::random_step(rod.layout().num_unknowns, 1.0, rng),
                          wanted = dense.along(v);
    const Eigen::VectorXd by_dense = dense.change(wanted), by_band = band.change(wanted);
    EXPECT_LT((dense.along(by_dense) - wanted).norm(), 1e-9 * wanted.norm());
    EXPECT_LT((by_band - by_dense).norm(), 1e-8 * by_dense.norm());
    Eigen::VectorXd still = v;
    still -= band.change(band.along(still));
    EXPECT_LT(band.along(still).norm(), 1e-9 * wanted.norm());
    EXPECT_LE(model.mass().kinetic_energy(still), model.mass().kinetic_energy(v));
}

TEST(RodStepper, what_constraints_bring_along_is_no_energy_of_the_step)
{
    const Rod rod = rubber(8);
    RodModel model(rod);
    model.terms.push_back(exact_elasticity(rod));
    model.constraints.push_back({});
    RodState state(rod);
    Eigen::VectorXd velocity = Eigen::VectorXd::Zero(state.x().size());
    for (const Integrator rule : {Integrator::ImplicitEuler, Integrator::Midpoint})
    {
        RodStepper stepper(model, rule);
        // Its end is taken away from where it is.
        model.constraints[0].point += Eigen::Vector3d(0.0, 0.05, 0.0);
        StepReport report = stepper.step(state, velocity, 1e-3);
        EXPECT_EQ(report.stop, MotionStop::Converged);
        EXPECT_EQ(report.parts, 1);
        // From then on nothing is added.
        double energy = stepper.energy(state, velocity);
        for (int k = 0; k < 20; ++k)
        {
            report = stepper.step(state, velocity, 1e-3);
            EXPECT_EQ(report.stop, MotionStop::Converged);
            EXPECT_LE(stepper.energy(state, velocity), 1.01 * energy);
            energy = stepper.energy(state, velocity);
        }
    }
}

TEST(RodStepper,
     explicit_steps_are_of_order_4_with_holds_that_turn_and_go_while_it_twists_and_bends)
{
    const Rod rod = rubber(4);
    const auto end_with = [&](int steps)
    {
        RodModel model(rod);
        model.terms.push_back(exact_elasticity(rod));
        model.gravity = {0, -9.81, 0};
        support::clamp(model, 0.0);
        RodConstraint rail;
        rail.s = rod.basis().end();
        rail.hold = HoldKind::Axis;
        rail.point = {1.0, 0.0, 0.0};
        rail.direction = {0, 1, 0};
        model.constraints.push_back(rail);
        const std::vector<RodConstraint> begin = model.constraints;
        const double duration = 0.02;
        const Eigen::Vector3d way(0.01, 0.02, 0.005), turn(0.2, 0.1, 0.3);
        model.lead(
            [&](double share)
            {
                for (std::size_t k = 0; k < begin.size(); ++k)
                {
                    RodConstraint& one = model.constraints[k];
                    one.point = begin[k].point + share * way;
                    one.point_speed = way / duration;
                    one.turning = turn / duration;
                    one.direction =
                        Eigen::AngleAxisd(share * turn.norm(), turn.normalized()) *
                        begin[k].direction;
                }
            },
            duration);
        RodState state(rod);
        Eigen::VectorXd velocity = Eigen::VectorXd::Zero(state.x().size());
        // As all of it would be carried, so that nothing jumps at the begin.
        for (int k = 0; k < rod.num_controls(); ++k)
            velocity.segment<3>(rod.layout().control[idx(k)]) =
                (way + turn.cross(state.control(k))) / duration;
        for (const auto& [unknown, value] : spin_at(state, 0.0))
            velocity[unknown] = turn.x() / duration / value;
        RodStepper stepper(model, Integrator::RungeKutta);
        for (int k = 0; k < steps; ++k)
            EXPECT_EQ(stepper.step(state, velocity, duration / steps).stop,
                      MotionStop::Converged);
        // Angles count from vectors that depend on the steps: of those only frames tell.
        Eigen::Matrix<double, 3, 4> end;
        const double s = 0.7 * rod.basis().end();
        end << state.frame(s), state.at(s).place;
        return end;
    };
    const auto a = end_with(100), b = end_with(200), c = end_with(400);
    const auto order_of = [&](int first, int count)
    {
        return std::log2((b - a).middleCols(first, count).norm() /
                         (c - b).middleCols(first, count).norm());
    };
    EXPECT_GT(order_of(3, 1), 3.7); // place
    EXPECT_GT(order_of(0, 3), 3.7); // frame
}

TEST(RodMass, is_the_mass_of_the_rod_and_its_inverse_undoes_it)
{
    const Rod rod = rubber(9);
    const RodMass mass(rod);
    EXPECT_NEAR(mass.total(), 1000.0 * std::numbers::pi * 1e-4, 1e-12);
    std::mt19937 rng(2);
    const Eigen::VectorXd v = support::random_step(rod.layout().num_unknowns, 1.0, rng);
    EXPECT_LT((mass.solved(mass.times(v)) - v).norm(), 1e-10 * v.norm());
    BandMatrix M(rod.layout().num_unknowns, rod.layout().half_band);
    mass.add_to(M, 2.0);
    Eigen::VectorXd y;
    M.multiply(v, y);
    EXPECT_LT((y - 2.0 * mass.times(v)).norm(), 1e-12 * y.norm());
}

} // namespace cellwarp::core
