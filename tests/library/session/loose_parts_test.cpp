// SPDX-License-Identifier: GPL-3.0-or-later
// Parts that no region holds, from the file to the samples.
#include "library/session/loose_parts.h"

#include <cmath>
#include <numbers>
#include <random>
#include <string>

#include <gtest/gtest.h>

#include "io/formats/field_file.h"
#include "library/session/deformation.h"
#include "library/session/holding_warnings.h"
#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "octree/base/point_tree.h"
#include "tests/support/random.h"
#include "tests/support/sessions.h"
#include "tests/support/shapes.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::box_shape;
using support::contains;
using support::handles;
using support::joined;
using support::model;
using support::played;
using support::settings;

namespace
{

SessionSettings staying(SessionSettings s)
{
    s.cells.loose_follow = false;
    return s;
}

Shape bar()
{
    return box_shape({0, 0, 0}, {4, 1, 1}, 4);
}

/// Turns by 60 degrees about the middle of the bar's end.
const std::string kTurn = "fixed foot box -1 -1 -1 0.5 2 2\n"
                          "handle head box 3.5 -1 -1 4.01 2 2\n"
                          "frame 1\nmove head rotate 0 0 1 60 about 2 0.5 0.5\n";

Eigen::Vector3d turned(const Eigen::Vector3d& x)
{
    const Eigen::Vector3d pivot(2, 0.5, 0.5);
    return pivot +
           rotation_about(Eigen::Vector3d::UnitZ(), std::numbers::pi / 3) * (x - pivot);
}

/// A cube on its tip, which is \p gap off the bar's end.
Shape cube_on_tip(double gap)
{
    Shape cube = box_shape({-0.4, -0.4, -0.4}, {0.4, 0.4, 0.4}, 4);
    Eigen::Matrix3d R;
    R.row(0) = Eigen::RowVector3d(1, 1, 1).normalized();
    R.row(1) = Eigen::RowVector3d(1, -1, 0).normalized();
    R.row(2) = R.row(0).cross(R.row(1));
    for (Eigen::Vector3d& x : cube.samples)
        x = R * x + Eigen::Vector3d(4 + gap + 0.4 * std::sqrt(3.0), 0.52, 0.47);
    return cube;
}

/// The held parts come first in the model, \p count samples.
void expect_held_parts_do_not_notice(const Shape& shape, const std::string& text,
                                     const SessionSettings& s, std::size_t count)
{
    const Session follows = played(shape, text, s);
    const Session stays = played(shape, text, staying(s));
    EXPECT_EQ(follows.frames().back().solve.energy_after,
              stays.frames().back().solve.energy_after);
    EXPECT_EQ(follows.frames().back().solve.iterations,
              stays.frames().back().solve.iterations);
    const CellSystem &one = *follows.system(), &other = *stays.system();
    ASSERT_EQ(one.body().cells.size(), other.body().cells.size());
    for (std::size_t c = 0; c < one.poses().size(); ++c)
        if (one.constraints()[c].hold != Hold::Following)
        {
            EXPECT_EQ(one.poses()[c].R, other.poses()[c].R);
            EXPECT_EQ(one.poses()[c].p, other.poses()[c].p);
        }
    for (std::size_t i = 0; i < count; ++i)
        EXPECT_LT((follows.deformed().samples[i] - stays.deformed().samples[i]).norm(),
                  1e-12);
}

/// The largest change of the distance between samples of loose parts and held ones that
/// are nearer than \p near at rest.
double largest_change(const Session& session, const Shape& shape, std::size_t count,
                      double near)
{
    const PointTree held(std::span(shape.samples).first(count));
    std::vector<PointTree::Neighbour> found;
    double largest = -1.0;
    for (std::size_t i = count; i < shape.samples.size(); ++i)
    {
        held.within(shape.samples[i], near, found);
        for (const auto& [k, squared] : found)
        {
            const Eigen::Vector3d now =
                session.deformed().samples[i] - session.deformed().samples[k];
            largest = std::max(largest, std::abs(now.norm() - std::sqrt(squared)));
        }
    }
    return largest;
}

} // namespace

