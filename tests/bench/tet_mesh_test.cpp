// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/bench/tet_mesh.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "octree/base/index.h"
#include "tests/bench/tet_box.h"
#include "tests/support/random.h"

namespace cellwarp::core::bench
{

namespace
{

using Eigen::Vector3d;

double volume_of(const TetMesh& mesh)
{
    double sum = 0.0;
    for (const Tet& tet : mesh.tets)
    {
        EXPECT_GT(six_volumes(mesh, tet), 0.0);
        sum += six_volumes(mesh, tet) / 6.0;
    }
    return sum;
}

/// Of the faces that only one tetrahedron has. None may be of more than two.
double area_of(const TetMesh& mesh)
{
    std::map<std::array<int, 3>, int> counts;
    for (const Tet& tet : mesh.tets)
        for (std::size_t k = 0; k < 4; ++k)
        {
            std::array<int, 3> face = {tet[(k + 1) % 4], tet[(k + 2) % 4],
                                       tet[(k + 3) % 4]};
            std::sort(face.begin(), face.end());
            ++counts[face];
        }
    double sum = 0.0;
    for (const auto& [face, count] : counts)
    {
        EXPECT_LE(count, 2);
        const auto point = [&, &corners = face](std::size_t k)
        { return mesh.points[idx(corners[k])]; };
        if (count == 1)
            sum += 0.5 * (point(1) - point(0)).cross(point(2) - point(0)).norm();
    }
    return sum;
}

int below(double height, const Vector3d& x)
{
    return x.z() <= height ? 0 : -1;
}

} // namespace

TEST(TetMesh, cutting_at_a_plane_leaves_what_is_beyond_it_without_a_gap)
{
    const TetMesh mesh = box_of_tets({1, 1, 1}, {3, 4, 5});
    EXPECT_NEAR(volume_of(mesh), 1.0, 1e-12);
    EXPECT_NEAR(area_of(mesh), 6.0, 1e-12);
    for (const double height : {0.37, 0.5, 0.2 + 1e-9, 0.81})
    {
        SCOPED_TRACE(height);
        const TetMesh rest =
            cut_at_regions(mesh, [&](const Vector3d& x) { return below(height, x); });
        EXPECT_NEAR(volume_of(rest), 1.0 - height, 1e-8);
        EXPECT_NEAR(area_of(rest), 2.0 + 4.0 * (1.0 - height), 1e-8);
        for (std::size_t p = 0; p < rest.points.size(); ++p)
            EXPECT_EQ(rest.region_of_point[p],
                      rest.points[p].z() < height + 1e-8 ? 0 : -1);
    }
}

TEST(TetMesh, slanted_and_round_borders_are_cut_alike_from_both_sides)
{
    const TetMesh mesh = box_of_tets({1, 1, 1}, {6, 6, 6});
    const Vector3d normal = Vector3d(1, 2, 3).normalized();
    const auto slanted = [&](const Vector3d& x)
    { return normal.dot(x - Vector3d::Constant(0.5)) <= 0 ? 1 : -1; };
    const TetMesh half = cut_at_regions(mesh, slanted);
    // Ends of edges that the border passes at 0.02 of their length are taken for it.
    EXPECT_NEAR(volume_of(half), 0.5, 2e-3);
    area_of(half);
    const auto ball = [](const Vector3d& x)
    { return (x - Vector3d::Constant(0.5)).norm() <= 0.4 ? 0 : -1; };
    const TetMesh shell = cut_at_regions(mesh, ball);
    EXPECT_NEAR(volume_of(shell), 1.0 - 4.0 / 3.0 * M_PI * 0.064, 0.02);
    area_of(shell);
}

TEST(TetMesh, points_know_the_region_that_holds_them)
{
    const TetMesh mesh = box_of_tets({1, 1, 4}, {2, 2, 8});
    const auto ends = [](const Vector3d& x) {
        return x.z() <= 0.6 ? 0 : x.z() >= 3.3 ? 1 : -1;
    };
    const TetMesh middle = cut_at_regions(mesh, ends);
    EXPECT_NEAR(volume_of(middle), 2.7, 1e-8);
    for (std::size_t p = 0; p < middle.points.size(); ++p)
    {
        const double z = middle.points[p].z();
        EXPECT_EQ(middle.region_of_point[p], z < 0.6 + 1e-8   ? 0
                                             : z > 3.3 - 1e-8 ? 1
                                                              : -1);
    }
    const auto all = [](const Vector3d&) { return 0; };
    EXPECT_TRUE(cut_at_regions(mesh, all).tets.empty());
}

TEST(TetFinder, finds_the_tetrahedron_of_a_place_and_the_nearest_one_outside)
{
    const TetMesh mesh = box_of_tets({1, 2, 3}, {3, 4, 5});
    const TetFinder finder(mesh);
    std::mt19937 rng(7);
    for (int trial = 0; trial < 200; ++trial)
    {
        SCOPED_TRACE(trial);
        const bool is_outside = trial % 2 == 1;
        const Vector3d x(support::random_number(rng, 0, 1),
                         support::random_number(rng, 0, 2),
                         is_outside ? 3.0 + support::random_number(rng, 0.01, 0.1)
                                    : support::random_number(rng, 0, 3));
        const TetFinder::Found found = finder.find(x);
        Vector3d place = Vector3d::Zero();
        for (int k = 0; k < 4; ++k)
            place += found.weights[k] * mesh.points[idx(mesh.tets[found.tet][idx(k)])];
        EXPECT_LT((place - x).norm(), 1e-12);
        EXPECT_GT(found.weights.minCoeff(), is_outside ? -0.6 : -1e-12);
    }
}

TEST(TetFinder, a_flat_tetrahedron_far_away_is_not_the_nearest)
{
    TetMesh mesh;
    mesh.points = {{0, 0, 0},   {1, 0, 0},     {0, 1, 0},     {1, 1, 1e-3}, // flat
                   {2, 0, 0.2}, {2.5, 0, 0.2}, {2, 0.5, 0.2}, {2, 0, 0.7}};
    mesh.tets = {{0, 1, 2, 3}, {4, 5, 6, 7}};
    EXPECT_EQ(TetFinder(mesh).find({2.1, 0.1, 0}).tet, 1u);
    EXPECT_EQ(TetFinder(mesh).find({0.9, 0.1, 0.01}).tet, 0u);
}

} // namespace cellwarp::core::bench
