// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/flat.h"

#include <cmath>
#include <numbers>
#include <random>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "io/base/number.h"
#include "io/formats/geometry_file.h"
#include "library/session/session.h"
#include "tests/support/random.h"
#include "tests/support/random_poses.h"
#include "tests/support/shapes.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

namespace
{

using support::contains;
using support::error_of;

/// A flat L of arms 3 and 2 long and 1 wide, from the origin.
Shape flat_l()
{
    Shape shape = support::joined(support::sheet_shape(3.0, 1.0, 6),
                                  support::sheet_shape(1.0, 2.0, 6));
    const std::size_t first = support::sheet_shape(3.0, 1.0, 6).samples.size();
    for (std::size_t i = first; i < shape.samples.size(); ++i)
        shape.samples[i].y() += 1.0;
    return shape;
}

Session played(const Shape& shape, const std::string& statements,
               std::optional<bool> is_flat, double tolerance = 1e-8,
               SessionSettings settings = {})
{
    settings.cells.across = 12;
    settings.cells.is_flat = is_flat;
    settings.gradient_tolerance = tolerance;
    Session session(scan_geometry("model.obj", support::obj_text(shape)).geometry,
                    parse_handles("h.handles", "cellwarp-handles 1\n" + statements),
                    settings);
    while (session.next_frame(true))
        ;
    return session;
}

const std::string kEnds = "fixed foot box -1 -1 -1 0.3 4 1\n"
                          "handle hand box 2.7 -1 -1 4 4 1\n";
const std::string kBend = "fixed foot box -1 -1 -1 0.3 4 1\n"
                          "handle hand box 2.7 -1 -1 4 4 1\n"
                          "frame 1\nmove hand rotate 0 0 1 50 about 1 1 0\n";

} // namespace

TEST(Flat, the_normal_of_a_plane_is_found_wherever_it_lies)
{
    std::mt19937 rng(1);
    for (int trial = 0; trial < 20; ++trial)
    {
        const Eigen::Matrix3d R = support::random_rotation(rng);
        const Eigen::Vector3d t = support::random_vector(rng, 1e3);
        std::vector<Eigen::Vector3d> places;
        for (const Eigen::Vector3d& x : flat_l().samples)
            places.push_back(R * x + t);
        const std::optional<Eigen::Vector3d> normal = plane_normal(places);
        ASSERT_TRUE(normal);
        EXPECT_LT(normal->cross(R.col(2)).norm(), 1e-12);
        const WorkFrame frame = frame_along_plane(places, *normal);
        EXPECT_LT(
            (frame.axes * frame.axes.transpose() - Eigen::Matrix3d::Identity()).norm(),
            1e-14);
        EXPECT_GT(frame.axes.determinant(), 0.0);
        for (const Eigen::Vector3d& x : places)
        {
            const Eigen::Vector3d in = frame.to_work(x);
            EXPECT_NEAR(in.z(), 0.0, 1e-11);
            EXPECT_TRUE((in.array() > -1e-11).all() &&
                        (in.array() < frame.size.array() + 1e-11).all());
        }
        places[7] += 1e-6 * R.col(2);
        EXPECT_FALSE(plane_normal(places));
    }
    EXPECT_EQ(*plane_normal(flat_l().samples), Eigen::Vector3d::UnitZ());
}

TEST(Flat, points_on_a_line_and_one_point_lie_in_a_plane)
{
    const Eigen::Vector3d along(1, 2, -3);
    const std::optional<Eigen::Vector3d> normal =
        plane_normal({{0, 0, 0}, along, 2.5 * along});
    ASSERT_TRUE(normal);
    EXPECT_NEAR(normal->dot(along), 0.0, 1e-12);
    EXPECT_TRUE(plane_normal({{3, 4, 5}, {3, 4, 5}}));
    EXPECT_EQ(*plane_normal({{0, 0, 0}, {1, 0, 0}, {3, 0, 0}}), Eigen::Vector3d::UnitZ());
    EXPECT_EQ(*plane_normal({{0, 0, 0}, {0, 1, 0}}), Eigen::Vector3d::UnitZ());
}

