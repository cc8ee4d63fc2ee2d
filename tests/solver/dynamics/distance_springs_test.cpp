// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/dynamics/distance_springs.h"

#include <random>

#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

namespace cellwarp::core
{

namespace
{

Eigen::VectorXd random_vector(double size, std::mt19937& rng)
{
    std::normal_distribution<double> normal(0.0, size);
    Eigen::VectorXd out(12);
    for (double& x : out)
        x = normal(rng);
    return out;
}

/// Between points, between sums of points, and from a place of the world.
DistanceSprings three_kinds(bool has_length)
{
    DistanceSprings springs;
    springs.add({way_between({{0, 1.0}}, {{3, 1.0}}), 30.0, has_length ? 1.0 : 0.0});
    springs.add({way_between({{0, 0.5}, {6, 0.5}}, {{3, 0.25}, {6, 0.5}, {9, 0.25}}),
                 20.0, has_length ? 0.7 : 0.0});
    springs.add({{{3, 0.4}, {9, 0.6}}, 10.0, has_length ? 0.3 : 0.0, {0.1, -1, 2}});
    return springs;
}

Eigen::MatrixXd dense(const DistanceSprings& springs, const Eigen::VectorXd& x,
                      DistanceSprings::Curvature how)
{
    Eigen::MatrixXd out = Eigen::MatrixXd::Zero(12, 12);
    springs.for_each_block(x, how,
                           [&](int row, int column, const Eigen::Matrix3d& B)
                           { out.block<3, 3>(row, column) += B; });
    return out.selfadjointView<Eigen::Lower>();
}

} // namespace

TEST(DistanceSprings, derivatives_are_those_of_differences_in_damped_steps_as_well)
{
    std::mt19937 rng(7);
    for (const bool has_length : {true, false})
        for (const double gain : {0.0, 2.5})
        {
            SCOPED_TRACE(testing::Message() << has_length << gain);
            DistanceSprings springs = three_kinds(has_length);
            const Eigen::VectorXd x = random_vector(1.0, rng);
            springs.damp(x + random_vector(0.1, rng), gain);
            Eigen::VectorXd gradient = Eigen::VectorXd::Zero(12);
            EXPECT_GT(springs.add_gradient(x, gradient), 0.0);
            const Eigen::MatrixXd H =
                dense(springs, x, DistanceSprings::Curvature::Exact);
            constexpr double h = 1e-5;
            for (int n = 0; n < 4; ++n)
            {
                const Eigen::VectorXd step = random_vector(1.0, rng);
                EXPECT_NEAR((springs.step_energy(x + h * step) -
                             springs.step_energy(x - h * step)) /
                                (2.0 * h),
                            gradient.dot(step), 1e-7 * gradient.norm());
                Eigen::VectorXd ahead = Eigen::VectorXd::Zero(12), behind = ahead;
                springs.add_gradient(x + h * step, ahead);
                springs.add_gradient(x - h * step, behind);
                EXPECT_LT(((ahead - behind) / (2.0 * h) - H * step).norm(),
                          1e-6 * H.norm());
            }
            // Springs that do not push have no negative part.
            const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
                dense(springs, x, DistanceSprings::Curvature::WithoutPushes));
            EXPECT_GT(eigen.eigenvalues()[0], -1e-12 * H.norm());
        }
}

TEST(DistanceSprings, a_correction_takes_back_what_a_step_stretched_to_second_order)
{
    std::mt19937 rng(8);
    const DistanceSprings springs = three_kinds(true);
    const Eigen::VectorXd x = random_vector(1.0, rng), step = random_vector(1.0, rng);
    // The change of the force along the old ways, beyond first order, with its sign.
    const auto corrected = [&](double h)
    {
        Eigen::VectorXd out = Eigen::VectorXd::Zero(12);
        springs.add_correction(x, x + h * step, h * step, out);
        return out;
    };
    EXPECT_LT((corrected(2e-4) - 4.0 * corrected(1e-4)).norm(),
              1e-2 * corrected(2e-4).norm());
    EXPECT_GT(corrected(1e-4).norm(), 0.0);
    // A step along a spring leaves nothing.
    DistanceSprings one;
    one.add({way_between({{0, 1.0}}, {{3, 1.0}}), 30.0, 1.0});
    Eigen::VectorXd along_it = Eigen::VectorXd::Zero(12), out = along_it;
    along_it.segment<3>(3) = x.segment<3>(3) - x.head<3>();
    one.add_correction(x, x + 0.1 * along_it, 0.1 * along_it, out);
    EXPECT_LT(out.norm(), 1e-12);
}

TEST(DistanceSprings, a_damped_step_begins_with_the_forces_of_one_that_is_not)
{
    std::mt19937 rng(9);
    DistanceSprings springs = three_kinds(true);
    const Eigen::VectorXd x = random_vector(1.0, rng);
    Eigen::VectorXd plain = Eigen::VectorXd::Zero(12), damped = plain;
    springs.add_gradient(x, plain);
    const double energy = springs.energy(x);
    springs.damp(x, 5.0);
    springs.add_gradient(x, damped);
    EXPECT_LT((damped - plain).norm(), 1e-12 * plain.norm());
    EXPECT_EQ(springs.energy(x), energy);
    // A shift of all loses nothing.
    const Eigen::VectorXd shifted = x + Eigen::Vector3d(1, 2, 3).replicate(4, 1);
    DistanceSprings free;
    free.add({way_between({{0, 1.0}}, {{3, 1.0}}), 30.0, 1.0});
    free.damp(x, 5.0);
    Eigen::VectorXd here = Eigen::VectorXd::Zero(12), there = here;
    free.add_gradient(x, here);
    free.add_gradient(shifted, there);
    EXPECT_LT((here - there).norm(), 1e-12);
}

} // namespace cellwarp::core
