// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/mirrored_limbs.h"

#include <algorithm>

#include <gtest/gtest.h>

#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

const MirrorPlane kPlane{Vector3d::UnitX(), 0.0};

bool everywhere(const Vector3d&)
{
    return true;
}

/// A root, a chest from which an arm leaves to the left, above it a place from which one
/// leaves to the right with a joint less, and a head.
std::vector<LimbJoint> crooked()
{
    return {{{0.05, 0, 0}, -1, 0, 0.1, 0},   {{0.02, 1, 0}, 0, 1, 0.1, 0},
            {{1, 1, 0}, 1, 2, 0.1, 0},       {{2, 1, 0}, 2, 2, 0.1, 0},
            {{-0.02, 1.2, 0}, 1, 3, 0.1, 0}, {{-1.9, 1.1, 0}, 4, 4, 0.1, 0},
            {{0.03, 2, 0}, 4, 5, 0.1, 0}};
}

} // namespace

TEST(MirroredLimbs, the_limb_with_more_joints_is_there_on_both_sides)
{
    const std::vector<LimbJoint> joints =
        mirrored_limbs(crooked(), kPlane, 0.02, everywhere);
    // Root, chest, two joints on each side, head: the place above the chest has no limb.
    ASSERT_EQ(joints.size(), 7u);
    for (const LimbJoint& joint : joints)
    {
        if (joint.side == 0)
        {
            EXPECT_EQ(joint.at.x(), 0.0);
            continue;
        }
        EXPECT_GT(joint.side * joint.at.x(), 0.0);
        EXPECT_EQ(std::count_if(
                      joints.begin(), joints.end(),
                      [&](const LimbJoint& other)
                      {
                          return other.side == -joint.side && other.limb == joint.limb &&
                                 other.at == kPlane.mirrored(joint.at) &&
                                 joints[idx(other.parent)].at ==
                                     kPlane.mirrored(joints[idx(joint.parent)].at);
                      }),
                  1);
    }
    for (std::size_t j = 1; j < joints.size(); ++j)
        EXPECT_LT(joints[j].parent, static_cast<int>(j));
}

TEST(MirroredLimbs, a_limb_whose_image_has_no_place_stays_alone)
{
    std::vector<LimbJoint> joints = crooked();
    joints.erase(joints.begin() + 5); // no arm on the right
    joints[5].parent = 4;
    const auto only_left = [](const Vector3d& x) { return x.x() > -0.1; };
    const std::vector<LimbJoint> alone = mirrored_limbs(joints, kPlane, 0.02, only_left);
    EXPECT_EQ(std::count_if(alone.begin(), alone.end(),
                            [](const LimbJoint& joint) { return joint.side != 0; }),
              0);
    EXPECT_EQ(std::count_if(alone.begin(), alone.end(),
                            [](const LimbJoint& joint) { return joint.at.x() > 0.5; }),
              2);
    const std::vector<LimbJoint> both = mirrored_limbs(joints, kPlane, 0.02, everywhere);
    EXPECT_EQ(std::count_if(both.begin(), both.end(),
                            [](const LimbJoint& joint) { return joint.side != 0; }),
              4);
}

TEST(MirroredLimbs, what_begins_beside_the_plane_is_refused)
{
    const std::vector<LimbJoint> line = {{{-1, 0, 0}, -1, 0, 0.1, 0},
                                         {{1, 0, 0}, 0, 1, 0.1, 0}};
    EXPECT_TRUE(mirrored_limbs(line, kPlane, 0.02, everywhere).empty());
    EXPECT_TRUE(mirrored_limbs({}, kPlane, 0.02, everywhere).empty());
    const MirrorPlane along{Vector3d::UnitY(), 0.01};
    const std::vector<LimbJoint> in_it = mirrored_limbs(line, along, 0.02, everywhere);
    ASSERT_EQ(in_it.size(), 2u);
    EXPECT_EQ(in_it[1].at, Vector3d(1, 0.01, 0));
}

} // namespace cellwarp::core
