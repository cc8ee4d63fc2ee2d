// SPDX-License-Identifier: GPL-3.0-or-later
#include "octree/limb_tree.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "io/formats/geometry_file.h"
#include "octree/base/index.h"
#include "octree/base/point_tree.h"
#include "octree/winding.h"
#include "tests/support/files.h"
#include "tests/support/person.h"
#include "tests/support/pot.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

/// A closed tube about a line in the plane z = 0.
Shape tube(const std::vector<Vector3d>& line, double radius, bool is_ring)
{
    constexpr int kAround = 12;
    Shape shape;
    const std::size_t n = line.size();
    for (std::size_t k = 0; k < n; ++k)
    {
        const Vector3d before = line[k > 0 ? k - 1 : (is_ring ? n - 1 : 0)];
        const Vector3d after = line[k + 1 < n ? k + 1 : (is_ring ? 0 : n - 1)];
        const Vector3d side =
            (after - before).normalized().cross(Vector3d::UnitZ()).normalized();
        for (int i = 0; i < kAround; ++i)
        {
            const double a = 2.0 * std::numbers::pi * i / kAround;
            shape.samples.push_back(line[k] + radius * (std::cos(a) * side +
                                                        std::sin(a) * Vector3d::UnitZ()));
        }
    }
    const auto at = [&](std::size_t ring, int i)
    {
        return static_cast<std::uint32_t>((ring % n) * kAround +
                                          idx((i + kAround) % kAround));
    };
    for (std::size_t k = 0; k + (is_ring ? 0 : 1) < n; ++k)
        for (int i = 0; i < kAround; ++i)
        {
            shape.triangles.push_back({at(k, i), at(k, i + 1), at(k + 1, i + 1)});
            shape.triangles.push_back({at(k, i), at(k + 1, i + 1), at(k + 1, i)});
        }
    for (const std::size_t end : {std::size_t(0), n - 1})
    {
        if (is_ring)
            break;
        const auto middle = static_cast<std::uint32_t>(shape.samples.size());
        shape.samples.push_back(line[end]);
        for (int i = 0; i < kAround; ++i)
            if (end == 0)
                shape.triangles.push_back({middle, at(end, i + 1), at(end, i)});
            else
                shape.triangles.push_back({middle, at(end, i), at(end, i + 1)});
    }
    return shape;
}

/// Every joint hangs on an earlier one that is elsewhere.
void expect_tree(const std::vector<LimbJoint>& joints)
{
    ASSERT_FALSE(joints.empty());
    EXPECT_EQ(joints[0].parent, -1);
    for (std::size_t j = 1; j < joints.size(); ++j)
    {
        ASSERT_GE(joints[j].parent, 0);
        ASSERT_LT(joints[j].parent, static_cast<int>(j));
        EXPECT_GT((joints[j].at - joints[idx(joints[j].parent)].at).norm(), 1e-6);
    }
}

int tips(const std::vector<LimbJoint>& joints)
{
    std::vector<bool> has_child(joints.size(), false);
    for (const LimbJoint& joint : joints)
        if (joint.parent >= 0)
            has_child[idx(joint.parent)] = true;
    return static_cast<int>(std::count(has_child.begin(), has_child.end(), false));
}

} // namespace

TEST(LimbTree, a_cross_hangs_on_its_branching_and_has_four_limbs)
{
    const std::vector<LimbJoint> joints = limb_tree(support::cross(true));
    expect_tree(joints);
    EXPECT_LT((joints[0].at - Vector3d(0, 0, 7.5)).norm(), 0.6);
    EXPECT_EQ(tips(joints), 4);
    for (const Vector3d& end : {Vector3d(0, 0, 0), Vector3d(5, 0, 7.5),
                                Vector3d(-5, 0, 7.5), Vector3d(0, 0, 10)})
    {
        double least = INFINITY;
        for (const LimbJoint& joint : joints)
            least = std::min(least, (joint.at - end).norm());
        EXPECT_LT(least, 0.8) << end.transpose();
    }
}

