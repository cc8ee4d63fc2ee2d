// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/session.h"

#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <gtest/gtest.h>

#include "io/base/number.h"
#include "io/formats/geometry_file.h"
#include "io/formats/stored_number.h"
#include "library/session/memory_limit.h"
#include "library/session/volume.h"
#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "tests/support/files.h"
#include "tests/support/random.h"
#include "tests/support/random_poses.h"
#include "tests/support/sanitized.h"
#include "tests/support/shapes.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::error_of;
using support::random_vector;

namespace
{

GeometryFile model_file(const Shape& shape)
{
    return scan_geometry("model.obj", support::obj_text(shape));
}

Geometry model(const Shape& shape)
{
    return model_file(shape).geometry;
}

HandleFile handles(const std::string& text)
{
    return parse_handles("h.handles", "cellwarp-handles 1\n" + text);
}

SessionSettings settings(int across)
{
    SessionSettings s;
    s.cells.across = across;
    return s;
}

SessionSettings tight(int across)
{
    SessionSettings s = settings(across);
    s.gradient_tolerance = 1e-10;
    return s;
}

Session played(Geometry geometry, const std::string& text, const SessionSettings& s)
{
    Session session(std::move(geometry), handles(text), s);
    while (session.next_frame(true))
        ;
    return session;
}

/// The survey's bar: 1 x 1 x 4, ends held up to a quarter.
Shape survey_bar(int n)
{
    return support::box_shape({-0.5, -0.5, 0}, {0.5, 0.5, 4}, n);
}

const std::string kBarEnds = "fixed foot box -1 -1 -1 1 1 0.2500001\n"
                             "handle head box -1 -1 3.7499999 1 1 5\n";
const std::string kTwist = kBarEnds + "frame 1\nmove head rotate 0 0 1 135 about 0 0 0\n";

double largest_difference(const std::vector<Eigen::Vector3d>& a,
                          const std::vector<Eigen::Vector3d>& b)
{
    double largest = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i)
        largest = std::max(largest, (a[i] - b[i]).norm());
    return largest;
}

std::string matrix_text(const Eigen::Matrix3d& R, const Eigen::Vector3d& t)
{
    std::string text = "matrix";
    for (int i = 0; i < 3; ++i)
    {
        for (int j = 0; j < 3; ++j)
            text += " " + shortest(R(i, j));
        text += " " + shortest(t[i]);
    }
    return text + " 0 0 0 1";
}

double volume_change(const Session& session)
{
    const std::optional<Volume> volume =
        enclosed_volumes(session.geometry(), session.deformed().samples);
    return volume ? volume->after / volume->before - 1.0 : 1e9;
}

} // namespace

TEST(Session, all_regions_moved_by_one_rigid_motion_move_every_sample_by_it)
{
    std::mt19937 rng(1);
    const Eigen::Matrix3d R = support::random_rotation(rng);
    const Eigen::Vector3d t = random_vector(rng, 3.0);
    const Shape mesh = survey_bar(6);
    const Shape cloud{support::random_points(mesh, 20000, 2), {}};
    for (const Shape& shape : {mesh, cloud})
    {
        const std::string ends = "handle foot box -1 -1 -1 1 1 0.25\n"
                                 "handle head box -1 -1 3.75 1 1 5\nframe 1\n";
        const std::string text = ends + "move foot " + matrix_text(R, t) +
                                 "\nmove head " + matrix_text(R, t) + "\n";
        const Session session = played(model(shape), text, settings(16));
        double worst = 0.0;
        for (std::size_t i = 0; i < shape.samples.size(); ++i)
            worst = std::max(
                worst,
                (session.deformed().samples[i] - (R * shape.samples[i] + t)).norm());
        EXPECT_LT(worst / std::sqrt(18.0), 1e-12);
        EXPECT_EQ(session.frames()[0].solve.stop, Stop::Converged);
        EXPECT_EQ(session.frames()[0].solve.iterations, 0);
    }
}

TEST(Session, plain_boxes_of_any_sides_are_solved)
{
    // The grid overhangs some of them by whole voxels.
    for (const Eigen::Vector3d& size :
         {Eigen::Vector3d(4, 1.5, 1), Eigen::Vector3d(2, 1.5, 2),
          Eigen::Vector3d(8, 3, 2), Eigen::Vector3d(3, 2, 1), Eigen::Vector3d(1, 1.5, 3),
          Eigen::Vector3d(3, 4, 1.5), Eigen::Vector3d(2, 3, 8), Eigen::Vector3d(1, 4, 2)})
    {
        SCOPED_TRACE(size.transpose());
        SessionSettings s;
        s.cells.max_depth = kUsualDepth;
        s.cells.threshold = kUsualThreshold;
        const Session session =
            played(model(support::box_shape({0, 0, 0}, size, 2)),
                   "units relative\nfixed a box 0 0 0 1 .1 1\n"
                   "handle b sphere .5 1 .5 .06\nframe 1\nmove b translate 0 .4 0\n",
                   s);
        EXPECT_EQ(session.frames()[0].solve.stop, Stop::Converged);
        for (const Cell& cell : session.system()->body().cells.cells)
            ASSERT_GT(cell.volume, 1e-3 * std::pow(cell.edge, 3));
    }
}

TEST(Session, region_samples_end_exactly_where_their_motion_puts_them)
{
    for (const FieldKind kind : {FieldKind::Rbf, FieldKind::Blend, FieldKind::Closest4})
    {
        SessionSettings s = settings(16);
        s.field = kind;
        const Shape shape = survey_bar(7);
        const Session session =
            played(model(shape),
                   "fixed foot box -1 -1 -1 1 1 0.3\nhandle head sphere 0 0 4 0.6\n"
                   "frame 1\nmove head rotate 1 1 0 50 translate 0.4 0.2 -0.5\n",
                   s);
        EXPECT_LT(session.frames()[0].handle_residual, 1e-12);
        for (const std::uint32_t i : session.system()->regions()[0].samples)
            EXPECT_EQ(session.deformed().samples[i], shape.samples[i]);
        EXPECT_GT(session.frames()[0].max_pair_gap, 0.0);
    }
}

TEST(Session, the_surveys_twist_and_bend_keep_their_volume)
{
    const Session twist = played(model(survey_bar(18)), kTwist, settings(32));
    EXPECT_EQ(twist.system()->body().cells.size(), 2048u);
    EXPECT_GT(volume_change(twist), -0.035);
    EXPECT_LT(volume_change(twist), 0.0);
    EXPECT_NEAR(volume_change(played(model(survey_bar(18)), kTwist, settings(40))),
                volume_change(twist), 0.003);
    // A square bar bent by 120 degrees to an arc of the same length.
    const double angle = 120.0 * std::numbers::pi / 180.0, radius = 3.5 / angle;
    const Eigen::Matrix3d R = rotation_about(Eigen::Vector3d::UnitY(), angle);
    const Eigen::Vector3d end(radius * (1 - std::cos(angle)), 0,
                              0.25 + radius * std::sin(angle));
    const std::string bend = kBarEnds + "frame 1\nmove head " +
                             matrix_text(R, end - R * Eigen::Vector3d(0, 0, 3.75)) + "\n";
    EXPECT_LT(std::abs(volume_change(played(model(survey_bar(18)), bend, settings(32)))),
              0.035);
}

TEST(Session, meshes_of_one_shape_bend_alike)
{
    const Shape coarse = survey_bar(18), fine = survey_bar(54);
    const Session a = played(model(coarse), kTwist, settings(32));
    const Session b = played(model(fine), kTwist, settings(32));
    // Every third vertex of the fine mesh is one of the coarse mesh.
    double worst = 0.0;
    std::size_t found = 0;
    for (std::size_t i = 0; i < coarse.samples.size(); ++i)
        for (std::size_t j = 0; j < fine.samples.size(); ++j)
            if ((coarse.samples[i] - fine.samples[j]).squaredNorm() < 1e-20)
            {
                ++found;
                worst = std::max(
                    worst, (a.deformed().samples[i] - b.deformed().samples[j]).norm());
                break;
            }
    EXPECT_EQ(found, coarse.samples.size());
    EXPECT_LT(worst / std::sqrt(18.0), 1e-3);
}

