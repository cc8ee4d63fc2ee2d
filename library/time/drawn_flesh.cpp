// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/time/drawn_flesh.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include <fmt/format.h>

#include "io/base/error.h"
#include "io/formats/medit_file.h"
#include "library/time/held_points.h"
#include "octree/base/index.h"
#include "octree/base/point_tree.h"
#include "octree/base/segment.h"
#include "solver/flesh/bone_points.h"
#include "solver/flesh/drawn_cells.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

/// The vertices of a drawn lattice are those of a bone within this [diagonal].
constexpr double kOnBone = 1e-6;

/// Cells of a drawn lattice whose middles are nearest to a sample that are looked at.
constexpr std::size_t kNearCells = 24;

/// A bone of a drawn lattice whose scene gives no radius [its length].
constexpr double kRadiusOfBone = 0.1;

/// A cell of a lattice file, for messages.
struct DrawnName
{
    std::int64_t line = 0;
    std::string text;
};

/// Material counts once: cells of the same corners would make it twice as stiff.
void refuse_twins(const FleshModel& model, const DrawnCells& drawn,
                  const std::vector<DrawnName>& names)
{
    std::map<std::vector<int>, std::size_t> known;
    for (std::size_t c = 0; c < drawn.cells.size(); ++c)
    {
        std::vector<int> corners = drawn.cells[c];
        std::sort(corners.begin(), corners.end());
        const auto [twin, is_new] = known.emplace(std::move(corners), c);
        if (!is_new)
            throw malformed({model.flesh().lattice, names[c].line, ""},
                            names[c].text + " has the corners of " +
                                names[twin->second].text);
    }
}

bool is_near(const BoneLine& bone, const Vector3d& x, double near)
{
    const double t = nearest_share(bone.from, bone.to, x);
    return (bone.from + t * (bone.to - bone.from) - x).norm() <= near;
}

/// Motions of the edges, which lie on bones of the skeleton, and of their vertices.
std::map<std::vector<int>, int> motions_of_edges(const FleshModel& model,
                                                 const Hexahedra& lattice,
                                                 const MeditMesh& mesh, double near)
{
    std::map<std::vector<int>, int> motions;
    std::size_t off = 0, first_off = 0;
    for (std::size_t e = 0; e < lattice.edges.size(); ++e)
    {
        const auto& [a, b] = lattice.edges[e];
        bool is_on = false;
        for (const TubeBone& bone : model.bones)
            if (is_near(bone.line, lattice.places[idx(a)], near) &&
                is_near(bone.line, lattice.places[idx(b)], near))
            {
                is_on = true;
                for (const std::vector<int>& of :
                     {std::vector{a}, {b}, {std::min(a, b), std::max(a, b)}})
                    motions.emplace(of, bone.line.motion);
                break;
            }
        if (!is_on && off++ == 0)
            first_off = e;
    }
    if (off > 0)
    {
        const std::size_t pieces = lattice.edges.size() / mesh.edges.size();
        const auto& edge = mesh.edges[first_off / pieces];
        throw malformed({model.flesh().lattice, edge.line, "Edges"},
                        fmt::format("the edge of vertices {} and {} lies on no bone "
                                    "of the skeleton ({} of {} do not)",
                                    edge.vertices[0] + 1, edge.vertices[1] + 1,
                                    (off + pieces - 1) / pieces, mesh.edges.size()));
    }
    return motions;
}

/// A bone that edges follow from end to end needs no other points.
bool runs_along_edges(const BoneLine& bone, const Hexahedra& lattice, double near)
{
    double covered = 0.0;
    for (const auto& [a, b] : lattice.edges)
        if (is_near(bone, lattice.places[idx(a)], near) &&
            is_near(bone, lattice.places[idx(b)], near))
            covered += (lattice.places[idx(a)] - lattice.places[idx(b)]).norm();
    return covered >= (bone.to - bone.from).norm() - 4.0 * near;
}

