// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/cells/refinement.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "octree/base/index.h"
#include "tests/support/random.h"
#include "tests/support/random_poses.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

using support::box_shape;
using support::joined;
using support::random_vector;

namespace
{

/// How much a cell's own rotation counts beside its neighbours: by so much of the strain
/// local_maps() is off constant strain.
constexpr double kOwn = 1e-3;

struct Cut
{
    Octree octree;
    Pieces pieces;
    Cells cells;
    Glue glue;
    std::vector<Constraint> constraints;
};

/// Material that is cut into cells in more than one way.
struct Block
{
    GridShape grid;
    Material material;
    MaterialTest has_material = material_test(material.grid);

    Block(const Shape& shape, const Eigen::Vector3d& size, int across, int depth,
          double max_voxel = 0.0)
        : grid(grid_shape(size, across, depth, max_voxel)),
          material(find_material(shape, bounding_surface(shape), grid, Fill::Solid))
    {
    }
    Block(const Block&) = delete;
    Block& operator=(const Block&) = delete;

    Octree coarsest() const { return {grid, has_material}; }
    Cut cut(const Octree& octree) const
    {
        Pieces pieces = find_pieces(material.grid, octree);
        Cells cells = build_cells(material.grid, octree, pieces);
        Glue glue = build_glue(cells, {});
        std::vector<Constraint> free(cells.size());
        return {octree, std::move(pieces), std::move(cells), std::move(glue),
                std::move(free)};
    }
    std::vector<Pose> handed_on(const Cut& from, const std::vector<Pose>& poses,
                                const std::vector<LocalMap>& maps, const Cut& to) const
    {
        return cellwarp::core::handed_on(material.grid, from.pieces, from.cells, poses,
                                         maps, to.octree, to.pieces, to.cells);
    }
};

/// A box of the given size, in units of the coarsest cells.
Block box_of(int nx, int ny, int nz, int depth)
{
    const Eigen::Vector3d size(nx, ny, nz);
    return {box_shape({0, 0, 0}, size, 1), size, size.cast<int>().maxCoeff(), depth};
}

/// A map of space and its derivative.
struct Map
{
    std::function<Eigen::Vector3d(const Eigen::Vector3d&)> value;
    std::function<Eigen::Matrix3d(const Eigen::Vector3d&)> gradient;
};

Eigen::Matrix3d polar(const Eigen::Matrix3d& F)
{
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(F, Eigen::ComputeFullU |
                                                       Eigen::ComputeFullV);
    return svd.matrixU() * svd.matrixV().transpose();
}

/// The cells agree with the map in their anchors, and turn as it does there.
std::vector<Pose> following(const Cells& cells, const Map& map)
{
    std::vector<Pose> poses;
    for (const Cell& cell : cells.cells)
    {
        const Eigen::Matrix3d R = polar(map.gradient(cell.anchor));
        poses.push_back({R, map.value(cell.anchor) + R * (cell.centre - cell.anchor)});
    }
    return poses;
}

Map affine(const Eigen::Matrix3d& F, const Eigen::Vector3d& t)
{
    return {[=](const Eigen::Vector3d& x) -> Eigen::Vector3d { return F * x + t; },
            [=](const Eigen::Vector3d&) { return F; }};
}

/// Turned, stretched and sheared.
Eigen::Matrix3d some_strain(std::mt19937& rng)
{
    Eigen::Matrix3d U = Eigen::Matrix3d::Identity();
    for (int k = 0; k < 3; ++k)
        U.col(k) += random_vector(rng, 0.2);
    return support::random_rotation(rng) * U;
}

Map rigid(const Motion& motion)
{
    return affine(motion.R, motion.t);
}

Motion random_motion(std::mt19937& rng)
{
    const Eigen::Matrix3d R = support::random_rotation(rng);
    return {R, random_vector(rng, 2.0)};
}

/// The largest gap between two cells in the middle of their face.
double largest_plain_gap(const Cells& cells, const std::vector<Pose>& poses)
{
    double largest = 0.0;
    for (const Face& face : cells.faces)
    {
        const std::size_t a = idx(face.a);
        const std::size_t b = idx(face.b);
        largest = std::max(largest, (image(poses[a], cells.cells[a].centre, face.centre) -
                                     image(poses[b], cells.cells[b].centre, face.centre))
                                        .norm());
    }
    return largest;
}

double largest_of(const std::vector<double>& values)
{
    return *std::max_element(values.begin(), values.end());
}

/// Two cells wide, one half split.
Octree half_split(const Block& block)
{
    const Octree coarse = block.coarsest();
    std::vector<LeafNumber> leaves;
    for (std::size_t i = 0; i < coarse.leaves().size(); ++i)
        if (coarse.leaves()[i].corner.x() >= 2 * coarse.width(coarse.leaves()[i]))
            leaves.push_back(LeafNumber(i));
    return coarse.split(leaves, block.has_material);
}

double apart(const Pose& a, const Pose& b)
{
    return (a.R - b.R).norm() + (a.p - b.p).norm();
}

} // namespace

