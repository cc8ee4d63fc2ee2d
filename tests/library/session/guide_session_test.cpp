// SPDX-License-Identifier: GPL-3.0-or-later
// Curves: places of a shape that stay on them.
#include <cmath>

#include <gtest/gtest.h>

#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "octree/base/segment.h"
#include "tests/support/sessions.h"
#include "tests/support/shapes.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::error_of;
using support::handles;
using support::long_bar;
using support::model;
using support::played;
using support::settings;

namespace
{

using Eigen::Vector3d;

SessionSettings tight(int across)
{
    SessionSettings s = settings(across);
    s.gradient_tolerance = 1e-9;
    return s;
}

const std::string kFoot = "fixed foot box -1 -1 -1 1 1 0.5\n";
const std::string kTip = kFoot + "pin tip sphere 0 0 4 0.01\n";
const std::string kRail = kTip + "curve rail through 0 -1 4.2  0 0.6 4.4  0 2 3.8\n";

std::size_t tip_of(const Shape& shape)
{
    for (std::size_t i = 0; i < shape.samples.size(); ++i)
        if (shape.samples[i] == Vector3d(0, 0, 4))
            return i;
    return 0;
}

/// The nearest place of a curve's line, as far as its pieces show it.
double distance_of_line(const std::vector<Vector3d>& line, const Vector3d& x)
{
    double least = INFINITY;
    for (std::size_t k = 0; k + 1 < line.size(); ++k)
    {
        const double t = nearest_share(line[k], line[k + 1], x);
        least = std::min(least, (x - line[k] - t * (line[k + 1] - line[k])).norm());
    }
    return least;
}

} // namespace

TEST(GuideSession, a_pin_at_a_share_of_a_curve_is_there_exactly)
{
    const Shape shape = long_bar();
    for (const double share : {0.0, 0.5, 1.0})
    {
        const Session session = played(
            shape, kRail + "on tip rail at " + std::to_string(share) + "\nframe 1\n",
            tight(12));
        const RodReport rail = session.rods()[0];
        const Vector3d wanted = rail.line[idx(int(share * 128))];
        EXPECT_LT((session.deformed().samples[tip_of(shape)] - wanted).norm(), 4e-9);
        EXPECT_NEAR(rail.pins.at(0).at, share, 1e-12);
        EXPECT_FALSE(rail.pins[0].slides);
        EXPECT_LT(session.frames()[0].handle_residual, 1e-12);
    }
}

TEST(GuideSession, a_pin_that_slides_stays_on_its_curve_where_nothing_pulls_along_it)
{
    const Shape shape = long_bar();
    const Session session = played(shape, kRail + "on tip rail\nframe 1\n", tight(12));
    const RodReport rail = session.rods()[0];
    const Vector3d place = session.deformed().samples[tip_of(shape)];
    EXPECT_LT(distance_of_line(rail.line, place), 1e-4); // of its straight pieces
    const RodReport::Pin& pin = rail.pins.at(0);
    EXPECT_TRUE(pin.slides);
    EXPECT_GT(pin.at, 0.05);
    EXPECT_LT(pin.at, 0.95);
    // The force is across the curve.
    const std::size_t k = idx(int(pin.at * 128));
    const Vector3d along = (rail.line[k + 1] - rail.line[k]).normalized();
    EXPECT_GT(pin.force.norm(), 0.0);
    EXPECT_LT(std::abs(pin.force.dot(along)), 0.02 * pin.force.norm());
    // Held anywhere else on the curve it needs more energy.
    const double energy = session.frames()[0].solve.energy_after;
    for (const double away : {-0.05, 0.05})
        EXPECT_GT(played(shape,
                         kRail + "on tip rail at " + std::to_string(pin.at + away) +
                             "\nframe 1\n",
                         tight(12))
                      .frames()[0]
                      .solve.energy_after,
                  energy);
}

TEST(GuideSession, a_curve_that_moves_takes_its_pins_along)
{
    const Shape shape = long_bar();
    const std::string moved =
        kRail + "on tip rail at 0.5\nframe 1\nframe 2\nmove rail translate 0 0 0.5\n"
                "frame 3\nmove rail point 1 translate 0 0.3 0.3\n"
                "move rail translate 0 0 0.5\n";
    const Session session = played(shape, moved, tight(12));
    const RodReport rail = session.rods()[0];
    EXPECT_LT((rail.points[1] - Vector3d(0, 0.9, 5.2)).norm(), 1e-9);
    EXPECT_LT((rail.points[0] - Vector3d(0, -1, 4.7)).norm(), 1e-9);
    EXPECT_LT(distance_of_line(rail.line, session.deformed().samples[tip_of(shape)]),
              1e-3);
    EXPECT_LT(session.frames()[2].handle_residual, 1e-12);
}

