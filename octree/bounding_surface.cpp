// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/bounding_surface.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <span>
#include <utility>

#include "octree/base/edges.h"
#include "octree/base/hash.h"
#include "octree/base/parallel.h"
#include "octree/joined_samples.h"

namespace cellwarp::core
{

namespace
{

constexpr std::size_t kTrianglesOfPart = 1 << 14; ///< triangles, of one thread

/// A triangle with its smallest corner first, the orientation kept.
Triangle canonical(Triangle t)
{
    std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
    return t;
}

/// A canonical triangle and its copies of either direction are one face.
bool is_one_face(const Triangle& a, const Triangle& b)
{
    return a[0] == b[0] &&
           ((a[1] == b[1] && a[2] == b[2]) || (a[1] == b[2] && a[2] == b[1]));
}

std::uint64_t key_of(std::uint32_t a, std::uint32_t b)
{
    return std::uint64_t{a} << 32 | b;
}

/// Sorts the triangles around one corner by a number of each; those of one number keep
/// their order.
template <class Key>
void sort_around(std::span<Triangle> triangles, const Key& key)
{
    constexpr std::size_t kFew = 32;
    const auto is_before = [&](const Triangle& a, const Triangle& b)
    { return key(a) < key(b); };
    if (triangles.size() > kFew)
        return std::stable_sort(triangles.begin(), triangles.end(), is_before);
    for (std::size_t next = 1; next < triangles.size(); ++next)
        for (std::size_t i = next; i > 0 && is_before(triangles[i], triangles[i - 1]);
             --i)
            std::swap(triangles[i], triangles[i - 1]);
}

/// Whether every edge is passed as often in one direction as in the other. Each edge has
/// a number that looks random; passes in one direction add it, those in the other take it
/// off. Where all edges are passed alike nothing is left; where some are not, 64 bits
/// would all have to be zero by chance.
bool is_closed_by_sum(const std::vector<Triangle>& triangles)
{
    std::vector<std::uint64_t> sums((triangles.size() + kTrianglesOfPart - 1) /
                                    kTrianglesOfPart);
    parallel_for(sums.size(), 1,
                 [&](std::size_t part)
                 {
                     const std::size_t begin = part * kTrianglesOfPart;
                     const std::size_t end =
                         std::min(triangles.size(), begin + kTrianglesOfPart);
                     std::uint64_t sum = 0;
                     for (std::size_t t = begin; t < end; ++t)
                         for (std::size_t k = 0; k < 3; ++k)
                         {
                             const std::uint32_t a = triangles[t][k];
                             const std::uint32_t b = triangles[t][(k + 1) % 3];
                             const std::uint64_t number =
                                 hash_of(key_of(std::min(a, b), std::max(a, b)));
                             sum += a < b ? number : -number;
                         }
                     sums[part] = sum;
                 });
    return std::accumulate(sums.begin(), sums.end(), std::uint64_t{0}) == 0;
}

double open_edge_share(const std::vector<Triangle>& triangles, std::size_t num_samples)
{
    if (triangles.empty())
        return 1.0;
    const auto each_pass = [&](const auto& pass)
    {
        for (const Triangle& t : triangles)
            for (std::size_t k = 0; k < 3; ++k)
                pass(t[k], t[(k + 1) % 3]);
    };
    if (is_closed_by_sum(triangles))
        return 0.0;
    std::size_t open = 0, total = 0;
    for_each_edge(num_samples, each_pass,
                  [&](const Edge& edge)
                  {
                      open += edge.forward != edge.backward;
                      ++total;
                  });
    return static_cast<double>(open) / static_cast<double>(total);
}

/// The triangles that are left where corners are joined, by their smallest corner; those
/// of one face follow each other in the order of \p shape.
std::vector<Triangle> by_faces(const Shape& shape)
{
    const std::vector<std::uint32_t> joined = joined_samples(shape.samples);
    const auto each_triangle = [&](const auto& visit)
    {
        for (const Triangle& t : shape.triangles)
        {
            const Triangle j = {joined[t[0]], joined[t[1]], joined[t[2]]};
            if (j[0] != j[1] && j[1] != j[2] && j[2] != j[0])
                visit(canonical(j));
        }
    };
    std::vector<std::size_t> end(shape.samples.size() + 1, 0);
    each_triangle([&](const Triangle& t) { ++end[t[0] + 1]; });
    std::partial_sum(end.begin(), end.end(), end.begin());
    std::vector<Triangle> sorted(end.back());
    each_triangle([&](const Triangle& t) { sorted[end[t[0]]++] = t; });
    constexpr std::size_t kCornersAtOnce = 4096; // of one thread
    parallel_for(shape.samples.size(), kCornersAtOnce,
                 [&](std::size_t corner)
                 {
                     const std::size_t begin = corner == 0 ? 0 : end[corner - 1];
                     sort_around(
                         std::span(sorted).subspan(begin, end[corner] - begin),
                         [](const Triangle& t)
                         { return key_of(std::min(t[1], t[2]), std::max(t[1], t[2])); });
                 });
    return sorted;
}

} // namespace

BoundingSurface bounding_surface(const Shape& shape)
{
    BoundingSurface surface{by_faces(shape), 1.0};
    std::vector<Triangle>& triangles = surface.triangles;
    // Of a face that is there in both directions either the second is a flaw, or both
    // are the wall between two bodies that touch: what leaves fewer edges open.
    std::vector<std::size_t> walls;
    std::size_t num_kept = 0; // the first of each face, from the front
    for (std::size_t i = 0; i < triangles.size();)
    {
        const Triangle first = triangles[i];
        bool has_both = false;
        for (; i < triangles.size() && is_one_face(triangles[i], first); ++i)
            has_both = has_both || triangles[i] != first;
        if (has_both)
            walls.push_back(num_kept);
        triangles[num_kept++] = first;
    }
    triangles.resize(num_kept);
    surface.open_edges = open_edge_share(triangles, shape.samples.size());
    if (!walls.empty())
    {
        std::vector<Triangle> without;
        without.reserve(triangles.size() - walls.size());
        auto wall = walls.begin();
        for (std::size_t t = 0; t < triangles.size(); ++t)
            if (wall != walls.end() && *wall == t)
                ++wall;
            else
                without.push_back(triangles[t]);
        const double open = open_edge_share(without, shape.samples.size());
        if (!(surface.open_edges < open))
            surface = {std::move(without), open};
    }
    // Parts that begin with a corner's first triangle, one for each thread at a time.
    std::vector<std::size_t> parts = {0};
    const auto is_next = [&](std::size_t t)
    { return triangles[t][0] != triangles[t - 1][0]; };
    for (std::size_t t = kTrianglesOfPart; t < triangles.size(); ++t)
        if (is_next(t))
        {
            parts.push_back(t);
            t += kTrianglesOfPart;
        }
    parts.push_back(triangles.size());
    parallel_for(parts.size() - 1, 1,
                 [&](std::size_t part)
                 {
                     for (std::size_t begin = parts[part]; begin < parts[part + 1];)
                     {
                         std::size_t end = begin + 1;
                         while (end < parts[part + 1] && !is_next(end))
                             ++end;
                         sort_around(std::span(triangles).subspan(begin, end - begin),
                                     [](const Triangle& t)
                                     { return key_of(t[1], t[2]); });
                         begin = end;
                     }
                 });
    return surface;
}

} // namespace cellwarp::core
