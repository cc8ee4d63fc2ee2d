// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/bounding_surface.h"

#include <algorithm>
#include <random>

#include <gtest/gtest.h>

#include "octree/base/edges.h"
#include "octree/joined_samples.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

/// Every triangle with corners of its own.
Shape soup_of(const Shape& shape)
{
    Shape soup;
    for (const Triangle& t : shape.triangles)
    {
        const auto first = static_cast<std::uint32_t>(soup.samples.size());
        for (const std::uint32_t corner : t)
            soup.samples.push_back(shape.samples[corner]);
        soup.triangles.push_back({first, first + 1, first + 2});
    }
    return soup;
}

} // namespace

TEST(BoundingSurface, of_a_closed_mesh_is_all_of_it)
{
    const Shape prism = support::l_prism();
    const BoundingSurface surface = bounding_surface(prism);
    EXPECT_EQ(surface.open_edges, 0.0);
    EXPECT_EQ(surface.triangles.size(), prism.triangles.size());
    EXPECT_TRUE(std::is_sorted(surface.triangles.begin(), surface.triangles.end()));
}

TEST(BoundingSurface, of_a_soup_is_that_of_its_mesh)
{
    const Shape prism = support::l_prism();
    const Shape soup = soup_of(prism);
    const BoundingSurface of_soup = bounding_surface(soup);
    EXPECT_EQ(of_soup.open_edges, 0.0);
    EXPECT_EQ(of_soup.triangles.size(), prism.triangles.size());
    const std::vector<std::uint32_t> joined = joined_samples(soup.samples);
    for (std::size_t i = 0; i < joined.size(); ++i)
    {
        EXPECT_EQ(soup.samples[joined[i]], soup.samples[i]);
        EXPECT_EQ(joined[joined[i]], joined[i]);
    }
}

TEST(BoundingSurface, leaves_out_copies_and_what_has_no_area)
{
    Shape prism = support::l_prism();
    const BoundingSurface plain = bounding_surface(prism);
    std::mt19937 rng(1);
    const std::vector<Triangle> all = prism.triangles;
    for (int k = 0; k < 20; ++k)
    {
        Triangle copy = all[rng() % all.size()];
        std::rotate(copy.begin(), copy.begin() + rng() % 3, copy.end());
        prism.triangles.push_back(copy);
        prism.triangles.push_back({copy[0], copy[1], copy[0]});
    }
    std::shuffle(prism.triangles.begin(), prism.triangles.end(), rng);
    const BoundingSurface surface = bounding_surface(prism);
    EXPECT_EQ(surface.triangles, plain.triangles);
    EXPECT_EQ(surface.open_edges, 0.0);
}

TEST(BoundingSurface, drops_a_wall_between_two_bodies_and_keeps_a_face_with_a_flaw)
{
    // The wall between two boxes is there in both directions.
    const Shape boxes = support::joined(support::box_shape({0, 0, 0}, {1, 1, 1}, 2),
                                        support::box_shape({1, 0, 0}, {2, 1, 1}, 2));
    const BoundingSurface surface = bounding_surface(boxes);
    EXPECT_EQ(surface.open_edges, 0.0);
    EXPECT_LT(surface.triangles.size(), boxes.triangles.size());
    // A second, turned copy of one face of a closed mesh: the first is right.
    Shape flawed = support::box_shape({0, 0, 0}, {1, 1, 1}, 2);
    const Triangle t = flawed.triangles[5];
    flawed.triangles.push_back({t[0], t[2], t[1]});
    EXPECT_EQ(bounding_surface(flawed).open_edges, 0.0);
    EXPECT_EQ(bounding_surface(flawed).triangles.size(), flawed.triangles.size() - 1);
}

TEST(BoundingSurface, tells_the_share_of_open_edges)
{
    Shape one;
    one.samples = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}};
    one.triangles = {{0, 1, 2}};
    EXPECT_EQ(bounding_surface(one).open_edges, 1.0);
    one.triangles.push_back({1, 3, 2}); // one edge of five is shared
    EXPECT_DOUBLE_EQ(bounding_surface(one).open_edges, 0.8);
    one.triangles.clear();
    EXPECT_EQ(bounding_surface(one).open_edges, 1.0);
}

TEST(BoundingSurface, of_many_triangles_tells_each_open_edge)
{
    // Several parts for several threads.
    const Shape whole = support::box_shape({0, 0, 0}, {1, 1, 1}, 70);
    ASSERT_GT(whole.triangles.size(), 50'000u);
    const auto share_by_edges = [&](const std::vector<Triangle>& triangles)
    {
        int open = 0, all = 0;
        for_each_edge(
            whole.samples.size(),
            [&](const auto& pass)
            {
                for (const Triangle& t : triangles)
                    for (std::size_t k = 0; k < 3; ++k)
                        pass(t[k], t[(k + 1) % 3]);
            },
            [&](const Edge& edge)
            {
                open += edge.forward != edge.backward;
                ++all;
            });
        return static_cast<double>(open) / all;
    };
    const BoundingSurface closed = bounding_surface(whole);
    EXPECT_EQ(closed.open_edges, 0.0);
    EXPECT_TRUE(std::is_sorted(closed.triangles.begin(), closed.triangles.end()));
    std::mt19937 rng(3);
    for (int trial = 0; trial < 4; ++trial)
    {
        Shape flawed = whole;
        const std::size_t t = rng() % whole.triangles.size();
        if (trial % 2 == 0)
            std::swap(flawed.triangles[t][0], flawed.triangles[t][1]);
        else
            flawed.triangles.erase(flawed.triangles.begin() +
                                   static_cast<std::ptrdiff_t>(t));
        const BoundingSurface surface = bounding_surface(flawed);
        EXPECT_GT(surface.open_edges, 0.0);
        EXPECT_EQ(surface.open_edges, share_by_edges(surface.triangles));
        EXPECT_TRUE(std::is_sorted(surface.triangles.begin(), surface.triangles.end()));
    }
}

} // namespace cellwarp::core
