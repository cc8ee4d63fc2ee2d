// SPDX-License-Identifier: GPL-3.0-or-later
// Rods as handles: a session whose statements name them.
#include <cmath>
#include <numbers>
#include <random>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "io/base/number.h"
#include "library/session/deformation.h"
#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "octree/wrap/skeleton.h"
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

const std::string kSpine = "rod spine through 0 0 0  0 0 1  0 0 2  0 0 3  0 0 4\n";
const std::string kBend =
    kSpine + "frame 1\nmove spine end translate 0 2 -1 tangent 0 1 0\n";

std::string vector_text(const Vector3d& v)
{
    return " " + shortest(v.x()) + " " + shortest(v.y()) + " " + shortest(v.z());
}

/// The points of the spine on an arc of \p degrees towards +y, the inner ones as well,
/// from \p from on, which keeps its place and direction.
std::string arc(double degrees)
{
    const double angle = degrees * std::numbers::pi / 180.0, radius = 4.0 / angle;
    std::string text;
    for (int k = 1; k <= 4; ++k)
    {
        const double turn = 0.25 * k * angle;
        text += k == 4 ? "move spine end to"
                       : "move spine point " + std::to_string(k) + " to";
        text += vector_text(radius * Vector3d(0, 1.0 - std::cos(turn), std::sin(turn)));
        text +=
            k == 4 ? " tangent" + vector_text({0, std::sin(turn), std::cos(turn)}) : "";
        text += "\n";
    }
    return text;
}

/// How far samples are from that arc, at the most.
double off_arc(const Session& session, double degrees)
{
    const double angle = degrees * std::numbers::pi / 180.0, radius = 4.0 / angle;
    double worst = 0.0;
    for (std::size_t i = 0; i < session.geometry().samples.size(); ++i)
    {
        const Vector3d& x = session.geometry().samples[i];
        const double turn = 0.25 * angle * x.z();
        const Vector3d place =
            radius * Vector3d(0, 1.0 - std::cos(turn), std::sin(turn)) +
            Vector3d(x.x(), x.y() * std::cos(turn), -x.y() * std::sin(turn));
        worst = std::max(worst, (session.deformed().samples[i] - place).norm());
    }
    return worst;
}

} // namespace

TEST(RodSession, a_rod_that_nothing_moves_leaves_every_sample_where_it_is)
{
    const Shape shape = long_bar();
    const Session session = played(shape, kSpine + "frame 1\n", settings(12));
    EXPECT_EQ(session.deformed().samples, shape.samples);
    ASSERT_EQ(session.rods().size(), 1u);
    EXPECT_GT(session.rods()[0].cells, 10u);
    EXPECT_NEAR(session.rods()[0].length, 4.0, 1e-12);
    EXPECT_EQ(session.rods()[0].energy, 0.0);
    EXPECT_EQ(session.parts().rods, 1);
    EXPECT_EQ(played(shape, "fixed all all\nframe 1\n", settings(12)).parts().rods, 0);
}

TEST(RodSession, a_rod_moved_as_a_whole_carries_the_shape_rigidly)
{
    const Shape shape = long_bar();
    const std::string move = " rotate 1 2 3 70 about 0 1 0 translate 0.3 -1 2\n";
    const Session by_rod =
        played(shape, kSpine + "frame 1\nmove spine" + move, settings(12));
    const Session by_handle =
        played(shape, "handle all all\nframe 1\nmove all" + move, settings(12));
    EXPECT_LT(largest_difference(by_rod.deformed().samples, by_handle.deformed().samples),
              1e-12);
    EXPECT_EQ(by_rod.frames()[0].solve.iterations, 0);
    EXPECT_EQ(by_rod.rods()[0].energy, 0.0);
    // Also what was bent before.
    const Session bent = played(shape, kBend, settings(12));
    const Session moved = played(shape, kBend + "move spine" + move, settings(12));
    const Eigen::Matrix3d R =
        Eigen::AngleAxisd(70.0 * std::numbers::pi / 180.0, Vector3d(1, 2, 3).normalized())
            .toRotationMatrix();
    const Vector3d about(0, 1, 0), shift(0.3, -1, 2);
    double worst = 0.0;
    for (std::size_t i = 0; i < shape.samples.size(); ++i)
        worst =
            std::max(worst, (moved.deformed().samples[i] -
                             (R * (bent.deformed().samples[i] - about) + about + shift))
                                .norm());
    EXPECT_LT(worst, 1e-6);
    EXPECT_NEAR(moved.rods()[0].energy, bent.rods()[0].energy,
                1e-9 * bent.rods()[0].energy);
}

