// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/tools/interaction.h"

#include <cmath>
#include <limits>
#include <numbers>

#include <gtest/gtest.h>

#include "tests/editor/tools/desk.h"
#include "tests/support/files.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

using support::Desk;

namespace
{

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr Modifiers kShift{.shift = true};
constexpr Modifiers kControl{.control = true};
constexpr Modifiers kAlt{.alt = true};

} // namespace

TEST(Interaction, a_box_selects_and_keys_name_what_is_selected)
{
    Desk desk;
    desk.select(-0.1, 0.1);
    const std::size_t end = desk.document().selection().count();
    EXPECT_EQ(end, 49u); // 7 x 7
    EXPECT_EQ(desk.last_edit(), "Select by box");
    EXPECT_EQ(desk.depth(), 1u);
    desk.key('j');
    EXPECT_EQ(desk.hand.active_region(), "fixed");
    EXPECT_EQ(desk.region("fixed").role, Role::Fixed);
    EXPECT_EQ(desk.region("fixed").samples.size(), end);
    EXPECT_TRUE(desk.hand.gizmo().empty()); // nothing to move
    desk.select(2.9, 3.1);
    desk.key('h');
    EXPECT_EQ(desk.hand.active_region(), "handle");
    EXPECT_EQ(desk.hand.tool(), Tool::Box); // another box may follow
    EXPECT_TRUE(desk.hand.gizmo().empty());
    desk.key('5');
    EXPECT_EQ(desk.hand.gizmo().size(), 4u); // two arrows, a square, a circle
    EXPECT_EQ(desk.depth(), 4u);
    desk.key(Key::Delete);
    EXPECT_EQ(desk.document().region("handle"), nullptr);
    EXPECT_EQ(desk.hand.active_region(), "");
    desk.key('z', kControl);
    EXPECT_NE(desk.document().region("handle"), nullptr);
}

TEST(Interaction, selections_are_added_to_subtracted_from_and_taken_back)
{
    Desk desk;
    desk.select(-0.1, 0.1);
    desk.select(2.9, 3.1, kShift);
    EXPECT_EQ(desk.document().selection().count(), 98u);
    EXPECT_EQ(desk.last_edit(), "Add by box");
    desk.select(-0.1, 0.1, kControl);
    EXPECT_EQ(desk.document().selection().count(), 49u);
    EXPECT_EQ(desk.last_edit(), "Subtract by box");
    const std::size_t depth = desk.depth();
    // Escape on the way leaves all as it was.
    desk.hand.set_tool(Tool::Box);
    desk.press(desk.pixel({1, 0, 0}));
    desk.move(desk.pixel({2, 1, 0}));
    desk.frame();
    EXPECT_EQ(desk.hand.outline().size(), 4u);
    EXPECT_EQ(desk.hand.status(), "Select by box (Esc: back)");
    EXPECT_TRUE(desk.hand.is_busy());
    desk.key(Key::Escape);
    desk.release();
    EXPECT_FALSE(desk.hand.is_busy());
    EXPECT_EQ(desk.depth(), depth);
    desk.press(desk.pixel({1, 0, 0})); // and so does the right button
    desk.move(desk.pixel({2, 1, 0}));
    desk.hand.button(Button::Right, true, {});
    EXPECT_FALSE(desk.hand.is_busy());
    desk.hand.button(Button::Right, false, {});
    desk.release();
    EXPECT_EQ(desk.depth(), depth);
    desk.keys("a");
    EXPECT_EQ(desk.document().selection().count(),
              desk.document().selection().num_samples());
    desk.key('a', kAlt);
    EXPECT_TRUE(desk.document().selection().empty());
    desk.key('i', kControl);
    EXPECT_EQ(desk.last_edit(), "Invert selection");
    EXPECT_FALSE(desk.document().selection().empty());
}

