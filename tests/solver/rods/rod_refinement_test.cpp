// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/rods/rod_refinement.h"

#include <cmath>
#include <memory>
#include <numbers>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "solver/rods/rod_newton.h"
#include "solver/rods/rod_stepper.h"
#include "solver/rods/springs.h"
#include "solver/rods/tensor_stretch.h"
#include "tests/support/rods.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

/// A rod in motion with a model of its own.
struct Moving
{
    Rod rod;
    RodModel model;
    RodState state;
    Eigen::VectorXd velocity;

    explicit Moving(Rod of, bool is_discrete = false)
        : rod(std::move(of)), model(rod), state(rod),
          velocity(Eigen::VectorXd::Zero(rod.layout().num_unknowns))
    {
        model.terms.push_back(exact_elasticity(rod, {}));
        if (is_discrete)
            model.terms.push_back(spring_elasticity(rod));
        else
            model.terms.push_back(tensor_stretch(rod));
    }
    Moving(const Moving&) = delete;
    MovingRod all() { return {rod, model, state, velocity}; }
    void shake(double size)
    {
        std::mt19937 rng(7);
        state.move(support::random_step(rod.layout().num_unknowns, size, rng));
        velocity = support::random_step(rod.layout().num_unknowns, 1.0, rng);
    }
};

std::vector<support::RodCase> cases()
{
    std::vector<support::RodCase> out;
    for (const bool is_closed : {false, true})
        for (const bool is_round : {false, true})
            for (const int degree : {2, 3, 5})
                out.push_back({is_closed, is_round, true, degree});
    return out;
}

/// Knots at places that lie in spans of every kind, and one on an old knot.
std::vector<double> places(const Rod& rod)
{
    const double begin = rod.basis().begin(), length = rod.basis().end() - begin;
    return {begin + 0.02 * length, begin + 0.31 * length, begin + 0.32 * length,
            rod.basis().spans()[1].begin, begin + 0.97 * length};
}

/// Velocities without spin: that is linear between stations, but the tangent is not.
Eigen::VectorXd still(const Moving& moving)
{
    Eigen::VectorXd v = moving.velocity;
    for (const int angle : moving.rod.layout().angle)
        v[angle] = 0.0;
    return v;
}

} // namespace

TEST(RodRefinement, a_knot_leaves_curve_velocities_and_momentum_as_they_are)
{
    for (const support::RodCase& of : cases())
    {
        SCOPED_TRACE(testing::Message() << of.is_closed << of.is_round << of.degree);
        Moving moving(support::crooked_rod(of, {}));
        moving.shake(0.02);
        for (const double s : places(moving.rod))
        {
            const RodState before = moving.state;
            const Spline curve = before.curve();
            const RodMass& mass = moving.model.mass();
            const double total = mass.total(),
                         kinetic = mass.kinetic_energy(moving.velocity);
            const Vector3d momentum = mass.momentum(moving.velocity),
                           turning = mass.angular_momentum(before, still(moving));
            insert_knot(moving.all(), s);
            EXPECT_NEAR(mass.total(), total, 1e-14 * total);
            EXPECT_NEAR((mass.momentum(moving.velocity) - momentum).norm(), 0.0, 1e-13);
            EXPECT_NEAR(
                (mass.angular_momentum(moving.state, still(moving)) - turning).norm(),
                0.0, 1e-12);
            EXPECT_NEAR(mass.kinetic_energy(moving.velocity), kinetic, 1e-13 * kinetic);
            const Spline now = moving.state.curve();
            for (double x = 0.0; x <= 1.0; x += 0.01)
            {
                const double at =
                    curve.basis.begin() + x * (curve.basis.end() - curve.basis.begin());
                EXPECT_LT((now.at(at).place - curve.at(at).place).norm(), 1e-14);
            }
        }
    }
}