TEST(RodSession, held_points_end_where_they_are_told_and_cells_follow_the_frames)
{
    const Session session =
        played(long_bar(), kBend + "move spine point 2 translate 0.3 0 0\nframe 2\n",
               settings(12));
    const RodReport rod = session.rods()[0];
    EXPECT_LT((rod.points[0] - Vector3d(0, 0, 0)).norm(), 4e-9);
    EXPECT_LT((rod.points[2] - Vector3d(0.3, 0, 2)).norm(), 4e-9);
    EXPECT_LT((rod.points[4] - Vector3d(0, 2, 3)).norm(), 4e-9);
    EXPECT_TRUE(rod.holds[2].place);
    EXPECT_FALSE(rod.holds[2].tangent);
    EXPECT_FALSE(rod.holds[1].place);
    // Forces hold the rod in balance.
    Vector3d sum = Vector3d::Zero();
    double largest = 0.0;
    for (const Vector3d& force : rod.forces)
    {
        sum += force;
        largest = std::max(largest, force.norm());
    }
    EXPECT_GT(largest, 0.0);
    EXPECT_LT(sum.norm(), 1e-7 * largest);
    EXPECT_EQ(rod.forces[1].norm(), 0.0);
    // A carried cell's centre keeps its place in the rod's frame there.
    const CellSystem& system = *session.system();
    std::size_t carried_cells = 0;
    for (std::size_t c = 0; c < system.poses().size(); ++c)
    {
        const int owner = system.region_of_cell()[c];
        if (owner < 0)
            continue;
        ++carried_cells;
        const Vector3d& centre = system.body().cells.cells[c].centre;
        const Motion motion = system.driving().motion_at(idx(owner), centre);
        EXPECT_LT((system.poses()[c].p - motion(centre)).norm(), 1e-14);
        EXPECT_LT((system.poses()[c].R - motion.R).norm(), 1e-14);
    }
    EXPECT_EQ(carried_cells, rod.cells);
}

TEST(RodSession, a_rod_led_along_an_arc_has_the_energy_of_its_curvature)
{
    // A quarter circle of the same length: kappa = (pi / 2) / 4 everywhere, YI kappa^2 L
    // / 2, YI = 2 pi R^4 / 4.
    const double radius = 4.0 / (std::numbers::pi / 2.0), tube = 0.1;
    const auto on_arc = [&](double share)
    {
        const double a = share * std::numbers::pi / 2.0;
        return Vector3d(0, radius * (1.0 - std::cos(a)), radius * std::sin(a));
    };
    const std::string text =
        "rod spine through 0 0 0  0 0 1  0 0 2  0 0 3  0 0 4 spans 8 radius 0.1\n"
        "frame 1\nmove spine end to" +
        vector_text(on_arc(1.0)) + " tangent 0 1 0\n";
    const RodReport rod = played(long_bar(), text, settings(12)).rods()[0];
    const double stiffness = 2.0 * std::numbers::pi * std::pow(tube, 4) / 4.0;
    const double curvature = (std::numbers::pi / 2.0) / 4.0;
    EXPECT_NEAR(rod.energy / (stiffness * curvature * curvature * 4.0 / 2.0), 1.0, 2e-4);
    for (std::size_t k = 0; k < 5; ++k)
        EXPECT_LT((rod.points[k] - on_arc(k / 4.0)).norm(), 1e-3);
}

TEST(RodSession, a_rod_bent_back_and_beyond_does_not_wind_the_shape_about_its_line)
{
    const Shape shape = long_bar();
    double before = 0.0;
    for (const double degrees :
         {170.0, 179.0, 180.0, 181.0, 185.0, 190.0, 200.0, 270.0, 360.0})
    {
        const Session session =
            played(shape, kSpine + "frame 1\n" + arc(degrees), settings(12));
        const double off = off_arc(session, degrees);
        if (degrees > 170.0 && degrees <= 200.0)
        {
            EXPECT_NEAR(off, before, 0.15 * before) << degrees;
        }
        EXPECT_LT(off, 0.6) << degrees; // a whole turn is off by more than 1
        EXPECT_TRUE(session.warnings().empty()) << session.warnings()[0];
        before = off;
    }
}

