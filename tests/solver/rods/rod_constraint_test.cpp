// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/rods/rod_constraint.h"

#include <cmath>
#include <random>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "tests/support/rods.h"

namespace cellwarp::core
{

namespace
{

Rod bent_rod()
{
    std::mt19937 rng(3);
    std::normal_distribution<double> normal(0.0, 0.05);
    std::vector<Eigen::Vector3d> q;
    for (int i = 0; i < 9; ++i)
        q.emplace_back(std::cos(0.3 * i) + normal(rng), std::sin(0.3 * i) + normal(rng),
                       0.2 * i);
    return Rod({SplineBasis::open(3, SplineBasis::clamped_knots(3, 9)), std::move(q)},
               [](double) { return support::section_of(50.0, 1.0, 0.7); }, {});
}

/// One of each kind at a place, off the state by less than a right angle.
std::vector<RodConstraint> all_at(const RodState& state, double s)
{
    const Eigen::Matrix3d off =
        Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
    std::vector<RodConstraint> all;
    for (int hold = 0; hold <= static_cast<int>(HoldKind::Frame); ++hold)
    {
        RodConstraint c;
        c.hold = static_cast<HoldKind>(hold);
        c.s = s;
        c.point = {0.1, 0.2, 0.3};
        c.direction = {0.5, 0.6, 0.9};
        if (c.hold == HoldKind::TwistAngle)
            c.direction = state.frame(s).col(0) + 0.4 * Eigen::Vector3d(0.3, -0.8, 0.5);
        if (c.hold == HoldKind::Spin)
        {
            const Eigen::Matrix3d F = off * state.frame(s);
            c.tangent = F.col(2);
            c.direction = F.col(0);
            c.spin = 0.2;
        }
        if (c.hold == HoldKind::Frame)
            c.frame = state.frame(s) * off;
        all.push_back(c);
    }
    return all;
}

double entry(const ConstraintRow& row, int unknown)
{
    for (const auto& [at, value] : row.entries)
        if (at == unknown)
            return value;
    return 0.0;
}

/// By differences, of what \p rows tell of the state.
void expect_derivatives(const RodConstraint& constraint, const RodState& state,
                        const HeldBasis& basis, const std::vector<ConstraintRow>& rows)
{
    const int n = state.rod().layout().num_unknowns;
    for (int i = 0; i < n; ++i)
    {
        RodState ahead = state, behind = state;
        ahead.move(Eigen::VectorXd::Unit(n, i), 1e-6);
        behind.move(Eigen::VectorXd::Unit(n, i), -1e-6);
        const auto after = rows_of(constraint, ahead, basis),
                   before = rows_of(constraint, behind, basis);
        for (std::size_t k = 0; k < rows.size(); ++k)
            EXPECT_NEAR((after[k].violation - before[k].violation) / 2e-6,
                        entry(rows[k], i), 2e-8);
    }
}

} // namespace

TEST(RodConstraint, rows_are_the_derivatives_of_what_is_violated)
{
    const Rod rod = bent_rod();
    std::mt19937 rng(5);
    RodState state(rod);
    const int n = rod.layout().num_unknowns;
    state.move(support::random_step(n, 0.05, rng));
    for (const double s : {0.0, 2.37, 4.0, 6.0})
        for (const RodConstraint& constraint : all_at(state, s))
        {
            SCOPED_TRACE(testing::Message()
                         << static_cast<int>(constraint.hold) << " at " << s);
            const HeldBasis basis(constraint, rod.basis());
            const std::vector<ConstraintRow> rows = rows_of(constraint, state, basis);
            ASSERT_EQ(static_cast<int>(rows.size()), num_rows(constraint.hold));
            if (constraint.hold == HoldKind::GeometricCurvature)
                continue; // its directions are those of the state: the next test
            expect_derivatives(constraint, state, basis, rows);
        }
}

TEST(RodConstraint, rows_of_a_curvature_that_is_met_are_its_derivatives)
{
    // Where nothing is violated it does not count that the directions turn.
    const Rod rod = bent_rod();
    std::mt19937 rng(6);
    RodState state(rod);
    const int n = rod.layout().num_unknowns;
    state.move(support::random_step(n, 0.05, rng));
    for (const double s : {0.0, 2.37, 4.0, 6.0})
    {
        SCOPED_TRACE(s);
        const CurvePoint at = state.at(s);
        RodConstraint c;
        c.hold = HoldKind::GeometricCurvature;
        c.s = s;
        c.direction = at.first.cross(at.second) /
                      (at.first.squaredNorm() * rod.rest().at(s).first.norm());
        const HeldBasis basis(c, rod.basis());
        const std::vector<ConstraintRow> rows = rows_of(c, state, basis);
        ASSERT_EQ(rows.size(), 2u);
        for (const ConstraintRow& row : rows)
            EXPECT_NEAR(row.violation, 0.0, 1e-12);
        expect_derivatives(c, state, basis, rows);
    }
}

TEST(RodConstraint, a_curvature_is_that_of_the_circle_through_the_curve)
{
    const Rod rod(support::circle(2.0, 48),
                  [](double) { return support::section_of(50.0, 1.0, 0.7); }, {});
    const RodState state(rod);
    RodConstraint c;
    c.hold = HoldKind::GeometricCurvature;
    c.s = 1.3;
    c.direction = {0, 0, 0.5}; // about z, 1 / radius
    for (const ConstraintRow& row : rows_of(c, state, HeldBasis(c, rod.basis())))
        EXPECT_NEAR(row.violation, 0.0, 1e-3);
}

TEST(RodConstraint, a_curvature_that_turns_says_how_fast_it_is_violated)
{
    const Rod rod = bent_rod();
    RodState state(rod);
    RodConstraint c;
    c.hold = HoldKind::GeometricCurvature;
    c.s = 2.37;
    c.direction = {0.3, -0.2, 0.4};
    c.turning = {0.3, -0.7, 0.5};
    const HeldBasis basis(c, rod.basis());
    const auto rows_after = [&](double time)
    {
        RodConstraint later = c;
        later.direction =
            Eigen::AngleAxisd(time * c.turning.norm(), c.turning.normalized()) *
            c.direction;
        return rows_of(later, state, basis);
    };
    constexpr double h = 1e-5;
    const std::vector<ConstraintRow> now = rows_after(0.0), ahead = rows_after(h),
                                     behind = rows_after(-h);
    for (const std::size_t k : {0u, 1u})
    {
        EXPECT_NEAR((ahead[k].violation - behind[k].violation) / (2.0 * h), now[k].rate,
                    1e-9);
        EXPECT_GT(std::abs(now[k].rate), 1e-3);
    }
}

TEST(RodConstraint, rates_are_the_derivatives_by_time_of_constraints_that_move)
{
    const Rod rod = bent_rod();
    std::mt19937 rng(7);
    RodState state(rod);
    const int n = rod.layout().num_unknowns;
    state.move(support::random_step(n, 0.05, rng));
    const Eigen::VectorXd v = support::random_step(n, 1.0, rng);
    const Eigen::Vector3d w(0.3, -0.7, 0.5);
    for (const RodConstraint& one : all_at(state, 2.37))
    {
        // Rows of two directions turn about the one between them: only their sum of
        // squares is of the constraint.
        if (one.hold > HoldKind::Spin || one.hold == HoldKind::GeometricCurvature)
            continue;
        SCOPED_TRACE(static_cast<int>(one.hold));
        RodConstraint c = one;
        c.point_speed = {0.4, 0.1, -0.2};
        c.turning = w;
        c.spin_speed = 0.6;
        const auto half_square = [&](double time)
        {
            RodConstraint later = c;
            later.point += time * c.point_speed;
            later.spin += time * c.spin_speed;
            if (c.hold != HoldKind::Spin)
                later.direction =
                    Eigen::AngleAxisd(time * w.norm(), w.normalized()) * c.direction;
            RodState there = state;
            there.move(v, time);
            double sum = 0.0;
            for (const ConstraintRow& row :
                 rows_of(later, there, HeldBasis(c, rod.basis()), false))
                sum += 0.5 * row.violation * row.violation;
            return sum;
        };
        const std::vector<ConstraintRow> rows =
            rows_of(c, state, HeldBasis(c, rod.basis()));
        const std::vector<double> bent = convective(c, state, v);
        double first = 0.0, second = 0.0;
        for (std::size_t k = 0; k < rows.size(); ++k)
        {
            double speed = rows[k].rate;
            for (const auto& [unknown, value] : rows[k].entries)
                speed += value * v[unknown];
            first += rows[k].violation * speed;
            second += speed * speed + rows[k].violation * bent[k];
        }
        const double h = 1e-4;
        EXPECT_NEAR((half_square(h) - half_square(-h)) / (2.0 * h), first,
                    1e-6 * std::max(1.0, std::abs(first)));
        EXPECT_NEAR((half_square(h) - 2.0 * half_square(0.0) + half_square(-h)) / (h * h),
                    second, 1e-5 * std::max(1.0, std::abs(second)));
    }
}

} // namespace cellwarp::core