TEST(LimbTree, the_corners_of_a_box_are_no_limbs)
{
    const std::vector<LimbJoint> bar =
        limb_tree(support::box_shape({0, 0, 0}, {1, 1, 5}, 8));
    expect_tree(bar);
    EXPECT_EQ(tips(bar), 1); // the other end is the root
    for (const LimbJoint& joint : bar)
        EXPECT_LT((joint.at - Vector3d(0.5, 0.5, joint.at.z())).norm(), 0.1);
}

TEST(LimbTree, a_limb_has_a_joint_where_it_bends)
{
    std::vector<Vector3d> line;
    for (int k = 0; k <= 20; ++k)
        line.emplace_back(0.2 * k, 0, 0);
    for (int k = 1; k <= 20; ++k)
        line.emplace_back(4, 0.2 * k, 0);
    const std::vector<LimbJoint> joints = limb_tree(tube(line, 0.4, false));
    expect_tree(joints);
    EXPECT_EQ(tips(joints), 1);
    double least = INFINITY;
    for (const LimbJoint& joint : joints)
        least = std::min(least, (joint.at - Vector3d(4, 0, 0)).norm());
    EXPECT_LT(least, 0.6);
}

namespace
{

/// A leg along x from 0, a bend and a foot straight on from it.
Shape leg_with_foot()
{
    constexpr double kAngle = 100.0 * std::numbers::pi / 180.0, kBend = 1.3;
    std::vector<Vector3d> line;
    for (int k = 0; k < 15; ++k)
        line.emplace_back(0.2 * k, 0, 0);
    const Vector3d knee = line.back();
    for (int k = 1; k <= 12; ++k)
    {
        const double a = kAngle * k / 12;
        line.push_back(knee + kBend * Vector3d(std::sin(a), 1.0 - std::cos(a), 0));
    }
    const Vector3d on = (line.back() - line[line.size() - 2]).normalized();
    for (int k = 1; k <= 3; ++k)
        line.push_back(line.back() + 0.15 * on);
    return tube(line, 0.35, false);
}

} // namespace

TEST(LimbTree, the_ends_of_limbs_of_real_models_are_inside)
{
    const std::string folder = support::data_folder();
    if (folder.empty())
        GTEST_SKIP() << "CELLWARP_TEST_DATA is not set";
    for (const char* const file : {"armadillo.obj", "stanford-bunny.obj", "spot.obj"})
    {
        const Geometry model = read_geometry(folder + "/" + file).geometry;
        Shape shape;
        shape.samples = model.samples;
        // All of these have triangles alone.
        for (std::size_t k = 0; k + 2 < model.corners.size(); k += 3)
            shape.triangles.push_back(
                {model.corners[k], model.corners[k + 1], model.corners[k + 2]});
        const PointTree tree(shape.samples);
        Eigen::AlignedBox3d box;
        for (const Vector3d& x : shape.samples)
            box.extend(x);
        // As far outside as the wrap is that limbs are looked for in.
        const double most = 0.004 * box.diagonal().norm();
        const std::vector<LimbJoint> joints = limb_tree(shape);
        ASSERT_GT(joints.size(), 8u) << file;
        for (const LimbJoint& joint : joints)
            EXPECT_TRUE(winding_number(shape, shape.triangles, joint.at) > 0.5 ||
                        std::sqrt(tree.nearest(joint.at).distance_squared) < most)
                << file << ": " << joint.at.transpose();
    }
}

TEST(LimbTree, of_a_surface_that_is_inside_out_is_that_of_the_surface)
{
    Shape leg = leg_with_foot();
    const std::vector<LimbJoint> joints = limb_tree(leg);
    for (Triangle& triangle : leg.triangles)
        std::swap(triangle[1], triangle[2]);
    const std::vector<LimbJoint> turned = limb_tree(leg);
    ASSERT_GT(joints.size(), 2u);
    expect_tree(turned);
    EXPECT_EQ(tips(turned), tips(joints));
    // Faces begin elsewhere in it: how the flow divides a bend hangs on that a little.
    EXPECT_LT((turned.front().at - joints.front().at).norm(), 0.1);
    EXPECT_LT((turned.back().at - joints.back().at).norm(), 0.1);
    for (const LimbJoint& joint : turned)
        EXPECT_NEAR(std::abs(winding_number(leg, leg.triangles, joint.at)), 1.0, 0.1)
            << joint.at.transpose();
}

