// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/time/region_weights.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include <fmt/format.h>

#include "io/base/error.h"
#include "io/scene/weight_file.h"
#include "octree/base/index.h"
#include "octree/base/segment.h"
#include "solver/cells/glue_distances.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

/// How far from their border bones blend [edge].
constexpr double kBlend = 2.0;

double distance_to(const BoneLine& line, const Vector3d& x)
{
    const double t = nearest_share(line.from, line.to, x);
    return (line.from + t * (line.to - line.from) - x).norm();
}

/// Of every bone, from it to each node [m].
using Distances = std::vector<std::vector<double>>;

Distances straight_distances(const FleshModel& model, const Lattice& lattice)
{
    Distances distances;
    for (const TubeBone& bone : model.bones)
    {
        std::vector<double>& of_bone = distances.emplace_back();
        for (const Vector3d& x : lattice.places)
            of_bone.push_back(distance_to(bone.line, x));
    }
    return distances;
}

/// Where the way through the material is much longer, that. [theory-skeleton 7]
void lengthen_by_glue(const FleshModel& model, const Lattice& lattice, const Cells& cells,
                      Distances& distances)
{
    constexpr double kLonger = 1.5, kBeyond = 2.0; // [1], [edge]
    const double edge = model.metre * model.rest->material.grid.shape().edge;
    GlueDistances through(cells);
    const auto length = [](const Cell& a, const Cell& b)
    { return (a.centre - b.centre).norm(); };
    for (std::size_t b = 0; b < model.bones.size(); ++b)
    {
        std::vector<int> crossed;
        for (std::size_t c = 0; c < cells.size(); ++c)
            if (distance_to(model.bones[b].line, model.metre * cells.cells[c].centre) <=
                model.metre * cells.cells[c].edge)
                crossed.push_back(static_cast<int>(c));
        through.search(crossed, INFINITY, length);
        std::vector<double> way(lattice.places.size(), INFINITY);
        std::vector<char> is_corner(lattice.places.size(), 0);
        for (std::size_t c = 0; c < cells.size(); ++c)
            for (const int node : lattice.cells[c])
            {
                is_corner[idx(node)] = 1;
                way[idx(node)] = std::min(
                    way[idx(node)],
                    model.metre * through.distance(static_cast<int>(c)) +
                        (model.metre * cells.cells[c].centre - lattice.places[idx(node)])
                            .norm());
            }
        for (std::size_t n = 0; n < way.size(); ++n)
            if (is_corner[n] && way[n] > kLonger * distances[b][n] + kBeyond * edge)
                distances[b][n] = way[n];
    }
}

/// Nodes take the mean of painted samples in their cells, or of painted vertices.
void paint(const FleshModel& model, const Lattice& lattice,
           std::span<const int> cell_of_sample, const ControlShares* vertices,
           std::vector<FleshRegionShares>& regions)
{
    const std::string& file = model.flesh().weights;
    const PaintedWeights painted = read_weights(file);
    const std::size_t num_samples = model.geometry->samples.size();
    const bool is_of_vertices = vertices && painted.num_samples() == vertices->size;
    if (!is_of_vertices && painted.num_samples() != num_samples)
        throw malformed({file, 0, ""},
                        fmt::format("has {} lines of numbers, the model {} samples{}",
                                    painted.num_samples(), num_samples,
                                    vertices ? fmt::format(", the lattice {} vertices",
                                                           vertices->size)
                                             : ""));
    const std::size_t num_joints = painted.joints.size();
    std::vector<std::size_t> region_of_joint;
    for (const std::string& name : painted.joints)
    {
        const int joint = model.skeleton->find(name);
        const auto region =
            std::find_if(regions.begin(), regions.end(),
                         [&](const FleshRegionShares& of) { return of.motion == joint; });
        if (joint < 0 || region == regions.end())
            throw malformed({file, 0, name}, joint < 0 ? "is no joint" : "has no bone");
        region_of_joint.push_back(static_cast<std::size_t>(region - regions.begin()));
    }
    std::map<int, std::vector<double>> of_node;
    const auto add = [&](int node, std::size_t row, double share)
    {
        std::vector<double>& sums = of_node[node];
        sums.resize(num_joints, 0.0);
        for (std::size_t j = 0; j < num_joints; ++j)
            sums[j] += share * painted.values[row * num_joints + j];
    };
    if (is_of_vertices)
        for (std::size_t n = 0; n < vertices->of_node.size(); ++n)
            for (const NodeShare& vertex : vertices->of_node[n])
                add(static_cast<int>(n), idx(vertex.node), vertex.share);
    else
        for (std::size_t i = 0; i < cell_of_sample.size(); ++i)
            for (const int corner : lattice.cells[idx(cell_of_sample[i])])
                add(corner, i, 1.0);
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

} // namespace

std::vector<FleshRegionShares> region_weights(const FleshModel& model,
                                              const Lattice& lattice, const Cells* cells,
                                              std::span<const int> cell_of_sample,
                                              const ControlShares* vertices)
{
    if (model.bones.empty())
        throw malformed(
            {model.scene.path, 0,
             model.flesh().law == "regions" ? "skeleton.law" : "skeleton.rest"},
            "regions need a bone");
    Distances distances = straight_distances(model, lattice);
    if (cells)
        lengthen_by_glue(model, lattice, *cells, distances);
    std::vector<int> motions;
    for (const TubeBone& bone : model.bones)
        motions.push_back(bone.line.motion);
    // Of the coarsest cells: detail that comes and goes leaves the regions alone.
    const double edge =
        cells ? model.metre * model.rest->material.grid.shape().edge : vertices->edge;
    std::vector<FleshRegionShares> regions =
        shares_by_distance(lattice, distances, motions, kBlend * edge);
    if (!model.flesh().weights.empty())
        paint(model, lattice, cell_of_sample, vertices, regions);
    return regions;
}

} // namespace cellwarp::core
