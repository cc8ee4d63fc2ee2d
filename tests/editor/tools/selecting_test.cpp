// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/tools/selecting.h"

#include <cmath>
#include <limits>
#include <random>

#include <Eigen/LU>
#include <gtest/gtest.h>

#include "editor/tools/gizmo.h"
#include "tests/editor/tools/shown.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

using support::box_shape;
using support::layout_of;
using support::shown;

namespace
{

using Kind = SelectGesture::Kind;

/// What a gesture holds, looked at in small parts.
Selection chosen(SelectGesture& gesture, const ShownShape& shape, const Picker& picker)
{
    gesture.collect(shape);
    while (!gesture.look(picker, 37))
        ;
    return gesture.chosen();
}

struct Scene
{
    Shape shape = box_shape({-0.4, -0.4, -0.4}, {0.4, 0.4, 0.4}, 8);
    ShownShape seen = shown(shape, layout_of(shape), 1);
    Camera camera;
    Picker picker;

    Scene()
    {
        camera.resize(800, 600);
        camera.look_from(Camera::View::Front);
        picker.update(seen);
    }
    Eigen::Vector2d pixel(std::size_t sample) const
    {
        return camera.project(shape.samples[sample])->head<2>();
    }
    Selection choose(const SelectGesture::Options& options,
                     const std::vector<Eigen::Vector2d>& path)
    {
        SelectGesture gesture(options, camera, seen, path.front());
        for (std::size_t i = 1; i < path.size(); ++i)
            gesture.move_to(path[i]);
        return chosen(gesture, seen, picker);
    }
    /// Compares with a test of each sample's pixel.
    template <class IsIn>
    void expect(const Selection& selection, IsIn&& is_in)
    {
        std::size_t count = 0;
        for (std::size_t i = 0; i < shape.samples.size(); ++i)
        {
            SCOPED_TRACE(shape.samples[i].transpose());
            EXPECT_EQ(selection.holds(i), is_in(i));
            count += is_in(i);
        }
        EXPECT_GT(count, 0u);
        EXPECT_LT(count, shape.samples.size());
    }
};

} // namespace

TEST(SelectGesture, a_box_holds_what_lies_in_it_from_whichever_corner_it_was_drawn)
{
    Scene scene;
    const auto in_box = [&](std::size_t i)
    {
        const Eigen::Vector2d x = scene.pixel(i);
        return x.x() >= 210 && x.x() <= 411 && x.y() >= 120 && x.y() <= 333;
    };
    const SelectGesture::Options through{Kind::Box, true};
    scene.expect(scene.choose(through, {{210, 120}, {411, 333}}), in_box);
    scene.expect(scene.choose(through, {{210, 333}, {700, 500}, {411, 120}}), in_box);
    scene.camera.toggle_perspective();
    scene.expect(scene.choose(through, {{411, 120}, {210, 333}}), in_box);
}

TEST(SelectGesture, takes_only_what_is_seen_unless_it_goes_through)
{
    Scene scene;
    const std::vector<Eigen::Vector2d> all = {{0, 0}, {800, 600}};
    EXPECT_EQ(scene.choose({Kind::Box, true}, all).count(), scene.shape.samples.size());
    // From the front a box in perspective shows its front alone.
    scene.expect(scene.choose({Kind::Box, false}, all),
                 [&](std::size_t i) { return scene.shape.samples[i].z() > 0.39; });
}

TEST(SelectGesture, a_lasso_holds_what_it_goes_round_an_odd_number_of_times)
{
    Scene scene;
    std::mt19937 rng(21);
    for (int round = 0; round < 10; ++round)
    {
        SCOPED_TRACE(round);
        std::vector<Eigen::Vector2d> path; // crosses itself, and leaves the view
        for (int i = 0; i < 9; ++i)
            path.emplace_back(support::random_number(rng, -100, 900),
                              support::random_number(rng, -200, 800));
        const Selection selection = scene.choose({Kind::Lasso, true}, path);
        for (std::size_t i = 0; i < scene.shape.samples.size(); ++i)
            EXPECT_EQ(selection.holds(i), is_inside(path, scene.pixel(i)));
    }
}

