// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/field/rbf_systems.h"

#include <random>
#include <span>

#include <gtest/gtest.h>

#include "octree/base/parallel.h"
#include "solver/field/field.h"
#include "tests/support/bodies.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

using support::random_vector;

namespace
{

std::vector<Eigen::Vector3d> random_centres(unsigned seed, int count = 30)
{
    std::mt19937 rng(seed);
    std::vector<Eigen::Vector3d> centres;
    for (int i = 0; i < count; ++i)
        centres.push_back(random_vector(rng, 1.0));
    return centres;
}

/// What the system of these centres takes where it is kept.
std::size_t bytes_of(std::span<const Eigen::Vector3d> centres)
{
    RbfSystems one;
    (void)one.system_of(centres);
    return one.num_bytes();
}

/// A bar of 4 x 4 x 24 cells; those of the first \p layers are divided.
struct DividedBar
{
    explicit DividedBar(double layers)
    {
        std::vector<LeafNumber> near_end;
        for (const LeafNumber leaf : octree.numbers())
            if (material.grid.centre(octree[leaf].corner).z() < layers)
                near_end.push_back(leaf);
        octree = octree.split(near_end, material_test(material.grid));
        pieces = find_pieces(material.grid, octree);
        cells = build_cells(material.grid, octree, pieces, {}, {});
        for (const Cell& cell : cells.cells)
            poses.push_back(
                {Eigen::Matrix3d::Identity(),
                 cell.centre + Eigen::Vector3d(0.01 * cell.centre.z(), 0.0, 0.0)});
        constraints.resize(cells.size());
    }
    FieldFitter fitter(RbfSystems* systems) const
    {
        return {FieldKind::Rbf, cells, constraints, systems};
    }

    Shape shape = support::box_shape(Eigen::Vector3d::Zero(), {4, 4, 24}, 1);
    Material material = find_material(shape, bounding_surface(shape),
                                      grid_shape({4, 4, 24}, 24, 1, 0.0), Fill::Solid);
    Octree octree = Octree(material.grid.shape(), material_test(material.grid));
    Pieces pieces;
    Cells cells;
    std::vector<Pose> poses;
    std::vector<Constraint> constraints;
};

} // namespace

TEST(RbfSystems, of_the_same_centres_are_one)
{
    RbfSystems systems;
    const auto centres = random_centres(1), others = random_centres(2);
    const RbfSystems::Found first = systems.system_of(centres);
    EXPECT_TRUE(first.is_new && first.is_kept);
    const RbfSystems::Found again = systems.system_of(centres);
    EXPECT_FALSE(again.is_new);
    EXPECT_EQ(again.system, first.system);
    const RbfSystems::Found other = systems.system_of(others);
    EXPECT_TRUE(other.is_new);
    EXPECT_NE(other.system, first.system);
}

TEST(RbfSystems, of_zeros_that_differ_in_sign_are_two)
{
    RbfSystems systems;
    auto centres = random_centres(3);
    centres[4].y() = 0.0;
    const RbfSystems::Found first = systems.system_of(centres);
    centres[4].y() = -0.0;
    EXPECT_TRUE(systems.system_of(centres).is_new);
}

TEST(RbfSystems, that_nobody_holds_are_dropped_and_their_memory_with_them)
{
    RbfSystems systems;
    const auto centres = random_centres(4), others = random_centres(5, 50);
    RbfSystems::Found held = systems.system_of(centres);
    const std::size_t bytes = systems.num_bytes();
    EXPECT_GT(bytes, 0u);
    EXPECT_TRUE(systems.system_of(others).is_new);
    EXPECT_GT(systems.num_bytes(), 2 * bytes);
    systems.drop_unused();
    EXPECT_EQ(systems.num_bytes(), bytes);
    EXPECT_FALSE(systems.system_of(centres).is_new);
    EXPECT_TRUE(systems.system_of(others).is_new);
    held.system.reset();
    systems.drop_unused();
    EXPECT_EQ(systems.num_bytes(), 0u);
}

TEST(RbfSystems, are_not_kept_beyond_their_memory)
{
    const auto centres = random_centres(6), others = random_centres(7);
    RbfSystems systems(bytes_of(centres));
    const RbfSystems::Found held = systems.system_of(centres);
    EXPECT_TRUE(held.is_kept);
    const RbfSystems::Found other = systems.system_of(others);
    EXPECT_TRUE(other.is_new && !other.is_kept);
    EXPECT_TRUE(systems.system_of(others).is_new);
    EXPECT_FALSE(systems.system_of(centres).is_new);
    EXPECT_EQ(systems.num_bytes(), bytes_of(centres));
}

