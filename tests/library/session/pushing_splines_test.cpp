// SPDX-License-Identifier: GPL-3.0-or-later
// Rods that push back: sessions in which they and the cells are one minimum.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <string>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "io/base/number.h"
#include "io/formats/geometry_file.h"
#include "library/session/pushing_splines.h"
#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "tests/support/bodies.h"
#include "tests/support/files.h"
#include "tests/support/sessions.h"
#include "tests/support/shapes.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::error_of;
using support::handles;
using support::largest_difference;
using support::long_bar;
using support::model;
using support::played;
using support::settings;

namespace
{

using Eigen::Vector3d;

constexpr double kPi = std::numbers::pi;

SessionSettings tight(int across, int depth = 0)
{
    SessionSettings s = settings(across, depth);
    s.gradient_tolerance = 1e-9;
    return s;
}

std::string spine(double stiffness)
{
    return "rod spine through 0 0 0  0 0 1  0 0 2  0 0 3  0 0 4 stiffness " +
           shortest(stiffness) + "\n";
}

const std::string kBend = "frame 1\nmove spine end translate 0 2 -1 tangent 0 1 0\n";
const std::string kFoot = "fixed foot box -1 -1 -1 1 1 0.5\n";

/// Of a round rod of radius \p r and this stiffness, YI [theory-rods (35)].
double bending(double stiffness, double r)
{
    return stiffness * 2.0 * kPi * std::pow(r, 4) / 4.0;
}

double total_energy(const Session& session)
{
    return session.frames().back().solve.energy_after;
}

} // namespace

TEST(PushingSplines, a_rod_that_nothing_moves_leaves_every_sample_where_it_is)
{
    const Session session =
        played(long_bar(), spine(10.0) + kFoot + "frame 1\n", settings(12));
    EXPECT_EQ(session.deformed().samples, long_bar().samples);
    EXPECT_EQ(session.rods()[0].energy, 0.0);
    EXPECT_EQ(session.rods()[0].stiffness, 10.0);
}

TEST(PushingSplines, a_bar_bent_along_an_arc_has_the_energy_of_its_rod_as_well)
{
    // Both ends are held along an arc: bar and rod have the curvature theta / L all
    // along, and the rod the energy YI theta^2 / 2 L.
    const double theta = 10.0 * kPi / 180.0, length = 3.8;
    const double radius = length / theta;
    const double y = radius * (1.0 - std::cos(theta)), z = 0.1 + radius * std::sin(theta);
    // The turn about x by -theta that takes the far end there.
    const Eigen::Rotation2Dd turn(theta);
    const Eigen::Vector2d from(3.9, 0.0), to(z, y);
    const Eigen::Vector2d pivot =
        (Eigen::Matrix2d::Identity() - turn.toRotationMatrix()).inverse() *
        (to - turn * from);
    const std::string ends =
        "fixed a box -1 -1 -1 1 1 0.17\nhandle b box -1 -1 3.83 1 1 5\n";
    const std::string bend = "frame 1\nmove b rotate 1 0 0 -10 about 0 " +
                             shortest(pivot.y()) + " " + shortest(pivot.x()) + "\n";
    const double alone = total_energy(played(long_bar(), ends + bend, tight(24)));
    double own_unit = 0.0; ///< of the session's energies, by the first rod
    for (const double ratio : {0.1, 1.0, 10.0})
    {
        // Of the bar's bending stiffness, 2 I.
        const double stiffness = ratio * (2.0 / 12.0) / bending(1.0, 0.1);
        const Session session =
            played(long_bar(),
                   ends + "rod r through 0 0 0.1  0 0 2  0 0 3.9 radius 0.1 stiffness " +
                       shortest(stiffness) + "\n" + bend + "move r end to 0 " +
                       shortest(y) + " " + shortest(z) + " tangent 0 " +
                       shortest(std::sin(theta)) + " " + shortest(std::cos(theta)) + "\n",
                   tight(24));
        const double expected = bending(stiffness, 0.1) * theta * theta / (2.0 * length);
        EXPECT_NEAR(session.rods()[0].energy / expected, 1.0, 0.02) << ratio;
        const double added = total_energy(session) - alone;
        if (own_unit == 0.0)
            own_unit = added / expected;
        EXPECT_NEAR(added / (own_unit * expected), 1.0, 0.03) << ratio;
        EXPECT_NEAR(total_energy(session) / alone, 1.0 + ratio, 0.08 * (1.0 + ratio));
    }
}