TEST(RodRefinement, a_rod_with_a_knot_more_is_the_rod_that_was_built_with_it)
{
    for (const support::RodCase& of : cases())
        for (const bool is_discrete : {false, true})
        {
            // Of others the material directions at rest depend on the knots.
            if (!of.is_round || (is_discrete && of.degree != 3))
                continue;
            SCOPED_TRACE(testing::Message()
                         << of.is_closed << of.is_round << of.degree << is_discrete);
            const RodSettings settings{RodRest::Given, 0.3, 0.0, is_discrete ? 2 : 1};
            Moving moving(support::crooked_rod(of, settings), is_discrete);
            Spline rest = moving.rod.rest();
            for (const double s : places(moving.rod))
            {
                insert_knot(moving.all(), s);
                rest = with_knot(rest, s);
            }
            const Rod& rod = moving.rod;
            Moving built(
                Rod(
                    rest, [&rod](double share) { return rod.section(share); }, settings),
                is_discrete);
            EXPECT_EQ(rod.layout().control, built.rod.layout().control);
            EXPECT_EQ(rod.layout().angle, built.rod.layout().angle);
            const int n = rod.layout().num_unknowns;
            ASSERT_EQ(n, built.rod.layout().num_unknowns);
            std::mt19937 rng(3);
            const Eigen::VectorXd v = support::random_step(n, 1.0, rng),
                                  step = support::random_step(n, 0.01, rng);
            // The one weighs by cubics of its own spans, the other by those it had.
            EXPECT_LT((moving.model.mass().times(v) - built.model.mass().times(v)).norm(),
                      1e-3 * built.model.mass().times(v).norm());
            EXPECT_NEAR(moving.model.elastic_energy(moving.state),
                        built.model.elastic_energy(built.state), 1e-9);
            Eigen::VectorXd moved, other;
            moving.state.move(step);
            built.state.move(step);
            const double energy = built.model.elastic_energy(built.state);
            EXPECT_NEAR(moving.model.elastic_energy(moving.state), energy, 1e-4 * energy);
            moving.model.gradient(moving.state, moved);
            built.model.gradient(built.state, other);
            EXPECT_LT((moved - other).norm(), 1e-3 * other.norm());
        }
}

TEST(RodRefinement,
     the_mass_of_an_even_rod_with_a_knot_more_is_that_of_the_rod_built_with_it)
{
    Moving moving(support::straight_rod(1.0, 9, support::section_of(1e3, 1.0, 1.0)));
    Spline rest = moving.rod.rest();
    for (const double share : {0.02, 0.31, 0.32, 0.97})
    {
        insert_knot(moving.all(), share * rest.basis.end());
        rest = with_knot(rest, share * rest.basis.end());
    }
    const Rod built(rest, [&](double) { return moving.rod.section(0.5); }, {});
    const RodMass mass(built);
    std::mt19937 rng(3);
    const Eigen::VectorXd v = support::random_step(built.layout().num_unknowns, 1.0, rng);
    EXPECT_LT((moving.model.mass().times(v) - mass.times(v)).norm(), 1e-14);
    EXPECT_LT((moving.model.mass().solved(v) - mass.solved(v)).norm(),
              1e-9 * mass.solved(v).norm());
}

TEST(RodRefinement, what_follows_has_the_derivatives_of_its_energy)
{
    for (const support::RodCase& of : cases())
    {
        SCOPED_TRACE(testing::Message() << of.is_closed << of.is_round << of.degree);
        Moving moving(support::crooked_rod(of, {RodRest::Given, 0.3, 0.0, 1}));
        for (const double s : places(moving.rod))
            insert_knot(moving.all(), s);
        for (const std::unique_ptr<RodTerm>& term : moving.model.terms)
            support::expect_derivatives(*term, moving.rod);
    }
}

TEST(RodRefinement, energies_change_by_quadrature_alone)
{
    // An arc with an even twist: the exact energy at 9, 16 and 30 points before and
    // after.
    double last = 1.0;
    for (const int spans : {6, 12, 24})
    {
        std::vector<Vector3d> points;
        for (int k = 0; k <= spans; ++k)
        {
            const double a = 1.5 * k / spans;
            points.emplace_back(std::sin(a), 1.0 - std::cos(a), 0.2 * a);
        }
        Moving moving(Rod(spline_through(points, false, 1),
                          [](double) { return support::section_of(10.0, 1.0, 0.7); },
                          {RodRest::Straight}));
        moving.model.terms.pop_back();
        for (int k = 0; k < moving.rod.num_stations(); ++k)
        {
            Eigen::VectorXd turn = Eigen::VectorXd::Zero(moving.state.x().size());
            turn[moving.rod.layout().angle[idx(k)]] = 0.3 * k / spans;
            moving.state.move(turn);
        }
        const double before = moving.model.elastic_energy(moving.state);
        insert_knot(moving.all(), 0.41 * moving.rod.basis().end());
        const double change =
            std::abs(moving.model.elastic_energy(moving.state) / before - 1.0);
        EXPECT_LT(change, 3e-4);
        EXPECT_LT(change, 0.3 * last);
        last = change;
    }
}

