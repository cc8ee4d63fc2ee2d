// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/skeleton/joint_keys.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include <gtest/gtest.h>

#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

using Eigen::AngleAxisd;
using Eigen::Quaterniond;
using Eigen::Vector3d;
using Eigen::Vector4d;

TurnKeys random_keys(Interpolation kind, const std::vector<double>& times, unsigned seed,
                     double size = 0.8)
{
    std::mt19937 random(seed);
    std::normal_distribution<double> number;
    TurnKeys keys;
    keys.kind = kind;
    keys.times = times;
    for (std::size_t k = 0; k < times.size(); ++k)
        keys.turns.push_back(
            exponential(size * Vector3d(number(random), number(random), number(random))));
    return keys;
}

/// In the axes of the turn [rad/s].
Vector3d speed(const TurnKeys& keys, double time, double step)
{
    return logarithm(keys.at(time).conjugate() * keys.at(time + step)) / step;
}

/// The largest change of speed from one side of a key to the other.
double jump(const TurnKeys& keys)
{
    constexpr double kStep = 1e-6;
    double largest = 0.0;
    for (std::size_t k = 1; k + 1 < keys.times.size(); ++k)
        largest = std::max(largest, (speed(keys, keys.times[k], kStep) -
                                     speed(keys, keys.times[k], -kStep))
                                        .norm());
    return largest;
}

} // namespace

TEST(JointKeys, logarithm_and_exponential_undo_each_other)
{
    std::mt19937 random(1);
    std::normal_distribution<double> number;
    for (const double size : {1e-200, 1e-9, 1.0, 3.1})
    {
        const Vector3d v =
            size * Vector3d(number(random), number(random), number(random)).normalized();
        EXPECT_LT((logarithm(exponential(v)) - v).norm(), 1e-14 * size);
    }
    EXPECT_TRUE(logarithm(Quaterniond::Identity()).isZero(0));
    // Either sign of a quaternion is the same turn.
    const Quaterniond turn = exponential(Vector3d(0.1, 0.2, 0.3));
    const Quaterniond other(-turn.w(), -turn.x(), -turn.y(), -turn.z());
    EXPECT_LT((logarithm(turn) - logarithm(other)).norm(), 1e-15);
}

TEST(JointKeys, every_kind_passes_through_its_keys_and_holds_beyond_them)
{
    for (const Interpolation kind :
         {Interpolation::Step, Interpolation::Linear, Interpolation::Smooth})
    {
        const TurnKeys keys = random_keys(kind, {0.5, 1.0, 2.0, 2.25}, 2);
        for (std::size_t k = 0; k < keys.times.size(); ++k)
            EXPECT_EQ(keys.at(keys.times[k]).coeffs(), keys.turns[k].coeffs());
        EXPECT_EQ(keys.at(-7.0).coeffs(), keys.turns.front().coeffs());
        EXPECT_EQ(keys.at(7.0).coeffs(), keys.turns.back().coeffs());
        // Continuous up to the next key, but for steps.
        if (kind != Interpolation::Step)
        {
            EXPECT_LT(keys.at(2.0 - 1e-12).angularDistance(keys.turns[2]), 1e-7);
        }
    }
}

TEST(JointKeys, linear_turns_go_evenly_along_the_shortest_way)
{
    TurnKeys keys;
    keys.times = {0.0, 2.0};
    keys.turns = {Quaterniond(AngleAxisd(0.2, Vector3d::UnitX())),
                  Quaterniond(AngleAxisd(1.8, Vector3d::UnitX()))};
    keys.turns[1].coeffs() *= -1.0; // the same turn
    for (const double t : {0.3, 1.0, 1.7})
        EXPECT_LT(keys.at(t).angularDistance(
                      Quaterniond(AngleAxisd(0.2 + 0.8 * t, Vector3d::UnitX()))),
                  1e-14);
}

TEST(JointKeys, smooth_turns_have_one_speed_on_both_sides_of_a_key)
{
    const std::vector<double> even = {0, 1, 2, 3, 4, 5},
                              uneven = {0, 0.3, 2, 2.5, 5, 5.1};
    for (unsigned seed = 1; seed <= 5; ++seed)
    {
        EXPECT_LT(jump(random_keys(Interpolation::Smooth, even, seed)), 1e-4);
        EXPECT_LT(jump(random_keys(Interpolation::Smooth, uneven, seed)), 1e-3);
        EXPECT_GT(jump(random_keys(Interpolation::Linear, even, seed)), 0.3);
    }
}

TEST(JointKeys, smooth_turns_at_even_keys_are_the_textbooks_squad)
{
    const TurnKeys keys = random_keys(Interpolation::Smooth, {0, 1, 2, 3}, 9, 0.3);
    const auto inner = [&](std::size_t i)
    {
        const Quaterniond& k = keys.turns[i];
        return k * exponential(-0.25 * (logarithm(k.conjugate() * keys.turns[i + 1]) +
                                        logarithm(k.conjugate() * keys.turns[i - 1])));
    };
    for (const double u : {0.1, 0.5, 0.8})
    {
        const Quaterniond squad =
            keys.turns[1]
                .slerp(u, keys.turns[2])
                .slerp(2.0 * u * (1.0 - u), inner(1).slerp(u, inner(2)));
        EXPECT_LT(keys.at(1.0 + u).angularDistance(squad), 1e-14);
    }
}

