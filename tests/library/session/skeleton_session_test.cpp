// SPDX-License-Identifier: GPL-3.0-or-later
// Skeletons that pose cells: joints of handle files and scenes.
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "library/session/scene_script.h"
#include "library/session/session.h"
#include "library/session/volume.h"
#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "tests/support/bodies.h"
#include "tests/support/sessions.h"
#include "tests/support/shapes.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

using support::contains;
using support::error_of;
using support::handles;
using support::largest_difference;
using support::long_bar;
using support::model;
using support::played;
using support::settings;

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kPi = std::numbers::pi;

/// Two bones along the bar, from 0 to 4.
const std::string kBones = "joint root at 0 0 0\n"
                           "joint knee at 0 0 2 parent root\n"
                           "joint foot at 0 0 4 parent knee\n";

Matrix3d about(const Vector3d& axis, double degrees)
{
    return Eigen::AngleAxisd(degrees * kPi / 180.0, axis.normalized()).toRotationMatrix();
}

/// Largest distance of the samples beyond \p from along the bar from where a motion about
/// the knee takes them.
double off_bone(const Session& session, double from, const Matrix3d& R)
{
    double most = 0.0;
    const Vector3d knee(0, 0, 2);
    for (std::size_t i = 0; i < session.geometry().samples.size(); ++i)
        if (const Vector3d& x = session.geometry().samples[i]; x.z() >= from)
            most = std::max(
                most, (session.deformed().samples[i] - knee - R * (x - knee)).norm());
    return most;
}

Vector3d joint_of(const Session& session, const std::string& name)
{
    for (const PosedJoint& joint : session.joints())
        if (joint.name == name)
            return joint.place;
    ADD_FAILURE() << "no joint " << name;
    return Vector3d::Zero();
}

std::vector<BoneBinding> bones_of(const Session& session)
{
    return session.skeleton().value().bones;
}

/// With all places turned by \p Q about the origin, then shifted.
std::string turned_bones(const Matrix3d& Q, const Vector3d& shift)
{
    std::string text;
    for (const auto& [name, z, parent] :
         {std::tuple("root", 0.0, ""), std::tuple("knee", 2.0, "root"),
          std::tuple("foot", 4.0, "knee")})
    {
        const Vector3d at = Q * Vector3d(0, 0, z) + shift;
        text += std::string("joint ") + name + " at " + std::to_string(at.x()) + " " +
                std::to_string(at.y()) + " " + std::to_string(at.z()) +
                (*parent ? std::string(" parent ") + parent : "") + "\n";
    }
    return text;
}

} // namespace

TEST(SkeletonSession, bones_at_rest_move_nothing)
{
    const Session session = played(long_bar(), kBones + "frame 1\n", settings(16));
    EXPECT_LT(largest_difference(session.geometry().samples, session.deformed().samples),
              1e-12);
}

TEST(SkeletonSession, what_lies_along_a_bone_follows_it_and_the_joint_bends)
{
    const Session session =
        played(long_bar(), kBones + "frame 1\nmove knee rotate 1 0 0 60\n", settings(16));
    EXPECT_LT(off_bone(session, 3.6, about({1, 0, 0}, 60)), 0.02);
    EXPECT_LT((joint_of(session, "foot") -
               (Vector3d(0, 0, 2) + about({1, 0, 0}, 60) * Vector3d(0, 0, 2)))
                  .norm(),
              1e-12);
    const std::optional<Volume> volume =
        enclosed_volumes(session.geometry(), session.deformed().samples);
    ASSERT_TRUE(volume);
    EXPECT_NEAR(volume->after / volume->before, 1.0, 0.05);
}

TEST(SkeletonSession, a_root_carries_the_whole_shape_rigidly)
{
    const Session session = played(
        long_bar(), kBones + "frame 1\nmove root rotate 0 1 0 75 translate 3 0 1\n",
        settings(12));
    double most = 0.0;
    for (std::size_t i = 0; i < session.geometry().samples.size(); ++i)
        most = std::max(most, (session.deformed().samples[i] - Vector3d(3, 0, 1) -
                               about({0, 1, 0}, 75) * session.geometry().samples[i])
                                  .norm());
    EXPECT_LT(most, 1e-9);
}

TEST(SkeletonSession, moves_are_absolute_and_last)
{
    const Session once =
        played(long_bar(), kBones + "frame 1\nmove knee rotate 1 0 0 40\n", settings(12));
    const Session twice = played(long_bar(),
                                 kBones + "frame 1\nmove knee rotate 1 0 0 20\n"
                                          "frame 2\nmove knee rotate 1 0 0 40\n"
                                          "frame 3\n",
                                 settings(12));
    EXPECT_LT(largest_difference(once.deformed().samples, twice.deformed().samples),
              1e-4);
}