TEST(GuideSession, a_pin_stays_on_a_rod_as_well)
{
    const Shape one = support::box_shape({-0.5, -0.5, 0}, {0.5, 0.5, 4}, 4);
    const Shape two = support::box_shape({2, -0.5, 0}, {3, 0.5, 4}, 4);
    const Shape both = support::joined(one, two);
    const Session session = played(both,
                                   "fixed foot box 1.5 -1 -1 4 1 0.5\n"
                                   "pin tip sphere 2.5 0 4 0.01\n"
                                   "rod spine through 0 0 0  0 0 2  0 0 4\n"
                                   "on tip spine at 1\nframe 1\n"
                                   "move spine end translate 1.5 0 0\n",
                                   tight(16));
    std::size_t tip = 0;
    for (std::size_t i = 0; i < both.samples.size(); ++i)
        if (both.samples[i] == Vector3d(2.5, 0, 4))
            tip = i;
    EXPECT_LT((session.deformed().samples[tip] - session.rods()[0].points[2]).norm(),
              4e-9);
    EXPECT_LT((session.rods()[0].points[2] - Vector3d(1.5, 0, 4)).norm(), 4e-9);
}

TEST(GuideSession, all_moved_alike_is_moved_rigidly)
{
    const Shape shape = long_bar();
    const std::string rigid = " rotate 1 2 3 80 about 0 0 1 translate 1 2 0\n";
    const std::string first = "handle foot box -1 -1 -1 1 1 0.5\n"
                              "pin tip sphere 0 0 4 0.01\n"
                              "curve rail through 0 -1 4.2  0 0.6 4.4  0 2 3.8\n"
                              "on tip rail\nframe 1\n";
    const Session before = played(shape, first, tight(12));
    const Session after = played(
        shape, first + "frame 2\nmove foot" + rigid + "move rail" + rigid, tight(12));
    // The same place of the curve, without a step of the solve.
    EXPECT_EQ(after.frames()[1].solve.iterations, 0);
    EXPECT_NEAR(after.rods()[0].pins[0].at, before.rods()[0].pins[0].at, 1e-12);
}

TEST(GuideSession, undone_and_done_again_it_is_the_same_to_the_bit)
{
    SessionSettings keeps = tight(12);
    keeps.keeps_checkpoints = true;
    const std::string first = kRail + "on tip rail\nframe 1\n",
                      second = first + "frame 2\nmove rail translate 0 0.2 0.3\n";
    Session edited(model(long_bar()), handles(second), keeps);
    for (const std::string& text : {second, first, second})
    {
        edited.set_script(handles(text));
        while (edited.next_frame(true))
            ;
        Session fresh(model(long_bar()), handles(text), keeps);
        while (fresh.next_frame(true))
            ;
        EXPECT_EQ(edited.deformed().samples, fresh.deformed().samples);
    }
    std::vector<std::vector<Vector3d>> results;
    for (const int threads : {1, 2})
    {
        const ThreadLimit limit(threads);
        results.push_back(played(long_bar(), second, tight(12)).deformed().samples);
    }
    EXPECT_EQ(results[0], results[1]);
}

TEST(GuideSession, what_cannot_be_is_told)
{
    const auto told = [](Fault fault, const std::string& text)
    {
        return error_of(
            fault,
            [&] { Session(model(long_bar()), handles(text + "frame 1\n"), tight(8)); });
    };
    const auto refused = [](const std::string& text)
    { return error_of(Fault::Malformed, [&] { handles(text); }); };
    const std::string rail = "curve rail through 0 0 4  0 2 4\n";
    EXPECT_TRUE(contains(told(Fault::Malformed,
                              "pin side box -1 -1 3.9 1 1 5\n" + rail + "on side rail\n"),
                         "h.handles:4: side: 'on' needs a pin of one place"));
    EXPECT_TRUE(
        contains(told(Fault::Unsolvable,
                      "fixed top box -1 -1 3.9 1 1 5\npin tip sphere 0 0 4 0.01\n" +
                          rail + "on tip rail\n"),
                 "tip"));
    // The region in its cell does not hold its sample.
    EXPECT_TRUE(
        contains(told(Fault::Unsolvable, "fixed part box 0.01 0.01 3.3 1 1 4.1\n"
                                         "pin tip sphere 0 0 4 0.01\n" +
                                             rail + "on tip rail\n"),
                 "h.handles:3: tip: fixed region part holds the cell of its sample"));
    EXPECT_TRUE(
        contains(refused(kRail + "on foot rail\n"), "only a pin can stay on a curve"));
    EXPECT_TRUE(contains(refused(kTip + "on tip foot\n"), "is no curve or rod"));
    EXPECT_TRUE(
        contains(refused(kRail + "on tip rail\nframe 1\nmove tip translate 0 0 1\n"),
                 "is on a curve (line 5): that moves it"));
    EXPECT_TRUE(contains(refused(kRail + "on tip rail at 1.5\n"), "need 0 to 1"));
}

} // namespace cellwarp::core
