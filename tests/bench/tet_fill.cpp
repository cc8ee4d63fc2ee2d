// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/bench/tet_fill.h"

#include <array>
#include <map>
#include <utility>
#include <vector>

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Mesh_complex_3_in_triangulation_3.h>
#include <CGAL/Mesh_criteria_3.h>
#include <CGAL/Mesh_polyhedron_3.h>
#include <CGAL/Mesh_triangulation_3.h>
#include <CGAL/Polygon_mesh_processing/orient_polygon_soup.h>
#include <CGAL/Polygon_mesh_processing/polygon_soup_to_polygon_mesh.h>
#include <CGAL/Polyhedral_mesh_domain_with_features_3.h>
#include <CGAL/make_mesh_3.h>

#include "io/base/error.h"
#include "octree/base/index.h"

namespace cellwarp::core::bench
{

namespace
{

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Polyhedron = CGAL::Mesh_polyhedron_3<Kernel>::type;
using Domain = CGAL::Polyhedral_mesh_domain_with_features_3<Kernel>;
using Triangulation = CGAL::Mesh_triangulation_3<Domain>::type;
using Complex =
    CGAL::Mesh_complex_3_in_triangulation_3<Triangulation, Domain::Corner_index,
                                            Domain::Curve_index>;

/// Radius of the sphere around a regular tetrahedron or, nearly, triangle [edge].
constexpr double kRadiusOfEdge = 0.6;
/// How far surface triangles may lie off the surface [edge].
constexpr double kOffSurface = 0.05;
/// So much of the edges' length about a place, as the mesher asks for it.
struct Share
{
    using FT = Kernel::FT;
    using Index = Domain::Index;

    const EdgeLength* edge;
    double share;

    FT operator()(const Kernel::Point_3& x, int, const Index&) const
    {
        return share * (*edge)({x.x(), x.y(), x.z()});
    }
};

Polyhedron polyhedron_of(const Shape& surface)
{
    namespace PMP = CGAL::Polygon_mesh_processing;
    std::vector<Kernel::Point_3> points;
    for (const Eigen::Vector3d& x : surface.samples)
        points.emplace_back(x.x(), x.y(), x.z());
    std::vector<std::array<std::size_t, 3>> faces;
    for (const Triangle& t : surface.triangles)
        faces.push_back({t[0], t[1], t[2]});
    Polyhedron polyhedron;
    if (!PMP::orient_polygon_soup(points, faces))
        throw Error(Fault::Malformed, "the model is not manifold: it cannot be filled");
    PMP::polygon_soup_to_polygon_mesh(points, faces, polyhedron);
    if (!CGAL::is_closed(polyhedron))
        throw Error(Fault::Malformed, "the model is not closed: it cannot be filled");
    return polyhedron;
}

TetMesh mesh_of(const Complex& complex)
{
    TetMesh mesh;
    std::map<Complex::Vertex_handle, int> numbers;
    for (auto cell = complex.cells_in_complex_begin();
         cell != complex.cells_in_complex_end(); ++cell)
    {
        Tet tet{};
        for (int k = 0; k < 4; ++k)
        {
            const Complex::Vertex_handle vertex = cell->vertex(k);
            const auto [found, is_new] =
                numbers.try_emplace(vertex, static_cast<int>(mesh.points.size()));
            if (is_new)
                mesh.points.emplace_back(vertex->point().x(), vertex->point().y(),
                                         vertex->point().z());
            tet[idx(k)] = found->second;
        }
        if (six_volumes(mesh, tet) < 0)
            std::swap(tet[0], tet[1]);
        mesh.tets.push_back(tet);
    }
    return mesh;
}

} // namespace

TetMesh fill_with_tets(const Shape& surface, const EdgeLength& edge, double sharp)
{
    const Polyhedron polyhedron = polyhedron_of(surface);
    Domain domain(polyhedron);
    domain.detect_features(sharp);
    const Share lengths{&edge, 1.0}, radii{&edge, kRadiusOfEdge},
        distances{&edge, kOffSurface};
    namespace P = CGAL::parameters;
    const CGAL::Mesh_criteria_3<Triangulation> criteria(
        P::edge_size = lengths, P::facet_angle = 25, P::facet_size = radii,
        P::facet_distance = distances, P::cell_radius_edge_ratio = 2,
        P::cell_size = radii);
    return mesh_of(CGAL::make_mesh_3<Complex>(domain, criteria));
}

} // namespace cellwarp::core::bench
