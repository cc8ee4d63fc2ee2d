// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/flesh/drawn_forest.h"

#include <functional>
#include <random>

#include <Eigen/LU>

#include <gtest/gtest.h>

#include "solver/flesh/flesh.h"
#include "solver/flesh/leaving_nodes.h"
#include "tests/support/random.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::Vector3i;
using Eigen::VectorXd;

/// Drawn cells, and the places of the vertices before a map moved them.
struct Drawn
{
    Hexahedra cells;
    std::vector<Vector3d> before;
};

/// Cubes of a grid, moved by a map.
Drawn grid(const Vector3i& counts, const std::function<Vector3d(const Vector3d&)>& map)
{
    Drawn out;
    DrawnCells drawn;
    const auto number = [&](int i, int j, int k)
    { return i + (counts.x() + 1) * (j + (counts.y() + 1) * k); };
    for (int k = 0; k <= counts.z(); ++k)
        for (int j = 0; j <= counts.y(); ++j)
            for (int i = 0; i <= counts.x(); ++i)
            {
                out.before.emplace_back(i, j, k);
                drawn.places.push_back(map(out.before.back()));
            }
    for (int k = 0; k < counts.z(); ++k)
        for (int j = 0; j < counts.y(); ++j)
            for (int i = 0; i < counts.x(); ++i)
            {
                std::vector<int>& cell = drawn.cells.emplace_back();
                for (const int up : {0, 1})
                    for (const auto& [a, b] : {std::pair{0, 0}, {1, 0}, {1, 1}, {0, 1}})
                        cell.push_back(number(i + a, j + b, k + up));
                // Every other cell begins at another corner, on its other side.
                if ((i + j + k) % 2 == 1)
                    cell = {cell[6], cell[5], cell[4], cell[7],
                            cell[2], cell[1], cell[0], cell[3]};
            }
    out.cells = hexahedra_of(drawn);
    return out;
}

Vector3d sheared(const Vector3d& x)
{
    return {x.x() + 0.3 * x.y(), 0.8 * x.y(), x.z() + 0.2 * x.x()};
}

Vector3d curved(const Vector3d& x)
{
    const double turn = 0.25 * x.x(), radius = 4.0 + x.y();
    return {radius * std::sin(turn), radius * std::cos(turn),
            x.z() + 0.1 * x.x() * x.y()};
}

/// Two cubes that share an edge alone, and one that shares a side with the first.
Drawn meeting_in_an_edge()
{
    Drawn out = grid({3, 2, 1}, [](const Vector3d& x) { return x; });
    // Two diagonal ones of (0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1), and one more.
    out.cells.cells = {out.cells.cells[0], out.cells.cells[1], out.cells.cells[5]};
    return out;
}

/// Halved at random.
Octree refined(const DrawnForest& forest, unsigned seed)
{
    std::mt19937 rng(seed);
    Octree octree = forest.roots();
    for (int round = 0; round < forest.max_depth(); ++round)
    {
        std::vector<LeafNumber> some;
        for (const LeafNumber leaf : octree.numbers())
            if (rng() % 3 == 0)
                some.push_back(leaf);
        octree = octree.split(some, forest.has_material());
    }
    return octree;
}

std::vector<Drawn> all_kinds()
{
    std::vector<Drawn> out = {grid({3, 2, 2}, sheared), grid({3, 2, 2}, curved),
                              meeting_in_an_edge()};
    DrawnCells split; // a tetrahedron beside a wedge: hexahedra with bent sides
    split.places = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 2},
                    {1, 0, 2}, {0, 1, 2}, {0, 0, -1}};
    split.cells = {{0, 1, 2, 3, 4, 5}, {0, 2, 1, 6}};
    out.push_back({hexahedra_of(split), {}});
    return out;
}

template <class Values>
Vector3d summed(std::span<const NodeShare> shares, const Values& values)
{
    Vector3d sum = Vector3d::Zero();
    for (const NodeShare& share : shares)
        sum += share.share * values[idx(share.node)];
    return sum;
}

bool is_inside(const Vector3d& local, double beside)
{
    return local.minCoeff() >= -beside && local.maxCoeff() <= 1.0 + beside;
}

} // namespace

