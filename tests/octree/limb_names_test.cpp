// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/limb_names.h"

#include <algorithm>
#include <set>

#include <gtest/gtest.h>

#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

/// Pelvis, legs with feet towards \p ahead (z), spine, arms, head; symmetric about x = 0.
std::vector<LimbJoint> person(double ahead)
{
    std::vector<LimbJoint> out = {{{0, 1, 0}, -1, 0, 0.1, 0}};
    const auto add = [&](const Vector3d& at, int parent, int limb, int side)
    {
        out.push_back({at, parent, limb, 0.1, side});
        return static_cast<int>(out.size()) - 1;
    };
    for (const int side : {1, -1})
    {
        const int knee = add({0.1 * side, 0.5, 0}, 0, 1, side);
        const int ankle = add({0.1 * side, 0.1, 0}, knee, 1, side);
        add({0.1 * side, 0, 0.3 * ahead}, ankle, 1, side);
    }
    const int chest = add({0, 1.5, 0}, 0, 2, 0);
    for (const int side : {1, -1})
        add({0.8 * side, 1.5, 0}, add({0.4 * side, 1.5, 0}, chest, 3, side), 3, side);
    add({0, 1.8, 0}, chest, 4, 0);
    return out;
}

Vector3d named(const std::vector<LimbJoint>& joints,
               const std::vector<std::string>& names, const std::string& name)
{
    const auto found = std::find(names.begin(), names.end(), name);
    return found == names.end() ? Vector3d(9, 9, 9)
                                : joints[idx(static_cast<int>(found - names.begin()))].at;
}

} // namespace

TEST(LimbNames, a_person_has_legs_arms_a_spine_and_a_head)
{
    const std::vector<LimbJoint> joints = person(1.0);
    const std::vector<std::string> names = limb_names(joints);
    EXPECT_EQ(std::set(names.begin(), names.end()).size(), joints.size());
    EXPECT_EQ(names[0], "root");
    EXPECT_EQ(named(joints, names, "leg.1.L"), Vector3d(0.1, 0.5, 0));
    EXPECT_EQ(named(joints, names, "leg.3.R"), Vector3d(-0.1, 0, 0.3));
    EXPECT_EQ(named(joints, names, "arm.2.L"), Vector3d(0.8, 1.5, 0));
    EXPECT_EQ(named(joints, names, "spine.1"), Vector3d(0, 1.5, 0));
    EXPECT_EQ(named(joints, names, "head.1"), Vector3d(0, 1.8, 0));
}

TEST(LimbNames, left_is_to_the_left_of_where_the_feet_point)
{
    const std::vector<LimbJoint> joints = person(-1.0);
    EXPECT_EQ(named(joints, limb_names(joints), "arm.2.L"), Vector3d(-0.8, 1.5, 0));
    // Feet that point nowhere leave the side of x.
    const std::vector<LimbJoint> still = person(0.0);
    EXPECT_EQ(named(still, limb_names(still), "arm.2.L"), Vector3d(0.8, 1.5, 0));
    // The same person in a space whose z is up, looking along -y.
    std::vector<LimbJoint> turned = person(1.0);
    for (LimbJoint& joint : turned)
        joint.at = Vector3d(joint.at.x(), -joint.at.z(), joint.at.y());
    EXPECT_EQ(named(turned, limb_names(turned, 'z'), "arm.2.L"), Vector3d(0.8, 0, 1.5));
}

TEST(LimbNames, without_legs_limbs_have_numbers)
{
    const std::vector<LimbJoint> cross = {{{0, 0, 0}, -1, 0, 0.1, 0},
                                          {{0, 1, 0}, 0, 1, 0.1, 0},
                                          {{1, 2, 0}, 1, 2, 0.1, 1},
                                          {{-1, 2, 0}, 1, 2, 0.1, -1}};
    EXPECT_EQ(limb_names(cross),
              (std::vector<std::string>{"root", "limb1.1", "limb2.1.L", "limb2.1.R"}));
}

} // namespace cellwarp::core
