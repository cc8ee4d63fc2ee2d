// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/flesh/flesh_body.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <numeric>

#include <fmt/format.h>

#include "editor/session/bone_regions.h"
#include "editor/session/region_set.h"
#include "io/error.h"
#include "io/medit_file.h"
#include "io/number.h"
#include "io/weight_file.h"
#include "octree/base/index.h"
#include "octree/base/point_tree.h"
#include "octree/base/segment.h"
#include "octree/base/union_find.h"
#include "solver/cells/glue_distances.h"
#include "solver/flesh/bone_points.h"
#include "solver/flesh/bone_tube.h"
#include "solver/flesh/drawn_cells.h"
#include "solver/flesh/step_rows.h"

namespace cellwarp
{

namespace
{

using Eigen::Vector3d;

/// Cells of the lattice along the longest side.
constexpr int kAcross = 24;

constexpr double kUsualTolerance = 1e-3, kTightTolerance = 1e-10;

/// The vertices of a drawn lattice are those of a bone within this [diagonal].
constexpr double kOnBone = 1e-6;

/// Cells of a drawn lattice whose middles are nearest to a sample that are looked at.
constexpr std::size_t kNearCells = 24;

/// A point this far beside a cell lies in it [edge].
constexpr double kBeside = 1e-6;

/// How far from their border bones blend [edge].
constexpr double kBlend = 2.0;

/// A bone of a drawn lattice whose scene gives no radius [its length].
constexpr double kRadiusOfBone = 0.1;

FleshMaterial material_of(const FleshStatement& flesh)
{
    return {flesh.young, flesh.poisson, flesh.density};
}

/// What of a scene this version does not build.
void refuse_what_is_not_built(const SceneFile& scene)
{
    const FleshStatement& flesh = scene.skeleton->flesh;
    const auto refuse = [&](const char* key, const std::string& what) {
        throw malformed({scene.path, 0, std::string("skeleton.") + key}, what);
    };
    if (flesh.detail > 0.0)
        refuse("detail", "is not supported by this version");
    if (flesh.law == "regions" && flesh.newton > 1)
        refuse("newton", "is for other laws: regions are solved once a step");
    if (scene.time->integrator != "implicit-euler")
        throw malformed({scene.path, 0, "simulate.integrator"},
                        "got " + in_quotes(scene.time->integrator) +
                            ", flesh has implicit-euler alone");
}

struct Builder
{
    const Geometry& geometry;
    const SceneFile& scene;
    const SkeletonValues& skeleton;
    FleshBody body;
    std::vector<FleshMaterial> materials;
    std::vector<TubeBone> bones;
    /// Points that are held wholly, but not by elimination.
    std::vector<std::pair<PulledPoint, ShiftKeys>> held_as_rows = {};
    std::size_t num_held_as_rows = 0;

    const FleshStatement& flesh() const { return scene.skeleton->flesh; }

    Units units() const
    {
        return {body.frame, false, bounding_box(geometry.samples), 0.0};
    }

    /// Bones as lines, and the radii of their tubes where they are told [m].
    void place_bones()
    {
        body.skeleton = make_skeleton_handle(skeleton.joints, units(), scene.path);
        for (std::size_t j = 0; j < body.skeleton->size(); ++j)
            for (const auto& [from, to] : body.skeleton->bones(j))
                bones.push_back(
                    {{body.metre * from, body.metre * to, static_cast<int>(j)},
                     body.metre * body.skeleton->told_radius(j).value_or(0.0)});
    }

    RegionSet region_of(const FleshRegion& told, const Body& octree) const
    {
        try
        {
            const HandleFile file =
                parse_handles(scene.path, "cellwarp-handles 1\nfixed material " +
                                              told.region + "\nframe 1\n");
            return RegionSet(octree.rest,
                             resolve_regions(file.stages.front().regions, geometry,
                                             geometry.samples, units(), file),
                             scene.path);
        }
        catch (const Error& error)
        {
            // It names the line of a file that nobody has.
            std::string what = error.what();
            const std::string place = scene.path + ":2: ";
            if (what.starts_with(place))
                what.erase(0, place.size());
            throw Error(error.fault(), at({scene.path, 0, told.field + ".region"}, what));
        }
    }