TEST(SelectGesture, a_brush_paints_everything_within_its_radius_of_its_way)
{
    Scene scene;
    const Eigen::Vector2d a(250, 150), b(500, 200), c(510, 420);
    const auto in_reach = [&](std::size_t i)
    {
        const auto near = [&](const Eigen::Vector2d& from, const Eigen::Vector2d& to)
        {
            const Eigen::Vector2d x = scene.pixel(i), way = to - from;
            const double t = std::clamp(way.dot(x - from) / way.squaredNorm(), 0.0, 1.0);
            return (from + t * way - x).norm() <= 33;
        };
        return near(a, b) || near(b, c);
    };
    scene.expect(scene.choose({Kind::Brush, true, 33}, {a, b, c}), in_reach);
    // The same, asked on the way; hidden samples are left out.
    SelectGesture gesture({Kind::Brush, false, 33}, scene.camera, scene.seen, a);
    std::size_t last = 0;
    for (const Eigen::Vector2d& to : {b, b, c})
    {
        gesture.move_to(to);
        const std::size_t count = chosen(gesture, scene.seen, scene.picker).count();
        EXPECT_GE(count, last);
        last = count;
    }
    scene.expect(chosen(gesture, scene.seen, scene.picker), [&](std::size_t i)
                 { return in_reach(i) && scene.shape.samples[i].z() > 0.39; });
}

TEST(SelectGesture, a_brush_that_is_only_pressed_paints_a_dot)
{
    Scene scene;
    scene.expect(scene.choose({Kind::Brush, true, 40}, {{380, 280}}), [&](std::size_t i)
                 { return (scene.pixel(i) - Eigen::Vector2d(380, 280)).norm() <= 40; });
}

TEST(SelectGesture, what_is_outside_the_view_or_behind_the_eye_cannot_be_chosen)
{
    Scene scene;
    scene.camera.zoom(20, {300, 200}, Eigen::Vector3d(0.05, 0.02, 0.4));
    scene.camera.pan({40, 0});
    const Selection selection =
        scene.choose({Kind::Box, true}, {{-1e5, -1e5}, {1e5, 1e5}});
    scene.expect(selection,
                 [&](std::size_t i)
                 {
                     const auto x = scene.camera.project(scene.shape.samples[i]);
                     return x && x->x() >= 0 && x->x() <= 800 && x->y() >= 0 &&
                            x->y() <= 600;
                 });
}

TEST(SelectGesture, outlines_are_what_is_drawn)
{
    Scene scene;
    SelectGesture box({Kind::Box}, scene.camera, scene.seen, {10, 20});
    box.move_to({30, 50});
    EXPECT_EQ(box.outline(),
              (std::vector<Eigen::Vector2d>{{10, 20}, {30, 20}, {30, 50}, {10, 50}}));
    SelectGesture brush({Kind::Brush, true, 7}, scene.camera, scene.seen, {10, 20});
    for (const Eigen::Vector2d& x : brush.outline())
        EXPECT_NEAR((x - Eigen::Vector2d(10, 20)).norm(), 7, 1e-9);
}

TEST(SelectGesture, numbers_that_are_none_and_a_view_of_no_size_choose_nothing)
{
    Scene scene;
    const double nan = std::numeric_limits<double>::quiet_NaN();
    SelectGesture gesture({Kind::Box, true}, scene.camera, scene.seen, {0, 0});
    gesture.move_to({nan, 5});
    EXPECT_EQ(gesture.outline().size(), 4u);
    EXPECT_TRUE(chosen(gesture, scene.seen, scene.picker).empty());
    EXPECT_TRUE(chosen(gesture, ShownShape{}, scene.picker).empty());
    scene.camera.resize(0, 0);
    for (const Kind kind : {Kind::Box, Kind::Lasso, Kind::Brush})
        EXPECT_TRUE(scene.choose({kind, true}, {{-9, -9}, {9, -9}, {9, 9}}).empty());
}

} // namespace cellwarp::core