TEST(LooseParts, a_block_off_the_end_goes_with_it_as_one_body)
{
    // It faces the end with sixteen cells, or with one of its corners.
    for (const bool has_tip : {false, true})
    {
        SCOPED_TRACE(has_tip);
        const Shape shape = joined(
            bar(), has_tip ? cube_on_tip(0.25) : box_shape({4.25, 0, 0}, {5.25, 1, 1}));
        SessionSettings s = settings(21);
        s.gradient_tolerance = 1e-10;
        const Session session = played(shape, kTurn, s);
        for (std::size_t i = bar().samples.size(); i < shape.samples.size(); ++i)
            EXPECT_LT((session.deformed().samples[i] - turned(shape.samples[i])).norm(),
                      2e-11);
        // Rigid to 1e-13.
        const CellSystem& system = *session.system();
        int num_following = 0;
        Eigen::Matrix3d R = Eigen::Matrix3d::Zero();
        for (std::size_t c = 0; c < system.poses().size(); ++c)
            if (system.constraints()[c].hold == Hold::Following)
            {
                if (num_following++ == 0)
                    R = system.poses()[c].R;
                EXPECT_LT((system.poses()[c].R - R).norm(), 1e-13);
            }
        EXPECT_GT(num_following, 4);
        EXPECT_EQ(parts_by_hold(system).held, 1u);
        EXPECT_EQ(parts_by_hold(system).follow, 1u);
        EXPECT_EQ(parts_by_hold(system).stay, 0u);
        EXPECT_TRUE(
            contains(session.warnings().at(0),
                     "1 of 2 parts have no region and go with the part nearest to "
                     "them: 1 with 0 ("));
        expect_held_parts_do_not_notice(shape, kTurn, s, bar().samples.size());
    }
}

TEST(LooseParts, stay_where_they_are_told_to)
{
    const Shape shape = joined(bar(), box_shape({4.25, 0, 0}, {5.25, 1, 1}));
    const Session session = played(shape, kTurn, staying(settings(21)));
    for (std::size_t i = bar().samples.size(); i < shape.samples.size(); ++i)
        EXPECT_EQ(session.deformed().samples[i], model(shape).samples[i]);
    EXPECT_EQ(parts_by_hold(*session.system()).stay, 1u);
}

TEST(LooseParts, what_touches_or_overlaps_still_does_so)
{
    // A body on wheels: two overlap it, two touch it, and a crate lies on its back.
    const Shape body = box_shape({0, 0, 0}, {4, 1, 1}, 20);
    Shape shape = body;
    const auto add = [&](const Eigen::Vector3d& low, const Eigen::Vector3d& high)
    { shape = joined(shape, box_shape(low, high, 20)); };
    add({0.713, -0.213, -0.311}, {1.217, 0.061, 0.317});
    add({0.713, 0.941, -0.311}, {1.217, 1.213, 0.317});
    add({2.813, -0.271, -0.311}, {3.317, 0, 0.317});
    add({2.813, 1, -0.311}, {3.317, 1.271, 0.317});
    add({1.611, 0.213, 1}, {2.413, 0.817, 1.411});
    const std::string text = "fixed foot box -1 -1 -1 0.4 2 2\n"
                             "handle head box 3.6 -1 -1 4.01 2 2\n"
                             "frame 1\nmove head rotate 0 1 0 -50 about border\n";
    for (const int depth : {0, 1})
    {
        SCOPED_TRACE(depth);
        const Session session = played(shape, text, settings(24, depth));
        EXPECT_EQ(parts_by_hold(*session.system()).follow, 5u);
        const RestShape& rest = session.system()->rest();
        const double voxel = (rest.frame.to_model(Eigen::Vector3d::UnitX() *
                                                  rest.material.grid.shape().voxel()) -
                              rest.frame.to_model(Eigen::Vector3d::Zero()))
                                 .norm();
        const double change = largest_change(session, shape, body.samples.size(), voxel);
        EXPECT_GE(change, 0.0) << "no samples are near";
        // A coarsest cell has twelve voxels a side.
        EXPECT_LT(change, voxel);
        const Session stays = played(shape, text, staying(settings(24, depth)));
        EXPECT_GT(largest_change(stays, shape, body.samples.size(), voxel), 10 * voxel);
    }
    expect_held_parts_do_not_notice(shape, text, settings(24), body.samples.size());
}