TEST(Session, soups_and_clouds_bend_as_the_mesh_that_they_sample)
{
    const Shape mesh = survey_bar(54);
    const Session wanted = played(model(mesh), kTwist, settings(32));
    const Body& body = wanted.system()->body();
    const RestShape& rest = wanted.system()->rest();
    const auto check = [&](const Shape& shape, double rms, double largest)
    {
        const Session session = played(model(shape), kTwist, settings(32));
        double sum = 0.0, worst = 0.0;
        for (std::size_t i = 0; i < shape.samples.size(); ++i)
        {
            const Eigen::Vector3d x = rest.frame.to_work(shape.samples[i]);
            const VoxelGrid& grid = rest.material.grid;
            const int own = body.pieces.at(grid, grid.locate(x));
            const Eigen::Vector3d moved =
                shape.samples[i] +
                rest.frame.vector_to_model(
                    wanted.field()->displacements({&x, 1}, {&own, 1})[0]);
            const double apart =
                (session.deformed().samples[i] - moved).norm() / std::sqrt(18.0);
            sum += apart * apart;
            worst = std::max(worst, apart);
        }
        EXPECT_LT(std::sqrt(sum / static_cast<double>(shape.samples.size())), rms);
        EXPECT_LT(worst, largest);
    };
    Shape third;
    std::vector<Triangle> shuffled = mesh.triangles;
    std::shuffle(shuffled.begin(), shuffled.end(), std::mt19937(4));
    shuffled.resize(shuffled.size() / 3);
    for (const Triangle& triangle : shuffled)
    {
        const std::uint32_t first = static_cast<std::uint32_t>(third.samples.size());
        for (const std::uint32_t corner : triangle)
            third.samples.push_back(mesh.samples[corner]);
        third.triangles.push_back({first, first + 1, first + 2});
    }
    check(third, 1e-3, 3e-3);
    check(Shape{support::random_points(mesh, 200000, 6), {}}, 1e-3, 3e-3);
}

TEST(Session, flaws_of_a_mesh_change_little)
{
    const Shape clean = survey_bar(12);
    const std::vector<Eigen::Vector3d> wanted =
        played(model(clean), kTwist, settings(16)).deformed().samples;
    const auto check = [&](const Shape& flawed, double tolerance)
    {
        const Session session = played(model(flawed), kTwist, settings(16));
        double worst = 0.0;
        for (std::size_t i = 0; i < wanted.size(); ++i)
            worst = std::max(worst, (session.deformed().samples[i] - wanted[i]).norm());
        EXPECT_LT(worst / std::sqrt(18.0), tolerance);
    };
    Shape flawed = clean;
    flawed.triangles.push_back(clean.triangles[3]); // twice
    flawed.triangles.push_back({clean.triangles[4][0], clean.triangles[4][2],
                                clean.triangles[4][1]}); // reversed
    flawed.triangles.push_back({0, 0, 1});               // degenerate
    flawed.samples.push_back({0.1, 0.05, 2.03});         // isolated
    check(flawed, 1e-12);
    Shape turned = clean; // half of the faces look inwards
    for (std::size_t t = 0; t < turned.triangles.size(); t += 2)
        std::swap(turned.triangles[t][0], turned.triangles[t][1]);
    check(turned, 1e-3);
    Shape walled = clean; // a wall inside: edges of three faces
    const auto near = [&](double x, double y)
    {
        std::size_t best = 0;
        const Eigen::Vector3d place(x, y, 2.0);
        for (std::size_t i = 0; i < clean.samples.size(); ++i)
            if ((clean.samples[i] - place).norm() < (clean.samples[best] - place).norm())
                best = i;
        return static_cast<std::uint32_t>(best);
    };
    walled.triangles.push_back({near(-0.5, -0.5), near(0.5, -0.5), near(0.5, 0.5)});
    check(walled, 1e-3);
    Shape holed = clean;
    holed.triangles.erase(holed.triangles.begin() + 700, holed.triangles.begin() + 706);
    check(holed, 2e-3);
    // A part that stands half inside: what overlaps is inside, so nothing is new there.
    check(
        support::joined(clean, support::box_shape({-0.45, -0.45, 1}, {0.45, 0.45, 3}, 8)),
        1e-12);
}

TEST(Session, parts_that_lie_side_by_side_stay_apart)
{
    // Two slabs 1 % of the diagonal apart, joined at one end.
    const Shape slabs = support::joined(
        support::joined(support::box_shape({0, 0, 0}, {4, 0.4, 1}, 8),
                        support::box_shape({0, 0.442, 0}, {4, 0.842, 1}, 8)),
        support::box_shape({0, 0.2, 0}, {0.4, 0.642, 1}, 8));
    const Session session =
        played(model(slabs),
               "fixed root box -1 -1 -1 0.2 2 2\nhandle tip box 3.8 0.43 -1 5 2 2\n"
               "frame 1\nmove tip rotate 0 0 1 35 about 0.4 0.44 0.5\n",
               settings(0));
    double free = 0.0, pulled = 0.0;
    for (std::size_t i = 0; i < slabs.samples.size(); ++i)
        (slabs.samples[i].y() < 0.41 ? free : pulled) =
            std::max(slabs.samples[i].y() < 0.41 ? free : pulled,
                     (session.deformed().samples[i] - slabs.samples[i]).norm());
    const double diagonal = std::sqrt(16.0 + 0.842 * 0.842 + 1.0);
    EXPECT_LT(free / diagonal, 0.02);
    EXPECT_GT(pulled / diagonal, 0.5);
}

TEST(Session, sheets_and_wires_bend_also_when_they_are_tilted)
{
    std::mt19937 rng(31);
    const Eigen::Matrix3d tilt = support::random_rotation(rng);
    for (const bool is_sheet : {true, false})
        for (const Eigen::Matrix3d& Q :
             {Eigen::Matrix3d(Eigen::Matrix3d::Identity()), tilt})
        {
            Shape shape; // points alone, in a plane or on a line
            std::string low, high;
            for (int i = 0; i <= 120; ++i)
                for (int j = 0; j <= (is_sheet ? 30 : 0); ++j)
                {
                    if (i <= 12 || i >= 108)
                        (i <= 12 ? low : high) +=
                            " " + std::to_string(shape.samples.size());
                    shape.samples.push_back(Q * Eigen::Vector3d(i / 30.0, j / 30.0, 0));
                }
            // Half of a turn about an axis across it, and the ends nearer together.
            const Eigen::Matrix3d R =
                rotation_about(Q * Eigen::Vector3d::UnitY(), -0.5 * std::numbers::pi);
            const Eigen::Vector3d end = Q * Eigen::Vector3d(2.5, 0, 2.2);
            const Session session = played(
                model(shape),
                "fixed low indices" + low + "\nhandle high indices" + high +
                    "\nframe 1\nmove high " +
                    matrix_text(R, end - R * (Q * Eigen::Vector3d(4, 0, 0))) + "\n",
                settings(24));
            EXPECT_EQ(session.frames()[0].solve.stop, Stop::Converged);
            // Neighbouring samples keep their distance: no crease, no tear.
            double longest = 0.0;
            const int row = is_sheet ? 31 : 1;
            for (std::size_t i = 0; i + idx(row) < shape.samples.size(); ++i)
                longest = std::max(longest, (session.deformed().samples[i + idx(row)] -
                                             session.deformed().samples[i])
                                                .norm());
            EXPECT_LT(longest, 1.35 / 30.0) << is_sheet;
        }
}

TEST(Session, translation_scale_and_quarter_turns_commute_with_the_result)
{
    const Shape shape = survey_bar(6);
    const std::string ends = "fixed foot indices ";
    std::string foot, head;
    for (std::size_t i = 0; i < shape.samples.size(); ++i)
    {
        if (shape.samples[i].z() < 0.3)
            foot += " " + std::to_string(i);
        if (shape.samples[i].z() > 3.7)
            head += " " + std::to_string(i);
    }
    const auto play =
        [&](const Eigen::Matrix3d& Q, double scale, const Eigen::Vector3d& shift)
    {
        Shape moved = shape;
        for (Eigen::Vector3d& x : moved.samples)
            x = scale * (Q * x) + shift;
        const Eigen::Vector3d axis = Q * Eigen::Vector3d(0.2, 0.1, 1.0);
        const Eigen::Vector3d to = scale * (Q * Eigen::Vector3d(0.3, -0.2, 0.4));
        const auto three = [](const Eigen::Vector3d& v)
        { return shortest(v.x()) + " " + shortest(v.y()) + " " + shortest(v.z()); };
        return played(model(moved),
                      "fixed foot indices" + foot + "\nhandle head indices" + head +
                          "\nframe 1\nmove head rotate " + three(axis) +
                          " 100 translate " + three(to) + "\n",
                      tight(16))
            .deformed()
            .samples;
    };
    const Eigen::Matrix3d one = Eigen::Matrix3d::Identity();
    const std::vector<Eigen::Vector3d> plain = play(one, 1.0, {0, 0, 0});
    const auto expect_same =
        [&](const Eigen::Matrix3d& Q, double scale, const Eigen::Vector3d& shift)
    {
        std::vector<Eigen::Vector3d> wanted = plain;
        for (Eigen::Vector3d& x : wanted)
            x = scale * (Q * x) + shift;
        EXPECT_LT(largest_difference(play(Q, scale, shift), wanted),
                  1e-9 * scale * std::sqrt(18.0));
    };
    expect_same(one, 1.0, {8, -16, 4});
    expect_same(one, 1024.0, {0, 0, 0});
    expect_same(one, std::ldexp(1.0, -100), {0, 0, 0});
    Eigen::Matrix3d turn;
    turn << 0, -1, 0, 1, 0, 0, 0, 0, 1;
    expect_same(turn, 1.0, {0, 0, 0});
    turn << 1, 0, 0, 0, 0, -1, 0, 1, 0;
    expect_same(turn, 1.0, {0, 0, 0});
    turn << 0, 0, 1, 1, 0, 0, 0, 1, 0;
    expect_same(turn, 1.0, {0, 0, 0});
}