TEST(Refinement, a_map_of_constant_strain_is_found_around_cells_of_one_size_and_of_two)
{
    std::mt19937 rng(1);
    const Block block = box_of(4, 4, 4, 1);
    for (const Octree& octree : {block.coarsest(), half_split(block)})
    {
        const Cut cut = block.cut(octree);
        SCOPED_TRACE(cut.cells.size());
        for (int trial = 0; trial < 5; ++trial)
        {
            const Eigen::Matrix3d F = some_strain(rng), R = polar(F);
            const Map map = affine(F, random_vector(rng, 2.0));
            const std::vector<Pose> poses = following(cut.cells, map);
            const std::vector<LocalMap> maps =
                local_maps(cut.cells, cut.glue, cut.constraints, poses);
            for (std::size_t c = 0; c < maps.size(); ++c)
            {
                const Cell& cell = cut.cells.cells[c];
                EXPECT_LT((maps[c].place - map.value(cell.anchor)).norm(), 1e-12);
                EXPECT_LT(maps[c].turning.norm(), 1e-12);
                // A neighbour on one side only is half of what two are.
                EXPECT_LT((maps[c].gradient - F).norm(), 3.0 * kOwn * (F - R).norm());
                const bool is_inside = (cell.anchor.array() > 1.0).all() &&
                                       (cell.anchor.array() < 3.0).all();
                if (is_inside && octree.leaves().size() == 64u)
                {
                    EXPECT_LT((maps[c].gradient - (F + kOwn * R) / (1.0 + kOwn)).norm(),
                              1e-12);
                }
            }
        }
    }
}

TEST(Refinement, a_rigid_motion_is_found_to_rounding)
{
    std::mt19937 rng(2);
    const Block block = box_of(4, 2, 2, 1);
    const Cut cut = block.cut(half_split(block));
    const Motion motion = random_motion(rng);
    const std::vector<Pose> poses = following(cut.cells, rigid(motion));
    for (const LocalMap& map : local_maps(cut.cells, cut.glue, cut.constraints, poses))
        EXPECT_LT((map.gradient - motion.R).norm(), 1e-12);
    EXPECT_LT(largest_of(cell_errors(cut.cells, cut.glue, cut.constraints, poses)),
              1e-12);
}

TEST(Refinement, where_there_are_no_neighbours_a_cell_goes_by_its_own_rotation)
{
    std::mt19937 rng(3);
    const Block block = box_of(6, 1, 1, 0);
    const Cut row = block.cut(block.coarsest());
    std::vector<Pose> poses;
    for (std::size_t c = 0; c < row.cells.size(); ++c)
        poses.push_back(support::random_pose(rng, 3.0));
    const std::vector<LocalMap> maps =
        local_maps(row.cells, row.glue, row.constraints, poses);
    for (std::size_t c = 0; c < maps.size(); ++c)
    {
        EXPECT_LT((maps[c].gradient.col(1) - poses[c].R.col(1)).norm(), 1e-12);
        EXPECT_LT((maps[c].gradient.col(2) - poses[c].R.col(2)).norm(), 1e-12);
        EXPECT_GT((maps[c].gradient.col(0) - poses[c].R.col(0)).norm(), 0.1);
        EXPECT_LT(maps[c].turning.rightCols<2>().norm(), 1e-12);
    }
}

