// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/plain_mesh.h"

#include <gtest/gtest.h>

#include "io/formats/geometry_file.h"

namespace cellwarp::core
{

namespace
{

/// A square with a corner cut off, and a triangle.
Geometry model()
{
    Geometry geometry;
    geometry.format = "fbx";
    geometry.samples = {{0, 0, 0}, {1, 0, 0}, {1, 0.1, 0}, {0, 1, 0}, {0, 0, 1}};
    geometry.corners = {0, 1, 2, 3, 0, 4, 1};
    for (const std::uint64_t end : {4, 7})
        geometry.face_ends.push_back(end);
    for (std::uint32_t i = 0; i < 5; ++i)
    {
        geometry.directions.emplace_back(0, 0.5, 1);
        geometry.direction_samples.push_back(i);
    }
    return geometry;
}

} // namespace

TEST(PlainMesh, what_is_written_reads_back)
{
    const Geometry geometry = model();
    DeformedSamples patch{geometry.samples, geometry.directions};
    patch.samples[2] = {1, 1.0 / 3, 1e-30};
    patch.directions[4] = {1, 0, 0};
    for (const std::string extension : {"obj", "ply"})
    {
        const Geometry read =
            scan_geometry("x." + extension, plain_mesh_bytes(geometry, patch, extension))
                .geometry;
        EXPECT_EQ(read.samples, patch.samples);
        EXPECT_EQ(read.corners, geometry.corners);
        EXPECT_EQ(read.face_ends, geometry.face_ends);
        EXPECT_EQ(read.directions, patch.directions);
    }
}

TEST(PlainMesh, other_formats_keep_what_they_can_hold)
{
    const Geometry geometry = model();
    DeformedSamples patch{geometry.samples, geometry.directions};
    patch.samples[2] = {1, 1.0 / 3, 1e-30};
    const auto read = [&](const std::string& extension)
    {
        EXPECT_TRUE(is_converted_format(extension));
        return scan_geometry("x." + extension,
                             plain_mesh_bytes(geometry, patch, extension))
            .geometry;
    };
    const Geometry off = read("off");
    EXPECT_EQ(off.samples, patch.samples);
    EXPECT_EQ(off.corners, geometry.corners);
    EXPECT_EQ(off.face_ends, geometry.face_ends);
    const Geometry xyz = read("xyz");
    EXPECT_EQ(xyz.samples, patch.samples);
    EXPECT_EQ(xyz.num_faces(), 0u);
    const Geometry stl = read("stl");
    ASSERT_EQ(stl.samples.size(), 9u);
    const std::uint32_t triangles[] = {0, 1, 2, 0, 2, 3, 0, 4, 1};
    for (std::size_t k = 0; k < 9; ++k)
        EXPECT_EQ(
            stl.samples[k],
            Eigen::Vector3d(patch.samples[triangles[k]].cast<float>().cast<double>()));
    EXPECT_FALSE(is_converted_format("glb"));
}

TEST(PlainMesh, a_concave_face_is_triangles_in_an_stl_as_it_lies_at_rest)
{
    // Its corner 2 points inwards at rest, its corner 1 where it is written.
    Geometry geometry;
    geometry.samples = {{0, 0, 0}, {2, 0, 0}, {0.5, 0.5, 0}, {0, 2, 0}};
    geometry.corners = {1, 2, 3, 0};
    geometry.face_ends.push_back(4);
    DeformedSamples patch{geometry.samples, {}};
    patch.samples[1] = {0.1, 0.1, 0};
    patch.samples[2] = {2, 2, 0};
    const Geometry stl =
        scan_geometry("x.stl", plain_mesh_bytes(geometry, patch, "stl")).geometry;
    ASSERT_EQ(stl.samples.size(), 6u);
    const std::uint32_t triangles[] = {1, 2, 0, 2, 3, 0};
    for (std::size_t k = 0; k < 6; ++k)
        EXPECT_EQ(
            stl.samples[k],
            Eigen::Vector3d(patch.samples[triangles[k]].cast<float>().cast<double>()));
}

TEST(PlainMesh, normals_in_columns_are_read_as_normals_again)
{
    const Geometry geometry =
        scan_geometry("x.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1\n")
            .geometry;
    const DeformedSamples patch{geometry.samples, {{0, 0, 1}, {0.6, 0.8, 0}, {1, 0, 0}}};
    const std::string text = plain_mesh_bytes(geometry, patch, "xyz");
    EXPECT_EQ(text, "0 0 0 0.0 0.0 1.0\n1 0 0 0.6 0.8 0.0\n0 1 0 1.0 0.0 0.0\n");
    EXPECT_EQ(scan_geometry("x.xyz", text).geometry.directions, patch.directions);
}

TEST(PlainMesh, groups_of_faces_keep_their_names)
{
    Geometry geometry = model();
    geometry.groups = {{"square", 0, 1}, {"corner", 1, 2}};
    const std::string bytes =
        plain_mesh_bytes(geometry, {geometry.samples, geometry.directions}, "obj");
    const Geometry read = scan_geometry("x.obj", bytes).geometry;
    ASSERT_EQ(read.groups.size(), 2u);
    for (std::size_t k = 0; k < 2; ++k)
    {
        EXPECT_EQ(read.groups[k].name, geometry.groups[k].name);
        EXPECT_EQ(read.groups[k].first_face, geometry.groups[k].first_face);
        EXPECT_EQ(read.groups[k].end_face, geometry.groups[k].end_face);
    }
}

TEST(PlainMesh, normals_are_left_out_where_a_sample_has_none)
{
    Geometry geometry = model();
    geometry.directions.pop_back();
    geometry.direction_samples.pop_back();
    geometry.corners.clear();
    geometry.face_ends.clear();
    const DeformedSamples patch{geometry.samples, geometry.directions};
    for (const std::string extension : {"obj", "ply"})
    {
        const Geometry read =
            scan_geometry("x." + extension, plain_mesh_bytes(geometry, patch, extension))
                .geometry;
        EXPECT_EQ(read.samples, patch.samples);
        EXPECT_TRUE(read.directions.empty());
        EXPECT_EQ(read.num_faces(), 0u);
    }
}

} // namespace cellwarp::core