TEST(Session, a_free_turn_commutes_when_the_frame_is_carried_along)
{
    std::mt19937 rng(3);
    const Eigen::Matrix3d Q = support::random_rotation(rng);
    const Eigen::Vector3d shift = random_vector(rng, 5.0);
    const Shape shape = survey_bar(6);
    Shape turned = shape;
    for (Eigen::Vector3d& x : turned.samples)
        x = Q * x + shift;
    std::string foot, head;
    for (std::size_t i = 0; i < shape.samples.size(); ++i)
        (shape.samples[i].z() < 0.3   ? foot
         : shape.samples[i].z() > 3.7 ? head
                                      : foot) +=
            shape.samples[i].z() < 0.3 || shape.samples[i].z() > 3.7
                ? " " + std::to_string(i)
                : "";
    const Eigen::Matrix3d R =
        rotation_about(Eigen::Vector3d(0.3, 0.2, 1).normalized(), 1.4);
    const Eigen::Vector3d t(0.2, 0.1, -0.3);
    const auto play = [&](const Shape& s, const Eigen::Matrix3d& axes,
                          const Eigen::Vector3d& origin, const Eigen::Matrix3d& R2,
                          const Eigen::Vector3d& t2)
    {
        SessionSettings chosen = tight(16);
        FrameBox box;
        for (std::size_t i = 0; i < 3; ++i)
        {
            box.origin[i] = origin[static_cast<Eigen::Index>(i)];
            box.size[i] = i == 2 ? 4.0 : 1.0;
            for (std::size_t j = 0; j < 3; ++j)
                box.axes[i][j] =
                    axes(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
        }
        chosen.cells.frame = box;
        return played(model(s),
                      "fixed foot indices" + foot + "\nhandle head indices" + head +
                          "\nframe 1\nmove head " + matrix_text(R2, t2) + "\n",
                      chosen)
            .deformed()
            .samples;
    };
    const Eigen::Vector3d corner(-0.5, -0.5, 0);
    const std::vector<Eigen::Vector3d> plain =
        play(shape, Eigen::Matrix3d::Identity(), corner, R, t);
    const Eigen::Matrix3d R2 = Q * R * Q.transpose();
    const std::vector<Eigen::Vector3d> other =
        play(turned, Q.transpose(), Q * corner + shift, R2, Q * t + shift - R2 * shift);
    std::vector<Eigen::Vector3d> wanted = plain;
    for (Eigen::Vector3d& x : wanted)
        x = Q * x + shift;
    EXPECT_LT(largest_difference(other, wanted), 1e-9 * std::sqrt(18.0));
}

TEST(Session, extreme_scales_and_offsets_give_the_scaled_result)
{
    const Shape shape = survey_bar(4);
    const std::vector<Eigen::Vector3d> plain =
        played(model(shape), kTwist, tight(12)).deformed().samples;
    const auto play = [&](double scale, double offset)
    {
        Shape moved = shape;
        for (Eigen::Vector3d& x : moved.samples)
            x = scale * x + Eigen::Vector3d::Constant(offset);
        const auto number = [&](double x) { return shortest(scale * x + offset) + " "; };
        const std::string text = "fixed foot box " + number(-1) + number(-1) +
                                 number(-1) + number(1) + number(1) + number(0.2500001) +
                                 "\nhandle head box " + number(-1) + number(-1) +
                                 number(3.7499999) + number(1) + number(1) + number(5) +
                                 "\nframe 1\nmove head rotate 0 0 1 135 about " +
                                 number(0) + number(0) + number(0) + "\n";
        return played(model(moved), text, tight(12)).deformed().samples;
    };
    for (const double scale : {1e-150, 1e-30, 1e30, 1e100})
    {
        const std::vector<Eigen::Vector3d> result = play(scale, 0.0);
        for (std::size_t i = 0; i < plain.size(); ++i)
            ASSERT_LT((result[i] / scale - plain[i]).norm(), 1e-9) << scale;
    }
    const std::vector<Eigen::Vector3d> far = play(1.0, 1e8);
    for (std::size_t i = 0; i < plain.size(); ++i)
        EXPECT_LT((far[i] - Eigen::Vector3d::Constant(1e8) - plain[i]).norm(),
                  4 * 1.5e-8 * 2);
}

TEST(Session, threads_do_not_change_a_bit)
{
    std::vector<Eigen::Vector3d> first;
    for (const int threads : {1, 2, 4})
    {
        const ThreadLimit limit(threads);
        const std::vector<Eigen::Vector3d> result =
            played(model(survey_bar(10)), kTwist, settings(24)).deformed().samples;
        if (first.empty())
            first = result;
        EXPECT_EQ(result, first);
    }
}

TEST(Session, a_wound_handle_differs_from_an_unwound_one)
{
    const auto play = [&](const std::string& angle)
    {
        return played(model(survey_bar(6)),
                      kBarEnds + "frame 1\nmove head rotate 0 0 1 " + angle +
                          " about 0 0 0\n",
                      settings(16));
    };
    const Session wound = play("360"), rest = play("0");
    EXPECT_GT(largest_difference(wound.deformed().samples, rest.deformed().samples), 0.3);
    EXPECT_EQ(wound.frames()[0].steps, 8);
    EXPECT_LT(largest_difference(rest.deformed().samples, survey_bar(6).samples), 1e-12);
}

TEST(Session, a_handle_turns_about_the_glue_around_it)
{
    const auto bend = [&](const std::string& about)
    {
        return played(model(survey_bar(6)),
                      kBarEnds + "frame 1\nmove head rotate 1 0 0 40" + about + "\n",
                      settings(16));
    };
    const Session session = bend(" about border");
    // The head holds a layer of cells: they end in the plane z = 3.75 that cuts the bar.
    const std::vector<Eigen::Vector3d> borders = session.system()->region_borders();
    const Eigen::Vector3d border = session.system()->rest().frame.to_model(borders[1]);
    EXPECT_LT((border - Eigen::Vector3d(0, 0, 3.75)).norm(), 1e-9);
    const Session given = bend(" about 0 0 3.75");
    EXPECT_LT(largest_difference(session.deformed().samples, given.deformed().samples),
              1e-6);
    EXPECT_GT(largest_difference(session.deformed().samples, bend("").deformed().samples),
              0.05);
}

TEST(Session, a_handle_without_glue_turns_about_the_middle_of_its_box)
{
    const Shape two = support::joined(support::box_shape({0, 0, 0}, {1, 1, 1}),
                                      support::box_shape({3, 0, 0}, {4, 1, 1}));
    const std::string regions = "fixed foot box -1 -1 -1 1 1 1\n"
                                "handle head box 3 0 0 4 1 1\n"
                                "frame 1\nmove head rotate 0 0 1 40";
    EXPECT_EQ(
        played(model(two), regions + " about border\n", settings(16)).deformed().samples,
        played(model(two), regions + "\n", settings(16)).deformed().samples);
}

TEST(Session, warns_of_a_turn_far_from_where_the_handle_is_attached)
{
    const std::string half = "fixed foot box -1 -1 -1 1 1 0.2500001\n"
                             "handle head box -1 -1 2 1 1 5\nframe 1\nmove head ";
    const auto warnings = [&](const std::string& move)
    { return played(model(survey_bar(6)), half + move + "\n", settings(16)).warnings(); };
    ASSERT_EQ(warnings("rotate 1 0 0 40").size(), 1u);
    EXPECT_TRUE(contains(warnings("rotate 1 0 0 40")[0], "about border"));
    EXPECT_TRUE(warnings("rotate 1 0 0 40 about border").empty());
    EXPECT_TRUE(warnings("rotate 1 0 0 40 about 0 0 2").empty());
    EXPECT_TRUE(warnings("rotate 1 0 0 5").empty());
    EXPECT_TRUE(warnings("rotate 0 0 1 40").empty()); // its axis passes the border
}

TEST(Session, warns_of_a_bit_of_the_body_in_the_box_around_a_limb)
{
    // An L: the box around the end of its arm reaches down, beside the post.
    const Shape body = support::joined(support::box_shape({0, 0, 0}, {1, 1, 4}, 8),
                                       support::box_shape({1, 0, 3}, {4, 1, 4}, 8));
    const auto warnings = [&](const std::string& hand)
    {
        return played(model(body),
                      "fixed foot box -1 -1 -1 2 2 0.3\nhandle hand " + hand +
                          "\nframe 1\nmove hand translate 0 0 0.5\n",
                      settings(16))
            .warnings();
    };
    const std::string arm = "box 3 -1 2.9 5 2 5";
    EXPECT_TRUE(warnings(arm).empty());
    const std::vector<std::string> found =
        warnings(arm + "\nhandle hand box 0.9 -1 0.99 1.1 0.01 1.2");
    ASSERT_EQ(found.size(), 1u);
    EXPECT_TRUE(contains(found[0], "hand")) << found[0];
    EXPECT_TRUE(contains(found[0], "samples are apart from the others")) << found[0];
    // Scattered samples, and two parts of a size, are meant.
    std::string scattered;
    for (std::size_t i = 0; i < body.samples.size(); i += 17)
        if (body.samples[i].z() > 1.0)
            scattered += " " + std::to_string(i);
    for (const std::string& warning : warnings("indices" + scattered))
        EXPECT_FALSE(contains(warning, "apart from")) << warning;
    EXPECT_TRUE(warnings(arm + "\nhandle hand box 0.5 -1 0.8 2 2 1.8").empty());
}

TEST(Session, frames_start_from_the_last_solution_and_come_back)
{
    const Session session =
        played(model(survey_bar(6)),
               kBarEnds + "frame 1\nmove head translate 0.5 0 0\n"
                          "frame 5\nframe 7\nmove head translate 0 0 0\n",
               tight(16));
    ASSERT_EQ(session.frames().size(), 3u);
    EXPECT_EQ(session.frames()[1].frame, 5);
    EXPECT_EQ(session.frames()[1].solve.iterations, 0);
    EXPECT_LT(largest_difference(session.deformed().samples, survey_bar(6).samples),
              1e-8);
}

TEST(Session, warns_where_a_compressed_bar_would_give_way)
{
    // Euler: clamped at both ends over 3.5 widths it buckles at a fifth to a quarter.
    const auto warnings_at = [&](const std::string& shift)
    {
        return played(model(survey_bar(6)),
                      kBarEnds + "frame 1\nmove head translate 0 0 " + shift + "\n",
                      settings(16))
            .warnings();
    };
    EXPECT_TRUE(warnings_at("-0.4").empty());
    EXPECT_TRUE(warnings_at("1.5").empty());
    const std::vector<std::string> compressed = warnings_at("-1.2");
    ASSERT_EQ(compressed.size(), 1u);
    EXPECT_TRUE(contains(compressed[0], "may not be stable"));
}

TEST(Session, a_commit_makes_the_result_the_new_rest_shape)
{
    const std::string two =
        kBarEnds + "frame 1\nmove head translate 0.6 0 0\ncommit\n"
                   "fixed foot box -1 -1 -1 2 1 0.25\nhandle head box -1 -1 3.75 2 1 5\n"
                   "frame 2\nmove head translate 0 0.6 0\n";
    const Session session = played(model(survey_bar(8)), two, settings(16));
    ASSERT_EQ(session.frames().size(), 2u);
    EXPECT_GT(session.frames()[1].cells_ms, 0.0);
    // The head made both moves, exactly.
    const Shape bar = survey_bar(8);
    for (std::size_t i = 0; i < bar.samples.size(); ++i)
        if (bar.samples[i].z() > 3.75)
        {
            EXPECT_LT((session.deformed().samples[i] - bar.samples[i] -
                       Eigen::Vector3d(0.6, 0.6, 0))
                          .norm(),
                      1e-12);
        }
    // Nothing pulls back: with the ends where they are the shape stays.
    const Session kept =
        played(model(survey_bar(8)),
               kBarEnds + "frame 1\nmove head translate 0.6 0 0\ncommit\n"
                          "handle every all\nframe 2\n",
               settings(16));
    const Session once =
        played(model(survey_bar(8)), kBarEnds + "frame 1\nmove head translate 0.6 0 0\n",
               settings(16));
    EXPECT_LT(largest_difference(kept.deformed().samples, once.deformed().samples),
              1e-12);
}

TEST(Session, without_a_frame_the_output_is_the_input)
{
    const Shape bar = survey_bar(4);
    Session session(model(bar), handles(kBarEnds), settings(8));
    EXPECT_FALSE(session.next_frame(true));
    EXPECT_EQ(session.deformed().samples, bar.samples);
    ASSERT_EQ(session.warnings().size(), 1u);
    EXPECT_EQ(patched(model_file(bar), session.deformed()), support::obj_text(bar));
}

TEST(Session, a_frame_that_moves_nothing_keeps_every_byte)
{
    const Session session =
        played(model(survey_bar(4)), "fixed every all\nframe 1\n", settings(8));
    EXPECT_EQ(patched(model_file(survey_bar(4)), session.deformed()),
              support::obj_text(survey_bar(4)));
}

TEST(Session, a_component_without_a_region_is_reported_where_it_stays)
{
    const Shape two =
        support::joined(survey_bar(4), support::box_shape({3, -0.5, 0}, {4, 0.5, 4}, 4));
    SessionSettings staying = settings(16);
    staying.cells.loose_follow = false;
    const Session session = played(model(two), kTwist, staying);
    const std::size_t first = survey_bar(4).samples.size();
    for (std::size_t i = first; i < two.samples.size(); ++i)
        EXPECT_EQ(session.deformed().samples[i], two.samples[i]);
    EXPECT_TRUE(contains(session.warnings().at(0), "1 of 2 components"));
}

TEST(Session, closed_parts_that_touch_move_apart_unless_they_are_joined)
{
    // A lid that lies on a bar, a corner within it: lifted, it leaves the bar where it
    // is.
    const Shape two = support::joined(
        survey_bar(4), support::box_shape({-0.4, -0.4, 3.9}, {0.37, 0.41, 4.3}, 3));
    const std::size_t first = survey_bar(4).samples.size();
    const std::string lift = "fixed foot box -1 -1 -1 1 1 0.25\nhandle lid indices " +
                             std::to_string(first) + "-" +
                             std::to_string(two.samples.size() - 1) +
                             "\nframe 1\nmove lid translate 0 0.3 0.5\n";
    const Session apart = played(model(two), lift, settings(16));
    for (std::size_t i = 0; i < two.samples.size(); ++i)
        EXPECT_LT((apart.deformed().samples[i] - two.samples[i] -
                   (i < first ? 0.0 : 1.0) * Eigen::Vector3d(0, 0.3, 0.5))
                      .norm(),
                  1e-10);
    EXPECT_TRUE(
        contains(apart.warnings().at(0),
                 "2 of 2 parts of the mesh touch another one and are not glued to "
                 "it (--join glues them)"));
    SessionSettings glued = settings(16);
    glued.cells.joins_parts = true;
    const Session joined = played(model(two), lift, glued);
    EXPECT_TRUE(joined.warnings().empty());
    double top = 0.0;
    for (std::size_t i = 0; i < first; ++i)
        if (two.samples[i].z() == 4.0)
            top = std::max(top, (joined.deformed().samples[i] - two.samples[i]).norm());
    EXPECT_GT(top, 0.4);
}

TEST(Session, of_parts_that_overlap_each_carries_its_own_samples)
{
    // A bar through a block: whichever is turned, the other's samples in it stay.
    const Shape two =
        support::joined(support::box_shape({0, 0, 0}, {2, 2, 2}, 4),
                        support::box_shape({0.7, 0.8, -2.1}, {1.2, 1.3, 4.2}, 3));
    const std::size_t first = support::box_shape({0, 0, 0}, {2, 2, 2}, 4).samples.size();
    const Session session = played(
        model(two),
        "fixed block indices 0-" + std::to_string(first - 1) + "\nhandle bar indices " +
            std::to_string(first) + "-" + std::to_string(two.samples.size() - 1) +
            "\nframe 1\nmove bar rotate 0 0 1 40 translate 0.4 0 0\n",
        settings(24));
    const Eigen::Matrix3d R =
        rotation_about(Eigen::Vector3d::UnitZ(), 40 * std::numbers::pi / 180);
    const Eigen::Vector3d centre(0.95, 1.05, 1.05);
    for (std::size_t i = 0; i < two.samples.size(); ++i)
    {
        const Eigen::Vector3d& x = two.samples[i];
        const Eigen::Vector3d wanted =
            i < first
                ? x
                : Eigen::Vector3d(R * (x - centre) + centre + Eigen::Vector3d(0.4, 0, 0));
        EXPECT_LT((session.deformed().samples[i] - wanted).norm(), 1e-12);
    }
}

TEST(Session, a_pin_holds_its_sample_and_lets_it_turn)
{
    const Shape bar = survey_bar(4);
    std::size_t tip = 0;
    for (std::size_t i = 0; i < bar.samples.size(); ++i)
        if ((bar.samples[i] - Eigen::Vector3d(0, 0, 4)).norm() <
            (bar.samples[tip] - Eigen::Vector3d(0, 0, 4)).norm())
            tip = i;
    const Session session =
        played(model(bar),
               "fixed foot box -1 -1 -1 1 1 0.25\npin tip indices " +
                   std::to_string(tip) + "\nframe 1\nmove tip to 2 0 3\n",
               settings(16));
    EXPECT_LT((session.deformed().samples[tip] - Eigen::Vector3d(2, 0, 3)).norm(), 1e-12);
    EXPECT_EQ(session.frames()[0].solve.stop, Stop::Converged);
    double turn = 0.0;
    for (std::size_t c = 0; c < session.system()->region_of_cell().size(); ++c)
        if (session.system()->region_of_cell()[c] == 1)
            turn = std::max(turn, rotation_vector(session.system()->poses()[c].R).norm());
    EXPECT_GT(turn, 0.3);
}

/// By how much at most the samples of a box are off one rigid motion of them all, and
/// that motion.
struct BestMotion
{
    Eigen::Matrix3d R;
    Eigen::Vector3d rest_centroid, centroid;
    double largest_miss = 0.0;

    BestMotion(const std::vector<Eigen::Vector3d>& rest,
               const std::vector<Eigen::Vector3d>& now)
        : rest_centroid(mean(rest)), centroid(mean(now))
    {
        Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
        for (std::size_t i = 0; i < rest.size(); ++i)
            sum += (now[i] - centroid) * (rest[i] - rest_centroid).transpose();
        const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU |
                                                             Eigen::ComputeFullV);
        R = svd.matrixU() * svd.matrixV().transpose();
        for (std::size_t i = 0; i < rest.size(); ++i)
            largest_miss = std::max(
                largest_miss, (now[i] - centroid - R * (rest[i] - rest_centroid)).norm());
    }
    static Eigen::Vector3d mean(const std::vector<Eigen::Vector3d>& points)
    {
        Eigen::Vector3d sum = Eigen::Vector3d::Zero();
        for (const Eigen::Vector3d& point : points)
            sum += point;
        return sum / static_cast<double>(points.size());
    }
};

