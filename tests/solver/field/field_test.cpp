// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/field/field.h"

#include <algorithm>
#include <cmath>
#include <span>

#include <gtest/gtest.h>

#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "tests/support/bodies.h"
#include "tests/support/counted_stop.h"
#include "tests/support/random.h"
#include "tests/support/random_poses.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

using support::Built;
using support::random_number;
using support::random_vector;

namespace
{

int own_cell(const Built& built, const Eigen::Vector3d& x)
{
    const VoxelGrid& grid = built.material.grid;
    return built.pieces.at(grid, grid.locate(x));
}

/// Smoothly varying poses: a bar along z, twisted.
std::vector<Pose> twisted(const Built& bar, double rate)
{
    std::vector<Pose> poses;
    for (const Cell& cell : bar.cells.cells)
    {
        const Eigen::Matrix3d R =
            rotation_about(Eigen::Vector3d::UnitZ(), rate * cell.centre.z());
        const Eigen::Vector3d axis(1.5, 1.5, 0);
        poses.push_back({R, axis + R * (cell.centre - axis)});
    }
    return poses;
}

std::vector<Pose> rigid(const Built& bar, const Motion& motion)
{
    std::vector<Pose> poses;
    for (const Cell& cell : bar.cells.cells)
        poses.push_back(carried(motion, cell.centre));
    return poses;
}

void expect_gradient_of_differences(const Field& field, const Eigen::Vector3d& x, int own)
{
    const Eigen::Matrix3d gradient = field.value(x, own).gradient;
    for (int k = 0; k < 3; ++k)
    {
        const Eigen::Vector3d h = 1e-6 * Eigen::Vector3d::Unit(k);
        const Eigen::Vector3d slope = (field.value(x + h, own).displacement -
                                       field.value(x - h, own).displacement) /
                                      2e-6;
        EXPECT_LT((gradient.col(k) - slope).norm(), 1e-5);
    }
}

Eigen::Vector3d point_in(std::mt19937& rng, double x, double y, double z)
{
    return {random_number(rng, 0, x), random_number(rng, 0, y), random_number(rng, 0, z)};
}

} // namespace

TEST(Blend, weights_sum_to_one_and_at_most_eight_are_positive)
{
    const Built bar = support::bar(3, 3, 6);
    const ClosestCells closest(bar.cells);
    std::mt19937 rng(1);
    std::vector<Influence> influences;
    for (int trial = 0; trial < 500; ++trial)
    {
        const Eigen::Vector3d x = point_in(rng, 3, 3, 6);
        closest.influences(x, own_cell(bar, x), influences);
        double sum = 0.0;
        Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
        for (const Influence& i : influences)
        {
            EXPECT_GT(i.weight, 0.0);
            sum += i.weight;
            gradient += i.gradient;
        }
        EXPECT_NEAR(sum, 1.0, 1e-14);
        EXPECT_LT(gradient.norm(), 1e-12);
        EXPECT_LE(influences.size(), 8u);
    }
}

TEST(Blend, is_continuous_and_smooth_across_cells)
{
    const Built bar = support::bar(3, 3, 6);
    const Field field = fit_field(FieldKind::Blend, bar.cells, twisted(bar, 0.3), {}, {});
    // Along a line through the bar no step is larger than its slope explains.
    const Eigen::Vector3d a(0.1, 0.2, 0.05), b(2.9, 2.7, 5.9);
    const int steps = 20000;
    Eigen::Vector3d last = Eigen::Vector3d::Zero(), last_step = Eigen::Vector3d::Zero();
    double largest = 0.0, largest_bend = 0.0;
    for (int i = 0; i <= steps; ++i)
    {
        const Eigen::Vector3d x = a + (b - a) * i / steps;
        const Eigen::Vector3d d = field.value(x, own_cell(bar, x)).displacement;
        if (i > 0)
            largest = std::max(largest, (d - last).norm());
        if (i > 1)
            largest_bend = std::max(largest_bend, (d - last - last_step).norm());
        last_step = d - last;
        last = d;
    }
    const double step = (b - a).norm() / steps;
    EXPECT_LT(largest, 4.0 * step);
    EXPECT_LT(largest_bend, 1e-4 * 20);
}

TEST(Blend, does_not_cross_a_gap)
{
    const Built fingers =
        support::built(support::joined(support::box_shape({0, 0, 0}, {4, 0.45, 1}),
                                       support::box_shape({0, 0.55, 0}, {4, 1, 1})),
                       8, 0, Fill::Solid, 0.02);
    const std::vector<int> component = connected_components(fingers.cells);
    const ClosestCells closest(fingers.cells);
    std::vector<Influence> influences;
    std::mt19937 rng(2);
    for (int trial = 0; trial < 200; ++trial)
    {
        const Eigen::Vector3d x(random_number(rng, 0, 4), random_number(rng, 0.4, 0.44),
                                0.5);
        const int own = own_cell(fingers, x);
        closest.influences(x, own, influences);
        for (const Influence& i : influences)
            EXPECT_EQ(component[idx(i.cell)], component[idx(own)]);
    }
}

TEST(Closest4, uses_four_cells_and_copes_with_equal_distances)
{
    const Built bar = support::bar(3, 3, 3);
    const Closest4 closest(bar.cells);
    std::vector<Influence> influences;
    closest.influences({1.0, 1.0, 1.0}, influences); // eight centres are equally near
    ASSERT_EQ(influences.size(), 4u);
    for (const Influence& i : influences)
        EXPECT_EQ(i.weight, 0.25);
    const Built one = support::bar(1, 1, 1);
    const Closest4 alone(one.cells);
    alone.influences({0.2, 0.3, 0.4}, influences);
    ASSERT_EQ(influences.size(), 1u);
    EXPECT_EQ(influences[0].weight, 1.0);
}

