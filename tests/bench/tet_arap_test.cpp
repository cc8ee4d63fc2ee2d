// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/bench/tet_arap.h"

#include <cmath>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "tests/bench/tet_box.h"
#include "tests/support/random.h"
#include "tests/support/random_poses.h"

namespace cellwarp::core::bench
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;

/// A bar of size 1 x 1 x 3 in so many parts, held by region 0 below and 1 above.
TetMesh held_bar(int across, int along)
{
    return cut_at_regions(box_of_tets({1, 1, 3}, {across, across, along}),
                          [](const Vector3d& x) {
                              return x.z() <= 0.5 ? 0 : x.z() >= 2.5 ? 1 : -1;
                          });
}

/// Moves the nodes of region 1.
void move_end(const TetElements& elements, const Matrix3d& R, const Vector3d& t,
              Matrix3Xd& x)
{
    for (std::size_t n = 0; n < elements.num_nodes(); ++n)
        if (elements.region_of_node[n] == 1)
            x.col(static_cast<Eigen::Index>(n)) =
                R * elements.rest.col(static_cast<Eigen::Index>(n)) + t;
}

Matrix3Xd random_columns(std::mt19937& rng, Eigen::Index count, double size)
{
    Matrix3Xd columns(3, count);
    for (Eigen::Index i = 0; i < count; ++i)
        columns.col(i) = support::random_vector(rng, size);
    return columns;
}

class TetArapOfOrder : public ::testing::TestWithParam<int>
{
protected:
    TetElements box_{[]
                     {
                         TetMesh mesh = box_of_tets({1, 2, 1}, {2, 2, 1});
                         mesh.region_of_point.assign(mesh.points.size(), -1);
                         return mesh;
                     }(),
                     GetParam()};
};

} // namespace

TEST_P(TetArapOfOrder, energy_is_zero_for_a_rigid_motion)
{
    std::mt19937 rng(3);
    for (int trial = 0; trial < 20; ++trial)
    {
        SCOPED_TRACE(trial);
        TetArap energy(box_);
        const Matrix3d R = support::random_rotation(rng);
        const Matrix3Xd x = (R * box_.rest).colwise() + support::random_vector(rng, 5.0);
        EXPECT_LT(energy.move_to(x), 1e-24);
        EXPECT_LT(energy.gradient().norm(), 1e-12);
    }
}

TEST_P(TetArapOfOrder, energy_of_a_stretch_is_that_of_its_factors_also_inside_out)
{
    std::mt19937 rng(4);
    for (const Vector3d& factors : {Vector3d(1.3, 0.8, 1.1), Vector3d(2.0, 0.1, -0.05)})
    {
        TetArap energy(box_);
        const Matrix3d F = support::random_rotation(rng) * factors.asDiagonal() *
                           Eigen::Matrix3d(support::random_rotation(rng));
        EXPECT_NEAR(energy.move_to(F * box_.rest),
                    2.0 * (factors - Vector3d::Ones()).squaredNorm(), 1e-12);
    }
}

TEST_P(TetArapOfOrder, derivatives_match_finite_differences)
{
    std::mt19937 rng(5);
    constexpr double kStep = 1e-5;
    for (int trial = 0; trial < 10; ++trial)
    {
        SCOPED_TRACE(trial);
        const Matrix3Xd x = support::random_rotation(rng) * box_.rest +
                            random_columns(rng, box_.rest.cols(), 0.15);
        const Matrix3Xd p = random_columns(rng, box_.rest.cols(), 1.0);
        TetArap energy(box_);
        const double above = energy.move_to(x + kStep * p);
        const Matrix3Xd gradient_above = energy.gradient();
        const double below = energy.move_to(x - kStep * p);
        const Matrix3Xd gradient_below = energy.gradient();
        energy.move_to(x);
        const double slope = energy.gradient().cwiseProduct(p).sum();
        EXPECT_NEAR((above - below) / (2.0 * kStep), slope,
                    1e-7 * (1.0 + std::abs(slope)));
        const Matrix3Xd product = energy.hessian_times(p);
        EXPECT_LT(((gradient_above - gradient_below) / (2.0 * kStep) - product).norm(),
                  1e-6 * product.norm());
    }
}