TEST(RodSession, a_rod_bent_back_in_two_frames_ends_as_in_one)
{
    const Shape shape = long_bar();
    const Session one = played(shape, kSpine + "frame 1\n" + arc(270), settings(12));
    const Session two = played(
        shape, kSpine + "frame 1\n" + arc(120) + "frame 2\n" + arc(270), settings(12));
    EXPECT_LT(largest_difference(one.deformed().samples, two.deformed().samples), 1e-3);
    // And straight again.
    const Session back = played(
        shape, kSpine + "frame 1\n" + arc(270) + "frame 2\n" + arc(1e-9), settings(12));
    EXPECT_LT(largest_difference(back.deformed().samples, shape.samples), 1e-3);
}

TEST(RodSession, an_end_that_points_exactly_back_with_nothing_between_says_so)
{
    const std::string released =
        "frame 1\nrelease spine end place\nmove spine end tangent ";
    const auto warned = [&](const std::string& tangent)
    {
        const Session session =
            played(long_bar(), kSpine + released + tangent + "\n", settings(8));
        return !session.warnings().empty() &&
               contains(session.warnings()[0],
                        "spine: frame 1: its line turns exactly back");
    };
    EXPECT_TRUE(warned("0 0 -1"));
    EXPECT_FALSE(warned("0 0.001 -1"));
}

TEST(RodSession, a_release_of_the_twist_alone_is_of_both_ends)
{
    const std::string bend = "move spine point 2 translate 0.3 0 0\n";
    const Session whole =
        played(long_bar(), kSpine + "frame 1\nrelease spine twist\n" + bend, settings(8));
    const Session ends = played(
        long_bar(),
        kSpine + "frame 1\nrelease spine start twist\nrelease spine end twist\n" + bend,
        settings(8));
    EXPECT_EQ(whole.deformed().samples, ends.deformed().samples);
    const RodReport rod = whole.rods()[0];
    for (const std::size_t k : {0u, 4u})
    {
        EXPECT_FALSE(rod.holds[k].twist);
        EXPECT_TRUE(rod.holds[k].tangent);
    }
}

TEST(RodSession, a_turned_end_twists_the_bar_evenly)
{
    const Session session =
        played(long_bar(), kSpine + "frame 1\nmove spine end turn 120\n", settings(12));
    const CellSystem& system = *session.system();
    for (std::size_t c = 0; c < system.poses().size(); ++c)
        if (system.region_of_cell()[c] >= 0)
        {
            const double z =
                system.rest().frame.to_model(system.body().cells.cells[c].centre).z();
            const Vector3d turn = rotation_vector(system.poses()[c].R);
            EXPECT_NEAR(turn.z(), z / 4.0 * 120.0 * std::numbers::pi / 180.0, 1e-6);
            EXPECT_LT(turn.head<2>().norm(), 1e-9);
        }
}

TEST(RodSession, what_is_released_is_no_longer_held)
{
    const std::string pushed =
        kSpine + "frame 1\nmove spine point 2 translate 1 0 0\nmove spine end turn 90\n";
    const Session held = played(long_bar(), pushed + "frame 2\n", settings(12));
    const Session free = played(
        long_bar(), pushed + "frame 2\nrelease spine point 2\nrelease spine end twist\n",
        settings(12));
    EXPECT_LT((held.rods()[0].points[2] - Vector3d(1, 0, 2)).norm(), 4e-9);
    EXPECT_GT(held.rods()[0].energy, 1e-6);
    // Nothing else holds it off the axis, nor turns it.
    EXPECT_LT(free.rods()[0].points[2].head<2>().norm(), 1e-6);
    EXPECT_LT(free.rods()[0].energy, 1e-9 * held.rods()[0].energy);
    EXPECT_EQ(free.rods()[0].holds[4], (HoldParts{true, true, false}));
    EXPECT_LT(largest_difference(free.deformed().samples, long_bar().samples), 1e-5);
}

