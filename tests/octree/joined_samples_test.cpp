// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/joined_samples.h"

#include <random>

#include <gtest/gtest.h>

namespace cellwarp::core
{

TEST(JoinedSamples, are_the_first_at_their_place_whatever_the_number)
{
    std::mt19937 rng(8);
    // Many are joined in parts, by several threads.
    for (const std::size_t count : {0u, 1u, 2u, 15u, 16u, 17u, 33u, 500u, 150'000u})
        for (const unsigned places : {1u, 3u, 200u})
        {
            std::vector<Eigen::Vector3d> samples(count);
            for (Eigen::Vector3d& x : samples)
            {
                // A zero of either sign is one place.
                const double zero = rng() % 2 ? 0.0 : -0.0;
                x = {zero, double(rng() % places), 0.25};
            }
            const std::vector<std::uint32_t> joined = joined_samples(samples);
            ASSERT_EQ(joined.size(), count);
            for (std::size_t i = 0; i < count; ++i)
            {
                std::size_t first = 0;
                while (samples[first] != samples[i])
                    ++first;
                EXPECT_EQ(joined[i], first);
            }
        }
}

} // namespace cellwarp::core