TEST(LooseParts, what_stands_on_a_loose_part_still_does_so)
{
    // Three crates on one another, on a bar that bends under them.
    const Shape bar = box_shape({0, 0, 0}, {4, 1, 1}, 40);
    std::vector<Shape> crates;
    for (int k = 0; k < 3; ++k)
        crates.push_back(box_shape({1.113 + 0.2 * k, 0.107 + 0.1 * k, 1 + 0.4 * k},
                                   {2.871 - 0.2 * k, 0.893 - 0.1 * k, 1.4 + 0.4 * k},
                                   40));
    Shape shape = bar;
    std::vector<std::size_t> first = {0, bar.samples.size()};
    for (const Shape& crate : crates)
    {
        shape = joined(shape, crate);
        first.push_back(shape.samples.size());
    }
    SessionSettings s = settings(24);
    s.keeps_fields = true;
    const Session session = played(shape,
                                   "fixed foot box -1 -1 -1 0.4 2 1.01\n"
                                   "handle head box 3.6 -1 -1 4.01 2 1.01\n"
                                   "frame 1\nmove head rotate 0 1 0 50 about border\n",
                                   s);
    EXPECT_EQ(parts_by_hold(*session.system()).follow, 3u);
    const std::vector<Eigen::Vector3d>& now = session.deformed().samples;
    const std::vector<Eigen::Vector3d> rest = model(shape).samples;
    // Samples of each crate's foot and those of its support that are near at rest.
    for (std::size_t k = 1; k + 1 < first.size(); ++k)
    {
        const double height = 1 + 0.4 * static_cast<double>(k - 1);
        const PointTree support(std::vector<Eigen::Vector3d>(
            rest.begin() + static_cast<std::ptrdiff_t>(first[k - 1]),
            rest.begin() + static_cast<std::ptrdiff_t>(first[k])));
        double largest = 0.0;
        int num_pairs = 0;
        for (std::size_t i = first[k]; i < first[k + 1]; ++i)
        {
            if (rest[i].z() > height + 1e-6)
                continue;
            const PointTree::Neighbour near = support.nearest(rest[i]);
            if (near.distance_squared > 0.02 * 0.02)
                continue;
            ++num_pairs;
            const double away = (now[i] - now[first[k - 1] + near.index]).norm();
            largest =
                std::max(largest, std::abs(away - std::sqrt(near.distance_squared)));
        }
        EXPECT_GT(num_pairs, 100);
        EXPECT_LT(largest, 0.014) << "a voxel"; // pairs stretch as the material does
    }
    // A field file moves the samples to nearly the same places, also those that lie in
    // voxels of the part beside them.
    const Deformation deformation(parse_field("f.cwf", field_bytes(session.field_file())),
                                  "f.cwf");
    std::vector<Eigen::Vector3d> carried = model(shape).samples;
    deformation.carry({carried});
    double farthest = 0.0;
    for (std::size_t i = 0; i < now.size(); ++i)
        farthest = std::max(farthest, (carried[i] - now[i]).norm());
    EXPECT_LT(farthest, 1e-3); // a fourteenth of a voxel
}

TEST(LooseParts, what_lies_in_a_hollow_goes_with_what_is_around_it)
{
    Shape hollow = box_shape({0.2, 0.2, 0.2}, {0.8, 0.8, 0.8});
    for (Triangle& triangle : hollow.triangles)
        std::swap(triangle[1], triangle[2]);
    Shape shape = joined(box_shape({0, 0, 0}, {4, 1, 1}), hollow);
    const std::size_t count = shape.samples.size();
    shape = joined(shape, box_shape({0.4, 0.4, 0.4}, {0.6, 0.6, 0.6}));
    const std::string text = "handle head box -1 -1 -1 1 2 2\n"
                             "fixed foot box 3.5 -1 -1 5 2 2\n"
                             "frame 1\nmove head rotate 1 0 0 35 about 0 0.5 0.5\n";
    const Session session = played(shape, text, settings(20));
    const Eigen::Matrix3d R =
        rotation_about(Eigen::Vector3d::UnitX(), 35 * std::numbers::pi / 180);
    const Eigen::Vector3d pivot(0, 0.5, 0.5);
    // The handle holds what lies in the hollow, too: it is no loose part.
    const std::string around = "handle head indices 0-" + std::to_string(count - 1) +
                               "\n" + text.substr(text.find("frame"));
    for (const std::string& one : {text, around})
    {
        const Session turns = played(shape, one, settings(20));
        for (std::size_t i = count; i < shape.samples.size(); ++i)
            EXPECT_LT(
                (turns.deformed().samples[i] - pivot - R * (shape.samples[i] - pivot))
                    .norm(),
                1e-10);
    }
}

