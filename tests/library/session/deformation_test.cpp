// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/deformation.h"

#include <cstring>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "io/base/error.h"
#include "io/formats/geometry_file.h"
#include "library/session/session.h"
#include "octree/base/parallel.h"
#include "tests/support/allocations.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

namespace
{

/// A twisted bar beside a loose cube, with a pin, bent a second time after a commit.
const std::string kStatements = "cellwarp-handles 1\n"
                                "fixed foot box -1 -1 -1 1 1 0.4\n"
                                "handle head box -1 -1 3.6 1 1 5\n"
                                "pin tip sphere 0.5 0.5 2 0.2\n"
                                "frame 1\n"
                                "move head rotate 0 0 1 60 translate 0.3 0 0\n"
                                "move tip translate 0.05 0.02 0\n"
                                "commit\n"
                                "fixed foot box -1 -1 -1 1 1 0.4\n"
                                "handle head box -1 -1 3.3 2 2 5\n"
                                "frame 2\n"
                                "move head rotate 1 0 0 25\n";

Shape bar_and_cube()
{
    return support::joined(support::box_shape({-0.5, -0.5, 0}, {0.5, 0.5, 4}, 9),
                           support::box_shape({1.5, -0.5, 0}, {2.5, 0.5, 1}, 3));
}

struct Played
{
    Geometry model;
    Session session;

    explicit Played(FieldKind kind, double threshold = INFINITY)
        : model(scan_geometry("model.obj", support::obj_text(bar_and_cube())).geometry),
          session(model, parse_handles("h.handles", kStatements),
                  settings(kind, threshold))
    {
        while (session.next_frame(true))
            ;
    }
    static SessionSettings settings(FieldKind kind, double threshold)
    {
        SessionSettings s;
        s.cells.across = 12;
        s.cells.loose_follow = false; // the cube stays at rest
        s.cells.threshold = threshold;
        s.cells.max_depth = threshold < INFINITY ? 1 : 0;
        s.field = kind;
        s.keeps_fields = true;
        return s;
    }
    Deformation deformation() const
    {
        return Deformation(parse_field("f.cwf", field_bytes(session.field_file())),
                           "f.cwf");
    }
};

std::vector<Eigen::Vector3d> moved(const Deformation& deformation,
                                   std::vector<Eigen::Vector3d> places)
{
    deformation.carry({places});
    return places;
}

bool same_bits(const std::vector<Eigen::Vector3d>& a,
               const std::vector<Eigen::Vector3d>& b)
{
    return a.size() == b.size() &&
           std::memcmp(a.data(), b.data(), a.size() * sizeof a.front()) == 0;
}

} // namespace

TEST(Deformation, moves_the_samples_of_its_model_as_the_session_did_to_the_bit)
{
    for (const FieldKind kind :
         {FieldKind::Blend, FieldKind::Closest4, FieldKind::Rbf, FieldKind::RbfGlobal})
    {
        const Played played(kind);
        const Deformation deformation = played.deformation();
        EXPECT_EQ(deformation.num_maps(), 2u);
        EXPECT_TRUE(same_bits(moved(deformation, played.model.samples),
                              played.session.deformed().samples));
    }
    const Played refined(FieldKind::Rbf, 1e-3);
    EXPECT_TRUE(same_bits(moved(refined.deformation(), refined.model.samples),
                          refined.session.deformed().samples));
}

TEST(Deformation, takes_no_more_memory_than_it_says_or_nothing)
{
    const Played played(FieldKind::Rbf);
    const FieldFile file = parse_field("f.cwf", field_bytes(played.session.field_file()));
    const double bytes = memory_of(file);
    {
        const support::MostMemory memory;
        const Deformation deformation(file, "f.cwf", bytes);
        EXPECT_LE(static_cast<double>(memory.bytes()), bytes);
        EXPECT_GE(static_cast<double>(memory.bytes()), 0.2 * bytes);
    }
    const support::MostMemory memory;
    EXPECT_TRUE(support::contains(
        support::error_of(Fault::Budget,
                          [&] { Deformation(file, "f.cwf", 0.99 * bytes); }),
        "f.cwf: the field needs about "));
    EXPECT_LT(memory.bytes(), 10000u);
}

