// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/rods/spline_sheet.h"

#include <cmath>
#include <stdexcept>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "octree/base/rigid_motion.h"
#include "solver/dynamics/implicit_stepper.h"
#include "tests/support/rods.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

SheetShape sheet(int n = 6, int m = 5, int degree = 3)
{
    return {
        {0.1, 0.2, 0.3}, {{1, 0, 0}, {0.2, 0.8, 0}}, {n, m}, degree, 1e4, 0.01, 500.0};
}

SheetShape block(int degree = 3)
{
    return {
        {0, 0, 0}, {{0.4, 0, 0}, {0, 0.3, 0}, {0, 0.1, 0.5}}, {4, 5, 4}, degree, 1e4, 0.0,
        500.0};
}

/// x -> A x
void deform(SplineSheet& of, const Eigen::Matrix3d& A)
{
    for (int k = 0; k < of.num_controls(); ++k)
        of.x.segment<3>(3 * k) = A * of.x.segment<3>(3 * k);
}

} // namespace

TEST(SplineSheet, is_where_its_corner_and_sides_say)
{
    const SplineSheet of(sheet());
    for (const double a : {0.0, 0.3, 1.0})
        for (const double b : {0.0, 0.55, 1.0})
            EXPECT_LT((of.at({a, b, 0}) - Vector3d(0.1 + a + 0.2 * b, 0.2 + 0.8 * b, 0.3))
                          .norm(),
                      1e-14);
    const SplineSheet solid(block());
    EXPECT_LT((solid.at({0.3, 0.6, 0.2}) - Vector3d(0.12, 0.2, 0.1)).norm(), 1e-14);
    EXPECT_NEAR(of.mass(), 500.0 * 0.01 * 0.8, 1e-12);
    EXPECT_NEAR(solid.mass(), 500.0 * 0.4 * 0.3 * 0.5, 1e-12);
    SheetShape flat = sheet();
    flat.sides[1] = {2, 0, 0};
    EXPECT_THROW(SplineSheet{flat}, std::invalid_argument);
    SheetShape few = sheet();
    few.counts = {3, 5};
    EXPECT_THROW(SplineSheet{few}, std::invalid_argument);
}

TEST(SplineSheet, mass_goes_by_its_factors)
{
    for (const SheetShape& shape : {sheet(), sheet(7, 4, 2), block(), block(2)})
    {
        SplineSheet of(shape);
        for (int k = 0; k < of.num_controls(); ++k)
            of.velocity.segment<3>(3 * k) = Vector3d(1, 2, 3);
        EXPECT_NEAR(of.kinetic(), 7.0 * of.mass(), 1e-12 * of.mass());
        EXPECT_LT((of.momentum() - of.mass() * Vector3d(1, 2, 3)).norm(), 1e-12);
        // A turn about the origin, by the inertia of a parallelogram or box of even
        // density.
        for (int k = 0; k < of.num_controls(); ++k)
            of.velocity.segment<3>(3 * k) =
                Vector3d(0, 0, 1).cross(Vector3d(of.x.segment<3>(3 * k)));
        double square = 0.0;
        Vector3d middle = shape.corner;
        for (const Vector3d& side : shape.sides)
        {
            middle += 0.5 * side;
            square += side.head<2>().squaredNorm() / 12.0;
        }
        square += middle.head<2>().squaredNorm();
        EXPECT_NEAR(of.kinetic(), 0.5 * of.mass() * square, 1e-12);
        EXPECT_NEAR(of.angular_momentum().z(), of.mass() * square, 1e-12);
    }
}

