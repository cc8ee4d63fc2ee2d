// SPDX-License-Identifier: GPL-3.0-or-later
// Rods and curves in the hand.
#include <gtest/gtest.h>

#include "tests/editor/tools/desk.h"
#include "tests/support/files.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::Desk;

namespace
{

using Eigen::Vector3d;

constexpr Modifiers kShift{.shift = true}, kControl{.control = true};

/// The left end fixed, a rod through the rest.
struct RodDesk : Desk
{
    RodDesk()
    {
        select(-0.1, 0.1);
        key('j');
        key('d');
        for (const double x : {0.5, 1.5, 2.5})
            click(pixel({x, 0.5, 0.5}));
        key(Key::Enter);
        settle();
    }
    Vector3d place(std::size_t point)
    {
        return editing.view_frame().to_model(editing.shape().lines[0].points[point]);
    }
};

} // namespace

TEST(InteractionLines, clicks_through_the_shape_draw_a_rod_in_its_middle)
{
    RodDesk desk;
    EXPECT_EQ(desk.last_edit(), "Draw rod");
    EXPECT_EQ(desk.hand.active_region(), "rod");
    EXPECT_EQ(desk.hand.tool(), Tool::Move);
    const EditedRegion& rod = desk.region("rod");
    ASSERT_EQ(rod.points.size(), 3u);
    for (std::size_t k = 0; k < 3; ++k)
        EXPECT_LT((rod.points[k].rest - Vector3d(0.5 + double(k), 0.5, 0.5)).norm(),
                  0.02);
    const std::vector<SeenLine> lines = desk.hand.lines();
    ASSERT_EQ(lines.size(), 1u);
    EXPECT_TRUE(lines[0].is_rod && lines[0].is_active);
    EXPECT_TRUE(lines[0].points[0].is_held && !lines[0].points[1].is_held);
}

TEST(InteractionLines, a_line_under_way_is_shown_shortened_and_dropped)
{
    Desk desk;
    desk.hand.set_tool(Tool::Draw);
    EXPECT_TRUE(contains(desk.hand.status(), "Click along"));
    desk.click(desk.pixel({0.5, 0.5, 0.5}));
    desk.click(desk.pixel({1.5, 0.5, 0.5}));
    desk.click(desk.pixel({2.5, 3.0, 0.5})); // beside the shape: as deep as the last
    ASSERT_EQ(desk.hand.drawn().size(), 3u);
    EXPECT_NEAR(desk.editing.view_frame().to_model(desk.hand.drawn()[2]).z(), 0.5, 0.02);
    EXPECT_TRUE(contains(desk.hand.status(), "3 points"));
    desk.key(Key::Backspace);
    EXPECT_EQ(desk.hand.drawn().size(), 2u);
    desk.hand.focus_lost(); // nothing is lost by looking elsewhere
    EXPECT_EQ(desk.hand.drawn().size(), 2u);
    desk.key('z', kControl); // takes back a point, no edit
    EXPECT_EQ(desk.hand.drawn().size(), 1u);
    desk.key(Key::Escape);
    EXPECT_TRUE(desk.hand.drawn().empty());
    desk.click(desk.pixel({0.5, 0.5, 0.5}));
    desk.key('5'); // another tool: dropped
    EXPECT_TRUE(desk.hand.drawn().empty());
    desk.key('7');
    desk.click(desk.pixel({0.5, 0.5, 0.5}));
    desk.key(Key::Enter); // one point is no line
    EXPECT_TRUE(contains(desk.hand.complaint(), "needs two points"));
    EXPECT_EQ(desk.hand.drawn().size(), 1u);
    desk.click(desk.pixel({1.5, 0.5, 0.5}));
    desk.hand.key({Key::Enter, 0, false, kShift});
    EXPECT_EQ(desk.document().regions()[0].role, Role::Curve);
}

TEST(InteractionLines, a_point_is_dragged_twisted_and_let_go)
{
    RodDesk desk;
    const Vector3d from = desk.place(2);
    desk.drag(desk.pixel(from), desk.pixel(from + Vector3d(-0.2, 0.8, 0)));
    desk.settle();
    EXPECT_EQ(desk.last_edit(), "Move point 2 of rod");
    EXPECT_EQ(desk.hand.active_point(), 2u);
    EXPECT_LT((desk.place(2) - (from + Vector3d(-0.2, 0.8, 0))).norm(), 0.03);
    // By the wheel, while it is in the hand.
    const Vector3d end = desk.place(2);
    desk.press(desk.pixel(end));
    desk.hand.wheel({0, 3}, {});
    EXPECT_TRUE(contains(desk.hand.status(), "twist 15°")) << desk.hand.status();
    desk.release();
    desk.settle();
    EXPECT_EQ(desk.last_edit(), "Turn point 2 of rod");
    EXPECT_NEAR(desk.region("rod").points[2].degrees, 15.0, 1e-9);
    EXPECT_LT((desk.place(2) - end).norm(), 1e-6);
    // By a key and a number.
    desk.key('r');
    desk.keys("30");
    desk.key(Key::Enter);
    EXPECT_NEAR(std::abs(desk.region("rod").points[2].degrees - 15.0), 30.0, 1e-9);
    desk.settle();
    desk.key('u');
    EXPECT_EQ(desk.last_edit(), "Release point 2 of rod");
    EXPECT_EQ(desk.region("rod").points[2].parts, HoldParts());
}

