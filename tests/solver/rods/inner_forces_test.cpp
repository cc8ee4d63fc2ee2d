// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/rods/inner_forces.h"

#include <cmath>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "solver/rods/rod_newton.h"
#include "tests/support/rods.h"

namespace cellwarp
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

} // namespace cellwarp