TEST(Rbf, takes_every_centre_where_it_goes)
{
    std::mt19937 rng(3);
    std::vector<Eigen::Vector3d> centres, displacements;
    for (int i = 0; i < 300; ++i)
    {
        centres.push_back(random_vector(rng, 1.0));
        displacements.push_back(random_vector(rng, 0.2));
    }
    const auto [field, residual] = RbfSystem(centres).fit(displacements);
    EXPECT_LT(residual, 1e-9);
    for (std::size_t i = 0; i < centres.size(); ++i)
        EXPECT_LT((field.value(centres[i]).displacement - displacements[i]).norm(), 1e-9);
}

TEST(Rbf, reproduces_quadratics_everywhere)
{
    std::mt19937 rng(4);
    const auto quadratic = [](const Eigen::Vector3d& x) -> Eigen::Vector3d {
        return {1 + x.x() * x.y(), 2 * x.z() * x.z() - x.x(), 3 * x.y() + x.x() * x.x()};
    };
    std::vector<Eigen::Vector3d> centres, displacements;
    for (int i = 0; i < 60; ++i)
    {
        centres.push_back(random_vector(rng, 1.0) + Eigen::Vector3d(5, 0, 0));
        displacements.push_back(quadratic(centres.back()));
    }
    const RbfField field = RbfSystem(centres).fit(displacements).field;
    for (int i = 0; i < 50; ++i)
    {
        const Eigen::Vector3d x = random_vector(rng, 2.0) + Eigen::Vector3d(5, 0, 0);
        EXPECT_LT((field.value(x).displacement - quadratic(x)).norm(), 1e-8);
    }
}

TEST(Rbf, gradient_matches_finite_differences)
{
    std::mt19937 rng(5);
    std::vector<Eigen::Vector3d> centres, displacements;
    for (int i = 0; i < 100; ++i)
    {
        centres.push_back(random_vector(rng, 1.0));
        displacements.push_back(random_vector(rng, 0.2));
    }
    const RbfField field = RbfSystem(centres).fit(displacements).field;
    for (int trial = 0; trial < 20; ++trial)
    {
        const Eigen::Vector3d x = random_vector(rng, 1.0);
        const FieldValue value = field.value(x);
        PlaceVectors alone;
        field.displacement(everywhere(x), alone);
        EXPECT_EQ(value.displacement, alone.row(3).transpose().matrix());
        for (int k = 0; k < 3; ++k)
        {
            const Eigen::Vector3d h = 1e-5 * Eigen::Vector3d::Unit(k);
            const Eigen::Vector3d slope =
                (field.value(x + h).displacement - field.value(x - h).displacement) /
                2e-5;
            EXPECT_LT((value.gradient.col(k) - slope).norm(), 1e-6 * (1 + slope.norm()));
        }
    }
}

TEST(Rbf, works_on_few_flat_collinear_and_coincident_centres)
{
    std::mt19937 rng(6);
    const auto check = [](const std::vector<Eigen::Vector3d>& centres,
                          const std::vector<Eigen::Vector3d>& displacements)
    {
        const auto [field, residual] = RbfSystem(centres).fit(displacements);
        EXPECT_LT(residual, 1e-9);
        EXPECT_TRUE(field.value({0.3, 0.4, 0.5}).displacement.allFinite());
    };
    check({{1, 2, 3}}, {{0.1, 0, 0}});
    check({{0, 0, 0}, {1, 0, 0}}, {{0.1, 0, 0}, {0, 0.1, 0}});
    std::vector<Eigen::Vector3d> flat, line, twice, moves;
    for (int i = 0; i < 40; ++i)
    {
        const Eigen::Vector3d x = random_vector(rng, 1.0);
        flat.emplace_back(x.x(), x.y(), 0.0);
        line.emplace_back(x.x(), 2 * x.x(), -x.x());
        moves.push_back(0.1 *
                        Eigen::Vector3d(std::sin(x.x()), std::cos(2 * x.y()), x.x()));
    }
    check(flat, moves);
    check(line, moves);
    twice = flat;
    twice.insert(twice.end(), flat.begin(), flat.end());
    std::vector<Eigen::Vector3d> both = moves;
    both.insert(both.end(), moves.begin(), moves.end());
    check(twice, both);
    EXPECT_EQ(RbfSystem(twice).num_centres(), 40u);
}

TEST(Field, reproduces_a_rigid_motion)
{
    const Built bar = support::bar(2, 2, 6);
    std::mt19937 rng(7);
    const Motion motion{support::random_rotation(rng), random_vector(rng, 3.0)};
    const std::vector<Constraint> constraints(bar.cells.size());
    for (const FieldKind kind :
         {FieldKind::Blend, FieldKind::Closest4, FieldKind::Rbf, FieldKind::RbfGlobal})
    {
        const Field field =
            fit_field(kind, bar.cells, rigid(bar, motion), constraints, {});
        for (int trial = 0; trial < 50; ++trial)
        {
            const Eigen::Vector3d x = point_in(rng, 2, 2, 6);
            const FieldValue value = field.value(x, own_cell(bar, x));
            EXPECT_LT((x + value.displacement - motion(x)).norm(), 1e-11);
            EXPECT_LT((value.gradient + Eigen::Matrix3d::Identity() - motion.R).norm(),
                      1e-9);
        }
    }
}

