// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/document/editing.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <new>
#include <thread>

#include <gtest/gtest.h>

#include "io/formats/geometry_file.h"
#include "library/session/deformation.h"
#include "library/session/scene_settings.h"
#include "octree/base/index.h"
#include "tests/support/allocations.h"
#include "tests/support/files.h"
#include "tests/support/shapes.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::error_of;

namespace
{

/// A bar of 1 x 1 x 4 in a folder of its own.
struct Bar
{
    support::Folder folder;
    std::string model;

    explicit Bar(int n = 8) : model(folder / "bar.obj")
    {
        write_file(model, support::obj_text(support::box_shape({0, 0, 0}, {1, 1, 4}, n)),
                   Overwrite::No);
    }
    /// In few cells of two sizes.
    Document document() const
    {
        Document document(model, "");
        SceneSettings settings;
        settings.cells.across = 8;
        settings.cells.max_depth = 1;
        document.change_settings(settings);
        return document;
    }
};

Selection samples_where(const Document& document, bool (*holds)(const Eigen::Vector3d&))
{
    const std::vector<Eigen::Vector3d>& samples = document.model()->geometry.samples;
    Selection selection(samples.size());
    for (std::size_t i = 0; i < samples.size(); ++i)
        if (holds(samples[i]))
            selection.add(i);
    return selection;
}

bool is_foot(const Eigen::Vector3d& x)
{
    return x.z() < 0.6;
}
bool is_head(const Eigen::Vector3d& x)
{
    return x.z() > 3.4;
}
bool is_top(const Eigen::Vector3d& x)
{
    return x.z() == 4.0 && x.x() == 0.5 && x.y() == 0.5;
}
bool is_middle(const Eigen::Vector3d& x)
{
    return x.z() > 1.7 && x.z() < 2.3;
}

void hold_ends(Document& document)
{
    document.select(samples_where(document, is_foot), "Select by box");
    document.add_region(Role::Fixed, "foot");
    document.select(samples_where(document, is_head), "Select by box");
    document.add_region(Role::Handle, "head");
}

RigidMove turned(double degrees, const Eigen::Vector3d& shift)
{
    RigidMove placement;
    placement.axis = Eigen::Vector3d::UnitY();
    placement.degrees = degrees;
    placement.translation = shift;
    return placement;
}

/// More frames than can be solved before they are given up.
constexpr std::size_t kOften = 40;

void turn_often(Document& document)
{
    for (std::size_t k = 1; k <= kOften; ++k)
    {
        const double way = static_cast<double>(k);
        document.move_region("head", turned(2.0 * way, {0.02 * way, 0, 0}));
    }
}

/// Drags in a few moves, as a hand would.
void drag(Editing& editing, const std::string& region, const RigidMove& to)
{
    const RigidMove from = editing.document().region(region)->placement;
    std::string why;
    ASSERT_TRUE(editing.begin_drag(region, &why)) << why;
    for (int k = 1; k <= 5; ++k)
    {
        RigidMove on_the_way = to;
        on_the_way.translation =
            from.translation + 0.2 * k * (to.translation - from.translation);
        on_the_way.degrees = from.degrees + 0.2 * k * (to.degrees - from.degrees);
        editing.drag_to(k == 5 ? to : on_the_way);
        editing.update();
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    editing.end_drag();
}

/// A commit, and a frame after it; solved.
void bend_twice(Editing& editing)
{
    Document& document = editing.document();
    document.select(samples_where(document, is_middle), "Select by box");
    document.add_region(Role::Handle, "belly");
    document.move_region("belly", turned(0, {0, 0.3, 0}));
    editing.wait();
    ASSERT_NE(editing.result(), nullptr) << editing.status().error;
}

/// What the saved scene replays to.
std::vector<Eigen::Vector3d> replayed(const std::string& scene_path)
{
    const SceneFile scene = read_scene(scene_path);
    Session session(read_geometry(scene.model).geometry, read_handles(scene.handles),
                    settings_of(scene));
    while (session.next_frame(true))
        ;
    return session.deformed().samples;
}

} // namespace

TEST(Editing, what_was_dragged_is_what_the_saved_scene_replays_to)
{
    const Bar bar;
    Editing editing(bar.document());
    hold_ends(editing.document());
    editing.wait();
    drag(editing, "head", turned(0, {0.4, 0, 0.1}));
    editing.wait();
    drag(editing, "head", turned(50, {0.8, 0, -0.3}));
    drag(editing, "head", turned(250, {0.8, 0, -0.3})); // before the last one is solved
    editing.wait();
    ASSERT_NE(editing.result(), nullptr) << editing.status().error;
    editing.document().save(bar.folder / "scene.json");
    EXPECT_TRUE(replayed(bar.folder / "scene.json") == editing.result()->samples);
    EXPECT_EQ(editing.status().state, SolveStatus::State::Idle);
    EXPECT_FALSE(editing.status().energy_curve.empty());
}

TEST(Editing, other_regions_after_a_bend_begin_a_new_stage_with_the_same_result)
{
    const Bar bar;
    Editing editing(bar.document());
    Document& document = editing.document();
    hold_ends(document);
    drag(editing, "head", turned(0, {0.5, 0, 0}));
    editing.wait();
    const std::vector<Eigen::Vector3d> bent = editing.result()->samples;
    document.select(samples_where(document, is_middle), "Select by box");
    document.add_region(Role::Handle, "belly");
    EXPECT_EQ(document.handles().stages.size(), 2u);
    editing.wait();
    ASSERT_NE(editing.result(), nullptr) << editing.status().error;
    EXPECT_TRUE(editing.result()->samples == bent);
    // Its centre is that of the bent shape.
    EXPECT_GT(document.region("belly")->centre.x(), 0.55);
    drag(editing, "belly", turned(0, {0, 0.4, 0}));
    editing.wait();
    document.save(bar.folder / "scene.json");
    EXPECT_TRUE(replayed(bar.folder / "scene.json") == editing.result()->samples);
    for (int k = 0; k < 2; ++k)
        document.undo();
    editing.wait();
    EXPECT_EQ(document.handles().stages.size(), 1u);
    EXPECT_TRUE(editing.result()->samples == bent);
}

TEST(Editing, undo_takes_the_shape_back_and_redo_does_it_again_to_the_bit)
{
    const Bar bar;
    Editing editing(bar.document());
    hold_ends(editing.document());
    std::vector<std::vector<Eigen::Vector3d>> results;
    for (int k = 0; k < 4; ++k)
    {
        drag(editing, "head", turned(20.0 * k, {0.2 * k + 0.1, 0, 0}));
        editing.wait();
        results.push_back(editing.result()->samples);
    }
    for (int k = 2; k >= 0; --k)
    {
        editing.document().undo();
        editing.wait();
        EXPECT_TRUE(editing.result()->samples == results[idx(k)]);
    }
    while (editing.document().can_undo())
        editing.document().undo();
    editing.wait();
    EXPECT_TRUE(editing.result()->samples ==
                editing.document().model()->geometry.samples);
    while (editing.document().can_redo())
        editing.document().redo();
    editing.wait();
    EXPECT_TRUE(editing.result()->samples == results.back());
}

TEST(Editing, a_drag_that_is_taken_back_leaves_no_edit_and_the_shape_as_it_was)
{
    const Bar bar;
    Editing editing(bar.document());
    hold_ends(editing.document());
    editing.wait();
    const std::vector<float> before = editing.shape().positions;
    const std::size_t edits = editing.document().history().size();
    EXPECT_FALSE(editing.dragged_placement());
    ASSERT_TRUE(editing.begin_drag("head"));
    editing.drag_to(turned(0, {1, 0, 0}));
    EXPECT_EQ(editing.dragged_placement(), turned(0, {1, 0, 0}));
    EXPECT_EQ(editing.document().region("head")->placement, RigidMove());
    for (int k = 0; k < 2000 && editing.shape().positions == before; ++k)
    {
        editing.update();
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    EXPECT_NE(editing.shape().positions, before);
    EXPECT_GT(editing.drag_status().frames, 0u);
    editing.cancel_drag();
    EXPECT_FALSE(editing.dragged_placement());
    EXPECT_EQ(editing.shape().positions, before);
    EXPECT_EQ(editing.document().history().size(), edits);
    editing.wait();
    ASSERT_TRUE(editing.begin_drag("head"));
    editing.end_drag();
    EXPECT_EQ(editing.document().history().size(), edits);
}

TEST(Editing, the_hand_sees_what_the_release_gives)
{
    const Bar bar;
    Editing editing(bar.document());
    hold_ends(editing.document());
    editing.wait();
    ASSERT_TRUE(editing.begin_drag("head"));
    editing.drag_to(turned(30, {0.5, 0, 0}));
    // Until no more frames come, however slow the machine is.
    std::uint64_t frames = 0;
    for (int k = 0, quiet = 0; k < 30000 && (frames <= 1 || quiet < 250); ++k, ++quiet)
    {
        editing.update();
        const std::uint64_t now = editing.drag_status().frames;
        if (now != frames)
            quiet = 0;
        frames = now;
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    EXPECT_GT(frames, 1u);
    const ShownShape seen = editing.shape();
    editing.end_drag();
    editing.wait();
    const std::vector<Eigen::Vector3d>& exact = editing.result()->samples;
    double largest = 0.0;
    for (std::size_t place = 0; place < exact.size(); ++place)
    {
        const Eigen::Vector3f p(seen.positions[3 * place], seen.positions[3 * place + 1],
                                seen.positions[3 * place + 2]);
        const Eigen::Vector3d in_view =
            (seen.to_view * p.cast<double>().homogeneous()).head<3>();
        largest = std::max(largest, (editing.view_frame().to_model(in_view) -
                                     exact[seen.layout->order[place]])
                                        .norm());
    }
    EXPECT_LT(largest, 0.02 * std::sqrt(18.0));
}

TEST(Editing, what_cannot_move_is_told)
{
    const Bar bar;
    Editing editing(bar.document());
    Document& document = editing.document();
    hold_ends(document);
    editing.wait();
    std::string why;
    EXPECT_FALSE(editing.begin_drag("foot", &why));
    EXPECT_TRUE(contains(why, "only handles and pins move")) << why;
    EXPECT_FALSE(editing.begin_drag("nobody", &why));
    EXPECT_TRUE(contains(why, "no region")) << why;
    EXPECT_TRUE(
        contains(error_of(Fault::Usage, [&]
                          { editing.export_field(bar.folder / "f.cwf", Overwrite::No); }),
                 "nothing has moved"));
    ASSERT_TRUE(editing.begin_drag("head"));
    editing.drag_to(turned(NAN, {0, 0, 0}));
    editing.drag_to(turned(0, {INFINITY, 0, 0}));
    editing.end_drag();
    EXPECT_TRUE(document.handles().stages[0].frames.empty());
}

TEST(Editing, a_region_that_fails_is_named_and_what_was_before_it_comes_back)
{
    const Bar bar;
    Editing editing(bar.document());
    Document& document = editing.document();
    SceneSettings uniform = document.settings();
    uniform.cells.max_depth = 0;
    document.change_settings(uniform);
    hold_ends(document);
    editing.wait();
    ASSERT_NE(editing.result(), nullptr) << editing.status().error;
    // The head holds all cells that the crown reaches.
    document.select(samples_where(document, is_top), "Select by box");
    document.add_region(Role::Pin, "crown");
    editing.wait();
    EXPECT_EQ(editing.result(), nullptr);
    const SolveStatus status = editing.status();
    EXPECT_EQ(status.state, SolveStatus::State::Failed);
    EXPECT_TRUE(contains(status.error, "no cell of its own")) << status.error;
    EXPECT_EQ(status.error_region, "crown");
    std::string why;
    EXPECT_FALSE(editing.begin_drag("head", &why));
    EXPECT_EQ(why, status.error);
    document.undo();
    editing.wait();
    ASSERT_NE(editing.result(), nullptr) << editing.status().error;
    EXPECT_TRUE(editing.status().error_region.empty());
}

TEST(Editing, regions_turn_about_the_same_centre_in_the_hand_and_on_release)
{
    // In turned cells; one region whose box depends on the axes, and one without samples.
    const Bar bar;
    std::string corner;
    const std::vector<Eigen::Vector3d> samples =
        read_geometry(bar.model).geometry.samples;
    for (std::size_t i = 0; i < samples.size(); ++i)
        if (samples[i].z() > 3.4 && (samples[i].z() == 4.0 || samples[i].x() == 0.0))
            corner += " " + std::to_string(i);
    bar.folder.write("s.handles", "cellwarp-handles 1\n"
                                  "fixed foot box -1 -1 -1 2 2 0.6\n"
                                  "handle head indices" +
                                      corner +
                                      "\nhandle core box 0.2 0.3 1.4 0.6 0.8 2\n"
                                      "frame 1\nmove head rotate 0 1 0 20\n"
                                      "move core rotate 1 0 0 10\n");
    const std::string scene = bar.folder.write(
        "s.json", R"({"cellwarp": 1, "model": "bar.obj", "handles": "s.handles",
  "cells": {"across": 10, "frame": {"origin": [1, -2, -1], "size": [3, 4, 6],
  "axes": [[0.8, 0.6, 0], [-0.6, 0.8, 0], [0, 0, 1]]}}})");
    const Document document(scene, "");
    ASSERT_TRUE(document.region("core")->samples.empty());
    Session session(geometry_of(document.model()), document.handles(),
                    settings_of(document.scene()));
    session.next_frame(false);
    for (std::size_t r = 0; r < document.regions().size(); ++r)
    {
        const EditedRegion& region = document.regions()[r];
        SCOPED_TRACE(region.name);
        const Motion hand =
            motion_of(region.placement, region.centre, session.system()->rest().frame);
        const Motion& released = session.system()->motions()[r];
        EXPECT_LT((hand.R - released.R).norm(), 1e-14);
        EXPECT_LT((hand.t - released.t).norm(), 1e-14);
    }
    EXPECT_EQ(document.region("head")->centre, Eigen::Vector3d(0.5, 0.5, 3.75));
    EXPECT_EQ(document.region("core")->centre, Eigen::Vector3d(0.4, 0.55, 1.7));
}

TEST(Editing, a_region_turned_about_its_border_is_taken_on_from_there)
{
    const Bar bar;
    const std::string turn = "move head rotate 0 1 0 30 about border\n";
    const auto opened = [&](const std::string& frames)
    {
        bar.folder.write("s.handles", "cellwarp-handles 1\n"
                                      "fixed foot box -1 -1 -1 2 2 0.6\n"
                                      "handle head box -1 -1 3.4 2 2 5\n" +
                                          frames);
        return Document(bar.folder.write("s.json", R"({"cellwarp": 1, "model": "bar.obj",
                                           "handles": "s.handles", "cells": {"across": 8}})"),
                        "");
    };
    Editing editing(opened("frame 1\n" + turn));
    editing.wait();
    const EditedRegion head = *editing.document().region("head");
    ASSERT_TRUE(head.border);
    EXPECT_LE(head.border->z(), 3.5);
    EXPECT_GT(head.border->z(), 2.9);
    EXPECT_EQ(head.placement.pivot, head.border);
    RigidMove to = head.placement;
    to.degrees = 45;
    drag(editing, "head", to);
    editing.wait();
    // As a file that says so from the beginning.
    Editing told(
        opened("frame 1\n" + turn + "frame 2\nmove head rotate 0 1 0 45 about border\n"));
    told.wait();
    ASSERT_TRUE(editing.result() && told.result());
    const std::vector<Eigen::Vector3d>& a = editing.result()->samples;
    const std::vector<Eigen::Vector3d>& b = told.result()->samples;
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t i = 0; i < a.size(); ++i)
        EXPECT_LT((a[i] - b[i]).norm(), 1e-9);
}

