// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/cells.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <tuple>

#include <gtest/gtest.h>

#include "octree/base/index.h"
#include "octree/notches.h"
#include "tests/support/bodies.h"
#include "tests/support/random.h"
#include "tests/support/random_poses.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

using support::box_shape;
using support::built;
using support::Built;
using support::joined;
using support::turned;

TEST(Cells, of_a_bar_are_cubes_with_known_moments)
{
    const Built bar = support::bar(2, 2, 8);
    ASSERT_EQ(bar.cells.size(), 32u);
    for (const Cell& cell : bar.cells.cells)
    {
        EXPECT_NEAR(cell.volume, 1.0, 1e-12);
        EXPECT_LT((cell.centre - cell.box_centre).norm(), 1e-12);
        EXPECT_LT((cell.second_moment - Eigen::Matrix3d::Identity() / 12.0).norm(),
                  1e-12);
    }
    EXPECT_EQ(bar.cells.faces.size(), 2u * 16u + 28u);
    for (const Face& face : bar.cells.faces)
    {
        EXPECT_NEAR(face.area, 1.0, 1e-12);
        EXPECT_NEAR(face.distance, 1.0, 1e-12);
    }
}

TEST(Cells, moments_are_those_of_the_material)
{
    // The upper half of the leaf is empty: centroid, volume and moment follow.
    const Built slab = built(box_shape({0, 0, 0}, {4, 4, 1.5}), 4, 0, Fill::Solid, 0.05);
    double volume = 0.0;
    for (const Cell& cell : slab.cells.cells)
    {
        volume += cell.volume;
        EXPECT_NEAR(cell.volume, 0.75, 1e-9);
        EXPECT_NEAR(cell.second_moment(2, 2), 0.75 * 0.75 / 12.0, 1e-9);
        EXPECT_NEAR(std::abs(cell.centre.z() - 0.75), 0.375, 1e-9);
    }
    EXPECT_NEAR(volume, 24.0, 1e-9);
}

TEST(Cells, of_a_rough_shape_are_glued_where_their_boxes_touch_and_mirrored_alike)
{
    // A rough surface leaves crumbs in the corners of boxes.
    Shape shape = box_shape({0, 0, 0}, {2, 1, 1}, 12);
    std::mt19937 rng(9);
    for (Eigen::Vector3d& x : shape.samples)
        x += support::random_vector(rng, 0.06);
    Eigen::Vector3d low = shape.samples[0], high = low;
    for (const Eigen::Vector3d& x : shape.samples)
    {
        low = low.cwiseMin(x);
        high = high.cwiseMax(x);
    }
    for (Eigen::Vector3d& x : shape.samples)
        x -= low;
    Shape mirrored = shape;
    for (Eigen::Vector3d& x : mirrored.samples)
        x.x() = high.x() - low.x() - x.x();
    for (Triangle& triangle : mirrored.triangles)
        std::swap(triangle[1], triangle[2]);
    std::vector<double> areas[2];
    std::size_t num_crumbs = 0;
    for (const bool is_mirrored : {false, true})
    {
        const Built body =
            built(is_mirrored ? mirrored : shape, 10, 1, Fill::Solid, 0.01);
        std::set<std::tuple<int, int, int>> pairs;
        for (const Face& face : body.cells.faces)
        {
            const auto block = [&](int cell)
            {
                return voxel_block(body.material.grid.shape(),
                                   body.octree[body.cells.cells[idx(cell)].leaf]);
            };
            const VoxelBlock below = block(face.a), above = block(face.b);
            ASSERT_EQ(below.first[face.axis] + below.width, above.first[face.axis]);
            EXPECT_TRUE(pairs.emplace(face.a, face.axis, face.b).second);
            areas[is_mirrored].push_back(face.area);
        }
        for (std::size_t voxel = 0; voxel < body.material.grid.size(); ++voxel)
            if (const int piece = body.pieces.at(body.material.grid, voxel); piece >= 0)
            {
                const VoxelBlock own = voxel_block(body.material.grid.shape(),
                                                   body.octree[body.pieces.leaf(piece)]);
                const Eigen::Vector3i v = body.material.grid.coordinates(voxel);
                num_crumbs += (v.array() < own.first.array()).any() ||
                              (v.array() >= own.first.array() + own.width).any();
            }
        std::sort(areas[is_mirrored].begin(), areas[is_mirrored].end());
    }
    EXPECT_GT(num_crumbs, 0u);
    ASSERT_EQ(areas[0].size(), areas[1].size());
    for (std::size_t f = 0; f < areas[0].size(); ++f)
        EXPECT_NEAR(areas[0][f], areas[1][f], 1e-9);
}

