// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/sample_normals.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "io/formats/geometry_file.h"
#include "tests/support/files.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

Geometry geometry_of_obj(const std::string& text)
{
    return scan_geometry("a.obj", text).geometry;
}

/// A tube around the y axis with quadrilaterals, open at both ends.
Geometry tube(int around)
{
    std::string text;
    for (int row = 0; row < 3; ++row)
        for (int k = 0; k < around; ++k)
        {
            const double a = 2.0 * std::numbers::pi * k / around;
            text += "v " + std::to_string(std::cos(a)) + " " + std::to_string(row) + " " +
                    std::to_string(std::sin(a)) + "\n";
        }
    const auto at = [&](int row, int k)
    { return std::to_string(1 + row * around + k % around) + " "; };
    for (int row = 0; row < 2; ++row)
        for (int k = 0; k < around; ++k)
            text += "f " + at(row, k) + at(row + 1, k) + at(row + 1, k + 1) +
                    at(row, k + 1) + "\n";
    return geometry_of_obj(text);
}

} // namespace

TEST(SampleNormals, of_a_tube_point_away_from_its_axis)
{
    const Geometry round = tube(24);
    const std::vector<Eigen::Vector3d> normals = sample_normals(round, round.samples);
    ASSERT_EQ(normals.size(), round.samples.size());
    for (std::size_t i = 0; i < normals.size(); ++i)
    {
        const Eigen::Vector3d out(round.samples[i].x(), 0.0, round.samples[i].z());
        EXPECT_LT((normals[i] - out).norm(), 1e-5) << i;
    }
    // A cloud has none, and of a sample without faces the length is 1, too.
    const Geometry cloud = geometry_of_obj("v 0 0 0\nv 1 0 0\n");
    EXPECT_TRUE(sample_normals(cloud, cloud.samples).empty());
    const Geometry more =
        geometry_of_obj("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 5 5 5\nf 1 2 3\n");
    EXPECT_EQ(sample_normals(more, more.samples)[3].norm(), 1.0);
}

TEST(SampleNormals, are_for_surfaces_without_sharp_edges)
{
    EXPECT_TRUE(is_smooth(tube(24)));
    EXPECT_FALSE(is_smooth(tube(4)));
    EXPECT_FALSE(is_smooth(geometry_of_obj("v 0 0 0\n")));
    // Sharp edges are as long in small faces.
    for (const int faces : {4, 40})
    {
        EXPECT_FALSE(is_smooth(geometry_of_obj(
            support::obj_text(support::box_shape({0, 0, 0}, {1, 1, 1}, faces)))))
            << faces;
    }
    // A soup has none in common.
    EXPECT_FALSE(is_smooth(geometry_of_obj(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\nf 1 2 3\nf 4 5 6\n")));
    const std::string folder = support::samples_folder();
    EXPECT_TRUE(is_smooth(read_geometry(folder + "/creature.obj").geometry));
    EXPECT_FALSE(is_smooth(read_geometry(folder + "/bar.obj").geometry));
    // They follow the samples.
    const Geometry round = tube(24);
    std::vector<Eigen::Vector3d> turned;
    for (const Eigen::Vector3d& x : round.samples)
        turned.push_back({x.y(), x.z(), x.x()});
    const auto normals = normals_of_smooth(round);
    ASSERT_TRUE(normals);
    EXPECT_LT((normals(turned)[5] -
               Eigen::Vector3d(0, round.samples[5].z(), round.samples[5].x()))
                  .norm(),
              1e-5);
    const Geometry square = tube(4);
    EXPECT_FALSE(normals_of_smooth(square));
}

} // namespace cellwarp::core