    /// Regions of other materials: of each voxel the last that has it.
    std::vector<int> materials_of_voxels(const Body& octree)
    {
        std::vector<int> of_voxel(octree.rest->material.grid.size(), 0);
        for (const FleshRegion& told : flesh().materials)
        {
            const RegionSet region = region_of(told, octree);
            const int number = static_cast<int>(materials.size());
            FleshMaterial& material = materials.emplace_back(materials.front());
            material.young = told.young.value_or(material.young);
            material.poisson = told.poisson.value_or(material.poisson);
            material.density = told.density.value_or(material.density);
            for (const std::uint32_t voxel : region.voxels(0))
                of_voxel[voxel] = number;
        }
        return of_voxel;
    }

    Body coarsest(const CellSettings& cells) const
    {
        try
        {
            return build_body(build_rest_shape(geometry, geometry.samples, cells), cells);
        }
        catch (const Error& error)
        {
            if (error.fault() != Fault::Budget)
                throw;
            throw Error(Fault::Budget,
                        at({scene.path, 0, "skeleton.across"}, error.what()));
        }
    }

    /// The octree's cells; those that bones pass are divided max_depth times.
    Body cut_octree(const CellSettings& settings)
    {
        CellSettings cells = settings;
        cells.across = static_cast<int>(flesh().across.value_or(kAcross));
        cells.max_depth = static_cast<int>(flesh().max_depth.value_or(0));
        cells.min_depth = 0;
        Body octree = coarsest(cells);
        const VoxelGrid& grid = octree.rest->material.grid;
        const MaterialTest has_material = material_test(grid);
        for (int level = 1; level <= cells.max_depth; ++level)
        {
            std::vector<LeafNumber> crossed;
            for (std::size_t l = 0; l < octree.octree.leaves().size(); ++l)
            {
                const VoxelBlock block =
                    voxel_block(grid.shape(), octree.octree.leaves()[l]);
                const Vector3d middle = grid.from_voxels(
                    block.first.cast<double>() + Vector3d::Constant(0.5 * block.width));
                const double reach =
                    0.5 * std::sqrt(3.0) * block.width * grid.shape().voxel();
                if (std::any_of(bones.begin(), bones.end(),
                                [&](const TubeBone& bone)
                                {
                                    const Vector3d a = bone.line.from / body.metre,
                                                   b = bone.line.to / body.metre;
                                    const double t = nearest_share(a, b, middle);
                                    return (a + t * (b - a) - middle).norm() <= reach;
                                }))
                    crossed.push_back(LeafNumber(l));
            }
            Octree finer = octree.octree.split(crossed, has_material);
            if (static_cast<std::int64_t>(finer.leaves().size()) > cells.max_cells)
                throw Error(
                    Fault::Budget,
                    at({scene.path, 0, "skeleton.max_depth"},
                       fmt::format("at depth {} the lattice has {} cells, more "
                                   "than max_cells {}",
                                   level, finer.leaves().size(), cells.max_cells)));
            octree = cut(octree.rest, std::move(finer));
        }
        return octree;
    }

    FleshSettings settings(bool is_tight) const
    {
        FleshSettings out;
        out.law = flesh().law == "linear"        ? FleshLaw::Linear
                  : flesh().law == "regions"     ? FleshLaw::Regions
                  : flesh().law == "stvk"        ? FleshLaw::StVenantKirchhoff
                  : flesh().law == "neo-hookean" ? FleshLaw::NeoHookean
                                                 : FleshLaw::Cells;
        out.alpha = flesh().alpha;
        out.beta = flesh().beta;
        const Triple& g = scene.time->gravity;
        out.gravity = body.frame.axes * Vector3d(g[0], g[1], g[2]);
        out.tolerance = is_tight ? kTightTolerance : kUsualTolerance;
        out.newton = static_cast<int>(flesh().newton);
        return out;
    }