TEST(InteractionLines, points_come_and_go_before_anything_has_moved)
{
    RodDesk desk;
    desk.click(desk.pixel(desk.place(1)));
    ASSERT_EQ(desk.hand.active_point(), 1u);
    EXPECT_EQ(desk.last_edit(), "Draw rod"); // a click moves nothing
    desk.key('n', {.shift = true});
    ASSERT_EQ(desk.region("rod").points.size(), 4u);
    EXPECT_EQ(desk.hand.active_point(), 2u);
    EXPECT_NEAR(desk.region("rod").points[2].rest.x(), 2.0, 0.02);
    desk.settle();
    desk.key(Key::Delete);
    EXPECT_EQ(desk.region("rod").points.size(), 3u);
    EXPECT_FALSE(desk.hand.active_point());
    desk.key(Key::Delete); // the rod itself
    EXPECT_EQ(desk.document().region("rod"), nullptr);
    desk.settle();
    EXPECT_TRUE(desk.hand.lines().empty());
}

TEST(InteractionLines, commands_of_a_point_say_so_where_none_is_active)
{
    RodDesk desk;
    const std::string before = desk.last_edit();
    for (const Command command :
         {Command::InsertPoint, Command::ReleasePoint, Command::ReleaseDirection})
    {
        desk.hand.set_active_point(std::nullopt);
        desk.hand.run(command);
        EXPECT_TRUE(contains(desk.hand.complaint(), "no point of a rod is active"))
            << desk.hand.complaint();
        EXPECT_EQ(desk.last_edit(), before);
    }
}

TEST(InteractionLines, a_point_that_is_gone_or_is_a_control_point_is_told)
{
    RodDesk desk;
    desk.click(desk.pixel(desk.place(1)));
    ASSERT_EQ(desk.hand.active_point(), 1u);
    desk.key('z', {.control = true}); // the rod with it, and no frame comes before
    desk.key(Key::Delete);
    EXPECT_TRUE(contains(desk.hand.complaint(), "no point of a rod is active"))
        << desk.hand.complaint();

    Desk other(
        [](const support::Folder& folder)
        {
            Desk::bar(folder);
            folder.write("r.handles", "cellwarp-handles 1\nrod r points 0.2 0.5 0.5  "
                                      "1 0.5 0.5  2 0.5 0.5  2.8 0.5 0.5\n");
            return folder.write("r.json", R"({"cellwarp": 1, "model": "bar.obj",
                                "handles": "r.handles"})");
        });
    other.settle();
    other.hand.set_active_region("r");
    other.hand.set_active_point(1);
    other.key('n', {.shift = true});
    EXPECT_TRUE(contains(other.hand.complaint(), "is told by control points"))
        << other.hand.complaint();
}

TEST(InteractionLines, the_last_point_once_more_ends_the_line)
{
    Desk desk;
    desk.key('d');
    for (const double x : {0.5, 1.5, 2.5, 2.5})
        desk.click(desk.pixel({x, 0.5, 0.5}));
    EXPECT_EQ(desk.last_edit(), "Draw rod");
    EXPECT_EQ(desk.region("rod").points.size(), 3u);
}

TEST(InteractionLines, delete_never_takes_the_rod_for_a_point_that_undo_took)
{
    RodDesk desk;
    desk.click(desk.pixel(desk.place(1)));
    for (int k = 0; k < 3; ++k)
    {
        desk.key('n', {.shift = true});
        desk.settle();
    }
    for (int k = 0; k < 3; ++k)
        desk.key('z', kControl);
    desk.settle();
    desk.key(Key::Delete);
    ASSERT_NE(desk.document().region("rod"), nullptr);
    EXPECT_EQ(desk.region("rod").points.size(), 2u);
}

TEST(InteractionLines, a_line_drawn_after_a_move_says_that_rods_end)
{
    RodDesk desk;
    desk.drag(desk.pixel(desk.place(2)), desk.pixel(desk.place(2) + Vector3d(0, 0.3, 0)));
    desk.settle();
    desk.key('d');
    for (const double x : {0.5, 1.5})
        desk.click(desk.pixel({x, 0.5, 0.5}));
    desk.key(Key::Enter);
    EXPECT_TRUE(contains(desk.hand.complaint(), "posed by rod stays"))
        << desk.hand.complaint();
    EXPECT_EQ(desk.document().handles().stages.size(), 2u);
}

TEST(InteractionLines, the_gizmo_is_on_the_active_point)
{
    RodDesk desk;
    desk.click(desk.pixel(desk.place(2)));
    const Vector3d before = desk.place(2);
    const Eigen::Vector2d arrow = desk.on(GizmoPart::Kind::Axis, 1);
    desk.drag(arrow, arrow + Eigen::Vector2d(0, -0.5 * desk.pixels_per_unit()));
    desk.settle();
    EXPECT_LT((desk.place(2) - (before + Vector3d(0, 0.5, 0))).norm(), 0.02);
    // It turns about its tangent alone: one ring.
    desk.hand.set_tool(Tool::Rotate);
    desk.hand.set_active_point(2);
    for (const GizmoPart& part : desk.hand.gizmo())
        EXPECT_TRUE(part.kind != GizmoPart::Kind::Ring || part.axis == 3);
}

} // namespace cellwarp::core