TEST(RodSession, what_nothing_holds_any_more_stays_as_it_is)
{
    for (const std::string moves :
         {"release spine start\nrelease spine end\n",
          "release spine start\nrelease spine end place tangent\n",
          "release spine start twist\nrelease spine end twist\n",
          "release spine start tangent twist\nrelease spine end tangent twist\n"})
    {
        const Session session =
            played(long_bar(), kSpine + "frame 1\n" + moves, settings(12));
        EXPECT_LT(largest_difference(session.deformed().samples, long_bar().samples),
                  1e-9)
            << moves;
    }
    // One place alone leads all of it, unbent.
    const Session led = played(long_bar(),
                               kSpine + "frame 1\nrelease spine start\nrelease spine "
                                        "end\nmove spine point 1 translate 1 2 3\n",
                               settings(12));
    for (std::size_t i = 0; i < long_bar().samples.size(); ++i)
        EXPECT_LT((led.deformed().samples[i] - long_bar().samples[i] - Vector3d(1, 2, 3))
                      .norm(),
                  1e-6);
}

TEST(RodSession, smaller_cells_follow_the_same_rod)
{
    const Session coarse = played(long_bar(), kBend, settings(12));
    const Session fine = played(long_bar(), kBend, settings(12, 2));
    EXPECT_GT(fine.system()->body().cells.size(), coarse.system()->body().cells.size());
    EXPECT_EQ(fine.rods()[0].points, coarse.rods()[0].points);
    EXPECT_LT(largest_difference(fine.deformed().samples, coarse.deformed().samples),
              0.1);
}

TEST(RodSession, cells_of_regions_stay_theirs_and_of_two_rods_the_first)
{
    const std::string text =
        "fixed foot box -1 -1 -1 1 1 0.5\n" + kSpine +
        "rod other through 0.4 0 2  0.4 0 3  0.4 0 4\nframe 1\nmove spine "
        "end translate 0 1 0\n";
    const Session session = played(long_bar(), text, settings(12));
    const CellSystem& system = *session.system();
    std::array<int, 3> cells = {};
    for (std::size_t c = 0; c < system.poses().size(); ++c)
        if (const int owner = system.region_of_cell()[c]; owner >= 0)
        {
            ++cells[idx(owner)];
            const double z =
                system.rest().frame.to_model(system.body().cells.cells[c].centre).z();
            EXPECT_EQ(owner == 0, z < 0.5 + 1e-9); // half of a cell and its border
        }
    EXPECT_GT(cells[0], 0);
    EXPECT_GT(cells[1], 0);
    EXPECT_GT(cells[2], 0);
    EXPECT_LT(cells[2], cells[1]); // what the first has left of its tube
}

TEST(RodSession, exact_rods_carry_the_samples_in_their_tube_exactly)
{
    const std::string text =
        "rod spine through 0.3 0.3 0  0.3 0.3 2  0.3 0.3 4 radius 0.3 exact\n"
        "frame 1\nmove spine end translate 0 2 -1 tangent 0 1 0\n";
    const Shape shape = long_bar();
    const Session session = played(shape, text, settings(12));
    const CellSystem& system = *session.system();
    const WorkFrame& frame = system.rest().frame;
    const Region& region = system.regions()[0];
    ASSERT_GT(region.samples.size(), 20u);
    for (const std::uint32_t i : region.samples)
    {
        const Vector3d x = frame.to_work(shape.samples[i]);
        EXPECT_LT((session.deformed().samples[i] -
                   frame.to_model(system.driving().motion_at(0, x)(x)))
                      .norm(),
                  4e-9);
    }
    // What was kept as a field says the same of them.
    Session again(model(shape), handles(text),
                  []
                  {
                      SessionSettings s = settings(12);
                      s.keeps_fields = true;
                      return s;
                  }());
    again.next_frame(true);
    const Deformation kept(again.field_file(), "f.cwf", 0.0);
    std::vector<Vector3d> carried = shape.samples;
    kept.carry({carried});
    EXPECT_LT(largest_difference(carried, session.deformed().samples), 1e-12);
}

TEST(RodSession, statements_that_change_under_way_give_what_a_new_session_gives)
{
    SessionSettings keeps = settings(12, 1);
    keeps.keeps_checkpoints = true;
    const std::string first = kBend, second = first + "frame 2\nmove spine end turn 60\n",
                      third = first + "frame 2\nrelease spine end tangent\n"
                                      "move spine point 1 translate 0.2 0 0\n";
    Session edited(model(long_bar()), handles(second), keeps);
    for (const std::string& text : {second, third, first, third})
    {
        edited.set_script(handles(text));
        while (edited.next_frame(true))
            ;
        Session fresh(model(long_bar()), handles(text), keeps);
        while (fresh.next_frame(true))
            ;
        EXPECT_EQ(edited.deformed().samples, fresh.deformed().samples);
        EXPECT_EQ(edited.rods()[0].points, fresh.rods()[0].points);
    }
}

