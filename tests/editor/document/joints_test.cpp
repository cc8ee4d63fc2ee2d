// SPDX-License-Identifier: GPL-3.0-or-later
// Joints of a skeleton in a document: turned, brought to places, let go, taken back.
#include <chrono>
#include <filesystem>
#include <thread>

#include <gtest/gtest.h>

#include "editor/document/editing.h"
#include "io/base/bytes.h"
#include "tests/editor/document/random_edits.h"
#include "tests/support/files.h"
#include "tests/support/shapes.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::contents;
using support::error_of;
using support::replayed;

namespace
{

using Eigen::Vector3d;

/// A bar of 1 x 1 x 4 along z with two bones.
struct Limb
{
    support::Folder folder;
    std::string scene, journals = folder / "journals";

    Limb()
    {
        std::filesystem::create_directory(journals);
        folder.write("bar.obj", support::obj_text(support::box_shape({-0.5, -0.5, 0},
                                                                     {0.5, 0.5, 4}, 6)));
        scene = folder.write("s.json", R"({"cellwarp": 1, "model": "bar.obj",
            "cells": {"across": 12, "max_depth": 0}, "skeleton": {"joints": [
                {"name": "root", "parent": null, "at": [0, 0, 0]},
                {"name": "knee", "parent": "root", "at": [0, 0, 2]},
                {"name": "foot", "parent": "knee", "at": [0, 0, 4]}]}})");
    }
    Document open(bool has_journal = false) const
    {
        return Document(scene, has_journal ? journals : "");
    }
};

RigidMove turned(const EditedRegion& joint, double degrees)
{
    RigidMove to = joint.placement;
    to.axis = Vector3d::UnitX();
    to.degrees = degrees;
    return to;
}

RigidMove shifted(const EditedRegion& joint, const Vector3d& by)
{
    RigidMove to = joint.placement;
    to.translation += by;
    return to;
}

Vector3d place_of(const Document& document, const std::string& joint)
{
    const EditedRegion& found = *document.region(joint);
    return found.centre + found.placement.translation;
}

} // namespace

TEST(Joints, stand_behind_the_regions_at_their_places)
{
    const Limb limb;
    const Document document = limb.open();
    ASSERT_EQ(document.regions().size(), 3u);
    EXPECT_EQ(document.regions()[1].name, "knee");
    EXPECT_EQ(document.regions()[1].role, Role::Bone);
    EXPECT_TRUE(document.regions()[0].joint->is_root);
    EXPECT_TRUE(document.regions()[1].moves());
    EXPECT_LT((place_of(document, "foot") - Vector3d(0, 0, 4)).norm(), 1e-12);
    EXPECT_TRUE(document.warnings().empty());
}

