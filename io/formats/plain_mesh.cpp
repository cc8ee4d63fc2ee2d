// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/formats/plain_mesh.h"

#include <algorithm>
#include <cassert>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include "io/base/number.h"
#include "io/formats/face_triangles.h"
#include "io/formats/stored_number.h"

namespace cellwarp::core
{

namespace
{

/// A normal for each sample; empty if one has none.
std::vector<Eigen::Vector3d> normals_of(const Geometry& geometry,
                                        const DeformedSamples& patch)
{
    std::vector<Eigen::Vector3d> normals(patch.samples.size(), Eigen::Vector3d::Zero());
    const std::vector<DirectionUse> uses = direction_uses(geometry);
    for (std::size_t u = 0; u < uses.size(); ++u)
        normals[uses[u].sample] = patch.directions[u];
    for (const Eigen::Vector3d& normal : normals)
        if (normal.isZero(0))
            return {};
    return normals;
}

void add_numbers(std::string& text, const Eigen::Vector3d& v, const char* before)
{
    for (int k = 0; k < 3; ++k)
    {
        text += k == 0 ? before : " ";
        text += shortest(v[k]);
    }
}

std::string obj_bytes(const Geometry& geometry, const DeformedSamples& patch,
                      const std::vector<Eigen::Vector3d>& normals)
{
    std::string text;
    const auto add_all =
        [&](const char* word, const std::vector<Eigen::Vector3d>& vectors)
    {
        for (const Eigen::Vector3d& v : vectors)
        {
            text += word;
            add_numbers(text, v, " ");
            text += "\n";
        }
    };
    add_all("v", patch.samples);
    add_all("vn", normals);
    std::size_t group = 0;
    for (std::size_t f = 0; f < geometry.num_faces(); ++f)
    {
        for (; group < geometry.groups.size() && geometry.groups[group].first_face <= f;
             ++group)
            text += "g " + geometry.groups[group].name + "\n";
        text += "f";
        for (const std::uint32_t corner : geometry.face(f))
        {
            const std::string index = std::to_string(corner + std::uint64_t(1));
            text += " " + index + (normals.empty() ? "" : "//" + index);
        }
        text += "\n";
    }
    return text;
}

std::string ply_bytes(const Geometry& geometry, const DeformedSamples& patch,
                      const std::vector<Eigen::Vector3d>& normals)
{
    std::string bytes = "ply\nformat binary_little_endian 1.0\nelement vertex " +
                        std::to_string(patch.samples.size()) + "\n";
    for (const char* name : {"double x", "double y", "double z"})
        bytes += std::string("property ") + name + "\n";
    if (!normals.empty())
        for (const char* name : {"float nx", "float ny", "float nz"})
            bytes += std::string("property ") + name + "\n";
    if (geometry.num_faces() > 0)
        bytes += "element face " + std::to_string(geometry.num_faces()) +
                 "\nproperty list uint uint vertex_indices\n";
    bytes += "end_header\n";
    for (std::size_t i = 0; i < patch.samples.size(); ++i)
    {
        for (int k = 0; k < 3; ++k)
            store(patch.samples[i][k], Scalar::Float64, false, bytes);
        for (int k = 0; k < 3 && !normals.empty(); ++k)
            store(normals[i][k], Scalar::Float32, false, bytes);
    }
    for (std::size_t f = 0; f < geometry.num_faces(); ++f)
    {
        const std::span<const std::uint32_t> corners = geometry.face(f);
        store(static_cast<double>(corners.size()), Scalar::UInt32, false, bytes);
        for (const std::uint32_t corner : corners)
            store(corner, Scalar::UInt32, false, bytes);
    }
    return bytes;
}

std::string off_bytes(const Geometry& geometry, const DeformedSamples& patch)
{
    std::string text = "OFF\n" + std::to_string(patch.samples.size()) + " " +
                       std::to_string(geometry.num_faces()) + " 0\n";
    for (const Eigen::Vector3d& x : patch.samples)
    {
        add_numbers(text, x, "");
        text += "\n";
    }
    for (std::size_t f = 0; f < geometry.num_faces(); ++f)
    {
        const std::span<const std::uint32_t> corners = geometry.face(f);
        text += std::to_string(corners.size());
        for (const std::uint32_t corner : corners)
            text += " " + std::to_string(corner);
        text += "\n";
    }
    return text;
}

std::string stl_bytes(const Geometry& geometry, const DeformedSamples& patch)
{
    constexpr std::size_t kHeader = 80;
    std::string bytes = "binary STL";
    bytes.resize(kHeader, ' ');
    store(static_cast<double>(geometry.num_triangles()), Scalar::UInt32, false, bytes);
    const auto add = [&](const Eigen::Vector3d& v)
    {
        for (int k = 0; k < 3; ++k)
            store(v[k], Scalar::Float32, false, bytes);
    };
    FaceCutter cutter(geometry);
    for (std::size_t f = 0; f < geometry.num_faces(); ++f)
        for (const FaceCutter::Triangle& triangle : cutter.triangles(f))
        {
            const Eigen::Vector3d& a = patch.samples[triangle[0]];
            const Eigen::Vector3d& b = patch.samples[triangle[1]];
            const Eigen::Vector3d& c = patch.samples[triangle[2]];
            add((b - a).cross(c - a).stableNormalized());
            for (const Eigen::Vector3d& corner : {a, b, c})
                add(corner);
            store(0.0, Scalar::UInt16, false, bytes);
        }
    return bytes;
}

std::string xyz_bytes(const DeformedSamples& patch,
                      const std::vector<Eigen::Vector3d>& normals)
{
    std::string text;
    for (std::size_t i = 0; i < patch.samples.size(); ++i)
    {
        add_numbers(text, patch.samples[i], "");
        // Without names they are known by their length, and by decimal points.
        for (int k = 0; k < 3 && !normals.empty(); ++k)
            store(normals[i][k], Scalar::TextReal, false, text += ' ');
        text += "\n";
    }
    return text;
}

} // namespace

bool has_all_normals(const Geometry& geometry)
{
    std::vector<char> has_one(geometry.samples.size(), 0);
    for (const DirectionUse& use : direction_uses(geometry))
        has_one[use.sample] = !geometry.directions[use.direction].isZero(0);
    return std::all_of(has_one.begin(), has_one.end(), [](char one) { return one != 0; });
}

bool is_plain_format(std::string_view extension)
{
    return extension == "obj" || extension == "ply";
}

bool is_converted_format(std::string_view extension)
{
    return is_plain_format(extension) || extension == "off" || extension == "stl" ||
           extension == "xyz";
}

std::string plain_mesh_bytes(const Geometry& geometry, const DeformedSamples& patch,
                             std::string_view extension)
{
    assert(is_converted_format(extension));
    if (extension == "off")
        return off_bytes(geometry, patch);
    if (extension == "stl")
        return stl_bytes(geometry, patch);
    const std::vector<Eigen::Vector3d> normals = normals_of(geometry, patch);
    return extension == "obj"   ? obj_bytes(geometry, patch, normals)
           : extension == "xyz" ? xyz_bytes(patch, normals)
                                : ply_bytes(geometry, patch, normals);
}

} // namespace cellwarp::core