TEST(RodSession, threads_do_not_change_a_bit)
{
    std::vector<std::vector<Vector3d>> results;
    for (const int threads : {1, 2, 4})
    {
        const ThreadLimit limit(threads);
        results.push_back(played(long_bar(), kBend, settings(12, 1)).deformed().samples);
    }
    EXPECT_EQ(results[1], results[0]);
    EXPECT_EQ(results[2], results[0]);
}

TEST(RodSession, after_a_commit_rods_start_anew)
{
    const Session session =
        played(long_bar(),
               kBend + "commit\nrod other through 0 0 0  0 0.5 1.9  0 2 3\nframe 2\n"
                       "move other end translate 0.5 0 0\n",
               settings(12));
    ASSERT_EQ(session.rods().size(), 1u);
    EXPECT_EQ(session.rods()[0].name, "other");
    EXPECT_LT((session.rods()[0].points[2] - Vector3d(0.5, 2, 3)).norm(), 1e-8);
}

TEST(RodSession, control_points_and_closed_rods_are_led_as_well)
{
    const RodReport by_controls =
        played(long_bar(),
               "rod spine points 0 0 0  0 0 1  0 0 2  0 0 3  0 0 4\nframe 1\n"
               "move spine point 2 translate 0.5 0 0\n",
               settings(12))
            .rods()[0];
    EXPECT_LT((by_controls.points[2] - Vector3d(0.5, 0, 2)).norm(), 4e-9);
    const RodReport closed =
        played(long_bar(),
               "rod ring through 0.3 0 1  0 0.3 1  -0.3 0 1  0 -0.3 1 closed\nframe 1\n"
               "move ring point 2 translate 0 0 0.4\n",
               settings(12))
            .rods()[0];
    EXPECT_LT((closed.points[0] - Vector3d(0.3, 0, 1)).norm(), 4e-9);
    EXPECT_LT((closed.points[2] - Vector3d(-0.3, 0, 1.4)).norm(), 4e-9);
}

TEST(RodSession, mirrored_and_turned_scenes_give_mirrored_and_turned_results)
{
    const Shape shape = support::l_prism();
    const auto text = [](const std::function<Vector3d(const Vector3d&)>& map,
                         const std::function<Vector3d(const Vector3d&)>& turn)
    {
        std::string line = "rod spine through";
        for (const Vector3d& x :
             {Vector3d(0.4, 0.5, 0.5), Vector3d(2, 0.5, 0.5), Vector3d(3.6, 0.5, 0.5)})
            line += vector_text(map(x));
        return line + "\nframe 1\nmove spine end translate" +
               vector_text(turn({-0.3, 0.4, 0.7})) + "\nrelease spine end tangent\n";
    };
    const auto same = [](const Vector3d& x) { return x; };
    const Session plain = played(shape, text(same, same), settings(16));
    for (const bool is_mirror : {true, false})
    {
        const auto map = [&](const Vector3d& x) -> Vector3d
        {
            return is_mirror ? Vector3d(4.0 - x.x(), x.y(), x.z())
                             : Vector3d(2.0 - x.y(), x.x(), x.z());
        };
        const auto turn = [&](const Vector3d& v) -> Vector3d
        { return map(v) - map(Vector3d::Zero()); };
        Shape other = shape;
        for (Vector3d& x : other.samples)
            x = map(x);
        if (is_mirror)
            for (Triangle& triangle : other.triangles)
                std::swap(triangle[0], triangle[1]);
        const Session moved = played(other, text(map, turn), settings(16));
        double worst = 0.0;
        for (std::size_t i = 0; i < shape.samples.size(); ++i)
            worst = std::max(
                worst,
                (moved.deformed().samples[i] - map(plain.deformed().samples[i])).norm());
        EXPECT_LT(worst, 1e-5) << is_mirror;
    }
}