TEST(Flat, planes_of_floats_and_planes_that_hardly_lean_are_planes)
{
    std::mt19937 rng(2);
    for (const double angle : {1.0, 1e-3, 1e-6, 1.7e-9, 1e-12})
    {
        const Eigen::Matrix3d R =
            Eigen::AngleAxisd(angle, Eigen::Vector3d(1, 2, 0.1).normalized())
                .toRotationMatrix();
        std::vector<Eigen::Vector3d> doubles, floats;
        for (const Eigen::Vector3d& x : flat_l().samples)
        {
            doubles.push_back(R * (x + Eigen::Vector3d(0.1, 0.2, 0)));
            floats.push_back(doubles.back().cast<float>().cast<double>());
        }
        for (const auto& places : {doubles, floats})
        {
            const std::optional<Eigen::Vector3d> normal = plane_normal(places);
            ASSERT_TRUE(normal) << angle;
            EXPECT_LT(normal->cross(R.col(2)).norm(), 1e-6);
        }
    }
}

TEST(Flat, many_samples_are_as_flat_as_few)
{
    std::mt19937 rng(3);
    const Eigen::Matrix3d R = support::random_rotation(rng);
    std::vector<Eigen::Vector3d> places;
    for (int i = 0; i < 60; ++i)
        for (int k = 0; k < 60; ++k)
            places.push_back(R * Eigen::Vector3d(0.1 * i, 0.05 * k, 0));
    EXPECT_TRUE(plane_normal(places));
    // Roundings to floats far from the origin are no thickness.
    std::vector<Eigen::Vector3d> floats;
    for (const Eigen::Vector3d& x : places)
        floats.push_back(
            (x + Eigen::Vector3d(3e5, 2e5, 1e5)).cast<float>().cast<double>());
    EXPECT_TRUE(plane_normal(floats));
    // One sample off it is enough, and so is a shape.
    std::vector<Eigen::Vector3d> dented = places;
    dented[1234] += 1e-6 * R.col(2);
    EXPECT_FALSE(plane_normal(dented));
    for (Eigen::Vector3d& x : places)
        x = support::random_vector(rng, 1.0);
    EXPECT_FALSE(plane_normal(places));
}

TEST(Flat, a_model_bends_in_its_plane_as_it_would_in_space)
{
    // In space the same state has no force across the plane, and as long as the move is
    // small the sheet does not buckle. What differs is on which side of a layer of voxels
    // the sheet lies.
    const Shape shape = flat_l();
    const std::string bend = "fixed foot box -1 -1 -1 0.3 4 1\n"
                             "handle hand box 2.7 -1 -1 4 4 1\n"
                             "frame 1\nmove hand rotate 0 0 1 2 about 1 1 0\n";
    const Session flat = played(shape, bend, true), space = played(shape, bend, false);
    EXPECT_EQ(flat.frames()[0].solve.stop, Stop::Converged);
    EXPECT_TRUE(flat.warnings().empty());
    double largest = 0.0;
    for (std::size_t i = 0; i < shape.samples.size(); ++i)
    {
        EXPECT_EQ(flat.deformed().samples[i].z(), 0.0);
        largest = std::max(
            largest, (flat.deformed().samples[i] - space.deformed().samples[i]).norm());
    }
    EXPECT_LT(largest, 1e-4);
}

TEST(Flat, cells_are_one_layer_at_every_depth_and_have_three_unknowns)
{
    SessionSettings settings;
    settings.cells.across = 12;
    settings.cells.is_flat = true;
    for (const int depth : {0, 1, 2})
    {
        settings.cells.max_depth = settings.cells.min_depth = depth;
        const Session session(
            scan_geometry("model.obj", support::obj_text(flat_l())).geometry,
            parse_handles("h.handles", "cellwarp-handles 1\n" + kBend), settings);
        EXPECT_EQ(session.system()->body().cells.size(), (48u + 32u) << (2 * depth));
    }
}

TEST(Flat, what_is_pressed_together_stays_in_its_plane)
{
    // In space a strip that is pressed leaves its plane: it is much softer there.
    const Shape strip = support::sheet_shape(6.0, 1.0, 6);
    const std::string press = "fixed foot box -1 -1 -1 0.5 4 1\n"
                              "handle hand box 5.5 -1 -1 7 4 1\nframe 1\n"
                              "move hand translate -2 0.05 0\nframe 2\n"
                              "move hand translate -3 0.05 0\n";
    const Session session = played(strip, press, true);
    for (const Eigen::Vector3d& x : session.deformed().samples)
        EXPECT_EQ(x.z(), 0.0);
    for (const FrameReport& frame : session.frames())
        EXPECT_EQ(frame.solve.stop, Stop::Converged);
}