    void from_octree(const CellSettings& cells, bool is_tight)
    {
        const auto octree = std::make_shared<const Body>(cut_octree(cells));
        body.octree = octree;
        const RestShape& rest = *octree->rest;
        body.warnings.insert(body.warnings.end(), rest.warnings.begin(),
                             rest.warnings.end());
        Lattice lattice = octree_lattice(octree->octree, octree->cells, body.metre);
        if (!flesh().materials.empty())
            lattice.parts =
                parts_by_material(rest.material.grid, octree->octree, octree->pieces,
                                  materials_of_voxels(*octree), body.metre);
        SkeletonBinding binding;
        bone_regions(*body.skeleton, rest, binding);
        for (TubeBone& bone : bones)
            for (const BoneBinding& bound : binding.bones)
                if (bound.name == body.skeleton->statement(idx(bone.line.motion)).name)
                    bone.radius = body.metre * bound.radius;
        const std::vector<std::int32_t>& pieces = octree->pieces.piece_of_voxel;
        const VoxelGrid& grid = rest.material.grid;
        const HoldsPoint holds = [&](int cell, const Vector3d& x)
        { return piece_at(grid, pieces, x / body.metre) == cell; };
        std::vector<TubePart> tubes;
        if (flesh().has_tube)
            tubes = tubes_of(lattice,
                             points_in_tubes(grid, pieces, lattice, body.metre, bones));
        std::vector<BoneLine> lines;
        for (const TubeBone& bone : bones)
            lines.push_back(bone.line);
        const CellOf cell_of = [&](const Vector3d& x)
        { return static_cast<int>(piece_at(grid, pieces, x / body.metre)); };
        std::vector<HeldPoint> points = points_on_bones(lattice, lines, holds);
        add_held_points(lattice, cell_of, points);
        std::vector<FleshRegionShares> regions;
        if (flesh().law == "regions")
            regions = blended(lattice, distances_to_bones(lattice, *octree),
                              octree->cell_of_sample);
        finish(std::move(lattice), std::move(points), std::move(tubes),
               std::move(regions), is_tight);
        body.cell_of_sample = octree->cell_of_sample;
        for (std::size_t i = 0; i < rest.samples.size(); ++i)
            body.local.push_back(*local_place(body.flesh->lattice(),
                                              body.cell_of_sample[i],
                                              body.metre * rest.samples[i]));
    }

    std::vector<TubePart> tubes_of(const Lattice& lattice,
                                   const std::vector<std::vector<MaterialPoint>>& points)
    {
        std::string empty;
        for (std::size_t b = 0; b < bones.size(); ++b)
            if (points[b].empty())
                empty += (empty.empty() ? "" : ", ") +
                         body.skeleton->statement(idx(bones[b].line.motion)).name;
        if (!empty.empty())
            body.warnings.push_back(at({scene.path, 0, "skeleton.tube"},
                                       "holds no material around bones of " + empty +
                                           ": their flesh may spin (see tube_radius)"));
        return tube_parts(lattice, materials, bones, points, flesh().tube_stiffness);
    }

