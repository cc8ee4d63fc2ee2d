// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/contact/rod_contacts.h"

#include <cmath>
#include <list>
#include <numbers>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "solver/dynamics/implicit_stepper.h"
#include "solver/rods/rod_stepper.h"
#include "tests/support/rods.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

constexpr double kRadius = 0.02;

/// Rods that touch what they touch.
struct Scene
{
    struct One
    {
        Rod rod;
        RodModel model;
        RodState state;
        Eigen::VectorXd velocity;
        RodObject object;

        One(const Vector3d& from, const Vector3d& to, int spans, double young)
            : rod(spline_through(std::vector<Vector3d>{from, to}, false, spans),
                  [young](double) { return Section::round(kRadius, young, 0.3, 1000.0); },
                  {}),
              model(rod), state(rod),
              velocity(Eigen::VectorXd::Zero(rod.layout().num_unknowns)), object(model)
        {
            model.terms.push_back(exact_elasticity(rod));
            object.bind(state, velocity);
        }
        One(const One&) = delete;
        void throw_with(const Vector3d& v)
        {
            for (const int first : rod.layout().control)
                velocity.segment<3>(first) = v;
        }
    };
    std::list<One> rods;
    RodContacts contacts;

    explicit Scene(const ContactSettings& settings = {}) : contacts(settings) {}
    One& add(const Vector3d& from, const Vector3d& to, int spans = 10, double young = 1e6)
    {
        One& one = rods.emplace_back(from, to, spans, young);
        contacts.add_rod(
            {&one.model, &one.state, &one.velocity, {}, &one.object, rods.size() - 1});
        return one;
    }
    ImplicitStepper stepper()
    {
        std::vector<ArticulableObject*> objects;
        for (One& one : rods)
            objects.push_back(&one.object);
        return ImplicitStepper(objects, {}, 1e-9, &contacts);
    }
};

std::vector<Eigen::VectorXd> gradients(Scene& scene)
{
    std::vector<Eigen::VectorXd> out;
    for (const Scene::One& one : scene.rods)
        out.push_back(Eigen::VectorXd::Zero(one.state.x().size()));
    scene.contacts.linearise(out);
    return out;
}

} // namespace

TEST(RodContacts, forces_are_those_of_their_energy_and_stiffness_is_that_of_forces)
{
    for (const double friction : {0.0, 0.4})
    {
        Scene scene({friction, 0.7, 500.0});
        Scene::One& a = scene.add({-0.5, 0, 0.003}, {0.5, 0, 0});
        Scene::One& b = scene.add({0.01, 0.036, -0.5}, {0, 0.036, 0.5});
        scene.contacts.add_obstacle(plane_obstacle({0, 1, 0.1}, -0.017));
        for (Scene::One* one : {&a, &b})
            one->object.start(1e-3);
        scene.contacts.start(1e-3);
        std::mt19937 rng(2);
        for (Scene::One* one : {&a, &b})
            one->state.move(
                support::random_step(one->rod.layout().num_unknowns, 3e-4, rng));
        const auto gradient = gradients(scene);
        EXPECT_TRUE(scene.contacts.has_product());
        EXPECT_GT(scene.contacts.value(false), 0.0);
        constexpr double h = 1e-8;
        int number = 0;
        for (Scene::One* one : {&a, &b})
        {
            const Eigen::VectorXd x = one->state.x();
            for (Eigen::Index k = 0; k < x.size(); ++k)
            {
                const Eigen::VectorXd unit = Eigen::VectorXd::Unit(x.size(), k);
                one->state.move_to(x + h * unit);
                const double more = scene.contacts.value(false);
                one->state.move_to(x - h * unit);
                const double less = scene.contacts.value(false);
                one->state.move_to(x);
                EXPECT_NEAR((more - less) / (2.0 * h), gradient[std::size_t(number)][k],
                            2e-5);
            }
            ++number;
        }
        // What the objects have, and the products, make the change of the gradient.
        const Eigen::VectorXd y = support::random_step(b.rod.layout().num_unknowns, 1.0,
                                                       rng),
                              x = b.state.x();
        std::vector<Eigen::VectorXd> along = {Eigen::VectorXd::Zero(a.state.x().size()),
                                              y};
        std::vector<Eigen::VectorXd> product = {along[0],
                                                Eigen::VectorXd::Zero(y.size())};
        gradients(scene);
        scene.contacts.add_product(along, product);
        b.state.move_to(x + h * y);
        const auto more = gradients(scene);
        b.state.move_to(x - h * y);
        const auto less = gradients(scene);
        const Eigen::VectorXd other = (more[0] - less[0]) / (2.0 * h);
        EXPECT_GT(other.norm(), 1.0);
        EXPECT_LT((other - product[0]).norm(), 1e-4 * other.norm());
    }
}