TEST(Flat, a_turned_model_is_bent_alike_and_keeps_its_plane)
{
    const Eigen::Matrix3d Q =
        Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
    const Eigen::Vector3d t(3, -4, 5);
    Shape shape = flat_l();
    std::string foot = "fixed foot indices", hand = "handle hand indices";
    for (std::size_t i = 0; i < shape.samples.size(); ++i)
    {
        if (shape.samples[i].x() <= 0.3)
            foot += " " + std::to_string(i);
        if (shape.samples[i].x() >= 2.7)
            hand += " " + std::to_string(i);
    }
    const std::string regions = foot + "\n" + hand + "\nframe 1\nmove hand ";
    const Session plain = played(shape, regions + "rotate 0 0 1 50 about 1 1 0\n", true);
    Shape turned = shape;
    for (Eigen::Vector3d& x : turned.samples)
        x = Q * x + t;
    // Numbers of a handle file have all their digits here, as a matrix.
    const Eigen::Matrix3d R =
        Eigen::AngleAxisd(50 * std::numbers::pi / 180, Q.col(2)).toRotationMatrix();
    const Eigen::Vector3d centre = Q * Eigen::Vector3d(1, 1, 0) + t,
                          shift = centre - R * centre;
    std::string matrix = "matrix";
    for (int i = 0; i < 3; ++i)
    {
        for (int j = 0; j < 3; ++j)
            matrix += " " + shortest(R(i, j));
        matrix += " " + shortest(shift[i]);
    }
    const Session session = played(turned, regions + matrix + " 0 0 0 1\n", true);
    const double scale = bounding_box(shape.samples).size().norm();
    double largest = 0.0;
    for (std::size_t i = 0; i < shape.samples.size(); ++i)
    {
        const Eigen::Vector3d& x = session.deformed().samples[i];
        EXPECT_LT(std::abs(Q.col(2).dot(x - t)), 1e-9 * scale);
        largest = std::max(largest, (x - Q * plain.deformed().samples[i] - t).norm());
    }
    EXPECT_LT(largest, 0.02 * scale); // other cells, turned in the plane
}

TEST(Flat, pins_turn_in_the_plane)
{
    const Session session =
        played(flat_l(),
               "fixed foot box -1 -1 -1 0.3 4 1\npin hand box 2.7 -1 -1 4 4 1\n"
               "frame 1\nmove hand translate -0.8 1 0\n",
               true);
    const PinReport& pin = session.frames()[0].pins.at(0);
    EXPECT_GT(pin.degrees, 20.0);
    EXPECT_EQ(pin.motion(2, 2), 1.0);
    for (const Eigen::Vector3d& x : session.deformed().samples)
        EXPECT_EQ(x.z(), 0.0);
}

TEST(Flat, what_is_not_flat_is_refused)
{
    const auto refused = [](const Shape& shape, const std::string& statements)
    { return error_of(Fault::Malformed, [&] { played(shape, statements, true); }); };
    EXPECT_TRUE(contains(refused(support::box_shape({0, 0, 0}, {3, 1, 1}), kBend),
                         "cells.flat: the samples lie in no plane"));
    SessionSettings askew;
    askew.cells.is_flat = true;
    askew.cells.frame.emplace();
    askew.cells.frame->origin = {-9, -9, -9};
    askew.cells.frame->axes = {{{1, 0, 0}, {0, 0.8, 0.6}, {0, -0.6, 0.8}}};
    askew.cells.frame->size = {20, 20, 20};
    EXPECT_TRUE(contains(
        error_of(Fault::Malformed,
                 [&]
                 {
                     Session(
                         scan_geometry("model.obj", support::obj_text(flat_l())).geometry,
                         parse_handles("h.handles", "cellwarp-handles 1\n" + kBend),
                         askew);
                 }),
        "cells.frame.axes: none of them is across the plane of the samples"));
    for (const std::string& move :
         {std::string("translate 0 0 0.1"), std::string("rotate 0 1 0 20"),
          std::string("rotate 1 0 0 180"),
          std::string("rotate 0 0 1 20 translate 0 0.1 1e-4")})
        EXPECT_TRUE(contains(
            refused(flat_l(), "fixed foot box -1 -1 -1 0.3 4 1\n"
                              "handle hand box 2.7 -1 -1 4 4 1\nframe 1\nmove hand " +
                                  move + "\n"),
            "h.handles:5: hand: frame 1: leaves the plane of the model"))
            << move;
}

