// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/rods/gauss.h"

#include <cmath>

#include <gtest/gtest.h>

namespace cellwarp::core
{

TEST(Gauss, integrates_polynomials_up_to_its_degree_and_no_further)
{
    for (int count = 1; count <= kMaxGaussPlaces; ++count)
        for (int power = 0; power <= 2 * count; ++power)
        {
            double sum = 0.0;
            for (std::size_t k = 0; k < gauss_places(count).size(); ++k)
                sum += gauss_weights(count)[k] * std::pow(gauss_places(count)[k], power);
            const double error = std::abs(sum - 1.0 / (power + 1));
            if (power < 2 * count)
                EXPECT_LT(error, 1e-15) << count << " " << power;
            else
                EXPECT_GT(error, 1e-11) << count << " " << power;
        }
}

} // namespace cellwarp::core
