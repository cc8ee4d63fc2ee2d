// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/time/flesh_body.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "io/base/error.h"
#include "library/time/drawn_flesh.h"
#include "library/time/region_weights.h"
#include "library/time/softness.h"
#include "octree/base/index.h"
#include "octree/base/segment.h"
#include "octree/base/union_find.h"
#include "solver/flesh/bone_points.h"
#include "solver/flesh/bone_tube.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

/// The leaves that bones pass.
std::vector<LeafNumber> crossed_by_bones(const FleshModel& model, const Octree& octree)
{
    const VoxelGrid& grid = model.rest->material.grid;
    std::vector<LeafNumber> crossed;
    for (const LeafNumber leaf : octree.numbers())
    {
        const VoxelBlock block = voxel_block(grid.shape(), octree[leaf]);
        const Vector3d middle = grid.from_voxels(block.first.cast<double>() +
                                                 Vector3d::Constant(0.5 * block.width));
        const double reach = 0.5 * std::sqrt(3.0) * block.width * grid.shape().voxel();
        if (std::any_of(model.bones.begin(), model.bones.end(),
                        [&](const TubeBone& bone)
                        {
                            const Vector3d a = bone.line.from / model.metre,
                                           b = bone.line.to / model.metre;
                            const double t = nearest_share(a, b, middle);
                            return (a + t * (b - a) - middle).norm() <= reach;
                        }))
            crossed.push_back(leaf);
    }
    return crossed;
}

/// Parts of the material that no bone holds.
void look_for_loose_parts(FleshBody& body)
{
    const FleshModel& model = *body.model;
    const Lattice& lattice = body.flesh->lattice();
    UnionFind joined(lattice.places.size());
    for (const CornerNodes& cell : lattice.cells)
        for (const int node : cell)
        {
            joined.join(cell[0], node);
            for (const NodeShare& share : lattice.hanging[idx(node)])
                joined.join(cell[0], share.node);
        }
    const BoundNodes& nodes = body.flesh->nodes();
    std::vector<bool> is_bound(lattice.places.size(), false);
    for (std::size_t k = 0; k < nodes.bound.size(); ++k)
        if (!nodes.by_points[k].empty())
            is_bound[idx(nodes.bound[k])] = true;
    std::map<int, bool> is_held;
    for (const CornerNodes& cell : lattice.cells)
        for (const int node : cell)
        {
            bool& is_part_held = is_held[joined.first_of(node)];
            is_part_held = is_part_held || is_bound[idx(node)];
        }
    for (std::size_t n = 0; n < lattice.places.size(); ++n)
    {
        const auto part = is_held.find(joined.first_of(static_cast<int>(n)));
        body.is_loose.push_back(part == is_held.end() || !part->second);
    }
    const auto loose = std::count_if(is_held.begin(), is_held.end(),
                                     [](const auto& part) { return !part.second; });
    const Triple& g = model.scene.time.gravity;
    if (loose > 0 && model.flesh().settles.value_or(false) &&
        (g[0] != 0 || g[1] != 0 || g[2] != 0))
        throw malformed({model.scene.path, 0, "skeleton.settle"},
                        fmt::format("{} of {} parts of the material have no bone: they "
                                    "would fall without end",
                                    loose, is_held.size()));
    if (loose > 0 && body.held > 0)
        body.warnings.push_back(
            at({model.scene.path, 0, "skeleton"},
               fmt::format("{} of {} parts of the material have no bone: they fly free",
                           loose, is_held.size())));
}