TEST(SkeletonSession, a_shape_that_is_turned_with_its_bones_bends_the_same)
{
    const Matrix3d Q = about({0, 1, 0}, 90);
    const Vector3d shift(0, 0.5, 0.5); // support::turned() begins at the origin
    const Session straight =
        played(long_bar(), kBones + "frame 1\nmove knee rotate 1 0 0 50\n", settings(12));
    const Session turned = played(
        support::turned(long_bar(), Q),
        turned_bones(Q, shift) + "frame 1\nmove knee rotate 0 0 -1 50\n", settings(12));
    double most = 0.0;
    for (std::size_t i = 0; i < straight.deformed().samples.size(); ++i)
        most = std::max(most, (Q * straight.deformed().samples[i] + shift -
                               turned.deformed().samples[i])
                                  .norm());
    EXPECT_LT(most, 1e-6);
}

TEST(SkeletonSession, mirror_images_bend_to_mirror_images)
{
    const auto bent = [](const char* degrees)
    {
        return played(long_bar(),
                      kBones + "frame 1\nmove knee rotate 1 0 0 " + degrees + "\n",
                      settings(14));
    };
    const Session one = bent("50"), other = bent("-50");
    double most = 0.0;
    for (const Vector3d& x : one.deformed().samples)
    {
        double least = INFINITY;
        for (const Vector3d& y : other.deformed().samples)
            least = std::min(least, (Vector3d(x.x(), -x.y(), x.z()) - y).norm());
        most = std::max(most, least);
    }
    EXPECT_LT(most, 1e-6);
}

TEST(SkeletonSession, bones_beside_fixed_regions_leave_them_in_place)
{
    const Session session = played(long_bar(),
                                   "fixed base box -1 -1 -1 1 1 0.3\n" + kBones +
                                       "frame 1\nmove knee rotate 1 0 0 45\n",
                                   settings(16));
    for (std::size_t i = 0; i < session.geometry().samples.size(); ++i)
        if (session.geometry().samples[i].z() <= 0.3)
        {
            EXPECT_LT(
                (session.deformed().samples[i] - session.geometry().samples[i]).norm(),
                1e-9);
        }
}

TEST(SkeletonSession, a_joint_reaches_a_place_and_stays_there)
{
    const std::string reach = kBones + "frame 1\nmove foot to 0 2 2\n"
                                       "frame 2\nmove root translate 0 0 0.5\n";
    Session session(model(long_bar()), handles(reach), settings(12));
    ASSERT_TRUE(session.next_frame(true));
    EXPECT_LT((joint_of(session, "foot") - Vector3d(0, 2, 2)).norm(), 1e-9);
    ASSERT_TRUE(session.next_frame(true));
    EXPECT_LT((joint_of(session, "foot") - Vector3d(0, 2, 2)).norm(), 1e-9);
    EXPECT_LT((joint_of(session, "root") - Vector3d(0, 0, 0.5)).norm(), 1e-12);
    EXPECT_TRUE(session.warnings().empty()) << session.warnings()[0];
}

TEST(SkeletonSession, a_joint_that_is_let_go_keeps_its_turns)
{
    Session session(model(long_bar()),
                    handles(kBones + "frame 1\nmove foot to 0 2 2\n"
                                     "frame 2\nrelease foot\n"
                                     "frame 3\nmove knee rotate 1 0 0 0\n"),
                    settings(8));
    session.next_frame(true);
    session.next_frame(true);
    EXPECT_LT((joint_of(session, "foot") - Vector3d(0, 2, 2)).norm(), 1e-9);
    session.next_frame(true);
    EXPECT_NEAR((joint_of(session, "foot") - joint_of(session, "root")).norm(), 4.0,
                1e-9);
}

TEST(SkeletonSession, places_out_of_reach_and_cut_turns_are_warnings)
{
    const Session session =
        played(long_bar(),
               "joint root at 0 0 0\n"
               "joint knee at 0 0 2 parent root hinge 1 0 0 twist 0 30\n"
               "joint foot at 0 0 4 parent knee\n"
               "frame 1\nmove knee rotate 1 0 0 50\n"
               "frame 2\nmove foot to 0 9 0\n",
               settings(8));
    ASSERT_EQ(session.warnings().size(), 2u);
    EXPECT_TRUE(contains(session.warnings()[0], "frame 1: 1 turns of joints are cut"));
    EXPECT_TRUE(contains(session.warnings()[1], "foot: frame 2: ends"));
    EXPECT_TRUE(contains(session.warnings()[1], "out of reach"));
}

