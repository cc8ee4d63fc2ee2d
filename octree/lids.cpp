// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/lids.h"

#include <cstddef>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "octree/base/edges.h"
#include "octree/base/union_find.h"
#include "octree/bounding_surface.h"

namespace cellwarp::core
{

namespace
{

using OpenEdge = std::pair<std::uint32_t, std::uint32_t>;

/// The edges that lack their opposite, from the first to the second corner; as often as
/// they do.
std::vector<OpenEdge> open_edges(const Shape& shape)
{
    const std::vector<Triangle> triangles = bounding_surface(shape).triangles;
    const auto each_pass = [&](const auto& pass)
    {
        for (const Triangle& t : triangles)
            for (std::size_t k = 0; k < 3; ++k)
                pass(t[k], t[(k + 1) % 3]);
    };
    std::vector<OpenEdge> open;
    for_each_edge(shape.samples.size(), each_pass,
                  [&](const Edge& edge)
                  {
                      for (int k = edge.backward; k < edge.forward; ++k)
                          open.emplace_back(edge.low, edge.high);
                      for (int k = edge.forward; k < edge.backward; ++k)
                          open.emplace_back(edge.high, edge.low);
                  });
    return open;
}

/// The middle of a loop, by the length of its edges.
class Middle
{
public:
    void add(const Eigen::Vector3d& a, const Eigen::Vector3d& b)
    {
        const double length = (b - a).norm();
        sum_ += 0.5 * length * (a + b);
        length_ += length;
    }
    Eigen::Vector3d place() const { return sum_ / length_; }
    double length() const { return length_; }

private:
    Eigen::Vector3d sum_ = Eigen::Vector3d::Zero();
    double length_ = 0.0;
};

} // namespace

Shape with_lids(const Shape& shape, double longest)
{
    const std::vector<OpenEdge> open = open_edges(shape);
    UnionFind loops(shape.samples.size());
    for (const auto& [a, b] : open)
        loops.join(static_cast<int>(a), static_cast<int>(b));
    const auto loop_of = [&](const OpenEdge& edge)
    { return loops.first_of(static_cast<int>(edge.first)); };
    std::map<int, Middle> middles;
    for (const OpenEdge& edge : open)
        middles[loop_of(edge)].add(shape.samples[edge.first], shape.samples[edge.second]);
    Shape closed = shape;
    std::map<int, std::uint32_t> tips;
    for (const auto& [loop, middle] : middles)
    {
        if (middle.length() > longest)
            continue;
        tips[loop] = static_cast<std::uint32_t>(closed.samples.size());
        closed.samples.push_back(middle.place());
    }
    for (const OpenEdge& edge : open)
        if (const auto tip = tips.find(loop_of(edge)); tip != tips.end())
            closed.triangles.push_back({edge.second, edge.first, tip->second});
    return closed;
}

} // namespace cellwarp::core