TEST(Cells, faces_add_up_to_the_sections)
{
    const Built uniform = built(box_shape({0, 0, 0}, {4, 1, 1}), 8, 1, Fill::Solid, 0.1);
    std::vector<double> area(3, 0.0);
    for (const Face& face : uniform.cells.faces)
        area[idx(face.axis)] += face.area;
    EXPECT_NEAR(area[0], 15.0 * 1.0, 1e-9);
    EXPECT_NEAR(area[1], 3.0 * 4.0, 1e-9);
    EXPECT_NEAR(area[2], 3.0 * 4.0, 1e-9);
}

TEST(Cells, two_fingers_in_one_leaf_are_two_cells)
{
    const Shape fingers =
        joined(box_shape({0, 0, 0}, {4, 0.45, 1}), box_shape({0, 0.55, 0}, {4, 1, 1}));
    const Built two = built(fingers, 4, 0, Fill::Solid, 0.02);
    EXPECT_EQ(two.octree.leaves().size(), 4u);
    EXPECT_EQ(two.cells.size(), 8u);
    const std::vector<int> components = connected_components(two.cells);
    EXPECT_EQ(*std::max_element(components.begin(), components.end()), 1);
    for (const Face& face : two.cells.faces)
        EXPECT_EQ(components[idx(face.a)], components[idx(face.b)]);
}

TEST(Cells, a_crumb_beside_another_piece_belongs_to_its_neighbour)
{
    // A thin bar reaches by a voxel into a leaf that holds part of a block.
    const Shape shape =
        joined(box_shape({0, 0, 0}, {2.03, 0.3, 0.3}), box_shape({2.3, 0, 0}, {4, 1, 1}));
    const Built two = built(shape, 4, 0, Fill::Solid, 0.04);
    EXPECT_EQ(two.octree.leaves().size(), 4u);
    ASSERT_EQ(two.cells.size(), 4u);
    const VoxelGrid& grid = two.material.grid;
    const auto cell_at = [&](double x) {
        return two.pieces.at(grid, grid.locate({x, 0.1, 0.1}));
    };
    EXPECT_EQ(cell_at(2.02), cell_at(1.5));
    EXPECT_NE(cell_at(2.02), cell_at(2.5));
    const std::vector<int> components = connected_components(two.cells);
    EXPECT_EQ(*std::max_element(components.begin(), components.end()), 1);
    for (const Face& face : two.cells.faces)
        EXPECT_NE(face.a, face.b);
}

TEST(Cells, cells_that_meet_at_an_edge_only_are_not_glued)
{
    const Shape diagonal =
        joined(box_shape({0, 0, 0}, {1, 1, 1}), box_shape({1.2, 1.2, 0}, {2, 2, 1}));
    const Built two = built(diagonal, 2, 0, Fill::Solid, 0.05);
    const std::vector<int> components = connected_components(two.cells);
    EXPECT_EQ(*std::max_element(components.begin(), components.end()), 1);
}

