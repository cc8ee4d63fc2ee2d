// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/flesh/drawn_cells.h"

#include <algorithm>
#include <map>

#include <Eigen/Geometry>

#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

/// The three corners that each corner has an edge to.
const std::vector<std::array<int, 3>>& edges_of(std::size_t corners)
{
    static const std::vector<std::array<int, 3>> tetrahedron = {
        {1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};
    static const std::vector<std::array<int, 3>> wedge = {
        {1, 2, 3}, {2, 0, 4}, {0, 1, 5}, {5, 4, 0}, {3, 5, 1}, {4, 3, 2}};
    static const std::vector<std::array<int, 3>> hexahedron = {
        {1, 3, 4}, {2, 0, 5}, {3, 1, 6}, {0, 2, 7},
        {7, 5, 0}, {4, 6, 1}, {5, 7, 2}, {6, 4, 3}};
    return corners == 4 ? tetrahedron : corners == 6 ? wedge : hexahedron;
}

/// Faces as loops of corners.
const std::vector<std::vector<int>>& faces_of(std::size_t corners)
{
    static const std::vector<std::vector<int>> tetrahedron = {
        {0, 1, 2}, {0, 1, 3}, {0, 2, 3}, {1, 2, 3}};
    static const std::vector<std::vector<int>> wedge = {
        {0, 1, 2}, {3, 4, 5}, {0, 1, 4, 3}, {1, 2, 5, 4}, {2, 0, 3, 5}};
    static const std::vector<std::vector<int>> hexahedron = {{0, 1, 2, 3}, {4, 5, 6, 7},
                                                             {0, 1, 5, 4}, {1, 2, 6, 5},
                                                             {2, 3, 7, 6}, {3, 0, 4, 7}};
    return corners == 4 ? tetrahedron : corners == 6 ? wedge : hexahedron;
}

/// Vertices at means of others, each once.
class Means
{
public:
    /// They come after those of \p of, which has places alone.
    explicit Means(Hexahedra& of) : of_(of)
    {
        for (std::size_t v = 0; v < of.places.size(); ++v)
            of.means.push_back({{static_cast<int>(v), 1.0}});
    }

    int of(std::vector<int> vertices)
    {
        std::sort(vertices.begin(), vertices.end());
        if (vertices.front() == vertices.back())
            return vertices.front();
        const auto [found, is_new] =
            known_.try_emplace(vertices, static_cast<int>(of_.places.size()));
        if (is_new)
        {
            Vector3d sum = Vector3d::Zero();
            NodeShares mean;
            for (const int vertex : vertices)
            {
                sum += of_.places[idx(vertex)];
                mean.push_back({vertex, 1.0 / static_cast<double>(vertices.size())});
            }
            of_.places.push_back(sum / static_cast<double>(vertices.size()));
            of_.means.push_back(gathered(std::move(mean)));
        }
        return found->second;
    }

private:
    Hexahedra& of_;
    std::map<std::vector<int>, int> known_;
};

/// The other way round where x, y and z do not turn right-handed.
void turn_right(const std::vector<Vector3d>& places, CornerNodes& cell)
{
    Vector3d sides[3] = {Vector3d::Zero(), Vector3d::Zero(), Vector3d::Zero()};
    for (int k = 0; k < 8; ++k)
        for (int axis = 0; axis < 3; ++axis)
            sides[axis] += (k >> axis & 1 ? 1.0 : -1.0) * places[idx(cell[idx(k)])];
    if (sides[0].cross(sides[1]).dot(sides[2]) < 0.0)
        for (std::size_t k = 0; k < 4; ++k)
            std::swap(cell[k], cell[k + 4]);
}

} // namespace

Hexahedra hexahedra_of(const DrawnCells& drawn)
{
    Hexahedra out;
    out.places = drawn.places;
    const bool is_plain =
        std::all_of(drawn.cells.begin(), drawn.cells.end(),
                    [](const std::vector<int>& corners) { return corners.size() == 8; });
    Means means(out);
    const auto add = [&](CornerNodes cell, std::size_t of)
    {
        turn_right(out.places, cell);
        out.cells.push_back(cell);
        out.cell_of.push_back(static_cast<int>(of));
    };
    for (std::size_t c = 0; c < drawn.cells.size(); ++c)
    {
        const std::vector<int>& v = drawn.cells[c];
        if (is_plain)
        {
            add({v[0], v[1], v[3], v[2], v[4], v[5], v[7], v[6]}, c);
            continue;
        }
        const int middle = means.of(v);
        const auto face = [&](int corner, int a, int b)
        {
            for (const std::vector<int>& loop : faces_of(v.size()))
            {
                const auto has = [&](int of)
                { return std::find(loop.begin(), loop.end(), of) != loop.end(); };
                if (!has(corner) || !has(a) || !has(b))
                    continue;
                std::vector<int> vertices;
                for (const int of : loop)
                    vertices.push_back(v[idx(of)]);
                return means.of(std::move(vertices));
            }
            return middle;
        };
        for (int k = 0; k < static_cast<int>(v.size()); ++k)
        {
            const std::array<int, 3>& to = edges_of(v.size())[idx(k)];
            const auto half = [&](int i) {
                return means.of({v[idx(k)], v[idx(to[idx(i)])]});
            };
            add({v[idx(k)], half(0), half(1), face(k, to[0], to[1]), half(2),
                 face(k, to[0], to[2]), face(k, to[1], to[2]), middle},
                c);
        }
    }
    for (const auto& [a, b] : drawn.edges)
        if (is_plain)
            out.edges.emplace_back(a, b);
        else
        {
            const int half = means.of({a, b});
            out.edges.emplace_back(a, half);
            out.edges.emplace_back(half, b);
        }
    return out;
}

} // namespace cellwarp::core
