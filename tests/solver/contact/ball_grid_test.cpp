// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/contact/ball_grid.h"

#include <algorithm>
#include <random>

#include <gtest/gtest.h>

namespace cellwarp::core
{

TEST(BallGrid, finds_every_pair_once)
{
    std::mt19937 rng(4);
    BallGrid grid;
    for (const double size : {0.5, 3.0, 1e4})
    {
        std::uniform_real_distribution<double> uniform(-size, size);
        std::vector<Eigen::Vector3d> centres;
        for (int k = 0; k < 400; ++k)
            centres.emplace_back(uniform(rng), 0.1 * uniform(rng), 0.1 * uniform(rng));
        centres.push_back(centres[7]); // at the same place
        // Of very different sizes.
        std::vector<double> radii;
        for (std::size_t k = 0; k < centres.size(); ++k)
            radii.push_back(k % 50 == 0 ? 0.4 : k % 3 == 0 ? 0.02 : 0.1);
        std::vector<std::pair<std::uint32_t, std::uint32_t>> wanted;
        for (std::uint32_t i = 0; i < centres.size(); ++i)
            for (std::uint32_t j = i + 1; j < centres.size(); ++j)
                if ((centres[i] - centres[j]).norm() < radii[i] + radii[j] + 0.1)
                    wanted.emplace_back(i, j);
        auto found = grid.pairs(centres, radii, 0.1);
        EXPECT_EQ(found, grid.pairs(centres, radii, 0.1)); // the same order
        std::sort(found.begin(), found.end());
        EXPECT_EQ(found, wanted);
        EXPECT_FALSE(found.empty());
        EXPECT_EQ(grid.pairs(centres, radii, 0.1, found.size()).size(), found.size());
        EXPECT_EQ(grid.pairs(centres, radii, 0.1, found.size() - 1).size(), found.size());
        EXPECT_EQ(grid.pairs(centres, radii, 1e9, 20).size(), 21u); // of 80,200
    }
    EXPECT_TRUE(grid.pairs({}, {}, 1.0).empty());
}

} // namespace cellwarp::core