TEST(Interaction, takes_what_is_seen_or_goes_through)
{
    Desk desk;
    desk.hand.set_tool(Tool::Box);
    EXPECT_TRUE(desk.hand.selects_through());
    desk.drag({0, 0}, {900, 600});
    EXPECT_EQ(desk.document().selection().count(),
              desk.document().selection().num_samples());
    EXPECT_EQ(desk.hand.hint(), "Press J to fix what is selected");
    desk.key('z', kAlt);
    EXPECT_FALSE(desk.hand.selects_through());
    desk.key('5', kAlt); // in perspective the front is all that is seen
    desk.drag({0, 0}, {900, 600});
    EXPECT_EQ(desk.document().selection().count(), 133u); // 19 x 7
    EXPECT_EQ(desk.hand.hint(),
              std::to_string(desk.document().selection().num_samples() - 133) +
                  " hidden behind them were left out (Alt+Z: take what is hidden, too). "
                  "Press J to fix what is selected");
    desk.key('z', kControl); // another selection is there
    EXPECT_EQ(desk.hand.hint(), "Press J to fix what is selected");
    desk.hand.set_tool(Tool::Brush);
    EXPECT_FALSE(desk.hand.selects_through());
    desk.key('z', kAlt);
    EXPECT_TRUE(desk.hand.selects_through());
    desk.hand.set_tool(Tool::Lasso); // which has its own
    EXPECT_FALSE(desk.hand.selects_through());
}

TEST(Interaction, clicks_lassos_and_brushes_select_too)
{
    Desk desk;
    desk.hand.set_tool(Tool::Click);
    desk.click(desk.pixel({1.02, 0.51, 1}));
    ASSERT_EQ(desk.document().selection().count(), 1u);
    const std::uint32_t clicked = desk.document().selection().samples()[0];
    EXPECT_LT(
        (desk.document().model()->geometry.samples[clicked] - Eigen::Vector3d(1, 0.5, 1))
            .norm(),
        1e-9);
    EXPECT_EQ(desk.last_edit(), "Select by click");
    desk.click({5, 5}); // beside it: nothing
    EXPECT_TRUE(desk.document().selection().empty());
    desk.drag(desk.pixel({-0.1, -0.1, 1}), desk.pixel({0.1, 1.1, 1})); // as a box
    EXPECT_EQ(desk.document().selection().count(), 49u);

    desk.hand.set_tool(Tool::Lasso);
    desk.press(desk.pixel({-0.2, -0.2, 0}));
    for (const Eigen::Vector3d& x :
         {Eigen::Vector3d(0.1, -0.2, 0), Eigen::Vector3d(0.1, 1.2, 0),
          Eigen::Vector3d(-0.2, 1.2, 0)})
        desk.move(desk.pixel(x)); // all between two frames
    desk.release();
    EXPECT_EQ(desk.document().selection().count(), 49u);
    EXPECT_EQ(desk.depth(), 3u); // which changed nothing

    desk.hand.set_tool(Tool::Brush);
    desk.hand.set_selects_through(true);
    desk.hand.set_brush_radius(0.1 * desk.pixels_per_unit());
    EXPECT_FALSE(desk.hand.outline().empty());
    desk.press(desk.pixel({3, 0, 0}));
    desk.move(desk.pixel({3, 1, 0}));
    desk.frame();
    EXPECT_EQ(desk.hand.shown_selection().count(), 49u); // while it paints
    EXPECT_NE(desk.hand.shown_selection(), desk.document().selection());
    EXPECT_EQ(desk.depth(), 3u);
    desk.release();
    EXPECT_EQ(desk.last_edit(), "Select by brush");
    EXPECT_EQ(desk.hand.shown_selection(), desk.document().selection());
}

TEST(Interaction, selections_grow_shrink_and_follow_what_hangs_together)
{
    Desk desk;
    desk.select(-0.1, 0.1);
    desk.key('+');
    desk.frame();
    EXPECT_EQ(desk.last_edit(), "Grow selection");
    EXPECT_EQ(desk.document().selection().count(), 49u + 24u);
    desk.key('-', {}, true);
    desk.frame();
    EXPECT_EQ(desk.document().selection().count(), 49u);
    desk.move(desk.pixel({1.5, 0.5, 1}));
    desk.key('l');
    desk.frame();
    EXPECT_EQ(desk.document().selection().count(),
              desk.document().selection().num_samples());
    desk.key('l', kShift);
    desk.frame();
    EXPECT_TRUE(desk.document().selection().empty());
    EXPECT_EQ(desk.last_edit(), "Subtract connected");
}