TEST(PushingSplines, a_rod_of_more_spans_takes_about_as_many_iterations)
{
    // A turn of a slender rod stretches it to second order, the shorter its spans are
    // the sooner.
    const auto solve_of = [](int spans)
    {
        const Session session =
            played(long_bar(),
                   "rod spine through 0 0 0  0 0 1  0 0 2  0 0 3  0 0 4 stiffness 1 "
                   "spans " +
                       std::to_string(spans) + "\n" + kFoot +
                       "frame 1\nmove spine point 1 to 0 0.3 0.9\n"
                       "move spine point 2 to 0.4 0.9 1.5\n"
                       "move spine point 3 to 1.2 0.9 1.7\n"
                       "move spine end to 1.9 0.3 1.4 tangent 1 -1 0\n",
                   settings(12));
        EXPECT_EQ(session.frames().back().solve.stop, Stop::Converged) << spans;
        return session.frames().back().solve.iterations;
    };
    const int few = solve_of(4), many = solve_of(40);
    EXPECT_LE(many, 2 * few);
}

TEST(PushingSplines,
     a_soft_rod_pressed_at_its_held_end_converges_with_any_number_of_spans)
{
    const Geometry hose = read_geometry(support::samples_folder() + "/hose.obj").geometry;
    const auto iterations = [&](int spans)
    {
        Session session(
            hose,
            handles("rod hose through 0 0 0  0 0 1.14286  0 0 2.28571  0 0 3.42857  "
                    "0 0 4.57143  0 0 5.71429  0 0 6.85714  0 0 8 stiffness 1 spans " +
                    std::to_string(spans) +
                    "\nframe 1\nmove hose point 1 to 0 0.1 1.1\n"
                    "move hose point 2 to 0.1 0.9 1.85\n"
                    "move hose point 3 to 0.45 1.9 1.6\n"
                    "move hose point 4 to 1.2 2.15 0.8\n"
                    "move hose point 5 to 1.9 1.5 0.25\n"
                    "move hose point 6 to 2.7 0.8 0.6\n"
                    "move hose point 7 to 3.1 0.6 1.7\nrelease hose end tangent twist\n"),
            SessionSettings());
        EXPECT_TRUE(session.next_frame(true));
        EXPECT_EQ(session.frames().back().solve.stop, Stop::Converged) << spans;
        const std::string warning =
            "spans: 9 in each gap instead of " + std::to_string(spans);
        EXPECT_EQ(std::any_of(session.warnings().begin(), session.warnings().end(),
                              [&](const std::string& of)
                              { return support::contains(of, warning); }),
                  spans > 9);
        return session.frames().back().solve.iterations;
    };
    const int few = iterations(4);
    for (const int spans : {16, 32, 64})
        EXPECT_LE(iterations(spans), 1.5 * few) << spans;
}

TEST(PushingSplines, holds_are_kept_and_carried_cells_follow_the_frames)
{
    std::optional<Eigen::Matrix3d> held;
    for (const double stiffness : {0.1, 1.0, 1e3})
    {
        const Session session =
            played(long_bar(),
                   spine(stiffness) + kFoot + kBend +
                       "move spine point 2 translate 0.3 0 0 turn 40\n",
                   settings(12));
        const RodReport rod = session.rods()[0];
        EXPECT_LT((rod.points[0] - Vector3d(0, 0, 0)).norm(), 4e-9);
        EXPECT_LT((rod.points[2] - Vector3d(0.3, 0, 2)).norm(), 4e-9);
        EXPECT_LT((rod.points[4] - Vector3d(0, 2, 3)).norm(), 4e-9);
        const CellSystem& system = *session.system();
        EXPECT_NEAR(system.spline(0)->turn_at_point(2), 40.0 * kPi / 180.0, 1e-9);
        // The frame of the end is held as the line that was asked for carries it; the
        // line that is found differs by the cells' push.
        EXPECT_NEAR(system.spline(0)->turn_at_point(4), 0.0, 0.1);
        const Eigen::Matrix3d frame = system.spline(0)->frame_at_point(4);
        EXPECT_LT((frame - held.value_or(frame)).norm(), 1e-8);
        held = frame;
        EXPECT_LT((system.spline(0)->frame_at_point(4).col(2) - Vector3d(0, 1, 0)).norm(),
                  1e-9);
        std::size_t carried_cells = 0;
        for (std::size_t c = 0; c < system.poses().size(); ++c)
        {
            if (system.region_of_cell()[c] != 0)
                continue;
            ++carried_cells;
            const Vector3d& centre = system.body().cells.cells[c].centre;
            const Motion motion = system.driving().motion_at(0, centre);
            EXPECT_LT((system.poses()[c].p - motion(centre)).norm(), 1e-14);
            EXPECT_LT((system.poses()[c].R - motion.R).norm(), 1e-14);
        }
        EXPECT_EQ(carried_cells, rod.cells);
    }
}

