// SPDX-License-Identifier: GPL-3.0-or-later
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "io/scene/handle_file.h"
#include "tests/editor/tools/desk.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using Eigen::Vector3d;
using support::contains;
using support::Desk;

namespace
{

constexpr Modifiers kShift{.shift = true};

/// Where the handle's motion takes a place of the rest shape.
Vector3d moved(Desk& desk, const Vector3d& rest)
{
    return motion_of(desk.region("handle"))(rest);
}

} // namespace

TEST(InteractionPivot, a_region_turns_about_its_middle_until_it_has_another_pivot)
{
    Desk desk;
    EXPECT_FALSE(desk.hand.pivot());
    desk.start();
    ASSERT_TRUE(desk.hand.pivot());
    EXPECT_EQ(*desk.hand.pivot(), desk.region("handle").centre);
    desk.keys("rz90");
    desk.key(Key::Enter);
    EXPECT_FALSE(desk.region("handle").placement.pivot);
    desk.key('z', {.control = true});

    const Vector3d pivot(2, 0.5, 0.5);
    desk.hand.set_pivot(pivot);
    EXPECT_EQ(*desk.hand.pivot(), pivot);
    desk.keys("rz90");
    desk.key(Key::Enter);
    EXPECT_EQ(desk.region("handle").placement.pivot, pivot);
    EXPECT_LT((moved(desk, pivot) - pivot).norm(), 1e-12);
    EXPECT_LT((moved(desk, {3, 0.5, 0.5}) - Vector3d(2, 1.5, 0.5)).norm(), 1e-12);
    // On, about the same axis through it, and from there about its middle.
    desk.keys("rz90");
    desk.key(Key::Enter);
    EXPECT_EQ(desk.region("handle").placement.degrees, 180);
    EXPECT_LT((moved(desk, {3, 0.5, 0.5}) - Vector3d(1, 0.5, 0.5)).norm(), 1e-12);
    desk.hand.set_pivot(std::nullopt);
    const Vector3d middle = desk.region("handle").centre;
    const Vector3d at = moved(desk, middle);
    desk.keys("ry90");
    desk.key(Key::Enter);
    EXPECT_LT((moved(desk, middle) - at).norm(), 1e-12);
    EXPECT_LT((moved(desk, middle + Vector3d::UnitX()) - at - Vector3d::UnitZ()).norm(),
              1e-12);
}

TEST(InteractionPivot, is_written_into_the_move_as_coordinates)
{
    Desk desk;
    desk.start();
    desk.hand.set_pivot(Vector3d(2, 0.25, 0.5));
    desk.keys("gy0.125"); // the pivot goes along, and a shift alone has none
    desk.key(Key::Enter);
    EXPECT_FALSE(contains(handle_text(desk.document().handles()), "about"));
    EXPECT_LT((desk.hand.seen_pivot()->place -
               desk.editing.view_frame().to_work({2, 0.375, 0.5}))
                  .norm(),
              1e-12);
    desk.keys("rz-45");
    desk.key(Key::Enter);
    const std::string text = handle_text(desk.document().handles());
    EXPECT_TRUE(contains(text, "move handle rotate 0 0 1 -45 about 2 0.25 0.5"
                               " translate 0 0.125 0"))
        << text;
    // A file that says so has that pivot.
    const std::string scene = desk.folder / "s.json";
    desk.document().save(scene);
    const Document again(scene, "");
    EXPECT_EQ(again.region("handle")->placement, desk.region("handle").placement);
}

TEST(InteractionPivot, the_hand_puts_it_elsewhere_and_it_snaps_to_the_border)
{
    Desk desk;
    desk.start();
    desk.settle();
    const EditedRegion& handle = desk.region("handle");
    ASSERT_TRUE(handle.border);
    const Vector3d border = *handle.border;
    EXPECT_LT(border.x(), 3.0);
    EXPECT_GT(border.x(), 2.4);
    const std::size_t depth = desk.depth();
    EXPECT_TRUE(desk.hand.seen_pivot()->marks.empty());

    desk.move(desk.pixel(handle.centre));
    desk.key('v');
    EXPECT_TRUE(desk.hand.is_busy());
    EXPECT_TRUE(desk.hand.gizmo().empty());
    ASSERT_EQ(desk.hand.seen_pivot()->marks.size(), 2u);
    EXPECT_EQ(desk.hand.status(), "Pivot: middle (Enter or click: done, Esc: back)");
    desk.move(desk.pixel(border) + Eigen::Vector2d(5, -4));
    desk.frame();
    EXPECT_EQ(desk.hand.status(), "Pivot: border (Enter or click: done, Esc: back)");
    desk.click(desk.pixel(border) + Eigen::Vector2d(5, -4));
    EXPECT_FALSE(desk.hand.is_busy());
    EXPECT_EQ(*desk.hand.pivot(), border); // to the bit

    desk.key('v');
    desk.keys("x-0.5"); // numbers do not snap
    EXPECT_TRUE(contains(desk.hand.status(), "Pivot at ")) << desk.hand.status();
    desk.key(Key::Enter);
    EXPECT_LT((*desk.hand.pivot() - border + Vector3d(0.5, 0, 0)).norm(), 1e-12);
    desk.key('v', kShift);
    EXPECT_EQ(*desk.hand.pivot(), border);
    for (const bool is_by_key : {true, false})
    {
        desk.key('v');
        desk.move({40, 40});
        desk.frame();
        if (is_by_key)
            desk.key(Key::Escape);
        else
            desk.press({40, 40}, {}, Button::Right);
        EXPECT_FALSE(desk.hand.is_busy());
        EXPECT_EQ(*desk.hand.pivot(), border);
        desk.release({}, Button::Right);
    }
    EXPECT_EQ(desk.depth(), depth); // nothing was edited
}

