// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/linear/conjugate_gradients.h"

#include <cmath>
#include <random>

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "octree/base/stop_scope.h"
#include "tests/support/dense_energy.h"
#include "tests/support/energy_checks.h"
#include "tests/support/random.h"

namespace cellwarp::core
{

using support::DensePreconditioner;
using support::Quadratic;

namespace
{

const std::vector<int> kSizes = {6, 1, 3, 6, 3, 1};
constexpr int kCount = 20;

Eigen::VectorXd random_numbers(std::mt19937& rng, int count)
{
    Eigen::VectorXd x(count);
    for (int i = 0; i < count; ++i)
        x[i] = support::random_number(rng, -1.0, 1.0);
    return x;
}

/// Eigenvalues from 1 to 20, in random directions.
Eigen::MatrixXd random_matrix(std::mt19937& rng)
{
    Eigen::MatrixXd M(kCount, kCount);
    for (int i = 0; i < kCount; ++i)
        M.col(i) = random_numbers(rng, kCount);
    const Eigen::MatrixXd Q = M.householderQr().householderQ();
    return Q * Eigen::VectorXd::LinSpaced(kCount, 1.0, kCount).asDiagonal() *
           Q.transpose();
}

/// What a multigrid in single precision does to an exact solution.
class RoundedPreconditioner final : public Preconditioner
{
public:
    explicit RoundedPreconditioner(const Eigen::MatrixXd& inverse)
        : inverse_(inverse.cast<float>())
    {
    }
    void apply(const Eigen::VectorXd& r, Eigen::VectorXd& z) override
    {
        const Eigen::VectorXf rounded = (r / r.norm()).cast<float>();
        z = r.norm() * (inverse_ * rounded).cast<double>();
    }

private:
    Eigen::MatrixXf inverse_;
};

struct System
{
    std::mt19937 rng;
    Eigen::MatrixXd A;
    Eigen::VectorXd b, x;
    Quadratic energy;
    DensePreconditioner identity{Eigen::MatrixXd::Identity(kCount, kCount)};
    ConjugateGradients conjugate_gradients;