TEST(Field, reproduces_a_rigid_motion_where_fingers_share_leaves)
{
    const Motion motion{rotation_about({0.6, 0, 0.8}, 2.0), {0.5, -0.3, 0.2}};
    for (const int depth : {0, 2})
    {
        const Built comb = support::built_mixed(support::comb(), 4, depth, 1, 0.02);
        const std::vector<Constraint> constraints(comb.cells.size());
        std::mt19937 rng(7);
        for (const FieldKind kind : {FieldKind::Blend, FieldKind::Rbf})
        {
            const Field field =
                fit_field(kind, comb.cells, rigid(comb, motion), constraints, {});
            for (int trial = 0; trial < 500; ++trial)
            {
                const Eigen::Vector3d x = point_in(rng, 4, 1, 1);
                if (own_cell(comb, x) < 0)
                    continue;
                const FieldValue value = field.value(x, own_cell(comb, x));
                EXPECT_LT((x + value.displacement - motion(x)).norm(), 1e-9);
                EXPECT_LT(
                    (value.gradient + Eigen::Matrix3d::Identity() - motion.R).norm(),
                    1e-8);
            }
        }
    }
}

TEST(Field, blend_and_rbf_agree_where_the_motion_is_smooth)
{
    const Built bar = support::bar(3, 3, 12);
    const std::vector<Constraint> constraints(bar.cells.size());
    const Field blend =
        fit_field(FieldKind::Blend, bar.cells, twisted(bar, 0.08), constraints, {});
    const Field rbf =
        fit_field(FieldKind::Rbf, bar.cells, twisted(bar, 0.08), constraints, {});
    std::mt19937 rng(8);
    for (int trial = 0; trial < 200; ++trial)
    {
        const Eigen::Vector3d x = point_in(rng, 3, 3, 12);
        const int own = own_cell(bar, x);
        EXPECT_LT(
            (blend.value(x, own).displacement - rbf.value(x, own).displacement).norm(),
            4e-3 * std::sqrt(162.0));
    }
}

TEST(Field, turns_what_is_one_cell_thick_as_its_cells_turn)
{
    // Centroids in a plane, or on a line, say nothing of turns about it.
    std::mt19937 rng(9);
    for (const Eigen::Vector3i& counts :
         {Eigen::Vector3i(1, 6, 9), {1, 1, 9}, {9, 1, 1}, {1, 1, 1}, {1, 1, 2}})
    {
        const Built bar = support::bar(counts.x(), counts.y(), counts.z());
        const Motion motion{support::random_rotation(rng), random_vector(rng, 3.0)};
        const std::vector<Constraint> constraints(bar.cells.size());
        for (const FieldKind kind : {FieldKind::Rbf, FieldKind::RbfGlobal})
        {
            const Field field =
                fit_field(kind, bar.cells, rigid(bar, motion), constraints, {});
            for (int trial = 0; trial < 50; ++trial)
            {
                const Eigen::Vector3d x =
                    point_in(rng, counts.x(), counts.y(), counts.z());
                const FieldValue value = field.value(x, own_cell(bar, x));
                EXPECT_LT((x + value.displacement - motion(x)).norm(), 1e-10);
            }
        }
    }
}

TEST(LocalRbf, is_nearer_to_the_global_interpolant_with_larger_clusters)
{
    const Built bar = support::bar(4, 4, 16);
    const std::vector<Constraint> constraints(bar.cells.size());
    const std::vector<Pose> poses = twisted(bar, 0.1);
    const Field global =
        fit_field(FieldKind::RbfGlobal, bar.cells, poses, constraints, {});
    double last = INFINITY;
    for (const ClusterSize& size :
         {ClusterSize{1, 1.5, 1.5}, kReleaseClusters, ClusterSize{5, 3.0, 4.0}})
    {
        const Field local =
            fit_field({FieldKind::Rbf, size}, bar.cells, poses, constraints, {});
        std::mt19937 rng(10);
        double largest = 0.0;
        for (int trial = 0; trial < 500; ++trial)
        {
            const Eigen::Vector3d x = point_in(rng, 4, 4, 16);
            const int own = own_cell(bar, x);
            largest = std::max(largest, (local.value(x, own).displacement -
                                         global.value(x, own).displacement)
                                            .norm());
        }
        EXPECT_LT(largest, 0.7 * last);
        last = largest;
    }
}

TEST(LocalRbf, is_near_to_the_global_interpolant_and_as_smooth)
{
    const Built bar = support::bar(6, 6, 24);
    const double diagonal = std::sqrt(36.0 + 36.0 + 576.0);
    const std::vector<Constraint> constraints(bar.cells.size());
    const std::vector<Pose> poses = twisted(bar, 0.1);
    const Field local = fit_field(FieldKind::Rbf, bar.cells, poses, constraints, {});
    const Field global =
        fit_field(FieldKind::RbfGlobal, bar.cells, poses, constraints, {});
    EXPECT_GT(local.num_clusters(), 20u);
    EXPECT_EQ(local.parts().num_centres, global.parts().num_centres);
    EXPECT_LT(local.parts().residual, 1e-9 * diagonal);
    std::mt19937 rng(10);
    double largest = 0.0, largest_turn = 0.0;
    for (int trial = 0; trial < 2000; ++trial)
    {
        const Eigen::Vector3d x = point_in(rng, 6, 6, 24);
        const int own = own_cell(bar, x);
        const FieldValue a = local.value(x, own), b = global.value(x, own);
        largest = std::max(largest, (a.displacement - b.displacement).norm());
        largest_turn = std::max(largest_turn, (a.gradient - b.gradient).norm());
    }
    EXPECT_LT(largest, 2e-4 * diagonal);
    EXPECT_LT(largest_turn, 0.02);
    // Second differences along a line on the surface, over many clusters.
    const double step = 0.02;
    const auto bend = [&](const Field& field)
    {
        double result = 0.0;
        const auto at = [&](double s)
        {
            const Eigen::Vector3d x(0.0, 0.2 * s, s);
            return Eigen::Vector3d(x + field.value(x, own_cell(bar, x)).displacement);
        };
        for (double s = 1.0; s < 23.0; s += step)
            result = std::max(result, (at(s + step) - 2.0 * at(s) + at(s - step)).norm() /
                                          step / step);
        return result;
    };
    EXPECT_LT(bend(local), 1.1 * bend(global));
}