TEST(Flat, a_figure_drawn_in_lines_bends_as_one_body)
{
    // A cross of two long lines and a lamp at the end of one: few samples, far apart.
    Shape figure{{{0, 0, 0}, {0, 2, 0}, {-1.5, 1, 0}, {0, 1, 0}, {1.5, 1, 0}}, {}};
    figure.lines = {{0, 3}, {3, 1}, {2, 3}, {3, 4}};
    for (int k = 0; k <= 12; ++k)
    {
        const double angle = 2.0 * std::numbers::pi * k / 12.0;
        figure.samples.emplace_back(1.8 - 0.3 * std::cos(angle),
                                    1.0 + 0.3 * std::sin(angle), 0.0);
        if (k > 0)
            figure.lines.push_back({std::uint32_t(4 + k), std::uint32_t(5 + k)});
    }
    const std::string moves = "fixed foot box -1 -1 -1 1 0.4 1\n"
                              "handle top box -1 1.8 -1 1 3 1\n"
                              "frame 1\nmove top rotate 0 0 1 40 about 0 0 0\n";
    for (const bool is_flat : {true, false})
    {
        const Session session = played(figure, moves, is_flat);
        EXPECT_EQ(session.frames()[0].solve.stop, Stop::Converged);
        const std::vector<Eigen::Vector3d>& samples = session.deformed().samples;
        // The arms and the lamp follow, and stay as far from each other.
        EXPECT_LT((samples[2] - figure.samples[2]).y(), -0.2) << is_flat;
        EXPECT_GT((samples[4] - figure.samples[4]).y(), 0.2) << is_flat;
        EXPECT_NEAR((samples[4] - samples[2]).norm(), 3.0, 0.15) << is_flat;
        EXPECT_NEAR((samples[11] - samples[5]).norm(), 0.6, 0.06) << is_flat;
        for (const Eigen::Vector3d& x : samples)
            EXPECT_NEAR(x.z(), 0.0, is_flat ? 1e-9 : 0.05);
    }
}

namespace
{

/// The setting whose result the default equals: 'flat', 'space' or 'neither'.
std::string as_told(const Shape& shape, const std::string& statements,
                    const SessionSettings& settings = {})
{
    const auto ended = [&](std::optional<bool> is_flat)
    { return played(shape, statements, is_flat, 1e-6, settings); };
    const Session by_default = ended(std::nullopt);
    const auto is_as = [&](const Session& told)
    {
        return by_default.deformed().samples == told.deformed().samples &&
               by_default.warnings() == told.warnings() &&
               by_default.frames().back().cells == told.frames().back().cells &&
               by_default.frames().back().solve.energy_after ==
                   told.frames().back().solve.energy_after;
    };
    const bool is_flat = by_default.system()->rest().is_flat();
    return is_as(ended(is_flat)) ? is_flat ? "flat" : "space" : "neither";
}

/// By the numbers of their samples: of a shape that is turned they are the same.
std::string ends_of(const Shape& shape)
{
    std::string foot = "fixed foot indices", hand = "handle hand indices";
    for (std::size_t i = 0; i < shape.samples.size(); ++i)
    {
        if (shape.samples[i].x() <= 0.3)
            foot += " " + std::to_string(i);
        if (shape.samples[i].x() >= 2.7)
            hand += " " + std::to_string(i);
    }
    return foot + "\n" + hand + "\n";
}

std::string numbers(const Eigen::Vector3d& x)
{
    return " " + shortest(x.x()) + " " + shortest(x.y()) + " " + shortest(x.z());
}

} // namespace

