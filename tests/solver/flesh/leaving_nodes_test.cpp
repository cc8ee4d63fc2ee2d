// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/flesh/leaving_nodes.h"

#include <random>

#include <gtest/gtest.h>

#include "octree/octree.h"
#include "octree/pieces.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;
using Eigen::VectorXd;

struct Cut
{
    Octree octree;
    Pieces pieces;
    Cells cells;
    Lattice lattice;

    Cut(const support::Built& of, Octree tree)
        : octree(std::move(tree)), pieces(find_pieces(of.material.grid, octree)),
          cells(build_cells(of.material.grid, octree, pieces)),
          lattice(octree_lattice(octree, cells, 1.0))
    {
    }
};

/// Of each fine cell, the coarse one that holds its first voxel.
std::vector<int> around(const support::Built& of, const Cut& fine, const Cut& coarse)
{
    std::vector<int> out(fine.cells.size(), -1);
    for (std::size_t voxel = 0; voxel < of.material.grid.size(); ++voxel)
        if (const int cell = fine.pieces.at(of.material.grid, voxel);
            cell >= 0 && out[idx(cell)] < 0)
            out[idx(cell)] = coarse.pieces.at(of.material.grid, voxel);
    return out;
}

/// Displacements of all nodes: those that stay at random, those that leave where their
/// parents have them, those that hang by the rest.
VectorXd random_displacements(const Lattice& lattice, const LeavingNodes& leaving)
{
    std::mt19937 rng(7);
    std::uniform_real_distribution<double> within(-1.0, 1.0);
    VectorXd u(Eigen::Index(3 * lattice.places.size()));
    for (double& x : u)
        x = within(rng);
    for (const LeavingNodes::Node& node : leaving.nodes)
        u.segment<3>(3 * node.node) = at_point(node.parents, u);
    for (std::size_t n = 0; n < lattice.hanging.size(); ++n)
        if (!lattice.hanging[n].empty())
            u.segment<3>(Eigen::Index(3 * n)) = at_point(lattice.hanging[n], u);
    return u;
}

Vector3d displacement_in(const CornerNodes& corners, const Vector3d& local,
                         const VectorXd& u)
{
    const std::array<double, 8> shares = corner_shares(local);
    Vector3d sum = Vector3d::Zero();
    for (std::size_t k = 0; k < 8; ++k)
        sum += shares[k] * u.segment<3>(3 * corners[k]);
    return sum;
}

} // namespace

TEST(LeavingNodes, without_their_detail_the_coarser_lattice_has_the_same_displacements)
{
    // Half a leaf of overhang: coarse corners that no fine cell has.
    const Shape shapes[] = {support::l_prism(), support::comb(),
                            support::box_shape({0, 0, 0}, {4.3, 1.1, 0.8})};
    for (const Shape& shape : shapes)
    {
        const support::Built built = support::built(shape, 7, 2, Fill::Solid, 0.01);
        const MaterialTest has_material = material_test(built.material.grid);
        // The first half of the leaves is cut twice, and half of these families leaves.
        std::vector<LeafNumber> some;
        for (const LeafNumber leaf : built.octree.numbers())
            if (2 * idx(leaf) < built.octree.leaves().size())
                some.push_back(leaf);
        const Octree once = built.octree.split(some, has_material);
        const Cut fine(built, once.split(std::vector{LeafNumber(0)}, has_material));
        std::vector<LeafNumber> leave;
        const std::vector<std::vector<LeafNumber>> families = fine.octree.siblings();
        for (std::size_t k = 0; k < families.size(); k += 2)
            leave.insert(leave.end(), families[k].begin(), families[k].end());
        const Cut coarse(built, fine.octree.merge(leave));
        ASSERT_LT(coarse.cells.size(), fine.cells.size());
        Lattice lattice = fine.lattice;
        const std::vector<int> coarse_cell = around(built, fine, coarse);
        const LeavingNodes leaving = let_leave(lattice, coarse.lattice, coarse_cell);
        EXPECT_GT(leaving.nodes.size(), 0u);
        EXPECT_EQ(lattice.places.size(), lattice.hanging.size());
        for (const LeavingNodes::Node& node : leaving.nodes)
        {
            EXPECT_TRUE(lattice.hanging[idx(node.node)].empty());
            double sum = 0.0;
            Vector3d place = Vector3d::Zero();
            for (const NodeShare& parent : node.parents)
            {
                sum += parent.share;
                place += parent.share * lattice.places[idx(parent.node)];
                EXPECT_NE(parent.node, node.node);
            }
            EXPECT_NEAR(sum, 1.0, 1e-13);
            EXPECT_LT((place - lattice.places[idx(node.node)]).norm(), 1e-12);
        }
        const VectorXd u = random_displacements(lattice, leaving);
        for (std::size_t c = 0; c < lattice.cells.size(); ++c)
        {
            const int large = coarse_cell[c];
            for (const Vector3d& local : {Vector3d(0.2, 0.7, 0.4), Vector3d(0.9, 0.1, 0)})
            {
                const Vector3d x = cell_point(lattice, static_cast<int>(c), local);
                const Vector3d there = *local_place(coarse.lattice, large, x);
                EXPECT_LT((displacement_in(lattice.cells[c], local, u) -
                           displacement_in(leaving.coarse_cells[idx(large)], there, u))
                              .norm(),
                          1e-12);
            }
        }
    }
}

TEST(LeavingNodes, nothing_leaves_where_both_lattices_are_the_same)
{
    const support::Built built =
        support::built(support::l_prism(), 8, 1, Fill::Solid, 0.02);
    const Cut one(built, built.octree);
    Lattice lattice = one.lattice;
    const LeavingNodes leaving = let_leave(lattice, one.lattice, around(built, one, one));
    EXPECT_TRUE(leaving.nodes.empty());
    EXPECT_EQ(lattice.places.size(), one.lattice.places.size());
    EXPECT_EQ(leaving.coarse_cells, one.lattice.cells);
}

TEST(Fading, begins_with_its_speed_and_ends_at_rest)
{
    const Fading fading{{1, -2, 3}, {4, 0, -1}, 2.0, 2.25};
    const double h = 1e-6;
    EXPECT_LT((fading.at(2.0) - fading.from).norm(), 1e-15);
    EXPECT_LT(((fading.at(2.0 + h) - fading.at(2.0)) / h - fading.slope).norm(), 2e-3);
    EXPECT_LT(((fading.at(2.25) - fading.at(2.25 - h)) / h).norm(), 1e-3);
    EXPECT_EQ(fading.at(2.25), Vector3d::Zero());
    EXPECT_EQ(fading.at(9.0), Vector3d::Zero());
    // Begun anew on its way, it goes on as it went.
    const double middle = 2.1;
    const Fading rest{fading.at(middle),
                      (fading.at(middle + h) - fading.at(middle - h)) / (2 * h), middle,
                      2.25};
    for (const double time : {2.1, 2.15, 2.2, 2.24})
        EXPECT_LT((rest.at(time) - fading.at(time)).norm(), 1e-8);
}

} // namespace cellwarp::core
