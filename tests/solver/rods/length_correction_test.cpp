// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/rods/length_correction.h"

#include <algorithm>
#include <memory>

#include <gtest/gtest.h>

#include "solver/rods/elasticity.h"
#include "tests/support/rods.h"

namespace cellwarp::core
{

TEST(LengthCorrection, takes_back_what_a_step_stretches_and_keeps_what_holds_the_rod)
{
    // Slender: it bends 1e6 times as easily as it stretches.
    const Rod rod = support::straight_rod(1.0, 40, support::section_of(1e4, 1e-2, 1e-2));
    RodModel model(rod);
    support::clamp(model, 0.0);
    const RodState rest(rod);
    const std::unique_ptr<RodTerm> elasticity = exact_elasticity(rod);
    // All but its begin bends sideways, by as much as is asked for.
    const auto bent = [&](double size, bool is_corrected)
    {
        Eigen::VectorXd step = Eigen::VectorXd::Zero(rest.x().size());
        for (int k = 0; k < rod.num_controls(); ++k)
        {
            const double x = std::max(rest.control(k).x() - 0.1, 0.0);
            step[rod.layout().control[idx(k)] + 1] = size * x * x;
        }
        RodState moved = rest;
        moved.move(step);
        LengthCorrection correction(rod);
        if (is_corrected)
            correction.correct(rest, model.constraints, step, moved);
        return moved;
    };
    for (const double size : {0.05, 0.1})
    {
        const RodState plain = bent(size, false), corrected = bent(size, true);
        EXPECT_LT(elasticity->value(corrected), 0.05 * elasticity->value(plain));
        // To second order it is where the step has led.
        EXPECT_LT((corrected.x() - plain.x()).lpNorm<Eigen::Infinity>(),
                  2.0 * size * size);
        EXPECT_LT(model.violations(corrected).lpNorm<Eigen::Infinity>(), 1e-12);
    }
    // It is of second order: with half the step a quarter.
    const double of_one = (bent(0.02, true).x() - bent(0.02, false).x()).norm(),
                 of_half = (bent(0.01, true).x() - bent(0.01, false).x()).norm();
    EXPECT_NEAR(of_one / of_half, 4.0, 0.05);
}

} // namespace cellwarp::core