    explicit System(unsigned seed, double factor = 1.0)
        : rng(seed), A(factor * random_matrix(rng)), b(random_numbers(rng, kCount)),
          energy(kSizes, A, b)
    {
        energy.linearise(kExact);
    }
    LinearReport solve(Preconditioner& preconditioner, double tolerance, int max_steps)
    {
        return conjugate_gradients.solve(energy.total, preconditioner, b,
                                         {.tolerance = tolerance, .max_steps = max_steps},
                                         x);
    }
};

} // namespace

TEST(DenseEnergy, has_the_derivatives_of_its_value)
{
    System s(1);
    s.energy.set_x(random_numbers(s.rng, kCount));
    support::check_energy(s.energy.total, s.rng);
}

TEST(ConjugateGradients, solve_what_eigen_solves_in_as_many_steps_as_unknowns)
{
    for (unsigned seed = 1; seed <= 5; ++seed)
    {
        System s(seed);
        const LinearReport report = s.solve(s.identity, 1e-10, 100);
        EXPECT_LE(report.steps, kCount);
        EXPECT_LE(report.residual, 1e-10);
        EXPECT_FALSE(report.has_negative_curvature);
        EXPECT_NEAR(report.residual, (s.b - s.A * s.x).norm() / s.b.norm(), 1e-12);
        EXPECT_LT((s.x - s.A.ldlt().solve(s.b)).norm(), 1e-9);
    }
}

TEST(ConjugateGradients, take_one_step_with_the_exact_inverse)
{
    System s(2);
    DensePreconditioner inverse(s.A.inverse());
    const LinearReport report = s.solve(inverse, 1e-10, 100);
    EXPECT_EQ(report.steps, 1);
    EXPECT_LT((s.x - s.A.ldlt().solve(s.b)).norm(), 1e-12);
}

TEST(ConjugateGradients, reach_double_precision_with_a_preconditioner_in_single)
{
    System s(3);
    RoundedPreconditioner inverse(s.A.inverse());
    const LinearReport report = s.solve(inverse, 1e-13, 100);
    EXPECT_LE(report.steps, 4);
    EXPECT_LT((s.x - s.A.ldlt().solve(s.b)).norm(), 1e-12);
}

TEST(ConjugateGradients, bear_a_preconditioner_that_is_never_the_same)
{
    /// The inverse, but for 15 % of other noise in each call.
    class Noisy final : public Preconditioner
    {
    public:
        explicit Noisy(const Eigen::MatrixXd& A) : inverse(A.inverse()) {}
        Eigen::MatrixXd inverse;
        std::mt19937 rng{1};
        void apply(const Eigen::VectorXd& r, Eigen::VectorXd& z) override
        {
            z = inverse * r;
            for (Eigen::Index i = 0; i < z.size(); ++i)
                z[i] *= support::random_number(rng, 0.85, 1.15);
        }
    };
    for (unsigned seed = 1; seed <= 5; ++seed)
    {
        System s(seed);
        Noisy noisy(s.A);
        const LinearReport report = s.solve(noisy, 1e-12, 100);
        EXPECT_LE(report.residual, 1e-12);
        EXPECT_LE(report.steps, 14);
    }
}

TEST(ConjugateGradients, end_as_soon_as_the_residual_is_small)
{
    System s(4);
    int last = 0;
    for (const double tolerance : {0.5, 0.1, 1e-3, 1e-6})
    {
        const LinearReport report = s.solve(s.identity, tolerance, 100);
        EXPECT_LE(report.residual, tolerance);
        EXPECT_GE(report.steps, last);
        last = report.steps;
        const LinearReport shorter = s.solve(s.identity, tolerance, report.steps - 1);
        EXPECT_GT(shorter.residual, tolerance);
    }
}

TEST(ConjugateGradients, end_at_negative_curvature_with_a_descent)
{
    for (unsigned seed = 1; seed <= 5; ++seed)
    {
        System s(seed);
        // Two directions of negative curvature among twenty.
        const Eigen::VectorXd bent = s.b.normalized() + random_numbers(s.rng, kCount);
        Quadratic saddle(kSizes, s.A - 30.0 * bent * bent.transpose(), s.b);
        saddle.linearise(kExact);
        const LinearReport report = s.conjugate_gradients.solve(
            saddle.total, s.identity, s.b, {.tolerance = 1e-10}, s.x);
        EXPECT_TRUE(report.has_negative_curvature);
        EXPECT_GT(s.x.dot(s.b), 0.0);
        EXPECT_TRUE(s.x.allFinite());
        EXPECT_LT(report.steps, kCount);
    }
}

TEST(ConjugateGradients, go_down_the_gradient_where_the_first_direction_curves_down)
{
    System s(5, -1.0);
    const LinearReport report = s.solve(s.identity, 1e-10, 100);
    EXPECT_TRUE(report.has_negative_curvature);
    EXPECT_EQ(report.steps, 1);
    EXPECT_EQ(s.x, s.b);
    EXPECT_EQ(report.residual, 1.0);
}

TEST(ConjugateGradients, go_as_far_as_a_trust_region_reaches)
{
    for (unsigned seed = 1; seed <= 5; ++seed)
    {
        System s(seed);
        const Eigen::MatrixXd M = random_matrix(s.rng);
        DensePreconditioner preconditioner(M.inverse());
        const auto solve = [&](double radius)
        {
            return s.conjugate_gradients.solve(s.energy.total, preconditioner, s.b,
                                               {.tolerance = 1e-12, .radius = radius},
                                               s.x);
        };
        const auto size = [&] { return std::sqrt(s.x.dot(M * s.x)); };
        const auto change = [&] { return s.x.dot(0.5 * s.A * s.x - s.b); };
        const LinearReport whole = solve(INFINITY);
        EXPECT_NEAR(whole.size, size(), 1e-9 * size());
        EXPECT_NEAR(whole.change, change(), 1e-9 * std::abs(change()));
        const Eigen::VectorXd solution = s.x;
        EXPECT_EQ(solve(1.01 * whole.size).size, whole.size);
        EXPECT_EQ(s.x, solution);
        double last = 0.0;
        for (const double share : {1e-3, 0.1, 0.5, 0.9, 0.999})
        {
            const LinearReport report = solve(share * whole.size);
            EXPECT_FALSE(report.has_negative_curvature);
            EXPECT_NEAR(size(), share * whole.size, 1e-6 * whole.size);
            EXPECT_NEAR(report.size, size(), 1e-6 * whole.size);
            EXPECT_NEAR(report.change, change(), 1e-9 * std::abs(whole.change));
            EXPECT_LT(report.change, last);
            last = report.change;
        }
        // A small one ends on the first direction, the preconditioned gradient.
        solve(1e-3 * whole.size);
        const Eigen::VectorXd first = M.inverse() * s.b;
        EXPECT_NEAR(s.x.dot(first), s.x.norm() * first.norm(), 1e-12);
    }
}

TEST(ConjugateGradients, know_a_size_well_enough_with_a_preconditioner_that_rounds)
{
    for (unsigned seed = 1; seed <= 5; ++seed)
    {
        System s(seed);
        const Eigen::MatrixXd M = random_matrix(s.rng);
        RoundedPreconditioner preconditioner(M.inverse());
        for (const double tolerance : {0.5, 0.1, 1e-3})
        {
            const LinearReport whole = s.conjugate_gradients.solve(
                s.energy.total, preconditioner, s.b, {.tolerance = tolerance}, s.x);
            EXPECT_NEAR(whole.size, std::sqrt(s.x.dot(M * s.x)), 1e-3 * whole.size);
            EXPECT_NEAR(whole.change, s.x.dot(0.5 * s.A * s.x - s.b),
                        1e-4 * std::abs(whole.change));
            s.conjugate_gradients.solve(
                s.energy.total, preconditioner, s.b,
                {.tolerance = tolerance, .radius = 0.7 * whole.size}, s.x);
            EXPECT_NEAR(std::sqrt(s.x.dot(M * s.x)), 0.7 * whole.size, 1e-3 * whole.size);
        }
    }
}

TEST(ConjugateGradients, follow_negative_curvature_to_the_end_of_a_trust_region)
{
    for (unsigned seed = 1; seed <= 5; ++seed)
    {
        System s(seed);
        const Eigen::VectorXd bent = s.b.normalized() + random_numbers(s.rng, kCount);
        const Eigen::MatrixXd A = s.A - 30.0 * bent * bent.transpose();
        Quadratic saddle(kSizes, A, s.b);
        saddle.linearise(kExact);
        double last = 0.0;
        for (const double radius : {0.1, 1.0, 10.0, 100.0})
        {
            const LinearReport report =
                s.conjugate_gradients.solve(saddle.total, s.identity, s.b,
                                            {.tolerance = 1e-10, .radius = radius}, s.x);
            EXPECT_TRUE(report.has_negative_curvature || radius < 10.0);
            EXPECT_NEAR(s.x.norm(), radius, 1e-9 * radius);
            EXPECT_NEAR(report.size, radius, 1e-9 * radius);
            EXPECT_LT(report.change, last);
            last = report.change;
        }
        // Without a minimum there is none to stop at: the change grows as the square.
        EXPECT_LT(last, -1e3);
    }
}

TEST(ConjugateGradients, answer_nothing_with_nothing)
{
    System s(6);
    s.solve(s.identity, 1e-3, 100);
    ASSERT_GT(s.x.norm(), 0.0);
    s.b.setZero();
    const LinearReport report = s.solve(s.identity, 1e-3, 100);
    EXPECT_EQ(report.steps, 0);
    EXPECT_EQ(report.residual, 0.0);
    EXPECT_EQ(s.x, Eigen::VectorXd::Zero(kCount));
}

TEST(ConjugateGradients, end_after_the_steps_they_are_given_nearer_each_time)
{
    System s(7);
    const Eigen::VectorXd solution = s.A.ldlt().solve(s.b);
    double last = solution.dot(s.A * solution);
    for (int steps = 1; steps <= 8; ++steps)
    {
        EXPECT_EQ(s.solve(s.identity, 1e-12, steps).steps, steps);
        const Eigen::VectorXd error = s.x - solution;
        EXPECT_LT(error.dot(s.A * error), last);
        last = error.dot(s.A * error);
    }
}

TEST(ConjugateGradients, end_on_request_with_what_they_have)
{
    /// Asks for the end while it works.
    class Stopping final : public Preconditioner
    {
    public:
        std::stop_source source;
        int calls = 0;
        void apply(const Eigen::VectorXd& r, Eigen::VectorXd& z) override
        {
            z = r;
            if (++calls == 4)
                source.request_stop();
        }
    };
    System s(8);
    Stopping stopping;
    {
        const StopOnRequest scope(stopping.source.get_token());
        const StopDeferral deferral; // as in Newton's method
        const LinearReport report = s.conjugate_gradients.solve(
            s.energy.total, stopping, s.b, {.tolerance = 1e-12}, s.x);
        EXPECT_EQ(report.steps, 3);
    }
    const Eigen::VectorXd stopped = s.x;
    s.solve(s.identity, 1e-12, 3);
    EXPECT_EQ(s.x, stopped);
}

TEST(ConjugateGradients, a_deadline_leaves_the_first_step)
{
    System s(9);
    const LinearReport report =
        s.conjugate_gradients.solve(s.energy.total, s.identity, s.b,
                                    {.tolerance = 1e-12, .deadline = Clock::now()}, s.x);
    EXPECT_EQ(report.steps, 1);
    EXPECT_GT(s.x.dot(s.b), 0.0);
}

} // namespace cellwarp::core