TEST(SkeletonSession, bones_outside_and_material_far_from_all_are_told)
{
    const Session session(
        model(long_bar()),
        handles("joint root at 0 0 0\njoint knee at 0 0 1 parent root\n"
                "joint tail at 0 5 0 parent root\njoint end at 0 7 0 parent tail\n"
                "frame 1\n"),
        settings(16));
    ASSERT_EQ(session.warnings().size(), 2u);
    EXPECT_TRUE(contains(session.warnings()[0], "1 of 2 bones meet no material"));
    EXPECT_TRUE(contains(session.warnings()[0], "tail"));
    EXPECT_TRUE(contains(session.warnings()[1], "far from every bone"));
    const std::optional<SkeletonBinding> binding = session.skeleton();
    ASSERT_TRUE(binding);
    EXPECT_EQ(binding->outside, std::vector<std::string>{"tail"});
    EXPECT_GT(binding->far_share, 0.2);
    EXPECT_NEAR(binding->farthest.z(), 4.0, 0.5);
}

TEST(SkeletonSession, bones_that_others_leave_no_cell_are_told)
{
    const Session session(
        model(long_bar()),
        handles("fixed all box -9 -9 -9 9 9 9\n" + kBones + "frame 1\n"), settings(8));
    ASSERT_EQ(session.warnings().size(), 1u);
    EXPECT_TRUE(contains(session.warnings()[0], "move nothing: root, knee"));
}

TEST(SkeletonSession, a_bone_has_half_the_distance_to_the_outside_for_its_radius)
{
    const Session session(model(long_bar()), handles(kBones + "frame 1\n"), settings(16));
    ASSERT_EQ(bones_of(session).size(), 2u);
    for (const BoneBinding& bone : bones_of(session))
    {
        EXPECT_NEAR(bone.radius, 0.25, 0.03);
        EXPECT_EQ(bone.inside, 1.0);
        EXPECT_GT(bone.cells, 10);
    }
}

TEST(SkeletonSession, a_bone_holds_cells_however_large_they_are)
{
    for (const int across : {4, 5, 8})
    {
        const Session session(model(long_bar()), handles(kBones + "frame 1\n"),
                              settings(across));
        for (const BoneBinding& bone : bones_of(session))
            EXPECT_GT(bone.cells, 0) << across;
    }
}

TEST(SkeletonSession, bones_grip_the_skin_of_a_shell)
{
    SessionSettings shell = settings(20);
    shell.cells.fill = Fill::Shell;
    const Session session =
        played(long_bar(), kBones + "frame 1\nmove knee rotate 1 0 0 30\n", shell);
    for (const BoneBinding& bone : bones_of(session))
        EXPECT_GT(bone.cells, 10);
    EXPECT_LT(off_bone(session, 3.6, about({1, 0, 0}, 30)), 0.1);
}

TEST(SkeletonSession, threads_do_not_change_a_bit)
{
    std::vector<Vector3d> first;
    for (const int threads : {1, 2, 4})
    {
        const ThreadLimit limit(threads);
        const Session session =
            played(long_bar(), kBones + "frame 1\nmove foot to 0 2 2\n", settings(12));
        if (first.empty())
            first = session.deformed().samples;
        EXPECT_EQ(session.deformed().samples, first) << threads;
    }
}

TEST(SkeletonSession, a_script_that_changes_goes_on_as_a_new_one_would)
{
    const HandleFile first = handles(kBones + "frame 1\nmove knee rotate 1 0 0 30\n"),
                     second = handles(kBones + "frame 1\nmove knee rotate 1 0 0 30\n"
                                               "frame 2\nmove foot to 0 1.5 2.5\n");
    SessionSettings s = settings(12);
    s.keeps_checkpoints = true;
    Session session(model(long_bar()), first, s);
    while (session.next_frame(true))
    {
    }
    session.set_script(second);
    while (session.next_frame(true))
    {
    }
    const Session fresh = played(long_bar(),
                                 kBones + "frame 1\nmove knee rotate 1 0 0 30\n"
                                          "frame 2\nmove foot to 0 1.5 2.5\n",
                                 settings(12));
    EXPECT_EQ(session.deformed().samples, fresh.deformed().samples);
    session.set_script(first);
    const Session back =
        played(long_bar(), kBones + "frame 1\nmove knee rotate 1 0 0 30\n", settings(12));
    EXPECT_EQ(session.deformed().samples, back.deformed().samples);
}

