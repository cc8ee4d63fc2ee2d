// SPDX-License-Identifier: GPL-3.0-or-later
// Flesh in the editor: the film of a scene, and flesh that follows the hand.
#include "editor/window/live_flesh.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <thread>

#include <gtest/gtest.h>

#include "editor/window/film.h"
#include "io/formats/geometry_file.h"
#include "io/scene/scene_file.h"
#include "tests/editor/tools/desk.h"
#include "tests/support/files.h"
#include "tests/support/program.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::Desk;

namespace
{

using Eigen::Vector3d;

/// The bar along x with two bones, whose knee turns by keys.
std::string limb(const support::Folder& folder)
{
    return Desk::limb(folder, R"(,
          "keys": [{"time": 0, "joint": "knee", "rotate": [0, 0, 1, 0]},
                   {"time": 0.2, "joint": "knee", "rotate": [0, 0, 1, 30]}],
          "E": 1e6, "across": 8)",
                      R"(, "simulate": {"duration": 0.2, "gravity": [0, 0, 0]})");
}

void pause()
{
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
}

/// Until the flesh is there and so much of its time has passed.
void wait(const LiveFlesh& live, double until)
{
    while (live.error().empty() && (!live.newest() || live.time() < until))
        pause();
    ASSERT_EQ(live.error(), "");
}

} // namespace

TEST(FleshFilm, has_the_frames_of_simulate_to_the_bit)
{
    Desk desk(limb);
    ASSERT_TRUE(Film::is_in(desk.document()));
    const Film film(desk.editing);
    while (film.is_working())
        pause();
    EXPECT_EQ(film.error(), "");
    ASSERT_EQ(film.num_made(), 7);
    const support::Folder folder;
    ASSERT_EQ(support::run({"simulate", desk.document().scene().path, "-o",
                            folder / "f{frame}.obj"})
                  .code,
              0);
    for (const int frame : {0, 3, 6})
    {
        const Geometry baked =
            read_geometry(folder / "f" + std::to_string(frame) + ".obj").geometry;
        EXPECT_EQ(
            film.shape(frame)->positions,
            shown_at(baked, baked.samples, layout_of(baked), desk.editing.view_frame())
                .positions);
    }
    EXPECT_NE(film.shape(6)->positions, film.shape(0)->positions);
    EXPECT_EQ(film.shape(6)->lines[2].name, "foot");
}

TEST(FleshFilm, has_the_frames_that_are_made_by_hand_where_there_are_no_keys)
{
    Desk desk(
        [](const support::Folder& folder)
        {
            return Desk::limb(folder, R"(, "E": 1e6, "across": 8, "every": 0.1)",
                              R"(, "simulate": {"duration": 0.1, "gravity": [0, 0, 0]})");
        });
    Document& document = desk.document();
    RigidMove to = document.region("knee")->placement;
    to.axis = Vector3d::UnitZ();
    to.degrees = 30.0;
    document.move_region("knee", to);
    EXPECT_EQ(Film::poses_of(document), "the poses of limb.json");
    const Film film(desk.editing);
    while (film.is_working())
        pause();
    EXPECT_EQ(film.error(), "");
    ASSERT_EQ(film.num_made(), 4);
    const std::string saved = desk.folder / "saved.json";
    document.save(saved);
    const support::Folder folder;
    const support::Result simulated =
        support::run({"simulate", saved, "-o", folder / "f{frame}.obj"});
    ASSERT_EQ(simulated.code, 0) << simulated.err;
    const Geometry baked = read_geometry(folder / "f3.obj").geometry;
    EXPECT_EQ(film.shape(3)->positions,
              shown_at(baked, baked.samples, layout_of(baked), desk.editing.view_frame())
                  .positions);
    EXPECT_NE(film.shape(3)->positions, film.shape(0)->positions);
}

TEST(LiveFlesh, is_pulled_at_any_place)
{
    Desk desk(limb);
    LiveFlesh live(desk.editing);
    wait(live, 0.3);
    // The sample that is farthest along x.
    const std::vector<Vector3d>& rest = desk.document().model()->geometry.samples;
    const auto far = static_cast<std::uint32_t>(
        std::max_element(rest.begin(), rest.end(),
                         [](const Vector3d& a, const Vector3d& b)
                         { return a.x() < b.x(); }) -
        rest.begin());
    const auto now = [&]() -> Vector3d
    {
        const std::shared_ptr<const ShownShape> shape = live.newest();
        const float* const x = &shape->positions[3 * far];
        return {x[0], x[1], x[2]};
    };
    const Vector3d before = now();
    const Vector3d goal = before + Vector3d(0, 0, 0.1);
    live.pull(far, goal);
    const double until = live.time() + 0.5;
    wait(live, until);
    EXPECT_LT((now() - goal).norm(), 0.02);
    live.let_go();
    wait(live, live.time() + 1.0);
    EXPECT_LT((now() - before).norm(), 0.06);
}

TEST(LiveFlesh, follows_its_keys_and_then_the_hand)
{
    Desk desk(limb);
    LiveFlesh live(desk.editing);
    wait(live, 0.3);
    const auto foot = [&]
    { return desk.editing.view_frame().to_model(live.newest()->lines[2].points[0]); };
    const Vector3d knee(1.5, 0.5, 0.5);
    const double turn = 30.0 * M_PI / 180.0;
    EXPECT_LT(
        (foot() - (knee + 1.4 * Vector3d(std::cos(turn), std::sin(turn), 0))).norm(),
        1e-9);
    const Vector3d wanted = knee + 1.4 * Vector3d(0, 0.6, 0.8);
    live.pull("foot", desk.editing.view_frame().to_work(wanted));
    wait(live, live.time() + 0.2);
    EXPECT_LT((foot() - wanted).norm(), 1e-9);
    // It stays where it is let go.
    live.let_go();
    wait(live, live.time() + 0.1);
    EXPECT_LT((foot() - wanted).norm(), 1e-9);
    // A root goes to the place itself, with all that hangs on it.
    live.pull("root", desk.editing.view_frame().to_work(Vector3d(0.1, 1.5, 0.5)));
    wait(live, live.time() + 0.2);
    EXPECT_LT((foot() - (wanted + Vector3d(0, 1, 0))).norm(), 1e-9);
}