TEST(Refinement, prescribed_and_idle_cells_move_as_rigid_bodies)
{
    std::mt19937 rng(4);
    const Block block = box_of(4, 2, 2, 0);
    Cut cut = block.cut(block.coarsest());
    const std::vector<Pose> poses =
        following(cut.cells, affine(some_strain(rng), {1, 2, 3}));
    cut.constraints[3].hold = Hold::Prescribed;
    cut.constraints[5].hold = Hold::Idle;
    cut.constraints[7].hold = Hold::Pinned;
    const std::vector<LocalMap> maps =
        local_maps(cut.cells, cut.glue, cut.constraints, poses);
    for (const std::size_t c : {std::size_t(3), std::size_t(5)})
    {
        EXPECT_EQ(maps[c].gradient, poses[c].R);
        EXPECT_EQ(maps[c].turning, Eigen::Matrix3d::Zero());
    }
    EXPECT_GT((maps[7].gradient - poses[7].R).norm(), 0.01);
}

TEST(Refinement, a_prescribed_neighbour_is_looked_at_where_its_glue_ends)
{
    // It ends a fifth of a cell before the free one: from there on the row is stretched.
    const Block block = box_of(4, 1, 1, 0);
    Cut row = block.cut(block.coarsest());
    row.constraints[0].hold = Hold::Prescribed;
    std::vector<BorderGlue> borders;
    for (std::size_t f = 0; f < row.cells.faces.size(); ++f)
        if (row.cells.faces[f].a == 0)
            borders.push_back({static_cast<int>(f), 0.7, true});
    ASSERT_EQ(borders.size(), 1u);
    row.glue = build_glue(row.cells, {}, borders);
    const double stretch = 1.5;
    std::vector<Pose> poses;
    for (const Cell& cell : row.cells.cells)
        poses.push_back({Eigen::Matrix3d::Identity(), cell.centre});
    for (std::size_t c = 1; c < 4; ++c)
        poses[c].p.x() = 0.8 + stretch * (poses[c].p.x() - 0.8);
    const std::vector<LocalMap> maps =
        local_maps(row.cells, row.glue, row.constraints, poses);
    EXPECT_NEAR(maps[1].gradient(0, 0), stretch, 3.0 * kOwn * 0.5);
    const std::vector<double> errors =
        cell_errors(row.cells, row.glue, row.constraints, poses);
    for (std::size_t c = 1; c < 4; ++c)
        EXPECT_LT(errors[c], kOwn);
}

TEST(Refinement, constant_strain_is_a_thousandth_of_an_error)
{
    std::mt19937 rng(5);
    const Block block = box_of(4, 4, 4, 1);
    for (const Octree& octree : {block.coarsest(), half_split(block)})
    {
        const Cut cut = block.cut(octree);
        const std::vector<Pose> poses =
            following(cut.cells, affine(some_strain(rng), {1, 2, 3}));
        EXPECT_LT(largest_of(cell_errors(cut.cells, cut.glue, cut.constraints, poses)),
                  kOwn * largest_plain_gap(cut.cells, poses));
        EXPECT_GT(largest_plain_gap(cut.cells, poses), 0.1);
    }
}