TEST(PushingSplines, what_holds_a_body_by_its_rod_alone_is_in_balance)
{
    const Session session =
        played(long_bar(), spine(5.0) + kBend + "move spine point 2 translate 0.3 0 0\n",
               tight(12));
    const RodReport rod = session.rods()[0];
    Vector3d sum = Vector3d::Zero();
    double largest = 0.0;
    for (const Vector3d& force : rod.forces)
    {
        sum += force;
        largest = std::max(largest, force.norm());
    }
    EXPECT_GT(largest, 0.0);
    EXPECT_LT(sum.norm(), 1e-6 * largest);
    EXPECT_GT(rod.forces[2].x(), 0.0) << "a hold pulls where it has moved to";
}

TEST(PushingSplines, the_stiffer_the_rod_the_more_it_leads)
{
    const std::string moves = kFoot + kBend + "release spine end twist\n";
    const std::string alone =
        "rod spine through 0 0 0  0 0 1  0 0 2  0 0 3  0 0 4\n" + moves;
    const Session led = played(long_bar(), alone, tight(12));
    double last = 0.0, nearest = INFINITY;
    for (const double stiffness : {0.1, 1.0, 10.0, 100.0, 1e6})
    {
        const Session session = played(long_bar(), spine(stiffness) + moves, tight(12));
        EXPECT_GT(total_energy(session), last);
        last = total_energy(session);
        nearest = largest_difference(session.rods()[0].line, led.rods()[0].line);
    }
    EXPECT_LT(nearest, 1e-4);
    EXPECT_GT(largest_difference(
                  played(long_bar(), spine(0.1) + moves, tight(12)).rods()[0].line,
                  led.rods()[0].line),
              0.02);
}

TEST(PushingSplines, rods_moved_as_a_whole_carry_the_shape_rigidly)
{
    const std::string move =
        "move spine rotate 1 2 3 70 about 0 1 0 translate 0.3 -1 2\n";
    const Session session =
        played(long_bar(), spine(3.0) + "frame 1\n" + move, settings(12));
    const Session by_handle = played(long_bar(),
                                     "handle all all\nframe 1\nmove all rotate 1 2 3 70 "
                                     "about 0 1 0 translate 0.3 -1 2\n",
                                     settings(12));
    EXPECT_LT(
        largest_difference(session.deformed().samples, by_handle.deformed().samples),
        1e-12);
    EXPECT_EQ(session.frames()[0].solve.iterations, 0);
    // And what was bent before.
    const Session bent = played(long_bar(), spine(3.0) + kBend, tight(12));
    const Session moved =
        played(long_bar(), spine(3.0) + kBend + "frame 2\n" + move, tight(12));
    const Eigen::Matrix3d R =
        Eigen::AngleAxisd(70.0 * kPi / 180.0, Vector3d(1, 2, 3).normalized())
            .toRotationMatrix();
    const Vector3d about(0, 1, 0), shift(0.3, -1, 2);
    double worst = 0.0;
    for (std::size_t i = 0; i < bent.deformed().samples.size(); ++i)
        worst =
            std::max(worst, (moved.deformed().samples[i] -
                             (R * (bent.deformed().samples[i] - about) + about + shift))
                                .norm());
    EXPECT_LT(worst, 1e-6);
}

TEST(PushingSplines, mirrored_and_turned_scenes_give_mirrored_and_turned_results)
{
    Eigen::Matrix3d quarter, mirror = Eigen::Matrix3d::Identity();
    quarter << 0, -1, 0, 1, 0, 0, 0, 0, 1;
    mirror(0, 0) = -1.0;
    const Shape shape = support::box_shape({-0.5, -0.5, 0}, {0.5, 0.5, 4}, 4);
    const auto text = [](const Eigen::Matrix3d& Q)
    {
        const auto at = [&](double x, double y, double z)
        {
            const Vector3d v = Q * Vector3d(x, y, z);
            return " " + shortest(v.x()) + " " + shortest(v.y()) + " " + shortest(v.z());
        };
        return "rod r through" + at(0.1, 0, 0) + at(0.1, 0.1, 1) + at(0, 0.1, 2) +
               at(0, 0, 4) + " stiffness 4\nframe 1\nmove r end to" + at(1, 2, 2.5) +
               " tangent" + at(0, 1, 0.2) + "\n";
    };
    const Session plain = played(shape, text(Eigen::Matrix3d::Identity()), tight(12));
    for (const Eigen::Matrix3d& Q : {quarter, mirror})
    {
        Shape other = shape;
        for (Vector3d& x : other.samples)
            x = Q * x;
        const Session session = played(other, text(Q), tight(12));
        double worst = 0.0;
        for (std::size_t i = 0; i < shape.samples.size(); ++i)
            worst = std::max(
                worst,
                (session.deformed().samples[i] - Q * plain.deformed().samples[i]).norm());
        EXPECT_LT(worst, 1e-5) << Q;
        EXPECT_NEAR(session.rods()[0].energy, plain.rods()[0].energy,
                    1e-6 * plain.rods()[0].energy);
    }
}