    void from_file(bool is_tight)
    {
        if (!flesh().materials.empty())
            throw malformed({scene.path, 0, "skeleton.materials"},
                            "a lattice of a file has one material");
        const MeditMesh mesh = read_medit(flesh().lattice);
        DrawnCells drawn;
        for (const Vector3d& x : mesh.vertices)
            drawn.places.push_back(body.to_metres(x));
        std::vector<DrawnName> names;
        const auto add = [&](const auto& cells, const char* kind)
        {
            for (std::size_t k = 0; k < cells.size(); ++k)
            {
                const auto& vertices = cells[k].vertices;
                drawn.cells.emplace_back(vertices.begin(), vertices.end());
                names.push_back({cells[k].line, fmt::format("{} {}", kind, k + 1)});
            }
        };
        add(mesh.hexahedra, "hexahedron");
        add(mesh.tetrahedra, "tetrahedron");
        add(mesh.prisms, "prism");
        refuse_twins(drawn, names);
        for (const auto& edge : mesh.edges)
            drawn.edges.emplace_back(edge.vertices[0], edge.vertices[1]);
        const Hexahedra hexahedra = hexahedra_of(drawn);
        Lattice lattice;
        try
        {
            lattice = drawn_lattice(hexahedra.places, hexahedra.cells,
                                    std::vector<int>(hexahedra.cells.size(), 0));
        }
        catch (const InvertedHexahedron& fault)
        {
            const DrawnName& name = names[idx(hexahedra.cell_of[fault.number])];
            throw malformed({flesh().lattice, name.line, ""},
                            name.text + " is turned inside out");
        }
        const double near = kOnBone * body.metre * body.frame.diagonal();
        const CellOf cell_of = [&](const Vector3d& x)
        { return drawn_cell_of(lattice, x); };
        std::vector<HeldPoint> points = points_of_edges(hexahedra, mesh, near);
        std::vector<BoneLine> lines;
        for (const TubeBone& bone : bones)
            if (!runs_along_edges(bone.line, hexahedra, near))
                lines.push_back(bone.line);
        const std::vector<HeldPoint> crossings =
            points_on_bones(lattice, lines, [](int, const Vector3d&) { return true; });
        points.insert(points.end(), crossings.begin(), crossings.end());
        add_held_points(lattice, cell_of, points);
        for (TubeBone& bone : bones)
            if (!(bone.radius > 0.0))
                bone.radius = kRadiusOfBone * (bone.line.to - bone.line.from).norm();
        std::vector<TubePart> tubes;
        if (flesh().has_tube)
            tubes = tubes_of(lattice, points_in_tubes(lattice, bones));
        std::vector<FleshRegionShares> regions;
        if (flesh().law == "regions")
        {
            if (!flesh().weights.empty())
                throw malformed({scene.path, 0, "skeleton.weights"},
                                "are painted on samples of an octree's lattice alone");
            regions = blended(lattice, straight_distances(lattice), {});
        }
        finish(std::move(lattice), std::move(points), std::move(tubes),
               std::move(regions), is_tight);
        locate_samples();
    }

    /// A cell of a lattice file, for messages.
    struct DrawnName
    {
        std::int64_t line = 0;
        std::string text;
    };

    /// Material counts once: cells of the same corners would make it twice as stiff.
    void refuse_twins(const DrawnCells& drawn, const std::vector<DrawnName>& names) const
    {
        std::map<std::vector<int>, std::size_t> known;
        for (std::size_t c = 0; c < drawn.cells.size(); ++c)
        {
            std::vector<int> corners = drawn.cells[c];
            std::sort(corners.begin(), corners.end());
            const auto [twin, is_new] = known.emplace(std::move(corners), c);
            if (!is_new)
                throw malformed({flesh().lattice, names[c].line, ""},
                                names[c].text + " has the corners of " +
                                    names[twin->second].text);
        }
    }

    /// The vertices of edges that lie on a bone of the skeleton, each once.
    std::vector<HeldPoint> points_of_edges(const Hexahedra& lattice,
                                           const MeditMesh& mesh, double near) const
    {
        std::map<int, int> motion_of_vertex;
        std::size_t off = 0, first_off = 0;
        for (std::size_t e = 0; e < lattice.edges.size(); ++e)
        {
            const auto& [a, b] = lattice.edges[e];
            bool is_on = false;
            for (const TubeBone& bone : bones)
                if (is_near(bone.line, lattice.places[idx(a)], near) &&
                    is_near(bone.line, lattice.places[idx(b)], near))
                {
                    is_on = true;
                    motion_of_vertex.emplace(a, bone.line.motion);
                    motion_of_vertex.emplace(b, bone.line.motion);
                    break;
                }
            if (!is_on && off++ == 0)
                first_off = e;
        }
        if (off > 0)
        {
            // Where cells are split each edge is two.
            const auto& edge =
                mesh.edges[first_off / (lattice.edges.size() / mesh.edges.size())];
            throw malformed({flesh().lattice, edge.line, "Edges"},
                            fmt::format("the edge of vertices {} and {} lies on no bone "
                                        "of the skeleton ({} of {} do not)",
                                        edge.vertices[0] + 1, edge.vertices[1] + 1, off,
                                        lattice.edges.size()));
        }
        std::vector<HeldPoint> points;
        for (const auto& [vertex, motion] : motion_of_vertex)
            points.push_back({{{vertex, 1.0}}, lattice.places[idx(vertex)], motion});
        return points;
    }

    static bool is_near(const BoneLine& bone, const Vector3d& x, double near)
    {
        const double t = nearest_share(bone.from, bone.to, x);
        return (bone.from + t * (bone.to - bone.from) - x).norm() <= near;
    }