TEST(Refinement, errors_of_a_curved_map_fall_fourfold_a_level_where_gaps_halve)
{
    const Map curved = {
        [](const Eigen::Vector3d& x) -> Eigen::Vector3d
        { return x + 0.05 * Eigen::Vector3d(x.x() * x.x(), x.x() * x.y(), 0.0); },
        [](const Eigen::Vector3d& x)
        {
            Eigen::Matrix3d F = Eigen::Matrix3d::Identity();
            F(0, 0) += 0.1 * x.x();
            F(1, 0) += 0.05 * x.y();
            F(1, 1) += 0.05 * x.x();
            return F;
        }};
    const Block block = box_of(4, 4, 4, 2);
    double last_error = 0.0, last_gap = 0.0;
    for (int level = 0; level <= 2; ++level)
    {
        SCOPED_TRACE(level);
        const Cut cut = block.cut(block.coarsest().split_all(level, block.has_material));
        const std::vector<Pose> poses = following(cut.cells, curved);
        const double error =
            largest_of(cell_errors(cut.cells, cut.glue, cut.constraints, poses));
        const double gap = largest_plain_gap(cut.cells, poses);
        if (level == 0)
        {
            // Half of the second derivative times the step squared, at half the step.
            EXPECT_NEAR(error, 0.25 * 0.05, 0.15 * 0.25 * 0.05);
        }
        else
        {
            EXPECT_GT(last_error / error, 3.5);
            EXPECT_LT(last_error / error, 4.5);
            EXPECT_GT(last_gap / gap, 1.7);
            EXPECT_LT(last_gap / gap, 2.3);
        }
        last_error = error;
        last_gap = gap;
    }
}

TEST(Refinement, what_stays_keeps_its_pose_to_the_bit)
{
    std::mt19937 rng(6);
    const Block block = box_of(4, 2, 2, 1);
    const Cut coarse = block.cut(block.coarsest());
    const Cut finer = block.cut(block.coarsest().split(
        std::vector{LeafNumber{2}, LeafNumber{9}}, block.has_material));
    std::vector<Pose> poses;
    for (std::size_t c = 0; c < coarse.cells.size(); ++c)
        poses.push_back(support::random_pose(rng, 5.0));
    const std::vector<LocalMap> maps =
        local_maps(coarse.cells, coarse.glue, coarse.constraints, poses);
    const std::vector<Pose> next = block.handed_on(coarse, poses, maps, finer);
    std::size_t num_kept = 0;
    const auto expect_kept = [&](const Cut& from, const std::vector<Pose>& old,
                                 const Cut& to, const std::vector<Pose>& now)
    {
        for (std::size_t c = 0; c < to.cells.size(); ++c)
            for (std::size_t o = 0; o < from.cells.size(); ++o)
                if (to.cells.cells[c].anchor == from.cells.cells[o].anchor)
                {
                    ++num_kept;
                    EXPECT_EQ(now[c].R, old[o].R);
                    EXPECT_EQ(now[c].p, old[o].p);
                }
    };
    expect_kept(coarse, poses, finer, next);
    EXPECT_EQ(num_kept, 14u);
    const std::vector<Pose> back = block.handed_on(
        finer, next, local_maps(finer.cells, finer.glue, finer.constraints, next),
        coarse);
    num_kept = 0;
    expect_kept(finer, next, coarse, back);
    EXPECT_EQ(num_kept, 14u);
}

TEST(Refinement, children_follow_the_map_of_their_parent)
{
    std::mt19937 rng(7);
    const Block block = box_of(4, 2, 2, 1);
    const Cut coarse = block.cut(block.coarsest());
    const Cut finer = block.cut(block.coarsest().split_all(1, block.has_material));
    for (int trial = 0; trial < 5; ++trial)
    {
        const Eigen::Matrix3d F = some_strain(rng);
        const Map map = affine(F, random_vector(rng, 2.0));
        const std::vector<Pose> poses = following(coarse.cells, map);
        const std::vector<Pose> wanted = following(finer.cells, map);
        std::vector<LocalMap> exact;
        for (const Cell& cell : coarse.cells.cells)
            exact.push_back({map.value(cell.anchor), F, Eigen::Matrix3d::Zero()});
        const std::vector<Pose> next = block.handed_on(coarse, poses, exact, finer);
        const std::vector<Pose> found = block.handed_on(
            coarse, poses,
            local_maps(coarse.cells, coarse.glue, coarse.constraints, poses), finer);
        for (std::size_t c = 0; c < next.size(); ++c)
        {
            EXPECT_LT(apart(next[c], wanted[c]), 1e-12);
            EXPECT_LT(apart(found[c], wanted[c]), 3.0 * kOwn);
        }
    }
}

