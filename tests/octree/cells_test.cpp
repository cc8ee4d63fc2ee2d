// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/cells.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <tuple>

#include <gtest/gtest.h>

#include "octree/base/index.h"
#include "octree/nearest_sample.h"
#include "tests/support/shapes.h"

namespace cellwarp
{

using support::box_shape;
using support::built;
using support::Built;
using support::joined;

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
            if (const int piece = body.pieces.piece_of_voxel[voxel]; piece >= 0)
            {
                const VoxelBlock own =
                    voxel_block(body.material.grid.shape(),
                                body.octree[body.pieces.leaf_of_piece[idx(piece)]]);
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
        return two.pieces.piece_of_voxel[grid.index(grid.locate({x, 0.1, 0.1}))];
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

TEST(NearestSamples, are_measured_through_the_material)
{
    // A U: the tip of one leg is near the other leg, but far through the bend.
    const Shape u = joined(
        joined(box_shape({0, 0, 0}, {4, 0.4, 1}), box_shape({0, 0.6, 0}, {4, 1, 1})),
        box_shape({0, 0, 0}, {0.4, 1, 1}));
    const Built body = built(u, 8, 0, Fill::Solid, 0.05);
    const std::vector<Eigen::Vector3d> samples = {{4, 0.2, 0.5}, {0, 1, 0.5}};
    const VoxelNumbers<std::uint32_t> nearest =
        nearest_samples(body.material.grid, samples);
    const VoxelGrid& grid = body.material.grid;
    EXPECT_EQ(nearest[grid.index(grid.locate({3.9, 0.2, 0.5}))], 0u);
    EXPECT_EQ(nearest[grid.index(grid.locate({3.9, 0.8, 0.5}))], 1u);
    for (std::size_t i = 0; i < grid.size(); ++i)
        EXPECT_EQ(nearest[i] == kNoSample, !grid.material()[i]);
}

} // namespace cellwarp
