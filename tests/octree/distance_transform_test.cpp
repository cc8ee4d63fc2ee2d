// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/distance_transform.h"

#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "octree/base/index.h"

namespace cellwarp::core
{

TEST(SpreadLabels, every_voxel_gets_the_label_of_a_nearest_one)
{
    const Eigen::Vector3i counts(13, 7, 9);
    const auto index = [&](int i, int j, int k)
    { return idx((k * counts.y() + j) * counts.x() + i); };
    std::mt19937 rng(3);
    std::vector<std::int32_t> given(idx(counts.prod()), -1);
    std::vector<Eigen::Vector3i> places;
    for (int n = 0; n < 12; ++n)
    {
        const Eigen::Vector3i place(static_cast<int>(rng() % 13),
                                    static_cast<int>(rng() % 7),
                                    static_cast<int>(rng() % 9));
        given[index(place.x(), place.y(), place.z())] = n;
    }
    std::vector<std::int32_t> spread = given;
    spread_labels(spread, counts);
    for (int k = 0; k < counts.z(); ++k)
        for (int j = 0; j < counts.y(); ++j)
            for (int i = 0; i < counts.x(); ++i)
            {
                int nearest = std::numeric_limits<int>::max(), own = nearest;
                for (int c = 0; c < counts.z(); ++c)
                    for (int b = 0; b < counts.y(); ++b)
                        for (int a = 0; a < counts.x(); ++a)
                        {
                            const std::int32_t label = given[index(a, b, c)];
                            if (label < 0)
                                continue;
                            const int d =
                                (a - i) * (a - i) + (b - j) * (b - j) + (c - k) * (c - k);
                            nearest = std::min(nearest, d);
                            if (label == spread[index(i, j, k)])
                                own = std::min(own, d);
                        }
                ASSERT_EQ(own, nearest);
            }
}

TEST(SpreadLabels, without_a_label_there_is_nothing_to_spread)
{
    std::vector<std::int32_t> labels(8, -1);
    spread_labels(labels, {2, 2, 2});
    EXPECT_EQ(labels, std::vector<std::int32_t>(8, -1));
}

} // namespace cellwarp::core
