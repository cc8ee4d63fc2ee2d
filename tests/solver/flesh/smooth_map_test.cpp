// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/flesh/smooth_map.h"

#include <cmath>
#include <utility>

#include <gtest/gtest.h>

#include "octree/base/parallel.h"
#include "tests/support/flesh.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

/// Random places in all cells, in the box of each.
std::vector<SmoothMap::Place> random_places(const Cells& cells, std::size_t count)
{
    std::mt19937 rng(7);
    std::vector<SmoothMap::Place> places;
    for (std::size_t i = 0; i < count; ++i)
        places.push_back({static_cast<int>(i % cells.size()),
                          Vector3d::Constant(0.5) + support::random_vector(rng, 0.5)});
    return places;
}

Vector3d at(const Cells& cells, const SmoothMap::Place& place)
{
    const Cell& cell = cells.cells[idx(place.cell)];
    return cell.box_centre + cell.edge * (place.local - Vector3d::Constant(0.5));
}

/// A hand of two fingers, side by side in the boxes of the lattice, far apart otherwise.
Shape two_fingers()
{
    Shape shape = support::box_shape({0, 0, 0}, {1, 1, 1});
    const auto add = [&](const Vector3d& low, const Vector3d& high)
    {
        const Shape box = support::box_shape(low, high);
        const auto first = static_cast<std::uint32_t>(shape.samples.size());
        shape.samples.insert(shape.samples.end(), box.samples.begin(), box.samples.end());
        for (const Triangle& t : box.triangles)
            shape.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
    };
    add({0.9, 0.05, 0.05}, {4, 0.45, 0.95});
    add({0.9, 0.55, 0.05}, {4, 0.95, 0.95});
    return shape;
}

std::vector<support::Built> bodies()
{
    std::vector<support::Built> out;
    out.push_back(support::built(support::l_prism(), 9));
    out.push_back(support::built(support::comb(), 16));
    out.push_back(support::built(two_fingers(), 8, 0, Fill::Solid, 0.02));
    out.push_back(support::built_mixed(support::l_prism(), 7, 2, 3));
    out.push_back(support::built_mixed(two_fingers(), 8, 1, 5, 0.02));
    return out;
}

VectorXd hung(const Lattice& lattice, VectorXd u)
{
    for (std::size_t n = 0; n < lattice.places.size(); ++n)
        if (!lattice.hanging[n].empty())
            u.segment<3>(Eigen::Index(3 * n)) = at_point(lattice.hanging[n], u);
    return u;
}

} // namespace

TEST(SmoothMap, is_exact_for_affine_maps)
{
    std::mt19937 rng(3);
    const Matrix3d A = Matrix3d::Random();
    const Vector3d b(0.3, -0.2, 0.5);
    for (const support::Built& built : bodies())
    {
        const Lattice lattice = octree_lattice(built.octree, built.cells, 2.0);
        const std::vector<SmoothMap::Place> places = random_places(built.cells, 2000);
        // Also with a grid that is coarser than the smallest cells.
        for (const std::size_t most_boxes : {SmoothMap::kMostBoxes, std::size_t(100)})
        {
            const SmoothMap map(built.octree, built.cells, lattice, places, most_boxes);
            const auto values = map.values(support::field_of(
                lattice, [&](const Vector3d& x) -> Vector3d { return A * x + b; }));
            ASSERT_EQ(values.size(), places.size());
            for (std::size_t i = 0; i < places.size(); ++i)
            {
                const Vector3d x = 2.0 * at(built.cells, places[i]);
                EXPECT_LT((values[i].displacement - A * x - b).norm(), 1e-12);
                EXPECT_LT((values[i].gradient - A).norm(), 1e-11);
            }
        }
    }
}