TEST(Deformation, gives_a_point_the_same_bits_alone_and_among_others)
{
    const Played played(FieldKind::Rbf);
    const Deformation deformation = played.deformation();
    std::mt19937 rng(4);
    std::vector<Eigen::Vector3d> places;
    for (int i = 0; i < 500; ++i)
        places.push_back(support::random_vector(rng, 1.5) + Eigen::Vector3d(0.5, 0, 2));
    const std::vector<Eigen::Vector3d> together = moved(deformation, places);
    for (std::size_t i = 0; i < places.size(); ++i)
        EXPECT_TRUE(same_bits(moved(deformation, {places[i]}), {together[i]})) << i;
    std::reverse(places.begin(), places.end());
    std::vector<Eigen::Vector3d> reversed;
    {
        const ThreadLimit one(1);
        reversed = moved(deformation, places);
    }
    std::reverse(reversed.begin(), reversed.end());
    EXPECT_TRUE(same_bits(reversed, together));
}

TEST(Deformation, turns_normals_tangents_and_rotations_by_its_own_slopes)
{
    const Played played(FieldKind::Rbf);
    const Deformation deformation = played.deformation();
    const Eigen::Vector3d x(0.31, 0.5, 1.3);
    constexpr double h = 1e-5;
    Eigen::Matrix3d J;
    for (int k = 0; k < 3; ++k)
        J.col(k) = (moved(deformation, {x + h * Eigen::Vector3d::Unit(k)})[0] -
                    moved(deformation, {x - h * Eigen::Vector3d::Unit(k)})[0]) /
                   (2.0 * h);
    std::vector<Eigen::Vector3d> places = {x}, normals = {Eigen::Vector3d::UnitY()},
                                 tangents = {Eigen::Vector3d::UnitZ()};
    std::vector<Eigen::Vector4d> rotations = {{1, 0, 0, 0}};
    const std::vector<std::uint32_t> at = {0};
    deformation.carry({places, {at, normals}, {at, tangents}, {at, rotations}});
    EXPECT_LT(
        (normals[0] - (J.inverse().transpose() * Eigen::Vector3d::UnitY()).normalized())
            .norm(),
        1e-6);
    EXPECT_LT((tangents[0] - J.col(2).normalized()).norm(), 1e-6);
    EXPECT_NEAR(rotations[0].norm(), 1.0, 1e-12);
    EXPECT_GT(std::abs(rotations[0][3]), 0.08);
    EXPECT_EQ(places[0], moved(deformation, {x})[0]);
}

TEST(Deformation, leaves_at_rest_what_belongs_to_a_part_that_nothing_holds)
{
    const Played played(FieldKind::Rbf);
    // In the cube, on it, and just beside.
    const std::vector<Eigen::Vector3d> places = {
        {2.0, 0.1, 0.5}, {2.5, 0.5, 1.0}, {2.52, 0.1, 0.3}};
    EXPECT_TRUE(same_bits(moved(played.deformation(), places), places));
}

TEST(Deformation, takes_points_far_outside_along_with_the_nearest_cell)
{
    const Played played(FieldKind::Rbf);
    const Deformation deformation = played.deformation();
    // Beyond the head: its cells make its motions, one after the other.
    const Eigen::Vector3d a(0.1, 0.2, 60.0), b(-0.3, 0.1, 90.0);
    const std::vector<Eigen::Vector3d> now = moved(deformation, {a, b});
    EXPECT_TRUE(now[0].allFinite());
    EXPECT_NEAR((now[0] - now[1]).norm(), (a - b).norm(), 1e-9);
}

TEST(Deformation, takes_points_at_any_distance_or_says_that_they_are_too_far)
{
    const Played played(FieldKind::Rbf);
    const Deformation deformation = played.deformation();
    // The second map turns by 25 degrees, the first by 60: no length changes.
    const std::vector<Eigen::Vector3d> now =
        moved(deformation, {{0, 0, 1e10}, {0, 0, 1e90}});
    EXPECT_NEAR(now[0].norm(), 1e10, 10.0);
    EXPECT_NEAR(now[1].norm() / 1e90, 1.0, 1e-9);
    EXPECT_TRUE(
        support::contains(support::error_of(Fault::Malformed,
                                            [&] {
                                                moved(deformation, {{0, 0, 1e120}});
                                            }),
                          "too far"));
}

TEST(Deformation, is_refused_where_its_material_does_not_fill_its_grid)
{
    const Played played(FieldKind::Blend);
    FieldFile file = played.session.field_file();
    file.stages[0].run_lengths.back() += 1;
    const auto use = [&] { Deformation(file, "f.cwf"); };
    EXPECT_TRUE(
        support::contains(support::error_of(Fault::Malformed, use), "fill the grid"));
    file.stages[0].run_lengths.back() -= 1;
    for (std::int32_t& piece : file.stages[1].run_pieces)
        piece = -1;
    EXPECT_TRUE(
        support::contains(support::error_of(Fault::Malformed, use), "no material"));
}

} // namespace cellwarp::core
