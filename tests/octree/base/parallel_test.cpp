// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/base/parallel.h"

#include <random>
#include <tuple>
#include <utility>

#include <gtest/gtest.h>

namespace cellwarp::core
{

TEST(Parallel, sorting_gives_what_one_thread_would)
{
    std::mt19937 rng(4);
    // Around the size from which on parts are sorted at once, and sizes that no number
    // of parts divides.
    for (const std::size_t size : {0u, 1u, 16383u, 16384u, 16399u, 100003u})
    {
        std::vector<std::pair<unsigned, unsigned>> values(size);
        for (auto& [key, number] : values)
            std::tie(key, number) = std::pair(rng() % 1000, rng() % 5); // many are equal
        std::vector<std::pair<unsigned, unsigned>> wanted = values;
        std::sort(wanted.begin(), wanted.end());
        std::vector<std::pair<unsigned, unsigned>> alone = values;
        {
            const ThreadLimit limit(1);
            parallel_sort(alone);
        }
        parallel_sort(values);
        EXPECT_EQ(values, wanted) << size;
        EXPECT_EQ(alone, wanted) << size;
        parallel_sort(values); // of what is sorted
        EXPECT_EQ(values, wanted) << size;
    }
}

} // namespace cellwarp::core