TEST(SmoothMap, is_exact_for_quadratic_maps_two_cells_from_the_border)
{
    const auto displacement = [](const Vector3d& x) -> Vector3d {
        return {x.x() * x.y(), x.z() * x.z() - x.y(), x.x() * x.x() - x.y() * x.z()};
    };
    const support::Built built =
        support::built_mixed(support::box_shape({0, 0, 0}, {1, 1, 1}), 12, 1, 11);
    const Lattice lattice = octree_lattice(built.octree, built.cells, 1.0);
    const std::vector<SmoothMap::Place> places = random_places(built.cells, 20000);
    // Hanging nodes are where the larger cells have them, so not at the quadratic map.
    const VectorXd u = hung(lattice, support::field_of(lattice, displacement));
    const auto values =
        SmoothMap(built.octree, built.cells, lattice, places).values(u, places.size());
    std::size_t inside = 0;
    for (std::size_t i = 0; i < places.size(); ++i)
    {
        const Vector3d x = at(built.cells, places[i]);
        if (x.minCoeff() < 0.25 || x.maxCoeff() > 0.75)
            continue;
        ++inside;
        EXPECT_LT((values[i].displacement - displacement(x)).norm(), 1e-12);
    }
    EXPECT_GT(inside, 1000u);
}

TEST(SmoothMap, gradients_are_those_of_the_values_and_do_not_jump_between_glued_cells)
{
    for (const support::Built& built : bodies())
    {
        const Lattice lattice = octree_lattice(built.octree, built.cells, 1.0);
        std::mt19937 rng(5);
        const VectorXd u = hung(lattice, support::random_field(lattice, rng, 1.0));
        // Both sides of each face at one place, and there a step to and fro along each
        // axis.
        const double step = 1e-6;
        std::vector<SmoothMap::Place> places;
        for (const Face& face : built.cells.faces)
        {
            const Cell &a = built.cells.cells[idx(face.a)],
                       &b = built.cells.cells[idx(face.b)];
            const Cell& smaller = a.edge < b.edge ? a : b;
            Vector3d x =
                smaller.box_centre + support::random_vector(rng, 0.49 * smaller.edge);
            x[face.axis] = a.box_centre[face.axis] + 0.5 * a.edge;
            for (const int cell : {face.a, face.b})
            {
                const Cell& of = built.cells.cells[idx(cell)];
                places.push_back(
                    {cell, (x - of.box_centre) / of.edge + Vector3d::Constant(0.5)});
            }
            const SmoothMap::Place from = places[places.size() - 2];
            for (int axis = 0; axis < 3; ++axis)
                for (const double sign : {-1.0, 1.0})
                    places.push_back({from.cell, from.local + sign * step / a.edge *
                                                                  Vector3d::Unit(axis)});
        }
        const auto values =
            SmoothMap(built.octree, built.cells, lattice, places).values(u);
        for (std::size_t f = 0; f < built.cells.faces.size(); ++f)
        {
            const SmoothMap::Value* const of = &values[8 * f];
            const double largest = std::max(of[0].gradient.norm(), 1.0);
            EXPECT_LT((of[0].displacement - of[1].displacement).norm(), 1e-9);
            EXPECT_LT((of[0].gradient - of[1].gradient).norm(), 1e-7 * largest);
            for (int axis = 0; axis < 3; ++axis)
                EXPECT_LT(
                    ((of[3 + 2 * axis].displacement - of[2 + 2 * axis].displacement) /
                         (2.0 * step) -
                     of[0].gradient.col(axis))
                        .norm(),
                    1e-3 * largest);
        }
    }
}

TEST(SmoothMap, fingers_that_share_boxes_do_not_move_each_other)
{
    const support::Built built = support::built(two_fingers(), 8, 0, Fill::Solid, 0.02);
    const Lattice lattice = octree_lattice(built.octree, built.cells, 1.0);
    const auto is_of = [&](int cell, double low, double high)
    {
        const Cell& of = built.cells.cells[idx(cell)];
        return of.box_centre.x() > 1.0 && of.centre.y() > low && of.centre.y() < high;
    };
    // The second finger turns away from its second cell on.
    std::vector<char> is_second(lattice.places.size(), 0);
    for (std::size_t c = 0; c < built.cells.size(); ++c)
        if (is_of(static_cast<int>(c), 0.5, 1.0))
            for (const int node : lattice.cells[c])
                is_second[idx(node)] = 1;
    VectorXd u = VectorXd::Zero(Eigen::Index(3 * lattice.places.size()));
    for (std::size_t n = 0; n < lattice.places.size(); ++n)
        if (is_second[n] && lattice.places[n].x() > 1.25)
            u.segment<3>(Eigen::Index(3 * n)) =
                Vector3d(0.0, 0.5 * (lattice.places[n].x() - 1.25), 0.0);
    const std::vector<SmoothMap::Place> places = random_places(built.cells, 4000);
    const auto values = SmoothMap(built.octree, built.cells, lattice, places).values(u);
    double most_of_first = 0.0, most_of_second = 0.0;
    for (std::size_t i = 0; i < places.size(); ++i)
        if (is_of(places[i].cell, 0.0, 0.5))
            most_of_first = std::max(most_of_first, values[i].displacement.norm());
        else if (is_of(places[i].cell, 0.5, 1.0))
            most_of_second = std::max(most_of_second, values[i].displacement.norm());
    EXPECT_GT(most_of_second, 1.0);
    EXPECT_LT(most_of_first, 0.02) << "beside the palm alone, where both are one";
}