/// \p tube_points: of each bone.
std::vector<TubePart> tubes_of(FleshBody& body, const Lattice& lattice,
                               std::span<const TubeBone> bones,
                               const std::vector<std::vector<MaterialPoint>>& tube_points)
{
    const FleshModel& model = *body.model;
    std::string empty;
    for (std::size_t b = 0; b < bones.size(); ++b)
        if (tube_points[b].empty())
            empty += (empty.empty() ? "" : ", ") +
                     model.skeleton->statement(idx(bones[b].line.motion)).name;
    if (!empty.empty())
        body.warnings.push_back(at({model.scene.path, 0, "skeleton.tube"},
                                   "holds no material around bones of " + empty +
                                       ": their flesh may spin (see tube_radius)"));
    return tube_parts(lattice, model.materials, bones, tube_points,
                      model.flesh().tube_stiffness);
}

/// \p on_bones: points that bones hold, after those of body.own_motions that leave.
void finish(FleshBody& body, Lattice lattice, std::vector<HeldPoint> points,
            std::vector<TubePart> tubes, std::vector<FleshRegionShares> regions)
{
    const FleshModel& model = *body.model;
    body.held = points.size() - body.leaving.nodes.size();
    if (body.held == 0 && body.held_points.whole.empty())
        body.warnings.push_back(at({model.scene.path, 0, "skeleton"},
                                   "no bone lies in the material: nothing is held"));
    points.insert(points.end(), body.held_points.whole.begin(),
                  body.held_points.whole.end());
    for (const LatticePart& part : lattice.parts)
        body.mass += part.volume * model.materials[idx(part.material)].density;
    body.flesh =
        std::make_shared<Flesh>(std::move(lattice), model.materials, std::move(points),
                                std::move(tubes), model.settings, regions);
    guide_what_is_not_bound(model, *body.flesh, body.held_points, body.warnings);
    body.dropped = body.flesh->nodes().dropped.size() - body.held_points.num_whole_guided;
    look_for_loose_parts(body);
    if (!model.flesh().is_at_rest_as_drawn)
        return;
    for (FleshRegionShares& region : regions)
        std::erase_if(region.shares, [&](const NodeShare& share)
                      { return body.is_loose[idx(share.node)]; });
    body.flesh->carry_weight(std::move(regions));
}

/// Whether a law, or forces at rest, turn with the regions of the bones.
bool needs_regions(const FleshStatement& flesh)
{
    return flesh.law == "regions" || flesh.is_at_rest_as_drawn;
}

/// What obstacles may touch.
void take_surface(FleshBody& body)
{
    if (body.model->obstacles.empty())
        return;
    std::vector<FleshPoint> surface;
    for (std::size_t i = 0; i < body.cell_of_sample.size(); ++i)
        surface.push_back(body.point_of_sample(i));
    body.flesh->set_surface(std::move(surface));
}

/// The lattice of a body's tree, and what bones hold of it.
DrawnLattice bare_lattice(FleshBody& body)
{
    const FleshModel& model = *body.model;
    if (model.drawn)
        return lattice_of(*model.drawn, *body.tree);
    body.octree = std::make_shared<const Body>(cut(model.rest, *body.tree));
    DrawnLattice out;
    out.lattice = octree_lattice(*body.tree, body.octree->cells, model.metre);
    std::vector<BoneLine> lines;
    for (const TubeBone& bone : model.bones)
        lines.push_back(bone.line);
    out.points =
        points_on_bones(out.lattice, lines,
                        [&](int cell, const Vector3d& x)
                        {
                            return piece_at(model.rest->material.grid,
                                            body.octree->pieces, x / model.metre) == cell;
                        });
    return out;
}

/// Finds the places of the samples in a lattice.
void locate_samples(FleshBody& body, const Lattice& lattice)
{
    const FleshModel& model = *body.model;
    if (model.drawn)
        for (const DrawnForest::Place& sample : model.drawn->samples)
        {
            const auto& [cell, local] =
                model.drawn->forest.place_in_leaf(*body.tree, sample);
            body.cell_of_sample.push_back(static_cast<int>(cell));
            body.local.push_back(local);
        }
    else
    {
        body.cell_of_sample = body.octree->cell_of_sample;
        for (std::size_t i = 0; i < model.rest->samples.size(); ++i)
            body.local.push_back(*local_place(lattice, body.cell_of_sample[i],
                                              model.metre * model.rest->samples[i]));
    }
}

} // namespace

