// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/field/sample_blend.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <gtest/gtest.h>

#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "solver/field/turning.h"
#include "tests/support/allocations.h"
#include "tests/support/bodies.h"
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

/// A body along z with a region at each end, twisted, and samples all over it.
struct Case
{
    Built body;
    double length;
    std::vector<Eigen::Vector3d> places;
    std::vector<int> own;
    std::vector<SampleNormal> normals;
    std::vector<Constraint> constraints;
    std::vector<Pose> poses;
    std::vector<Motion> motions;
    std::vector<RegionFade> fades;
    std::vector<FadedRegion> regions;

    Case(Built built, double body_length, double twist)
        : body(std::move(built)), length(body_length), constraints(body.cells.size())
    {
        const Eigen::Vector3d axis(1.7, 1.4, 0);
        for (const Cell& cell : body.cells.cells)
        {
            const Eigen::Matrix3d R = rotation_about(Eigen::Vector3d::UnitZ(),
                                                     twist * cell.centre.z() / length);
            poses.push_back({R, axis + R * (cell.centre - axis)});
        }
        const Eigen::Matrix3d R = rotation_about(Eigen::Vector3d::UnitZ(), twist);
        motions = {Motion(), {R, axis - R * axis + Eigen::Vector3d(0.05, 0, 0.1)}};
    }

    int cell_at(const Eigen::Vector3d& x) const
    {
        const VoxelGrid& grid = body.material.grid;
        return body.pieces.at(grid, grid.locate(x));
    }
    void add(const Eigen::Vector3d& x)
    {
        if (cell_at(x) < 0)
            return;
        places.push_back(x);
        own.push_back(cell_at(x));
    }
    void add_normals(std::mt19937& rng)
    {
        for (std::uint32_t i = 0; i < places.size(); ++i)
            normals.push_back({i, random_vector(rng, 1.0).normalized()});
    }
    /// The ends, as deep as \p depth. Their cells get the motions.
    void hold_ends(double depth, bool may_turn)
    {
        std::vector<RegionFade::Node> nodes[2];
        for (std::size_t i = 0; i < places.size(); ++i)
            if (places[i].z() <= depth || places[i].z() >= length - depth)
                nodes[places[i].z() > depth].push_back({places[i], own[i]});
        fades.reserve(2);
        for (std::size_t r = 0; r < 2; ++r)
        {
            const RegionFade::Node further{
                {1.5, 1.5, r == 0 ? depth + 0.1 : length - depth - 0.1},
                cell_at({1.5, 1.5, r == 0 ? depth + 0.1 : length - depth - 0.1})};
            fades.emplace_back(body.cells, nodes[r], std::span(&further, 1));
            FadedRegion& region = regions.emplace_back();
            region.fade = &fades[r];
            region.may_turn = may_turn && r == 1;
            for (std::size_t c = 0; c < body.cells.size() && !region.may_turn; ++c)
            {
                const Eigen::Vector3d& centre = body.cells.cells[c].centre;
                if (r == 0 ? centre.z() >= depth : centre.z() <= length - depth)
                    continue;
                constraints[c].hold = Hold::Prescribed;
                poses[c] = carried(motions[r], centre);
                region.cells.push_back(static_cast<int>(c));
            }
        }
    }
    SampleSet samples() const { return {places, own, normals}; }
    std::vector<MovedRegion> moved() const
    {
        std::vector<MovedRegion> result;
        for (std::size_t r = 0; r < regions.size(); ++r)
            result.push_back({&fades[r], motions[r], regions[r].may_turn, {}});
        return result;
    }
    SampleBlend blend(FieldKind kind = FieldKind::Blend) const
    {
        return SampleBlend(kind, body.cells, samples(), constraints, regions);
    }
};

/// A bar of 4 x 4 x 14 cells with samples within and on its sides; both ends are held.
Case held_bar(bool may_turn = false)
{
    Case c(support::bar(4, 4, 14), 14.0, 1.9);
    std::mt19937 rng(5);
    for (int i = 0; i <= 12; ++i)
        for (int j = 0; j <= 12; ++j)
            for (int k = 0; k <= 10; ++k)
                for (const double z : {0.2 * k, 14.0 - 0.2 * k})
                    c.add({4.0 * i / 12, 4.0 * j / 12, z});
    for (int i = 0; i < 6000; ++i)
        c.add({random_number(rng, 0, 4), random_number(rng, 0, 4),
               random_number(rng, 0, 14)});
    for (int i = 0; i < 2000; ++i)
        c.add({4.0 * (i % 2), random_number(rng, 0, 4), random_number(rng, 0, 14)});
    c.add_normals(rng);
    c.hold_ends(2.0, may_turn);
    return c;
}

