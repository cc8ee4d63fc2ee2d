// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/minimize/newton.h"

#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <thread>

#include <gtest/gtest.h>

#include "octree/base/stop_scope.h"
#include "tests/support/dense_energy.h"
#include "tests/support/energy_checks.h"
#include "tests/support/random.h"

namespace cellwarp::core
{

using support::DenseEnergy;
using support::DensePreconditioner;

namespace
{

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// A chain of points (blocks of 3) with an angle each (blocks of 1): every link d is to
/// be one long and to lie along (cos, sin, 0) of the angle before it; angles are to grow
/// by a curl. It begins at the origin and its end is drawn to a target, against all that.
class Chain final : public DenseEnergy
{
public:
    explicit Chain(int links, double pull = 2.0)
        : DenseEnergy(sizes(links), straight(links)), links_(links), pull_(pull)
    {
    }
    double offset = 0.0; ///< a constant that hides the rest behind its rounding

    double value() const override
    {
        double sum = 0.0;
        for (int i = 0; i < links_; ++i)
            sum += link(x(), i).residual.squaredNorm();
        sum += pull_ * (x().segment<3>(4 * (links_ - 1)) - target()).squaredNorm();
        return offset + 0.5 * sum;
    }

protected:
    Eigen::VectorXd gradient_at(const Eigen::VectorXd& x) const override
    {
        Eigen::VectorXd gradient = Eigen::VectorXd::Zero(x.size());
        for (int i = 0; i < links_; ++i)
        {
            const Link part = link(x, i);
            add(i, part.J.transpose() * part.residual, gradient);
        }
        const Eigen::Index end = 4 * (links_ - 1);
        gradient.segment<3>(end) += pull_ * (x.segment<3>(end) - target());
        return gradient;
    }
    Eigen::MatrixXd hessian_at(const Eigen::VectorXd& x,
                               Curvature curvature) const override
    {
        // One link more before the first: its point and angle do not move.
        const Eigen::Index n = x.size();
        Eigen::MatrixXd H = Eigen::MatrixXd::Zero(n + 4, n + 4);
        for (int i = 0; i < links_; ++i)
        {
            const Link part = link(x, i);
            H.block<8, 8>(4 * i, 4 * i) +=
                part.J.transpose() * part.J + curvature.share * part.curvature;
        }
        H.block<3, 3>(n, n).diagonal().array() += pull_;
        return H.bottomRightCorner(n, n);
    }

private:
    using Vector8 = Eigen::Matrix<double, 8, 1>;

    /// Residuals of a link in point, angle, next point and next angle.
    struct Link
    {
        Eigen::Matrix<double, 5, 1> residual;
        Eigen::Matrix<double, 5, 8> J;
        Eigen::Matrix<double, 8, 8> curvature;
    };

    static std::vector<int> sizes(int links)
    {
        std::vector<int> sizes;
        for (int i = 0; i < links; ++i)
        {
            sizes.push_back(3);
            sizes.push_back(1);
        }
        return sizes;
    }
    static Eigen::VectorXd straight(int links)
    {
        Eigen::VectorXd x = Eigen::VectorXd::Zero(4 * links);
        for (int i = 0; i < links; ++i)
            x[4 * i] = i + 1.0;
        return x;
    }
    Eigen::Vector3d target() const { return {0.3 * links_, 0.5 * links_, 0.4 * links_}; }