TEST(RodSession, a_rod_from_the_skeleton_lies_in_the_middle)
{
    if (!has_curve_skeleton())
        GTEST_SKIP() << "built without CGAL";
    for (const std::string near : {"", " near tip"})
    {
        const Session session =
            played(long_bar(),
                   "fixed tip box -1 -1 3.9 1 1 5\nrod line from skeleton" + near +
                       "\nframe 1\n",
                   settings(12));
        const RodReport rod = session.rods()[0];
        EXPECT_GT(rod.length, 2.5);
        for (const Vector3d& x : rod.line)
            EXPECT_LT(x.head<2>().norm(), 0.15) << x.transpose();
        EXPECT_TRUE(near.empty() || rod.points.back().z() > rod.points[0].z());
    }
}

TEST(RodSession, what_cannot_be_is_told)
{
    const auto told = [](Fault fault, const std::string& text)
    {
        return error_of(
            fault, [&]
            { Session(model(long_bar()), handles(text + "frame 1\n"), settings(8)); });
    };
    const Fault none = Fault::Unsolvable, wrong = Fault::Malformed;
    EXPECT_TRUE(contains(told(none, "rod far through 9 9 9  9 9 12\n"),
                         "h.handles:2: far: its tube meets no material"));
    EXPECT_TRUE(contains(told(none, "fixed all all\n" + kSpine), "spine"));
    EXPECT_TRUE(contains(told(wrong, kSpine + "frame 0\nmove spine end turn 5000\n"),
                         "several frames"));
    EXPECT_TRUE(contains(error_of(wrong,
                                  [&]
                                  {
                                      handles(kSpine +
                                              "frame 0\nmove spine start turn 5\n"
                                              "move spine point 0 turn 6\n");
                                  }),
                         "is moved twice in this frame (line 4)"));
    EXPECT_TRUE(contains(told(wrong, "rod r from skeleton near nobody\n"), "nobody"));
    EXPECT_TRUE(
        contains(told(wrong, kSpine + "frame 0\nmove spine point 5 translate 0 0 1\n"),
                 "point: got 5, need 0 to 4"));
    std::string far = "move spine point 2";
    for (int k = 0; k < 20; ++k)
        far += " translate 0 0 1e308";
    EXPECT_TRUE(contains(told(wrong, kSpine + "frame 0\n" + far + "\n"),
                         "h.handles:4: spine: moves beyond what numbers can hold"));
    // So far away that no state of the rod is at rest.
    const auto tear = [&]
    {
        played(long_bar(), kSpine + "frame 1\nmove spine point 2 translate 0 0 1e9\n",
               settings(8));
    };
    EXPECT_TRUE(contains(error_of(none, tear), "the rod finds no rest")) << "torn";
    Shape triangle;
    triangle.samples = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    triangle.triangles = {{0, 1, 2}};
    const auto draw = [&]
    { Session(model(triangle), handles("rod r from skeleton\nframe 1\n"), settings(8)); };
    EXPECT_TRUE(contains(error_of(none, draw), "the shape has no centre line there"));
    EXPECT_TRUE(contains(told(wrong, "rod r points 1 1 1  1 1 1  1 1 1  1 1 1\n"),
                         "h.handles:2: r:"));
    EXPECT_TRUE(contains(told(wrong, "rod r points 0 0 0  0 0 1  0 0 2  0 0 4\nframe 0\n"
                                     "move r point 1 turn 20\n"),
                         "point 1 is a control point off the rod"));
}

TEST(RodSession, a_flat_model_takes_no_rod)
{
    SessionSettings flat = settings(12);
    flat.cells.is_flat = true;
    const auto play = [&]
    {
        played(support::sheet_shape(3.0, 1.0, 6),
               "fixed foot box -1 -1 -1 0.3 4 1\n"
               "rod spine through 0 0.5 0 3 0.5 0\nframe 1\n"
               "move spine end translate 0 0.1 0\n",
               flat);
    };
    EXPECT_TRUE(
        contains(error_of(Fault::Malformed, play), "h.handles:3: spine: a flat model"));
}

TEST(RodSession, a_flat_model_with_a_curve_bends_in_space)
{
    const Session session = played(support::sheet_shape(3.0, 1.0, 6),
                                   "fixed foot box -1 -1 -1 0.3 4 1\n"
                                   "curve way through 2 0 0  3 0 0\n"
                                   "handle hand box 2.7 -1 -1 4 4 1\nframe 1\n"
                                   "move hand translate 0 0.1 0\n",
                                   settings(12));
    EXPECT_FALSE(session.system()->rest().is_flat());
}

} // namespace cellwarp::core
