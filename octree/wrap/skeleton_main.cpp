// SPDX-License-Identifier: GPL-3.0-or-later
// cellwarp-skeleton: the curve skeleton of the surface on stdin, onto stdout. A program
// of its own because the library orders some of its work by the addresses of what it
// allocates: in a process that does nothing else these are always in the same order.
#include <array>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include <csignal>
#include <sys/prctl.h>

#include <CGAL/Polygon_mesh_processing/connected_components.h>
#include <CGAL/Polygon_mesh_processing/orientation.h>
#include <CGAL/Polygon_mesh_processing/polygon_mesh_to_polygon_soup.h>
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Random.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/boost/graph/helpers.h>
#include <CGAL/extract_mean_curvature_flow_skeleton.h>

#include "octree/wrap/skeleton_bytes.h"

namespace cellwarp::core
{

namespace
{

using Point = CGAL::Simple_cartesian<double>::Point_3;
using Mesh = CGAL::Surface_mesh<Point>;
using Skeletonization = CGAL::Mean_curvature_flow_skeletonization<Mesh>;

/// Weights of the flow: how slowly it contracts, and how much it keeps to the middle.
constexpr double kQuality = 0.05, kCentred = 1.0;

Eigen::Vector3d vector_of(const Point& p)
{
    return {p.x(), p.y(), p.z()};
}

/// The largest part of a surface that is closed and of one sheet; \p corners: in which
/// order those of a triangle are taken.
Mesh closed_part(const Shape& surface, const std::array<std::size_t, 3>& corners)
{
    std::vector<Point> points;
    for (const Eigen::Vector3d& x : surface.samples)
        points.emplace_back(x.x(), x.y(), x.z());
    std::vector<std::vector<std::size_t>> faces;
    for (const Triangle& triangle : surface.triangles)
        faces.push_back(
            {triangle[corners[0]], triangle[corners[1]], triangle[corners[2]]});
    Mesh mesh;
    if (!CGAL::Polygon_mesh_processing::is_polygon_soup_a_polygon_mesh(faces))
        return mesh;
    CGAL::Polygon_mesh_processing::polygon_soup_to_polygon_mesh(points, faces, mesh);
    for (const Mesh::Vertex_index vertex : mesh.vertices())
        if (mesh.is_isolated(vertex))
            mesh.remove_vertex(vertex);
    mesh.collect_garbage();
    CGAL::Polygon_mesh_processing::keep_largest_connected_components(mesh, 1);
    mesh.collect_garbage();
    if (!CGAL::is_closed(mesh) || mesh.number_of_faces() < 4)
        mesh.clear();
    return mesh;
}

/// The same with its normals outwards: the flow goes against them.
Mesh closed_part_turned_outwards(const Shape& surface)
{
    Mesh mesh = closed_part(surface, {0, 1, 2});
    // Made anew: the flow depends on where faces begin as well.
    if (!mesh.is_empty() && !CGAL::Polygon_mesh_processing::is_outward_oriented(mesh))
        mesh = closed_part(surface, {0, 2, 1});
    return mesh;
}

CurveSkeleton skeleton_of(const Shape& surface)
{
    CurveSkeleton skeleton;
    const Mesh mesh = closed_part_turned_outwards(surface);
    if (mesh.is_empty())
        return skeleton;
    // Points are shuffled before they are triangulated: each time the same way.
    CGAL::get_default_random() = CGAL::Random(1);
    Skeletonization::Skeleton graph;
    Skeletonization flow(mesh);
    flow.set_quality_speed_tradeoff(kQuality);
    flow.set_medially_centered_speed_tradeoff(kCentred);
    flow.contract_until_convergence();
    flow.convert_to_skeleton(graph);
    for (const auto vertex : CGAL::make_range(vertices(graph)))
    {
        skeleton.points.push_back(vector_of(graph[vertex].point));
        std::vector<Eigen::Vector3d>& around = skeleton.around.emplace_back();
        for (const Mesh::Vertex_index origin : graph[vertex].vertices)
            around.push_back(vector_of(mesh.point(origin)));
    }
    for (const auto edge : CGAL::make_range(edges(graph)))
        skeleton.edges.push_back({static_cast<int>(source(edge, graph)),
                                  static_cast<int>(target(edge, graph))});
    return skeleton;
}

int run()
{
    std::string bytes;
    char part[65536];
    for (std::size_t got = 0; (got = std::fread(part, 1, sizeof part, stdin)) > 0;)
        bytes.append(part, got);
    Shape surface;
    if (!read_bytes(bytes, surface))
        return 2;
    const std::string answer = bytes_of(skeleton_of(surface));
    return std::fwrite(answer.data(), 1, answer.size(), stdout) == answer.size() &&
                   std::fflush(stdout) == 0
               ? 0
               : 4;
}

} // namespace

} // namespace cellwarp::core

int main()
{
    // It ends with the program that started it.
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    try
    {
        return cellwarp::core::run();
    }
    catch (const std::bad_alloc&)
    {
        return cellwarp::core::kSkeletonWithoutMemory;
    }
    catch (const std::exception&)
    {
        return 1; // the library gave up: there is no skeleton
    }
}