std::vector<LeafNumber> leaves_of_fine_regions(const FleshModel& model,
                                               const Octree& octree)
{
    std::vector<char> is_fine(octree.leaves().size(), 0);
    if (model.fine)
    {
        const VoxelGrid& grid = model.rest->material.grid;
        for (std::size_t region = 0; region < model.fine->size(); ++region)
            model.fine->voxels(region).for_each(
                [&](std::size_t voxel)
                {
                    const LeafNumber leaf = octree.find(grid.coordinates(voxel) /
                                                        grid.shape().voxels_per_leaf);
                    if (leaf != LeafNumber::None)
                        is_fine[idx(leaf)] = 1;
                });
    }
    if (model.drawn)
        for (const std::uint32_t sample : model.drawn->fine)
            is_fine[model.drawn->forest
                        .place_in_leaf(octree, model.drawn->samples[sample])
                        .cell] = 1;
    std::vector<LeafNumber> leaves;
    for (const LeafNumber leaf : octree.numbers())
        if (is_fine[idx(leaf)])
            leaves.push_back(leaf);
    return leaves;
}

Octree first_octree(const FleshModel& model)
{
    const bool has_detail = model.flesh().detail > 0.0;
    const MaterialTest has_material = model.has_material();
    Octree octree = model.drawn ? model.drawn->first
                                : Octree(model.rest->material.grid.shape(), has_material);
    if (model.drawn && !has_detail)
        return octree;
    model.check_cells(octree.leaves().size(), 0);
    for (int level = 1; level <= model.cells.max_depth; ++level)
    {
        octree = octree.split(has_detail ? leaves_of_fine_regions(model, octree)
                                         : crossed_by_bones(model, octree),
                              has_material);
        model.check_cells(octree.leaves().size(), level);
    }
    return octree;
}

std::vector<int> cells_around(const FleshBody& body, const FleshBody& other)
{
    if (!body.octree)
    {
        std::vector<int> around;
        for (const Leaf& leaf : body.tree->leaves())
            around.push_back(static_cast<int>(other.tree->find(leaf.corner)));
        return around;
    }
    const Body& cells = *body.octree;
    std::vector<int> around(cells.cells.size(), -1);
    const VoxelGrid& grid = cells.rest->material.grid;
    cells.pieces.for_each(
        grid,
        [&](std::size_t voxel, int cell)
        {
            if (around[idx(cell)] < 0 &&
                is_in(voxel_block(grid.shape(),
                                  cells.octree[cells.cells.cells[idx(cell)].leaf]),
                      grid.coordinates(voxel))) // no crumb of elsewhere
                around[idx(cell)] = other.octree->pieces.at(grid, voxel);
        });
    return around;
}

FleshPoint FleshBody::point_of_sample(std::size_t sample) const
{
    const Lattice& lattice = flesh->lattice();
    const int cell = cell_of_sample[sample];
    return {shares_at(lattice, cell, local[sample]),
            cell_point(lattice, cell, local[sample])};
}

FleshBody build_flesh(std::shared_ptr<const FleshModel> model)
{
    const auto built = [](std::shared_ptr<const FleshModel> of)
    {
        const Octree octree = first_octree(*of);
        return build_flesh(std::move(of), octree, octree);
    };
    FleshBody body = built(model);
    if (!model->flesh().young)
        if (const double young = holding_stiffness(body); young > 0.0)
        {
            auto holding = std::make_shared<FleshModel>(*model);
            for (std::size_t k = 0; k < holding->materials.size(); ++k)
                if (k == 0 || !holding->flesh().materials[k - 1].young)
                    holding->materials[k].young = young;
            body = built(std::move(holding));
        }
    if (model->flesh().settles.value_or(false))
        refuse_without_rest(body);
    warn_of_sag(body);
    return body;
}