TEST(LocalRbf, fits_again_only_what_has_moved_and_factors_nothing_twice)
{
    const Built bar = support::bar(4, 4, 24);
    const std::vector<Constraint> constraints(bar.cells.size());
    std::vector<Pose> poses = twisted(bar, 0.1);
    RbfSystems systems;
    FieldFitter fitter(FieldKind::Rbf, bar.cells, constraints, &systems);
    const Field first = fitter.fit(poses, {});
    EXPECT_EQ(fitter.num_solved(), first.num_clusters());
    EXPECT_EQ(fitter.num_factored(), first.num_clusters());
    (void)fitter.fit(poses, {});
    EXPECT_EQ(fitter.num_solved(), 0u);
    poses.front().p.x() += 0.01;
    const Field again = fitter.fit(poses, {});
    EXPECT_GT(fitter.num_solved(), 0u);
    EXPECT_LT(fitter.num_solved(), first.num_clusters() / 3);
    EXPECT_EQ(fitter.num_factored(), 0u);
    const Field fresh = fit_field(FieldKind::Rbf, bar.cells, poses, constraints, {});
    std::mt19937 rng(12);
    for (int trial = 0; trial < 50; ++trial)
    {
        const Eigen::Vector3d x = point_in(rng, 4, 4, 24);
        const int own = own_cell(bar, x);
        EXPECT_EQ(again.value(x, own).displacement, fresh.value(x, own).displacement);
    }
}

TEST(LocalRbf, a_fit_that_was_stopped_changes_no_bit_of_the_next)
{
    const Built bar = support::bar(3, 3, 6);
    const std::vector<Constraint> constraints(bar.cells.size());
    FieldFitter fitter(FieldKind::Rbf, bar.cells, constraints, nullptr);
    const std::vector<Eigen::Vector3d> points = {{1.2, 1.3, 2.4}, {2.1, 0.2, 5.5}};
    const std::vector<int> cells = {0, static_cast<int>(bar.cells.size()) - 1};
    const auto shifts = [&](const Field& field)
    {
        std::vector<Eigen::Vector3d> out;
        for (const FieldValue& value : field.values(points, cells))
            out.push_back(value.displacement);
        return out;
    };
    (void)fitter.fit(twisted(bar, 0.2), {});
    int num_stopped = 0;
    for (int k = 0; k < 50; ++k)
    {
        const support::CountedStop scope(k);
        try
        {
            (void)fitter.fit(twisted(bar, 0.1), {});
        }
        catch (const Stopped&)
        {
            ++num_stopped;
        }
    }
    EXPECT_GT(num_stopped, 1);
    EXPECT_EQ(
        shifts(fitter.fit(twisted(bar, 0.1), {})),
        shifts(fit_field(FieldKind::Rbf, bar.cells, twisted(bar, 0.1), constraints, {})));
}

TEST(LocalRbf, gradient_matches_finite_differences_inside_and_outside)
{
    const Built bar = support::bar(3, 3, 12);
    const std::vector<Constraint> constraints(bar.cells.size());
    const Field field =
        fit_field(FieldKind::Rbf, bar.cells, twisted(bar, 0.2), constraints, {});
    std::mt19937 rng(11);
    const double h = 1e-5;
    for (int trial = 0; trial < 60; ++trial)
    {
        // Some points lie up to a cell outside; the nearest cell is their own.
        const Eigen::Vector3d x =
            point_in(rng, 5, 3, 14) -
            (trial % 2 ? Eigen::Vector3d(1, 0, 1) : Eigen::Vector3d(0.5, 0, 0));
        const int own = own_cell(bar, x);
        const FieldValue value = field.value(x, own);
        for (int axis = 0; axis < 3; ++axis)
        {
            const Eigen::Vector3d e = h * Eigen::Vector3d::Unit(axis);
            const Eigen::Vector3d slope = (field.value(x + e, own).displacement -
                                           field.value(x - e, own).displacement) /
                                          (2 * h);
            EXPECT_LT((slope - value.gradient.col(axis)).norm(), 1e-6);
        }
    }
}

TEST(LocalRbf, far_outside_a_point_follows_the_nearest_cells)
{
    const Built bar = support::bar(2, 2, 6);
    const std::vector<Constraint> constraints(bar.cells.size());
    const std::vector<Pose> poses = twisted(bar, 0.2);
    const Field field = fit_field(FieldKind::Rbf, bar.cells, poses, constraints, {});
    // Straight out from the centre of a cell's face only that cell counts.
    const int own = own_cell(bar, {0.5, 0.5, 0.5});
    const std::size_t c = idx(own);
    const Eigen::Vector3d far(0.5, 0.5, -1e6);
    EXPECT_LT((field.value(far, own).displacement -
               displacement(poses[c], bar.cells.cells[c].centre, far))
                  .norm(),
              1e-6);
    EXPECT_LT((field.value(far, own).gradient + Eigen::Matrix3d::Identity() - poses[c].R)
                  .norm(),
              1e-10);
}