    static Link link(const Eigen::VectorXd& x, int i)
    {
        constexpr double kCurl = 0.2;
        Vector8 u = Vector8::Zero();
        if (i > 0)
            u.head<4>() = x.segment<4>(4 * (i - 1));
        u.tail<4>() = x.segment<4>(4 * i);
        const Eigen::Vector3d d = u.segment<3>(4) - u.segment<3>(0);
        const double length = d.norm(), c = std::cos(u[3]), s = std::sin(u[3]);
        Link link;
        link.residual << length - 1.0, d.x() - c, d.y() - s, d.z(), u[7] - u[3] - kCurl;
        link.J.setZero();
        link.J.block<1, 3>(0, 4) = d.transpose() / length;
        link.J.block<3, 3>(1, 4).setIdentity();
        link.J.block<4, 3>(0, 0) = -link.J.block<4, 3>(0, 4);
        link.J(1, 3) = s;
        link.J(2, 3) = -c;
        link.J(4, 3) = -1.0;
        link.J(4, 7) = 1.0;
        const Eigen::Matrix3d across =
            link.residual[0] / length *
            (Eigen::Matrix3d::Identity() - d * d.transpose() / (length * length));
        link.curvature.setZero();
        link.curvature.block<3, 3>(0, 0) = link.curvature.block<3, 3>(4, 4) = across;
        link.curvature.block<3, 3>(0, 4) = link.curvature.block<3, 3>(4, 0) = -across;
        link.curvature(3, 3) = link.residual[1] * c + link.residual[2] * s;
        return link;
    }
    static void add(int i, const Vector8& part, Eigen::VectorXd& sum)
    {
        if (i > 0)
            sum.segment<4>(4 * (i - 1)) += part.head<4>();
        sum.segment<4>(4 * i) += part.tail<4>();
    }

