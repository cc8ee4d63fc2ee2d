// SPDX-License-Identifier: GPL-3.0-or-later
// The limb at a region is the way from the tip nearest to it inwards, through branchings
// inside the region (the fingers of a hand), to the first one outside.
#include "octree/centre_line.h"

#include <algorithm>
#include <cmath>

#include "octree/base/point_tree.h"
#include "octree/curve_graph.h"

namespace cellwarp::core
{

namespace
{

/// Places of the line.
constexpr int kPlacesOfLine = 97;

/// From where the limb begins to its tip.
std::vector<int> limb_at(const CurveGraph& graph,
                         const std::vector<Eigen::Vector3d>& region)
{
    const PointTree tree(region);
    const auto away = [&](int node)
    { return std::sqrt(tree.nearest(graph.place(node)).distance_squared); };
    int tip = -1;
    for (const int other : graph.tips())
        if (tip < 0 || away(other) < away(tip))
            tip = other;
    if (tip < 0)
        return {};
    // Inwards is the way to what lies farthest off.
    std::vector<int> way;
    graph.farthest_from(tip, &way);
    std::reverse(way.begin(), way.end()); // from the tip on
    std::size_t end = 1;
    while (end + 1 < way.size() &&
           (graph.degree(way[end]) < 3 || away(way[end]) <= 1.5 * graph.radius(way[end])))
        ++end;
    way.resize(std::min(end + 1, way.size()));
    std::reverse(way.begin(), way.end());
    return way;
}

} // namespace

CentreLine centre_line(const Shape& shape, const std::vector<std::uint32_t>& near)
{
    CentreLine line;
    const CurveGraph graph(shape, CurveOptions());
    if (graph.is_empty())
        return line;
    std::vector<int> way;
    if (near.empty())
    {
        const std::vector<int> tips = graph.tips();
        if (tips.empty())
            return line;
        graph.farthest_from(graph.farthest_from(tips.front()), &way);
    }
    else
    {
        std::vector<Eigen::Vector3d> region;
        for (const std::uint32_t i : near)
            region.push_back(shape.samples[i]);
        way = limb_at(graph, region);
    }
    if (way.size() < 2)
        return line;
    line.radius = graph.least_radius(way);
    line.places = graph.line(way, kPlacesOfLine);
    return line;
}

} // namespace cellwarp::core