TEST(LocalRbf, keeps_apart_what_the_material_keeps_apart)
{
    // Two slabs, 1 % of the diagonal apart, joined at one end; the cells of one slab
    // turn, the other's rest.
    const Built slabs = support::built(
        support::joined(support::joined(support::box_shape({0, 0, 0}, {4, 0.48, 1}),
                                        support::box_shape({0, 0.52, 0}, {4, 1, 1})),
                        support::box_shape({0, 0.4, 0}, {0.5, 0.6, 1})),
        32, 0, Fill::Solid, 0.01);
    const std::vector<Constraint> constraints(slabs.cells.size());
    std::vector<Pose> poses;
    for (const Cell& cell : slabs.cells.cells)
    {
        const bool is_upper = cell.centre.y() > 0.5 && cell.centre.x() > 0.5;
        const Motion motion = {
            rotation_about(Eigen::Vector3d::UnitZ(),
                           is_upper ? 0.2 * (cell.centre.x() - 0.5) : 0.0),
            Eigen::Vector3d::Zero()};
        poses.push_back(carried(motion, cell.centre));
    }
    const Field local = fit_field(FieldKind::Rbf, slabs.cells, poses, constraints, {});
    const Field global =
        fit_field(FieldKind::RbfGlobal, slabs.cells, poses, constraints, {});
    double by_local = 0.0, by_global = 0.0;
    for (double x = 1.5; x < 4.0; x += 0.01)
    {
        const Eigen::Vector3d inner(x, 0.479, 0.5);
        const int own = own_cell(slabs, inner);
        by_local = std::max(by_local, local.value(inner, own).displacement.norm());
        by_global = std::max(by_global, global.value(inner, own).displacement.norm());
    }
    EXPECT_LT(by_local, 1e-9);
    EXPECT_GT(by_global, 0.05);
}

namespace
{

/// A bar whose lower end is a region that turns; every other cell rests.
struct RegionCase
{
    Built bar = support::bar(3, 3, 9);
    std::vector<Eigen::Vector3d> samples;
    std::vector<int> cells;
    Motion motion{rotation_about(Eigen::Vector3d::UnitZ(), 0.02), {0.01, 0, 0}};
    std::vector<Constraint> constraints{bar.cells.size()};

    std::vector<RegionFade::Node> nodes() const
    {
        std::vector<RegionFade::Node> result;
        for (std::size_t i = 0; i < samples.size(); ++i)
            result.push_back({samples[i], cells[i]});
        return result;
    }
    RegionCase()
    {
        for (int i = 0; i <= 12; ++i)
            for (int j = 0; j <= 12; ++j)
                for (int k = 0; k <= 4; ++k)
                {
                    samples.emplace_back(0.25 * i, 0.25 * j, 0.25 * k);
                    cells.push_back(own_cell(bar, samples.back()));
                }
    }
};

} // namespace

TEST(RegionFade, region_samples_follow_their_motion_to_the_bit)
{
    const RegionCase c;
    const RegionFade fade(c.bar.cells, c.nodes(), {});
    for (const FieldKind kind : {FieldKind::Blend, FieldKind::Rbf})
    {
        const Field field = fit_field(kind, c.bar.cells, rigid(c.bar, Motion()),
                                      c.constraints, {{&fade, c.motion, false, {}}});
        const std::vector<Eigen::Vector3d> d = field.displacements(c.samples, c.cells);
        for (std::size_t i = 0; i < c.samples.size(); ++i)
        {
            const Eigen::Vector3d wanted =
                (c.motion.R - Eigen::Matrix3d::Identity()) * c.samples[i] + c.motion.t;
            EXPECT_EQ(d[i], wanted);
        }
    }
}

TEST(RegionFade, further_nodes_count_once_and_not_where_a_sample_is)
{
    const RegionCase c;
    std::vector<RegionFade::Node> samples = c.nodes(), further;
    samples.push_back({samples[3].place + Eigen::Vector3d(1e-9, 0, 0), samples[3].cell});
    samples.push_back(samples[4]);
    const std::size_t num_samples = samples.size() - 1;
    for (const double hair : {0.0, 1e-12, -1e-12})
    {
        further.push_back({{1.1 + hair, 1.1, 1.1}, c.cells[0]});
        further.push_back({samples[5].place + Eigen::Vector3d(0, hair, 0), c.cells[5]});
    }
    const RegionFade fade(c.bar.cells, samples, further);
    EXPECT_EQ(fade.nodes().size(), num_samples + 1);
    EXPECT_EQ(fade.nodes().back(), further.front().place);
}

TEST(RegionFade, a_node_of_which_there_are_24_copies_counts_once)
{
    // A corner of eight cells, each of which has it on three sides.
    const RegionCase c;
    std::vector<RegionFade::Node> further;
    for (int place = 0; place < 5; ++place)
        for (int copy = 0; copy < 24; ++copy)
            further.push_back({{0.6 + 0.2 * place, 1.1, 1.1}, c.cells[0]});
    std::shuffle(further.begin(), further.end(), std::mt19937(1));
    const RegionFade fade(c.bar.cells, c.nodes(), further);
    EXPECT_EQ(fade.nodes().size(), c.samples.size() + 5);
}

TEST(RegionFade, fades_without_a_step_and_ends)
{
    const RegionCase c;
    const RegionFade fade(c.bar.cells, c.nodes(), {});
    const Field field = fit_field(FieldKind::Blend, c.bar.cells, rigid(c.bar, Motion()),
                                  c.constraints, {{&fade, c.motion, false, {}}});
    Eigen::Vector3d last = Eigen::Vector3d::Zero();
    const double step = 0.002;
    for (int i = 0; i * step < 8.0; ++i)
    {
        const Eigen::Vector3d x(1.37, 1.21, 0.9 + i * step);
        const Eigen::Vector3d d = field.value(x, own_cell(c.bar, x)).displacement;
        if (i > 0)
        {
            EXPECT_LT((d - last).norm(), 0.1 * step);
        }
        if (x.z() > 1.0 + fade.radius())
        {
            EXPECT_TRUE(d.isZero(0));
        }
        last = d;
    }
}