TEST(Session, a_pin_of_several_places_turns_as_one_rigid_body_about_their_centroid)
{
    // Its 3 x 3 x 3 cells and more, and the samples in them, also where it ends in a
    // cell; a bar along z and an L turned in space.
    for (const bool is_turned : {false, true})
    {
        Shape shape =
            is_turned ? support::box_shape({0, 0, 0}, {1, 1, 4}, 6) : survey_bar(8);
        const Eigen::Matrix3d Q =
            rotation_about(Eigen::Vector3d(1, 2, 3).normalized(), is_turned ? 0.8 : 0.0);
        std::string indices;
        std::vector<Eigen::Vector3d> rest, now;
        std::vector<std::size_t> held;
        const double top = is_turned ? 3.05 : 3.3;
        std::string foot;
        for (std::size_t i = 0; i < shape.samples.size(); ++i)
        {
            if (shape.samples[i].z() > top)
            {
                indices += " " + std::to_string(i);
                held.push_back(i);
            }
            if (shape.samples[i].z() < 0.3)
                foot += " " + std::to_string(i);
            shape.samples[i] = Q * shape.samples[i];
        }
        const Eigen::Vector3d to = Q * Eigen::Vector3d(1.2, 0.3, -0.6);
        const Session session =
            played(model(shape),
                   "fixed foot indices" + foot + "\npin hand indices" + indices +
                       "\nframe 1\nmove hand translate " + shortest(to.x()) + " " +
                       shortest(to.y()) + " " + shortest(to.z()) + "\n",
                   settings(16));
        EXPECT_EQ(session.frames()[0].solve.stop, Stop::Converged);
        for (const std::size_t i : held)
        {
            rest.push_back(shape.samples[i]);
            now.push_back(session.deformed().samples[i]);
        }
        const BestMotion motion(rest, now);
        EXPECT_LT(motion.largest_miss, 1e-12);
        EXPECT_LT((motion.centroid - motion.rest_centroid - to).norm(), 1e-12);
        EXPECT_GT(rotation_vector(motion.R).norm(), 0.3);
        ASSERT_EQ(session.frames()[0].pins.size(), 1u);
        const PinReport& pin = session.frames()[0].pins[0];
        EXPECT_EQ(pin.name, "hand");
        EXPECT_LT((pin.motion.topLeftCorner<3, 3>() - motion.R).norm(), 1e-9);
        EXPECT_LT((pin.motion.topLeftCorner<3, 3>() * motion.rest_centroid +
                   pin.motion.topRightCorner<3, 1>() - motion.centroid)
                      .norm(),
                  1e-12);
        EXPECT_NEAR(pin.degrees,
                    rotation_vector(motion.R).norm() * 180 / std::numbers::pi, 1e-6);
    }
}