TEST(Interaction, an_arrow_drags_the_handle_along_its_axis)
{
    Desk desk;
    desk.start();
    const std::size_t depth = desk.depth();
    const Eigen::Vector2d from = desk.on(GizmoPart::Kind::Axis, 0);
    desk.move(from);
    desk.frame();
    EXPECT_TRUE(desk.part(GizmoPart::Kind::Axis, 0)->is_hot);
    EXPECT_FALSE(desk.part(GizmoPart::Kind::Axis, 1)->is_hot);
    desk.press(from);
    EXPECT_EQ(desk.editing.dragged(), "handle");
    desk.move(from + Eigen::Vector2d(0.5 * desk.pixels_per_unit(), 40));
    desk.frame();
    EXPECT_EQ(desk.hand.status(), "Move X 0.5 (let go: done, Esc: back)");
    EXPECT_TRUE(desk.part(GizmoPart::Kind::Axis, 0)->is_hot);
    // The last move counts, though no frame came between it and the release.
    desk.move(from + Eigen::Vector2d(0.6 * desk.pixels_per_unit(), 40));
    desk.release();
    EXPECT_FALSE(desk.editing.dragged());
    EXPECT_EQ(desk.depth(), depth + 1);
    EXPECT_EQ(desk.last_edit(), "Move handle");
    EXPECT_LT(
        (desk.region("handle").placement.translation - Eigen::Vector3d(0.6, 0, 0)).norm(),
        1e-9);
    desk.key('z', kControl);
    EXPECT_EQ(desk.region("handle").placement, RigidMove{});
    EXPECT_EQ(desk.depth(), depth);
    desk.key('y', kControl);
    EXPECT_EQ(desk.depth(), depth + 1);
}

TEST(Interaction, keys_move_by_an_axis_and_a_typed_number)
{
    Desk desk;
    desk.start();
    const std::size_t depth = desk.depth();
    desk.keys("gx0.3");
    EXPECT_EQ(desk.hand.status(), "Move X [0.3] (Enter or click: done, Esc: back)");
    desk.key(Key::Enter);
    EXPECT_EQ(desk.depth(), depth + 1);
    EXPECT_EQ(desk.region("handle").placement.translation, Eigen::Vector3d(0.3, 0, 0));
    desk.keys("ry400"); // more than a turn
    desk.key(Key::Enter);
    EXPECT_EQ(desk.region("handle").placement.degrees, 400);
    EXPECT_EQ(desk.region("handle").placement.axis, Eigen::Vector3d(0, 1, 0));
    EXPECT_EQ(desk.last_edit(), "Turn handle");
    desk.keys("ry-30");
    desk.key(Key::Enter);
    EXPECT_NEAR(desk.region("handle").placement.degrees, 370, 1e-9);
    EXPECT_LT(
        (desk.region("handle").placement.translation - Eigen::Vector3d(0.3, 0, 0)).norm(),
        1e-12);
}