TEST(Refinement, children_of_a_row_that_winds_turn_on_the_way)
{
    const Block block = box_of(6, 1, 1, 1);
    const Cut coarse = block.cut(block.coarsest());
    const Cut finer = block.cut(block.coarsest().split_all(1, block.has_material));
    const double rate = 0.3; // [rad] a cell
    const auto turned = [&](double x)
    { return rotation_about(Eigen::Vector3d::UnitX(), rate * x); };
    std::vector<Pose> poses;
    for (const Cell& cell : coarse.cells.cells)
        poses.push_back(
            {turned(cell.anchor.x()), cell.centre - Eigen::Vector3d(0, 0.5, 0.5)});
    const std::vector<Pose> next = block.handed_on(
        coarse, poses, local_maps(coarse.cells, coarse.glue, coarse.constraints, poses),
        finer);
    for (std::size_t c = 0; c < next.size(); ++c)
        EXPECT_LT((next[c].R - turned(finer.cells.cells[c].anchor.x())).norm(),
                  3.0 * kOwn * rate);
}

TEST(Refinement, children_of_one_rigid_motion_merge_to_that_motion)
{
    std::mt19937 rng(8);
    const Block block = box_of(4, 2, 2, 1);
    const Cut coarse = block.cut(block.coarsest());
    const Cut finer = block.cut(block.coarsest().split_all(1, block.has_material));
    for (int trial = 0; trial < 5; ++trial)
    {
        const Map motion = rigid(random_motion(rng));
        const std::vector<Pose> poses = following(finer.cells, motion);
        const std::vector<Pose> wanted = following(coarse.cells, motion);
        const std::vector<Pose> merged = block.handed_on(
            finer, poses, local_maps(finer.cells, finer.glue, finer.constraints, poses),
            coarse);
        for (std::size_t c = 0; c < merged.size(); ++c)
            EXPECT_LT(apart(merged[c], wanted[c]), 1e-12);
    }
}

TEST(Refinement, pieces_of_one_box_keep_their_own_motions)
{
    // Two slabs; the lower halves of the boxes hold both, the upper ones only one.
    std::mt19937 rng(9);
    const Block block(
        joined(box_shape({0, 0, 0}, {4, 0.2, 1}), box_shape({0, 0.3, 0}, {4, 1, 1})),
        {4, 1, 1}, 4, 1, 0.02);
    const Cut coarse = block.cut(block.coarsest());
    const Cut finer = block.cut(block.coarsest().split_all(1, block.has_material));
    ASSERT_EQ(coarse.cells.size(), 8u);
    ASSERT_EQ(finer.cells.size(), 8u * 6u);
    const Map motions[] = {rigid(random_motion(rng)), rigid(random_motion(rng))};
    const auto moved_apart = [&](const Cells& cells)
    {
        const std::vector<Pose> low = following(cells, motions[0]);
        std::vector<Pose> poses = following(cells, motions[1]);
        for (std::size_t c = 0; c < poses.size(); ++c)
            if (cells.cells[c].centre.y() < 0.25)
                poses[c] = low[c];
        return poses;
    };
    const auto expect_handed_on = [&](const Cut& from, const Cut& to)
    {
        const std::vector<Pose> poses = moved_apart(from.cells);
        const std::vector<Pose> wanted = moved_apart(to.cells);
        const std::vector<Pose> next = block.handed_on(
            from, poses, local_maps(from.cells, from.glue, from.constraints, poses), to);
        for (std::size_t c = 0; c < next.size(); ++c)
            EXPECT_LT(apart(next[c], wanted[c]), 1e-12);
    };
    expect_handed_on(coarse, finer);
    expect_handed_on(finer, coarse);
}

} // namespace cellwarp::core