    /// A bone that edges follow from end to end needs no other points.
    static bool runs_along_edges(const BoneLine& bone, const Hexahedra& lattice,
                                 double near)
    {
        double covered = 0.0;
        for (const auto& [a, b] : lattice.edges)
            if (is_near(bone, lattice.places[idx(a)], near) &&
                is_near(bone, lattice.places[idx(b)], near))
                covered += (lattice.places[idx(a)] - lattice.places[idx(b)]).norm();
        return covered >= (bone.to - bone.from).norm() - 4.0 * near;
    }

    /// The cell of a drawn lattice that each sample lies in, or nearest to.
    void locate_samples()
    {
        const Lattice& lattice = body.flesh->lattice();
        std::vector<Vector3d> middles;
        for (int c = 0; c < static_cast<int>(lattice.cells.size()); ++c)
            middles.push_back(cell_point(lattice, c, Vector3d::Constant(0.5)));
        const PointTree tree(middles);
        std::vector<PointTree::Neighbour> near;
        std::size_t outside = 0;
        // Of a cell: samples farther off count as outside, and where its map ends.
        constexpr double kOutside = 0.05, kReach = 1.0;
        for (const Vector3d& sample : geometry.samples)
        {
            const Vector3d x = body.to_metres(sample);
            tree.nearest(x, kNearCells, near);
            double least = INFINITY;
            bool is_outside = true;
            int best = static_cast<int>(near.front().index);
            Vector3d at = Vector3d::Constant(0.5);
            for (const PointTree::Neighbour& candidate : near)
            {
                const int cell = static_cast<int>(candidate.index);
                const std::optional<Vector3d> local = local_place(lattice, cell, x);
                if (!local)
                    continue;
                // Far outside a bent cell the map folds: how far counts in space.
                const Vector3d near_cell =
                    local->cwiseMax(-kReach).cwiseMin(1.0 + kReach);
                const Vector3d inside = local->cwiseMax(0.0).cwiseMin(1.0);
                const double beyond = (cell_point(lattice, cell, inside) - x).norm();
                if (beyond < least)
                {
                    least = beyond;
                    best = cell;
                    at = near_cell;
                    is_outside = (*local - inside).norm() > kOutside;
                }
                if (*local == inside)
                    break;
            }
            outside += is_outside;
            body.cell_of_sample.push_back(best);
            body.local.push_back(at);
        }
        if (outside > 0)
            body.warnings.push_back(at(
                {flesh().lattice, 0, ""},
                fmt::format("{} of {} samples lie outside the lattice: they follow the "
                            "nearest cell",
                            outside, geometry.samples.size())));
    }

    using CellOf = std::function<int(const Vector3d& metres)>; ///< negative: none

    ShiftKeys keys_of(const ShiftStatement& told) const
    {
        ShiftKeys keys;
        keys.times = told.times;
        for (const Vector3d& shift : told.shifts)
            keys.shifts.push_back(body.metre * body.frame.vector_to_work(shift));
        return keys;
    }
    Vector3d direction_of(const Vector3d& model) const
    {
        return body.frame.axes * model.normalized();
    }

    /// What the scene holds, after what bones hold; those along a normal are taken down.
    void add_held_points(const Lattice& lattice, const CellOf& cell_of,
                         std::vector<HeldPoint>& points)
    {
        for (const FleshHoldStatement& told : flesh().held)
        {
            const Vector3d x = body.to_metres(told.at);
            const int cell = cell_of(x);
            const std::optional<Vector3d> local =
                cell < 0 ? std::nullopt : local_place(lattice, cell, x);
            if (!local || local->minCoeff() < -kBeside ||
                local->maxCoeff() > 1.0 + kBeside)
                throw malformed({scene.path, 0, told.field + ".at"},
                                "lies outside of the material");
            const NodeShares shares = shares_at(lattice, cell, *local);
            if (told.normal)
            {
                PulledPoint guided;
                guided.point = {shares, x};
                guided.normal = direction_of(*told.normal);
                body.guided.emplace_back(guided, keys_of(told.keys));
                continue;
            }
            points.push_back(
                {shares, x, static_cast<int>(body.skeleton->size() + body.holds.size())});
            body.holds.push_back(keys_of(told.keys));
        }
    }