TEST(RodRefinement, a_knot_that_came_goes_without_a_trace)
{
    for (const support::RodCase& of : cases())
    {
        SCOPED_TRACE(testing::Message() << of.is_closed << of.is_round << of.degree);
        Moving moving(support::crooked_rod(of, {}));
        moving.shake(0.02);
        const double begin = moving.rod.basis().begin();
        const double s = begin + 0.52 * (moving.rod.basis().end() - begin);
        const Eigen::VectorXd x = moving.state.x(), v = moving.velocity;
        const double energy = moving.model.elastic_energy(moving.state);
        Eigen::VectorXd gradient, again;
        moving.model.gradient(moving.state, gradient);
        insert_knot(moving.all(), s);
        const std::size_t span = idx(moving.rod.basis().span_of(s));
        ASSERT_TRUE(remove_knot(moving.all(), span, 1e-9));
        EXPECT_LT((moving.state.x() - x).norm(), 1e-12);
        EXPECT_LT((moving.velocity - v).norm(), 1e-9);
        EXPECT_NEAR(moving.model.elastic_energy(moving.state), energy, 1e-10 * energy);
        moving.model.gradient(moving.state, again);
        EXPECT_LT((gradient - again).norm(), 1e-9 * gradient.norm());
    }
}

TEST(RodRefinement, a_knot_goes_with_the_momentum_kept_and_no_energy_won)
{
    Moving moving(support::crooked_rod({false, true, true, 3}, {}));
    insert_knot(moving.all(), 0.4 * moving.rod.basis().end());
    moving.shake(1e-3);
    const std::size_t span =
        idx(moving.rod.basis().span_of(0.4 * moving.rod.basis().end()));
    const RodMass& mass = moving.model.mass();
    const double kinetic = mass.kinetic_energy(moving.velocity), total = mass.total();
    const Vector3d momentum = mass.momentum(moving.velocity);
    EXPECT_FALSE(remove_knot(moving.all(), span, 1e-9));
    EXPECT_EQ(mass.kinetic_energy(moving.velocity), kinetic);
    ASSERT_TRUE(remove_knot(moving.all(), span, 0.1));
    EXPECT_NEAR((mass.momentum(moving.velocity) - momentum).norm(), 0.0, 1e-12);
    EXPECT_LT(mass.kinetic_energy(moving.velocity), kinetic);
    EXPECT_NEAR(mass.total(), total, 1e-13);
    // Not one that the rest curve needs, at an end, or of a hinge.
    EXPECT_FALSE(remove_knot(moving.all(), 2, 1.0));
    EXPECT_FALSE(remove_knot(moving.all(), 0, 1.0));
}

TEST(RodRefinement, a_cut_leaves_two_rods_that_share_nothing)
{
    for (const support::RodCase& of : cases())
    {
        if (of.is_closed)
            continue;
        SCOPED_TRACE(testing::Message() << of.is_round << of.degree);
        Moving moving(support::crooked_rod(of, {RodRest::Given, 0.0, 0.0, 1}));
        moving.shake(0.02);
        const double s = moving.rod.arc_length().parameter(0.4);
        const RodMass& mass = moving.model.mass();
        const double total = mass.total();
        const Vector3d momentum = mass.momentum(moving.velocity);
        cut(moving.all(), s);
        ASSERT_EQ(moving.rod.pieces().size(), 2u);
        EXPECT_NEAR(mass.total(), total, 1e-13 * total);
        EXPECT_NEAR((mass.momentum(moving.velocity) - momentum).norm(), 0.0, 1e-12);
        // Its section may vary; the mass behind the cut is that of the control points
        // there.
        const int first = moving.rod.controls(idx(moving.rod.basis().span_of(s)))[0];
        const double behind = mass.weights().tail(mass.weights().size() - first).sum();
        EXPECT_NEAR(behind / total, 0.6, 0.02);
        // One piece moves: the other feels nothing of it.
        Eigen::VectorXd before, after;
        moving.model.gradient(moving.state, before);
        Eigen::VectorXd step = Eigen::VectorXd::Zero(moving.state.x().size());
        for (int k = first; k < moving.rod.num_controls(); ++k)
            step.segment<3>(moving.rod.layout().control[idx(k)]) =
                Vector3d(0.1 * k, 0.2, -0.1);
        moving.state.move(step);
        moving.model.gradient(moving.state, after);
        for (int k = 0; k < first; ++k)
        {
            const int at = moving.rod.layout().control[idx(k)];
            EXPECT_LT((before.segment<3>(at) - after.segment<3>(at)).norm(),
                      1e-12 * before.norm());
        }
        const Eigen::VectorXd held = mass.times(step);
        for (int k = 0; k < first; ++k)
            EXPECT_EQ(held.segment<3>(moving.rod.layout().control[idx(k)]),
                      Vector3d::Zero());
        for (const std::unique_ptr<RodTerm>& term : moving.model.terms)
            support::expect_derivatives(*term, moving.rod);
        EXPECT_THROW(cut(moving.all(), moving.rod.basis().begin()),
                     std::invalid_argument);
    }
}

