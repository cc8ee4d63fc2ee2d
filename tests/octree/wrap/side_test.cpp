// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/wrap/side.h"

#include <algorithm>
#include <cmath>
#include <random>

#include <gtest/gtest.h>

#include "octree/winding.h"
#include "tests/support/random.h"

namespace cellwarp::core
{

namespace
{

/// A closed double cone around the line along x through (y, z); its two tips lie beside
/// it, each less than a few roundings away, its ring at random in a box of 0 to 100.
Shape double_cone(std::mt19937& rng, double y, double z, int around)
{
    const auto beside = [&](double value)
    {
        for (int steps = static_cast<int>(rng() % 4); steps > 0; --steps)
            value = std::nextafter(value, rng() % 2 ? 1e9 : 0.0);
        return value;
    };
    Shape shape;
    shape.samples.emplace_back(3.25, beside(y), beside(z));
    shape.samples.emplace_back(7.75, beside(y), beside(z));
    for (int i = 0; i < around; ++i)
    {
        const double angle = 2 * 3.14159265358979 * i / around;
        const double r = support::random_number(rng, 0.4, 95.0);
        const double height = support::random_number(rng, 4.0, 7.0);
        shape.samples.emplace_back(height,
                                   std::clamp(y + r * std::cos(angle), 0.0, 100.0),
                                   std::clamp(z + r * std::sin(angle), 0.0, 100.0));
    }
    for (int i = 0; i < around; ++i)
    {
        const std::uint32_t a = static_cast<std::uint32_t>(2 + i);
        const std::uint32_t b = static_cast<std::uint32_t>(2 + (i + 1) % around);
        shape.triangles.push_back({0, b, a});
        shape.triangles.push_back({1, a, b});
    }
    return shape;
}

} // namespace

TEST(Side, is_the_sign_of_the_exact_product)
{
    // Whole numbers below 2^52 beside a line of slope one: the products take 106 bits.
    std::mt19937_64 rng(3);
    int differs_from_rounded = 0;
    for (int trial = 0; trial < 20000; ++trial)
    {
        std::int64_t n[6]; // a, b, point
        for (int k = 0; k < 3; ++k)
        {
            n[2 * k] = static_cast<std::int64_t>(rng() % (1ull << 52));
            n[2 * k + 1] = n[2 * k] + static_cast<std::int64_t>(rng() % 5) - 2;
        }
        const __int128 cross = static_cast<__int128>(n[2] - n[0]) * (n[5] - n[1]) -
                               static_cast<__int128>(n[3] - n[1]) * (n[4] - n[0]);
        const int exact = cross > 0 ? 1 : cross < 0 ? -1 : 0;
        double x[6];
        for (int k = 0; k < 6; ++k)
            x[k] = std::ldexp(static_cast<double>(n[k]), -40);
        ASSERT_EQ(side_of_line(x, x + 2, x[4], x[5]), exact) << trial;
        const double rounded =
            (x[2] - x[0]) * (x[5] - x[1]) - (x[3] - x[1]) * (x[4] - x[0]);
        differs_from_rounded += (rounded > 0 ? 1 : rounded < 0 ? -1 : 0) != exact;
    }
    EXPECT_GT(differs_from_rounded, 0);
}

TEST(Side, no_column_beside_a_vertex_leaks)
{
    std::mt19937 rng(5);
    GridShape unit; // a voxel is 1
    unit.coarsest = {10, 100, 100};
    unit.size = unit.coarsest.cast<double>();
    unit.voxels_per_leaf = 1;
    int leaks = 0, holes = 0;
    for (int trial = 0; trial < 3000; ++trial)
    {
        const Shape shape = double_cone(rng, 1.5, 0.5, 3 + static_cast<int>(rng() % 9));
        const VoxelGrid grid(unit);
        const VoxelFlags is_inside = inside_by_winding(shape, shape.triangles, grid);
        // Below and above all of it, and between its tips near the ring's lowest place.
        for (const int i : {0, 1, 2, 8, 9})
            leaks += is_inside[grid.index(i, 1, 0)];
        holes += is_inside[grid.index(5, 1, 0)] == 0;
    }
    EXPECT_EQ(leaks, 0);
    EXPECT_EQ(holes, 0);
}

} // namespace cellwarp::core