/// Largest differences to the field: of places [diagonal], and of normals.
struct Difference
{
    double place = 0.0, normal = 0.0;
};

Difference difference(const Case& c, const SampleBlend& blend, FieldKind kind)
{
    const Field field = fit_field(kind, c.body.cells, c.poses, c.constraints, c.moved());
    const std::vector<Eigen::Vector3f> places = blend.positions_as_given(),
                                       normals = blend.normals_as_given();
    EXPECT_EQ(places.size(), c.places.size());
    EXPECT_EQ(normals.size(), c.normals.size());
    Difference result;
    for (std::size_t i = 0; i < places.size(); ++i)
    {
        const Eigen::Vector3d wanted =
            c.places[i] + field.value(c.places[i], c.own[i]).displacement;
        result.place =
            std::max(result.place, (places[i].cast<double>() - wanted).norm() /
                                       std::sqrt(4 * 4 * 2 + c.length * c.length));
    }
    for (std::size_t n = 0; n < normals.size(); ++n)
    {
        const std::size_t i = c.normals[n].sample;
        const Eigen::Matrix3d J =
            Eigen::Matrix3d::Identity() + field.value(c.places[i], c.own[i]).gradient;
        const Eigen::Vector3d wanted = turned_normal(J, c.normals[n].direction);
        result.normal =
            std::max(result.normal, (normals[n].cast<double>() - wanted).norm());
    }
    return result;
}

std::vector<float> values_of(std::span<const float> values)
{
    return {values.begin(), values.end()};
}

} // namespace

TEST(SampleBlend, equals_the_field_with_fades_and_normals)
{
    for (const FieldKind kind : {FieldKind::Blend, FieldKind::Closest4})
    {
        const Case c = held_bar();
        SampleBlend blend = c.blend(kind);
        blend.apply(c.poses, c.motions);
        const Difference d = difference(c, blend, kind);
        EXPECT_LT(d.place, 1e-6);
        EXPECT_LT(d.normal, 2e-5);
    }
}

TEST(SampleBlend, equals_the_field_around_pins)
{
    const Case c = held_bar(true);
    SampleBlend blend = c.blend();
    blend.apply(c.poses, c.motions);
    const Difference d = difference(c, blend, FieldKind::Blend);
    EXPECT_LT(d.place, 1e-6);
    EXPECT_LT(d.normal, 2e-5);
}

TEST(SampleBlend, equals_the_field_where_fingers_share_leaves)
{
    Eigen::Matrix3d upright; // its length along z
    upright << 0, -1, 0, 0, 0, 1, -1, 0, 0;
    Case c(support::built_mixed(support::turned(support::comb(), upright), 4, 1, 1, 0.02),
           4.0, 1.0);
    c.motions.clear();
    std::mt19937 rng(9);
    for (std::size_t i = 0; i < c.poses.size(); ++i) // fingers apart
        c.poses[i].p += random_vector(rng, 0.1);
    for (int i = 0; i < 10000; ++i)
        c.add({random_number(rng, 0, 1), random_number(rng, 0, 1),
               random_number(rng, 0, 4)});
    c.add_normals(rng);
    SampleBlend blend = c.blend();
    blend.apply(c.poses, c.motions);
    const Difference d = difference(c, blend, FieldKind::Blend);
    EXPECT_LT(d.place, 1e-6);
    EXPECT_LT(d.normal, 2e-5);
}

TEST(SampleBlend, has_corrections_to_make_in_these_tests)
{
    const Case c = held_bar();
    const Field with =
        fit_field(FieldKind::Blend, c.body.cells, c.poses, c.constraints, c.moved());
    const Field without =
        fit_field(FieldKind::Blend, c.body.cells, c.poses, c.constraints, {});
    int num_corrected = 0;
    for (std::size_t i = 0; i < c.places.size(); ++i)
        num_corrected += (with.value(c.places[i], c.own[i]).displacement -
                          without.value(c.places[i], c.own[i]).displacement)
                             .norm() > 1e-3;
    EXPECT_GT(num_corrected, 500);
}