TEST(Editing, a_region_on_a_shape_that_is_not_there_yet_is_not_taken_into_the_hand)
{
    const Bar bar;
    bar.folder.write("s.handles", "cellwarp-handles 1\n"
                                  "fixed foot box -1 -1 -1 2 2 0.6\n"
                                  "handle head box -1 -1 3.4 2 2 5\nframe 1\n"
                                  "move head translate 0.5 0 2\ncommit\n"
                                  "fixed foot box -1 -1 -1 2 2 0.6\n"
                                  "handle top box -1 -1 5.4 2 2 9\n");
    const std::string scene = bar.folder.write(
        "s.json", R"({"cellwarp": 1, "model": "bar.obj", "handles": "s.handles",
                      "cells": {"across": 8}})");
    Editing editing(Document(scene, ""));
    EXPECT_TRUE(editing.document().region("top")->samples.empty());
    std::string why;
    if (!editing.begin_drag("top", &why)) // else it was there at once
    {
        EXPECT_TRUE(contains(why, "not there yet")) << why;
        editing.wait();
        ASSERT_TRUE(editing.begin_drag("top", &why)) << why;
    }
    EXPECT_FALSE(editing.document().region("top")->samples.empty());
    editing.cancel_drag();
}

TEST(Editing, an_edit_from_elsewhere_opens_the_hand)
{
    const Bar bar;
    Editing editing(bar.document());
    hold_ends(editing.document());
    editing.wait();
    ASSERT_TRUE(editing.begin_drag("head"));
    editing.drag_to(turned(0, {0.3, 0, 0}));
    editing.update();
    editing.document().undo(); // the head is no region any more
    editing.drag_to(turned(0, {0.4, 0, 0}));
    EXPECT_FALSE(editing.dragged());
    editing.end_drag();
    EXPECT_EQ(editing.document().regions().size(), 1u);
    EXPECT_TRUE(editing.document().can_redo());
    editing.wait();
    ASSERT_NE(editing.result(), nullptr) << editing.status().error;
    EXPECT_EQ(editing.result()->samples, editing.document().model()->geometry.samples);
}

