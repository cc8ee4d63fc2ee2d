// SPDX-License-Identifier: GPL-3.0-or-later
#include "io/scene/skinned_file.h"

#include <cmath>

#include <gtest/gtest.h>

#include "io/formats/geometry_file.h"
#include "io/scene/weight_file.h"
#include "tests/support/files.h"
#include "tests/support/throws.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

/// A bar along z, open at its ends, with two bones, the upper one turned by a quarter
/// about x in a second.
struct Rig
{
    Geometry geometry;
    SkeletonValues skeleton;
    std::vector<SkinShares> shares;

    Rig()
    {
        constexpr std::uint32_t kRings = 17;
        for (std::uint32_t ring = 0; ring < kRings; ++ring)
            for (const auto& [x, y] :
                 {std::pair(-0.5, -0.5), {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}})
                geometry.samples.emplace_back(x, y, 0.25 * ring);
        const auto add = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c)
        {
            geometry.corners.insert(geometry.corners.end(), {a, b, c});
            geometry.face_ends.push_back(geometry.corners.size());
        };
        for (std::uint32_t low = 0; low < 4 * (kRings - 1); low += 4)
            for (std::uint32_t k = 0; k < 4; ++k)
            {
                const std::uint32_t a = low + k, b = low + (k + 1) % 4;
                add(a, b, b + 4);
                add(a, b + 4, a + 4);
            }
        for (const auto& [name, parent, z] :
             {std::tuple("root", "", 0.0), {"knee", "root", 2.0}, {"foot", "knee", 4.0}})
        {
            SkeletonJoint& joint = skeleton.joints.emplace_back();
            joint.name = name;
            joint.parent = parent;
            joint.at = {0, 0, z};
        }
        const double half = std::sqrt(0.5);
        skeleton.turns = {
            {1, KeyStep::Linear, {0, 1}, {{0, 0, 0, 1}, {half, 0, 0, half}}}};
        skeleton.shifts = {{0, KeyStep::Linear, {0, 2}, {{0, 0, 0}, {1, 0, 3}}}};
        for (const Vector3d& x : geometry.samples)
        {
            const float share = static_cast<float>(x.z() / 4.0);
            shares.push_back({{0, 1, 0, 0}, {1.0f - share, share, 0.0f, 0.0f}});
        }
    }
};

} // namespace

TEST(SkinnedFile, what_is_read_again_is_what_was_written)
{
    const Rig rig;
    const support::Folder folder;
    const std::string path = folder.write(
        "rig.glb", skinned_glb("rig.glb", rig.geometry, rig.skeleton, rig.shares));
    const Geometry geometry = read_geometry(path).geometry;
    ASSERT_EQ(geometry.samples.size(), rig.geometry.samples.size());
    for (std::size_t i = 0; i < geometry.samples.size(); ++i)
        EXPECT_LT((geometry.samples[i] - rig.geometry.samples[i]).norm(), 1e-6);
    EXPECT_EQ(geometry.num_faces(), rig.geometry.num_faces());

    const SkeletonValues skeleton = read_skeleton(path);
    for (const SkeletonJoint& joint : rig.skeleton.joints)
    {
        bool is_there = false;
        for (const SkeletonJoint& other : skeleton.joints)
            is_there =
                is_there || (other.name == joint.name && other.parent == joint.parent &&
                             (other.at - joint.at).norm() < 1e-6);
        EXPECT_TRUE(is_there) << joint.name;
    }
    ASSERT_EQ(skeleton.turns.size(), 1u);
    EXPECT_EQ(skeleton.joints[skeleton.turns[0].joint].name, "knee");
    ASSERT_EQ(skeleton.turns[0].values.size(), 2u);
    EXPECT_LT((skeleton.turns[0].values[1] - rig.skeleton.turns[0].values[1]).norm(),
              1e-6);
    ASSERT_EQ(skeleton.shifts.size(), 1u);
    EXPECT_LT((skeleton.shifts[0].values[1] - Vector3d(1, 0, 3)).norm(), 1e-6);

    const PaintedWeights weights = read_weights(path);
    ASSERT_EQ(weights.num_samples(), rig.geometry.samples.size());
    for (std::size_t j = 0; j < weights.joints.size(); ++j)
        if (weights.joints[j] == "knee")
        {
            for (std::size_t i = 0; i < rig.shares.size(); ++i)
                EXPECT_NEAR(weights.values[i * weights.joints.size() + j],
                            rig.shares[i].shares[1], 1e-6);
        }
}

TEST(SkinnedFile, numbers_beyond_single_precision_are_refused)
{
    Rig rig;
    rig.geometry.samples[0].x() = 1e60;
    EXPECT_TRUE(support::contains(
        support::error_of(
            Fault::Malformed,
            [&] { skinned_glb("rig.glb", rig.geometry, rig.skeleton, rig.shares); }),
        "does not fit 32 bits"));
}

} // namespace cellwarp::core