TEST(Session, the_turn_that_a_pin_finds_is_the_one_of_least_energy)
{
    // A handle in its place, turned a little further about any axis, needs more energy.
    const std::string foot = "fixed foot box -1 -1 -1 1 1 0.3\n",
                      top = " hand box -1 -1 3.3 1 1 5\n";
    const Session pinned = played(
        model(survey_bar(8)),
        foot + "pin" + top + "frame 1\nmove hand translate 1.2 0.3 -0.6\n", tight(16));
    const PinReport& pin = pinned.frames()[0].pins.at(0);
    const Eigen::Matrix3d R = pin.motion.topLeftCorner<3, 3>();
    const Eigen::Vector3d t = pin.motion.topRightCorner<3, 1>();
    std::vector<Eigen::Vector3d> held;
    for (const Eigen::Vector3d& x : survey_bar(8).samples)
        if (x.z() >= 3.3)
            held.push_back(x);
    const Eigen::Vector3d centroid = BestMotion::mean(held);
    const auto energy_of = [&](const Eigen::Matrix3d& turned)
    {
        const Eigen::Vector3d image = R * centroid + t;
        return played(model(survey_bar(8)),
                      foot + "handle" + top + "frame 1\nmove hand " +
                          matrix_text(turned, image - turned * centroid) + "\n",
                      tight(16))
            .frames()[0]
            .solve.energy_after;
    };
    const double found = pinned.frames()[0].solve.energy_after;
    EXPECT_NEAR(energy_of(R) / found, 1.0, 1e-9);
    for (const Eigen::Vector3d& axis :
         {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(0, 1, 0), Eigen::Vector3d(1, -2, 3)})
        for (const double angle : {-0.02, 0.02})
            EXPECT_GT(energy_of(rotation_about(axis.normalized(), angle) * R),
                      found * (1 + 1e-6));
}

TEST(Session, a_pin_of_several_places_goes_on_turning_from_frame_to_frame)
{
    // The second frame back at rest ends at rest; alone it would start there.
    const Session session =
        played(model(survey_bar(6)),
               "fixed foot box -1 -1 -1 1 1 0.3\npin hand box -1 -1 3.3 1 1 5\n"
               "frame 1\nmove hand translate 1 0 -0.5\nframe 2\n"
               "move hand translate 0 0 0\n",
               tight(16));
    EXPECT_GT(session.frames()[0].pins.at(0).degrees, 20.0);
    EXPECT_LT(session.frames()[1].pins.at(0).degrees, 1e-6);
    for (std::size_t i = 0; i < session.deformed().samples.size(); ++i)
        EXPECT_LT((session.deformed().samples[i] - survey_bar(6).samples[i]).norm(),
                  1e-8);
}