TEST(Interaction, escape_a_right_click_and_a_lost_focus_take_a_drag_back)
{
    Desk desk;
    desk.start();
    const std::size_t depth = desk.depth();
    const auto begin = [&]
    {
        desk.move(desk.pixel({2, 0.5, 1}));
        desk.key('g');
        desk.move(desk.pixel({2.3, 0.5, 1}));
        desk.frame();
        EXPECT_EQ(desk.editing.dragged(), "handle");
        EXPECT_TRUE(desk.hand.is_busy());
    };
    begin();
    desk.key(Key::Escape);
    EXPECT_FALSE(desk.editing.dragged());
    begin();
    desk.hand.button(Button::Right, true, {});
    desk.hand.button(Button::Right, false, {});
    EXPECT_FALSE(desk.editing.dragged());
    begin();
    desk.hand.focus_lost();
    EXPECT_FALSE(desk.editing.dragged());
    EXPECT_FALSE(desk.hand.is_busy());
    const Eigen::Vector2d from = desk.on(GizmoPart::Kind::Axis, 1);
    desk.press(from);
    desk.move(from + Eigen::Vector2d(0, -50));
    desk.key(Key::Escape);
    desk.release();
    EXPECT_EQ(desk.depth(), depth);
    EXPECT_EQ(desk.region("handle").placement, RigidMove{});
    begin();
    desk.hand.button(Button::Left, true, {}); // and a click means it
    desk.hand.button(Button::Left, false, {});
    EXPECT_EQ(desk.depth(), depth + 1);
    EXPECT_NEAR(desk.region("handle").placement.translation.x(), 0.3, 1e-9);
}

TEST(Interaction, a_handle_is_grabbed_and_bent_without_its_gizmo)
{
    Desk desk;
    desk.start();
    desk.hand.set_active_region("");
    const Eigen::Vector2d from = desk.pixel({2.99, 0.2, 1});
    desk.press(from);
    EXPECT_FALSE(desk.editing.dragged()); // perhaps a click
    desk.move(from + 0.4 * desk.pixels_per_unit() * Eigen::Vector2d(1, -1));
    desk.frame();
    EXPECT_EQ(desk.editing.dragged(), "handle");
    EXPECT_EQ(desk.hand.status(), "Move 0.4, 0.4, 0 (let go: done, Esc: back)");
    desk.release();
    EXPECT_LT((desk.region("handle").placement.translation - Eigen::Vector3d(0.4, 0.4, 0))
                  .norm(),
              1e-9);
    // In perspective too it stays under the pointer.
    desk.key('z', kControl);
    desk.settle();
    desk.key('5', kAlt);
    const Eigen::Vector3d point(2.99, 0.2, 1);
    const Eigen::Vector2d by(60, -35);
    desk.drag(desk.pixel(point), desk.pixel(point) + by);
    EXPECT_LT((desk.pixel(point + desk.region("handle").placement.translation) -
               desk.pixel(point) - by)
                  .norm(),
              1e-3);
    desk.key('z', kControl);
    desk.settle();
    desk.key('5', kAlt);
    // A click makes a region the active one.
    desk.hand.set_active_region("");
    desk.click(desk.pixel({0.01, 0.5, 1}));
    EXPECT_EQ(desk.hand.active_region(), "fixed");
}

TEST(Interaction, control_snaps_to_steps)
{
    Desk desk;
    desk.start();
    const Eigen::Vector2d from = desk.on(GizmoPart::Kind::Axis, 0);
    desk.drag(from, from + Eigen::Vector2d(0.33 * desk.pixels_per_unit(), 0), kControl);
    EXPECT_LT(
        (desk.region("handle").placement.translation - Eigen::Vector3d(0.3, 0, 0)).norm(),
        1e-9); // the model is 3 long: steps of 0.1
}

TEST(Interaction, rings_turn_about_the_regions_own_centre)
{
    Desk desk;
    desk.start();
    desk.hand.set_tool(Tool::Rotate);
    const Eigen::Vector2d centre = desk.pixel(desk.region("handle").centre);
    desk.press(centre + 80 * Eigen::Vector2d(std::cos(0.7), -std::sin(0.7)));
    EXPECT_EQ(desk.editing.dragged(), "handle");
    for (int degrees = 0; degrees <= 450; degrees += 10)
    {
        const double angle = 0.7 + degrees * std::numbers::pi / 180;
        desk.move(centre + 80 * Eigen::Vector2d(std::cos(angle), -std::sin(angle)));
        desk.frame();
    }
    EXPECT_EQ(desk.hand.status(), "Turn Z 450° (let go: done, Esc: back)");
    desk.release();
    EXPECT_NEAR(desk.region("handle").placement.degrees, 450, 1e-6);
    EXPECT_LT((desk.region("handle").placement.axis - Eigen::Vector3d(0, 0, 1)).norm(),
              1e-12);
    EXPECT_EQ(desk.region("handle").placement.translation, Eigen::Vector3d(0, 0, 0));
}