TEST(RbfSystems, that_nobody_holds_give_way_where_the_room_is_short)
{
    const auto centres = random_centres(8), others = random_centres(9);
    RbfSystems systems(bytes_of(centres));
    EXPECT_TRUE(systems.system_of(centres).is_kept);
    EXPECT_TRUE(systems.system_of(others).is_kept);
    EXPECT_EQ(systems.num_bytes(), bytes_of(others));
    const RbfSystems::Found held = systems.system_of(others);
    EXPECT_FALSE(held.is_new);
    EXPECT_FALSE(systems.system_of(centres).is_kept);
}

TEST(RbfSystems, that_are_forgotten_stay_with_who_holds_them)
{
    RbfSystems systems;
    const auto centres = random_centres(10);
    const RbfSystems::Found held = systems.system_of(centres);
    systems.clear();
    EXPECT_EQ(systems.num_bytes(), 0u);
    EXPECT_EQ(held.system->num_centres(), centres.size());
    EXPECT_TRUE(systems.system_of(centres).is_new);
}

TEST(RbfSystems, are_found_by_many_threads_at_once)
{
    RbfSystems systems;
    std::vector<std::vector<Eigen::Vector3d>> sets;
    for (unsigned seed = 0; seed < 8; ++seed)
        sets.push_back(random_centres(seed));
    std::vector<RbfSystems::Found> found(400);
    parallel_for(found.size(),
                 [&](std::size_t i) { found[i] = systems.system_of(sets[i % 8]); });
    for (std::size_t i = 0; i < found.size(); ++i)
        EXPECT_EQ(found[i].system, found[i % 8].system);
}

TEST(RbfSystems, far_from_where_cells_change_are_used_again_to_the_bit)
{
    const DividedBar coarse(0.0), fine(2.0);
    ASSERT_GT(fine.cells.size(), coarse.cells.size() + 100);
    RbfSystems systems;
    FieldFitter before = coarse.fitter(&systems);
    const Field first = before.fit(coarse.poses, {});
    EXPECT_EQ(before.num_factored(), first.num_clusters());
    FieldFitter fitter = fine.fitter(&systems);
    const Field field = fitter.fit(fine.poses, {});
    EXPECT_EQ(fitter.num_solved(), field.num_clusters());
    EXPECT_LT(fitter.num_factored(), field.num_clusters());
    const Field fresh =
        fit_field(FieldKind::Rbf, fine.cells, fine.poses, fine.constraints, {});
    for (const Cell& cell : fine.cells.cells)
    {
        const int own = static_cast<int>(&cell - fine.cells.cells.data());
        EXPECT_EQ(field.value(cell.centre, own).displacement,
                  fresh.value(cell.centre, own).displacement);
    }
}

TEST(RbfSystems, for_which_there_is_no_room_change_no_bit_of_a_fit)
{
    const DividedBar bar(1.0);
    RbfSystems all;
    FieldFitter keeping = bar.fitter(&all);
    const Field first = keeping.fit(bar.poses, {});
    RbfSystems none(0), some(all.num_bytes() / 2);
    std::vector<Pose> moved = bar.poses;
    for (Pose& pose : moved)
        pose.p.y() += 0.02 * pose.p.z();
    const Field kept = keeping.fit(moved, {});
    EXPECT_EQ(keeping.num_factored(), 0u);
    for (RbfSystems* const systems : {&none, &some})
    {
        FieldFitter fitter = bar.fitter(systems);
        (void)fitter.fit(bar.poses, {});
        const Field field = fitter.fit(moved, {});
        EXPECT_EQ(fitter.num_factored() == field.num_clusters(), systems == &none);
        EXPECT_LE(systems->num_bytes(), all.num_bytes() / 2);
        for (std::size_t c = 0; c < bar.cells.size(); ++c)
        {
            const Eigen::Vector3d& x = bar.cells.cells[c].centre;
            EXPECT_EQ(field.value(x, static_cast<int>(c)).displacement,
                      kept.value(x, static_cast<int>(c)).displacement);
        }
    }
}

} // namespace cellwarp::core