/// The last material that has each cell: by its reference in the file, by its middle in a
/// shape, or by the sample nearest to its middle.
std::vector<int> materials_of(const FleshModel& model, const Lattice& lattice,
                              const std::vector<std::int64_t>& references)
{
    const std::vector<FleshRegion>& materials = model.flesh().materials;
    std::vector<int> out(lattice.cells.size(), 0);
    if (materials.empty())
        return out;
    const std::vector<Vector3d>& samples = model.geometry->samples;
    const PointTree tree(samples);
    std::vector<PointTree::Neighbour> near;
    for (std::size_t m = 0; m < materials.size(); ++m)
    {
        const FleshRegion& told = materials[m];
        std::vector<Region> regions;
        if (!told.reference)
            regions = flesh_regions(model, {told.region}, told.field + ".region");
        const auto has = [&](std::size_t cell)
        {
            if (told.reference)
                return references[cell] == *told.reference;
            const Vector3d middle = model.to_model(
                cell_point(lattice, static_cast<int>(cell), Vector3d::Constant(0.5)));
            if (regions.front().holds(middle))
                return true;
            const std::vector<std::uint32_t>& listed = regions.front().listed;
            if (listed.empty())
                return false;
            tree.nearest(middle, 1, near);
            return std::binary_search(listed.begin(), listed.end(),
                                      static_cast<std::uint32_t>(near.front().index));
        };
        bool is_used = false;
        for (std::size_t c = 0; c < out.size(); ++c)
            if (has(c))
            {
                out[c] = static_cast<int>(m + 1);
                is_used = true;
            }
        if (!is_used)
            throw malformed({model.scene.path, 0,
                             told.field + (told.reference ? ".reference" : ".region")},
                            "no cell of the lattice has it");
    }
    return out;
}

/// Places of the samples, each in the cell that holds it or is nearest.
std::vector<DrawnForest::Place> places_of_samples(const FleshModel& model,
                                                  const DrawnForest& forest,
                                                  std::vector<std::string>& warnings)
{
    const Lattice lattice = forest.lattice(forest.roots()).lattice;
    std::vector<Vector3d> middles;
    for (int c = 0; c < static_cast<int>(lattice.cells.size()); ++c)
        middles.push_back(cell_point(lattice, c, Vector3d::Constant(0.5)));
    const PointTree tree(middles);
    std::vector<PointTree::Neighbour> near;
    std::size_t outside = 0;
    // Samples farther off count as outside, and there the map of a smallest cell ends.
    const double finest = 1.0 / (1 << forest.max_depth());
    const double outside_at = 0.05 * finest, reach = finest;
    std::vector<DrawnForest::Place> out;
    for (const Vector3d& sample : model.geometry->samples)
    {
        const Vector3d x = model.to_metres(sample);
        tree.nearest(x, kNearCells, near);
        double least = INFINITY;
        bool is_outside = true;
        int best = static_cast<int>(near.front().index);
        Vector3d at = Vector3d::Constant(0.5);
        for (const PointTree::Neighbour& candidate : near)
        {
            const int cell = static_cast<int>(candidate.index);
            const std::optional<Vector3d> found = local_place(lattice, cell, x);
            if (!found)
                continue;
            // Far outside a bent cell the map folds: how far counts in space.
            const Vector3d near_cell = found->cwiseMax(-reach).cwiseMin(1.0 + reach);
            const Vector3d inside = found->cwiseMax(0.0).cwiseMin(1.0);
            const double beyond = (cell_point(lattice, cell, inside) - x).norm();
            if (beyond < least)
            {
                least = beyond;
                best = cell;
                at = near_cell;
                is_outside = (*found - inside).norm() > outside_at;
            }
            if (*found == inside)
                break;
        }
        outside += is_outside;
        out.push_back({idx(best), at});
    }
    if (outside > 0)
        warnings.push_back(
            at({model.flesh().lattice, 0, ""},
               fmt::format("{} of {} samples lie outside the lattice: they follow the "
                           "nearest cell",
                           outside, model.geometry->samples.size())));
    return out;
}

} // namespace