    void take_obstacles()
    {
        for (const FleshObstacleStatement& told : flesh().contact)
        {
            FleshObstacle obstacle;
            obstacle.friction = told.friction;
            if (told.plane)
            {
                const auto& [x, y, z, d] = *told.plane;
                const Vector3d normal(x, y, z);
                obstacle.normal = direction_of(normal);
                obstacle.offset = obstacle.normal->dot(
                    body.to_metres(d / normal.norm() * normal.normalized()));
            }
            else
            {
                const auto& [x, y, z, r] = *told.sphere;
                obstacle.centre = body.to_metres({x, y, z});
                obstacle.radius = r * body.metre / body.frame.length_to_model(1.0);
            }
            body.obstacles.emplace_back(obstacle, keys_of(told.keys));
        }
        if (body.obstacles.empty())
            return;
        std::vector<FleshPoint> surface;
        for (std::size_t i = 0; i < geometry.samples.size(); ++i)
            surface.push_back(body.point_of_sample(i));
        body.flesh->set_surface(std::move(surface));
    }

    /// The cell of a drawn lattice that holds a point.
    static int drawn_cell_of(const Lattice& lattice, const Vector3d& x)
    {
        for (int cell = 0; cell < static_cast<int>(lattice.cells.size()); ++cell)
            if (const std::optional<Vector3d> local = local_place(lattice, cell, x);
                local && local->minCoeff() >= -kBeside &&
                local->maxCoeff() <= 1.0 + kBeside)
                return cell;
        return -1;
    }

    /// Of every bone, from it to each node [m].
    std::vector<std::vector<double>> straight_distances(const Lattice& lattice) const
    {
        std::vector<std::vector<double>> distances;
        for (const TubeBone& bone : bones)
        {
            std::vector<double>& of_bone = distances.emplace_back();
            for (const Vector3d& x : lattice.places)
            {
                const double t = nearest_share(bone.line.from, bone.line.to, x);
                of_bone.push_back(
                    (bone.line.from + t * (bone.line.to - bone.line.from) - x).norm());
            }
        }
        return distances;
    }

    /// The same; where the way through the material is much longer, that. [theory 7]
    std::vector<std::vector<double>> distances_to_bones(const Lattice& lattice,
                                                        const Body& octree) const
    {
        std::vector<std::vector<double>> distances = straight_distances(lattice);
        const Cells& cells = octree.cells;
        const double edge = body.metre * octree.rest->material.grid.shape().edge;
        GlueDistances through(cells);
        const auto length = [](const Cell& a, const Cell& b)
        { return (a.centre - b.centre).norm(); };
        for (std::size_t b = 0; b < bones.size(); ++b)
        {
            const BoneLine& line = bones[b].line;
            std::vector<int> crossed;
            for (std::size_t c = 0; c < cells.size(); ++c)
            {
                const Vector3d x = body.metre * cells.cells[c].centre;
                const double t = nearest_share(line.from, line.to, x);
                if ((line.from + t * (line.to - line.from) - x).norm() <=
                    body.metre * cells.cells[c].edge)
                    crossed.push_back(static_cast<int>(c));
            }
            through.search(crossed, INFINITY, length);
            std::vector<double> way(lattice.places.size(), INFINITY);
            for (std::size_t c = 0; c < cells.size(); ++c)
                for (const int node : lattice.cells[c])
                    way[idx(node)] =
                        std::min(way[idx(node)],
                                 body.metre * through.distance(static_cast<int>(c)) +
                                     (body.metre * cells.cells[c].centre -
                                      lattice.places[idx(node)])
                                         .norm());
            constexpr double kLonger = 1.5, kBeyond = 2.0; // [1], [edge]
            for (std::size_t n = 0; n < way.size(); ++n)
                if (way[n] > kLonger * distances[b][n] + kBeyond * edge)
                    distances[b][n] = way[n];
        }
        return distances;
    }