TEST(LimbTree, a_leg_ends_in_its_foot_also_beside_an_open_sheet)
{
    Shape leg = leg_with_foot();
    const double heel = 1.5; // where the foot begins
    for (const bool has_sheet : {false, true})
    {
        const std::vector<LimbJoint> joints = limb_tree(leg);
        ASSERT_GT(joints.size(), 2u) << has_sheet;
        EXPECT_EQ(std::count_if(joints.begin(), joints.end(),
                                [&](const LimbJoint& joint)
                                { return joint.at.y() > heel; }),
                  1)
            << has_sheet;
        for (const LimbJoint& joint : joints)
            EXPECT_NEAR(std::abs(winding_number(leg, leg.triangles, joint.at)), 1.0, 0.1)
                << has_sheet << ": " << joint.at.transpose();
        const auto first = static_cast<std::uint32_t>(leg.samples.size());
        for (const Vector3d& corner :
             {Vector3d(9, 9, 0), Vector3d(9, 9, 0.1), Vector3d(9.1, 9, 0)})
            leg.samples.push_back(corner);
        leg.triangles.push_back({first, first + 1, first + 2});
    }
}

namespace
{

double nearest_joint(const std::vector<LimbJoint>& joints, const Vector3d& x)
{
    double least = INFINITY;
    for (const LimbJoint& joint : joints)
        least = std::min(least, (joint.at - x).norm());
    return least;
}

Vector3d mirrored(const Vector3d& x)
{
    return {-x.x(), x.y(), x.z()};
}

} // namespace

TEST(LimbTree, of_a_person_with_an_open_mouth_legs_begin_at_the_hips)
{
    for (const unsigned seed : {1u, 2u, 3u})
    {
        const support::Person person = support::person(seed == 2 ? 45.0 : 0.0, seed);
        const Shape open = support::with_hole(person.shape, person.mouth, 0.035);
        ASSERT_LT(open.triangles.size(), person.shape.triangles.size());
        const std::vector<LimbJoint> joints = limb_tree(open);
        expect_tree(joints);
        EXPECT_EQ(tips(joints), 5) << seed;
        // The lowest joint with several children.
        std::vector<int> children(joints.size(), 0);
        for (const LimbJoint& joint : joints)
            if (joint.parent >= 0)
                ++children[idx(joint.parent)];
        double lowest = INFINITY;
        for (std::size_t j = 0; j < joints.size(); ++j)
            if (children[j] > 1)
                lowest = std::min(lowest, joints[j].at.y());
        EXPECT_GT(lowest, person.hip.y() - 0.1) << seed;
    }
}

TEST(LimbTree, of_a_person_in_clothes_of_several_parts_all_limbs_are_found)
{
    const support::Person person = support::person(0.0, 4);
    const double waist = 0.4 * person.pelvis.y() + 0.6 * person.chest.y();
    // Cut at the waist: two shells, each open there.
    Shape cut = person.shape;
    std::erase_if(
        cut.triangles,
        [&](const Triangle& t)
        {
            const double y =
                (cut.samples[t[0]] + cut.samples[t[1]] + cut.samples[t[2]]).y() / 3.0;
            return std::abs(y - waist) < 0.02;
        });
    ASSERT_LT(cut.triangles.size(), person.shape.triangles.size());
    EXPECT_EQ(tips(limb_tree(cut)), 5);
}

TEST(LimbTree, straight_arms_and_legs_of_a_person_have_elbows_and_knees)
{
    for (const unsigned seed : {1u, 5u})
    {
        const support::Person person = support::person(0.0, seed);
        const std::vector<LimbJoint> joints = limb_tree(person.shape);
        for (const Vector3d& joint : {person.elbow, person.knee})
        {
            EXPECT_LT(nearest_joint(joints, joint), 0.09) << seed;
            EXPECT_LT(nearest_joint(joints, mirrored(joint)), 0.09) << seed;
        }
    }
}