TEST(Editing, what_was_given_up_can_be_asked_for_again)
{
    const Bar bar(16);
    Editing editing(bar.document());
    hold_ends(editing.document());
    turn_often(editing.document());
    editing.update();
    editing.cancel();
    editing.wait();
    EXPECT_EQ(editing.result(), nullptr);
    EXPECT_EQ(editing.status().state, SolveStatus::State::Failed);
    EXPECT_EQ(editing.status().error, "cancelled");
    editing.solve();
    editing.wait();
    EXPECT_NE(editing.result(), nullptr) << editing.status().error;
    EXPECT_EQ(editing.status().state, SolveStatus::State::Idle);
}

TEST(Editing, exports_what_is_seen_and_a_field_that_gives_the_same)
{
    const Bar bar;
    Editing editing(bar.document());
    hold_ends(editing.document());
    drag(editing, "head", turned(40, {0.5, 0, 0}));
    EXPECT_TRUE(
        contains(error_of(Fault::Usage, [&]
                          { editing.export_field(bar.folder / "b.obj", Overwrite::No); }),
                 "ends in .cwf"));
    EXPECT_TRUE(
        contains(error_of(Fault::Usage, [&]
                          { editing.export_model(bar.folder / "b.obj", Overwrite::No); }),
                 "the result is not there yet"));
    editing.wait();
    editing.export_model(bar.folder / "bent.obj", Overwrite::No);
    const GeometryFile bent = read_geometry(bar.folder / "bent.obj");
    EXPECT_TRUE(bent.geometry.samples == editing.result()->samples);
    error_of(Fault::File,
             [&] { editing.export_model(bar.folder / "bent.obj", Overwrite::No); });
    bend_twice(editing);
    editing.export_field(bar.folder / "bent.cwf", Overwrite::No);
    EXPECT_EQ(editing.export_status().frames, 2u);
    // What is edited meanwhile is not in it.
    const std::vector<Eigen::Vector3d> exported = editing.result()->samples;
    editing.document().move_region("belly", turned(0, {0, 0, 0.2}));
    editing.wait();
    const ExportStatus status = editing.export_status();
    ASSERT_EQ(status.state, ExportStatus::State::Written) << status.error;
    EXPECT_EQ(status.frames_done, 2u);
    const Deformation field(read_field(bar.folder / "bent.cwf"), "bent.cwf");
    EXPECT_EQ(field.num_maps(), 2u);
    std::vector<Eigen::Vector3d> samples = editing.document().model()->geometry.samples;
    field.carry({samples});
    EXPECT_TRUE(samples == exported);
    error_of(Fault::File,
             [&] { editing.export_field(bar.folder / "bent.cwf", Overwrite::No); });
}

