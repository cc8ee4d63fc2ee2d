// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/cells/grouping.h"

#include <algorithm>
#include <set>
#include <tuple>

#include <gtest/gtest.h>

#include "octree/base/index.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

Links links_of(const Cells& cells)
{
    return {cells.first_neighbour, cells.neighbours};
}

} // namespace

TEST(Grouping, follows_the_lattice_of_the_octree_where_it_overhangs_the_box)
{
    // 4 x 2.2 x 1 in leaves of edge 1 overhangs by 0.4 in y: more than half a fine leaf.
    for (const double side : {2.2, 2.0, 1.7})
    {
        SCOPED_TRACE(side);
        const support::Built body = support::built(
            support::box_shape({0, 0, 0}, {4, side, 1}), 4, 1, Fill::Solid, 0.1);
        std::vector<GridPlace> places;
        for (std::size_t c = 0; c < body.cells.size(); ++c)
            places.push_back(grid_place(body.cells, static_cast<int>(c)));
        const Grouping grouping = OctreeBlocks(places).join(
            links_of(body.cells), [](std::size_t, std::size_t) { return true; });
        std::set<std::tuple<int, int, int>> parents;
        for (std::size_t g = 0; g < grouping.members.size(); ++g)
        {
            std::set<std::tuple<int, int, int>> of_group;
            for (const int cell : grouping.members.of(g))
            {
                const Eigen::Vector3i parent =
                    body.octree[body.cells.cells[idx(cell)].leaf].corner / 2;
                of_group.emplace(parent.x(), parent.y(), parent.z());
            }
            ASSERT_EQ(of_group.size(), 1u);
            EXPECT_TRUE(parents.insert(*of_group.begin()).second);
        }
    }
}

} // namespace cellwarp::core