TEST(DrawnForest, halved_cells_keep_the_map_of_the_cell_and_share_its_neighbours_nodes)
{
    const Drawn drawn = grid({2, 1, 1}, curved);
    const DrawnForest forest(drawn.cells, 1);
    const Lattice large = forest.lattice(forest.roots()).lattice;
    const Octree halves = forest.roots().split_all(1, forest.has_material());
    const Lattice small = forest.lattice(halves).lattice;
    EXPECT_EQ(large.places.size(), 12u);
    EXPECT_EQ(small.cells.size(), 16u);
    EXPECT_EQ(small.places.size(), 5u * 3u * 3u);
    ASSERT_EQ(small.coarser.size(), 1u);
    EXPECT_EQ(small.coarser[0].num_nodes, large.places.size());
    const Vector3d local(0.3, 0.6, 0.9);
    for (int child = 0; child < 16; ++child)
    {
        const LeafNumber of = forest.roots().find(small.boxes[idx(child)].corner);
        const LatticeBox& around = large.boxes[idx(of)];
        const Vector3d in_large =
            place_in(around, small.boxes[idx(child)].corner) + 0.5 * local;
        EXPECT_LT((cell_point(small, child, local) -
                   cell_point(large, static_cast<int>(of), in_large))
                      .norm(),
                  1e-14);
    }
    for (std::size_t n = 0; n < small.places.size(); ++n)
        EXPECT_LT(
            (summed(small.coarser[0].below[n], large.places) - small.places[n]).norm(),
            1e-14);
}

TEST(DrawnForest, of_mixed_sizes_is_continuous_and_keeps_affine_maps)
{
    std::mt19937 rng(3);
    for (const Drawn& drawn : all_kinds())
    {
        const DrawnForest forest(drawn.cells, 2);
        const Octree octree = refined(forest, 5);
        const Lattice lattice = forest.lattice(octree).lattice;
        std::vector<Vector3d> values;
        for (std::size_t n = 0; n < lattice.places.size(); ++n)
            values.push_back(support::random_vector(rng, 1.0));
        int hanging = 0;
        for (std::size_t n = 0; n < values.size(); ++n)
            if (!lattice.hanging[n].empty())
            {
                ++hanging;
                for (const NodeShare& share : lattice.hanging[n])
                    EXPECT_TRUE(lattice.hanging[idx(share.node)].empty());
                EXPECT_LT((summed(lattice.hanging[n], lattice.places) - lattice.places[n])
                              .norm(),
                          1e-13);
                values[n] = summed(lattice.hanging[n], values);
            }
        EXPECT_GT(hanging, 10);
        // All cells see the same function where they touch.
        int seen = 0;
        for (int cell = 0; cell < static_cast<int>(lattice.cells.size()); ++cell)
            for (int side = 0; side < 12; ++side)
            {
                Vector3d local(support::random_number(rng, 0, 1),
                               support::random_number(rng, 0, 1),
                               support::random_number(rng, 0, 1));
                local[side % 3] = side / 3 % 2;
                if (side >= 6) // an edge
                    local[(side + 1) % 3] = side % 2;
                const Vector3d x = cell_point(lattice, cell, local);
                const Vector3d value = summed(shares_at(lattice, cell, local), values);
                for (int other = 0; other < static_cast<int>(lattice.cells.size());
                     ++other)
                    if (const std::optional<Vector3d> there =
                            local_place(lattice, other, x);
                        other != cell && there && is_inside(*there, 1e-9))
                    {
                        ++seen;
                        EXPECT_LT(
                            (summed(shares_at(lattice, other, *there), values) - value)
                                .norm(),
                            1e-8);
                    }
            }
        EXPECT_GT(seen, 100);
    }
}