TEST(RodContacts, a_rod_rests_on_a_plane_with_its_weight)
{
    for (const bool is_explicit : {false, true})
    {
        Scene scene({0.3, 1.0, 300.0});
        Scene::One& rod = scene.add({0, kRadius, 0}, {1, kRadius, 0});
        rod.model.gravity = {0, -9.81, 0};
        scene.contacts.add_obstacle(plane_obstacle({0, 1, 0}, 0));
        ImplicitStepper implicit = scene.stepper();
        RodStepper stepper(rod.model, Integrator::RungeKutta);
        for (int k = 0; k < 3000; ++k)
        {
            if (is_explicit)
            {
                rod.model.pushed = scene.contacts.forces(2e-4)[0];
                stepper.step(rod.state, rod.velocity, 2e-4);
            }
            else
                ASSERT_EQ(implicit.step(1e-3).stop, MotionStop::Converged);
        }
        // Balls overlap by what makes their sum the weight.
        const auto force = scene.contacts.forces(1e-5)[0];
        double up = 0.0;
        for (const int first : rod.rod.layout().control)
            up += force[first + 1];
        const double weight = 9.81 * rod.model.mass().total();
        EXPECT_NEAR(up, weight, 2e-3 * weight);
        for (const int first : rod.rod.layout().control)
            EXPECT_LT(rod.velocity.segment<3>(first).norm(), 2e-3);
    }
}

TEST(RodContacts, slips_down_a_slope_above_the_angle_of_friction_and_sticks_below)
{
    for (const double mu : {0.1, 0.8})
    {
        // 30 degrees: tan = 0.577.
        const double a = std::numbers::pi / 6.0;
        const Vector3d normal(std::sin(a), std::cos(a), 0),
            down(std::cos(a), -std::sin(a), 0);
        Scene scene({mu, 1.0, 5000.0});
        const Vector3d at = 0.9999 * kRadius * normal;
        Scene::One& rod = scene.add(at - Vector3d(0, 0, 0.5), at + Vector3d(0, 0, 0.5));
        rod.model.gravity = {0, -9.81, 0};
        scene.contacts.add_obstacle(plane_obstacle(normal, 0));
        ImplicitStepper stepper = scene.stepper();
        // Against the roll of a round thing: its turn is held.
        RodConstraint turn;
        turn.hold = HoldKind::TwistAngle;
        turn.direction = rod.state.frame(0.0).col(0);
        rod.model.constraints.push_back(turn);
        for (int k = 0; k < 200; ++k)
            ASSERT_EQ(stepper.step(1e-3).stop, MotionStop::Converged);
        const double v0 = rod.velocity.segment<3>(rod.rod.layout().control[5]).dot(down);
        for (int k = 0; k < 200; ++k)
            ASSERT_EQ(stepper.step(1e-3).stop, MotionStop::Converged);
        const double v1 = rod.velocity.segment<3>(rod.rod.layout().control[5]).dot(down);
        const double slides = 9.81 * (std::sin(a) - mu * std::cos(a));
        if (slides > 0.0)
            EXPECT_NEAR((v1 - v0) / 0.2, slides, 0.01 * slides);
        else
            EXPECT_LT(std::abs(v1), 0.1 * kRadius); // it creeps
    }
}