TEST(Interaction, a_pin_moves_but_does_not_turn)
{
    Desk desk;
    desk.select(2.9, 3.1);
    desk.key('p');
    desk.hand.set_tool(Tool::Rotate);
    desk.frame();
    EXPECT_FALSE(desk.part(GizmoPart::Kind::Ring, 0));
    EXPECT_TRUE(desk.part(GizmoPart::Kind::Axis, 0));
    const Eigen::Vector2d from = desk.on(GizmoPart::Kind::Screen, 0);
    desk.press(from);
    desk.move(from + 0.2 * desk.pixels_per_unit() * Eigen::Vector2d(1, 1));
    desk.frame();
    EXPECT_EQ(desk.hand.status(), "Move 0.2, -0.2, 0 (let go: done, Esc: back)");
    desk.key(Key::Escape);
    desk.release();
    desk.key('r');
    EXPECT_FALSE(desk.hand.is_busy());
    EXPECT_EQ(desk.hand.complaint(), "pin is a pin: it turns as it likes");
    desk.keys("gy0.25");
    desk.key(Key::Enter);
    EXPECT_EQ(desk.hand.complaint(), ""); // gone with the next command
    EXPECT_EQ(desk.region("pin").placement.translation, Eigen::Vector3d(0, 0.25, 0));
}

TEST(Interaction, what_cannot_be_is_said)
{
    Desk desk;
    desk.key('h');
    EXPECT_EQ(desk.hand.complaint(), "nothing is selected");
    desk.key(Key::Delete);
    EXPECT_EQ(desk.hand.complaint(), "no region is active");
    desk.key('g');
    EXPECT_EQ(desk.hand.complaint(), "no region is active: select samples and press H");
    EXPECT_FALSE(desk.hand.is_busy());
    desk.key('a');
    EXPECT_EQ(desk.hand.complaint(), "");
    desk.key('z', kControl);
    desk.key('z', kControl); // nothing left to undo
    EXPECT_EQ(desk.hand.complaint(), "");
}

TEST(Interaction, hints_lead_to_the_first_bend_and_then_end)
{
    Desk desk;
    EXPECT_EQ(desk.hand.hint(),
              "Paint or box-select the part that stays; press J to fix it");
    desk.select(-0.1, 0.1);
    EXPECT_EQ(desk.hand.hint(), "Press J to fix what is selected");
    desk.key('j');
    EXPECT_EQ(desk.hand.hint(), "Select the part to grab; press H");
    desk.select(2.9, 3.1);
    desk.key('h');
    EXPECT_EQ(desk.hand.hint(),
              "Press G to move it and R to turn it, or 5 for its arrows");
    desk.key('5');
    EXPECT_EQ(desk.hand.hint(),
              "Drag the arrows, or press G to move it and R to turn it");
    desk.click(desk.on(GizmoPart::Kind::Axis, 1)); // that was no drag
    EXPECT_EQ(desk.hand.hint(),
              "Drag the arrows, or press G to move it and R to turn it");
    desk.keys("gy");
    EXPECT_EQ(desk.hand.hint(), "Let go where it should be; Ctrl+Z undoes");
    desk.keys("0.2");
    desk.key(Key::Enter);
    EXPECT_EQ(desk.hand.hint(),
              "R turns the handle, too: a hand that only moves kinks its wrist");
    desk.key('z', kControl); // nothing has moved
    EXPECT_EQ(desk.hand.hint(), "");
    desk.keys("rx20");
    desk.key(Key::Enter);
    EXPECT_EQ(desk.hand.hint(), "");
}

