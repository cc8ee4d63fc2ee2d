// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/flesh/lattice.h"

#include <random>
#include <set>
#include <stdexcept>

#include <gtest/gtest.h>

#include "solver/flesh/drawn_cells.h"
#include "tests/support/flesh.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;
using Eigen::Vector3i;

/// The sum of shares times what a map gives at the nodes.
Vector3d at_nodes(const NodeShares& shares, const std::vector<Vector3d>& places)
{
    Vector3d sum = Vector3d::Zero();
    for (const NodeShare& share : shares)
        sum += share.share * places[idx(share.node)];
    return sum;
}

} // namespace

TEST(BoxNodes, corners_of_glued_boxes_are_one_node_and_of_others_two)
{
    const std::vector<LatticeBox> boxes = {{{0, 0, 0}, 1}, {{1, 0, 0}, 1}};
    EXPECT_EQ(box_nodes(boxes, std::vector<std::pair<int, int>>{{0, 1}}).places.size(),
              12u);
    EXPECT_EQ(box_nodes(boxes, {}).places.size(), 16u);
    // Two parts of the material in one box.
    const std::vector<LatticeBox> twice = {
        {{0, 0, 0}, 1}, {{0, 0, 0}, 1}, {{1, 0, 0}, 1}};
    const BoxNodes nodes = box_nodes(twice, std::vector<std::pair<int, int>>{{0, 2}});
    EXPECT_EQ(nodes.places.size(), 20u);
    for (const int node : nodes.of_box[1])
        for (const int other : nodes.of_box[0])
            EXPECT_NE(node, other);
}

TEST(BoxNodes, nodes_on_the_side_of_a_larger_box_hang_between_its_corners)
{
    // A box of width 4 beside boxes of width 2, one of them of width 1s.
    std::vector<LatticeBox> boxes = {{{0, 0, 0}, 4}};
    std::vector<std::pair<int, int>> glued;
    for (const int y : {0, 2})
        for (const int z : {0, 2})
        {
            glued.emplace_back(0, static_cast<int>(boxes.size()));
            boxes.push_back({{4, y, z}, 2});
        }
    const BoxNodes nodes = box_nodes(boxes, glued);
    int hanging = 0;
    for (std::size_t n = 0; n < nodes.places.size(); ++n)
    {
        if (nodes.hanging[n].empty())
            continue;
        ++hanging;
        Vector3d place = Vector3d::Zero();
        double sum = 0.0;
        for (const NodeShare& share : nodes.hanging[n])
        {
            EXPECT_TRUE(nodes.hanging[idx(share.node)].empty());
            place += share.share * nodes.places[idx(share.node)].cast<double>();
            sum += share.share;
        }
        EXPECT_EQ(place, nodes.places[n].cast<double>());
        EXPECT_EQ(sum, 1.0);
    }
    // The middles of four edges and of the side itself: of each of the four boxes its
    // own, for they are not glued to each other.
    EXPECT_EQ(hanging, 4 * 3);
}

TEST(Lattice, of_mixed_sizes_is_continuous_and_keeps_affine_maps)
{
    const support::Built body = support::built_mixed(support::l_prism(), 7, 2, 4);
    const Lattice lattice = octree_lattice(body.octree, body.cells, 2.0);
    std::size_t hanging = 0;
    for (std::size_t n = 0; n < lattice.places.size(); ++n)
        if (!lattice.hanging[n].empty())
        {
            ++hanging;
            EXPECT_LT(
                (at_nodes(lattice.hanging[n], lattice.places) - lattice.places[n]).norm(),
                1e-12);
        }
    EXPECT_GT(hanging, 20u);
    // Both sides of a face see the same function there.
    std::mt19937 rng(3);
    std::vector<Vector3d> values(lattice.places.size());
    for (Vector3d& value : values)
        value = support::random_vector(rng, 1.0);
    for (std::size_t n = 0; n < values.size(); ++n)
        if (!lattice.hanging[n].empty())
            values[n] = at_nodes(lattice.hanging[n], values);
    for (const Face& face : body.cells.faces)
    {
        const Cell& small = body.cells.cells[idx(
            body.cells.cells[idx(face.a)].edge < body.cells.cells[idx(face.b)].edge
                ? face.a
                : face.b)];
        const double side = body.cells.cells[idx(face.a)].box_centre[face.axis] +
                            0.5 * body.cells.cells[idx(face.a)].edge;
        for (int k = 0; k < 5; ++k)
        {
            Vector3d x =
                small.box_centre + 0.5 * small.edge * support::random_vector(rng, 1.0);
            x[face.axis] = side;
            const auto seen = [&](int cell)
            {
                return at_nodes(
                    shares_at(lattice, cell, *local_place(lattice, cell, 2.0 * x)),
                    values);
            };
            EXPECT_LT((seen(face.a) - seen(face.b)).norm(), 1e-12);
        }
    }
}

