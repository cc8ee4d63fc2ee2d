// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/rods/inner_forces.h"

#include <cmath>
#include <numbers>
#include <vector>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "solver/rods/rod_newton.h"
#include "tests/support/rods.h"

namespace cellwarp::core
{

TEST(InnerForces, of_a_rod_that_is_loaded_at_its_end_are_in_balance_with_that)
{
    // An arc that is curved at rest, bent out of its plane and twisted.
    std::vector<Eigen::Vector3d> points;
    for (int k = 0; k <= 12; ++k)
        points.emplace_back(std::sin(k / 12.0), 1.0 - std::cos(k / 12.0), 0.0);
    const Rod rod(spline_through(points, false, 4),
                  [](double) { return support::section_of(1e5, 2.0, 1.5); }, {});
    RodModel model(rod);
    model.terms.push_back(exact_elasticity(rod));
    support::clamp(model, 0.0);
    RodLoad load;
    load.s = rod.basis().end();
    load.force = {0.3, 0.4, 1.0};
    load.moment = {0.2, -0.1, 0.3};
    model.loads.push_back(load);
    RodState state(rod);
    ASSERT_EQ(RodNewton(model).solve(state).stop, MotionStop::Converged);
    const InnerForces forces(state);
    const Eigen::Vector3d tip = state.at(load.s).place;
    for (std::size_t e = 0; e < rod.spans().size(); ++e)
        for (const double share : {0.0, 0.4, 1.0})
        {
            const RodSpan& span = rod.spans()[e];
            const double s = span.begin + share * (span.end - span.begin);
            const SectionForces at = forces.in(e, s);
            const CurvePoint now = state.at(s);
            const Eigen::Vector3d t = now.first.normalized();
            // The rest curve has no curvature at its very ends, and tension ripples
            // there by up to an eighth of the force, 1.1 N.
            EXPECT_NEAR(at.tension, load.force.dot(t), e < 5 || e >= 43 ? 0.14 : 5e-4);
            EXPECT_LT((at.shear - (load.force - t.dot(load.force) * t)).norm(), 5e-2);
            const Eigen::Vector3d moment =
                load.moment + (tip - now.place).cross(load.force);
            EXPECT_LT((at.moment - moment).norm(), 3e-3);
            EXPECT_NEAR(at.torque, moment.dot(t), 3e-3);
        }
}

TEST(InnerForces, of_a_ring_do_not_know_where_its_seam_is)
{
    // The same ring, squeezed at four places, from two seams: a quarter of a turn apart.
    const auto forces_at = [](int degree, int from, int quarter)
    {
        constexpr int kPoints = 40;
        std::vector<Eigen::Vector3d> points;
        for (int k = 0; k < kPoints; ++k)
        {
            const double a = 2.0 * std::numbers::pi * (k + from) / kPoints;
            const double r = 1.0 + 0.1 * std::cos(4.0 * a + 0.7);
            points.emplace_back(r * std::cos(a), r * std::sin(a), 0.0);
        }
        const Rod rod(spline_through(points, true, 1, degree),
                      [](double) { return support::section_of(1e3, 2.0, 1.5); },
                      {.rest = RodRest::Straight});
        const RodState state(rod);
        const std::size_t e =
            static_cast<std::size_t>((quarter - from + kPoints) % kPoints);
        const InnerForces forces(state);
        return forces.in(e, rod.spans()[e].begin);
    };
    for (const int degree : {2, 3})
        for (const int place : {0, 1, 39})
        {
            SCOPED_TRACE(testing::Message() << degree << " " << place);
            const SectionForces seam = forces_at(degree, 0, place),
                                inside = forces_at(degree, 20, place);
            EXPECT_NEAR(seam.tension, inside.tension, 1e-9 * std::abs(inside.tension));
            EXPECT_LT((seam.moment - inside.moment).norm(), 1e-9 * inside.moment.norm());
            EXPECT_LT((seam.shear - inside.shear).norm(),
                      1e-8 * (inside.shear.norm() + inside.moment.norm()));
        }
}

} // namespace cellwarp::core