TEST(SkeletonSession, keys_of_a_scene_are_frames)
{
    const SceneFile scene = parse_scene("s.json", R"({"cellwarp": 1, "model": "bar.obj",
        "skeleton": {"joints": [{"name": "root", "parent": null, "at": [0, 0, 0]},
                                {"name": "knee", "parent": "root", "at": [0, 0, 2]},
                                {"name": "foot", "parent": "knee", "at": [0, 0, 4]}],
                     "keys": [{"time": 1, "joint": "knee", "rotate": [1, 0, 0, 40]},
                              {"time": 0, "joint": "knee", "rotate": [1, 0, 0, 0]},
                              {"time": 0.5, "joint": "root", "translate": [1, 0, 0]}]}})");
    std::vector<std::string> warnings;
    const std::optional<HandleFile> script = script_of(scene, "", warnings);
    ASSERT_TRUE(script);
    const std::vector<FrameStatement>& frames = script->stages[0].frames;
    ASSERT_EQ(frames.size(), 3u);
    EXPECT_EQ(frames[2].number, 3);
    EXPECT_EQ(frames[1].time, 0.5);
    Session session(model(long_bar()), *script, settings(8));
    session.next_frame(true);
    session.next_frame(true);
    // Half way between two keys.
    EXPECT_LT((joint_of(session, "foot") - Vector3d(1, 0, 2) -
               about({1, 0, 0}, 20) * Vector3d(0, 0, 2))
                  .norm(),
              1e-12);
    SceneFile finer = scene;
    finer.skeleton->every = 0.25;
    EXPECT_EQ(script_of(finer, "", warnings)->stages[0].frames.size(), 5u);
    finer.skeleton->every = 0.7; // the last key has its frame as well
    EXPECT_EQ(script_of(finer, "", warnings)->stages[0].frames.back().time, 1.0);
    finer.skeleton->every = 1e-6;
    EXPECT_TRUE(
        contains(error_of(Fault::Malformed, [&] { script_of(finer, "", warnings); }),
                 "s.json: skeleton.every: makes more than 100000 frames"));
}

TEST(SkeletonSession, cells_are_refined_where_a_joint_bends)
{
    const std::string bend = kBones + "frame 1\nmove knee rotate 1 0 0 60\n";
    const Session coarse = played(long_bar(), bend, settings(16));
    const Session fine = played(long_bar(), bend, settings(16, 1));
    EXPECT_GT(fine.system()->body().cells.size(), coarse.system()->body().cells.size());
    EXPECT_LT(off_bone(fine, 3.6, about({1, 0, 0}, 60)), 0.02);
    for (const BoneBinding& bone : bones_of(fine))
        EXPECT_GT(bone.cells, 0);
}

TEST(SkeletonSession, moves_beyond_numbers_are_told_with_file_and_line)
{
    const std::string said = error_of(
        Fault::Malformed,
        [] {
            played(long_bar(), kBones + "frame 1\nmove foot to 0 0 1e300\n", settings(8));
        });
    EXPECT_TRUE(contains(said, "h.handles:6: foot: moves beyond")) << said;
    std::string far = "move root";
    for (int k = 0; k < 20; ++k)
        far += " translate 0 0 1e308";
    const std::string shifted =
        error_of(Fault::Malformed, [&]
                 { played(long_bar(), kBones + "frame 1\n" + far + "\n", settings(8)); });
    EXPECT_TRUE(contains(shifted, "h.handles:6: root: moves beyond")) << shifted;
}

TEST(SkeletonSession, a_flat_model_takes_none)
{
    SessionSettings flat = settings(12);
    flat.cells.is_flat = true;
    const auto play = [&]
    {
        played(support::sheet_shape(3.0, 1.0, 6),
               "joint a at 0.2 0.2 0\njoint b at 2 0.2 0 parent a\nframe 1\n", flat);
    };
    EXPECT_TRUE(contains(error_of(Fault::Malformed, play),
                         "a flat model (cells.flat) has regions alone, no skeleton"));
}

TEST(SkeletonSession, scenes_without_one_build_none)
{
    const Session session =
        played(long_bar(), "fixed base box -1 -1 -1 1 1 0.3\nframe 1\n", settings(8));
    EXPECT_EQ(session.parts().skeleton, 0);
    EXPECT_FALSE(session.skeleton());
    EXPECT_TRUE(session.joints().empty());
    const Session posed = played(long_bar(), kBones + "frame 1\n", settings(8));
    EXPECT_EQ(posed.parts().skeleton, 1);
}

TEST(SkeletonSession, a_commit_starts_a_skeleton_anew)
{
    const Session session = played(long_bar(),
                                   kBones + "frame 1\nmove knee rotate 1 0 0 30\ncommit\n"
                                            "joint a at 0 0 0\n"
                                            "joint b at 0 0 2 parent a\n"
                                            "frame 2\nmove a rotate 0 0 1 90\n",
                                   settings(10));
    ASSERT_EQ(session.joints().size(), 2u);
    EXPECT_EQ(session.joints()[1].name, "b");
}

TEST(SkeletonSession, a_flat_model_with_a_skeleton_bends_in_space)
{
    const Session session = played(support::sheet_shape(3.0, 1.0, 6),
                                   "joint a at 0.2 0.5 0\njoint b at 2 0.5 0 parent a\n"
                                   "frame 1\nmove b rotate 0 0 1 20\n",
                                   settings(12));
    EXPECT_FALSE(session.system()->rest().is_flat());
}

} // namespace cellwarp::core
