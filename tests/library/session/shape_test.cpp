// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/shape.h"

#include <random>
#include <set>
#include <utility>

#include <gtest/gtest.h>

#include "tests/support/random_poses.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

TEST(ShapeLayout, the_coarse_mesh_of_a_closed_one_has_no_holes)
{
    // Askew, so that the boxes whose samples become one cut its faces anyhow.
    std::mt19937 rng(7);
    const Eigen::Matrix3d R = support::random_rotation(rng);
    const Shape fine = support::box_shape({0, 0, 0}, {1, 1.5, 0.7}, 170);
    Geometry geometry;
    for (const Eigen::Vector3d& x : fine.samples)
        geometry.samples.push_back(R * x);
    for (const Triangle& triangle : fine.triangles)
    {
        geometry.corners.insert(geometry.corners.end(), triangle.begin(), triangle.end());
        geometry.face_ends.push_back(geometry.corners.size());
    }
    const std::vector<std::uint32_t> coarse = layout_of(geometry)->coarse_triangles;
    ASSERT_GT(coarse.size(), 3 * 10'000u);
    EXPECT_LT(coarse.size(), 3 * 200'000u);
    // What goes over an edge one way comes back over it.
    std::set<std::pair<std::uint32_t, std::uint32_t>> passes;
    for (std::size_t t = 0; t < coarse.size(); t += 3)
        for (std::size_t k = 0; k < 3; ++k)
            passes.emplace(coarse[t + k], coarse[t + (k + 1) % 3]);
    std::size_t open = 0;
    for (const auto& [a, b] : passes)
        open += !passes.contains({b, a});
    EXPECT_EQ(open, 0u);
}

} // namespace cellwarp::core