TEST(Editing, a_field_is_written_behind_and_can_be_given_up)
{
    const Bar bar(16);
    Editing editing(bar.document());
    hold_ends(editing.document());
    turn_often(editing.document());
    const std::string path = bar.folder / "bent.cwf";
    editing.export_field(path, Overwrite::No);
    EXPECT_EQ(editing.export_status().state, ExportStatus::State::Working);
    EXPECT_TRUE(contains(
        error_of(Fault::Usage, [&] { editing.export_field(path, Overwrite::No); }),
        "another field"));
    editing.cancel_export();
    editing.cancel();
    while (editing.export_status().state == ExportStatus::State::Working)
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    EXPECT_TRUE(editing.update());
    EXPECT_EQ(editing.export_status().state, ExportStatus::State::Cancelled);
    EXPECT_LT(editing.export_status().frames_done, kOften);
    EXPECT_FALSE(std::filesystem::exists(path));
    // What cannot be is told at its end.
    editing.document().move_region("head", turned(0, {1e160, 0, 0}));
    editing.export_field(path, Overwrite::No);
    editing.wait();
    EXPECT_EQ(editing.export_status().state, ExportStatus::State::Failed);
    EXPECT_TRUE(contains(editing.export_status().error, "no solution"));
    EXPECT_FALSE(std::filesystem::exists(path));
}