TEST(PushingSplines, statements_that_change_under_way_give_what_a_new_session_gives)
{
    SessionSettings keeps = settings(12, 1);
    keeps.keeps_checkpoints = true;
    const std::string first = spine(2.0) + kBend,
                      second = first + "frame 2\nmove spine end turn 60\n",
                      third = first + "frame 2\nrelease spine end tangent\n"
                                      "move spine point 1 translate 0.2 0 0\n",
                      softer = spine(0.5) + kBend;
    Session edited(model(long_bar()), handles(second), keeps);
    for (const std::string& text : {second, third, softer, first, third})
    {
        edited.set_script(handles(text));
        while (edited.next_frame(true))
            ;
        Session fresh(model(long_bar()), handles(text), keeps);
        while (fresh.next_frame(true))
            ;
        EXPECT_EQ(edited.deformed().samples, fresh.deformed().samples);
        EXPECT_EQ(edited.rods()[0].points, fresh.rods()[0].points);
        EXPECT_EQ(edited.rods()[0].energy, fresh.rods()[0].energy);
    }
}

TEST(PushingSplines, threads_do_not_change_a_bit)
{
    std::vector<std::vector<Vector3d>> results;
    for (const int threads : {1, 2, 4})
    {
        const ThreadLimit limit(threads);
        results.push_back(
            played(long_bar(), spine(2.0) + kBend, settings(12, 1)).deformed().samples);
    }
    EXPECT_EQ(results[1], results[0]);
    EXPECT_EQ(results[2], results[0]);
}

TEST(PushingSplines, whole_turns_of_a_rod_are_kept_from_frame_to_frame)
{
    std::string text = spine(20.0) + kFoot;
    for (int k = 1; k <= 6; ++k)
        text += "frame " + std::to_string(k) + "\nmove spine end turn " +
                std::to_string(60 * k) + "\n";
    const Session session = played(long_bar(), text, settings(10));
    // GJ = YI: the whole turn over its length.
    const double expected =
        bending(20.0, session.rods()[0].radius) * std::pow(2.0 * kPi, 2) / (2.0 * 4.0);
    EXPECT_GT(session.rods()[0].energy, 0.9 * expected);
}

TEST(PushingSplines, closed_rods_and_rods_by_control_points_push_as_well)
{
    const Session closed =
        played(long_bar(),
               kFoot + "rod ring through 0.3 0 2  0 0.3 2  -0.3 0 2  0 "
                       "-0.3 2 closed stiffness 5\nframe 1\n"
                       "move ring point 2 translate 0 0 0.4\n",
               settings(12));
    EXPECT_LT((closed.rods()[0].points[0] - Vector3d(0.3, 0, 2)).norm(), 4e-9);
    EXPECT_LT((closed.rods()[0].points[2] - Vector3d(-0.3, 0, 2.4)).norm(), 4e-9);
    const Session by_controls =
        played(long_bar(),
               "rod spine points 0 0 0  0 0 1  0 0 2  0 0 3  0 0 4 stiffness 5\n"
               "frame 1\nmove spine point 2 translate 0.5 0 0\n",
               settings(12));
    EXPECT_LT((by_controls.rods()[0].points[2] - Vector3d(0.5, 0, 2)).norm(), 4e-9);
}

TEST(PushingSplines, a_commit_makes_what_a_pushing_rod_has_done_the_rest)
{
    const std::string bend = spine(1.0) + kFoot + kBend;
    const Session before = played(long_bar(), bend, settings(8));
    const Session after =
        played(long_bar(), bend + "commit\nfixed all box -9 -9 -9 9 9 9\nframe 2\n",
               settings(8));
    EXPECT_TRUE(after.rods().empty());
    EXPECT_LT(largest_difference(after.deformed().samples, before.deformed().samples),
              1e-12);
}

TEST(PushingSplines, no_pin_stays_on_a_rod_that_pushes_back)
{
    const std::string said =
        error_of(Fault::Malformed,
                 [&]
                 {
                     Session(model(long_bar()),
                             handles(spine(1.0) + "pin tip sphere 0.5 0.5 4 0.01\n"
                                                  "on tip spine\nframe 1\n"),
                             settings(8));
                 });
    EXPECT_TRUE(contains(said, "spine pushes back")) << said;
}

} // namespace cellwarp::core