TEST(JointKeys, smooth_turns_about_one_axis_at_an_even_speed_stay_even)
{
    TurnKeys keys;
    keys.kind = Interpolation::Smooth;
    for (const double t : {0.0, 0.4, 1.0, 2.0, 2.5})
    {
        keys.times.push_back(t);
        keys.turns.emplace_back(AngleAxisd(t, Vector3d::UnitY()));
    }
    for (double t = 0.0; t <= 2.5; t += 0.01)
        EXPECT_LT(
            keys.at(t).angularDistance(Quaterniond(AngleAxisd(t, Vector3d::UnitY()))),
            1e-7);
}

TEST(JointKeys, cubic_turns_follow_their_tangents)
{
    TurnKeys keys;
    keys.kind = Interpolation::Cubic;
    keys.times = {0.0, 0.5};
    keys.turns = {Quaterniond::Identity(),
                  Quaterniond(AngleAxisd(1.0, Vector3d::UnitZ()))};
    keys.tangents.assign(2, {Vector4d::Zero(), Vector4d::Zero()});
    // Half way, with no slope at either end, all weights are halves.
    EXPECT_LT(
        keys.at(0.25).angularDistance(Quaterniond(AngleAxisd(0.5, Vector3d::UnitZ()))),
        1e-7);
    EXPECT_LT(speed(keys, 0.0, 1e-6).norm(), 1e-4);
    keys.tangents[0][1] = {0.0, 0.0, 0.75, 0.0}; // half the speed, about z
    EXPECT_NEAR(speed(keys, 0.0, 1e-7).z(), 1.5, 1e-5);
}

TEST(JointKeys, shifts_of_a_parabola_are_reproduced_smoothly)
{
    ShiftKeys keys;
    keys.kind = Interpolation::Smooth;
    const auto parabola = [](double t) { return Vector3d(t, t * t, 1 - t * t); };
    for (const double t : {0.0, 0.5, 1.5, 2.0, 4.0})
    {
        keys.times.push_back(t);
        keys.shifts.push_back(parabola(t));
    }
    for (const double t : {0.6, 1.0, 1.4, 1.7})
        EXPECT_LT((keys.at(t) - parabola(t)).norm(), 1e-14);
    keys.kind = Interpolation::Linear;
    EXPECT_LT((keys.at(1.0) - 0.5 * (parabola(0.5) + parabola(1.5))).norm(), 1e-15);
    keys.kind = Interpolation::Step;
    EXPECT_EQ(keys.at(1.49), parabola(0.5));
}

TEST(JointKeys, no_key_is_rest)
{
    EXPECT_EQ(TurnKeys().at(1.0).coeffs(), Quaterniond::Identity().coeffs());
    EXPECT_EQ(ShiftKeys().at(1.0), Vector3d::Zero());
}

TEST(JointKeys, half_a_turn_goes_as_the_signs_say_whatever_the_rounding)
{
    std::mt19937 random(9);
    std::normal_distribution<double> number;
    for (int trial = 0; trial < 50; ++trial)
    {
        const Vector3d axis =
            Vector3d(number(random), number(random), number(random)).normalized();
        const Quaterniond from =
            exponential(Vector3d(number(random), number(random), number(random)));
        for (const double sense : {1.0, -1.0})
            for (const double off : {-9e-7, -1e-9, -1e-16, 0.0, 1e-16, 1e-9, 9e-7})
            {
                const Vector3d turn = sense * (std::numbers::pi + off) * axis;
                const Quaterniond to = from * exponential(turn);
                EXPECT_LT((logarithm(from.conjugate() * to) - turn).norm(), 1e-6);
                const Quaterniond half = from * exponential(0.5 * turn);
                for (const Interpolation kind :
                     {Interpolation::Linear, Interpolation::Smooth})
                {
                    const TurnKeys keys{kind, {0.0, 1.0}, {from, to}};
                    EXPECT_LT(keys.at(0.5).angularDistance(half), 1e-6) << off;
                    EXPECT_LT(keys.at(1.0).angularDistance(to), 1e-6);
                }
            }
    }
}

// A wheel that turns by half a turn from key to key goes on.
TEST(JointKeys, signs_lead_from_key_to_key)
{
    TurnKeys keys;
    Quaterniond before = Quaterniond::Identity();
    for (int k = 0; k <= 8; ++k)
    {
        const Quaterniond turn = exponential(k * std::numbers::pi * Vector3d::UnitZ());
        before = nearer_sign(before, turn);
        EXPECT_EQ(before.coeffs(), turn.coeffs());
        EXPECT_EQ(nearer_sign(before, Quaterniond(-turn.coeffs())).coeffs(),
                  turn.coeffs());
    }
}

} // namespace cellwarp::core
