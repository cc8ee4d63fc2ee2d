// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/mirror_plane.h"

#include <algorithm>
#include <cmath>
#include <random>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "tests/support/person.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

/// The nearest of the planes to one that is known: distance of normals and of places.
std::pair<double, double> off(const std::vector<MirrorPlane>& planes,
                              const Vector3d& normal, const Vector3d& in_plane)
{
    std::pair<double, double> least(INFINITY, INFINITY);
    for (const MirrorPlane& plane : planes)
        least = std::min(least, std::pair((plane.normal.cross(normal)).norm(),
                                          std::abs(plane.side(in_plane))));
    return least;
}

} // namespace

TEST(MirrorPlanes, of_a_person_the_best_is_between_its_sides_wherever_it_stands)
{
    std::mt19937 random(5);
    std::normal_distribution<double> normal;
    const support::Person person = support::person(30.0, 3);
    for (int trial = 0; trial < 4; ++trial)
    {
        Eigen::Quaterniond turn(normal(random), normal(random), normal(random),
                                normal(random));
        turn.normalize();
        if (trial == 0)
            turn.setIdentity();
        const Vector3d shift = trial == 0 ? Vector3d(0, 0, 0) : Vector3d(100, -3, 7);
        std::vector<Vector3d> samples = person.shape.samples;
        for (Vector3d& x : samples)
            x = turn * x + shift;
        const std::vector<MirrorPlane> planes = mirror_planes(samples);
        // Another one may go through its sides: front and back differ little.
        ASSERT_GE(planes.size(), 1u) << trial;
        const auto [turned, away] =
            off({planes.front()}, turn * Vector3d::UnitX(), shift);
        EXPECT_LT(turned, 1e-4) << trial;
        EXPECT_LT(away, 1e-4) << trial;
    }
}

TEST(MirrorPlanes, of_a_box_there_are_three_and_of_an_l_prism_one_or_two)
{
    const auto box = mirror_planes(support::box_shape({0, 0, 0}, {1, 2, 4}, 6).samples);
    ASSERT_EQ(box.size(), 3u);
    for (int axis = 0; axis < 3; ++axis)
    {
        const auto [turned, away] = off(box, Vector3d::Unit(axis), {0.5, 1, 2});
        EXPECT_LT(turned, 1e-9);
        EXPECT_LT(away, 1e-9);
    }
    EXPECT_GE(mirror_planes(support::l_prism().samples).size(), 1u);
}

TEST(MirrorPlanes, what_is_bent_to_one_side_has_none_there)
{
    support::Person person = support::person(0.0, 1);
    for (Vector3d& x : person.shape.samples)
        if (x.x() > 0.2) // one arm upwards
            x = Vector3d(0.2, x.y() + (x.x() - 0.2), x.z());
    EXPECT_GT(
        off(mirror_planes(person.shape.samples), Vector3d::UnitX(), {0, 0, 0}).first,
        0.2);
}

TEST(MirrorPlanes, of_few_samples_there_is_none)
{
    EXPECT_TRUE(mirror_planes({}).empty());
    EXPECT_TRUE(mirror_planes({{0, 0, 0}, {1, 0, 0}}).empty());
}

} // namespace cellwarp::core