TEST(SampleBlend, poses_at_rest_give_the_rest_to_the_bit)
{
    Case c = held_bar();
    SampleBlend blend = c.blend();
    const std::vector<float> before = values_of(blend.positions()),
                             normals_before = values_of(blend.normals());
    const std::vector<Motion> still(2);
    std::vector<Pose> rest;
    for (const Cell& cell : c.body.cells.cells)
        rest.push_back({Eigen::Matrix3d::Identity(), cell.centre});
    blend.apply(c.poses, c.motions);
    EXPECT_NE(values_of(blend.positions()), before);
    blend.apply(rest, still);
    EXPECT_EQ(values_of(blend.positions()), before);
    EXPECT_EQ(values_of(blend.normals()), normals_before);
    const std::vector<Eigen::Vector3f> places = blend.positions_as_given();
    for (std::size_t i = 0; i < places.size(); ++i)
        EXPECT_EQ(places[i], c.places[i].cast<float>());
}

TEST(SampleBlend, one_motion_of_all_is_a_rigid_motion)
{
    Case c = held_bar();
    const Motion motion{rotation_about({0.6, 0, 0.8}, 2.0), {0.5, -0.3, 0.2}};
    for (std::size_t i = 0; i < c.poses.size(); ++i)
        c.poses[i] = carried(motion, c.body.cells.cells[i].centre);
    c.motions = {motion, motion};
    SampleBlend blend = c.blend();
    blend.apply(c.poses, c.motions);
    const std::vector<Eigen::Vector3f> places = blend.positions_as_given(),
                                       normals = blend.normals_as_given();
    for (std::size_t i = 0; i < places.size(); ++i)
    {
        EXPECT_LT((places[i].cast<double>() - motion(c.places[i])).norm(), 4e-6);
        EXPECT_LT((normals[i].cast<double>() - motion.R * c.normals[i].direction).norm(),
                  2e-6);
    }
}

TEST(SampleBlend, idle_parts_stay_while_others_move)
{
    Case c(support::built(support::joined(support::box_shape({0, 0, 0}, {1, 3, 10}),
                                          support::box_shape({2, 0, 0}, {3, 3, 10})),
                          10, 0, Fill::Solid, 0.2),
           10.0, 1.0);
    c.motions.clear();
    std::mt19937 rng(6);
    for (int i = 0; i < 4000; ++i)
        c.add({random_number(rng, 0, 1) + 2 * (i % 2), random_number(rng, 0, 3),
               random_number(rng, 0, 10)});
    c.add_normals(rng);
    const std::vector<int> component = connected_components(c.body.cells);
    ASSERT_EQ(*std::max_element(component.begin(), component.end()), 1);
    const int idle = component[idx(c.cell_at({2.5, 1.5, 5}))];
    for (std::size_t i = 0; i < component.size(); ++i)
        if (component[i] == idle)
            c.constraints[i].hold = Hold::Idle;
    SampleBlend blend = c.blend();
    blend.apply(c.poses, c.motions);
    const Difference d = difference(c, blend, FieldKind::Blend);
    EXPECT_LT(d.place, 1e-6);
    EXPECT_LT(d.normal, 2e-5);
    const std::vector<Eigen::Vector3f> places = blend.positions_as_given();
    int num_moved = 0;
    for (std::size_t i = 0; i < places.size(); ++i)
    {
        const bool is_at_rest = places[i] == c.places[i].cast<float>();
        if (component[idx(c.own[i])] == idle)
        {
            EXPECT_TRUE(is_at_rest);
        }
        num_moved += !is_at_rest;
    }
    EXPECT_GT(num_moved, 1000);
}