TEST(LimbTree, a_symmetric_person_has_a_symmetric_skeleton_also_turned_and_mirrored)
{
    const support::Person person = support::person(35.0, 6);
    for (const double degrees : {0.0, 50.0, 180.0})
    {
        const Eigen::AngleAxisd turn(degrees * std::numbers::pi / 180.0,
                                     Vector3d(1, 2, 3).normalized());
        Shape shape = support::with_hole(person.shape, person.mouth, 0.035);
        for (Vector3d& x : shape.samples)
            x = turn * x + Vector3d(3, 0, 1);
        const std::vector<LimbJoint> joints = limb_tree(shape);
        expect_tree(joints);
        EXPECT_EQ(tips(joints), 5) << degrees;
        int beside = 0;
        for (const LimbJoint& joint : joints)
        {
            const Vector3d image =
                turn * mirrored(turn.inverse() * (joint.at - Vector3d(3, 0, 1))) +
                Vector3d(3, 0, 1);
            EXPECT_LT(nearest_joint(joints, image), 2e-3) << degrees;
            beside += joint.side != 0;
        }
        EXPECT_GE(beside, 12) << degrees;
        for (const Vector3d& joint : {person.elbow, person.knee})
            EXPECT_LT(nearest_joint(joints, turn * joint + Vector3d(3, 0, 1)), 0.1)
                << degrees;
    }
}

TEST(LimbTree, a_straight_piece_of_a_limb_that_bends_elsewhere_is_halved)
{
    // Long, then a bend and a short foot.
    std::vector<Vector3d> line;
    for (int k = 0; k <= 40; ++k)
        line.emplace_back(0.1 * k, 0, 0);
    for (int k = 1; k <= 8; ++k)
        line.emplace_back(4, 0.1 * k, 0);
    const std::vector<LimbJoint> joints = limb_tree(tube(line, 0.25, false));
    expect_tree(joints);
    EXPECT_LT(nearest_joint(joints, {2, 0, 0}), 0.4);
}

TEST(LimbTree, a_long_straight_limb_has_as_many_bones_as_asked_for)
{
    std::vector<Vector3d> line;
    for (int k = 0; k <= 30; ++k)
        line.emplace_back(0.2 * k, 0, 0);
    const Shape rod = tube(line, 0.3, false);
    EXPECT_EQ(limb_tree(rod).size(), 3u);
    EXPECT_EQ(limb_tree(rod, {0.35, 5}).size(), 6u);
    EXPECT_EQ(limb_tree(rod, {0.35, 1}).size(), 2u);
}

TEST(LimbTree, a_ring_is_open_in_one_place)
{
    std::vector<Vector3d> line;
    for (int k = 0; k < 60; ++k)
        line.emplace_back(2.0 * std::cos(2.0 * std::numbers::pi * k / 60),
                          2.0 * std::sin(2.0 * std::numbers::pi * k / 60), 0);
    const std::vector<LimbJoint> joints = limb_tree(tube(line, 0.3, true));
    expect_tree(joints);
    EXPECT_EQ(tips(joints), 1);
    EXPECT_GT(joints.size(), 4u);
    for (const LimbJoint& joint : joints)
        EXPECT_NEAR(joint.at.head<2>().norm(), 2.0, 0.25);
}

TEST(LimbTree, limbs_are_found_far_from_the_origin)
{
    const Vector3d away(1e6, -2e6, 5e5);
    Shape far = support::cross(true);
    for (Vector3d& x : far.samples)
        x += away;
    const std::vector<LimbJoint> joints = limb_tree(far);
    expect_tree(joints);
    EXPECT_EQ(tips(joints), 4);
    EXPECT_LT((joints[0].at - away - Vector3d(0, 0, 7.5)).norm(), 0.6);
}

TEST(LimbTree, the_same_each_time)
{
    const std::vector<LimbJoint> one = limb_tree(support::cross(true)),
                                 other = limb_tree(support::cross(true));
    ASSERT_EQ(one.size(), other.size());
    for (std::size_t j = 0; j < one.size(); ++j)
        EXPECT_EQ(one[j].at, other[j].at);
}

TEST(LimbTree, what_has_no_line_has_no_joints)
{
    EXPECT_TRUE(limb_tree(Shape()).empty());
    Shape three;
    three.samples = {Vector3d(0, 0, 0), Vector3d(1, 0, 0), Vector3d(0, 1, 0)};
    EXPECT_TRUE(limb_tree(three).empty());
}

} // namespace cellwarp::core