TEST(RodContacts, two_rods_that_meet_keep_their_momentum_and_win_no_energy)
{
    Scene scene({0.2, 0.5, {}});
    Scene::One& a = scene.add({-0.5, 0, 0}, {0.5, 0, 0});
    Scene::One& b = scene.add({0.1, 0.1, -0.5}, {0.1, 0.1, 0.5});
    a.throw_with({0, 2, 0});
    b.throw_with({0, -1, 0.5});
    const auto momentum = [&]
    {
        return Vector3d(a.model.mass().momentum(a.velocity) +
                        b.model.mass().momentum(b.velocity));
    };
    const auto energy = [&] { return a.object.energy().sum + b.object.energy().sum; };
    const Vector3d before = momentum();
    const double last = energy(), own = a.model.mass().momentum(a.velocity).y();
    ImplicitStepper stepper = scene.stepper();
    int touching = 0;
    for (int k = 0; k < 200; ++k)
    {
        ASSERT_EQ(stepper.step(1e-3).stop, MotionStop::Converged);
        touching += scene.contacts.report().count;
    }
    EXPECT_GT(touching, 10);
    EXPECT_LT((momentum() - before).norm(), 1e-8);
    EXPECT_LT(energy(), last);
    EXPECT_LT(a.model.mass().momentum(a.velocity).y(), 0.6 * own); // it was braked
    EXPECT_GE(*scene.contacts.report().least, 0.9);
}

TEST(RodContacts, nothing_goes_through_anything_at_any_speed)
{
    for (const double speed : {1.0, 20.0, 300.0})
        for (const int kind : {0, 1, 2, 3})
        {
            SCOPED_TRACE(testing::Message() << speed << " " << kind);
            Scene scene;
            Scene::One& rod = scene.add({-0.3, 0.5, 0}, {0.3, 0.5, 0}, 6, 1e7);
            rod.throw_with({0, -speed, 0});
            if (kind == 0)
                scene.contacts.add_obstacle(plane_obstacle({0, 1, 0}, 0));
            else if (kind == 1)
                scene.contacts.add_obstacle(sphere_obstacle({0, -0.5, 0}, 0.5));
            else if (kind == 2)
                scene.contacts.add_obstacle(
                    mesh_obstacle({{-9, 0, -9}, {9, 0, -9}, {0, 0, 9}}, {{0, 1, 2}}));
            else
            {
                Scene::One& other = scene.add({0, 0, -0.3}, {0, 0, 0.3}, 6, 1e7);
                for (const double s : {0.0, 0.5, 1.0})
                    support::clamp(other.model, other.rod.arc_length().parameter(s));
            }
            ImplicitStepper stepper = scene.stepper();
            double least = 1.0;
            const int steps = static_cast<int>(1000.0 / speed);
            for (int k = 0; k < steps; ++k)
            {
                stepper.step(1e-3);
                least = std::min(
                    least, rod.state.at(rod.rod.arc_length().parameter(0.5)).place.y());
            }
            EXPECT_GT(least, 0.0);
            EXPECT_LT(least, 0.1);
        }
}

TEST(RodContacts, a_step_in_which_all_might_come_to_all_has_to_be_shorter)
{
    // Two layers of rods that fly side by side: 2,400 balls, nearly 3 million pairs, if
    // each is looked for as far as it goes.
    Scene scene;
    for (int k = 0; k < 40; ++k)
        scene.add({-0.3, k % 2 * 0.06, 0.05 * k}, {0.3, k % 2 * 0.06, 0.05 * k});
    for (const double speed : {0.0, 995.0})
    {
        for (Scene::One& rod : scene.rods)
            rod.throw_with({0, -speed, 0});
        // A ball goes half its radius in a part, where something is near.
        EXPECT_EQ(scene.contacts.parts(1e-3), speed > 0.0 ? 100 : 1);
        EXPECT_EQ(scene.contacts.start(1e-3), speed == 0.0);
    }
}