TEST(SampleBlend, a_sample_may_follow_very_many_cells)
{
    // A hundred pieces of one leaf, glued in a chain.
    std::mt19937 rng(7);
    Cells cells;
    std::vector<Pose> poses;
    for (int i = 0; i < 100; ++i)
    {
        Cell cell;
        cell.box_centre = Eigen::Vector3d::Constant(0.5);
        cell.edge = 1.0;
        cell.centre = cell.box_centre + random_vector(rng, 0.5);
        cells.cells.push_back(cell);
        poses.push_back(support::random_pose(rng, 1.0));
        cells.first_neighbour.push_back(static_cast<int>(cells.neighbours.size()));
        for (const int other : {i - 1, i + 1})
            if (other >= 0 && other < 100)
                cells.neighbours.push_back(other);
    }
    cells.first_neighbour.push_back(static_cast<int>(cells.neighbours.size()));
    std::vector<Eigen::Vector3d> places;
    std::vector<int> own;
    for (int i = 0; i < 3000; ++i)
    {
        places.push_back(Eigen::Vector3d::Constant(0.5) + random_vector(rng, 0.5));
        own.push_back(i % 100);
    }
    SampleBlend blend(FieldKind::Blend, cells, {places, own, {}}, {}, {});
    blend.apply(poses, {});
    const Field field = fit_field(FieldKind::Blend, cells, poses, {}, {});
    const std::vector<Eigen::Vector3d> wanted = field.displacements(places, own);
    const std::vector<Eigen::Vector3f> found = blend.positions_as_given();
    for (std::size_t i = 0; i < places.size(); ++i)
        EXPECT_LT((found[i].cast<double>() - places[i] - wanted[i]).norm(), 1e-5);
}

TEST(SampleBlend, small_groups_and_large_ones_give_the_same)
{
    const Case many = held_bar();
    SampleBlend all = many.blend();
    all.apply(many.poses, many.motions);
    const std::vector<Eigen::Vector3f> wanted = all.positions_as_given();
    Case few = held_bar();
    few.places.clear();
    few.own.clear();
    few.normals.clear();
    for (std::size_t i = 0; i < many.places.size(); i += 40)
    {
        few.places.push_back(many.places[i]);
        few.own.push_back(many.own[i]);
    }
    SampleBlend some = few.blend();
    some.apply(few.poses, few.motions);
    EXPECT_TRUE(some.normals().empty());
    const std::vector<Eigen::Vector3f> found = some.positions_as_given();
    for (std::size_t i = 0; i < found.size(); ++i)
        EXPECT_LT((found[i] - wanted[40 * i]).norm(), 1e-5);
}

TEST(SampleBlend, normals_stand_where_their_samples_do)
{
    for (const bool may_turn : {false, true})
    {
        const Case c = held_bar(may_turn);
        const SampleBlend blend = c.blend();
        EXPECT_TRUE(std::equal(blend.order().begin(), blend.order().end(),
                               blend.normal_order().begin(), blend.normal_order().end()));
    }
}

TEST(SampleBlend, several_normals_may_be_at_one_sample)
{
    Case c = held_bar();
    std::mt19937 rng(8);
    c.normals.resize(50);
    for (const std::uint32_t sample : {7u, 4000u, 7u, 6000u})
        c.normals.push_back({sample, random_vector(rng, 1.0).normalized()});
    SampleBlend blend = c.blend();
    blend.apply(c.poses, c.motions);
    EXPECT_LT(difference(c, blend, FieldKind::Blend).normal, 2e-5);
}

TEST(SampleBlend, instruction_sets_and_threads_do_not_change_a_bit)
{
    const Case c = held_bar();
    std::vector<float> places, normals;
    std::vector<std::uint32_t> order;
    for (const int threads : {1, 2, 4})
    {
        const ThreadLimit limit(threads);
        SampleBlend blend = c.blend();
        for (const InstructionSet set : instruction_sets())
        {
            blend.use(set);
            blend.apply(c.poses, c.motions);
            if (places.empty())
            {
                places = values_of(blend.positions());
                normals = values_of(blend.normals());
                order.assign(blend.order().begin(), blend.order().end());
            }
            EXPECT_EQ(values_of(blend.positions()), places);
            EXPECT_EQ(values_of(blend.normals()), normals);
        }
        EXPECT_TRUE(std::equal(order.begin(), order.end(), blend.order().begin()));
    }
}

TEST(SampleBlend, a_frame_allocates_nothing)
{
    const Case c = held_bar();
    SampleBlend blend = c.blend();
    blend.apply(c.poses, c.motions);
    const std::size_t before = support::num_allocations();
    for (int frame = 0; frame < 20; ++frame)
        blend.apply(c.poses, c.motions);
    EXPECT_EQ(support::num_allocations(), before);
    const std::vector<float> counted = values_of(blend.positions());
    EXPECT_GT(support::num_allocations(), before);
}

} // namespace cellwarp::core