TEST(Editing, memory_that_is_not_there_is_told_and_asked_for_again_by_the_next_edit)
{
    const Bar bar;
    Editing editing(bar.document());
    hold_ends(editing.document());
    editing.wait();
    int num_solves = 0, num_fields = 0;
    const auto wait_for_field = [&]
    {
        while (editing.export_status().state == ExportStatus::State::Working)
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
    };
    // Which thread asks for the memory that is not there depends on how fast they are.
    for (const std::size_t which : {100u, 400u, 1600u, 2400u, 2800u, 3200u, 4800u, 6400u})
    {
        editing.document().move_region("head", turned(10, {0.1, 0, 1e-4 * which}));
        {
            const support::FailingAllocation failing(which);
            try
            {
                editing.wait();
            }
            catch (const std::bad_alloc&)
            {
            }
        }
        const SolveStatus status = editing.status();
        num_solves += status.state == SolveStatus::State::Failed &&
                      contains(status.error, "out of memory");
        const std::string path = bar.folder / "bent.cwf";
        {
            const support::FailingAllocation failing(which);
            try
            {
                editing.export_field(path, Overwrite::Yes);
                wait_for_field();
            }
            catch (const std::bad_alloc&)
            {
            }
        }
        wait_for_field(); // the wait may have been what had no memory
        num_fields += editing.export_status().state == ExportStatus::State::Failed &&
                      contains(editing.export_status().error, "out of memory");
    }
    EXPECT_GT(num_solves, 0);
    EXPECT_GT(num_fields, 0);
    editing.document().move_region("head", turned(30, {0.2, 0, 0}));
    editing.wait();
    EXPECT_EQ(editing.status().state, SolveStatus::State::Idle) << editing.status().error;
    editing.export_field(bar.folder / "bent.cwf", Overwrite::Yes);
    wait_for_field();
    EXPECT_EQ(editing.export_status().state, ExportStatus::State::Written);
}