TEST(Cells, neighbours_are_symmetric)
{
    const Built bar = built(box_shape({0, 0, 0}, {3, 1, 2}), 6, 0);
    for (int a = 0; a < static_cast<int>(bar.cells.size()); ++a)
        for (const int b : bar.cells.neighbours_of(a))
        {
            const auto back = bar.cells.neighbours_of(b);
            EXPECT_TRUE(std::find(back.begin(), back.end(), a) != back.end());
        }
}

TEST(Cells, neighbours_of_different_size_share_their_true_area)
{
    const Shape shape = box_shape({0, 0, 0}, {2, 1, 1});
    const GridShape grid = grid_shape({2, 1, 1}, 2, 1, 0.0);
    const Material material =
        find_material(shape, bounding_surface(shape), grid, Fill::Solid);
    const MaterialTest test = material_test(material.grid);
    const Octree octree = Octree(grid, test).split(std::vector{LeafNumber{0}}, test);
    const Cells cells =
        build_cells(material.grid, octree, find_pieces(material.grid, octree));
    ASSERT_EQ(cells.size(), 9u);
    int num_large = 0;
    for (const Face& face : cells.faces)
    {
        const bool is_large =
            cells.cells[idx(face.a)].edge > 0.9 || cells.cells[idx(face.b)].edge > 0.9;
        num_large += is_large;
        EXPECT_NEAR(face.area, 0.25, 1e-12);
        if (is_large)
        {
            EXPECT_NEAR(face.distance, 0.75, 1e-12);
        }
    }
    EXPECT_EQ(num_large, 4);
}

namespace
{

void expect_same(const VoxelGrid& grid, const Octree& octree, const Pieces& a,
                 const Pieces& b)
{
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t voxel = 0; voxel < grid.size(); ++voxel)
        ASSERT_EQ(a.at(grid, voxel), b.at(grid, voxel));
    for (std::size_t box = 0; box < grid.num_boxes(); ++box)
        ASSERT_EQ(a.leaf_of_box(box), b.leaf_of_box(box));
    for (const LeafNumber leaf : octree.numbers())
    {
        EXPECT_EQ(a.first(leaf), b.first(leaf));
        EXPECT_EQ(a.end(leaf), b.end(leaf));
        EXPECT_EQ(a.only(leaf), b.only(leaf));
        EXPECT_EQ(a.is_full(leaf), b.is_full(leaf));
        EXPECT_EQ(a.shares_crumbs(leaf), b.shares_crumbs(leaf));
    }
}

void expect_same(const Cells& a, const Cells& b)
{
    EXPECT_EQ(a.corner, b.corner);
    EXPECT_EQ(a.first_neighbour, b.first_neighbour);
    EXPECT_EQ(a.neighbours, b.neighbours);
    ASSERT_EQ(a.cells.size(), b.cells.size());
    for (std::size_t c = 0; c < a.cells.size(); ++c)
    {
        const Cell &one = a.cells[c], &other = b.cells[c];
        ASSERT_EQ(one.leaf, other.leaf);
        EXPECT_EQ(one.box_centre, other.box_centre);
        EXPECT_EQ(one.edge, other.edge);
        EXPECT_EQ(one.centre, other.centre);
        EXPECT_EQ(one.anchor, other.anchor);
        EXPECT_EQ(one.volume, other.volume);
        EXPECT_EQ(one.second_moment, other.second_moment);
        EXPECT_EQ(one.middle, other.middle);
    }
    ASSERT_EQ(a.faces.size(), b.faces.size());
    for (std::size_t f = 0; f < a.faces.size(); ++f)
    {
        const Face &one = a.faces[f], &other = b.faces[f];
        ASSERT_EQ(std::tuple(one.a, one.axis, one.b),
                  std::tuple(other.a, other.axis, other.b));
        EXPECT_EQ(one.area, other.area);
        EXPECT_EQ(one.centre, other.centre);
        EXPECT_EQ(one.distance, other.distance);
        EXPECT_EQ(one.turning, other.turning);
        EXPECT_EQ(one.sheet_share, other.sheet_share);
        EXPECT_EQ(one.contact, other.contact);
    }
}

