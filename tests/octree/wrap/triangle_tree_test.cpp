// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/wrap/triangle_tree.h"

#include <algorithm>
#include <random>

#include <gtest/gtest.h>

namespace cellwarp::core
{

TEST(TriangleTree, finds_what_a_cube_meets_and_nothing_far_away)
{
    std::mt19937 rng(5);
    std::uniform_real_distribution<double> uniform(-1.0, 1.0);
    const auto random = [&]
    { return Eigen::Vector3d(uniform(rng), uniform(rng), uniform(rng)); };
    std::vector<Eigen::Vector3d> vertices;
    std::vector<std::array<std::uint32_t, 3>> triangles;
    for (std::uint32_t k = 0; k < 300; ++k)
    {
        const Eigen::Vector3d middle = 3.0 * random();
        for (int c = 0; c < 3; ++c)
            vertices.push_back(middle + 0.3 * random());
        triangles.push_back({3 * k, 3 * k + 1, 3 * k + 2});
    }
    const TriangleTree tree(vertices, triangles);
    std::size_t met = 0;
    for (int query = 0; query < 100; ++query)
    {
        const Eigen::Vector3d place = 3.0 * random();
        constexpr double kReach = 0.4;
        std::vector<std::uint32_t> found;
        tree.near(place, kReach, found);
        EXPECT_TRUE(std::is_sorted(found.begin(), found.end()));
        met += found.size();
        for (std::uint32_t k = 0; k < triangles.size(); ++k)
        {
            bool is_met = false, is_off = false;
            for (int a = 0; a <= 20 && !is_met; ++a)
                for (int b = 0; a + b <= 20 && !is_met; ++b)
                {
                    const Eigen::Vector3d x =
                        vertices[3 * k] +
                        a / 20.0 * (vertices[3 * k + 1] - vertices[3 * k]) +
                        b / 20.0 * (vertices[3 * k + 2] - vertices[3 * k]);
                    is_met = (x - place).cwiseAbs().maxCoeff() <= kReach;
                }
            for (int c = 0; c < 3; ++c)
            {
                const auto of = [&](int corner)
                { return vertices[3 * k + std::size_t(corner)][c]; };
                const auto [low, high] = std::minmax({of(0), of(1), of(2)});
                is_off = is_off || low > place[c] + kReach || high < place[c] - kReach;
            }
            const bool is_found = std::binary_search(found.begin(), found.end(), k);
            EXPECT_TRUE(!is_met || is_found);
            EXPECT_TRUE(!is_off || !is_found);
        }
    }
    EXPECT_GT(met, 50u);
}

} // namespace cellwarp::core