TEST(LooseParts, many_crumbs_follow)
{
    Shape shape = bar();
    std::mt19937 rng(7);
    const std::size_t count = shape.samples.size();
    for (int k = 0; k < 300; ++k)
    {
        // On a lattice around the bar, so that none touch.
        const Eigen::Vector3d low(0.4 * (k % 10), 1.3 + 0.4 * (k / 10 % 5),
                                  0.4 * (k / 50));
        const Eigen::Vector3d at =
            low + Eigen::Vector3d(1, 1, 1) * support::random_number(rng, 0.0, 0.1);
        shape = joined(shape, box_shape(at, at + Eigen::Vector3d(0.1, 0.1, 0.1), 1));
    }
    const std::string text = "fixed foot box -0.1 -1 -1 0.5 1.01 2\n"
                             "handle head box 3.5 -1 -1 4.01 1.01 1.01\n"
                             "frame 1\nmove head rotate 0 0 1 -60 about border\n";
    const Session session = played(shape, text, settings(16));
    EXPECT_EQ(parts_by_hold(*session.system()).follow, 300u);
    // Each is as large as it was.
    for (std::size_t i = count; i + 7 < shape.samples.size(); i += 8)
        for (std::size_t k = 1; k < 8; ++k)
            EXPECT_NEAR(
                (session.deformed().samples[i + k] - session.deformed().samples[i])
                    .norm(),
                (shape.samples[i + k] - shape.samples[i]).norm(), 2e-3);
    expect_held_parts_do_not_notice(shape, text, settings(16), count);
}

TEST(LooseParts, end_at_one_place_in_cells_of_any_size)
{
    const Shape shape = joined(bar(), box_shape({1.5, 1.2, 0.1}, {2.3, 1.8, 0.9}));
    const Session large = played(shape, kTurn, settings(20));
    const Session small = played(shape, kTurn, settings(20, 1));
    EXPECT_GT(small.system()->body().cells.size(), large.system()->body().cells.size());
    for (std::size_t i = 0; i < shape.samples.size(); ++i)
        EXPECT_LT((large.deformed().samples[i] - small.deformed().samples[i]).norm(),
                  0.02);
}

TEST(LooseParts, are_the_same_to_the_bit_again_and_on_one_thread)
{
    const Shape shape = joined(bar(), box_shape({1.5, 1.2, 0.1}, {2.3, 1.8, 0.9}));
    const Session once = played(shape, kTurn, settings(20, 1));
    const ThreadLimit limit(1);
    const Session again = played(shape, kTurn, settings(20, 1));
    for (std::size_t i = 0; i < shape.samples.size(); ++i)
        EXPECT_EQ(once.deformed().samples[i], again.deformed().samples[i]);
}

TEST(LooseParts, follow_from_part_to_part)
{
    // Three blocks in a row off the end, each nearer to the one before it.
    Shape shape = bar();
    for (int k = 0; k < 3; ++k)
        shape = joined(shape,
                       box_shape({4.2 + 0.7 * k, 0.2, 0.2}, {4.7 + 0.7 * k, 0.8, 0.8}));
    const Session session = played(shape, kTurn, settings(24));
    EXPECT_TRUE(contains(session.warnings().at(0), ": 1 with 0, 2 with 1, 3 with 2 ("));
    for (std::size_t i = bar().samples.size(); i < shape.samples.size(); ++i)
        EXPECT_LT((session.deformed().samples[i] - turned(shape.samples[i])).norm(),
                  1e-10);
}