TEST(Editing, ends_while_it_solves)
{
    const Bar bar(24);
    for (int k = 0; k < 3; ++k)
    {
        Editing editing(bar.document());
        hold_ends(editing.document());
        if (k > 0)
            editing.wait();
        editing.begin_drag("head");
        editing.drag_to(turned(90, {0.5, 0, 0}));
        editing.update();
        if (k == 2)
            editing.end_drag();
        editing.update();
    }
}

namespace
{

/// A strip in the plane z = 0, its ends held.
struct Strip
{
    support::Folder folder;
    std::string model;

    Strip() : model(folder / "strip.obj")
    {
        write_file(model, support::obj_text(support::sheet_shape(4, 1, 6)),
                   Overwrite::No);
    }
    Document document() const
    {
        Document document(model, "");
        SceneSettings settings;
        settings.cells.across = 12;
        settings.cells.max_depth = 1;
        document.change_settings(settings);
        document.select(
            samples_where(document, [](const Eigen::Vector3d& x) { return x.x() < 0.4; }),
            "Select by box");
        document.add_region(Role::Fixed, "foot");
        document.select(
            samples_where(document, [](const Eigen::Vector3d& x) { return x.x() > 3.6; }),
            "Select by box");
        document.add_region(Role::Handle, "head");
        return document;
    }
};

double height(const std::vector<Eigen::Vector3d>& samples)
{
    double height = 0.0;
    for (const Eigen::Vector3d& x : samples)
        height = std::max(height, std::abs(x.z()));
    return height;
}

double shown_height(const ShownShape& shape)
{
    double height = 0.0;
    for (std::size_t i = 2; i < shape.positions.size(); i += 3)
    {
        const Eigen::Vector4d x(shape.positions[i - 2], shape.positions[i - 1],
                                shape.positions[i], 1.0);
        height = std::max(height, std::abs((shape.to_view * x).z()));
    }
    return height;
}

} // namespace