TEST(Interaction, a_thousand_moves_between_two_frames_are_one)
{
    Desk desk;
    desk.start();
    const Eigen::Vector2d from = desk.on(GizmoPart::Kind::Axis, 0);
    desk.press(from);
    for (int i = 0; i <= 1000; ++i)
        desk.move(from + Eigen::Vector2d(std::sin(0.1 * i) * 300, i % 7));
    desk.move(from + Eigen::Vector2d(0.7 * desk.pixels_per_unit(), 0));
    desk.move({kNan, 1});
    desk.move({1, std::numeric_limits<double>::infinity()});
    EXPECT_EQ(desk.hand.status().substr(0, 8), "Move X 0"); // nothing was done yet
    desk.frame();
    EXPECT_EQ(desk.hand.status(), "Move X 0.7 (let go: done, Esc: back)");
    desk.release();
    EXPECT_NEAR(desk.region("handle").placement.translation.x(), 0.7, 1e-9);
}

TEST(Interaction, drags_may_leave_the_view_and_numbers_may_be_none)
{
    Desk desk;
    desk.start();
    const Eigen::Vector2d from = desk.on(GizmoPart::Kind::Screen, 0);
    desk.drag(from, {-5000, 9000});
    EXPECT_TRUE(desk.region("handle").placement.translation.allFinite());
    EXPECT_LT(desk.region("handle").placement.translation.x(), -3.0);
    const Eigen::Matrix4d view = desk.hand.camera().view_matrix();
    desk.hand.wheel({kNan, kNan}, {});
    desk.hand.resize(kNan, 1);
    desk.hand.set_brush_radius(kNan);
    desk.frame();
    EXPECT_EQ(desk.hand.camera().view_matrix(), view);
    EXPECT_TRUE(std::isfinite(desk.hand.brush_radius()));
}

TEST(Interaction, a_view_of_no_size_does_no_harm)
{
    Desk desk;
    desk.start();
    for (const double size : {0.0, 1.0})
    {
        desk.hand.resize(size, size);
        for (const Tool tool :
             {Tool::Click, Tool::Box, Tool::Lasso, Tool::Brush, Tool::Move, Tool::Rotate})
        {
            desk.hand.set_tool(tool);
            desk.drag({0, 0}, {1, 1});
            desk.drag({0, 0}, {50, 50}, {}, Button::Middle);
            desk.hand.wheel({0, 1}, {});
            desk.keys("grx");
            desk.key(Key::Escape);
            desk.key(Key::Home);
            desk.hand.gizmo();
            desk.hand.outline();
        }
    }
    EXPECT_TRUE(desk.hand.camera().view_matrix().allFinite());
    desk.hand.resize(900, 600);
    desk.key(Key::Home);
    desk.frame();
    EXPECT_TRUE(desk.hand.camera().project({0, 0, 0}));
}

TEST(Interaction, hover_tells_what_a_click_would_pick)
{
    Desk desk;
    desk.start();
    desk.move(desk.pixel({1.52, 0.49, 1}));
    desk.frame();
    ASSERT_TRUE(desk.hand.hover());
    EXPECT_EQ(desk.hand.hover()->region, -1);
    EXPECT_LT((desk.document().model()->geometry.samples[desk.hand.hover()->sample] -
               Eigen::Vector3d(1.5, 0.5, 1))
                  .norm(),
              1e-9);
    EXPECT_LT(
        (desk.hand.hover()->point - desk.editing.view_frame().to_work({1.52, 0.49, 1}))
            .norm(),
        1e-5);
    desk.move(desk.pixel({0.01, 0.2, 1}));
    desk.frame();
    ASSERT_TRUE(desk.hand.hover());
    EXPECT_EQ(desk.hand.hover()->region, 0);
    desk.move({2, 2});
    desk.frame();
    EXPECT_FALSE(desk.hand.hover());
    desk.move(desk.pixel({1.5, 0.5, 1}));
    desk.frame();
    desk.hand.focus_lost();
    desk.frame();
    EXPECT_FALSE(desk.hand.hover());
}