TEST(LooseParts, keep_out_of_what_does_not_pass_through_them)
{
    // A roof stands on a wall behind the bar's fixed end; the other end is lifted into
    // it.
    std::vector<double> along = {-0.6, -0.15};
    for (int k = 0; k <= 32; ++k)
        along.push_back(0.125 * k);
    const Shape shape = joined(
        box_shape({0, 0, 0}, {4, 1, 0.5}, 8),
        support::blocks_shape(
            {along, {0, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 1}, {0, 0.7, 0.9}},
            [](int i, int, int k) { return i == 0 || k == 1; }));
    const std::string text = "fixed foot box -1 -1 -1 0.5 2 0.55\n"
                             "handle head box 3.5 -1 -1 4.01 2 0.55\n"
                             "frame 1\nmove head translate 0 0 0.4\n";
    SessionSettings s = settings(24);
    const Session through = played(shape, text, s);
    s.cells.has_contact = true;
    const Session beside = played(shape, text, s);
    const auto lowest = [&](const Session& session)
    {
        // The gap between the roof over the lifted end and the bar's top there.
        double gap = 1e300;
        for (std::size_t i = 0; i < shape.samples.size(); ++i)
            if (shape.samples[i].z() == 0.7 && shape.samples[i].x() == 4.0)
                for (std::size_t k = 0; k < shape.samples.size(); ++k)
                    if (shape.samples[k].z() == 0.5 && shape.samples[k].x() == 4.0 &&
                        shape.samples[k].y() == shape.samples[i].y())
                        gap = std::min(gap, session.deformed().samples[i].z() -
                                                session.deformed().samples[k].z());
        return gap;
    };
    EXPECT_LT(lowest(through), -0.15);
    EXPECT_GT(lowest(beside), -0.01);
}

TEST(LooseParts, stay_in_the_plane_of_a_flat_shape)
{
    const Shape shape = joined(support::sheet_shape(4, 1, 8),
                               []
                               {
                                   Shape other = support::sheet_shape(0.8, 0.6, 6);
                                   for (Eigen::Vector3d& x : other.samples)
                                       x += Eigen::Vector3d(4.3, 0.2, 0);
                                   return other;
                               }());
    SessionSettings s = settings(24);
    s.cells.is_flat = true;
    const Session session =
        played(shape,
               "fixed foot box -1 -1 -1 0.5 2 2\nhandle head box 3.5 -1 -1 4.01 2 2\n"
               "frame 1\nmove head rotate 0 0 1 60 about 2 0.5 0\n",
               s);
    const Eigen::Vector3d pivot(2, 0.5, 0);
    const Eigen::Matrix3d R =
        rotation_about(Eigen::Vector3d::UnitZ(), std::numbers::pi / 3);
    for (std::size_t i = 0; i < shape.samples.size(); ++i)
    {
        EXPECT_EQ(session.deformed().samples[i].z(), 0.0);
        if (!(shape.samples[i].x() > 4.1))
            continue;
        EXPECT_LT((session.deformed().samples[i] - pivot - R * (shape.samples[i] - pivot))
                      .norm(),
                  1e-10);
    }
}

TEST(LooseParts, of_clouds_follow_as_well)
{
    Shape shape;
    shape.samples = support::random_points(box_shape({0, 0, 0}, {4, 1, 1}), 6000, 3);
    const std::vector<Eigen::Vector3d> island =
        support::random_points(box_shape({4.6, 0.2, 0.2}, {5.2, 0.8, 0.8}), 900, 4);
    const std::size_t count = shape.samples.size();
    shape.samples.insert(shape.samples.end(), island.begin(), island.end());
    const Session session = played(shape, kTurn, settings(24));
    EXPECT_GE(parts_by_hold(*session.system()).follow, 1u);
    for (std::size_t i = count; i < shape.samples.size(); ++i)
        EXPECT_LT((session.deformed().samples[i] - turned(shape.samples[i])).norm(),
                  1e-3);
}

} // namespace cellwarp::core