/// Some leaves of an octree.
std::vector<LeafNumber> some_of(const Octree& octree, double share, std::mt19937& rng)
{
    std::vector<LeafNumber> some;
    for (const LeafNumber leaf : octree.numbers())
        if (support::random_number(rng, 0.0, 1.0) < share)
            some.push_back(leaf);
    return some;
}

} // namespace

TEST(Cells, made_from_earlier_ones_are_those_made_from_nothing_to_the_bit)
{
    std::mt19937 rng(17);
    Shape rough = box_shape({0, 0, 0}, {2, 1, 1}, 12); // leaves crumbs
    for (Eigen::Vector3d& x : rough.samples)
        x += Eigen::Vector3d::Constant(0.06) + support::random_vector(rng, 0.06);
    Shape soup = box_shape({0, 0, 0}, {2, 1, 1}, 9);
    std::erase_if(soup.triangles,
                  [&](const Triangle&) { return support::random_number(rng, 0, 3) < 1; });
    Shape beside = support::sheet_shape(3.0, 1.0, 6); // of a box
    for (Eigen::Vector3d& x : beside.samples)
        x.z() += 0.4;
    const Shape with_sheet = joined(box_shape({0, 0, 0}, {1, 1, 1}), beside);
    std::size_t num_crumbs = 0, num_sheets = 0, num_taken = 0;
    bool has_notches = false;
    for (const Shape& shape :
         {support::l_prism(), support::comb(),
          turned(support::comb(), support::random_rotation(rng)), rough,
          turned(rough, support::random_rotation(rng)), soup, with_sheet,
          turned(with_sheet, support::random_rotation(rng))})
    {
        Eigen::Vector3d high = Eigen::Vector3d::Zero();
        for (const Eigen::Vector3d& x : shape.samples)
            high = high.cwiseMax(x);
        const BoundingSurface surface = bounding_surface(shape);
        const Material material = find_material(
            shape, surface, grid_shape(high, 6, 2, 0.01 * high.norm()), Fill::Solid);
        const VoxelGrid& grid = material.grid;
        const Sheets sheets = find_sheets(shape, surface, material, 0.01 * high.norm());
        num_sheets += sheets.crossings.size();
        const MaterialTest test = material_test(grid);
        Octree octree(grid.shape(), test);
        const Notches notches = find_notches(shape, surface, grid);
        has_notches |= !notches.empty();
        Pieces pieces = find_pieces(grid, octree, notches);
        Cells cells =
            build_cells(grid, octree, pieces, material.is_sheet, sheets, notches);
        for (int step = 0; step < 6; ++step)
        {
            const std::vector<LeafNumber> some = some_of(octree, 0.1, rng);
            Octree next = step % 3 == 2 ? octree.merge(some) : octree.split(some, test);
            for (const LeafNumber from : next.numbers_in(octree))
                num_taken += from != LeafNumber::None;
            Pieces recut = find_pieces(grid, next, notches, octree, pieces);
            const Pieces anew = find_pieces(grid, next, notches);
            expect_same(grid, next, recut, anew);
            const EarlierCells earlier{octree, pieces, cells};
            Cells recut_cells = build_cells(grid, next, recut, material.is_sheet, sheets,
                                            notches, &earlier);
            expect_same(recut_cells, build_cells(grid, next, anew, material.is_sheet,
                                                 sheets, notches));
            for (const LeafNumber leaf : next.numbers())
                num_crumbs += recut.shares_crumbs(leaf);
            octree = std::move(next);
            pieces = std::move(recut);
            cells = std::move(recut_cells);
        }
    }
    EXPECT_GT(num_crumbs, 0u);
    EXPECT_GT(num_sheets, 0u);
    EXPECT_GT(num_taken, 1000u);
    EXPECT_TRUE(has_notches);
}

} // namespace cellwarp::core
