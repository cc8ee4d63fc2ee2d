// SPDX-License-Identifier: GPL-3.0-or-later
// The library carves a Delaunay tetrahedrisation from outside: through facets that no
// ball of radius alpha could pass it does not go on, and where it comes near the points
// it adds vertices at the offset. Its kernel decides all signs exactly.
#include "octree/wrap/wrap.h"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/alpha_wrap_3.h>

namespace cellwarp::core
{

namespace
{

using WrapKernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Mesh = CGAL::Surface_mesh<WrapKernel::Point_3>;

std::vector<WrapKernel::Point_3> library_points(std::span<const Eigen::Vector3d> points)
{
    std::vector<WrapKernel::Point_3> out;
    out.reserve(points.size());
    for (const Eigen::Vector3d& x : points)
        out.emplace_back(x.x(), x.y(), x.z());
    return out;
}

Shape shape_of(const Mesh& mesh)
{
    Shape shape;
    for (const Mesh::Vertex_index vertex : mesh.vertices())
    {
        const WrapKernel::Point_3& x = mesh.point(vertex);
        shape.samples.emplace_back(x.x(), x.y(), x.z());
    }
    for (const Mesh::Face_index face : mesh.faces())
    {
        Triangle triangle;
        std::size_t k = 0;
        for (const Mesh::Vertex_index vertex :
             CGAL::vertices_around_face(mesh.halfedge(face), mesh))
            triangle[k++] = vertex.idx();
        shape.triangles.push_back(triangle);
    }
    return shape;
}

} // namespace

Shape alpha_wrap(std::span<const Eigen::Vector3d> points, double alpha, double offset)
{
    if (points.empty())
        return {};
    Mesh mesh;
    CGAL::alpha_wrap_3(library_points(points), alpha, offset, mesh);
    return shape_of(mesh);
}

Shape alpha_wrap(const Shape& surface, double alpha, double offset)
{
    if (surface.triangles.empty())
        return {};
    std::vector<std::vector<std::size_t>> faces;
    faces.reserve(surface.triangles.size());
    for (const auto& [a, b, c] : surface.triangles)
        faces.push_back({a, b, c});
    Mesh mesh;
    CGAL::alpha_wrap_3(library_points(surface.samples), faces, alpha, offset, mesh);
    return shape_of(mesh);
}

} // namespace cellwarp::core
