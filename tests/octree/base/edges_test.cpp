// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/base/edges.h"

#include <array>
#include <map>
#include <random>

#include <gtest/gtest.h>

namespace cellwarp::core
{

TEST(Edges, come_once_each_ascending_with_all_that_pass_them)
{
    std::mt19937 rng(3);
    for (const std::uint32_t corners : {1u, 2u, 9u, 20000u})
    {
        std::vector<std::array<std::uint32_t, 2>> passes(3 * corners);
        for (auto& [a, b] : passes)
        {
            a = static_cast<std::uint32_t>(rng() % corners);
            b = static_cast<std::uint32_t>(rng() % corners);
        }
        std::map<std::pair<std::uint32_t, std::uint32_t>, std::pair<int, int>> expected;
        for (const auto& [a, b] : passes)
        {
            auto& [forward, backward] = expected[{std::min(a, b), std::max(a, b)}];
            ++(a > b ? backward : forward);
        }
        auto next = expected.begin();
        for_each_edge(
            corners,
            [&](const auto& pass)
            {
                for (const auto& [a, b] : passes)
                    pass(a, b);
            },
            [&](const Edge& edge)
            {
                ASSERT_NE(next, expected.end());
                EXPECT_EQ(std::pair(edge.low, edge.high), next->first);
                EXPECT_EQ(std::pair(edge.forward, edge.backward), next->second);
                ++next;
            });
        EXPECT_EQ(next, expected.end());
    }
}

TEST(Edges, of_nothing_are_none)
{
    for_each_edge(
        0, [](const auto&) {}, [](const Edge&) { FAIL(); });
}

} // namespace cellwarp::core
