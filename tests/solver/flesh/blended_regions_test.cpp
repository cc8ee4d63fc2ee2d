// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/flesh/blended_regions.h"

#include <cmath>
#include <numbers>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "octree/base/segment.h"
#include "solver/flesh/bone_points.h"
#include "solver/flesh/flesh.h"
#include "tests/support/flesh.h"
#include "tests/support/shapes.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kStep = 1.0 / 120.0;

/// A bar 8 x 2 x 2 about the x axis in cubes of 0.5, with bones along its axis.
struct Bar
{
    std::vector<BoneLine> bones;
    FleshSettings settings = {};
    double margin = 1.0; ///< reach of the shares [bones' half way]
    bool has_tube = true;

    Flesh make() const
    {
        const support::Built body = support::bar(16, 4, 4);
        Lattice lattice = octree_lattice(body.octree, body.cells, 0.5);
        for (Vector3d& x : lattice.places)
            x -= Vector3d(0, 1, 1);
        for (LatticePart& part : lattice.parts)
            part.centre -= Vector3d(0, 1, 1);
        const std::vector<FleshMaterial> materials = {{1.0, 0.4, 1.0}};
        std::vector<TubeBone> tubes;
        std::vector<std::vector<double>> distances;
        std::vector<int> motions;
        for (const BoneLine& bone : bones)
        {
            tubes.push_back({bone, 0.5});
            motions.push_back(bone.motion);
            std::vector<double>& of_bone = distances.emplace_back();
            for (const Vector3d& x : lattice.places)
            {
                const double t = nearest_share(bone.from, bone.to, x);
                of_bone.push_back((bone.from + t * (bone.to - bone.from) - x).norm());
            }
        }
        std::vector<TubePart> parts;
        if (has_tube)
            parts = tube_parts(lattice, materials, tubes, points_in_tubes(lattice, tubes),
                               10.0);
        std::vector<HeldPoint> points =
            points_on_bones(lattice, bones, [](int, const Vector3d&) { return true; });
        std::vector<FleshRegionShares> regions;
        if (settings.law == FleshLaw::Regions)
            regions = shares_by_distance(lattice, distances, motions, margin);
        return Flesh(std::move(lattice), materials, std::move(points), std::move(parts),
                     settings, std::move(regions));
    }
};

FleshSettings law(FleshLaw of)
{
    FleshSettings settings;
    settings.law = of;
    settings.tolerance = 1e-12;
    return settings;
}

Motion turned(const Vector3d& axis, double angle, const Vector3d& about)
{
    Motion T;
    T.R = rotation_about(axis.normalized(), angle);
    T.t = about - T.R * about;
    return T;
}

const std::vector<BoneLine> kElbow = {{{0, 0, 0}, {4, 0, 0}, 0},
                                      {{4, 0, 0}, {8, 0, 0}, 1}};

double volume_of(const Flesh& flesh, const FleshState& state)
{
    double volume = 0.0;
    for (const CornerNodes& cell : flesh.lattice().cells)
    {
        // Six tetrahedra around the diagonal.
        const auto at = [&](int corner) -> Vector3d
        {
            const int node = cell[idx(corner)];
            return flesh.lattice().places[idx(node)] + state.u.segment<3>(3 * node);
        };
        constexpr int around[7] = {1, 3, 2, 6, 4, 5, 1};
        for (int k = 0; k < 6; ++k)
            volume += (at(around[k]) - at(0))
                          .cross(at(around[k + 1]) - at(0))
                          .dot(at(7) - at(0)) /
                      6.0;
    }
    return volume;
}

} // namespace

TEST(BlendedRegions, one_region_is_a_plain_linear_step)
{
    Bar bar{{{{0, 0, 0}, {8, 0, 0}, 0}}, law(FleshLaw::Regions)};
    bar.settings.gravity = {0, -0.3, 0.1};
    bar.settings.alpha = 0.4;
    bar.settings.beta = 0.02;
    Flesh regions = bar.make();
    bar.settings.law = FleshLaw::Linear;
    Flesh linear = bar.make();
    FleshState a = regions.rest(), b = a;
    std::vector<Motion> motions(1);
    for (int step = 1; step <= 10; ++step)
    {
        motions[0].t = {0.01 * step, 0, 0.002 * step};
        ASSERT_TRUE(regions.step(a, kStep, motions).is_finite);
        linear.step(b, kStep, motions);
    }
    EXPECT_GT(b.u.norm(), 1e-2);
    EXPECT_LT((a.u - b.u).norm(), 1e-9 * b.u.norm());
    // In a frame that turns: the turned step, of the turned body.
    const Motion turn = turned({1, 2, -1}, 0.7, {0.3, 0.1, 2});
    FleshState c = regions.rest();
    for (std::size_t n = 0; n < regions.lattice().places.size(); ++n)
    {
        const Vector3d& x = regions.lattice().places[n];
        c.u.segment<3>(Eigen::Index(3 * n)) = turn(x) - x;
    }
    const VectorXd before = c.u;
    const FleshReport report = regions.step(c, kStep, {{turn}});
    EXPECT_TRUE(report.is_converged);
    FleshState d = linear.rest();
    // The weight turns the other way.
    bar.settings.law = FleshLaw::Linear;
    bar.settings.gravity = turn.R.transpose() * bar.settings.gravity;
    Flesh other = bar.make();
    other.step(d, kStep, {{Motion()}});
    for (std::size_t n = 0; n < regions.lattice().places.size(); ++n)
        EXPECT_LT(((c.u - before).segment<3>(Eigen::Index(3 * n)) -
                   turn.R * d.u.segment<3>(Eigen::Index(3 * n)))
                      .norm(),
                  1e-10);
}