TEST(Flat, what_moves_in_its_plane_is_kept_there_without_being_told)
{
    const Shape l = flat_l();
    EXPECT_EQ(as_told(l, kBend), "flat");
    EXPECT_EQ(as_told(l, kEnds + "frame 1\nmove hand translate -1 0.2 0\n"), "flat");
    EXPECT_EQ(as_told(l, "fixed foot box -1 -1 -1 0.3 4 1\npin hand box 2.7 -1 -1 4 4 1\n"
                         "frame 1\nmove hand translate -0.8 1 0\n"),
              "flat");
    // Turns about the middle or the border, whole turns, and turns back and forth.
    for (const std::string& move :
         {std::string("rotate 0 0 1 40"), std::string("rotate 0 0 -2 40 about border"),
          std::string("rotate 0 0 1 360"), std::string("rotate 0 0 1 20 about 1 1 7"),
          std::string("matrix -1 0 0 6  0 -1 0 1  0 0 1 0  0 0 0 1")})
        EXPECT_EQ(as_told(l, kEnds + "frame 1\nmove hand " + move + "\n"), "flat")
            << move;
    // The first frame that moves something tells.
    EXPECT_EQ(as_told(l, kEnds + "frame 1\nframe 2\nmove hand translate 0 0 0\nframe 3\n"
                                 "move hand translate 0 0.5 0\n"),
              "flat");
    // Shares of a flat box: nothing moves along the axis across it.
    EXPECT_EQ(as_told(l, "units relative\nfixed foot box 0 0 0 0.1 1 1\n"
                         "handle hand box 0.9 0 0 1 1 1\nframe 1\n"
                         "move hand translate 0 0.2 3\n"),
              "flat");
    // Clouds, soups and lines.
    Shape cloud = l;
    cloud.triangles.clear();
    EXPECT_EQ(as_told(cloud, kBend), "flat");
    Shape soup;
    for (const Triangle& triangle : l.triangles)
    {
        const auto first = static_cast<std::uint32_t>(soup.samples.size());
        for (const std::uint32_t i : triangle)
            soup.samples.push_back(l.samples[i]);
        soup.triangles.push_back({first, first + 1, first + 2});
    }
    EXPECT_EQ(as_told(soup, kBend), "flat");
    Shape lines{l.samples, {}};
    for (std::uint32_t i = 1; i < lines.samples.size(); ++i)
        lines.lines.push_back({i - 1, i});
    EXPECT_EQ(as_told(lines, kBend), "flat");
}

TEST(Flat, planes_that_lie_askew_are_kept_as_well)
{
    const Shape l = flat_l();
    std::mt19937 rng(4);
    for (const bool are_floats : {false, true})
        for (int trial = 0; trial < 2; ++trial)
        {
            const Eigen::Matrix3d R = support::random_rotation(rng);
            const Eigen::Vector3d t = support::random_vector(rng, 10.0);
            Shape turned = l;
            for (Eigen::Vector3d& x : turned.samples)
            {
                x = R * x + t;
                if (are_floats)
                    x = x.cast<float>().cast<double>();
            }
            const auto moved = [&](const std::string& move)
            { return as_told(turned, ends_of(l) + "frame 1\nmove hand " + move + "\n"); };
            EXPECT_EQ(moved("translate" + numbers(R * Eigen::Vector3d(-0.4, 0.7, 0))),
                      "flat");
            EXPECT_EQ(moved("rotate" + numbers(R.col(2)) + " 30"), "flat");
            EXPECT_EQ(moved("rotate" + numbers(R.col(2)) + " 30 about border"), "flat");
            if (trial > 0)
                continue;
            EXPECT_EQ(moved("translate" + numbers(R * Eigen::Vector3d(-0.4, 0.7, 0.1))),
                      "space");
        }
}

TEST(Flat, what_first_leaves_its_plane_bends_in_space)
{
    for (const std::string& move :
         {std::string("translate 0 0 0.3"), std::string("rotate 0 1 0 20"),
          std::string("rotate 1 0 0 180"), std::string("rotate 1 0 0 360"),
          std::string("matrix 1 0 0 0  0 -1 0 1  0 0 -1 0  0 0 0 1"),
          std::string("rotate 0 0 1 20 translate 0 0.1 1e-4")})
        EXPECT_EQ(as_told(flat_l(), kEnds + "frame 1\nmove hand " + move + "\n"), "space")
            << move;
    EXPECT_EQ(as_told(flat_l(), kEnds + "frame 1\nframe 2\nmove hand translate 0 0 1\n"
                                        "frame 3\nmove hand translate 0 1 0\n"),
              "space");
    // Nothing moves.
    EXPECT_EQ(as_told(flat_l(), kEnds + "frame 1\n"), "space");
}