TEST(RodRefinement, a_ring_is_one_rod_after_a_cut_and_two_after_the_next)
{
    Moving moving(support::crooked_rod({true, true, true, 3}, {}));
    const double begin = moving.rod.basis().begin(), end = moving.rod.basis().end();
    cut(moving.all(), begin);
    EXPECT_EQ(moving.rod.pieces().size(), 1u);
    EXPECT_NEAR(moving.rod.pieces()[0][1] - moving.rod.pieces()[0][0], end - begin,
                1e-12);
    cut(moving.all(), begin + 0.4 * (end - begin));
    EXPECT_EQ(moving.rod.pieces().size(), 2u);
    for (const std::unique_ptr<RodTerm>& term : moving.model.terms)
        support::expect_derivatives(*term, moving.rod);
}

TEST(RodRefinement, pieces_fall_side_by_side_and_what_slides_stays_on_its_own)
{
    Moving moving(support::straight_rod(1.0, 10, support::section_of(1e3, 1e-2, 1e-2)));
    moving.model.terms.pop_back();
    moving.model.gravity = {0, -10, 0};
    support::clamp(moving.model, 0.0);
    moving.model.slides.push_back({0.0, moving.rod.basis().end()});
    moving.state.sliding.push_back(
        begun(moving.model.slides[0], moving.rod.arc_length().parameter(0.7)));
    RodConstraint rail;
    rail.hold = HoldKind::Plane;
    rail.direction = Vector3d::UnitZ();
    rail.slide = 0;
    moving.model.constraints.push_back(rail);
    const double s = moving.rod.arc_length().parameter(0.45);
    cut(moving.all(), s);
    EXPECT_EQ(moving.model.slides[0].begin, s);
    RodStepper stepper(moving.model, Integrator::ImplicitEuler);
    constexpr int kSteps = 200;
    constexpr double dt = 1e-3;
    for (int k = 0; k < kSteps; ++k)
        EXPECT_EQ(stepper.step(moving.state, moving.velocity, dt).stop,
                  MotionStop::Converged);
    // Implicit Euler falls g t (t + dt) / 2.
    const double fallen = 10.0 * kSteps * dt * (kSteps + 1) * dt / 2.0;
    for (const double share : {0.46, 0.7, 1.0})
        EXPECT_NEAR(moving.state.at(moving.rod.arc_length().parameter(share)).place.y(),
                    -fallen, 1e-6);
    EXPECT_LT(moving.state.at(moving.rod.arc_length().parameter(0.44)).place.y(), -1e-3);
    EXPECT_NEAR(moving.state.at(0.0).place.norm(), 0.0, 1e-9);
}

TEST(RodRefinement, what_slides_stops_at_a_cut_or_leaves_there)
{
    for (const bool leaves : {false, true})
    {
        // The end behind the cut is pulled back through a hole.
        Moving moving(
            support::straight_rod(1.0, 12, support::section_of(1e3, 1e-2, 1e-2)));
        moving.model.terms.pop_back();
        RodSlide slide{0.0, moving.rod.basis().end()};
        slide.leaves = leaves;
        moving.model.slides.push_back(slide);
        const double s = moving.rod.arc_length().parameter(0.5),
                     at = moving.rod.arc_length().parameter(0.4);
        moving.state.sliding.push_back(begun(slide, at));
        RodConstraint hole;
        hole.slide = 0;
        hole.point = moving.state.at(at).place;
        moving.model.constraints.push_back(hole);
        cut(moving.all(), s);
        moving.model.loads.push_back({0.0, {-1, 0, 0}, Vector3d::Zero()});
        RodStepper stepper(moving.model, Integrator::ImplicitEuler);
        for (int k = 0; k < 200; ++k)
            ASSERT_EQ(stepper.step(moving.state, moving.velocity, 5e-3).stop,
                      MotionStop::Converged);
        EXPECT_EQ(moving.state.sliding[0].mode,
                  leaves ? Sliding::Mode::Gone : Sliding::Mode::AtEnd);
        EXPECT_NEAR(moving.state.sliding[0].s, s, 1e-6);
        const double end = moving.state.at(s - 1e-6).place.x();
        if (leaves)
            EXPECT_LT(end, 0.3);
        else
            EXPECT_NEAR(end, 0.4, 1e-3);
        EXPECT_NEAR(moving.state.at(moving.rod.basis().end()).place.x(), 1.0, 1e-9);
    }
}

