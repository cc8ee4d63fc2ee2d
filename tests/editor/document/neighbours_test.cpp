// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/document/neighbours.h"

#include <algorithm>
#include <random>

#include <gtest/gtest.h>

#include "editor/document/selection.h"
#include "octree/base/index.h"
#include "tests/support/random.h"

namespace cellwarp::core
{

namespace
{

using Samples = std::vector<std::uint32_t>;

Geometry polygons(std::vector<Eigen::Vector3d> samples, const std::vector<Samples>& faces)
{
    Geometry geometry;
    geometry.samples = std::move(samples);
    for (const Samples& face : faces)
    {
        geometry.corners.insert(geometry.corners.end(), face.begin(), face.end());
        geometry.face_ends.push_back(geometry.corners.size());
    }
    return geometry;
}

Neighbours neighbours_of(const Geometry& geometry)
{
    return Neighbours(geometry, geometry.samples);
}

Samples list(const Neighbours& neighbours, std::size_t sample)
{
    const auto span = neighbours.of(sample);
    Samples samples(span.begin(), span.end());
    std::sort(samples.begin(), samples.end());
    return samples;
}

} // namespace

TEST(Neighbours, are_joined_along_the_edges_of_polygons_not_across_them)
{
    // Two squares side by side; a loose sample.
    const Neighbours neighbours = neighbours_of(polygons(
        {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {0, 1, 0}, {1, 1, 0}, {2, 1, 0}, {9, 9, 9}},
        {{0, 1, 4, 3}, {1, 2, 5, 4}}));
    EXPECT_EQ(list(neighbours, 0), (Samples{1, 3}));
    EXPECT_EQ(list(neighbours, 1), (Samples{0, 2, 4}));
    EXPECT_EQ(list(neighbours, 5), (Samples{2, 4}));
    EXPECT_TRUE(list(neighbours, 6).empty());
}

TEST(Neighbours, a_corner_that_a_face_names_twice_is_not_its_own_neighbour)
{
    const Neighbours neighbours =
        neighbours_of(polygons({{0, 0, 0}, {1, 0, 0}}, {{0, 0, 1}, {1}}));
    EXPECT_EQ(list(neighbours, 0), (Samples{1}));
    EXPECT_EQ(list(neighbours, 1), (Samples{0}));
}

TEST(Neighbours, soups_hold_together_at_corners_at_the_same_place)
{
    // Two triangles of one square, each with corners of its own; -0 is 0.
    const Neighbours neighbours = neighbours_of(
        polygons({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {-0.0, 0, -0.0}, {1, 1, 0}, {0, 1, 0}},
                 {{0, 1, 2}, {3, 4, 5}}));
    EXPECT_EQ(list(neighbours, 0), (Samples{0, 1, 2, 3, 4, 5}));
    EXPECT_EQ(list(neighbours, 3), (Samples{0, 1, 2, 3, 4, 5}));
    EXPECT_EQ(list(neighbours, 1), (Samples{0, 2, 3, 4}));
    EXPECT_EQ(list(neighbours, 5), (Samples{0, 2, 3, 4}));
    Selection one(6);
    one.add(5);
    EXPECT_EQ(connected(one, neighbours).count(), 6u);
}

TEST(Neighbours, of_a_cloud_are_the_nearest_and_mutual)
{
    std::mt19937 rng(11);
    Geometry geometry;
    for (int i = 0; i < 400; ++i)
        geometry.samples.push_back(support::random_vector(rng, 1.0));
    const Neighbours neighbours = neighbours_of(geometry);
    for (std::uint32_t i = 0; i < 400; ++i)
    {
        SCOPED_TRACE(i);
        const Samples own = list(neighbours, i);
        EXPECT_GE(own.size(), 8u);
        EXPECT_FALSE(std::binary_search(own.begin(), own.end(), i));
        std::vector<std::pair<double, std::uint32_t>> by_distance;
        for (std::uint32_t j = 0; j < 400; ++j)
            if (j != i)
                by_distance.emplace_back(
                    (geometry.samples[j] - geometry.samples[i]).norm(), j);
        std::sort(by_distance.begin(), by_distance.end());
        for (int k = 0; k < 8; ++k)
        {
            const std::uint32_t near = by_distance[idx(k)].second;
            EXPECT_TRUE(std::binary_search(own.begin(), own.end(), near));
            const Samples others = list(neighbours, near);
            EXPECT_TRUE(std::binary_search(others.begin(), others.end(), i));
        }
    }
}

TEST(Neighbours, of_a_cloud_look_past_points_at_the_same_place)
{
    // Ten points at each of three places: the nearest nine of a point are its twins.
    Geometry geometry;
    for (int i = 0; i < 30; ++i)
        geometry.samples.emplace_back(i / 10, 0, 0);
    EXPECT_EQ(list(neighbours_of(geometry), 0).size(), 30u);
}

TEST(Neighbours, of_one_sample_or_none_are_none)
{
    Geometry geometry;
    geometry.samples.emplace_back(1, 2, 3);
    EXPECT_TRUE(neighbours_of(geometry).of(0).empty());
    geometry.samples.clear();
    neighbours_of(geometry);
}

} // namespace cellwarp::core