TEST(Editing, a_drag_out_of_its_plane_lets_a_flat_model_bend_in_space)
{
    const Strip strip;
    Editing editing(strip.document());
    Document& document = editing.document();
    editing.wait();
    drag(editing, "head", turned(0, {-0.5, 0.5, 0}));
    editing.wait();
    ASSERT_NE(editing.result(), nullptr) << editing.status().error;
    const std::vector<Eigen::Vector3d> bent = editing.result()->samples;
    EXPECT_EQ(height(bent), 0.0);
    EXPECT_EQ(document.settings().cells.flat, std::nullopt);

    drag(editing, "head", turned(0, {-0.5, 0.5, 1.0}));
    editing.wait();
    ASSERT_NE(editing.result(), nullptr) << editing.status().error;
    EXPECT_GT(height(editing.result()->samples), 0.9);
    EXPECT_EQ(document.settings().cells.flat, false);
    document.save(strip.folder / "scene.json");
    EXPECT_TRUE(
        contains(support::bytes_of(strip.folder / "scene.json"), "\"flat\": false"));
    EXPECT_TRUE(replayed(strip.folder / "scene.json") == editing.result()->samples);

    // One step back it is flat again, and what is done there stays so.
    document.undo();
    editing.wait();
    EXPECT_EQ(document.settings().cells.flat, std::nullopt);
    EXPECT_TRUE(editing.result()->samples == bent);
    drag(editing, "head", turned(0, {-0.7, 0.5, 0}));
    editing.wait();
    EXPECT_EQ(height(editing.result()->samples), 0.0);
    document.save(strip.folder / "scene.json");
    EXPECT_FALSE(contains(support::bytes_of(strip.folder / "scene.json"), "\"flat\""));
    EXPECT_TRUE(replayed(strip.folder / "scene.json") == editing.result()->samples);
}

TEST(Editing, a_first_drag_tells_whether_a_flat_model_stays_in_its_plane)
{
    const Strip strip;
    Editing editing(strip.document());
    editing.wait();
    drag(editing, "head", turned(30, {0, 0, 0.5}));
    editing.wait();
    ASSERT_NE(editing.result(), nullptr) << editing.status().error;
    EXPECT_GT(height(editing.result()->samples), 0.4);
    EXPECT_EQ(editing.document().settings().cells.flat, std::nullopt);
    drag(editing, "head", turned(30, {0.2, 0, 0.5}));
    editing.wait();
    EXPECT_EQ(editing.document().settings().cells.flat, std::nullopt);
    editing.document().save(strip.folder / "scene.json");
    EXPECT_TRUE(replayed(strip.folder / "scene.json") == editing.result()->samples);
}

TEST(Editing, a_flat_model_in_the_hand_is_seen_in_space_once_it_leaves_its_plane)
{
    const Strip strip;
    Editing editing(strip.document());
    Document& document = editing.document();
    editing.wait();
    document.move_region("head", turned(0, {-0.5, 0.5, 0}));
    editing.wait();
    const auto flat = editing.result();
    ASSERT_TRUE(editing.begin_drag("head"));
    const auto held_at = [&](const Eigen::Vector3d& shift)
    {
        editing.drag_to(turned(0, shift));
        for (int k = 0; k < 4000; ++k)
        {
            editing.update();
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
            if (k > 200 && (shift.z() == 0.0 || editing.drag_status().frames > 2))
                break;
        }
        return shown_height(editing.shape());
    };
    EXPECT_LT(held_at({-0.6, 0.5, 0}), 1e-6);
    const double scale = (editing.view_frame().axes * Eigen::Vector3d::UnitX()).norm() *
                         std::ldexp(1.0, editing.view_frame().exponent);
    EXPECT_GT(held_at({-0.6, 0.5, 1.0}), 0.9 * scale);
    editing.cancel_drag();
    editing.wait();
    // The result is that of the document, whatever the hand has seen.
    EXPECT_EQ(document.settings().cells.flat, std::nullopt);
    ASSERT_NE(editing.result(), nullptr);
    EXPECT_TRUE(editing.result()->samples == flat->samples);
    EXPECT_EQ(editing.status().error, "");
    drag(editing, "head", turned(0, {-0.6, 0.4, 0}));
    editing.wait();
    EXPECT_EQ(height(editing.result()->samples), 0.0);
}

} // namespace cellwarp::core