TEST(LiveFlesh, is_taken_by_its_joints_with_the_pointer)
{
    Desk desk(limb);
    desk.settle();
    LiveFlesh live(desk.editing);
    desk.hand.set_puller(&live);
    wait(live, 0.3);
    desk.editing.show_instead(live.newest());
    const auto foot = [&]
    { return desk.editing.view_frame().to_model(live.newest()->lines[2].points[0]); };
    const Vector3d from = foot();
    const Eigen::Vector2d pixel = desk.pixel(from);
    desk.hand.pointer_moved(pixel, {});
    desk.hand.button(Button::Left, true, {});
    EXPECT_TRUE(contains(desk.hand.status(), "Pull foot"));
    desk.hand.pointer_moved(pixel + Eigen::Vector2d(0, -60), {});
    desk.hand.update();
    wait(live, live.time() + 0.2);
    EXPECT_GT((foot() - from).norm(), 0.05);
    desk.hand.button(Button::Left, false, {});
    EXPECT_EQ(desk.hand.status(), "");
    // Beside the joints it is the flesh that is taken.
    desk.hand.pointer_moved(desk.pixel(Vector3d(0.8, 0.5, 0.5)), {});
    desk.hand.button(Button::Left, true, {});
    EXPECT_TRUE(contains(desk.hand.status(), "Pull the flesh"));
    desk.hand.pointer_moved(desk.pixel(Vector3d(0.8, 0.7, 0.5)), {});
    desk.hand.update();
    desk.hand.button(Button::Left, false, {});
    EXPECT_EQ(desk.hand.status(), "");
    // Beside the shape nothing is taken, and nothing is selected either.
    desk.hand.pointer_moved({3, 3}, {});
    desk.hand.button(Button::Left, true, {});
    EXPECT_EQ(desk.hand.status(), "");
    desk.hand.set_puller(nullptr);
    desk.editing.show_instead(nullptr);
}

TEST(LiveFlesh, and_its_keys_are_kept_by_a_save_or_it_is_refused)
{
    Desk desk(limb);
    Document& document = desk.document();
    const std::string scene = document.scene().path;
    EXPECT_EQ(Film::poses_of(document), "the poses of limb.json");
    std::filesystem::create_directory(desk.folder / "deep");
    const std::string other = desk.folder / "deep/other.json";
    ASSERT_EQ(document.why_not_whole(), "");
    document.save(other);
    const SceneFile saved = read_scene(other), was = read_scene(scene);
    ASSERT_TRUE(saved.has_flesh());
    ASSERT_EQ(saved.skeleton->keys.size(), 2u);
    EXPECT_EQ(saved.skeleton->keys[1].time, was.skeleton->keys[1].time);
    EXPECT_EQ(saved.skeleton->keys[1].move, was.skeleton->keys[1].move);
    EXPECT_EQ(saved.skeleton->flesh.young, 1e6);
    EXPECT_EQ(saved.time.duration, was.time.duration);
    EXPECT_EQ(saved.settings.cells.across, 6); // which was edited
    EXPECT_TRUE(saved.handles.empty());
    // It opens as what was saved, and its own scene is saved in place.
    EXPECT_EQ(handle_text(Document(other, "").handles()),
              handle_text(document.handles()));
    document.save(other);
    // A pose has no time.
    const std::string before = support::bytes_of(other);
    RigidMove to = document.region("knee")->placement;
    to.axis = Vector3d::UnitZ();
    to.degrees = 60.0;
    document.move_region("knee", to);
    EXPECT_TRUE(contains(document.why_not_whole(), "the pose made here has no time"));
    EXPECT_EQ(Film::poses_of(document),
              "the poses of other.json, without the one made here");
    for (const std::string& path : {other, desk.folder / "third.json"})
        EXPECT_TRUE(
            contains(support::error_of(Fault::Usage, [&] { document.save(path); }),
                     "has no time"));
    EXPECT_EQ(support::bytes_of(other), before);
    EXPECT_FALSE(std::filesystem::exists(desk.folder / "third.json"));
    // Alone the poses are saved on request, and never over the scene in time.
    EXPECT_THROW(document.save(other, Overwrite::Yes, SavedPart::Poses), Error);
    document.save(desk.folder / "poses.json", Overwrite::No, SavedPart::Poses);
    EXPECT_FALSE(contains(support::bytes_of(desk.folder / "poses.json"), "simulate"));
    EXPECT_EQ(support::run({"check", desk.folder / "poses.json"}).code, 0);
    EXPECT_EQ(support::bytes_of(other), before);
}

TEST(LiveFlesh, that_cannot_be_says_why)
{
    Desk desk(
        [](const support::Folder& folder)
        {
            Desk::bar(folder);
            return folder.write("s.json", R"({"cellwarp": 1, "model": "bar.obj",
                "skeleton": {"joints": [{"name": "a", "parent": null, "at": [1, 0.5, 0.5]}],
                             "law": "regions"}, "simulate": {}})");
        });
    const LiveFlesh live(desk.editing);
    while (live.error().empty())
        pause();
    EXPECT_TRUE(contains(live.error(), "skeleton.law"));
    EXPECT_EQ(live.newest(), nullptr);
}

} // namespace cellwarp::core
