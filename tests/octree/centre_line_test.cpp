// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/centre_line.h"

#include <cmath>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

#include "octree/base/index.h"
#include "tests/support/random_poses.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;

double length_of(const std::vector<Vector3d>& places)
{
    double sum = 0.0;
    for (std::size_t k = 1; k < places.size(); ++k)
        sum += (places[k] - places[k - 1]).norm();
    return sum;
}

std::vector<std::uint32_t> samples_where(const Shape& shape, auto&& holds)
{
    std::vector<std::uint32_t> samples;
    for (std::size_t i = 0; i < shape.samples.size(); ++i)
        if (holds(shape.samples[i]))
            samples.push_back(static_cast<std::uint32_t>(i));
    return samples;
}

} // namespace

TEST(CentreLine, of_a_bar_is_its_axis)
{
    const Shape bar = support::cross(false);
    const CentreLine line = centre_line(bar, {});
    ASSERT_GT(line.places.size(), 2u);
    EXPECT_GT(length_of(line.places), 8.0); // of 10
    EXPECT_LT(length_of(line.places), 10.0);
    for (const Vector3d& x : line.places)
        EXPECT_LT(x.head<2>().norm(), 0.08) << x.transpose();
    EXPECT_GT(line.radius, 0.3);
    EXPECT_LT(line.radius, 0.8);
}

TEST(CentreLine, of_a_bar_of_few_samples_is_its_axis_however_it_lies)
{
    std::mt19937 rng(3);
    for (int n = 1; n <= 10; ++n)
        for (int turn = 0; turn < 2; ++turn)
        {
            SCOPED_TRACE(testing::Message() << n << " segments, turn " << turn);
            std::array<std::vector<double>, 3> lines;
            for (std::size_t axis = 0; axis < 3; ++axis)
                for (int i = 0; i <= (axis == 2 ? 4 * n : n); ++i)
                    lines[axis].push_back(double(i) / n - (axis == 2 ? 0.0 : 0.5));
            Shape bar = support::blocks_shape(lines, [](int, int, int) { return true; });
            const Matrix3d rotation =
                turn ? support::random_rotation(rng) : Matrix3d::Identity();
            for (Vector3d& x : bar.samples)
                x = rotation * x;
            const CentreLine line = centre_line(bar, {});
            ASSERT_GT(line.places.size(), 2u);
            // It goes to and fro nowhere.
            EXPECT_GT(length_of(line.places), 2.8);
            EXPECT_LT(length_of(line.places), 4.2);
            for (const Vector3d& x : line.places)
            {
                const Vector3d y = rotation.transpose() * x;
                // Only at its ends it may lean towards a corner.
                const bool is_end = y.z() < 0.5 || y.z() > 3.5;
                EXPECT_LT(y.head<2>().norm(), is_end ? 0.45 : 0.15) << y.transpose();
            }
        }
}

TEST(CentreLine, of_a_limb_goes_from_the_branching_to_its_tip)
{
    const Shape shape = support::cross(true);
    const CentreLine line = centre_line(
        shape, samples_where(shape, [](const Vector3d& x) { return x.x() > 4.7; }));
    ASSERT_GT(line.places.size(), 2u);
    EXPECT_LT(line.places.front().x(), 1.0);
    EXPECT_GT(line.places.back().x(), 4.3);
    EXPECT_LT(line.places.back().x(), 5.0);
    for (const Vector3d& x : line.places)
    {
        EXPECT_LT(std::abs(x.y()), 0.15) << x.transpose();
        EXPECT_LT(std::abs(x.z() - 7.5), 0.35) << x.transpose();
    }
    // Near the foot it is the trunk.
    const CentreLine trunk = centre_line(
        shape, samples_where(shape, [](const Vector3d& x) { return x.z() < 0.3; }));
    EXPECT_LT(trunk.places.back().z(), 0.6);
    EXPECT_GT(trunk.places.front().z(), 5.0);
}

TEST(CentreLine, of_a_soup_or_a_cloud_is_that_of_a_wrap_around_it)
{
    const Shape mesh = support::cross(true);
    Shape cloud;
    cloud.samples = support::random_points(mesh, 20000, 1);
    const CentreLine line = centre_line(
        cloud, samples_where(cloud, [](const Vector3d& x) { return x.x() > 4.5; }));
    ASSERT_GT(line.places.size(), 2u);
    EXPECT_GT(line.places.back().x(), 4.2);
    for (const Vector3d& x : line.places)
        EXPECT_LT(std::abs(x.y()), 0.25) << x.transpose();
}

TEST(CentreLine, is_the_same_each_time_and_turns_with_the_shape)
{
    const Shape shape = support::cross(true);
    const CentreLine line = centre_line(shape, {});
    EXPECT_EQ(centre_line(shape, {}).places, line.places);
    Shape turned = shape;
    for (Vector3d& x : turned.samples)
        x = Vector3d(x.z(), x.x(), x.y());
    const CentreLine other = centre_line(turned, {});
    ASSERT_EQ(other.places.size(), line.places.size());
    EXPECT_NEAR(length_of(other.places), length_of(line.places),
                0.05 * length_of(line.places));
}

TEST(CentreLine, where_there_is_no_shape_there_is_none)
{
    EXPECT_TRUE(centre_line({}, {}).places.empty());
    Shape two;
    two.samples = {Vector3d(0, 0, 0), Vector3d(1, 0, 0)};
    EXPECT_TRUE(centre_line(two, {}).places.empty());
    Shape one_place;
    one_place.samples.assign(100, Vector3d(1, 2, 3));
    EXPECT_TRUE(centre_line(one_place, {}).places.empty());
}

} // namespace cellwarp::core
