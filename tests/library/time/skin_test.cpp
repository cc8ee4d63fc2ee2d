// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/time/skin.h"

#include <map>
#include <stdexcept>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

/// Every edge has two faces, opposite ways.
void expect_closed(const Geometry& mesh)
{
    std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
    for (std::size_t f = 0; f < mesh.num_faces(); ++f)
    {
        const auto face = mesh.face(f);
        for (std::size_t k = 0; k < face.size(); ++k)
            ++edges[{face[k], face[(k + 1) % face.size()]}];
    }
    for (const auto& [edge, count] : edges)
        EXPECT_EQ((edges[{edge.second, edge.first}]), count);
}

double volume(const Geometry& mesh)
{
    double sum = 0.0;
    for (std::size_t f = 0; f < mesh.num_faces(); ++f)
    {
        const auto face = mesh.face(f);
        for (std::size_t k = 2; k < face.size(); ++k)
            sum += mesh.samples[face[0]].dot(
                       mesh.samples[face[k - 1]].cross(mesh.samples[face[k]])) /
                   6.0;
    }
    return sum;
}

} // namespace

TEST(Skin, of_a_straight_row_of_balls_has_their_radius)
{
    constexpr double R = 0.03;
    std::vector<Vector3d> centres;
    for (int k = 0; k <= 60; ++k)
        centres.push_back(Vector3d(1, 2, 3) +
                          0.5 * R * k * Vector3d(1, 0.3, -0.2).normalized());
    Geometry mesh;
    add_skin(centres, R, {1, 2, 3}, mesh);
    expect_closed(mesh);
    EXPECT_GT(volume(mesh), 0.0); // faces look out
    EXPECT_EQ(mesh.colours.size(), mesh.samples.size());
    EXPECT_EQ(mesh.groups.at(0).end_face, mesh.num_faces());
    const Vector3d axis = (centres.back() - centres.front()).normalized();
    for (const Vector3d& x : mesh.samples)
    {
        const double along = (x - centres.front()).dot(axis);
        if (along < 2.0 * R || along > 28.0 * R)
            continue;
        const double away = (x - centres.front() - along * axis).norm();
        EXPECT_NEAR(away, R, 1e-3 * R);
    }
}

TEST(Skin, is_one_where_it_comes_near_itself_and_closed_wherever)
{
    constexpr double R = 1.0;
    std::vector<Vector3d> centres;
    for (int k = 0; k <= 40; ++k)
        centres.emplace_back(0.5 * k, 0.0, 0.0);
    for (int k = 0; k <= 40; ++k)
        centres.emplace_back(10.0, 1.9, 0.5 * k - 10.0);
    Geometry mesh;
    add_skin(centres, R, {0, 0, 0}, mesh);
    expect_closed(mesh);
    Geometry one;
    add_skin(std::span(centres).first(1), R, {0, 0, 0},
             one); // less than the surface needs
    EXPECT_EQ(one.num_faces(), 0u);
    add_skin({}, R, {0, 0, 0}, one);
    EXPECT_EQ(one.num_faces(), 0u);
    EXPECT_THROW(
        add_skin(std::vector<Vector3d>{{0, 0, 0}, {1e9, 0, 0}}, R, {0, 0, 0}, one),
        std::invalid_argument);
}

} // namespace cellwarp::core