DrawnFlesh read_drawn_flesh(const FleshModel& model, std::vector<std::string>& warnings)
{
    const MeditMesh mesh = read_medit(model.flesh().lattice);
    DrawnCells cells;
    for (const Vector3d& x : mesh.vertices)
        cells.places.push_back(model.to_metres(x));
    std::vector<DrawnName> names;
    std::vector<std::int64_t> references;
    const auto add = [&](const auto& of, const char* kind)
    {
        for (std::size_t k = 0; k < of.size(); ++k)
        {
            const auto& vertices = of[k].vertices;
            cells.cells.emplace_back(vertices.begin(), vertices.end());
            references.push_back(of[k].reference);
            names.push_back({of[k].line, fmt::format("{} {}", kind, k + 1)});
        }
    };
    add(mesh.hexahedra, "hexahedron");
    add(mesh.tetrahedra, "tetrahedron");
    add(mesh.prisms, "prism");
    refuse_twins(model, cells, names);
    for (const auto& edge : mesh.edges)
        cells.edges.emplace_back(edge.vertices[0], edge.vertices[1]);
    const bool has_detail = model.flesh().detail > 0.0;
    DrawnForest forest(hexahedra_of(cells), model.cells.max_depth);
    Octree first = forest.roots();
    for (int level = 1; !has_detail && level <= model.cells.max_depth; ++level)
    {
        model.check_cells(8 * first.leaves().size(), level);
        first = first.split_all(level, forest.has_material());
    }
    DrawnFlesh out{std::move(forest), std::move(first)};
    out.num_vertices = cells.places.size();
    const Hexahedra& hexahedra = out.forest.drawn();
    std::vector<int> cell_of; // in the file, of each cell
    for (const Leaf& leaf : out.first.leaves())
        cell_of.push_back(hexahedra.cell_of[out.forest.root_of(leaf)]);
    Lattice lattice;
    try
    {
        lattice = out.forest.lattice(out.first).lattice;
        // However small parts are, they must be the right way round.
        for (std::size_t cell = 0; has_detail && cell < cell_of.size(); ++cell)
            for (int k = 0; k < 8; ++k)
                if (!(cell_slopes(lattice, static_cast<int>(cell),
                                  Vector3d(k & 1, k >> 1 & 1, k >> 2))
                          .determinant() > 0.0))
                    throw InvertedHexahedron(cell);
    }
    catch (const InvertedHexahedron& fault)
    {
        const DrawnName& name = names[idx(cell_of[fault.number])];
        throw malformed({model.flesh().lattice, name.line, ""},
                        name.text + " is turned inside out");
    }
    std::vector<std::int64_t> reference_of_cell;
    for (const int cell : cell_of)
        reference_of_cell.push_back(references[idx(cell)]);
    out.materials = materials_of(model, lattice, reference_of_cell);
    for (const CornerNodes& corners : lattice.cells)
        out.edge = std::max(
            out.edge,
            (lattice.places[idx(corners[1])] - lattice.places[idx(corners[0])]).norm());
    const double near = kOnBone * model.metre * model.frame.diagonal();
    out.motion_of_edge = motions_of_edges(model, hexahedra, mesh, near);
    for (const TubeBone& bone : model.bones)
        if (!runs_along_edges(bone.line, hexahedra, near))
            out.lines.push_back(bone.line);
    out.bones = model.bones;
    for (TubeBone& bone : out.bones)
        if (!(bone.radius > 0.0))
            bone.radius = kRadiusOfBone * (bone.line.to - bone.line.from).norm();
    out.samples = places_of_samples(model, out.forest, warnings);
    if (!model.flesh().fine_regions.empty())
        for (const Region& region :
             flesh_regions(model, model.flesh().fine_regions, "skeleton.detail_regions"))
            out.fine.insert(out.fine.end(), region.samples.begin(), region.samples.end());
    return out;
}

DrawnLattice lattice_of(const DrawnFlesh& drawn, const Octree& octree)
{
    DrawnLattice out;
    ForestLattice made = drawn.forest.lattice(octree);
    out.lattice = std::move(made.lattice);
    for (LatticePart& part : out.lattice.parts)
        part.material =
            drawn
                .materials[idx(drawn.first.find(octree.leaves()[idx(part.cell)].corner))];
    out.vertices = {drawn.num_vertices, {}, drawn.edge};
    for (std::size_t n = 0; n < made.of_vertices.size(); ++n)
    {
        std::vector<int> of;
        NodeShares in_file;
        for (const NodeShare& vertex : made.of_vertices[n])
        {
            of.push_back(vertex.node);
            for (const NodeShare& drawn_one :
                 drawn.forest.drawn().means[idx(vertex.node)])
                in_file.push_back({drawn_one.node, vertex.share * drawn_one.share});
        }
        out.vertices.of_node.push_back(gathered(std::move(in_file)));
        if (const auto edge = drawn.motion_of_edge.find(of);
            edge != drawn.motion_of_edge.end() && out.lattice.hanging[n].empty())
            out.points.push_back(
                {{{static_cast<int>(n), 1.0}}, out.lattice.places[n], edge->second});
    }
    const std::vector<HeldPoint> crossings = points_on_bones(
        out.lattice, drawn.lines, [](int, const Vector3d&) { return true; });
    out.points.insert(out.points.end(), crossings.begin(), crossings.end());
    return out;
}

int drawn_cell_of(const Lattice& lattice, const Vector3d& metres)
{
    for (int cell = 0; cell < static_cast<int>(lattice.cells.size()); ++cell)
        if (const std::optional<Vector3d> local = local_place(lattice, cell, metres);
            local && local->minCoeff() >= -kBeside && local->maxCoeff() <= 1.0 + kBeside)
            return cell;
    return -1;
}

} // namespace cellwarp::core
