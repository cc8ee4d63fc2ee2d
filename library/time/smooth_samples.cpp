// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/time/smooth_samples.h"

#include <algorithm>
#include <optional>

#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "solver/field/blend.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr std::size_t kGrain = 256; ///< samples

} // namespace

SmoothSamples::SmoothSamples(const FleshBody& body)
    : samples_(body.octree->rest->samples), metre_(body.model->metre),
      bones_(bones_of(body)), map_(map_of(body, bones_))
{
    if (bones_.fade)
        find_near_bones(body);
}

/// The points that bones hold, without the nodes of the lattice that are leaving.
SmoothSamples::Bones SmoothSamples::bones_of(const FleshBody& body)
{
    Bones out;
    const FleshModel& model = *body.model;
    const VoxelGrid& grid = body.octree->rest->material.grid;
    const std::vector<HeldPoint>& points = body.flesh->points();
    const std::vector<int>& dropped = body.flesh->nodes().dropped;
    std::vector<RegionFade::Node> nodes;
    for (std::size_t k = body.leaving.nodes.size(); k < points.size(); ++k)
    {
        const Vector3d x = points[k].place / model.metre;
        const int cell = piece_at(grid, body.octree->pieces, x);
        if (cell >= 0 &&
            !std::binary_search(dropped.begin(), dropped.end(), static_cast<int>(k)))
            nodes.push_back({x, cell});
    }
    if (nodes.empty())
        return out;
    out.fade = std::make_unique<RegionFade>(body.octree->cells, nodes,
                                            std::span<const RegionFade::Node>());
    out.cells = out.fade->node_cells();
    for (const Vector3d& node : out.fade->nodes())
        out.motions.push_back(
            std::find_if(
                points.begin() + static_cast<std::ptrdiff_t>(body.leaving.nodes.size()),
                points.end(),
                [&](const HeldPoint& point) { return point.place / model.metre == node; })
                ->motion);
    return out;
}

SmoothMap SmoothSamples::map_of(const FleshBody& body, const Bones& bones)
{
    const Lattice& lattice = body.flesh->lattice();
    std::vector<SmoothMap::Place> places;
    for (std::size_t i = 0; i < body.cell_of_sample.size(); ++i)
        places.push_back({body.cell_of_sample[i], body.local[i]});
    for (std::size_t k = 0; k < bones.cells.size(); ++k)
        places.push_back(
            {bones.cells[k], *local_place(lattice, bones.cells[k],
                                          body.model->metre * bones.fade->nodes()[k])});
    return {body.octree->octree, body.octree->cells, lattice, places};
}

void SmoothSamples::find_near_bones(const FleshBody& body)
{
    const Cells& cells = body.octree->cells;
    const ClosestCells closest(cells);
    const RegionFades fades({bones_.fade.get()}, cells.size());
    const NearNodesOfRegions no_ways;
    std::vector<std::optional<NearBones>> found(samples_.size());
    parallel_ranges(
        samples_.size(), kGrain,
        [&](std::size_t begin, std::size_t end)
        {
            std::vector<Influence> influences;
            RegionFades::Reach reach;
            for (std::size_t i = begin; i < end; ++i)
            {
                closest.influences(samples_[i], body.cell_of_sample[i], influences);
                fades.reach(samples_[i], influences, no_ways, reach);
                if (reach.node_of >= 0)
                {
                    NearBones& near = found[i].emplace();
                    near.sample = i;
                    near.weight = {1.0, Vector3d::Zero()};
                    near.shares.slope = 1.0;
                    near.shares.nodes = {
                        {reach.nearest[reach.nearest_of_node].nodes[0].index, 1.0,
                         Vector3d::Zero()}};
                }
                else if (!reach.shares.empty()) // all bones are one region
                {
                    const RegionFades::Share& share = reach.shares.front();
                    NearBones& near = found[i].emplace();
                    near.sample = i;
                    near.weight = {share.value, share.gradient};
                    bones_.fade->node_shares(samples_[i], reach.nearest[share.nearest],
                                             near.shares);
                }
            }
        });
    for (std::optional<NearBones>& near : found)
        if (near)
            near_bones_.push_back(std::move(*near));
}

std::vector<FieldValue> SmoothSamples::values(const Eigen::VectorXd& u,
                                              std::span<const Motion> motions,
                                              bool wants_gradients) const
{
    // Misses have slopes, whatever is wanted.
    const std::vector<SmoothMap::Value> of_map =
        map_.values(u, wants_gradients ? 0 : samples_.size());
    const auto value_at = [&](std::size_t place) -> FieldValue {
        return {of_map[place].displacement / metre_, of_map[place].gradient};
    };
    std::vector<FieldValue> out;
    out.reserve(samples_.size());
    for (std::size_t i = 0; i < samples_.size(); ++i)
        out.push_back(value_at(i));
    std::vector<FieldValue> misses;
    for (std::size_t k = 0; k < bones_.motions.size(); ++k)
    {
        const Motion& motion = motions[idx(bones_.motions[k])];
        const FieldValue wanted =
            moved_by({motion.R, motion.t / metre_}, bones_.fade->nodes()[k]);
        const FieldValue now = value_at(samples_.size() + k);
        misses.push_back(
            {wanted.displacement - now.displacement, wanted.gradient - now.gradient});
    }
    parallel_for(near_bones_.size(), kGrain,
                 [&](std::size_t n)
                 {
                     const NearBones& near = near_bones_[n];
                     FieldValue& value = out[near.sample];
                     const FieldValue miss = bones_.fade->average(
                         samples_[near.sample], near.shares, misses, wants_gradients);
                     value.displacement += near.weight.value * miss.displacement;
                     value.gradient +=
                         near.weight.value * miss.gradient +
                         miss.displacement * near.weight.gradient.transpose();
                 });
    return out;
}

} // namespace cellwarp::core