TEST(RegionFade, points_among_many_move_as_they_do_alone)
{
    // Among many the nodes near them are listed once for all; a point alone asks the
    // tree. Places between the nodes of the lattice have up to eight equally near ones.
    const RegionCase c;
    const RegionFade fade(c.bar.cells, c.nodes(), {});
    std::mt19937 rng(4);
    std::vector<Eigen::Vector3d> points;
    std::vector<int> own;
    const auto add = [&](const Eigen::Vector3d& x)
    {
        points.push_back(x);
        own.push_back(own_cell(c.bar, x));
    };
    for (int i = 0; i < 1500; ++i)
        add({random_number(rng, 1.0, 2.0), random_number(rng, 1.0, 2.0),
             random_number(rng, 0.8, 3.0)});
    for (int i = 0; i < 8; ++i)
        for (int j = 0; j < 8; ++j)
            for (int k = 0; k < 16; ++k)
                add({1.0 + 0.125 * i, 1.0 + 0.125 * j, 0.5 + 0.125 * k});
    for (const FieldKind kind : {FieldKind::Blend, FieldKind::Rbf})
    {
        const Field field = fit_field(kind, c.bar.cells, rigid(c.bar, Motion()),
                                      c.constraints, {{&fade, c.motion, false, {}}});
        const std::vector<Eigen::Vector3d> moved = field.displacements(points, own);
        const std::vector<FieldValue> values = field.values(points, own);
        for (std::size_t i = 0; i < points.size(); ++i)
        {
            const FieldValue alone = field.value(points[i], own[i]);
            EXPECT_EQ(moved[i], alone.displacement) << points[i].transpose();
            EXPECT_EQ(values[i].displacement, alone.displacement);
            EXPECT_EQ(values[i].gradient, alone.gradient) << points[i].transpose();
        }
    }
}

TEST(Field, what_is_kept_around_points_changes_no_bit)
{
    const RegionCase c;
    const RegionFade fade(c.bar.cells, c.nodes(), {});
    std::mt19937 rng(8);
    std::vector<Eigen::Vector3d> points;
    std::vector<int> own;
    for (int i = 0; i < 4000; ++i)
    {
        points.emplace_back(random_number(rng, 0.0, 3.0), random_number(rng, 0.0, 3.0),
                            random_number(rng, 0.0, 4.0));
        own.push_back(own_cell(c.bar, points.back()));
        if (i % 7 == 0) // some outside of the box of the cell that they follow
            points.back() += random_vector(rng, 0.8);
        if (i % 11 == 0) // some at nodes
            points.back() = 0.25 * (4.0 * points.back()).array().round();
    }
    constexpr std::size_t kRoom = std::size_t(1) << 24, kLittleRoom = 20000, kNoRoom = 10;
    for (const FieldKind kind : {FieldKind::Blend, FieldKind::Closest4, FieldKind::Rbf})
        for (const std::size_t most : {kRoom, kLittleRoom, kNoRoom})
        {
            Field field = fit_field(kind, c.bar.cells, twisted(c.bar, 0.1), c.constraints,
                                    {{&fade, c.motion, false, {}}});
            const std::vector<Eigen::Vector3d> wanted = field.displacements(points, own);
            const std::vector<FieldValue> values = field.values(points, own);
            field.keep_surroundings(most);
            // A few at a time, twice: before they are kept and after.
            constexpr std::size_t kFew = 40;
            for (std::size_t first = 0; first < 2 * points.size(); first += kFew)
            {
                const std::size_t at = first % points.size();
                const auto some = std::span(points).subspan(at, kFew);
                const auto of_some = std::span(own).subspan(at, kFew);
                const std::vector<Eigen::Vector3d> moved =
                    field.displacements(some, of_some);
                const std::vector<FieldValue> turned = field.values(some, of_some);
                for (std::size_t i = 0; i < kFew; ++i)
                {
                    EXPECT_EQ(moved[i], wanted[at + i]);
                    EXPECT_EQ(turned[i].displacement, values[at + i].displacement);
                    EXPECT_EQ(turned[i].gradient, values[at + i].gradient);
                }
            }
        }
}

TEST(NearNodes, are_the_nearest_of_all_nodes)
{
    // Thousands of nodes on a plane, at random and on a lattice, a few, and far ones.
    const RegionCase c;
    std::mt19937 rng(12);
    std::vector<RegionFade::Node> scattered, lattice, few, far;
    for (int i = 0; i < 6000; ++i)
        scattered.push_back(
            {{random_number(rng, 0, 3), random_number(rng, 0, 3), 1.0}, 0});
    for (int i = 0; i < 60; ++i)
        for (int j = 0; j < 60; ++j)
            lattice.push_back({{0.05 * i, 0.05 * j, 1.0}, 0});
    for (int i = 0; i < 7; ++i)
        few.push_back({{random_number(rng, 1, 2), random_number(rng, 1, 2), 1.0}, 0});
    for (int i = 0; i < 50; ++i)
        far.push_back({{0.06 * i, 0.0, 40.0}, 0});
    int num_told = 0, num_none = 0;
    for (const std::vector<RegionFade::Node>& nodes : {scattered, lattice, few, far})
    {
        const RegionFade fade(c.bar.cells, nodes, {});
        for (int trial = 0; trial < 60; ++trial)
        {
            const Eigen::Vector3d low(random_number(rng, 0, 2.5),
                                      random_number(rng, 0, 2.5),
                                      random_number(rng, 0.2, 4.0));
            const double edge = trial % 2 == 0 ? 0.5 : 0.1;
            const Eigen::AlignedBox3d box(low, low + Eigen::Vector3d::Constant(edge));
            const NearNodes near(fade, box, 1000);
            RegionFade::Nearest found;
            for (int k = 0; k < 30; ++k)
            {
                Eigen::Vector3d x = low;
                for (int axis = 0; axis < 3; ++axis)
                    x[axis] += random_number(rng, 0, edge);
                if (k % 5 == 0) // a node, where the box holds it
                    x = fade.nodes()[idx(k * 7 % static_cast<int>(nodes.size()))];
                if (!near.may_tell_of(x) || !near.nearest(x, fade.radius(), found))
                    continue;
                std::vector<std::pair<double, std::size_t>> all;
                for (std::size_t i = 0; i < fade.nodes().size(); ++i)
                {
                    const Eigen::Vector3d d = fade.nodes()[i] - x;
                    all.emplace_back(d.x() * d.x() + d.y() * d.y() + d.z() * d.z(), i);
                }
                std::sort(all.begin(), all.end());
                ++num_told;
                std::size_t wanted = std::min(all.size(), RegionFade::kNearest);
                if (std::sqrt(all.front().first) / fade.radius() >= 1.0)
                    wanted = 0;
                else if (all.front().first == 0.0)
                    wanted = 1;
                num_none += wanted == 0;
                ASSERT_EQ(found.count, wanted);
                for (std::size_t i = 0; i < wanted; ++i)
                {
                    EXPECT_EQ(found.nodes[i].index, all[i].second);
                    EXPECT_EQ(found.nodes[i].distance_squared, all[i].first);
                }
            }
        }
    }
    EXPECT_GT(num_told, 3000);
    EXPECT_GT(num_none, 100);
}

