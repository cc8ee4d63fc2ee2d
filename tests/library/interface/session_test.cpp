// SPDX-License-Identifier: GPL-3.0-or-later
#include <cellwarp/session.h>

#include <atomic>
#include <thread>

#include "tests/support/interface.h"

namespace cellwarp
{

using support::Bar;
using support::bend;
using support::coarse;
using support::contains;
using support::error_of;
using support::numbers;

namespace
{

Edit two_frames(double second)
{
    Edit edit = bend(30.0);
    edit.frame(2).move("head", {rotate_about_border({1, 0, 0}, second)});
    return edit;
}

} // namespace

TEST(Session, gives_the_bits_of_one_call)
{
    const Model model{Bar()};
    Session session(model, two_frames(60.0), coarse());
    EXPECT_EQ(session.num_upcoming(), 2u);
    EXPECT_EQ(session.upcoming(), 1);
    while (session.next())
    {
    }
    EXPECT_EQ(session.upcoming(), std::nullopt);
    ASSERT_EQ(session.frames().size(), 2u);
    EXPECT_EQ(session.frames()[1].frame, 2);
    EXPECT_TRUE(numbers(session.deformed().samples()) ==
                numbers(deform(model, two_frames(60.0), coarse()).deformed.samples()));
}

TEST(Session, solves_anew_only_frames_that_have_changed)
{
    const Model model{Bar()};
    Session session(model, two_frames(60.0), coarse());
    while (session.next())
    {
    }
    session.set_edit(two_frames(-20.0));
    EXPECT_EQ(session.num_upcoming(), 1u);
    EXPECT_EQ(session.upcoming(), 2);
    ASSERT_EQ(session.frames().size(), 1u);
    session.next();
    ASSERT_EQ(session.frames().size(), 2u);
    EXPECT_TRUE(numbers(session.deformed().samples()) ==
                numbers(deform(model, two_frames(-20.0), coarse()).deformed.samples()));
    session.set_edit(bend(30.0)); // as undo has it
    EXPECT_EQ(session.num_upcoming(), 0u);
    EXPECT_EQ(session.frames().size(), 1u);
    EXPECT_TRUE(numbers(session.deformed().samples()) ==
                numbers(deform(model, bend(30.0), coarse()).deformed.samples()));
}

TEST(Session, is_as_before_after_an_error)
{
    const Model model{Bar()};
    Session session(model, two_frames(60.0), coarse());
    std::stop_source source;
    source.request_stop();
    Control control;
    control.stop = source.get_token();
    error_of(Fault::Stopped, [&] { session.next(true, control); });
    EXPECT_EQ(session.upcoming(), 1);
    EXPECT_TRUE(session.frames().empty());
    while (session.next())
    {
    }
    EXPECT_TRUE(numbers(session.deformed().samples()) ==
                numbers(deform(model, two_frames(60.0), coarse()).deformed.samples()));
    Edit wrong;
    wrong.fixed("foot", Selector::group("none")).frame(1);
    EXPECT_TRUE(
        contains(error_of(Fault::Malformed, [&] { session.set_edit(wrong); }), "none"));
    EXPECT_FALSE(session.next());
    error_of(Fault::Usage, [&] { session.cells(); });
    error_of(Fault::Usage, [&] { session.borders(); });
    error_of(Fault::Usage, [&] { session.field(); });
    EXPECT_TRUE(session.rods().empty());
    session.set_edit(bend(30.0));
    while (session.next())
    {
    }
    EXPECT_TRUE(numbers(session.deformed().samples()) ==
                numbers(deform(model, bend(30.0), coarse()).deformed.samples()));
}

TEST(Session, describes_its_cells_and_borders)
{
    Session session(Model(Bar()), bend(), coarse());
    const Cells cells = session.cells();
    ASSERT_FALSE(cells.regions.empty());
    EXPECT_EQ(cells.corners.size(), 24 * cells.regions.size());
    EXPECT_EQ(cells.depths.size(), cells.regions.size());
    int num_held = 0;
    for (std::size_t c = 0; c < cells.regions.size(); ++c)
    {
        EXPECT_LT(cells.corners[24 * c], cells.corners[24 * c + 3]);
        num_held += cells.regions[c] == 0;
    }
    EXPECT_GT(num_held, 0);
    const std::map<std::string, Vec3> borders = session.borders();
    ASSERT_EQ(borders.count("head"), 1u);
    EXPECT_NEAR(borders.at("head")[0], 0.5, 0.01);
    EXPECT_GT(borders.at("head")[2], 4.0);
}

TEST(Session, reports_rods_and_joints)
{
    const Model model{Bar()};
    Edit edit;
    edit.fixed("foot", Selector::box({0, 0, 0}, {1, 1, 0.5}))
        .rod("rod", {.points = {{0.5, 0.5, 1}, {0.5, 0.5, 4}}, .radius = 0.3});
    edit.frame(1).move("rod", kEnd, {translate({0.5, 0, 0})});
    const Result bent = deform(model, edit, coarse());
    ASSERT_EQ(bent.rods.size(), 1u);
    EXPECT_EQ(bent.rods[0].name, "rod");
    EXPECT_NEAR(bent.rods[0].points.back()[0], 1.0, 1e-6);
    Edit posed;
    const std::vector<Joint> joints = {
        {.name = "root", .at = {0.5, 0.5, 0}},
        {.name = "middle", .parent = "root", .at = {0.5, 0.5, 2.5}},
        {.name = "tip", .parent = "middle", .at = {0.5, 0.5, 5}}};
    posed.skeleton(joints).frame(1);
    const Operation turn = rotate({1, 0, 0}, 90);
    posed.pose("middle", {&turn, 1});
    Session session(model, posed, coarse());
    session.next();
    ASSERT_EQ(session.joints().size(), 3u);
    EXPECT_NEAR(session.joints()[2].place[1], -2.0, 1e-6);
}

TEST(Session, has_no_field_before_a_frame_moved_samples)
{
    Session session(Model(Bar()), bend(), coarse());
    EXPECT_TRUE(contains(error_of(Fault::Usage, [&] { session.field(); }), "no field"));
    session.next(false);
    error_of(Fault::Usage, [&] { session.field(); });
}

TEST(Session, refuses_a_second_thread_meanwhile)
{
    Session session(Model(Bar(12)), two_frames(60.0)); // the watch is called on the way
    Control control;
    int num_refused = 0;
    control.watch = [&](const Progress&)
    {
        try
        {
            session.num_upcoming();
        }
        catch (const Error& error)
        {
            num_refused += error.fault() == Fault::Usage;
        }
    };
    session.next(true, control);
    EXPECT_GE(num_refused, 1);
    EXPECT_EQ(session.num_upcoming(), 1u);
}

} // namespace cellwarp