TEST(Flat, what_spans_no_plane_is_not_kept_in_one)
{
    const auto told = [](const Shape& shape)
    {
        return as_told(shape, "fixed foot indices 0\nhandle hand indices 1\nframe 1\n"
                              "move hand translate 0.1 0 0\n");
    };
    EXPECT_EQ(told({{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}}, {}}), "space");
    EXPECT_EQ(told({{{0, 1, 2}, {1, 3, 5}, {2, 5, 8}, {3, 7, 11}}, {}}), "space");
    // A thin box is not flat, and neither is a sheet with a dent.
    Shape thin = support::box_shape({0, 0, 0}, {3, 1, 1});
    for (Eigen::Vector3d& x : thin.samples)
        x.z() *= 1e-3;
    EXPECT_EQ(as_told(thin, kBend), "space");
    Shape dented = flat_l();
    dented.samples[40].z() += 1e-5;
    EXPECT_EQ(as_told(dented, kBend), "space");
    SessionSettings askew;
    askew.cells.frame.emplace();
    askew.cells.frame->origin = {-9, -9, -15};
    askew.cells.frame->axes = {{{1, 0, 0}, {0, 0.8, 0.6}, {0, -0.6, 0.8}}};
    askew.cells.frame->size = {20, 20, 20};
    EXPECT_FALSE(
        played(flat_l(), kBend, std::nullopt, 1e-6, askew).system()->rest().is_flat());
    askew.cells.frame->origin = {-2, -9, -9};
    askew.cells.frame->axes = {{{0.6, 0.8, 0}, {-0.8, 0.6, 0}, {0, 0, 1}}};
    EXPECT_EQ(as_told(flat_l(), kBend, askew), "flat");
}

TEST(Flat, a_later_frame_that_leaves_the_plane_is_an_error_that_says_what_lets_it)
{
    const std::string later = kEnds + "frame 1\nmove hand translate 0 0.3 0\nframe 4\n"
                                      "move hand translate 0 0.3 0.1\n";
    const std::string error =
        error_of(Fault::Malformed, [&] { played(flat_l(), later, std::nullopt); });
    EXPECT_TRUE(contains(error, "h.handles:7: hand: frame 4: leaves the plane of the "
                                "model"))
        << error;
    EXPECT_TRUE(contains(error, "--no-flat, or cells.flat false,")) << error;
    const Session space = played(flat_l(), later, false);
    double height = 0.0;
    for (const Eigen::Vector3d& x : space.deformed().samples)
        height = std::max(height, x.z());
    EXPECT_GT(height, 0.099);
}

TEST(Flat, each_stage_is_kept_in_its_plane_by_its_own_first_move)
{
    const std::string first = kEnds + "frame 1\nmove hand translate 0 0.3 0\n",
                      flat = "commit\n" + kEnds + "frame 2\nmove hand translate 0 -1 0\n",
                      space = "commit\n" + kEnds + "frame 2\nmove hand translate 0 0 1\n";
    EXPECT_EQ(as_told(flat_l(), first + flat), "flat");
    EXPECT_FALSE(
        played(flat_l(), first + space, std::nullopt).system()->rest().is_flat());
    // A model that has left its plane is not flat in the next stage.
    EXPECT_EQ(as_told(flat_l(), kEnds + "frame 1\nmove hand translate 0 0 1\n" + flat),
              "space");
}

TEST(Flat, what_is_told_to_bend_in_space_is_no_stiffer_where_it_is_pressed)
{
    const Shape strip = support::sheet_shape(6.0, 1.0, 6);
    const std::string press = "fixed foot box -1 -1 -1 0.5 4 1\n"
                              "handle hand box 5.5 -1 -1 7 4 1\nframe 1\n"
                              "move hand rotate 0 0 1 5 translate -2 0.05 0\n";
    const Session flat = played(strip, press, std::nullopt),
                  space = played(strip, press, false);
    EXPECT_TRUE(flat.system()->rest().is_flat());
    EXPECT_FALSE(space.system()->rest().is_flat());
    EXPECT_LE(space.frames()[0].solve.energy_after, flat.frames()[0].solve.energy_after);
    for (const Eigen::Vector3d& x : flat.deformed().samples)
        EXPECT_EQ(x.z(), 0.0);
}

} // namespace cellwarp::core