    /// \p cell_of_sample: where painted weights may be.
    std::vector<FleshRegionShares>
    blended(const Lattice& lattice, const std::vector<std::vector<double>>& distances,
            std::span<const int> cell_of_sample) const
    {
        if (bones.empty())
            throw malformed({scene.path, 0, "skeleton.law"}, "regions need a bone");
        std::vector<int> motions;
        for (const TubeBone& bone : bones)
            motions.push_back(bone.line.motion);
        double edge = 0.0;
        for (int c = 0; c < static_cast<int>(lattice.cells.size()); ++c)
        {
            const CornerNodes& corners = lattice.cells[idx(c)];
            edge = std::max(
                edge, (lattice.places[idx(corners[1])] - lattice.places[idx(corners[0])])
                          .norm());
        }
        std::vector<FleshRegionShares> regions =
            shares_by_distance(lattice, distances, motions, kBlend * edge);
        if (!flesh().weights.empty())
            paint(lattice, cell_of_sample, regions);
        return regions;
    }

    /// Nodes of cells with painted samples take their mean.
    void paint(const Lattice& lattice, std::span<const int> cell_of_sample,
               std::vector<FleshRegionShares>& regions) const
    {
        const PaintedWeights painted = read_weights(flesh().weights);
        if (painted.num_samples() != geometry.samples.size())
            throw malformed({flesh().weights, 0, ""},
                            fmt::format("has {} lines of numbers, the model {} samples",
                                        painted.num_samples(), geometry.samples.size()));
        const std::size_t num_joints = painted.joints.size();
        std::vector<std::size_t> region_of_joint;
        for (const std::string& name : painted.joints)
        {
            const int joint = body.skeleton->find(name);
            const auto region = std::find_if(regions.begin(), regions.end(),
                                             [&](const FleshRegionShares& of)
                                             { return of.motion == joint; });
            if (joint < 0 || region == regions.end())
                throw malformed({flesh().weights, 0, name},
                                joint < 0 ? "is no joint" : "has no bone");
            region_of_joint.push_back(static_cast<std::size_t>(region - regions.begin()));
        }
        std::map<int, std::vector<double>> of_node;
        for (std::size_t i = 0; i < cell_of_sample.size(); ++i)
            for (const int corner : lattice.cells[idx(cell_of_sample[i])])
            {
                std::vector<double>& sums = of_node[corner];
                sums.resize(num_joints, 0.0);
                for (std::size_t j = 0; j < num_joints; ++j)
                    sums[j] += painted.values[i * num_joints + j];
            }
        std::erase_if(of_node,
                      [&](const auto& painted_node)
                      {
                          const std::vector<double>& sums = painted_node.second;
                          return !lattice.hanging[idx(painted_node.first)].empty() ||
                                 !(std::accumulate(sums.begin(), sums.end(), 0.0) > 0.0);
                      });
        for (FleshRegionShares& region : regions)
            std::erase_if(region.shares, [&](const NodeShare& share)
                          { return of_node.contains(share.node); });
        for (const auto& [node, sums] : of_node)
        {
            const double sum = std::accumulate(sums.begin(), sums.end(), 0.0);
            for (std::size_t j = 0; j < num_joints; ++j)
                if (sums[j] > 0.0)
                    regions[region_of_joint[j]].shares.push_back({node, sums[j] / sum});
        }
    }

    void finish(Lattice lattice, std::vector<HeldPoint> points,
                std::vector<TubePart> tubes, std::vector<FleshRegionShares> regions,
                bool is_tight)
    {
        if (points.empty())
            body.warnings.push_back(at({scene.path, 0, "skeleton"},
                                       "no bone lies in the material: nothing is held"));
        body.held = points.size() - body.holds.size();
        for (const LatticePart& part : lattice.parts)
            body.mass += part.volume * materials[idx(part.material)].density;
        body.flesh = std::make_shared<Flesh>(std::move(lattice), materials,
                                             std::move(points), std::move(tubes),
                                             settings(is_tight), std::move(regions));
        take_held_points();
        body.dropped = body.flesh->nodes().dropped.size() - num_held_as_rows;
        look_for_loose_parts();
    }

