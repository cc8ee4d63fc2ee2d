// SPDX-License-Identifier: GPL-3.0-or-later
// Samples at one place are a spot. The spots are joined, and a spot's list names all the
// samples of the spots around it: in a soup every place has some six corners, so a list
// for each of them would be six times as much.
#include "editor/document/neighbours.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <numeric>
#include <utility>

#include "octree/base/hash.h"
#include "octree/base/parallel.h"
#include "octree/base/point_tree.h"

namespace cellwarp::core
{

namespace
{

/// Of a cloud's point: a surface that is sampled evenly has eight around each.
constexpr std::size_t kCloudNeighbours = 8;
/// Parts of a loop that are worth a thread.
constexpr std::size_t kLoopGrain = 4096;

using Pair = std::pair<std::uint32_t, std::uint32_t>;

/// Lists of numbers, one after the other.
struct Lists
{
    std::vector<std::uint64_t> first = {0};
    std::vector<std::uint32_t> items;

    std::span<std::uint32_t> of(std::size_t i)
    {
        return std::span(items).subspan(first[i], first[i + 1] - first[i]);
    }
};

/// The spot of every sample; spots count in the order of their first samples.
std::vector<std::uint32_t> spots_of(std::span<const Eigen::Vector3d> samples,
                                    std::vector<Eigen::Vector3d>& places)
{
    // Open addressing, at most half full.
    const std::size_t size = std::bit_ceil(2 * samples.size() + 1);
    std::vector<std::uint32_t> table(size, kNone), spots(samples.size());
    for (std::size_t i = 0; i < samples.size(); ++i)
    {
        std::size_t slot = hash_of(samples[i]) & (size - 1);
        while (table[slot] != kNone && places[table[slot]] != samples[i])
            slot = (slot + 1) & (size - 1);
        if (table[slot] == kNone)
        {
            table[slot] = static_cast<std::uint32_t>(places.size());
            places.push_back(samples[i]);
        }
        spots[i] = table[slot];
    }
    return spots;
}

/// Calls use(a, b) for both directions of every edge between two spots.
template <class Use>
void for_each_edge(const Geometry& geometry, const std::vector<std::uint32_t>& spots,
                   Use&& use)
{
    for (std::size_t f = 0; f < geometry.num_faces(); ++f)
    {
        const std::span<const std::uint32_t> face = geometry.face(f);
        for (std::size_t k = 0; k < face.size(); ++k)
        {
            const std::uint32_t a = spots[face[k]];
            const std::uint32_t b = spots[face[k + 1 < face.size() ? k + 1 : 0]];
            if (a == b)
                continue;
            use(a, b);
            use(b, a);
        }
    }
}

/// Sorts every list and drops what stands twice in it.
Lists without_doubles(Lists lists)
{
    const std::size_t count = lists.first.size() - 1;
    Lists result;
    result.first.assign(count + 1, 0);
    parallel_ranges(count, kLoopGrain,
                    [&](std::size_t begin, std::size_t end)
                    {
                        for (std::size_t i = begin; i < end; ++i)
                        {
                            const std::span<std::uint32_t> list = lists.of(i);
                            std::sort(list.begin(), list.end());
                            result.first[i + 1] = static_cast<std::uint64_t>(
                                std::unique(list.begin(), list.end()) - list.begin());
                        }
                    });
    std::partial_sum(result.first.begin(), result.first.end(), result.first.begin());
    result.items.resize(result.first.back());
    parallel_ranges(count, kLoopGrain,
                    [&](std::size_t begin, std::size_t end)
                    {
                        for (std::size_t i = begin; i < end; ++i)
                            std::copy_n(lists.of(i).begin(), result.of(i).size(),
                                        result.of(i).begin());
                    });
    return result;
}

/// Lists from pairs: the second of a pair goes into the list of the first. \p for_each
/// is called twice, with what is to be done with a pair.
template <class ForEach>
Lists listed(std::size_t count, ForEach&& for_each)
{
    Lists lists;
    lists.first.assign(count + 1, 0);
    for_each([&](std::uint32_t a, std::uint32_t) { ++lists.first[a + 1]; });
    std::partial_sum(lists.first.begin(), lists.first.end(), lists.first.begin());
    lists.items.resize(lists.first.back());
    std::vector<std::uint64_t> next(lists.first.begin(), lists.first.end() - 1);
    for_each([&](std::uint32_t a, std::uint32_t b) { lists.items[next[a]++] = b; });
    return lists;
}

/// Every spot with its nearest ones, and those that have it among theirs.
Lists cloud_lists(const std::vector<Eigen::Vector3d>& places)
{
    const PointTree tree(places);
    const std::size_t count = std::min(kCloudNeighbours + 1, places.size());
    std::vector<std::uint32_t> nearest(count * places.size());
    parallel_ranges(places.size(), kLoopGrain,
                    [&](std::size_t begin, std::size_t end)
                    {
                        std::vector<PointTree::Neighbour> found;
                        for (std::size_t i = begin; i < end; ++i)
                        {
                            tree.nearest(places[i], count, found);
                            for (std::size_t k = 0; k < count; ++k)
                                nearest[count * i + k] =
                                    k < found.size()
                                        ? static_cast<std::uint32_t>(found[k].index)
                                        : static_cast<std::uint32_t>(i);
                        }
                    });
    return listed(places.size(),
                  [&](auto&& use)
                  {
                      for (std::size_t i = 0; i < nearest.size(); ++i)
                      {
                          const std::uint32_t a = static_cast<std::uint32_t>(i / count);
                          if (nearest[i] == a)
                              continue;
                          use(a, nearest[i]);
                          use(nearest[i], a);
                      }
                  });
}

} // namespace

Neighbours::Neighbours(const Geometry& geometry, std::span<const Eigen::Vector3d> samples)
{
    assert(samples.size() == geometry.samples.size());
    std::vector<Eigen::Vector3d> places;
    places.reserve(samples.size());
    spots_ = spots_of(samples, places);
    Lists around = without_doubles(geometry.num_faces() > 0 || samples.empty()
                                       ? listed(places.size(), [&](auto&& use)
                                                { for_each_edge(geometry, spots_, use); })
                                       : cloud_lists(places));
    if (places.size() == samples.size())
    {
        first_ = std::move(around.first);
        neighbours_ = std::move(around.items);
        return;
    }
    Lists members = listed(places.size(),
                           [&](auto&& use)
                           {
                               for (std::size_t i = 0; i < spots_.size(); ++i)
                                   use(spots_[i], static_cast<std::uint32_t>(i));
                           });
    first_ = {0};
    for (std::size_t spot = 0; spot < places.size(); ++spot)
    {
        const auto append = [&](std::size_t other)
        {
            const std::span<const std::uint32_t> list = members.of(other);
            neighbours_.insert(neighbours_.end(), list.begin(), list.end());
        };
        if (members.of(spot).size() > 1)
            append(spot);
        for (const std::uint32_t other : around.of(spot))
            append(other);
        first_.push_back(neighbours_.size());
    }
}

} // namespace cellwarp::core