TEST(BlendedRegions, bones_that_turn_as_one_carry_all_without_force)
{
    const Bar bar{kElbow, law(FleshLaw::Regions)};
    Flesh flesh = bar.make();
    const Motion turn = turned({0, 0.6, 0.8}, 2.5, {1, 2, 3});
    FleshState state = flesh.rest();
    for (std::size_t n = 0; n < flesh.lattice().places.size(); ++n)
    {
        const Vector3d& x = flesh.lattice().places[n];
        state.u.segment<3>(Eigen::Index(3 * n)) = turn(x) - x;
    }
    const VectorXd before = state.u;
    flesh.step(state, kStep, {{turn, turn}});
    EXPECT_LT((state.u - before).norm(), 1e-11);
    EXPECT_LT(state.v.norm(), 1e-9);
}

TEST(BlendedRegions, a_joint_keeps_the_volume_that_is_known)
{
    // [theory-skeleton 4], "regions (section 7), margin 1".
    Bar bar{kElbow, law(FleshLaw::Regions)};
    for (const auto& [degrees, known] :
         {std::pair{30.0, 1.018}, {60.0, 1.047}, {90.0, 1.025}, {120.0, 0.912}})
    {
        Flesh flesh = bar.make();
        FleshState state = flesh.rest();
        FleshReport report;
        for (int part = 1; part <= 40; ++part)
        {
            const double angle =
                std::min(1.0, part / 10.0) * degrees * std::numbers::pi / 180.0;
            state.v.setZero();
            report = flesh.step(
                state, 1000.0, {{Motion(), turned(Vector3d::UnitZ(), angle, {4, 0, 0})}});
            ASSERT_TRUE(report.is_finite);
        }
        const double volume = volume_of(flesh, state) / 32.0;
        // Other cells of the tubes' integrals, other shares: the last digit differs.
        EXPECT_NEAR(volume, known, 0.008);
    }
}

TEST(BlendedRegions, steps_of_any_length_and_stiffness_stay_bounded)
{
    for (const double dt : {1e-4, kStep, 0.05})
    {
        Bar bar{kElbow, law(FleshLaw::Regions)};
        bar.settings.gravity = {0, -0.1, 0};
        Flesh flesh = bar.make();
        FleshState state = flesh.rest();
        for (int step = 0; step < 200; ++step)
        {
            const double angle = std::min(1.0, step / 60.0);
            ASSERT_TRUE(
                flesh
                    .step(state, dt,
                          {{Motion(), turned(Vector3d::UnitZ(), angle, {4, 0, 0})}})
                    .is_finite);
        }
        EXPECT_LT(state.u.cwiseAbs().maxCoeff(), 8.0);
    }
}

TEST(BlendedRegions, shares_fall_from_bone_to_bone_and_sum_to_one)
{
    const Lattice lattice = support::bar_lattice(1, 6);
    std::vector<std::vector<double>> distances(2);
    for (const Vector3d& x : lattice.places)
    {
        distances[0].push_back(x.x());
        distances[1].push_back(6.0 - x.x());
    }
    const std::vector<int> motions = {3, 5};
    const auto regions = shares_by_distance(lattice, distances, motions, 3.0);
    ASSERT_EQ(regions.size(), 2u);
    EXPECT_EQ(regions[1].motion, 5);
    VectorXd sums = VectorXd::Zero(Eigen::Index(lattice.places.size()));
    for (const FleshRegionShares& region : regions)
        for (const NodeShare& share : region.shares)
        {
            sums[share.node] += share.share;
            const double x = lattice.places[idx(share.node)].x();
            const double farther =
                std::max(0.0, (region.motion == 3 ? 2 : -2) * (x - 3.0));
            EXPECT_LT(farther, 3.0);
            if (x == 4.0)
            {
                EXPECT_NEAR(share.share, region.motion == 3 ? 1.0 / 10.0 : 0.9, 1e-12);
            }
        }
    EXPECT_LT((sums.array() - 1.0).abs().maxCoeff(), 1e-15);
    const BoundNodes nodes = bind_nodes(lattice.hanging, {});
    const std::vector<FleshMaterial> materials(1);
    EXPECT_THROW(BlendedRegions(lattice, nodes, materials, {}, {regions[0]}, 0.0, 0.0),
                 std::invalid_argument);
}

TEST(BlendedRegions, contact_and_pulled_points_are_met)
{
    Bar bar{kElbow, law(FleshLaw::Regions)};
    Flesh flesh = bar.make();
    PulledPoint pulled;
    pulled.point.shares = shares_at(flesh.lattice(), 100, {0.9, 0.3, 0.6});
    pulled.point.place = cell_point(flesh.lattice(), 100, {0.9, 0.3, 0.6});
    pulled.goal = pulled.point.place + Vector3d(0.02, 0.04, -0.03);
    FleshState state = flesh.rest();
    const std::vector<Motion> still(2);
    flesh.step(state, kStep, still, {{}, std::span(&pulled, 1)});
    EXPECT_LT((pulled.point.place + at_point(pulled.point.shares, state.u) - pulled.goal)
                  .norm(),
              1e-10);
}

} // namespace cellwarp::core