TEST(SplineSheet, energy_is_zero_at_rest_and_that_of_an_even_material)
{
    for (const SheetShape& shape : {sheet(), block()})
    {
        SplineSheet of(shape);
        EXPECT_NEAR(of.elastic(), 0.0, 1e-20);
        deform(of, rotation_about(Vector3d(1, 2, 3).normalized(), 1.0));
        EXPECT_NEAR(of.elastic(), 0.0, 1e-18);
    }
    // Pulled along one side, drawn in by Poisson's ratio: 1/2 E V eps^2.
    constexpr double eps = 1e-4;
    SplineSheet even({{0, 0, 0}, {{1, 0, 0}, {0, 1, 0}}, {7, 7}, 3, 1e4, 0.01, 500.0});
    deform(even, Vector3d(1 + eps, 1 - eps / 3.0, 1).asDiagonal());
    EXPECT_NEAR(even.elastic() / (0.5 * 1e4 * 0.01 * eps * eps), 1.0, 2e-3);
    SplineSheet cube(
        {{0, 0, 0}, {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {6, 6, 6}, 3, 1e4, 0.0, 500.0});
    deform(cube, Vector3d(1 - eps / 4.0, 1 + eps, 1 - eps / 4.0).asDiagonal());
    EXPECT_NEAR(cube.elastic() / (0.5 * 1e4 * eps * eps), 1.0, 2e-3);
    // Sheared within its plane: G = E / (2 (1 + nu)).
    SplineSheet sheared({{0, 0, 0}, {{1, 0, 0}, {0, 1, 0}}, {7, 7}, 3, 1e4, 0.01, 500.0});
    Eigen::Matrix3d shear = Eigen::Matrix3d::Identity();
    shear(0, 1) = eps;
    deform(sheared, shear);
    EXPECT_NEAR(sheared.elastic() / (0.5 * 3.0 / 8.0 * 1e4 * 0.01 * eps * eps), 1.0,
                2e-3);
}

TEST(SplineSheet, derivatives_are_those_of_differences)
{
    for (const SheetShape& shape : {sheet(), sheet(5, 4, 2), block()})
    {
        SplineSheet of(shape);
        of.gravity = {1, -9, 2};
        of.viscosity = 0.3;
        of.damping = 4e-3;
        std::mt19937 rng(5);
        of.velocity = support::random_step(of.num_unknowns(), 1.0, rng);
        of.start(1e-3);
        of.x += support::random_step(of.num_unknowns(), 1e-3, rng);
        ArticulableObject::Measure here;
        Eigen::VectorXd gradient;
        of.linearise(gradient, here);
        const Eigen::VectorXd x = of.x;
        const auto value = [&](const Eigen::VectorXd& at)
        {
            of.x = at;
            of.measure(false, here);
            return here.value;
        };
        for (int k = 0; k < of.num_unknowns(); k += 7)
        {
            const Eigen::VectorXd unit = Eigen::VectorXd::Unit(x.size(), k);
            EXPECT_NEAR((value(x + 1e-6 * unit) - value(x - 1e-6 * unit)) / 2e-6,
                        gradient[k], 1e-6 * gradient.norm());
        }
        // The solve undoes the change of the gradient.
        of.x = x;
        int level = 0;
        of.factorize({}, level); // no rows, no multipliers
        EXPECT_EQ(level, 0);
        const Eigen::VectorXd y = support::random_step(of.num_unknowns(), 1.0, rng);
        Eigen::VectorXd more, less, none;
        of.x = x + 1e-6 * y;
        of.linearise(more, here);
        of.x = x - 1e-6 * y;
        of.linearise(less, here);
        Eigen::VectorXd back = (more - less) / 2e-6;
        of.solve(back, none);
        EXPECT_LT((back - y).norm(), 1e-4 * y.norm());
    }
}

TEST(SplineSheet, hangs_from_its_corners_and_falls_as_everything_does)
{
    SplineSheet free(sheet());
    free.gravity = {0, -10, 0};
    const double before = free.at({0.5, 0.5, 0}).y();
    ImplicitStepper falls({&free});
    for (int k = 0; k < 50; ++k)
        EXPECT_EQ(falls.step(0.01).stop, MotionStop::Converged);
    EXPECT_NEAR(before - free.at({0.5, 0.5, 0}).y(), 10.0 * 0.5 * 0.51 / 2.0, 1e-9);
    EXPECT_NEAR(free.elastic(), 0.0, 1e-12);
    for (const bool is_block : {false, true})
    {
        SplineSheet of(is_block ? SheetShape{{0, 0, 0},
                                             {{0.2, 0, 0}, {0, 0.2, 0}, {0, 0, 0.6}},
                                             {4, 4, 6},
                                             3,
                                             1e5,
                                             0,
                                             500}
                                : SheetShape{{-0.5, 0, -0.5},
                                             {{1, 0, 0}, {0, 0, 1}},
                                             {6, 6},
                                             3,
                                             1e5,
                                             0.002,
                                             500});
        of.gravity = {0, -10, 0};
        of.viscosity = 3.0;
        for (const double a : {0.0, 1.0})
            for (const double b : {0.0, 1.0})
                of.fix({a, b, 0});
        const Vector3d corner = of.at({1, 1, 0});
        ImplicitStepper stepper({&of});
        for (int k = 0; k < 300; ++k)
            ASSERT_EQ(stepper.step(0.01).stop, MotionStop::Converged);
        EXPECT_LT((of.at({1, 1, 0}) - corner).norm(), 1e-10);
        EXPECT_LT(of.at(is_block ? SheetPlace{0.5, 0.5, 1} : SheetPlace{0.5, 0.5, 0}).y(),
                  is_block ? 0.099 : -0.02);
        if (!is_block)
        {
            // Alike on all sides.
            EXPECT_NEAR(of.at({0.5, 0.1, 0}).y(), of.at({0.5, 0.9, 0}).y(), 1e-5);
            EXPECT_NEAR(of.at({0.5, 0.1, 0}).y(), of.at({0.1, 0.5, 0}).y(), 1e-5);
        }
    }
}

TEST(SplineSheet, slides_over_a_point_until_an_edge_comes)
{
    SplineSheet of({{-0.5, 0, -0.5}, {{1, 0, 0}, {0, 0, 1}}, {6, 6}, 3, 1e5, 0.002, 500});
    of.gravity = {0, -10, 0};
    of.viscosity = 2.0;
    of.fix({0, 0, 0});
    of.fix({0, 1, 0});
    const Vector3d nail(0.2, 0, 0.03);
    of.slide_over(nail);
    EXPECT_NEAR(of.sliding(0)[0], 0.7, 1e-9);
    EXPECT_NEAR(of.sliding(0)[1], 0.53, 1e-9);
    ImplicitStepper stepper({&of});
    double last = 0.69;
    int slid = 0;
    for (int k = 0; k < 200; ++k)
    {
        ASSERT_EQ(stepper.step(0.005).stop, MotionStop::Converged) << k;
        if (of.has_left(0))
            continue;
        EXPECT_LT(of.own_violation(), 1e-9);
        EXPECT_LT((of.at(of.sliding(0)) - nail).norm(), 1e-5);
        EXPECT_GT(of.sliding(0)[0], last);
        last = of.sliding(0)[0] - 1e-3;
        ++slid;
    }
    EXPECT_GT(slid, 50);
    EXPECT_TRUE(of.has_left(0));
    EXPECT_LT(of.at({1, 0.5, 0}).y(), -0.1);
    SplineSheet solid(block());
    EXPECT_THROW(solid.slide_over({0, 0, 0}), std::invalid_argument);
}

} // namespace cellwarp::core
