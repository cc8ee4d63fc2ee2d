// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/picture/ray_tree.h"

#include <algorithm>
#include <vector>

#include <gtest/gtest.h>

namespace cellwarp::core
{

namespace
{

const Eigen::Vector3f kDown(0, 0, -1);

void write(float* out, std::initializer_list<float> numbers)
{
    std::copy(numbers.begin(), numbers.end(), out);
}

/// A triangle at z = 0, a ball above (0.25, 0.25), a square at z = -1.
struct Bodies
{
    RayDevice device;
    std::vector<std::uint32_t> triangle = {0, 1, 2}, square = {0, 1, 2, 3};
    RayTree tree;

    explicit Bodies(RayTree::Making making) : tree(device, making)
    {
        write(tree.add_triangles(3, triangle), {0, 0, 0, 1, 0, 0, 0, 1, 0});
        write(tree.add_balls(2), {9, 9, 9, 1, 0.25f, 0.25f, 2, 0.5f});
        write(tree.add_quadrilaterals(4, square),
              {-1, -1, -1, 3, -1, -1, 3, 3, -1, -1, 3, -1});
        tree.commit();
    }
};

} // namespace

TEST(RayTree, tells_body_element_and_place_of_what_a_ray_meets_first)
{
    for (const auto making : {RayTree::Making::Quick, RayTree::Making::Best})
    {
        const Bodies bodies(making);
        const auto on_ball = bodies.tree.first_hit({0.25f, 0.25f, 5}, kDown);
        ASSERT_TRUE(on_ball);
        EXPECT_EQ(on_ball->body, 1u);
        EXPECT_EQ(on_ball->element, 1u);
        EXPECT_NEAR(on_ball->distance, 2.5f, 1e-5f);
        EXPECT_NEAR(on_ball->normal.normalized().z(), 1.0f, 1e-5f);
        // Distances are in lengths of the direction.
        const auto on_triangle = bodies.tree.first_hit({0.25f, 0.5f, 1}, 2 * kDown);
        ASSERT_TRUE(on_triangle);
        EXPECT_EQ(on_triangle->body, 0u);
        EXPECT_NEAR(on_triangle->distance, 0.5f, 1e-5f);
        EXPECT_NEAR(on_triangle->u, 0.25f, 1e-5f); // of the second corner
        EXPECT_NEAR(on_triangle->v, 0.5f, 1e-5f);
        const auto on_square = bodies.tree.first_hit({2, 2, 1}, kDown);
        ASSERT_TRUE(on_square);
        EXPECT_EQ(on_square->body, 2u);
        EXPECT_FALSE(bodies.tree.first_hit({5, 5, 1}, kDown));
        EXPECT_FALSE(bodies.tree.first_hit({0.25f, 0.25f, 5}, -kDown));
    }
}

TEST(RayTree, is_blocked_between_two_distances_alone)
{
    const Bodies bodies(RayTree::Making::Best);
    const Eigen::Vector3f origin(0.25f, 0.25f, 5); // ball at 2.5 to 3.5, then 5 and 6
    EXPECT_TRUE(bodies.tree.is_blocked(origin, kDown, 0, 10));
    EXPECT_FALSE(bodies.tree.is_blocked(origin, kDown, 0, 2.4f));
    EXPECT_FALSE(bodies.tree.is_blocked(origin, kDown, 3.6f, 4.9f));
    EXPECT_TRUE(bodies.tree.is_blocked(origin, kDown, 4.9f, 5.1f));
    EXPECT_FALSE(bodies.tree.is_blocked(origin, kDown, 6.1f, 100));
}

TEST(RayTree, without_bodies_is_met_by_no_ray)
{
    const RayDevice device;
    RayTree tree(device, RayTree::Making::Quick);
    tree.commit();
    EXPECT_FALSE(tree.first_hit({0, 0, 5}, kDown));
    EXPECT_FALSE(tree.is_blocked({0, 0, 5}, kDown, 0, 10));
}

} // namespace cellwarp::core