TEST(Joints, are_seen_at_rest_at_once_and_their_keys_are_solved_when_somebody_asks)
{
    Limb limb;
    limb.scene = limb.folder.write("k.json", R"({"cellwarp": 1, "model": "bar.obj",
        "cells": {"across": 12, "max_depth": 0}, "skeleton": {"joints": [
            {"name": "root", "parent": null, "at": [0, 0, 0]},
            {"name": "knee", "parent": "root", "at": [0, 0, 2]},
            {"name": "foot", "parent": "knee", "at": [0, 0, 4]}],
            "keys": [{"time": 0, "joint": "knee", "rotate": [1, 0, 0, 10]},
                     {"time": 1, "joint": "knee", "rotate": [1, 0, 0, 40]}]}})");
    Editing editing(limb.open());
    const auto place = [&](std::size_t joint) -> Vector3d
    { return editing.view_frame().to_model(editing.shape().lines[joint].points[0]); };
    ASSERT_EQ(editing.shape().lines.size(), 3u);
    EXPECT_EQ(editing.shape().lines[2].name, "foot");
    EXPECT_LT((place(2) - Vector3d(0, 0, 4)).norm(), 1e-12);
    EXPECT_TRUE(editing.is_unsolved());
    editing.wait();
    EXPECT_EQ(editing.result(), nullptr);
    EXPECT_EQ(editing.status().cells, 0u);
    EXPECT_EQ(editing.document().num_frames_without_key(), 0u);
    editing.solve();
    EXPECT_FALSE(editing.is_unsolved());
    editing.wait();
    ASSERT_NE(editing.result(), nullptr) << editing.status().error;
    EXPECT_GT((place(2) - Vector3d(0, 0, 4)).norm(), 1.0);
    // A drag asks for a solve, and so does every edit.
    Editing second(limb.open());
    EXPECT_TRUE(second.begin_drag("foot"));
    EXPECT_FALSE(second.is_unsolved());
    second.cancel_drag();
    Editing third(limb.open());
    third.document().move_region("knee", turned(*third.document().region("knee"), 70));
    EXPECT_FALSE(third.is_unsolved());
    EXPECT_EQ(third.document().num_frames_without_key(), 1u);
    // Frames of a handle file are what is edited: they are solved at once.
    Document posed = limb.open();
    posed.save(limb.folder / "posed.json", Overwrite::No, SavedPart::Poses);
    EXPECT_FALSE(Editing(Document(limb.folder / "posed.json", "")).is_unsolved());
}

TEST(Joints, a_turn_in_the_world_is_told_about_the_axes_that_the_parent_has_turned)
{
    const Limb limb;
    Document document = limb.open();
    document.move_region("root", turned(*document.region("root"), 90));
    EXPECT_LT((place_of(document, "foot") - Vector3d(0, -4, 0)).norm(), 1e-12);
    // The knee is turned by 90 degrees already: 120 are 30 of its own.
    EXPECT_NEAR(document.region("knee")->placement.degrees, 90.0, 1e-9);
    document.move_region("knee", turned(*document.region("knee"), 120));
    const Move& move = document.handles().stages[0].frames[1].moves[0];
    EXPECT_EQ(move.region, "knee");
    EXPECT_NEAR(move.operations[0].move.degrees, 30.0, 1e-9);
    EXPECT_NEAR(document.region("knee")->placement.degrees, 120.0, 1e-9);
    // Back to rest is its own turn, not the parent's.
    document.move_region("knee", RigidMove());
    EXPECT_NEAR(document.region("knee")->placement.degrees, 90.0, 1e-9);
}

TEST(Joints, a_joint_that_is_moved_is_held_there_until_it_is_let_go)
{
    const Limb limb;
    Document document = limb.open();
    document.move_region("foot", shifted(*document.region("foot"), {0, 2, -2}));
    EXPECT_LT((place_of(document, "foot") - Vector3d(0, 2, 2)).norm(), 1e-9);
    EXPECT_TRUE(document.region("foot")->joint->is_held);
    // The others that are turned turn around it.
    document.move_region("root", turned(*document.region("root"), -30));
    EXPECT_TRUE(document.region("foot")->joint->is_held);
    document.release_joint("foot");
    EXPECT_FALSE(document.region("foot")->joint->is_held);
    EXPECT_TRUE(contains(error_of(Fault::Usage, [&] { document.release_joint("foot"); }),
                         "no joint that is held"));
}

TEST(Joints, edits_go_back_and_forth_and_survive_in_the_journal)
{
    const Limb limb;
    std::vector<std::string> states;
    {
        Document document = limb.open(true);
        states.push_back(contents(document));
        document.move_region("knee", turned(*document.region("knee"), 40));
        states.push_back(contents(document));
        document.move_region("foot", shifted(*document.region("foot"), {0, 0.5, 0}));
        states.push_back(contents(document));
        document.release_joint("foot");
        states.push_back(contents(document));
        for (std::size_t k = states.size(); k-- > 1;)
        {
            EXPECT_EQ(contents(document), states[k]);
            document.undo();
        }
        EXPECT_LT((place_of(document, "foot") - Vector3d(0, 0, 4)).norm(), 1e-12);
        for (std::size_t k = 1; k < states.size(); ++k)
            document.redo();
        EXPECT_EQ(contents(document), states.back());
    }
    Document document = limb.open(true);
    ASSERT_GT(document.num_recoverable(), 0u);
    EXPECT_TRUE(document.recover().empty());
    EXPECT_EQ(contents(document), states.back());
    EXPECT_EQ(document.regions().size(), 3u);
}