TEST(RodContacts, a_rod_that_does_not_touch_itself_may_fly_as_fast_as_it_likes)
{
    ContactSettings settings;
    settings.with_itself = false;
    Scene scene(settings);
    scene.add({-20, 0, 0}, {20, 0, 0}, 20).throw_with({0, -5000, 0});
    EXPECT_TRUE(scene.contacts.start(1e-3));
    EXPECT_EQ(scene.contacts.parts(1e-3), 1);
}

TEST(RodContacts, tell_where_something_may_have_gone_through)
{
    // Too fast for the smallest part of a step, and too hard for so soft a rod.
    for (const auto& [speed, stiffness] : {std::pair(1e4, 1e4), {50.0, 1e-3}})
    {
        Scene scene({0.0, 1.0, stiffness});
        Scene::One& rod = scene.add({-0.3, 0.03, 0}, {0.3, 0.03, 0}, 6, 1e7);
        rod.throw_with({0, -speed, 0});
        scene.contacts.add_obstacle(
            mesh_obstacle({{-9, 0, -9}, {9, 0, -9}, {0, 0, 9}}, {{0, 1, 2}}));
        ImplicitStepper stepper = scene.stepper();
        MotionStop stop = MotionStop::Converged;
        for (int k = 0; k < 3 && stop == MotionStop::Converged; ++k)
            stop = stepper.step(1e-3).stop;
        EXPECT_EQ(stop, MotionStop::TooFast);
    }
}

TEST(RodContacts, knows_no_neighbours_along_a_rod_and_none_around_a_joint)
{
    // A ring of four times its thickness is no contact of its own.
    const Rod ring(support::circle(4.0 * kRadius, 12),
                   [](double) { return Section::round(kRadius, 1e6, 0.3, 1000.0); }, {});
    RodModel model(ring);
    RodState state(ring);
    const Eigen::VectorXd still = Eigen::VectorXd::Zero(state.x().size());
    RodObject object(model);
    Eigen::VectorXd velocity = still;
    object.bind(state, velocity);
    RodContacts contacts({});
    contacts.add_rod({&model, &state, &velocity, {}, &object, 0});
    contacts.start(1e-3);
    EXPECT_EQ(contacts.report().count, 0);
    EXPECT_GT(contacts.num_balls(), 40);
    // Two that cross at a joint.
    Scene scene;
    Scene::One& a = scene.add({-0.5, 0, 0}, {0.5, 0, 0});
    Scene::One& b = scene.add({0, 0, -0.5}, {0, 0, 0.5});
    scene.contacts.start(1e-3);
    EXPECT_GT(scene.contacts.report().count, 0);
    EXPECT_FALSE(scene.contacts.touched(0).empty());
    const double s = a.rod.arc_length().parameter(0.5);
    EXPECT_NEAR(scene.contacts.touched(0).front(), s, 0.1 * a.rod.basis().end());
    scene.contacts.exempt({0, s}, {1, b.rod.arc_length().parameter(0.5)});
    scene.contacts.start(1e-3);
    EXPECT_EQ(scene.contacts.report().count, 0);
}

TEST(RodContacts, balls_stand_half_a_radius_apart_and_do_not_flicker)
{
    Scene scene;
    Scene::One& rod = scene.add({0, 0, 0}, {1, 0, 0});
    scene.contacts.start(1e-3);
    const int count = scene.contacts.num_balls();
    EXPECT_GE(count, 101);
    EXPECT_LE(count, 111);
    // A little longer and shorter again.
    const Eigen::VectorXd x = rod.state.x();
    for (int k = 0; k < 20; ++k)
    {
        rod.state.move_to((1.0 + 0.01 * std::sin(k)) * x);
        scene.contacts.start(1e-3);
        EXPECT_EQ(scene.contacts.num_balls(), count);
    }
    rod.state.move_to(1.3 * x);
    scene.contacts.start(1e-3);
    EXPECT_GE(scene.contacts.num_balls(), 130);
}

} // namespace cellwarp::core