TEST(InteractionPivot, goes_with_its_region_and_its_gizmo_stands_there)
{
    Desk desk;
    desk.start();
    desk.hand.set_pivot(Vector3d(2, 0.5, 0.5));
    desk.keys("rz90");
    desk.key(Key::Enter);
    desk.keys("gx1");
    desk.key(Key::Enter);
    desk.frame();
    const Vector3d place = desk.editing.view_frame().to_work({3, 0.5, 0.5});
    EXPECT_LT((desk.hand.seen_pivot()->place - place).norm(), 1e-12);
    desk.hand.set_tool(Tool::Rotate);
    const GizmoPart ring = *desk.part(GizmoPart::Kind::Ring, 2);
    Vector3d middle = Vector3d::Zero();
    for (const Vector3d& x : ring.line)
        middle += x / static_cast<double>(ring.line.size());
    EXPECT_LT((middle - place).norm(), 0.05);
}

TEST(InteractionPivot, what_has_none_says_so)
{
    Desk desk;
    desk.key('v');
    EXPECT_TRUE(contains(desk.hand.complaint(), "no region is active"));
    desk.select(2.9, 3.1);
    desk.key('p');
    desk.key('v');
    EXPECT_TRUE(contains(desk.hand.complaint(), "has no pivot")) << desk.hand.complaint();
    EXPECT_FALSE(desk.hand.is_busy());
    EXPECT_FALSE(desk.hand.seen_pivot());
    desk.key('z', {.control = true});
    desk.key('h');
    desk.key('v', kShift); // no cells have been made of it yet
    EXPECT_TRUE(contains(desk.hand.complaint(), "is known when its cells are there"));
    const Vector3d before = *desk.hand.pivot();
    desk.hand.set_pivot(Vector3d(std::numeric_limits<double>::quiet_NaN(), 0, 0));
    EXPECT_EQ(*desk.hand.pivot(), before);
}

TEST(InteractionPivot, is_of_these_samples_whatever_they_are_called)
{
    Desk desk;
    desk.start();
    const Vector3d pivot(2, 0.5, 0.5);
    desk.hand.set_pivot(pivot);
    desk.document().rename_region("handle", "tip");
    desk.hand.set_active_region("tip");
    EXPECT_EQ(*desk.hand.pivot(), pivot);
    desk.key(Key::Delete);
    desk.select(1.4, 1.6);
    desk.document().add_region(Role::Handle, "tip");
    desk.hand.set_active_region("tip");
    EXPECT_EQ(*desk.hand.pivot(), desk.region("tip").centre);
}

TEST(InteractionPivot, one_in_the_hand_is_dropped_with_its_region)
{
    Desk desk;
    desk.start();
    desk.key('v');
    EXPECT_TRUE(desk.hand.is_busy());
    desk.document().remove_region("handle");
    desk.move({100, 100}); // before the next frame
    desk.key('x');
    desk.key(Key::Enter);
    desk.frame();
    EXPECT_FALSE(desk.hand.is_busy());
    EXPECT_FALSE(desk.hand.pivot());
}

TEST(InteractionPivot, along_an_axis_it_snaps_to_nothing)
{
    Desk desk;
    desk.start();
    desk.settle();
    desk.key('v');
    desk.key('y');
    desk.move(desk.pixel(*desk.region("handle").border));
    desk.frame();
    EXPECT_TRUE(contains(desk.hand.status(), "Pivot at ")) << desk.hand.status();
    desk.key(Key::Escape);
}

TEST(InteractionPivot, one_of_an_earlier_stage_is_forgotten)
{
    Desk desk;
    desk.start();
    desk.hand.set_pivot(Vector3d(2, 0.5, 0.5));
    desk.keys("gx1");
    desk.key(Key::Enter);
    desk.settle();
    desk.select(1.4, 1.6);
    desk.key('j'); // what is bent is the rest shape now
    desk.settle();
    desk.hand.set_active_region("handle");
    EXPECT_LT((*desk.hand.pivot() - desk.region("handle").centre).norm(), 1e-12);
}

} // namespace cellwarp::core