TEST_P(TetArapOfOrder, a_bar_that_is_pulled_stretches_evenly)
{
    const TetMesh mesh = held_bar(2, 5);
    const TetElements elements(mesh, GetParam());
    Matrix3Xd x = elements.rest;
    move_end(elements, Matrix3d::Identity(), {0, 0, 0.6}, x);
    const TetSolveReport report = TetSolver(elements).solve(x, {});
    EXPECT_EQ(report.stop, "converged");
    EXPECT_NEAR(report.energy, 2.0 * 0.3 * 0.3, 1e-9);
    Matrix3Xd even = elements.rest;
    even.row(2) = (even.row(2).array() - 0.5) * 1.3 + 0.5;
    EXPECT_LT((x - even).cwiseAbs().maxCoeff(), 1e-9);
}

TEST_P(TetArapOfOrder, newton_ends_where_many_local_global_iterations_do)
{
    const TetMesh mesh = held_bar(2, 6);
    const TetElements elements(mesh, GetParam());
    const Matrix3d R = Eigen::AngleAxisd(0.7, Vector3d(1, 2, 3).normalized()).matrix();
    Matrix3Xd start = elements.rest;
    move_end(elements, R, {0.2, 0, 0}, start);
    TetSolver solver(elements);
    Matrix3Xd by_newton = start, by_iterations = start;
    const TetSolveReport report = solver.solve(by_newton, {});
    EXPECT_EQ(report.stop, "converged");
    EXPECT_FALSE(report.is_saddle);
    TetSolveOptions slow;
    slow.local_global = 3000;
    slow.max_newton = 0;
    const TetSolveReport other = solver.solve(by_iterations, slow);
    EXPECT_EQ(other.stop, "iteration limit");
    EXPECT_LT((by_newton - by_iterations).cwiseAbs().maxCoeff(), 1e-6);
    EXPECT_LE(report.energy, other.energy + 1e-12);
}

INSTANTIATE_TEST_SUITE_P(Orders, TetArapOfOrder, ::testing::Values(1, 2));

TEST(TetElements, places_outside_go_straight_on)
{
    TetMesh mesh = box_of_tets({1, 1, 1}, {1, 1, 1});
    mesh.region_of_point.assign(mesh.points.size(), -1);
    const TetFinder finder(mesh);
    std::mt19937 rng(6);
    for (const int order : {1, 2})
    {
        SCOPED_TRACE(order);
        const TetElements elements(mesh, order);
        const Matrix3Xd x =
            elements.rest + random_columns(rng, elements.rest.cols(), 0.1);
        const TetFinder::Found found = finder.find({0.4, 0.3, 0.9});
        const auto place = [&](double share) -> Vector3d
        {
            // Beyond the corner of the largest weight: the nearest place stays that
            // corner.
            TetFinder::Found beyond = found;
            Eigen::Index corner = 0;
            found.weights.maxCoeff(&corner);
            beyond.weights.setConstant(-share / 3.0);
            beyond.weights[corner] = 1.0 + share;
            return elements.place(beyond, x);
        };
        EXPECT_LT((place(0.2) - 2.0 * place(0.1) + place(0.0)).norm(), 1e-12);
        EXPECT_GT((place(0.1) - place(0.0)).norm(), 0.01);
        EXPECT_LT((elements.place(found, elements.rest) - Vector3d(0.4, 0.3, 0.9)).norm(),
                  1e-12);
    }
}

TEST(TetElements, quadratic_ones_come_near_the_same_energy_with_fewer_tetrahedra)
{
    const auto twisted = [](int across, int along, int order)
    {
        const TetMesh mesh = held_bar(across, along);
        const TetElements elements(mesh, order);
        Matrix3Xd x = elements.rest;
        const Matrix3d R = Eigen::AngleAxisd(0.8, Vector3d::UnitZ()).matrix();
        const Vector3d axis(0.5, 0.5, 0);
        move_end(elements, R, axis - R * axis, x);
        return TetSolver(elements).solve(x, {}).energy;
    };
    const double fine = twisted(6, 18, 2);
    EXPECT_LT(std::abs(twisted(3, 9, 2) - fine),
              0.2 * std::abs(twisted(6, 18, 1) - fine));
    EXPECT_GT(twisted(3, 9, 1), twisted(6, 18, 1));
    EXPECT_GT(twisted(6, 18, 1), fine);
}

} // namespace cellwarp::core::bench
