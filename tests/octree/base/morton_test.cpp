// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/base/morton.h"

#include <random>

#include <gtest/gtest.h>

namespace cellwarp::core
{

TEST(Morton, takes_the_bits_of_the_axes_in_turns)
{
    std::mt19937 rng(2);
    for (int k = 0; k < 100; ++k)
    {
        Eigen::Vector3i v;
        for (int axis = 0; axis < 3; ++axis)
            v[axis] = static_cast<int>(rng() & 0x1fffff);
        std::uint64_t expected = 0;
        for (int bit = 0; bit < 21; ++bit)
            for (int axis = 0; axis < 3; ++axis)
                expected |= static_cast<std::uint64_t>(v[axis] >> bit & 1)
                            << (3 * bit + axis);
        EXPECT_EQ(morton(v), expected);
    }
}

} // namespace cellwarp::core
