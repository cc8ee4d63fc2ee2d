// SPDX-License-Identifier: GPL-3.0-or-later
// The library carves a Delaunay tetrahedrisation from outside: through facets that no
// ball of radius alpha could pass it does not go on, and where it comes near the points
// it adds vertices at the offset. Its kernel decides all signs exactly.
#include "octree/wrap/wrap.h"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/alpha_wrap_3.h>

#include "octree/wrap/exact_numbers.h"

namespace cellwarp
{

Shape alpha_wrap(std::span<const Eigen::Vector3d> points, double alpha, double offset)
{
    using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
    using Mesh = CGAL::Surface_mesh<Kernel::Point_3>;
    Shape wrap;
    if (points.empty())
        return wrap;
    std::vector<Kernel::Point_3> input;
    input.reserve(points.size());
    for (const Eigen::Vector3d& x : points)
        input.emplace_back(x.x(), x.y(), x.z());
    Mesh mesh;
    CGAL::alpha_wrap_3(input, alpha, offset, mesh);
    for (const Mesh::Vertex_index vertex : mesh.vertices())
    {
        const Kernel::Point_3& x = mesh.point(vertex);
        wrap.samples.emplace_back(x.x(), x.y(), x.z());
    }
    for (const Mesh::Face_index face : mesh.faces())
    {
        Triangle triangle;
        std::size_t k = 0;
        for (const Mesh::Vertex_index vertex :
             CGAL::vertices_around_face(mesh.halfedge(face), mesh))
            triangle[k++] = vertex.idx();
        wrap.triangles.push_back(triangle);
    }
    return wrap;
}

} // namespace cellwarp