TEST(RodRefinement, knots_come_where_it_bends_and_go_when_it_is_straight_again)
{
    Moving moving(support::straight_rod(1.0, 8, support::section_of(1e4, 1.0, 1.0)));
    moving.model.terms.pop_back();
    support::clamp(moving.model, 0.0);
    support::clamp(moving.model, moving.rod.basis().end());
    RodRefinement refinement({});
    const auto lead = [&](double turn, int steps)
    {
        for (int k = 0; k < steps; ++k)
        {
            // Both ends turn up and come together: a hairpin.
            const double a = turn * (k + 1) / steps;
            for (const std::size_t end : {0u, 1u})
            {
                const double sign = end == 0 ? 1.0 : -1.0;
                const Vector3d place(end == 0 ? 0.22 * a : 1.0 - 0.22 * a, 0, 0);
                moving.model.constraints[3 * end].point = place;
                moving.model.constraints[3 * end + 1].direction =
                    Vector3d(std::cos(a), sign * std::sin(a), 0);
                moving.model.constraints[3 * end + 2].direction = Vector3d::UnitZ();
            }
            RodNewton newton(moving.model);
            ASSERT_EQ(newton.solve(moving.state).stop, MotionStop::Converged);
            refinement.refine(moving.all(), {});
        }
    };
    const std::size_t before = moving.rod.spans().size();
    lead(0.5 * std::numbers::pi, 20);
    EXPECT_GT(moving.rod.spans().size(), before);
    for (std::size_t e = 0; e < moving.rod.spans().size(); ++e)
        EXPECT_LE(turn_of(moving.state, e), 0.55);
    for (const double a : {0.7, 0.3, 0.1, 0.0})
        lead(a, 1);
    // Not at once, but then all.
    EXPECT_GT(moving.rod.spans().size(), before);
    lead(0.0, 40);
    EXPECT_EQ(moving.rod.spans().size(), before);
}

TEST(RodRefinement, a_knot_stays_where_something_holds_or_touches)
{
    Moving moving(support::straight_rod(1.0, 8, support::section_of(1e4, 1.0, 1.0)));
    Eigen::VectorXd bend = Eigen::VectorXd::Zero(moving.state.x().size());
    for (int k = 0; k < moving.rod.num_controls(); ++k)
        bend[moving.rod.layout().control[idx(k)] + 1] = k % 2 == 0 ? 0.05 : -0.05;
    moving.state.move(bend);
    RodRefinement refinement({0.2, 0.3, 1e-3, 3, 0.1});
    EXPECT_EQ(refinement.refine(moving.all(), {}), 8);
    moving.state = RodState(moving.rod);
    const std::vector<double> used = {0.51 * moving.rod.basis().end()};
    for (int k = 0; k < 20; ++k)
        refinement.refine(moving.all(), used);
    EXPECT_EQ(moving.rod.spans().size(), 9u);
    for (int k = 0; k < 20; ++k)
        refinement.refine(moving.all(), {});
    EXPECT_EQ(moving.rod.spans().size(), 8u);
}

TEST(RodRefinement, finds_where_a_rod_breaks)
{
    Moving moving(support::straight_rod(1.0, 10, support::section_of(1e3, 1.0, 1.0)));
    moving.state.move_to(1.05 * moving.state.x());
    EXPECT_FALSE(breaking_place(moving.state, {{}, 51.0}));
    EXPECT_TRUE(breaking_place(moving.state, {{}, 49.0}));
    EXPECT_FALSE(breaking_place(moving.state, {0.1, {}}));
    Eigen::VectorXd step = Eigen::VectorXd::Zero(moving.state.x().size());
    step[moving.rod.layout().control[6] + 1] = 0.05;
    moving.state.move(step);
    const auto place = breaking_place(moving.state, {0.1, {}});
    ASSERT_TRUE(place);
    EXPECT_NEAR(*place, moving.rod.arc_length().parameter(0.5), 0.11);
}

} // namespace cellwarp::core