TEST(Interaction, looks_around_like_blender_or_like_maya)
{
    Desk desk;
    const auto looked = [&](Button button, const Modifiers& modifiers)
    {
        const Eigen::Matrix4d before = desk.hand.camera().view_matrix();
        desk.drag({450, 300}, {480, 330}, modifiers, button);
        return desk.hand.camera().view_matrix() != before;
    };
    desk.hand.set_tool(Tool::Box);
    EXPECT_TRUE(looked(Button::Middle, {}));
    EXPECT_TRUE(looked(Button::Right, {}));
    EXPECT_TRUE(looked(Button::Left, kAlt));
    EXPECT_FALSE(looked(Button::Left, {}));
    desk.hand.set_tool(Tool::Move);
    desk.drag({5, 5}, {5, 5});
    const Eigen::Vector3d forward = desk.hand.camera().forward();
    desk.drag({5, 5}, {35, 35}); // beside the shape
    EXPECT_NE(desk.hand.camera().forward(), forward);
    desk.hand.set_navigation(Navigation::Maya);
    EXPECT_FALSE(looked(Button::Middle, {}));
    EXPECT_TRUE(looked(Button::Middle, kAlt));
    EXPECT_FALSE(looked(Button::Right, kShift));
}

TEST(Interaction, the_wheel_zooms_to_the_pointer_or_sizes_the_brush)
{
    Desk desk;
    desk.key('5', kAlt); // in perspective depth matters
    const Eigen::Vector3d point(0.5, 0.3, 1);
    const Eigen::Vector2d at = desk.pixel(point);
    const auto distance = [&] {
        return (desk.hand.camera().eye() - desk.editing.view_frame().to_work(point))
            .norm();
    };
    const double before = distance();
    desk.move(at);
    desk.hand.wheel({0, 3}, {});
    EXPECT_LT((desk.pixel(point) - at).norm(), 1e-3);
    EXPECT_NEAR(distance() / before, std::pow(1.15, -3), 1e-5);
    EXPECT_GT(desk.pixels_per_unit(), 0.0);
    desk.hand.set_tool(Tool::Brush);
    const double radius = desk.hand.brush_radius(), scale = desk.pixels_per_unit();
    desk.hand.wheel({0, 2}, {});
    EXPECT_GT(desk.hand.brush_radius(), radius);
    EXPECT_EQ(desk.pixels_per_unit(), scale);
    desk.hand.wheel({0, 2}, kControl);
    EXPECT_GT(desk.pixels_per_unit(), scale);
    for (int i = 0; i < 100; ++i)
        desk.hand.wheel({0, -9}, {});
    EXPECT_GE(desk.hand.brush_radius(), 1.0);
}

TEST(Interaction, keys_choose_views_and_what_is_framed)
{
    Desk desk;
    desk.key('7', {}, true);
    EXPECT_LT((desk.hand.camera().forward() - Eigen::Vector3d(0, -1, 0)).norm(), 1e-12);
    desk.key('3', {.control = true, .alt = true});
    EXPECT_LT((desk.hand.camera().forward() - Eigen::Vector3d(1, 0, 0)).norm(), 1e-12);
    desk.key('1', kAlt);
    desk.key(Key::Home);
    desk.select(2.9, 3.1);
    const double scale = desk.pixels_per_unit();
    desk.key('f');
    EXPECT_GT(desk.pixels_per_unit(), 1.3 * scale);
    EXPECT_LT((desk.pixel({3, 0.5, 0.5}) - Eigen::Vector2d(450, 300)).norm(), 1e-6);
    desk.key(Key::Home);
    EXPECT_NEAR(desk.pixels_per_unit(), scale, 1e-6);
    EXPECT_FALSE(desk.hand.camera().is_perspective());
    desk.key('5', kAlt);
    EXPECT_TRUE(desk.hand.camera().is_perspective());
}

TEST(Interaction, the_tool_in_use_stays_whatever_region_is_made)
{
    for (const Tool tool : {Tool::Box, Tool::Lasso, Tool::Brush, Tool::Rotate})
        for (const char made : {'j', 'h', 'p', 'k'})
        {
            Desk desk;
            desk.select(2.9, 3.1);
            desk.hand.set_tool(tool);
            desk.key(made);
            EXPECT_EQ(desk.depth(), 2u);
            EXPECT_EQ(desk.hand.tool(), tool);
        }
}