TEST(Session, a_pin_of_several_places_that_others_hold_samples_of_is_refused)
{
    EXPECT_TRUE(contains(error_of(Fault::Malformed,
                                  []
                                  {
                                      played(model(survey_bar(4)),
                                             "pin p box -1 -1 3.5 1 1 5\n"
                                             "fixed f box -1 -1 -1 1 1 3.75\n"
                                             "frame 1\nmove p translate 0 0 0.1\n",
                                             settings(8));
                                  }),
                         "h.handles:2: p: turns as it likes, but f (line 3) holds its "
                         "sample"));
}

TEST(Session, a_pin_of_several_places_cannot_be_put_at_one)
{
    EXPECT_TRUE(contains(error_of(Fault::Malformed,
                                  []
                                  {
                                      Session(model(survey_bar(4)),
                                              handles("pin p box -1 -1 3.9 1 1 5\n"
                                                      "frame 1\nmove p to 0 0 5\n"),
                                              settings(8));
                                  }),
                         "h.handles:4: p: 'to' needs a pin of one place; this one has 25 "
                         "samples, use translate"));
}

TEST(Session, a_pin_on_a_cell_corner_holds_one_point)
{
    // Its sample is shared by several cells: all of them are held there, so a pin
    // that moves along with two handles does not hinder a rigid motion. (The pin goes
    // straight, the handles along a screw: only the end is rigid.)
    const Shape bar = survey_bar(12);
    std::size_t corner = 0;
    for (std::size_t i = 0; i < bar.samples.size(); ++i)
        if ((bar.samples[i] - Eigen::Vector3d(0.5, 0, 2)).norm() <
            (bar.samples[corner] - Eigen::Vector3d(0.5, 0, 2)).norm())
            corner = i;
    const Eigen::Matrix3d R = rotation_about(Eigen::Vector3d(1, 2, 3).normalized(), 0.7);
    const Eigen::Vector3d t(0.3, -0.2, 0.5), to = R * bar.samples[corner] + t;
    const std::string move = matrix_text(R, t);
    const Session session =
        played(model(bar),
               "handle foot box -1 -1 -1 1 1 0.25\nhandle head box -1 -1 3.75 1 1 5\npin "
               "p indices " +
                   std::to_string(corner) + "\nframe 1\nmove foot " + move +
                   "\nmove head " + move + "\nmove p to " + shortest(to.x()) + " " +
                   shortest(to.y()) + " " + shortest(to.z()) + "\n",
               tight(16));
    std::size_t num_pinned = 0;
    for (const int owner : session.system()->region_of_cell())
        num_pinned += owner == 2;
    EXPECT_GT(num_pinned, 1u);
    for (std::size_t i = 0; i < bar.samples.size(); ++i)
        EXPECT_LT((session.deformed().samples[i] - R * bar.samples[i] - t).norm(), 1e-8);
}

TEST(Session, no_crease_stands_at_a_border_between_cells_or_in_one)
{
    // Along the bar's edge the direction turns by no more than a few degrees from
    // sample to sample, a tenth of a cell, wherever in a cell the region ends.
    const Shape bar = survey_bar(40);
    for (const std::string end : {"0.26", "0.30", "0.34", "0.38", "0.42", "0.46"})
    {
        const Session session = played(
            model(bar),
            "fixed foot box -1 -1 -1 1 1 " + end +
                "\nhandle head box -1 -1 3.75 1 1 5\nframe 1\nmove head rotate 1 0 0 60 "
                "translate 0 -1 -0.4\n",
            settings(16));
        std::map<double, Eigen::Vector3d> edge;
        for (std::size_t i = 0; i < bar.samples.size(); ++i)
            if (bar.samples[i].x() == 0.5 && bar.samples[i].y() == 0.5)
                edge[bar.samples[i].z()] = session.deformed().samples[i];
        std::vector<Eigen::Vector3d> line;
        for (const auto& [z, x] : edge)
            line.push_back(x);
        double largest = 0.0;
        for (std::size_t i = 2; i < line.size(); ++i)
        {
            const Eigen::Vector3d a = line[i - 1] - line[i - 2],
                                  b = line[i] - line[i - 1];
            largest = std::max(largest, std::atan2(a.cross(b).norm(), a.dot(b)));
        }
        EXPECT_LT(largest * 180 / std::numbers::pi, 4.0) << end;
    }
}

TEST(Session, a_frame_that_does_not_hold_the_model_is_refused)
{
    SessionSettings s = settings(8);
    s.cells.frame = FrameBox{{0, 0, 0}, {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}}, {1, 1, 1}};
    s.cells.frame_file = "s.json";
    EXPECT_TRUE(contains(error_of(Fault::Malformed, [&]
                                  { Session(model(survey_bar(4)), handles(kTwist), s); }),
                         "s.json: cells.frame: does not hold sample"));
}

TEST(Session, many_regions_move_as_one)
{
    // One pin a cell: every region has its own, all move alike.
    const Shape bar = survey_bar(12);
    std::string regions, moves;
    std::set<std::array<int, 3>> cells;
    for (std::size_t i = 0; i < bar.samples.size(); ++i)
    {
        const Eigen::Vector3d u = (bar.samples[i] + Eigen::Vector3d(0.5, 0.5, 0)) * 3.999;
        const std::array<int, 3> cell = {static_cast<int>(u.x()), static_cast<int>(u.y()),
                                         static_cast<int>(u.z())};
        if (!cells.insert(cell).second)
            continue;
        const std::string name = "p" + std::to_string(i);
        regions += "handle " + name + " sphere " + shortest(bar.samples[i].x()) + " " +
                   shortest(bar.samples[i].y()) + " " + shortest(bar.samples[i].z()) +
                   " 0.05\n";
        moves += "move " + name + " translate 0.1 0 0\n";
    }
    EXPECT_GT(cells.size(), 100u);
    const Session session =
        played(model(bar), regions + "frame 1\n" + moves, settings(32));
    for (std::size_t i = 0; i < bar.samples.size(); ++i)
        EXPECT_LT(
            (session.deformed().samples[i] - bar.samples[i] - Eigen::Vector3d(0.1, 0, 0))
                .norm(),
            1e-10);
}

TEST(Session, a_pin_alone_warns_of_its_free_rotations)
{
    const Shape bar = survey_bar(4);
    const Session session =
        played(model(bar), "pin tip indices 0\nframe 1\nmove tip translate 1 2 3\n",
               settings(8));
    EXPECT_TRUE(contains(session.warnings().at(0), "one pin"));
    for (std::size_t i = 0; i < bar.samples.size(); ++i)
        EXPECT_LT(
            (session.deformed().samples[i] - bar.samples[i] - Eigen::Vector3d(1, 2, 3))
                .norm(),
            1e-11);
}

TEST(Session, a_stiff_region_bends_less)
{
    const std::string bend = "frame 1\nmove head rotate 1 0 0 60 translate 0 -1 -0.5\n";
    const auto middle_bend = [&](const std::string& more)
    {
        const Session session =
            played(model(survey_bar(6)), kBarEnds + more + bend, settings(16));
        const Cells& cells = session.system()->body().cells;
        const double diagonal_z = session.system()->rest().frame.size.z();
        Eigen::Matrix3d low = Eigen::Matrix3d::Identity(), high = low;
        double low_z = 1e9, high_z = -1e9;
        for (std::size_t c = 0; c < cells.size(); ++c)
        {
            const double z = cells.cells[c].centre.z() / diagonal_z;
            if (z > 0.4 && z < low_z)
            {
                low_z = z;
                low = session.system()->poses()[c].R;
            }
            if (z < 0.6 && z > high_z)
            {
                high_z = z;
                high = session.system()->poses()[c].R;
            }
        }
        return rotation_vector(high * low.transpose()).norm();
    };
    EXPECT_LT(middle_bend("stiff plate box -1 -1 1.5 1 1 2.5 1000\n"),
              0.1 * middle_bend(""));
}

TEST(Session, an_extreme_contrast_of_stiffness_gives_a_warning)
{
    const auto warnings = [&](const std::string& factor)
    {
        return played(model(survey_bar(6)),
                      kBarEnds + "stiff mid box -1 -1 1 1 1 3 " + factor +
                          "\nframe 1\nmove head translate 0 0 0.1\n",
                      settings(8))
            .warnings();
    };
    EXPECT_TRUE(warnings("1e8").empty());
    const std::vector<std::string> extreme = warnings("1e15");
    ASSERT_FALSE(extreme.empty());
    EXPECT_TRUE(contains(extreme.front(), "stiffness differs by a factor of 1e+15"));
}