    int links_;
    double pull_;
};

/// One number, with the value and the derivatives that a test gives it.
class OneNumber final : public DenseEnergy
{
public:
    using Function = std::function<double(double)>;
    OneNumber(double x, Function value, Function slope, Function curvature)
        : DenseEnergy({1}, Eigen::VectorXd::Constant(1, x)), value_(std::move(value)),
          slope_(std::move(slope)), curvature_(std::move(curvature))
    {
    }
    double value() const override { return value_(x()[0]); }
    void add_rounding(std::span<double>) const override {}

protected:
    Eigen::VectorXd gradient_at(const Eigen::VectorXd& x) const override
    {
        return Eigen::VectorXd::Constant(1, slope_(x[0]));
    }
    Eigen::MatrixXd hessian_at(const Eigen::VectorXd& x, Curvature) const override
    {
        return Eigen::MatrixXd::Constant(1, 1, curvature_(x[0]));
    }

private:
    Function value_, slope_, curvature_;
};

/// A function f(u) that a test gives, with its derivatives, beside a stiff number w:
/// f(u) + 50 w^2. Tells how it was linearised; without the curvature of residuals f has
/// that of 1.
class BesideStiff final : public DenseEnergy
{
public:
    using Function = OneNumber::Function;
    BesideStiff(double u, double w, Function value, Function slope, Function curvature)
        : DenseEnergy({1, 1}, Eigen::Vector2d(u, w)), value_(std::move(value)),
          slope_(std::move(slope)), curvature_(std::move(curvature))
    {
    }
    double value() const override { return value_(x()[0]) + 50.0 * x()[1] * x()[1]; }
    void linearise(Curvature curvature) override
    {
        shares.push_back(curvature.share);
        DenseEnergy::linearise(curvature);
    }
    std::vector<double> shares; ///< of the curvature of residuals

protected:
    Eigen::VectorXd gradient_at(const Eigen::VectorXd& x) const override
    {
        return Eigen::Vector2d(slope_(x[0]), 100.0 * x[1]);
    }
    Eigen::MatrixXd hessian_at(const Eigen::VectorXd& x,
                               Curvature curvature) const override
    {
        return Eigen::Vector2d(1.0 + curvature.share * (curvature_(x[0]) - 1.0), 100.0)
            .asDiagonal();
    }

private:
    Function value_, slope_, curvature_;
};

SolveReport minimized(DenseEnergy& energy, const SolveOptions& options)
{
    const Eigen::Index n = energy.x().size();
    DensePreconditioner identity(Eigen::MatrixXd::Identity(n, n));
    return NewtonSolver(energy.total, identity).minimize(options);
}

constexpr Method kMethods[] = {Method::Newton, Method::GaussNewton,
                               Method::GaussNewtonDirect};

} // namespace

TEST(Newton, is_tested_with_a_chain_that_has_the_derivatives_of_its_value)
{
    std::mt19937 rng(1);
    Chain chain(4);
    for (int trial = 0; trial < 5; ++trial)
    {
        Eigen::VectorXd x = chain.x();
        for (Eigen::Index i = 0; i < x.size(); ++i)
            x[i] += support::random_number(rng, -0.5, 0.5);
        chain.set_x(x);
        support::check_energy(chain.total, rng);
    }
}

TEST(Newton, all_methods_find_the_same_minimum)
{
    Eigen::VectorXd first;
    for (const Method method : kMethods)
    {
        Chain chain(8);
        const SolveReport report =
            minimized(chain, {.method = method, .gradient_tolerance = 1e-11});
        EXPECT_EQ(report.stop, Stop::Converged);
        EXPECT_LE(report.gradient, 1e-11);
        EXPECT_LT(report.energy_after, report.energy_before);
        EXPECT_EQ(report.energy_after, chain.value());
        EXPECT_EQ(report.linear_steps > 0, method != Method::GaussNewtonDirect);
        EXPECT_EQ(report.backward_error > 0, method == Method::GaussNewtonDirect);
        EXPECT_LE(report.backward_error, 1e-13);
        if (first.size() == 0)
            first = chain.x();
        EXPECT_LT((chain.x() - first).norm(), 1e-9);
        RecordProperty("iterations_" + std::to_string(static_cast<int>(method)),
                       report.iterations);
    }
}

TEST(Newton, the_last_digits_cost_few_iterations_with_all_curvature)
{
    const auto iterations = [](Method method, double tolerance)
    {
        Chain chain(8);
        const SolveReport report =
            minimized(chain, {.method = method, .gradient_tolerance = tolerance});
        EXPECT_EQ(report.stop, Stop::Converged);
        return report.iterations;
    };
    // Of order 3/2 at least, by how well the linear systems are solved.
    EXPECT_LE(iterations(Method::Newton, 1e-12), iterations(Method::Newton, 1e-4) + 3);
    // Residuals that stay leave the others linear.
    EXPECT_GT(iterations(Method::GaussNewtonDirect, 1e-12),
              iterations(Method::GaussNewtonDirect, 1e-4) + 3);
}

TEST(Newton, goes_on_where_a_small_force_is_a_long_way_from_the_end)
{
    // The second number is soft: its force hardly counts.
    const Eigen::MatrixXd A = Eigen::Vector2d(1e4, 1e-4).asDiagonal();
    const Eigen::Vector2d end(1.0, 100.0);
    const auto distance_left = [&](double place_tolerance)
    {
        support::Quadratic energy({1, 1}, A, A * end);
        DensePreconditioner plain(Eigen::MatrixXd::Identity(2, 2));
        NewtonSolver solver(energy.total, plain);
        const SolveReport report = solver.minimize(
            {.gradient_tolerance = 1e-3, .place_tolerance = place_tolerance});
        EXPECT_EQ(report.stop, Stop::Converged);
        return (energy.x() - end).norm();
    };
    EXPECT_GT(distance_left(INFINITY), 1.0);
    EXPECT_LT(distance_left(1e-3), 1e-3);
    EXPECT_LT(distance_left(1e-9), 1e-9);
}

TEST(Newton, gradients_fall_faster_and_faster)
{
    Chain chain(8);
    Eigen::VectorXd gradient;
    chain.total.gradient(gradient);
    const double scale = gradient.norm();
    std::vector<double> sizes;
    for (SolveReport report; report.stop != Stop::Converged && sizes.size() < 50;)
    {
        report = minimized(
            chain,
            {.max_iterations = 1, .gradient_tolerance = 1e-12, .gradient_scale = scale});
        EXPECT_LE(report.iterations, 1);
        sizes.push_back(report.gradient);
    }
    ASSERT_GE(sizes.size(), 4u);
    ASSERT_LT(sizes.size(), 20u);
    for (std::size_t k = 1; k < sizes.size(); ++k)
        if (sizes[k - 1] < 1e-3 && sizes[k] > 1e-13)
        {
            EXPECT_LT(sizes[k], 10.0 * std::pow(sizes[k - 1], 1.5));
        }
}

TEST(Newton, at_the_minimum_there_is_nothing_to_do)
{
    Chain chain(4);
    minimized(chain, {.gradient_tolerance = 0.0});
    const Eigen::VectorXd found = chain.x();
    const SolveReport report = minimized(chain, {.gradient_tolerance = 0.0});
    EXPECT_EQ(report.stop, Stop::Converged);
    EXPECT_EQ(report.iterations, 0);
    EXPECT_EQ(report.linear_steps, 0);
    EXPECT_EQ(chain.x(), found);
}

TEST(Newton, ends_at_the_limit_of_iterations)
{
    for (const int limit : {0, 1, 2})
    {
        Chain chain(8);
        const SolveReport report = minimized(chain, {.max_iterations = limit});
        EXPECT_EQ(report.stop, Stop::IterationLimit);
        EXPECT_EQ(report.iterations, limit);
        EXPECT_EQ(report.energy_after, chain.value());
        EXPECT_EQ(report.energy_after<report.energy_before, limit> 0);
    }
}

TEST(Newton, ends_when_its_time_is_over_with_the_best_found)
{
    const auto slow = [](double t)
    {
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
        return std::pow(t, 6);
    };
    OneNumber energy(
        1.0, slow, [](double t) { return 6.0 * std::pow(t, 5); },
        [](double t) { return 30.0 * std::pow(t, 4); });
    const SolveReport report =
        minimized(energy, {.gradient_tolerance = 1e-30, .time_budget = 0.03});
    EXPECT_EQ(report.stop, Stop::TimeLimit);
    EXPECT_GE(report.iterations, 1);
    EXPECT_LE(report.iterations, 3);
    EXPECT_LT(report.energy_after, report.energy_before);
}

TEST(Newton, ends_on_request_with_the_best_found)
{
    std::stop_source source;
    int calls = 0;
    OneNumber energy(
        1.0,
        [&](double t)
        {
            if (++calls == 3)
                source.request_stop();
            return std::pow(t, 6);
        },
        [](double t) { return 6.0 * std::pow(t, 5); },
        [](double t) { return 30.0 * std::pow(t, 4); });
    SolveReport report;
    {
        const StopOnRequest scope(source.get_token());
        report = minimized(energy, {});
    }
    EXPECT_EQ(report.stop, Stop::Stopped);
    EXPECT_EQ(report.iterations, 2);
    EXPECT_LT(report.energy_after, report.energy_before);
    EXPECT_EQ(minimized(energy, {}).stop, Stop::Converged);
}

TEST(Newton, a_slope_that_lies_is_no_descent)
{
    OneNumber energy(
        1.0, [](double t) { return -t; }, [](double) { return 1.0; },
        [](double) { return 1.0; });
    for (const Method method : kMethods)
    {
        const SolveReport report = minimized(energy, {.method = method});
        EXPECT_EQ(report.stop, Stop::NoDescent);
        EXPECT_EQ(report.iterations, 0);
        EXPECT_EQ(energy.x()[0], 1.0);
        EXPECT_EQ(report.energy_after, report.energy_before);
    }
}

TEST(Newton, tells_when_no_damping_makes_a_factor)
{
    OneNumber flat(
        1.0, [](double t) { return t; }, [](double) { return 1.0; },
        [](double) { return 0.0; });
    const SolveReport report = minimized(flat, {.method = Method::GaussNewtonDirect});
    EXPECT_EQ(report.stop, Stop::NotPositiveDefinite);
    EXPECT_GT(report.damped_factorisations, 0);
    EXPECT_EQ(flat.x()[0], 1.0);
    EXPECT_EQ(stop_name(report.stop), "no descent");
}

TEST(Newton, what_is_not_finite_never_passes_for_a_solution)
{
    const double nan = std::numeric_limits<double>::quiet_NaN();
    for (const double bad : {nan, kInfinity, -kInfinity})
        for (const Method method : kMethods)
        {
            OneNumber no_value(
                1.0, [=](double) { return bad; }, [](double t) { return t; },
                [](double) { return 1.0; });
            OneNumber no_slope(
                1.0, [](double t) { return t; }, [=](double) { return bad; },
                [](double) { return 1.0; });
            OneNumber no_curvature(
                1.0, [](double t) { return 0.5 * t * t; }, [](double t) { return t; },
                [=](double) { return bad; });
            EXPECT_EQ(minimized(no_value, {.method = method}).stop,
                      Stop::NotPositiveDefinite);
            EXPECT_EQ(minimized(no_slope, {.method = method}).stop,
                      Stop::NotPositiveDefinite);
            // The gradient alone may lead there; then it is one.
            const SolveReport report =
                minimized(no_curvature, {.method = method, .max_iterations = 3});
            EXPECT_TRUE(report.stop != Stop::Converged || no_curvature.x()[0] == 0.0);
            EXPECT_TRUE(no_curvature.x().allFinite());
        }
}

TEST(Newton, steps_out_of_where_the_value_is_defined_are_halved)
{
    // Newton's step from above 2 ends below 0, where the logarithm is no number.
    OneNumber energy(
        3.5, [](double t) { return t - std::log(t); },
        [](double t) { return 1.0 - 1.0 / t; }, [](double t) { return 1.0 / (t * t); });
    const SolveReport report = minimized(energy, {.gradient_tolerance = 1e-12});
    EXPECT_EQ(report.stop, Stop::Converged);
    EXPECT_NEAR(energy.x()[0], 1.0, 1e-11);
}

TEST(Newton, leaves_a_saddle_or_tells_of_it)
{
    // (t^2 - 1)^2 curves down at its middle.
    const auto saddle = [](double t)
    {
        return OneNumber(
            t, [](double u) { return (u * u - 1.0) * (u * u - 1.0); },
            [](double u) { return 4.0 * u * (u * u - 1.0); },
            [](double u) { return 12.0 * u * u - 4.0; });
    };
    const SolveOptions options = {.gradient_tolerance = 1e-12, .checks_stability = true};
    OneNumber energy = saddle(0.1);
    SolveReport report = minimized(energy, options);
    EXPECT_EQ(report.stop, Stop::Converged);
    EXPECT_FALSE(report.is_saddle);
    EXPECT_NEAR(energy.x()[0], 1.0, 1e-10);
    // Where the gradient is zero nothing leads away.
    OneNumber middle = saddle(0.0);
    report = minimized(middle, options);
    EXPECT_EQ(report.stop, Stop::Converged);
    EXPECT_TRUE(report.is_saddle);
    EXPECT_FALSE(minimized(middle, {}).is_saddle);
}

TEST(Newton, begins_without_the_curvature_of_residuals_where_that_is_negative)
{
    // 1 - cos u, which would round near 0 if it were written so.
    const auto wave = [](double at)
    {
        return BesideStiff(
            at, 0.01,
            [](double u) { return 2.0 * std::sin(0.5 * u) * std::sin(0.5 * u); },
            [](double u) { return std::sin(u); }, [](double u) { return std::cos(u); });
    };
    const SolveOptions options = {.gradient_tolerance = 1e-9};
    BesideStiff above = wave(2.0);
    EXPECT_EQ(minimized(above, options).stop, Stop::Converged);
    ASSERT_GE(above.shares.size(), 4u);
    above.shares.resize(4);
    EXPECT_EQ(above.shares, (std::vector<double>{1.0, 0.0, 0.0, 1.0}));
    EXPECT_NEAR(above.x().norm(), 0.0, 1e-8);

    BesideStiff below = wave(1.0);
    EXPECT_EQ(minimized(below, options).stop, Stop::Converged);
    EXPECT_EQ(below.shares, std::vector<double>(below.shares.size(), 1.0));

    // Who may not leave what is stable must see it.
    SolveOptions stable = options;
    stable.stays_stable = true;
    BesideStiff unstable = wave(2.0);
    EXPECT_EQ(minimized(unstable, stable).stop, Stop::NoDescent);
    EXPECT_EQ(unstable.x()[0], 2.0);
}

TEST(Newton, a_step_that_was_too_long_does_not_hold_back_what_is_stiff)
{
    // sqrt(1 + u^2) is nearly straight far out: each step is much too long.
    const auto stiff_part_after = [](int iterations, bool stays_stable)
    {
        BesideStiff energy(
            10.0, 0.01, [](double u) { return std::hypot(1.0, u); },
            [](double u) { return u / std::hypot(1.0, u); },
            [](double u) { return std::pow(1.0 + u * u, -1.5); });
        SolveOptions options{.max_iterations = iterations, .gradient_tolerance = 1e-12};
        options.stays_stable = stays_stable;
        minimized(energy, options);
        return std::abs(energy.x()[1]);
    };
    EXPECT_GT(stiff_part_after(1, false), 0.95 * 0.01); // so much was it shortened
    EXPECT_LT(stiff_part_after(2, false), 0.6 * 0.01);
    // Without a trust region the second step is shortened as a whole, too.
    EXPECT_GT(stiff_part_after(2, true), 0.9 * 0.01);
}

TEST(Newton, a_trust_region_so_small_that_rounding_hides_it_ends_nothing)
{
    // Beside 1e15 what a step within the second region would bring is rounding.
    BesideStiff energy(
        3e3, 0.0, [](double u) { return 1e15 + std::hypot(1.0, u); },
        [](double u) { return u / std::hypot(1.0, u); },
        [](double u) { return std::pow(1.0 + u * u, -1.5); });
    EXPECT_EQ(minimized(energy, {.gradient_tolerance = 1e-6}).stop, Stop::Converged);
    EXPECT_LT(std::abs(energy.x()[0]), 10.0); // it was 3e3, and is 2e2 in the second
}

TEST(Newton, a_solve_of_few_iterations_begins_with_all_curvature)
{
    BesideStiff energy(
        2.0, 0.01, [](double u) { return 2.0 * std::sin(0.5 * u) * std::sin(0.5 * u); },
        [](double u) { return std::sin(u); }, [](double u) { return std::cos(u); });
    minimized(energy, {.max_iterations = 1, .gradient_tolerance = 1e-9});
    EXPECT_EQ(energy.shares, std::vector<double>{1.0});
}

TEST(Newton, a_tolerance_of_zero_ends_where_rounding_does)
{
    for (const Method method : kMethods)
    {
        Chain chain(8);
        const SolveReport report =
            minimized(chain, {.method = method, .gradient_tolerance = 0.0});
        EXPECT_EQ(report.stop, Stop::Converged);
        EXPECT_LT(report.gradient, 1e-14);
        EXPECT_LT(report.iterations, 60);
    }
}

TEST(Newton, goes_on_by_the_gradient_where_rounding_hides_the_decrease)
{
    for (const double offset : {0.0, 1e4, 1e8, -1e4, -1e8})
    {
        Chain chain(8);
        chain.offset = offset;
        const SolveReport report = minimized(chain, {.gradient_tolerance = 1e-12});
        EXPECT_EQ(report.stop, Stop::Converged) << offset;
        EXPECT_LT(report.gradient, 1e-11) << offset;
        EXPECT_LT(report.iterations, 20) << offset;
    }
}

TEST(Newton, tells_the_memory_of_a_factor_before_it_makes_one)
{
    Chain chain(8);
    DensePreconditioner identity(Eigen::MatrixXd::Identity(32, 32));
    NewtonSolver solver(chain.total, identity);
    EXPECT_GE(solver.factor_bytes(), 8.0 * 32 * 33 / 2);
    EXPECT_LE(solver.factor_bytes(), 8.0 * 32 * 32);
}

TEST(Newton, serves_many_solves)
{
    Chain chain(8);
    DensePreconditioner identity(Eigen::MatrixXd::Identity(32, 32));
    NewtonSolver solver(chain.total, identity);
    const Eigen::VectorXd start = chain.x();
    Eigen::VectorXd first;
    for (const Method method :
         {Method::Newton, Method::GaussNewtonDirect, Method::Newton})
    {
        chain.set_x(start);
        EXPECT_EQ(solver.minimize({.method = method, .gradient_tolerance = 1e-11}).stop,
                  Stop::Converged);
        if (first.size() == 0)
            first = chain.x();
        EXPECT_LT((chain.x() - first).norm(), 1e-9);
    }
    EXPECT_EQ(chain.x(), first);
}

} // namespace cellwarp::core
