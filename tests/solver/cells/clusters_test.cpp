// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/cells/clusters.h"

#include <array>
#include <cmath>
#include <set>

#include <gtest/gtest.h>

#include "octree/base/index.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

using support::Built;

namespace
{

/// Steps through faces of a bar from a cell to the nearest of some cells.
double steps(const Built& bar, std::span<const int> core, int cell)
{
    double nearest = 1e9;
    for (const int other : core)
        nearest = std::min(nearest, (bar.cells.cells[idx(other)].box_centre -
                                     bar.cells.cells[idx(cell)].box_centre)
                                        .lpNorm<1>());
    return nearest;
}

std::vector<bool> none(const Built& built)
{
    return std::vector<bool>(built.cells.size(), false);
}

} // namespace

TEST(Clusters, have_cores_that_cover_all_and_reach_as_far_as_asked)
{
    const Built bar = support::bar(3, 4, 15);
    const ClusterSize size{2, 2.0, 3.0};
    const Clusters clusters = grow_clusters(bar.cells, none(bar), size);
    std::vector<int> times_in_core(bar.cells.size(), 0);
    for (const Cluster& cluster : clusters.clusters)
    {
        for (const int cell : cluster.core)
            ++times_in_core[idx(cell)];
        std::vector<int> expected;
        for (int cell = 0; cell < static_cast<int>(bar.cells.size()); ++cell)
            if (steps(bar, cluster.core, cell) < 3.5)
                expected.push_back(cell);
        EXPECT_EQ(cluster.cells, expected);
    }
    EXPECT_EQ(times_in_core, std::vector<int>(bar.cells.size(), 1));
    for (int cell = 0; cell < static_cast<int>(bar.cells.size()); ++cell)
    {
        double heaviest = 0.0;
        for (const Membership& member : clusters.of_cell(cell))
        {
            const double d =
                steps(bar, clusters.clusters[idx(member.cluster)].core, cell);
            EXPECT_NEAR(member.weight, std::pow(1.0 - d / 2.0, 3), 1e-12);
            heaviest = std::max(heaviest, member.weight);
        }
        EXPECT_EQ(heaviest, 1.0);
    }
}

TEST(Clusters, of_a_mirrored_shape_are_the_mirrored_clusters)
{
    // Odd, even and small counts; every core's mirror image must be a core.
    const Eigen::Vector3i counts(5, 8, 14);
    const Built bar = support::bar(counts.x(), counts.y(), counts.z());
    for (const int core : {1, 2, 3, 4})
    {
        const Clusters clusters =
            grow_clusters(bar.cells, none(bar), ClusterSize{core, 2.0, 2.0});
        std::set<std::vector<std::array<int, 3>>> cores;
        for (const bool is_mirrored : {false, true})
            for (const Cluster& cluster : clusters.clusters)
            {
                std::vector<std::array<int, 3>> places;
                for (const int cell : cluster.core)
                {
                    std::array<int, 3> place;
                    for (int axis = 0; axis < 3; ++axis)
                    {
                        const int at =
                            static_cast<int>(bar.cells.cells[idx(cell)].box_centre[axis]);
                        place[idx(axis)] = is_mirrored ? counts[axis] - 1 - at : at;
                    }
                    places.push_back(place);
                }
                std::sort(places.begin(), places.end());
                EXPECT_EQ(cores.insert(places).second, !is_mirrored);
            }
        EXPECT_EQ(cores.size(), clusters.clusters.size());
    }
}

TEST(Clusters, do_not_cross_a_gap_and_leave_out_what_they_must)
{
    const Built two =
        support::built(support::joined(support::box_shape({0, 0, 0}, {4, 0.45, 1}),
                                       support::box_shape({0, 0.55, 0}, {4, 1, 1})),
                       8, 0, Fill::Solid, 0.02);
    const std::vector<int> component = connected_components(two.cells);
    std::vector<bool> is_left_out;
    for (const int number : component)
        is_left_out.push_back(number == 1);
    const Clusters clusters = grow_clusters(two.cells, is_left_out, ClusterSize());
    ASSERT_FALSE(clusters.clusters.empty());
    for (const Cluster& cluster : clusters.clusters)
        for (const int cell : cluster.cells)
            EXPECT_EQ(component[idx(cell)], 0);
    for (std::size_t cell = 0; cell < two.cells.size(); ++cell)
        EXPECT_EQ(clusters.of_cell(static_cast<int>(cell)).empty(), is_left_out[cell]);
}

} // namespace cellwarp::core