TEST(Session, normals_turn_with_the_surface)
{
    const Shape bar = survey_bar(8);
    std::string text =
        "ply\nformat ascii 1.0\nelement vertex " + std::to_string(bar.samples.size()) +
        "\nproperty double x\nproperty double y\nproperty double z\n"
        "property double nx\nproperty double ny\nproperty double nz\nend_header\n";
    for (const Eigen::Vector3d& x : bar.samples)
        text +=
            shortest(x.x()) + " " + shortest(x.y()) + " " + shortest(x.z()) + " 0 0 1\n";
    const Session session =
        played(scan_geometry("m.ply", text).geometry,
               kBarEnds + "frame 1\nmove head rotate 1 0 0 60\n", settings(16));
    const Eigen::Matrix3d R =
        rotation_about(Eigen::Vector3d::UnitX(), 60 * std::numbers::pi / 180);
    for (std::size_t i = 0; i < bar.samples.size(); ++i)
    {
        const Eigen::Vector3d n = session.deformed().directions[i];
        EXPECT_NEAR(n.norm(), 1.0, 1e-12);
        if (bar.samples[i].z() > 3.76)
        {
            EXPECT_LT((n - R * Eigen::Vector3d::UnitZ()).norm(), 1e-12);
        }
        if (bar.samples[i].z() < 0.24)
        {
            EXPECT_EQ(n, Eigen::Vector3d::UnitZ());
        }
    }
}

TEST(Session, splats_turn_as_a_whole_with_a_rigid_motion)
{
    std::mt19937 rng(7);
    const Eigen::Matrix3d R = support::random_rotation(rng);
    const std::vector<Eigen::Vector3d> points =
        support::random_points(survey_bar(6), 3000, 2);
    std::string bytes = "ply\nformat binary_little_endian 1.0\nelement vertex " +
                        std::to_string(points.size()) + "\n";
    for (const char* name : {"x", "y", "z", "nx", "ny", "nz", "f_dc_0", "opacity",
                             "scale_0", "rot_0", "rot_1", "rot_2", "rot_3"})
        bytes += std::string("property float ") + name + "\n";
    bytes += "end_header\n";
    std::vector<Eigen::Vector4d> rotations;
    for (const Eigen::Vector3d& x : points)
    {
        Eigen::Vector4d q;
        q << random_vector(rng, 1.0), random_vector(rng, 1.0).x();
        rotations.push_back(q);
        for (const double v :
             {x.x(), x.y(), x.z(), 0.0, 0.0, 0.0, 0.5, 1.0, -3.0, q[0], q[1], q[2], q[3]})
            store(v, Scalar::Float32, false, bytes);
    }
    const std::string text = "handle foot box -1 -1 -1 1 1 0.25\n"
                             "handle head box -1 -1 3.75 1 1 5\nframe 1\nmove foot " +
                             matrix_text(R, {1, 2, 3}) + "\nmove head " +
                             matrix_text(R, {1, 2, 3}) + "\n";
    const Session session =
        played(scan_geometry("m.ply", bytes).geometry, text, settings(16));
    EXPECT_TRUE(session.geometry().directions.empty());
    const Geometry moved =
        scan_geometry("m.ply", patched(scan_geometry("m.ply", bytes), session.deformed()))
            .geometry;
    ASSERT_EQ(moved.rotations.size(), points.size());
    for (std::size_t i = 0; i < points.size(); ++i)
    {
        const Eigen::Vector4d &q = rotations[i], &after = moved.rotations[i];
        const Eigen::Quaterniond wanted =
            Eigen::Quaterniond(R) * Eigen::Quaterniond(q[0], q[1], q[2], q[3]);
        const Eigen::Vector4d w(wanted.w(), wanted.x(), wanted.y(), wanted.z());
        EXPECT_LT(std::min((after - w).norm(), (after + w).norm()), 1e-6);
        EXPECT_GE(after.dot(q), 0.0);
    }
    const std::vector<std::string>& warnings = session.warnings();
    EXPECT_TRUE(std::none_of(warnings.begin(), warnings.end(),
                             [](const std::string& w) { return contains(w, "normal"); }));
}

TEST(Session, regions_that_contradict_each_other_are_named)
{
    const std::string overlap = error_of(
        Fault::Malformed,
        []
        {
            Session(
                model(survey_bar(6)),
                handles("fixed foot box -1 -1 -1 1 1 1\nhandle head box -1 -1 0.9 1 1 5\n"
                        "frame 3\nmove head translate 0 0 1\n"),
                settings(16));
        });
    EXPECT_TRUE(contains(overlap, "foot"));
    EXPECT_TRUE(contains(overlap, "head"));
    EXPECT_TRUE(contains(overlap, "sample"));
    EXPECT_TRUE(contains(overlap, "h.handles:4"));
    // Where their motions agree there is nothing to complain about.
    played(model(survey_bar(6)),
           "fixed foot box -1 -1 -1 1 1 1\nhandle head box -1 -1 0.9 1 1 5\nframe 1\n",
           settings(16));
    const std::string crowded = error_of(
        Fault::Unsolvable,
        []
        {
            Session(model(survey_bar(6)),
                    handles("fixed foot box -1 -1 -1 1 1 0.25\nhandle tip indices 0\n"
                            "fixed rest box -1 -1 0.3 1 1 5\nframe 1\n"),
                    settings(1));
        });
    EXPECT_TRUE(contains(crowded, "no cell of its own"));
}

TEST(Session, a_region_that_selects_nothing_tells_by_how_much)
{
    const std::string message = error_of(
        Fault::Malformed,
        []
        {
            Session(model(survey_bar(4)),
                    handles("handle head box 2 2 2 3 3 3\nframe 1\n"), settings(8));
        });
    EXPECT_TRUE(contains(message, "h.handles:2: head: selects nothing"));
    EXPECT_TRUE(contains(message, "away"));
}

TEST(Session, selectors_that_do_not_fit_the_model_are_errors)
{
    const auto refused = [](const std::string& region)
    {
        return error_of(Fault::Malformed,
                        [&] {
                            Session(model(survey_bar(4)), handles(region + "\nframe 1\n"),
                                    settings(8));
                        });
    };
    EXPECT_TRUE(contains(refused("fixed a indices 999999"), "out of range"));
    EXPECT_TRUE(contains(refused("fixed a group arm"), "no group"));
    EXPECT_TRUE(
        contains(refused("stiff a box -1 -1 0 1 1 1 2\nstiff a box -1 -1 1 1 1 2 3"),
                 "h.handles:3: a: has another factor than on line 2 (got 3, need "
                 "2)"));
    const support::Folder folder;
    EXPECT_TRUE(
        contains(refused("fixed a labels " + folder.write("a.sel", "0\n1\n") + " 0"),
                 "need one for each"));
}

TEST(Session, too_many_cells_are_over_the_budget)
{
    SessionSettings s = settings(32);
    s.cells.max_cells = 2000;
    EXPECT_TRUE(contains(error_of(Fault::Budget, [&]
                                  { Session(model(survey_bar(4)), handles(kTwist), s); }),
                         "2048 cells"));
    s = settings(16);
    s.cells.max_depth = s.cells.min_depth = 1;
    s.cells.max_cells = 300;
    const Session session(model(survey_bar(4)), handles(kTwist), s);
    EXPECT_TRUE(contains(session.warnings().at(0), "refinement stopped"));
    s.cells.max_memory = 1e5;
    EXPECT_TRUE(contains(error_of(Fault::Budget, [&]
                                  { Session(model(survey_bar(4)), handles(kTwist), s); }),
                         "290 samples and"));
    if (support::kIsSanitized)
        return; // what the process takes itself changes too much
    s = settings(64);
    s.cells.gap = 1.0; // few voxels
    // Enough for the samples and voxels; the process's own memory counts.
    s.cells.max_memory = resident_memory() + 5.2e7;
    EXPECT_TRUE(contains(error_of(Fault::Budget, [&]
                                  { Session(model(survey_bar(4)), handles(kTwist), s); }),
                         "the equations of 16384 cells need about"));
    // Factors grow faster than the rest.
    s = settings(48);
    s.cells.gap = 1.0;
    s.cells.max_memory = resident_memory() + 8.5e7;
    s.method = Method::GaussNewtonDirect;
    EXPECT_TRUE(contains(error_of(Fault::Budget, [&]
                                  { Session(model(survey_bar(4)), handles(kTwist), s); }),
                         "the factors of 6912 cells need about"));
    s = settings(32);
    s.cells.gap = 1.0;
    s.field = FieldKind::RbfGlobal;
    s.cells.max_memory = resident_memory() + 5.2e7;
    EXPECT_TRUE(contains(error_of(Fault::Budget, [&]
                                  { Session(model(survey_bar(4)), handles(kTwist), s); }),
                         "the global release field of"));
}