TEST(Lattice, coarser_ones_have_fewer_nodes_and_keep_affine_maps)
{
    const support::Built body = support::built_mixed(support::l_prism(), 9, 1, 6);
    const Lattice lattice = octree_lattice(body.octree, body.cells, 1.0);
    ASSERT_GE(lattice.coarser.size(), 3u);
    std::size_t below = lattice.places.size();
    for (const Lattice::Coarser& coarser : lattice.coarser)
    {
        EXPECT_EQ(coarser.below.size(), below);
        EXPECT_LT(coarser.num_nodes, below);
        for (std::size_t row = 0; row < below; ++row)
        {
            double sum = 0.0;
            for (const NodeShare& share : coarser.below[row])
                sum += share.share;
            EXPECT_TRUE(coarser.below[row].empty() || std::abs(sum - 1.0) < 1e-12);
        }
        below = coarser.num_nodes;
    }
    EXPECT_LT(below, 40u);
}

TEST(Lattice, parts_by_material_sum_up_to_the_cells)
{
    const support::Built body = support::built(support::l_prism(), 7, 0);
    const Lattice lattice = octree_lattice(body.octree, body.cells, 1.0);
    const VoxelGrid& grid = body.material.grid;
    std::vector<int> material(grid.size());
    for (std::size_t v = 0; v < grid.size(); ++v)
        material[v] = grid.centre(grid.coordinates(v)).x() > 1.3;
    const std::vector<LatticePart> parts =
        parts_by_material(grid, body.octree, body.pieces, material, 1.0);
    std::vector<double> volume(lattice.cells.size(), 0.0);
    std::vector<Vector3d> first(lattice.cells.size(), Vector3d::Zero());
    for (const LatticePart& part : parts)
    {
        volume[idx(part.cell)] += part.volume;
        first[idx(part.cell)] += part.volume * part.centre;
        EXPECT_TRUE(part.material == 0 || part.centre.x() > 1.3 - 1e-9);
    }
    EXPECT_GT(parts.size(), lattice.parts.size());
    for (const LatticePart& part : lattice.parts)
    {
        EXPECT_NEAR(volume[idx(part.cell)], part.volume, 1e-12);
        EXPECT_LT((first[idx(part.cell)] / volume[idx(part.cell)] - part.centre).norm(),
                  1e-12);
    }
}

TEST(Lattice, places_in_bent_cells_are_found)
{
    Lattice lattice = support::grid_lattice({{{0, 1, 2}, {0, 1}, {0, 1}}});
    std::mt19937 rng(2);
    for (Vector3d& x : lattice.places)
        x += support::random_vector(rng, 0.15);
    for (int k = 0; k < 50; ++k)
    {
        const Vector3d local(support::random_number(rng, 0, 1),
                             support::random_number(rng, 0, 1),
                             support::random_number(rng, 0, 1));
        const auto found = local_place(lattice, 1, cell_point(lattice, 1, local));
        ASSERT_TRUE(found);
        EXPECT_LT((*found - local).norm(), 1e-11);
    }
}

TEST(DrawnCells, all_kinds_become_hexahedra_that_fill_the_same_space)
{
    DrawnCells drawn;
    for (int k = 0; k < 8; ++k)
        drawn.places.emplace_back(k & 1, k >> 1 & 1, k >> 2);
    drawn.places.emplace_back(0.5, 0.5, 2.0);
    // A cube as two loops, and a tetrahedron and a wedge above it.
    drawn.cells.push_back({0, 1, 3, 2, 4, 5, 7, 6});
    drawn.edges = {{0, 4}};
    Hexahedra plain = hexahedra_of(drawn);
    EXPECT_EQ(plain.cells.size(), 1u);
    EXPECT_EQ(plain.places.size(), 9u);
    const auto volume = [](const Hexahedra& of)
    {
        double sum = 0.0;
        for (const LatticePart& part :
             drawn_lattice(of.places, of.cells, std::vector<int>(of.cells.size(), 0))
                 .parts)
            sum += part.volume;
        return sum;
    };
    EXPECT_NEAR(volume(plain), 1.0, 1e-14);
    drawn.cells.push_back({4, 5, 7, 8}); // half of a pyramid of height 1
    const Hexahedra split = hexahedra_of(drawn);
    EXPECT_EQ(split.cells.size(), 12u);
    EXPECT_EQ(split.edges.size(), 2u);
    EXPECT_NEAR(volume(split), 1.0 + 1.0 / 6.0, 1e-12);
    DrawnCells wedge;
    wedge.places = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 2}, {1, 0, 2}, {0, 1, 2}};
    wedge.cells.push_back({0, 1, 2, 3, 4, 5});
    EXPECT_NEAR(volume(hexahedra_of(wedge)), 1.0, 1e-12);
    // Turned inside out in the file: turned back.
    std::swap(wedge.places[1], wedge.places[2]);
    std::swap(wedge.places[4], wedge.places[5]);
    EXPECT_NEAR(volume(hexahedra_of(wedge)), 1.0, 1e-12);
}

TEST(DrawnCells, cells_that_fold_into_themselves_are_refused)
{
    std::vector<Vector3d> places;
    for (int k = 0; k < 8; ++k)
        places.emplace_back(k & 1, k >> 1 & 1, k >> 2);
    places[7] = {-0.9, -0.9, -0.9};
    EXPECT_THROW(drawn_lattice(places, {{0, 1, 2, 3, 4, 5, 6, 7}}, std::vector<int>{0}),
                 std::invalid_argument);
}

} // namespace cellwarp::core