TEST(NearNodes, ask_the_tree_only_where_it_is_open_which_nodes_are_the_nearest)
{
    // On a lattice of whole numbers of sixteenths many are equally far.
    const RegionCase c;
    std::vector<RegionFade::Node> lattice;
    for (int i = 0; i < 48; ++i)
        for (int j = 0; j < 48; ++j)
            lattice.push_back({{i / 16.0, j / 16.0, 1.0}, 0});
    const RegionFade fade(c.bar.cells, lattice, {});
    const Eigen::Vector3d low(1.0, 1.0, 1.0);
    const NearNodes near(
        fade, Eigen::AlignedBox3d(low, low + Eigen::Vector3d::Constant(0.25)), 1000);
    int num_told = 0, num_equal = 0, num_open = 0;
    RegionFade::Nearest found;
    for (int i = 0; i < 16; ++i)
        for (int j = 0; j < 16; ++j)
            for (int k = 1; k < 8; ++k)
            {
                const Eigen::Vector3d x = low + Eigen::Vector3d(i, j, k) / 64.0;
                ASSERT_TRUE(near.may_tell_of(x));
                std::vector<std::pair<double, std::size_t>> all;
                for (std::size_t n = 0; n < fade.nodes().size(); ++n)
                    all.emplace_back((fade.nodes()[n] - x).squaredNorm(), n);
                std::sort(all.begin(), all.end());
                constexpr std::size_t kNearest = RegionFade::kNearest;
                const bool is_open = all[kNearest - 1].first == all[kNearest].first;
                ASSERT_EQ(near.nearest(x, fade.radius(), found), !is_open);
                num_open += is_open;
                if (is_open)
                    continue;
                ++num_told;
                ASSERT_EQ(found.count, kNearest);
                for (std::size_t n = 0; n < kNearest; ++n)
                {
                    EXPECT_EQ(found.nodes[n].index, all[n].second);
                    num_equal += n > 0 && all[n - 1].first == all[n].first;
                }
            }
    EXPECT_GT(num_told, 100);
    EXPECT_GT(num_open, 100);
    EXPECT_GT(num_equal, 100);
}

TEST(RegionFade, gradient_matches_finite_differences)
{
    const RegionCase c;
    const RegionFade fade(c.bar.cells, c.nodes(), {});
    std::mt19937 rng(9);
    for (const FieldKind kind : {FieldKind::Blend, FieldKind::Rbf})
    {
        const Field field = fit_field(kind, c.bar.cells, twisted(c.bar, 0.01),
                                      c.constraints, {{&fade, c.motion, false, {}}});
        for (int trial = 0; trial < 50; ++trial)
        {
            const Eigen::Vector3d x(random_number(rng, 0.1, 2.9),
                                    random_number(rng, 0.1, 2.9),
                                    random_number(rng, 1.05, 3.0));
            expect_gradient_of_differences(field, x, own_cell(c.bar, x));
        }
    }
}

TEST(Field, samples_of_a_loose_part_go_where_the_part_that_leads_them_takes_them)
{
    // Three slabs on one another, each bent differently. The lowest one leads the middle
    // one, and this the highest.
    Shape shape;
    constexpr double kGap = 0.04;
    for (int k = 0; k < 3; ++k)
        shape = support::joined(
            shape, support::box_shape({0, k * 0.52, 0}, {4, (k + 1) * 0.52 - kGap, 1}));
    const Built slabs = support::built(shape, 32, 0, Fill::Solid, 0.01);
    const auto slab_of = [](const Eigen::Vector3d& x)
    { return static_cast<int>((x.y() + 0.5 * kGap) / 0.52); };
    std::vector<Pose> poses;
    const auto bend = [&](double shift)
    {
        poses.clear();
        for (const Cell& cell : slabs.cells.cells)
            poses.push_back(carried(
                {rotation_about(Eigen::Vector3d::UnitZ(),
                                0.003 * (1 + slab_of(cell.centre)) * cell.centre.x()),
                 {shift * slab_of(cell.centre), 0, 0}},
                cell.centre));
    };
    bend(0.01);
    // The middle slab's samples below its own middle, and the same of the highest one.
    std::vector<RegionFade::Node> nodes[2];
    std::vector<int> leading[2];
    for (int k = 0; k < 2; ++k)
        for (double x = 0.45; x < 3.6; x += 0.1)
            for (double z = 0.05; z < 1.0; z += 0.1)
            {
                const Eigen::Vector3d at(x, (k + 1) * 0.52 + 0.001, z);
                nodes[k].push_back({at, own_cell(slabs, at)});
                leading[k].push_back(
                    own_cell(slabs, {x, (k + 1) * 0.52 - kGap - 0.001, z}));
                ASSERT_GE(nodes[k].back().cell, 0);
                ASSERT_GE(leading[k].back(), 0);
            }
    const RegionFade fades[2] = {RegionFade(slabs.cells, nodes[0], {}),
                                 RegionFade(slabs.cells, nodes[1], {})};
    const std::vector<Constraint> constraints(slabs.cells.size());
    std::vector<MovedRegion> parts;
    for (const int k : {1, 0}) // their order does not count
    {
        MovedRegion& part = parts.emplace_back();
        part.fade = &fades[k];
        part.bends = true;
        part.leading_cells = leading[k];
        part.rank = k + 1;
    }
    for (const FieldKind kind : {FieldKind::Blend, FieldKind::Rbf})
    {
        const Field field = fit_field(kind, slabs.cells, poses, constraints, parts);
        const Field alone = fit_field(kind, slabs.cells, poses, constraints, {});
        double missed = 0.0;
        for (int k = 0; k < 2; ++k)
            for (std::size_t i = 0; i < nodes[k].size(); ++i)
            {
                const auto& [x, cell] = nodes[k][i];
                const FieldValue value = field.value(x, cell),
                                 led = field.value(x, leading[k][i]);
                EXPECT_LT((value.displacement - led.displacement).norm(), 1e-14);
                EXPECT_LT((value.gradient - led.gradient).norm(), 1e-12);
                missed = std::max(
                    missed,
                    (alone.value(x, cell).displacement - value.displacement).norm());
            }
        EXPECT_GT(missed, 0.03);
        std::mt19937 rng(10);
        for (int trial = 0; trial < 50; ++trial)
        {
            const Eigen::Vector3d x(random_number(rng, 0.5, 3.5),
                                    random_number(rng, 0.53, 0.95),
                                    random_number(rng, 0.05, 0.95));
            expect_gradient_of_differences(field, x, own_cell(slabs, x));
        }
    }
    // Parts that move apart by more than a cell are not drawn out to each other.
    bend(1.0);
    const Field field = fit_field(FieldKind::Rbf, slabs.cells, poses, constraints, parts);
    const Field alone = fit_field(FieldKind::Rbf, slabs.cells, poses, constraints, {});
    for (const RegionFade::Node& node : nodes[1])
        EXPECT_EQ(field.value(node.place, node.cell).displacement,
                  alone.value(node.place, node.cell).displacement);
}