TEST(Session, the_automatic_grid_has_a_thousand_cells_or_two)
{
    for (const Shape& shape : {survey_bar(6), support::box_shape({0, 0, 0}, {1, 1, 1}, 6),
                               support::box_shape({0, 0, 0}, {4, 4, 0.2}, 1)})
    {
        const Session session(model(shape), handles("fixed a all\nframe 1\n"),
                              settings(0));
        EXPECT_GE(session.system()->body().cells.size(), 1000u);
        EXPECT_LE(session.system()->body().cells.size(), 2500u);
    }
}

TEST(Session, degenerate_shapes_follow_a_handle_exactly)
{
    const auto check = [](const std::vector<Eigen::Vector3d>& points)
    {
        const Session session =
            played(model(Shape{points, {}}),
                   "handle h all\nframe 1\nmove h rotate 0 0 1 30 about "
                   "0 0 0 translate 1 2 3\n",
                   settings(0));
        const Eigen::Matrix3d R =
            rotation_about(Eigen::Vector3d::UnitZ(), 30 * std::numbers::pi / 180);
        for (std::size_t i = 0; i < points.size(); ++i)
            EXPECT_LT(
                (session.deformed().samples[i] - R * points[i] - Eigen::Vector3d(1, 2, 3))
                    .norm(),
                1e-12);
    };
    check({{1, 2, 3}});
    check(std::vector<Eigen::Vector3d>(100, {1, 2, 3}));
    check({{0, 0, 0}, {1, 1, 1}, {2, 2, 2}, {3, 3, 3}});
    check({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}, {0.5, 0.5, 0}});
    check({{0, 0, 0}, {1, 0, 0}, {1e12, 0, 0}});
}

TEST(Session, handles_may_be_anywhere)
{
    // Teleports, swaps and collapses end finite, with the handles met.
    for (const std::string move :
         {"move head translate 5000 0 0", "move head translate 0 0 -4",
          "move head translate 0 0 -8", "move head rotate 1 0 0 180",
          "move head rotate 1 0 0 179.999999"})
    {
        SCOPED_TRACE(move);
        const Session session = played(
            model(survey_bar(4)), kBarEnds + "frame 1\n" + move + "\n", settings(12));
        for (const Eigen::Vector3d& x : session.deformed().samples)
            ASSERT_TRUE(x.allFinite());
        EXPECT_LT(session.frames()[0].handle_residual, 1e-9 * 2000);
        EXPECT_LE(session.frames()[0].solve.energy_after,
                  session.frames()[0].solve.energy_before * (1 + 1e-12));
    }
}

TEST(Session, a_handle_beyond_what_the_solve_can_hold_is_an_error)
{
    // Squares of the forces overflow: nothing tells a good pose from a bad one.
    for (const std::string move :
         {"translate 1e160 0 0", "translate 0 1e200 -1e200", "translate 0 0 1e307",
          "rotate 0 0 1 60 about 1e160 0 0"})
        EXPECT_TRUE(contains(
            error_of(Fault::Unsolvable,
                     [&]
                     {
                         played(model(survey_bar(4)),
                                kBarEnds + "frame 3\nmove head " + move + "\n",
                                settings(12));
                     }),
            "h.handles: frame 3: the equations have no solution in finite numbers"))
            << move;
}

TEST(Session, real_models_bend)
{
    const std::string folder = support::data_folder();
    if (folder.empty())
        GTEST_SKIP() << "CELLWARP_TEST_DATA is not set";
    const auto check = [&](const std::string& file, const std::string& text)
    {
        SCOPED_TRACE(file);
        const Session session =
            played(read_geometry(folder + "/" + file).geometry, text, SessionSettings());
        const FrameReport& report = session.frames().back();
        EXPECT_EQ(report.solve.stop, Stop::Converged);
        EXPECT_LT(report.handle_residual, 1e-12);
        EXPECT_LT(report.solve.iterations, 40);
        EXPECT_GE(session.system()->body().cells.size(), 1000u);
        EXPECT_LE(session.system()->body().cells.size(), 2500u);
    };
    const std::string relative = "units relative\n";
    check("stanford-bunny.obj", relative +
                                    "fixed base box -1 -1 -1 2 0.2 2\n"
                                    "handle ear box -1 0.8 -1 2 2 2\nframe 1\n"
                                    "move ear rotate 0 0 1 40 translate 0.1 0.1 0\n");
    check("armadillo.obj", relative + "fixed feet box -1 -1 -1 2 0.1 2\n"
                                      "handle hand sphere 0.914 0.805 1 0.1\nframe 1\n"
                                      "move hand rotate 0 0 1 60 translate 0 0.2 0\n");
    check("spot.obj",
          relative + "fixed feet box -1 -1 -1 2 0.2 2\nhandle head box -1 0.7 -1 2 2 2\n"
                     "frame 1\nmove head rotate 0 1 0 40\n");
    check("decimated-knight.off",
          "fixed base labels " + folder + "/decimated-knight-selection.dmat 0\n" +
              "handle middle labels " + folder + "/decimated-knight-selection.dmat 1\n" +
              "handle top labels " + folder + "/decimated-knight-selection.dmat 2\n" +
              "frame 1\nmove top rotate 0 1 0 40 translate 0 0.05 0\n");
}

TEST(Session, takes_hardly_more_steps_by_newton_than_by_gauss_newton_where_a_rod_folds)
{
    const auto iterations = [](Method method)
    {
        SessionSettings s = tight(40);
        s.method = method;
        const Session session =
            played(model(support::box_shape({0, 0, 0}, {10, 0.3, 0.3}, 6)),
                   "fixed a box -1 -1 -1 0.5 1 1\nhandle b box 9.5 -1 -1 11 1 1\n"
                   "frame 1\nmove b rotate 0 0 1 150 translate -4 2 0\n",
                   s);
        EXPECT_EQ(session.frames()[0].solve.stop, Stop::Converged);
        return session.frames()[0].solve.iterations;
    };
    EXPECT_LE(iterations(Method::Newton), 1.5 * iterations(Method::GaussNewton));
}

TEST(Session, moves_samples_of_a_region_in_every_part_that_holds_some)
{
    // The handle has the samples of the second box's side, but no half of any cell.
    const Shape parts = support::joined(support::box_shape({0, 0, 0}, {1, 1, 3}, 4),
                                        support::box_shape({1.3, 0, 0}, {2.3, 1, 3}, 4));
    const Session session = played(model(parts),
                                   "fixed foot box -1 -1 -1 1.1 2 0.3\n"
                                   "handle top box -1 -1 2.5 1.31 2 4\n"
                                   "frame 1\nmove top translate 0.5 0 0.5\n",
                                   settings(12));
    EXPECT_LE(session.frames()[0].handle_residual, 1e-9);
    const Eigen::Vector3d move(0.5, 0, 0.5);
    for (std::size_t i = 0; i < parts.samples.size(); ++i)
        if (parts.samples[i].z() >= 2.5 && parts.samples[i].x() <= 1.31)
        {
            EXPECT_LT((session.deformed().samples[i] - parts.samples[i] - move).norm(),
                      1e-9);
        }
}

TEST(Session, names_both_regions_where_one_leaves_the_other_no_cell_of_a_part)
{
    const Shape parts =
        support::joined(support::box_shape({0, 0, 0}, {1, 1, 3}, 4),
                        support::box_shape({1.3, 0, 0}, {1.4, 0.1, 0.1}, 1));
    const std::string message =
        error_of(Fault::Unsolvable,
                 [&]
                 {
                     played(model(parts),
                            "fixed foot box -1 -1 -1 1.1 2 0.3\n"
                            "handle top box -1 -1 2.5 1.31 2 4\n"
                            "handle top box 1.29 -1 -1 1.32 2 1\n"
                            "fixed rest box 1.33 -1 -1 2 2 2\n"
                            "frame 1\nmove top translate 0.5 0 0.5\n",
                            settings(12));
                 });
    EXPECT_TRUE(contains(
        message,
        "top: has no cell of its own in a part of the shape that holds samples of "
        "it: fixed region rest holds"))
        << message;
}

TEST(Session, splits_what_is_stretched_a_thousandfold_no_further_than_it_pays)
{
    SessionSettings s = settings(16);
    s.cells.max_depth = kUsualDepth;
    s.cells.threshold = kUsualThreshold;
    const Session session = played(
        model(survey_bar(4)), kBarEnds + "frame 1\nmove head translate 3000 3000 0\n", s);
    EXPECT_EQ(session.frames()[0].solve.stop, Stop::Converged);
    EXPECT_LT(session.system()->body().cells.size(), 3000u);
}

} // namespace cellwarp::core