TEST(DrawnForest, cells_that_meet_in_an_edge_alone_agree_on_it)
{
    const Drawn drawn = meeting_in_an_edge();
    const DrawnForest forest(drawn.cells, 2);
    // The third cell is halved twice, the others stay.
    Octree octree = forest.roots();
    for (int round = 0; round < 2; ++round)
    {
        std::vector<LeafNumber> of_third;
        for (const LeafNumber leaf : octree.numbers())
            if (forest.root_of(octree[leaf]) == 2)
                of_third.push_back(leaf);
        octree = octree.split(of_third, forest.has_material());
    }
    const Lattice lattice = forest.lattice(octree).lattice;
    EXPECT_EQ(lattice.cells.size(), 66u);
    int on_edge = 0, hanging = 0;
    for (std::size_t n = 0; n < lattice.places.size(); ++n)
    {
        hanging += !lattice.hanging[n].empty();
        if ((lattice.places[n].head<2>() - Eigen::Vector2d(2, 1)).norm() > 1e-9)
            continue;
        ++on_edge;
        EXPECT_EQ(lattice.hanging[n].size(),
                  std::abs(lattice.places[n].z() - 0.5) < 0.4 ? 2u : 0u);
    }
    EXPECT_EQ(on_edge, 5);
    EXPECT_EQ(hanging, 3);
    // They share no side.
    for (const CellSide& side : lattice.sides)
        EXPECT_EQ(forest.root_of(octree.leaves()[idx(side.a)]) == 2,
                  forest.root_of(octree.leaves()[idx(side.b)]) == 2);
}

TEST(DrawnForest, sides_lead_from_each_cell_to_its_neighbours)
{
    const Drawn drawn = grid({2, 1, 1},
                             [](const Vector3d& x) -> Vector3d
                             { return Vector3d(2, 1, 1).cwiseProduct(x); });
    const DrawnForest forest(drawn.cells, 2);
    Octree octree = forest.roots();
    for (int round = 0; round < 2; ++round) // the first cell alone
    {
        std::vector<LeafNumber> some;
        for (const LeafNumber leaf : octree.numbers())
            if (forest.root_of(octree[leaf]) == 0)
                some.push_back(leaf);
        octree = octree.split(some, forest.has_material());
    }
    const std::vector<CellSide> sides = forest.lattice(octree).lattice.sides;
    EXPECT_EQ(sides.size(), 3u * 48u + 16u);
    int between = 0;
    for (const CellSide& side : sides)
        if (side.width_a != side.width_b)
        {
            ++between;
            EXPECT_NEAR(std::min(side.width_a, side.width_b), 0.5, 1e-14);
            EXPECT_NEAR(std::max(side.width_a, side.width_b), 2.0, 1e-14);
        }
    EXPECT_EQ(between, 16);
}

TEST(DrawnForest, coarser_lattices_have_fewer_nodes_and_keep_affine_maps)
{
    for (const Drawn& drawn : all_kinds())
    {
        const DrawnForest forest(drawn.cells, 2);
        const Lattice lattice = forest.lattice(refined(forest, 2)).lattice;
        ASSERT_EQ(lattice.coarser.size(), 2u);
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
                EXPECT_TRUE(coarser.below[row].empty() || std::abs(sum - 1.0) < 1e-14);
            }
            below = coarser.num_nodes;
        }
    }
}

TEST(DrawnForest, even_strain_loads_no_node_inside)
{
    for (const auto& map : {&sheared, &curved})
    {
        const Drawn drawn = grid({3, 3, 3}, *map);
        const DrawnForest forest(drawn.cells, 2);
        ForestLattice made = forest.lattice(refined(forest, 1));
        const Lattice lattice = made.lattice;
        const FleshMaterial material;
        Flesh flesh(std::move(made.lattice), {material}, {}, {}, {});
        Matrix3d G;
        G << 0.1, 0.2, -0.1, 0.05, -0.2, 0.1, 0.3, 0.1, 0.15;
        VectorXd u(Eigen::Index(3 * lattice.places.size()));
        double volume = 0.0;
        for (const LatticePart& part : lattice.parts)
            volume += part.volume;
        for (std::size_t n = 0; n < lattice.places.size(); ++n)
            u.segment<3>(Eigen::Index(3 * n)) = G * lattice.places[n];
        VectorXd f = flesh.dense_matrix(0.0, 1.0, 0.0) * u;
        const Matrix3d strain = 0.5 * (G + G.transpose());
        const double density = material.lambda() * strain.trace() * strain.trace() +
                               2.0 * material.shear() * strain.squaredNorm();
        EXPECT_NEAR(u.dot(f), volume * density, 1e-9 * volume * density);
        const double scale = f.cwiseAbs().maxCoeff();
        for (std::size_t n = 0; n < lattice.places.size(); ++n)
            for (const NodeShare& share : lattice.hanging[n])
                f.segment<3>(3 * share.node) +=
                    share.share * f.segment<3>(Eigen::Index(3 * n));
        int inside = 0;
        for (std::size_t n = 0; n < lattice.places.size(); ++n)
        {
            const Vector3d before = summed(made.of_vertices[n], drawn.before);
            if (!lattice.hanging[n].empty() || before.minCoeff() <= 0.0 ||
                before.maxCoeff() >= 3.0)
                continue;
            ++inside;
            EXPECT_LT(f.segment<3>(Eigen::Index(3 * n)).norm(), 1e-11 * scale);
        }
        EXPECT_GT(inside, 50);
    }
}

