// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/rods/spline.h"

#include <numbers>
#include <random>

#include <gtest/gtest.h>

#include "octree/base/index.h"
#include "tests/support/rods.h"

namespace cellwarp::core
{

namespace
{

std::vector<Eigen::Vector3d> random_points(int count, unsigned seed)
{
    std::mt19937 rng(seed);
    std::normal_distribution<double> normal(0.0, 0.3);
    std::vector<Eigen::Vector3d> points;
    for (int k = 0; k < count; ++k)
        points.emplace_back(k + normal(rng), normal(rng), normal(rng));
    return points;
}

std::vector<Spline> splines()
{
    std::vector<Spline> all;
    for (int degree = 1; degree <= 5; ++degree)
    {
        all.push_back({SplineBasis::open(degree, SplineBasis::clamped_knots(degree, 9)),
                       random_points(9, 1)});
        all.push_back({SplineBasis::open(degree, SplineBasis::uniform_knots(degree, 9)),
                       random_points(9, 2)});
        std::vector<double> turn = {0.0, 1.0, 1.5, 2.5, 4.0, 5.0, 6.0, 6.2, 7.0, 8.0};
        all.push_back({SplineBasis::closed(degree, turn), random_points(9, 3)});
    }
    all.push_back(catmull_rom(random_points(9, 4), false));
    all.push_back(catmull_rom(random_points(9, 5), true));
    all.push_back(bezier(random_points(10, 6)));
    all.push_back(bezier(random_points(5, 7)));
    return all;
}

} // namespace

TEST(Spline, functions_sum_to_one_and_their_derivatives_are_those_of_differences)
{
    for (const Spline& spline : splines())
        for (const SplineSpan& span : spline.basis.spans())
            for (const double share : {0.1, 0.45, 0.9})
            {
                const double s = span.begin + share * span.length(), h = 1e-5;
                const BasisValues values = spline.basis.values(s);
                double sum = 0.0;
                for (int j = 0; j < values.count; ++j)
                    sum += values.value[0][idx(j)];
                EXPECT_NEAR(sum, 1.0, 1e-14);
                const CurvePoint at = spline.at(s), ahead = spline.at(s + h),
                                 behind = spline.at(s - h);
                EXPECT_LT((at.first - (ahead.place - behind.place) / (2 * h)).norm(),
                          1e-8);
                EXPECT_LT((at.second - (ahead.first - behind.first) / (2 * h)).norm(),
                          1e-7);
            }
}

TEST(Spline, knots_come_in_without_moving_the_curve)
{
    for (const Spline& spline : splines())
    {
        for (const double share : {0.0, 0.31, 0.5, 0.77})
        {
            const double begin = spline.basis.begin(), end = spline.basis.end();
            const Spline finer = with_knot(spline, begin + share * (end - begin) + 1e-3);
            EXPECT_EQ(finer.controls.size(), spline.controls.size() + 1);
            for (double x = 0.005; x < 1.0; x += 0.01)
            {
                const double s = begin + x * (end - begin);
                EXPECT_LT((finer.at(s).place - spline.at(s).place).norm(), 2e-14);
            }
        }
    }
}

TEST(Spline, is_refined_without_moving)
{
    for (const Spline& spline : splines())
    {
        const Spline finer = refined(spline, 3);
        EXPECT_EQ(finer.basis.spans().size(), 3 * spline.basis.spans().size());
        const double begin = spline.basis.begin(), end = spline.basis.end();
        EXPECT_EQ(finer.basis.begin(), begin);
        EXPECT_EQ(finer.basis.end(), end);
        for (double x = 0.005; x < 1.0; x += 0.01)
        {
            const double s = begin + x * (end - begin);
            EXPECT_LT((finer.at(s).place - spline.at(s).place).norm(), 2e-14);
        }
    }
}

TEST(Spline, a_knot_that_was_put_in_comes_out_again)
{
    for (const bool is_closed : {false, true})
    {
        const Spline spline =
            is_closed ? Spline{SplineBasis::closed(3, std::vector<double>{0, 1, 2.5, 3, 4,
                                                                          5, 6, 7, 8, 9}),
                               random_points(9, 1)}
                      : Spline{SplineBasis::open(3, SplineBasis::clamped_knots(3, 9)),
                               random_points(9, 1)};
        for (const double s : {0.3, 2.4, 5.9})
        {
            const Spline finer = with_knot(spline, s);
            const auto removal =
                KnotRemoval::at(finer.basis, finer.basis.span_of(s + 1e-9));
            ASSERT_TRUE(removal);
            std::vector<Eigen::Vector3d> back;
            EXPECT_LT(removal->apply(finer.controls, back), 1e-13);
            for (std::size_t k = 0; k < spline.controls.size(); ++k)
                EXPECT_LT((back[k] - spline.controls[k]).norm(), 1e-13);
        }
        // One that is needed: no point moves farther than the bound says.
        const auto needed = KnotRemoval::at(spline.basis, 2);
        ASSERT_TRUE(needed);
        Spline without{needed->coarse(), {}};
        const double bound = needed->apply(spline.controls, without.controls);
        double most = 0.0;
        for (double s = 0.0; s <= 6.0; s += 0.01)
            most = std::max(most, (without.at(s).place - spline.at(s).place).norm());
        EXPECT_GT(most, 1e-3);
        EXPECT_LE(most, bound + 1e-15);
    }
    EXPECT_FALSE(
        KnotRemoval::at(SplineBasis::open(3, SplineBasis::clamped_knots(3, 9)), 0));
    EXPECT_FALSE(
        KnotRemoval::at(SplineBasis::open(3, SplineBasis::clamped_knots(3, 4)), 0));
}

TEST(Spline, goes_through_its_points)
{
    for (const bool is_closed : {false, true})
        for (const int degree : {2, 3, 5})
        {
            const auto points = random_points(8, 11);
            std::vector<double> at;
            const Spline spline = spline_through(points, is_closed, 3, degree, &at);
            for (std::size_t k = 0; k < points.size(); ++k)
                EXPECT_LT((spline.at(at[k]).place - points[k]).norm(), 1e-12);
        }
    const Spline natural = spline_through(random_points(5, 12), false, 4);
    EXPECT_LT(natural.at(natural.basis.begin()).second.norm(), 1e-12);
    EXPECT_EQ(natural.basis.spans().size(), 16u);
    EXPECT_THROW(spline_through(std::vector<Eigen::Vector3d>(3, Eigen::Vector3d::Zero()),
                                false, 1),
                 std::invalid_argument);
}

TEST(Spline, few_of_many_places_tell_a_line)
{
    // An arc needs some, a straight line its ends alone.
    std::vector<Eigen::Vector3d> arc, straight;
    for (int k = 0; k <= 100; ++k)
    {
        const double a = std::numbers::pi * k / 100;
        arc.emplace_back(std::cos(a), std::sin(a), 0.2 * a);
        straight.emplace_back(k, 0.5 * k, 1.0);
    }
    EXPECT_EQ(few_points(straight, 1e-6).size(), 2u);
    std::size_t before = 2;
    for (const double tolerance : {1e-1, 1e-2, 1e-3})
    {
        const std::vector<Eigen::Vector3d> few = few_points(arc, tolerance);
        EXPECT_GE(few.size(), before);
        EXPECT_LT(few.size(), 40u);
        before = few.size();
        EXPECT_EQ(few.front(), arc.front());
        EXPECT_EQ(few.back(), arc.back());
        const Spline spline = spline_through(few, false, 4);
        for (const Eigen::Vector3d& x : arc)
        {
            double least = 1.0;
            for (int k = 0; k <= 2000; ++k)
                least = std::min(
                    least,
                    (spline
                         .at(spline.basis.begin() +
                             (spline.basis.end() - spline.basis.begin()) * k / 2000)
                         .place -
                     x)
                        .norm());
            EXPECT_LT(least, 1.05 * tolerance + 1e-3);
        }
    }
}

TEST(Spline, control_points_make_the_curve_that_ends_at_the_outer_ones)
{
    const std::vector<Eigen::Vector3d> controls = random_points(7, 3);
    const Spline open = spline_by_controls(controls, false);
    EXPECT_LT((open.at(open.basis.begin()).place - controls.front()).norm(), 1e-14);
    EXPECT_LT((open.at(open.basis.end()).place - controls.back()).norm(), 1e-14);
    const Spline closed = spline_by_controls(controls, true);
    EXPECT_LT(
        (closed.at(closed.basis.begin()).place - closed.at(closed.basis.end()).place)
            .norm(),
        1e-14);
    EXPECT_THROW(spline_by_controls(random_points(3, 1), false), std::invalid_argument);
}

TEST(Spline, what_is_no_curve_is_refused)
{
    const auto refused = [](const auto& make)
    { EXPECT_THROW(make(), std::invalid_argument); };
    const auto points = random_points(5, 3);
    refused([] { SplineBasis::open(3, {0, 0, 0, 0, 1, 1, 1}); });
    refused([] { SplineBasis::open(9, std::vector<double>(30, 0.0)); });
    refused([] { SplineBasis::open(1, {0, 1, 0.5, 2}); });
    refused([] { SplineBasis::closed(3, std::vector<double>{0, 1, 2, 3}); });
    refused([&] { spline_through(points, false, 0); });
    refused([&] { spline_through(points, true, 1, 6); });
    refused([&] { spline_through(points, false, 1, 6); });
    refused([&] { catmull_rom(std::span(points).first(3), false); });
    refused([&] { bezier(std::span(points).first(2)); });
    refused([] { bezier(random_points(9, 3)); });
}

TEST(Spline, catmull_rom_goes_through_its_points_along_the_way_between_their_neighbours)
{
    const auto points = random_points(7, 8);
    for (const bool is_closed : {false, true})
    {
        const Spline spline = catmull_rom(points, is_closed);
        for (int k = 0; k < 7; ++k)
        {
            const CurvePoint at = spline.at(double(k));
            EXPECT_LT((at.place - points[idx(k)]).norm(), 1e-14);
            if (!is_closed && (k == 0 || k == 6))
                continue;
            EXPECT_LT(
                (at.first - 0.5 * (points[idx((k + 1) % 7)] - points[idx((k + 6) % 7)]))
                    .norm(),
                1e-13);
        }
        EXPECT_EQ(spline.basis.smoothness_before(3), 1);
    }
}

TEST(Spline, bezier_pieces_are_smooth_where_handles_are_in_line_and_kink_elsewhere)
{
    // Handles of different lengths in line at the third point, none at the sixth.
    const std::vector<Eigen::Vector3d> points = {
        {0, 0, 0}, {1, 0, 0}, {2, 1, 0}, {3, 2, 0}, {3.5, 2.5, 0},
        {4, 3, 1}, {5, 3, 0}, {6, 2, 0}, {7, 2, 1}, {8, 2, 0}};
    const Spline spline = bezier(points);
    ASSERT_EQ(spline.basis.spans().size(), 3u);
    EXPECT_EQ(spline.basis.smoothness_before(1), 1);
    EXPECT_EQ(spline.basis.smoothness_before(2), 0);
    EXPECT_EQ(spline.controls.size(), points.size() - 1);
    for (int piece = 0; piece < 3; ++piece)
        for (const double t : {0.0, 0.3, 0.5, 0.9, 1.0})
        {
            const auto p = [&](int k) { return points[idx(3 * piece + k)]; };
            const double u = 1.0 - t;
            const Eigen::Vector3d place = u * u * u * p(0) + 3 * u * u * t * p(1) +
                                          3 * u * t * t * p(2) + t * t * t * p(3);
            const SplineSpan& span = spline.basis.spans()[idx(piece)];
            EXPECT_LT(
                (spline.at(piece, span.begin + t * span.length()).place - place).norm(),
                1e-14);
        }
}

TEST(ArcLength, of_a_circle_is_even_and_its_inverse_finds_back)
{
    const Spline circle = support::circle(2.0, 64);
    const ArcLength length(circle);
    EXPECT_NEAR(length.total(), 4.0 * std::numbers::pi, 1e-5);
    for (const double share : {0.0, 1e-9, 0.25, 0.7, 1.0})
        EXPECT_NEAR(length.at(length.parameter(share)),
                    share < 1.0 ? share * length.total() : 0.0, 1e-12 * length.total());
    const Eigen::Vector3d quarter = circle.at(length.parameter(0.25)).place;
    EXPECT_LT((quarter - Eigen::Vector3d(0, 2, 0)).norm(), 1e-5);
}

TEST(Transport, keeps_lengths_and_turns_no_more_than_needed)
{
    std::mt19937 rng(5);
    for (int k = 0; k < 20; ++k)
    {
        const Eigen::Vector3d a = support::random_step(3, 1.0, rng).normalized(),
                              b = support::random_step(3, 1.0, rng).normalized();
        const Eigen::Vector3d v = any_normal(a), w = transported(a, b, v);
        EXPECT_NEAR(w.norm(), 1.0, 1e-12);
        EXPECT_NEAR(w.dot(b), 0.0, 1e-12);
        EXPECT_LT((transported(b, a, w) - v).norm(), 1e-12);
    }
}

} // namespace cellwarp::core