TEST(Interaction, what_follows_a_selection_that_is_still_being_found_is_not_lost)
{
    // No frame comes between: neighbours are not known yet, what is hidden neither.
    Desk desk;
    desk.select(-0.1, 0.1);
    desk.key('+');
    desk.key('j');
    EXPECT_EQ(desk.region("fixed").samples.size(), 73u); // grown, then fixed
    // More samples than are looked at in a frame.
    Desk fine(
        [](const support::Folder& folder)
        {
            return folder.write("fine.obj", support::obj_text(support::box_shape(
                                                {0, 0, 0}, {3, 1, 1}, 110)));
        });
    fine.hand.set_tool(Tool::Box);
    fine.hand.set_selects_through(false);
    fine.press(fine.pixel({-0.2, -0.2, 0.5}));
    fine.move(fine.pixel({3.2, 1.2, 0.5}));
    fine.hand.button(Button::Left, false, {});
    EXPECT_TRUE(fine.hand.is_busy());
    fine.key('h');
    EXPECT_EQ(fine.last_edit(), "Make handle");
    EXPECT_GT(fine.region("handle").samples.size(), 10000u);
    // Another box, too.
    fine.press(fine.pixel({-0.2, -0.2, 0.5}));
    fine.move(fine.pixel({3.2, 1.2, 0.5}));
    fine.hand.button(Button::Left, false, {});
    fine.drag(fine.pixel({-0.2, -0.2, 0.5}), fine.pixel({0.5, 1.2, 0.5}));
    EXPECT_EQ(fine.depth(), 4u);
    EXPECT_LT(fine.document().selection().count(), fine.region("handle").samples.size());
}

TEST(Interaction, tab_goes_from_handle_to_handle)
{
    Desk desk;
    desk.start();
    desk.select(1.4, 1.6);
    desk.key('h');
    EXPECT_EQ(desk.hand.active_region(), "handle2");
    desk.key(Key::Tab);
    EXPECT_EQ(desk.hand.active_region(), "handle");
    desk.key(Key::Tab);
    EXPECT_EQ(desk.hand.active_region(), "handle2");
}

TEST(Interaction, keys_leave_a_region_alone_that_a_number_field_holds)
{
    Desk desk;
    desk.start();
    const std::string name = desk.hand.active_region();
    const std::size_t before = desk.depth();
    ASSERT_TRUE(desk.editing.begin_drag(name));
    EXPECT_TRUE(desk.hand.is_busy());
    desk.editing.drag_to({.translation = {0, 0.5, 0}});
    desk.keys("hjpkgra");
    desk.key(Key::Delete);
    desk.key(Key::Tab);
    desk.key('z', kControl);
    desk.frame();
    EXPECT_EQ(desk.depth(), before);
    EXPECT_EQ(desk.hand.active_region(), name);
    EXPECT_EQ(desk.editing.dragged(), name);
    desk.key(Key::Escape);
    EXPECT_FALSE(desk.editing.dragged());
    EXPECT_FALSE(desk.hand.is_busy());
    EXPECT_EQ(desk.depth(), before);
    EXPECT_EQ(desk.region(name).placement, RigidMove());
}

TEST(Interaction, follows_a_document_that_others_change)
{
    Desk desk;
    desk.start();
    desk.document().rename_region("handle", "head");
    desk.frame();
    EXPECT_EQ(desk.hand.active_region(), "");
    EXPECT_TRUE(desk.hand.gizmo().empty());
    desk.hand.set_active_region("head");
    desk.key('g');
    ASSERT_TRUE(desk.hand.is_busy());
    desk.editing.cancel_drag(); // by somebody else
    desk.frame();
    EXPECT_FALSE(desk.hand.is_busy());
}

} // namespace cellwarp::core
