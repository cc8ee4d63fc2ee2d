// SPDX-License-Identifier: GPL-3.0-or-later
// The edges of faces, each once, with how many faces pass it in either direction.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

#include "octree/base/parallel.h"

namespace cellwarp::core
{

struct Edge
{
    std::uint32_t low = 0, high = 0; ///< its corners; equal where a face repeats one
    int forward = 0, backward = 0;   ///< passes from low to high, and back
};

/// Calls visit(edge) for every edge, by its corners, ascending. \p each_pass(pass) calls
/// pass(a, b) for every corner a of a face that corner b follows, the same ones whenever
/// it is called; corners are below \p num_corners. Takes 8 bytes a pass.
template <class EachPass, class Visit>
void for_each_edge(std::size_t num_corners, const EachPass& each_pass, Visit&& visit)
{
    // Sorted by the lower corner through a count of each; a corner has few edges.
    std::vector<std::size_t> begin(num_corners + 1, 0);
    each_pass([&](std::uint32_t a, std::uint32_t b) { ++begin[std::min(a, b) + 1]; });
    std::partial_sum(begin.begin(), begin.end(), begin.begin());
    std::vector<std::uint64_t> passes(begin.back()); // the higher corner, the direction
    each_pass(
        [&](std::uint32_t a, std::uint32_t b)
        {
            passes[begin[std::min(a, b)]++] =
                std::uint64_t{std::max(a, b)} << 1 | std::uint64_t{a > b};
        });
    // Filling has moved every beginning to its end.
    const auto begin_of = [&](std::size_t low) { return low == 0 ? 0 : begin[low - 1]; };
    const auto at = [&](std::size_t i)
    { return passes.begin() + static_cast<std::ptrdiff_t>(i); };
    constexpr std::size_t kCornersAtOnce = 4096;
    parallel_for(num_corners, kCornersAtOnce,
                 [&](std::size_t low) { std::sort(at(begin_of(low)), at(begin[low])); });
    for (std::size_t low = 0; low < num_corners; ++low)
        for (std::size_t i = begin_of(low); i < begin[low];)
        {
            Edge edge{static_cast<std::uint32_t>(low),
                      static_cast<std::uint32_t>(passes[i] >> 1)};
            for (; i < begin[low] && passes[i] >> 1 == edge.high; ++i)
                ++(passes[i] & 1 ? edge.backward : edge.forward);
            visit(edge);
        }
}

} // namespace cellwarp::core