TEST(Field, where_nothing_is_held_nothing_moves)
{
    const Built bar = support::bar(3, 3, 6);
    const std::vector<Pose> poses = rigid(bar, Motion());
    Constraint idle;
    idle.hold = Hold::Idle;
    const std::vector<Constraint> constraints(bar.cells.size(), idle);
    for (const FieldKind kind : {FieldKind::Blend, FieldKind::Closest4, FieldKind::Rbf,
                                 FieldKind::RbfGlobal, FieldKind::RbfCentres})
    {
        const Field field = fit_field(kind, bar.cells, poses, constraints, {});
        EXPECT_EQ(field.parts().residual, 0.0);
        const Eigen::Vector3d x(1.4, 1.2, 3.3);
        EXPECT_EQ(field.value(x, own_cell(bar, x)).displacement, Eigen::Vector3d::Zero());
    }
}

TEST(Field, threads_do_not_change_a_bit)
{
    const RegionCase c;
    const RegionFade fade(c.bar.cells, c.nodes(), {});
    std::vector<Eigen::Vector3d> first;
    for (const int threads : {1, 2, 4})
    {
        const ThreadLimit limit(threads);
        const Field field = fit_field(FieldKind::Rbf, c.bar.cells, twisted(c.bar, 0.2),
                                      c.constraints, {{&fade, c.motion, false, {}}});
        const std::vector<Eigen::Vector3d> d = field.displacements(c.samples, c.cells);
        if (first.empty())
            first = d;
        EXPECT_EQ(d, first);
    }
}

TEST(RbfField, a_quadratic_that_the_centres_hardly_determine_stays_small)
{
    // A bar two cells thick, each with a point towards its open edge: y y - z z is
    // nothing there but for the little that cells and their motions are off.
    std::mt19937 rng(4);
    for (const double off : {0.0, 1e-6, 1e-4, 1e-3})
    {
        std::vector<Eigen::Vector3d> centres, displacements;
        for (int x = 0; x < 8; ++x)
            for (const double r : {0.25, 0.45})
                for (const int y : {-1, 1})
                    for (const int z : {-1, 1})
                    {
                        centres.push_back(Eigen::Vector3d(0.5 * x, r * y, r * z) +
                                          random_vector(rng, off));
                        displacements.push_back(random_vector(rng, 0.01));
                    }
        const RbfField field = RbfSystem(centres).fit(displacements).field;
        for (int trial = 0; trial < 100; ++trial)
        {
            const Eigen::Vector3d at(random_number(rng, -0.25, 3.75),
                                     random_number(rng, -0.5, 0.5),
                                     random_number(rng, -0.5, 0.5));
            EXPECT_LT(field.value(at).displacement.norm(), 0.2) << off;
        }
    }
}

TEST(RbfField, what_rounding_leaves_of_a_term_does_not_count)
{
    // A row of cells: its centres and the middles of its sides. y z is 0 but for
    // rounding.
    std::vector<Eigen::Vector3d> centres, moves;
    std::mt19937 rng(4);
    for (int i = 0; i < 40; ++i)
        for (const auto& [y, z] : {std::pair(0.0, 0.0), {0.01, 0.0}, {0.0, 0.01}})
        {
            centres.push_back(Eigen::Vector3d(0.025 * i, y, z) +
                              support::random_vector(rng, 1e-17));
            moves.emplace_back(0.0, 0.1 * std::sin(0.1 * i), 0.3 * y - 0.2 * z);
        }
    const RbfField field = RbfSystem(centres).fit(moves).field;
    for (const Eigen::Vector3d& c : centres)
    {
        const Eigen::Vector3d beside = c + Eigen::Vector3d(0.0, 0.004, 0.004);
        EXPECT_LT(field.value(beside).displacement.norm(), 0.2);
    }
}

} // namespace cellwarp::core