    /// Points that are held and could not be eliminated, as in the middle of a cell, are
    /// rows of each step; those that bones have are told.
    void take_held_points()
    {
        const FreeShares shares(body.flesh->nodes(), body.flesh->lattice().places.size());
        std::size_t whole = body.flesh->points().size() - body.holds.size(), guided = 0;
        for (const FleshHoldStatement& told : flesh().held)
        {
            const FleshPoint point = told.normal
                                         ? body.guided[guided++].first.point
                                         : FleshPoint{body.flesh->points()[whole].shares,
                                                      body.flesh->points()[whole].place};
            const std::vector<int>& dropped = body.flesh->nodes().dropped;
            const bool is_eliminated =
                !told.normal && !std::binary_search(dropped.begin(), dropped.end(),
                                                    static_cast<int>(whole));
            whole += told.normal ? 0 : 1;
            if (is_eliminated)
                continue;
            num_held_as_rows += told.normal ? 0 : 1;
            if (shares.of(point.shares).free.empty())
                body.warnings.push_back(at({scene.path, 0, told.field},
                                           "lies where bones or other held points have "
                                           "the flesh already: it is ignored"));
            else if (!told.normal)
                held_as_rows.emplace_back(
                    PulledPoint{point, point.place, std::nullopt},
                    body.holds[idx(body.flesh->points()[whole - 1].motion) -
                               body.skeleton->size()]);
        }
        body.guided.insert(body.guided.end(), held_as_rows.begin(), held_as_rows.end());
    }

    /// Parts of the material that no bone holds.
    void look_for_loose_parts()
    {
        const Lattice& lattice = body.flesh->lattice();
        UnionFind joined(lattice.places.size());
        for (const CornerNodes& cell : lattice.cells)
            for (const int node : cell)
            {
                joined.join(cell[0], node);
                for (const NodeShare& share : lattice.hanging[idx(node)])
                    joined.join(cell[0], share.node);
            }
        std::vector<bool> is_bound(lattice.places.size(), false);
        for (std::size_t k = 0; k < body.flesh->nodes().bound.size(); ++k)
            if (!body.flesh->nodes().by_points[k].empty())
                is_bound[idx(body.flesh->nodes().bound[k])] = true;
        std::map<int, bool> is_held;
        for (const CornerNodes& cell : lattice.cells)
            for (const int node : cell)
            {
                bool& is_part_held = is_held[joined.first_of(node)];
                is_part_held = is_part_held || is_bound[idx(node)];
            }
        const auto loose = std::count_if(is_held.begin(), is_held.end(),
                                         [](const auto& part) { return !part.second; });
        const Triple& g = scene.time->gravity;
        if (loose > 0 && flesh().settles && (g[0] != 0 || g[1] != 0 || g[2] != 0))
            throw malformed({scene.path, 0, "skeleton.settle"},
                            fmt::format("{} of {} parts of the material have no bone: "
                                        "they would fall without end",
                                        loose, is_held.size()));
        if (loose > 0 && body.held > 0)
            body.warnings.push_back(at(
                {scene.path, 0, "skeleton"},
                fmt::format("{} of {} parts of the material have no bone: they fly free",
                            loose, is_held.size())));
    }
};

} // namespace

FleshPoint FleshBody::point_of_sample(std::size_t sample) const
{
    const Lattice& lattice = flesh->lattice();
    const int cell = cell_of_sample[sample];
    return {shares_at(lattice, cell, local[sample]),
            cell_point(lattice, cell, local[sample])};
}

FleshBody build_flesh(const Geometry& geometry, const SceneFile& scene,
                      const SkeletonValues& skeleton, const CellSettings& cells,
                      bool is_tight)
{
    refuse_what_is_not_built(scene);
    Builder builder{geometry, scene, skeleton, {}, {}, {}};
    builder.body.frame = cells.frame ? given_frame(*cells.frame, cells.frame_file)
                                     : automatic_frame(bounding_box(geometry.samples));
    builder.body.metre = builder.body.frame.length_to_model(1.0) * scene.time->unit;
    builder.materials.push_back(material_of(builder.flesh()));
    if (scene.time->viscosity > 0.0)
        builder.body.warnings.push_back(at({scene.path, 0, "simulate.viscosity"},
                                           "is for rods, ignored: flesh has damping"));
    builder.place_bones();
    if (builder.flesh().lattice.empty())
        builder.from_octree(cells, is_tight);
    else
        builder.from_file(is_tight);
    builder.take_obstacles();
    return std::move(builder.body);
}

} // namespace cellwarp
