// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/field/node_table.h"

#include <random>

#include <gtest/gtest.h>

#include "tests/support/random.h"

namespace cellwarp::core
{

using support::random_vector;

TEST(NodeTable, finds_each_node_in_its_cell_and_nothing_else)
{
    std::mt19937 rng(1);
    std::vector<Eigen::Vector3d> places;
    for (int i = 0; i < 2000; ++i)
        places.push_back(random_vector(rng, 1.0));
    std::vector<NodeTable::Node> nodes;
    for (int i = 0; i < 2000; ++i)
        nodes.push_back({&places[static_cast<std::size_t>(i)], i % 7, i % 3});
    const NodeTable table(nodes);
    for (const NodeTable::Node& node : nodes)
    {
        EXPECT_EQ(table.region_at(*node.place, node.cell), node.region);
        EXPECT_EQ(table.region_at(*node.place, node.cell + 1), -1);
        EXPECT_EQ(table.region_at(random_vector(rng, 1.0), node.cell), -1);
    }
}

TEST(NodeTable, of_nodes_at_one_place_tells_the_first_and_nothing_of_several_cells)
{
    const Eigen::Vector3d one(0.1, 0.2, 0.3), other(0.1, 0.2, 0.4);
    const NodeTable table({{&one, 5, 1}, {&one, 5, 0}, {&other, 5, 0}, {&other, 6, 0}});
    EXPECT_EQ(table.region_at(one, 5), 1);
    EXPECT_EQ(table.region_at(other, 5), -1);
    EXPECT_EQ(table.region_at(other, 6), -1);
}

TEST(NodeTable, tells_nothing_of_a_place_with_a_node_that_is_not_to_be_found)
{
    const Eigen::Vector3d place(0.1, 0.2, 0.3);
    for (const bool is_first : {false, true})
    {
        std::vector<NodeTable::Node> nodes = {{&place, 5, 0},
                                              {&place, NodeTable::kNotFound, 1}};
        if (is_first)
            std::swap(nodes[0], nodes[1]);
        EXPECT_EQ(NodeTable(nodes).region_at(place, 5), -1);
    }
}

TEST(NodeTable, without_nodes_finds_none)
{
    EXPECT_EQ(NodeTable().region_at(Eigen::Vector3d::Zero(), 0), -1);
    EXPECT_EQ(
        NodeTable(std::vector<NodeTable::Node>()).region_at(Eigen::Vector3d::Zero(), 0),
        -1);
}

TEST(NodeTable, takes_zeros_of_either_sign_for_one)
{
    const Eigen::Vector3d place(0.0, 1.0, 2.0);
    const NodeTable table({{&place, 3, 0}});
    EXPECT_EQ(table.region_at(Eigen::Vector3d(-0.0, 1.0, 2.0), 3), 0);
}

} // namespace cellwarp::core