TEST(DrawnForest, without_their_detail_the_coarser_lattice_has_the_same_displacements)
{
    for (const Drawn& drawn : all_kinds())
    {
        const DrawnForest forest(drawn.cells, 2);
        const Octree octree = refined(forest, 4);
        std::vector<LeafNumber> leave;
        const std::vector<std::vector<LeafNumber>> families = octree.siblings();
        for (std::size_t k = 0; k < families.size(); k += 2)
            leave.insert(leave.end(), families[k].begin(), families[k].end());
        const Octree fewer = octree.merge(leave);
        ASSERT_LT(fewer.leaves().size(), octree.leaves().size());
        Lattice fine = forest.lattice(octree).lattice;
        const Lattice coarse = forest.lattice(fewer).lattice;
        std::vector<int> coarse_cell;
        for (const Leaf& leaf : octree.leaves())
            coarse_cell.push_back(static_cast<int>(fewer.find(leaf.corner)));
        const LeavingNodes leaving = let_leave(fine, coarse, coarse_cell);
        EXPECT_GT(leaving.nodes.size(), 0u);
        std::mt19937 rng(7);
        std::vector<Vector3d> u;
        for (std::size_t n = 0; n < fine.places.size(); ++n)
            u.push_back(support::random_vector(rng, 1.0));
        for (const LeavingNodes::Node& node : leaving.nodes)
        {
            EXPECT_LT(
                (summed(node.parents, fine.places) - fine.places[idx(node.node)]).norm(),
                1e-13);
            u[idx(node.node)] = summed(node.parents, u);
        }
        for (std::size_t n = 0; n < fine.places.size(); ++n)
            if (!fine.hanging[n].empty())
                u[n] = summed(fine.hanging[n], u);
        const auto in = [&](const CornerNodes& corners, const Vector3d& local)
        {
            Vector3d sum = Vector3d::Zero();
            const std::array<double, 8> shares = corner_shares(local);
            for (std::size_t k = 0; k < 8; ++k)
                sum += shares[k] * u[idx(corners[k])];
            return sum;
        };
        for (std::size_t c = 0; c < fine.cells.size(); ++c)
        {
            const std::size_t around = idx(coarse_cell[c]);
            const LatticeBox &box = fine.boxes[c], &large = coarse.boxes[around];
            const Vector3d local(0.2, 0.7, 0.4);
            const Vector3d there =
                place_in(large, box.corner) + double(box.width) / large.width * local;
            EXPECT_LT((in(fine.cells[c], local) - in(leaving.coarse_cells[around], there))
                          .norm(),
                      1e-13);
        }
    }
}

TEST(DrawnForest, places_of_cells_lie_in_their_leaves)
{
    const Drawn drawn = grid({2, 2, 1}, curved);
    const DrawnForest forest(drawn.cells, 3);
    const Octree roots = forest.roots(), octree = refined(forest, 8);
    const Lattice large = forest.lattice(roots).lattice,
                  small = forest.lattice(octree).lattice;
    for (int cell = 0; cell < 4; ++cell)
        for (const Vector3d& local :
             {Vector3d(0, 0, 0), Vector3d(1, 1, 1), Vector3d(0.3, 0.8, 0.55),
              Vector3d(-0.05, 0.5, 1.05)})
        {
            const DrawnForest::Place place = forest.place_in_leaf(
                octree, {forest.root_of(roots.leaves()[idx(cell)]), local});
            EXPECT_LT((cell_point(small, static_cast<int>(place.cell), place.local) -
                       cell_point(large, cell, local))
                          .norm(),
                      1e-13);
        }
}

} // namespace cellwarp::core