TEST(Joints, what_is_saved_opens_as_it_was_and_says_the_joints_once)
{
    const Limb limb;
    Document document = limb.open();
    document.move_region("knee", turned(*document.region("knee"), 40));
    const std::string copy = limb.folder / "copy.json";
    document.save(copy, Overwrite::No);
    EXPECT_TRUE(contains(read_file(copy), "skeleton"));
    const std::string handles = read_file(limb.folder / "copy.handles");
    EXPECT_FALSE(contains(handles, "joint knee at"));
    EXPECT_TRUE(contains(handles, "move knee"));
    {
        Document again(copy, "");
        EXPECT_TRUE(again.warnings().empty());
        EXPECT_EQ(again.regions().size(), 3u);
        EXPECT_LT((place_of(again, "foot") - place_of(document, "foot")).norm(), 1e-12);
        again.save(copy); // nobody else has changed it
    }
    // The poses alone have the joints beside them.
    document.save(limb.folder / "poses.json", Overwrite::No, SavedPart::Poses);
    EXPECT_FALSE(contains(read_file(limb.folder / "poses.json"), "skeleton"));
    EXPECT_TRUE(
        contains(read_file(limb.folder / "poses.handles"), "joint knee at 0 0 2"));
}

TEST(Joints, can_only_be_moved)
{
    const Limb limb;
    Document document = limb.open();
    const auto refuses = [&](auto&& command)
    {
        const std::string said = error_of(Fault::Usage, command);
        EXPECT_TRUE(contains(said, "is a joint of the skeleton")) << said;
    };
    document.select(support::between(document, 0, 0.5), "Select by box");
    refuses([&] { document.remove_region("knee"); });
    refuses([&] { document.rename_region("knee", "elbow"); });
    refuses([&] { document.set_role("knee", Role::Fixed, 1.0); });
    refuses([&] { document.set_samples("knee"); });
    error_of(Fault::Usage, [&] { document.add_region(Role::Fixed, "knee"); });
    // Regions beside them are made before anything has moved.
    document.add_region(Role::Fixed, "base");
    EXPECT_EQ(document.regions().size(), 4u);
    EXPECT_EQ(document.regions()[0].name, "base");
}

TEST(Joints, a_joint_in_the_hand_poses_what_is_shown_and_is_solved_on_release)
{
    const Limb limb;
    Editing editing(limb.open());
    editing.wait();
    ASSERT_EQ(editing.shape().lines.size(), 3u);
    EXPECT_TRUE(editing.shape().lines[1].is_bone);
    ASSERT_TRUE(editing.begin_drag("foot"));
    const Vector3d wanted = editing.view_frame().to_work({0, 1.5, 3});
    editing.drag_to(shifted(*editing.document().region("foot"), {0, 1.5, -1}));
    for (int k = 0;
         k < 1000 && (editing.shape().lines[2].points[0] - wanted).norm() > 1e-6; ++k)
    {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
        editing.update();
    }
    EXPECT_LT((editing.shape().lines[2].points[0] - wanted).norm(), 1e-6);
    editing.end_drag();
    editing.wait();
    ASSERT_TRUE(editing.result());
    EXPECT_EQ(editing.result()->samples, replayed(editing.document()));
    EXPECT_EQ(
        editing.document().history().name(editing.document().history().position() - 1),
        "Move foot");
}

} // namespace cellwarp::core