TEST(SmoothMap, a_node_with_next_to_no_material_around_it_moves_nothing)
{
    // The last layer of cells is full to a twentieth.
    const support::Built built = support::built(
        support::box_shape({0, 0, 0}, {4, 1.05, 1.05}), 8, 0, Fill::Solid, 0.02);
    const Lattice lattice = octree_lattice(built.octree, built.cells, 1.0);
    std::vector<double> held(lattice.places.size(), 0.0);
    for (const LatticePart& part : lattice.parts)
        for (const int node : lattice.cells[idx(part.cell)])
            held[idx(node)] += part.volume / std::pow(lattice.edge(part.cell), 3);
    std::mt19937 rng(13);
    VectorXd u = VectorXd::Zero(Eigen::Index(3 * lattice.places.size()));
    std::size_t loose = 0;
    for (std::size_t n = 0; n < lattice.places.size(); ++n)
        if (held[n] < 0.45)
        {
            u.segment<3>(Eigen::Index(3 * n)) = support::random_vector(rng, 1.0);
            ++loose;
        }
    ASSERT_GT(loose, 4u); // the corners
    for (const SmoothMap::Value& value :
         SmoothMap(built.octree, built.cells, lattice, random_places(built.cells, 2000))
             .values(u))
        EXPECT_EQ(value.displacement, Vector3d::Zero());
}

TEST(SmoothMap, a_limb_thinner_than_a_cell_follows_its_own_nodes)
{
    // Two boxes that overlap: a block, and a limb whose section is a seventh of a cell's.
    Shape shape = support::box_shape({0, 0, 0}, {1, 1, 1});
    const Shape limb = support::box_shape({0.9, 0.4, 0.4}, {3, 0.6, 0.6});
    shape = support::joined(shape, limb);
    const support::Built built = support::built(shape, 6, 0, Fill::Solid, 0.02);
    const Lattice lattice = octree_lattice(built.octree, built.cells, 1.0);
    // The limb turns about its root.
    const VectorXd u =
        support::field_of(lattice,
                          [](const Vector3d& x) -> Vector3d {
                              return {0.0, std::max(0.0, x.x() - 1.0), 0.0};
                          });
    const std::vector<SmoothMap::Place> places = random_places(built.cells, 2000);
    const auto values = SmoothMap(built.octree, built.cells, lattice, places).values(u);
    for (std::size_t i = 0; i < places.size(); ++i)
    {
        const Vector3d x = at(built.cells, places[i]);
        EXPECT_NEAR(values[i].displacement.y(), std::max(0.0, x.x() - 1.0), 0.13) << x;
    }
}

TEST(SmoothMap, thread_count_changes_no_bit_and_no_places_are_no_values)
{
    const support::Built built = support::built_mixed(support::l_prism(), 7, 1, 3);
    const Lattice lattice = octree_lattice(built.octree, built.cells, 1.0);
    EXPECT_TRUE(SmoothMap(built.octree, built.cells, lattice, {})
                    .values(VectorXd::Zero(Eigen::Index(3 * lattice.places.size())))
                    .empty());
    const std::vector<SmoothMap::Place> places = random_places(built.cells, 3000);
    const SmoothMap map(built.octree, built.cells, lattice, places);
    std::mt19937 rng(9);
    const VectorXd u = hung(lattice, support::random_field(lattice, rng, 1.0));
    const auto all = map.values(u);
    const ThreadLimit one(1);
    const auto alone = map.values(u);
    for (std::size_t i = 0; i < places.size(); ++i)
    {
        EXPECT_EQ(all[i].displacement, alone[i].displacement);
        EXPECT_EQ(all[i].gradient, alone[i].gradient);
    }
}

} // namespace cellwarp::core
