// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/base/point_tree.h"

#include <algorithm>
#include <random>

#include <gtest/gtest.h>

#include "tests/support/random.h"

namespace cellwarp::core
{

namespace
{

std::vector<Eigen::Vector3d> some_points(int count)
{
    std::mt19937 rng(1);
    std::vector<Eigen::Vector3d> points;
    for (int i = 0; i < count; ++i)
        points.push_back(support::random_vector(rng, 1.0));
    return points;
}

} // namespace

TEST(PointTree, gives_as_many_as_are_asked_for)
{
    const std::vector<Eigen::Vector3d> points = some_points(200);
    const PointTree tree(points);
    const Eigen::Vector3d x(0.1, -0.2, 0.3);
    std::vector<double> wanted;
    for (const Eigen::Vector3d& point : points)
        wanted.push_back((point - x).squaredNorm());
    std::sort(wanted.begin(), wanted.end());
    std::vector<PointTree::Neighbour> near;
    for (const std::size_t count : {0u, 1u, 5u, 16u, 17u, 24u, 32u, 33u, 100u, 200u})
    {
        tree.nearest(x, count, near);
        ASSERT_EQ(near.size(), count);
        for (std::size_t i = 0; i < count; ++i)
        {
            EXPECT_DOUBLE_EQ(near[i].distance_squared, wanted[i]);
            EXPECT_DOUBLE_EQ((points[near[i].index] - x).squaredNorm(), wanted[i]);
        }
    }
}

TEST(PointTree, gives_those_within_a_distance)
{
    const std::vector<Eigen::Vector3d> points = some_points(200);
    const PointTree tree(points);
    const Eigen::Vector3d x(0.1, -0.2, 0.3);
    std::vector<PointTree::Neighbour> near(3);
    for (const double distance : {0.0, 0.2, 0.7, 10.0})
    {
        tree.within(x, distance, near);
        std::vector<std::size_t> found, wanted;
        for (const PointTree::Neighbour& one : near)
        {
            found.push_back(one.index);
            EXPECT_DOUBLE_EQ(one.distance_squared, (points[one.index] - x).squaredNorm());
        }
        for (std::size_t i = 0; i < points.size(); ++i)
            if ((points[i] - x).norm() < distance)
                wanted.push_back(i);
        std::sort(found.begin(), found.end());
        EXPECT_EQ(found, wanted) << distance;
    }
}

TEST(PointTree, gives_all_where_there_are_fewer)
{
    const PointTree tree(some_points(7));
    std::vector<PointTree::Neighbour> near;
    for (const std::size_t count : {8u, 24u, 1000000000u})
    {
        tree.nearest({0, 0, 0}, count, near);
        EXPECT_EQ(near.size(), 7u);
    }
}

} // namespace cellwarp::core