FleshBody build_flesh(std::shared_ptr<const FleshModel> of, const Octree& octree,
                      const Octree& coarser)
{
    FleshBody body;
    body.model = std::move(of);
    const FleshModel& model = *body.model;
    const bool has_detail = model.flesh().detail > 0.0;
    const bool leaves = coarser.leaves() != octree.leaves();
    body.tree = std::make_shared<const Octree>(octree);
    DrawnLattice bare = bare_lattice(body);
    Lattice& lattice = bare.lattice;
    if (body.octree && model.materials.size() > 1)
        lattice.parts =
            parts_by_material(model.rest->material.grid, octree, body.octree->pieces,
                              model.material_of_voxel, model.metre);
    const CellOf cell_of = [&](const Vector3d& x)
    {
        return body.octree
                   ? static_cast<int>(piece_at(model.rest->material.grid,
                                               body.octree->pieces, x / model.metre))
                   : drawn_cell_of(lattice, x);
    };
    std::vector<HeldPoint> points;
    if (leaves)
    {
        FleshBody large;
        large.model = body.model;
        large.tree = std::make_shared<const Octree>(coarser);
        const DrawnLattice of_large = bare_lattice(large);
        const Lattice& coarse = of_large.lattice;
        body.coarse_cell = cells_around(body, large);
        for (const LatticeBox& box : coarse.boxes)
            body.coarse_leaf.push_back(coarser[coarser.find(box.corner)]);
        body.leaving = let_leave(lattice, coarse, body.coarse_cell);
        for (const LeavingNodes::Node& node : body.leaving.nodes)
        {
            HeldPoint& row = points.emplace_back();
            row.place = lattice.places[idx(node.node)];
            row.shares = {{node.node, 1.0}};
            for (const NodeShare& parent : node.parents)
                row.shares.push_back({parent.node, -parent.share});
        }
        // Bones hold what they will hold in the coarser lattice.
        for (const HeldPoint& point : of_large.points)
            if (const int cell = cell_of(point.place); cell >= 0)
            {
                const Vector3d local = *local_place(lattice, cell, point.place);
                points.push_back(
                    {shares_at(lattice, cell, local.cwiseMax(0.0).cwiseMin(1.0)),
                     point.place, point.motion});
            }
    }
    else
        points = std::move(bare.points);
    body.held_points = held_points(model, lattice, cell_of);
    const auto own = [&](HeldPoint& point, int follows)
    {
        body.own_motions.push_back({follows, point.shares, point.place});
        point.motion =
            static_cast<int>(body.first_own_motion() + body.own_motions.size() - 1);
    };
    if (has_detail)
    {
        for (std::size_t k = 0; k < points.size(); ++k)
            own(points[k], k < body.leaving.nodes.size() ? -1 : points[k].motion);
        for (HeldPoint& point : body.held_points.whole)
            own(point, point.motion);
    }
    locate_samples(body, lattice);
    std::vector<TubePart> tubes;
    if (model.flesh().has_tube)
        tubes =
            model.drawn
                ? tubes_of(body, lattice, model.drawn->bones,
                           points_in_tubes(lattice, model.drawn->bones))
                : tubes_of(body, lattice, model.bones,
                           points_in_tubes(model.rest->material.grid, body.octree->pieces,
                                           lattice, model.metre, model.tube_voxels));
    std::vector<FleshRegionShares> regions;
    if (needs_regions(model.flesh()))
        regions =
            region_weights(model, lattice, body.octree ? &body.octree->cells : nullptr,
                           body.cell_of_sample, model.drawn ? &bare.vertices : nullptr);
    finish(body, std::move(lattice), std::move(points), std::move(tubes),
           std::move(regions));
    take_surface(body);
    return body;
}

} // namespace cellwarp::core
