// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/field/rbf_kernel.h"

#include <cmath>
#include <cstring>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/shapes.h"

namespace cellwarp
{

TEST(RbfKernel, every_instruction_set_gives_the_bits_of_the_plain_sums)
{
    std::mt19937 rng(5);
    for (const std::size_t n : {std::size_t(8), std::size_t(40), std::size_t(328)})
    {
        std::vector<double> rows(6 * n);
        for (double& number : rows)
            number = support::random_number(rng, -1.0, 1.0);
        RbfRun plain;
        plain.rows = rows.data();
        plain.num_padded = n;
        for (double& x : plain.place)
            x = support::random_number(rng, -2.0, 2.0);
        const RbfRun asked = plain;
        rbf_kernels(InstructionSet::Plain).value(plain);
        // Against the sums written down plainly.
        double sums[3] = {}, slope = 0.0;
        for (std::size_t j = 0; j < n; ++j)
        {
            double d[3], squared = 0.0;
            for (std::size_t k = 0; k < 3; ++k)
            {
                d[k] = asked.place[k] - rows[k * n + j];
                squared += d[k] * d[k];
            }
            for (std::size_t k = 0; k < 3; ++k)
                sums[k] += squared * std::sqrt(squared) * rows[(3 + k) * n + j];
            slope += 3.0 * std::sqrt(squared) * d[1] * rows[5 * n + j];
        }
        for (std::size_t k = 0; k < 3; ++k)
            EXPECT_NEAR(plain.displacement[k], sums[k], 1e-11 * static_cast<double>(n));
        EXPECT_NEAR(plain.slopes[5], slope, 1e-11 * static_cast<double>(n));
        for (const InstructionSet set : instruction_sets())
        {
            RbfRun value = asked, displacement = asked;
            rbf_kernels(set).value(value);
            rbf_kernels(set).displacement(displacement);
            EXPECT_EQ(std::memcmp(value.displacement, plain.displacement,
                                  sizeof plain.displacement),
                      0);
            EXPECT_EQ(std::memcmp(value.slopes, plain.slopes, sizeof plain.slopes), 0);
            EXPECT_EQ(std::memcmp(displacement.displacement, plain.displacement,
                                  sizeof plain.displacement),
                      0);
        }
    }
}

} // namespace cellwarp
