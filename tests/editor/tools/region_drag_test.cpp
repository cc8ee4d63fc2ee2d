// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/tools/region_drag.h"

#include <gtest/gtest.h>

namespace cellwarp::core
{

namespace
{

using Kind = DragWay::Kind;

/// A model whose unit is a quarter of the view's, seen from the front.
struct Scene
{
    EditedRegion region;
    Camera camera;
    DragSpace space{.view_per_model = 0.25, .snap = 0.2};
    Eigen::Vector3d centre{0.1, 0.05, 0.2};

    Scene()
    {
        region.name = "head";
        region.role = Role::Handle;
        camera.resize(800, 600);
        camera.look_from(Camera::View::Front);
    }
    Eigen::Vector2d pixel(const Eigen::Vector3d& x) const
    {
        return camera.project(x)->head<2>();
    }
    RegionDrag drag(Kind kind, int axis = 0) const
    {
        return {region, region.placement, space,        camera, centre,
                {},     {kind, axis},     pixel(centre)};
    }
};

void type(RegionDrag& drag, const std::string& keys)
{
    for (const char key : keys)
        EXPECT_TRUE(drag.key({Key::Character, key, false, {}})) << key;
}

} // namespace

TEST(RegionDrag, steps_are_round_numbers_of_at_most_a_twentieth_of_the_model)
{
    EXPECT_DOUBLE_EQ(snap_step(1.0), 0.05);
    EXPECT_DOUBLE_EQ(snap_step(0.9), 0.02);
    EXPECT_DOUBLE_EQ(snap_step(100.0), 5.0);
    EXPECT_DOUBLE_EQ(snap_step(399.0), 10.0);
    EXPECT_DOUBLE_EQ(snap_step(0.0039), 0.0001);
    EXPECT_EQ(snap_step(0.0), 0.0);
}

TEST(RegionDrag, gives_places_in_units_of_the_model_and_says_them)
{
    const Scene scene;
    RegionDrag drag = scene.drag(Kind::MoveAxis, 0);
    drag.move_to(scene.pixel(scene.centre + Eigen::Vector3d(0.11, 0, 0)), false);
    EXPECT_LT((drag.placement().translation - Eigen::Vector3d(0.44, 0, 0)).norm(), 1e-9);
    EXPECT_EQ(drag.status(), "Move X 0.44");
    EXPECT_LT((drag.centre() - scene.centre - Eigen::Vector3d(0.11, 0, 0)).norm(), 1e-9);
    drag.move_to(scene.pixel(scene.centre + Eigen::Vector3d(0.11, 0, 0)), true);
    EXPECT_EQ(drag.status(), "Move X 0.4"); // in steps
}

TEST(RegionDrag, goes_on_from_where_the_region_is)
{
    Scene scene;
    scene.region.placement.translation = {1, 2, 3};
    scene.region.placement.axis = Eigen::Vector3d::UnitZ();
    scene.region.placement.degrees = 350;
    RegionDrag drag = scene.drag(Kind::TurnAxis, 2);
    type(drag, "20");
    EXPECT_EQ(drag.placement().translation, Eigen::Vector3d(1, 2, 3));
    EXPECT_EQ(drag.placement().degrees, 370);
    EXPECT_EQ(drag.status(), "Turn Z [20]");
    EXPECT_EQ(drag.centre(), scene.centre);
}

TEST(RegionDrag, axis_keys_bind_it_and_the_same_again_frees_it)
{
    Scene scene;
    scene.camera.toggle_perspective();
    RegionDrag drag = scene.drag(Kind::MoveScreen);
    drag.move_to(scene.pixel(scene.centre + Eigen::Vector3d(0.1, 0.05, 0)), false);
    EXPECT_EQ(drag.status(), "Move 0.4, 0.2, 0");
    type(drag, "y");
    EXPECT_EQ(drag.way(), (DragWay{Kind::MoveAxis, 1}));
    EXPECT_EQ(drag.status(), "Move Y 0.2");
    EXPECT_TRUE(drag.key({Key::Character, 'z', false, {.shift = true}}));
    EXPECT_EQ(drag.status(), "Move XY 0.4, 0.2");
    type(drag, "xx");
    EXPECT_EQ(drag.way().kind, Kind::MoveScreen);
    EXPECT_LT((drag.placement().translation - Eigen::Vector3d(0.4, 0.2, 0)).norm(), 1e-9);
    type(drag, "r"); // turned instead, and freely, and about an axis
    EXPECT_EQ(drag.way().kind, Kind::TurnView);
    EXPECT_EQ(drag.placement().translation, Eigen::Vector3d(0, 0, 0));
    type(drag, "r");
    EXPECT_EQ(drag.way().kind, Kind::TurnFree);
    type(drag, "z");
    EXPECT_EQ(drag.way(), (DragWay{Kind::TurnAxis, 2}));
    type(drag, "z");
    EXPECT_EQ(drag.way().kind, Kind::TurnView);
    type(drag, "g");
    EXPECT_EQ(drag.way().kind, Kind::MoveScreen);
}

TEST(RegionDrag, a_typed_number_counts_until_it_is_taken_back)
{
    const Scene scene;
    RegionDrag drag = scene.drag(Kind::MoveScreen);
    drag.move_to(scene.pixel(scene.centre + Eigen::Vector3d(0.1, 0, 0)), false);
    type(drag, "x0.3-");
    EXPECT_EQ(drag.status(), "Move X [-0.3]");
    EXPECT_LT((drag.placement().translation - Eigen::Vector3d(-0.3, 0, 0)).norm(), 1e-12);
    for (int i = 0; i < 4; ++i)
        EXPECT_TRUE(drag.key({Key::Backspace, 0, false, {}}));
    EXPECT_EQ(drag.status(), "Move X 0.4");
}

TEST(RegionDrag, of_a_pin_never_turns_and_takes_no_other_keys)
{
    Scene scene;
    scene.region.role = Role::Pin;
    RegionDrag drag = scene.drag(Kind::MoveScreen);
    EXPECT_FALSE(drag.key({Key::Character, 'r', false, {}}));
    EXPECT_EQ(drag.way().kind, Kind::MoveScreen);
    EXPECT_FALSE(drag.key({Key::Character, 'q', false, {}}));
    EXPECT_FALSE(drag.key({Key::Tab, 0, false, {}}));
}

} // namespace cellwarp::core
