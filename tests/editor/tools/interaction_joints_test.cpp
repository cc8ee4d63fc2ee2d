// SPDX-License-Identifier: GPL-3.0-or-later
// Joints of a skeleton in the hand.
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

struct JointDesk : Desk
{
    JointDesk() : Desk([](const support::Folder& in) { return limb(in); }) { settle(); }
    Vector3d place(std::size_t joint)
    {
        return editing.view_frame().to_model(editing.shape().lines[joint].points[0]);
    }
};

} // namespace

TEST(InteractionJoints, bones_are_seen_through_the_shape)
{
    JointDesk desk;
    const std::vector<SeenLine> lines = desk.hand.lines();
    ASSERT_EQ(lines.size(), 3u);
    EXPECT_TRUE(lines[1].is_bone);
    ASSERT_EQ(lines[1].places.size(), 2u);
    EXPECT_LT((desk.place(2) - Vector3d(2.9, 0.5, 0.5)).norm(), 1e-9);
}

TEST(InteractionJoints, the_end_of_a_bone_is_dragged_and_the_others_follow)
{
    JointDesk desk;
    desk.hand.set_tool(Tool::Move);
    const Vector3d from = desk.place(2), way(-0.5, 1.0, 0);
    desk.drag(desk.pixel(from), desk.pixel(from + way));
    desk.settle();
    EXPECT_EQ(desk.last_edit(), "Move foot");
    EXPECT_EQ(desk.hand.active_region(), "foot");
    EXPECT_LT((desk.place(2) - (from + way)).norm(), 0.03);
    EXPECT_TRUE(desk.hand.lines()[2].points[0].is_held);
    desk.key('z', {.control = true});
    desk.settle();
    EXPECT_LT((desk.place(2) - from).norm(), 1e-9);
}

TEST(InteractionJoints, a_joint_is_turned_by_a_key_and_a_number)
{
    JointDesk desk;
    desk.hand.set_tool(Tool::Move);
    desk.click(desk.pixel(desk.place(1)));
    EXPECT_EQ(desk.hand.active_region(), "knee");
    desk.key('r');
    desk.key('z');
    desk.keys("90");
    desk.key(Key::Enter);
    desk.settle();
    EXPECT_EQ(desk.last_edit(), "Turn knee");
    EXPECT_LT((desk.place(2) - Vector3d(1.5, 1.9, 0.5)).norm(), 1e-9);
    EXPECT_LT((desk.place(1) - Vector3d(1.5, 0.5, 0.5)).norm(), 1e-9);
}

} // namespace cellwarp::core
