// SPDX-License-Identifier: GPL-3.0-or-later
// Equilibria: cantilevers, moments, cables, a buckled column, an arc.
#include <array>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "tests/bench/rod_answers.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;
constexpr double kPi = std::numbers::pi;

struct Bent
{
    double load, w, u, theta; ///< tip: sunk, drawn back, turned
};

/// All three of a tip, as three rows.
void add_tip(Answers& answers, const std::string& name, const Bent& exact, int points,
             const std::function<void(RodCase&)>& load)
{
    RodCase rod(straight_case(1.0, points, slender_section(1.0, 1.0)));
    rod.clamp(rod.begin());
    load(rod);
    answers.add(name + ": sunk", exact.w, points,
                [&]
                {
                    rod.settle();
                    return -rod.state.at(rod.end()).place.y();
                });
    answers.add(
        name + ": drawn back", exact.u, points,
        [&] { return 1.0 - rod.state.at(rod.end()).place.x(); }, 1.0);
    answers.add(name + ": turned [rad]", exact.theta, points,
                [&]
                {
                    const Vector3d t = rod.state.at(rod.end()).first;
                    return std::atan2(-t.y(), t.x());
                });
}

void add_cantilevers(Answers& answers)
{
    answers.begin("Cantilever with a dead load at its tip, P L²/EI");
    constexpr std::array<Bent, 12> kLoaded = {{{0.1, 0.03329532, 0.00066540, 0.04995426},
                                               {0.2, 0.06636448, 0.00264655, 0.09963616},
                                               {0.5, 0.16214358, 0.01591896, 0.24453365},
                                               {1, 0.30172077, 0.05643324, 0.46135195},
                                               {1.5, 0.41097821, 0.10794150, 0.63953983},
                                               {2, 0.49345748, 0.16064172, 0.78174983},
                                               {3, 0.60325344, 0.25442018, 0.98601695},
                                               {4, 0.66996418, 0.32894124, 1.12123935},
                                               {5, 0.71379152, 0.38762836, 1.21536812},
                                               {6, 0.74457115, 0.43458883, 1.28369729},
                                               {8, 0.78498237, 0.50482773, 1.37443151},
                                               {10, 0.81060902, 0.55499560, 1.43028554}}};
    for (const Bent& row : kLoaded)
        add_tip(answers, fmt::format("{}", row.load), row, 24,
                [&](RodCase& rod) {
                    rod.pull({0, -row.load, 0});
                });
    for (const int points : {8, 11, 16})
        for (const std::size_t k : {3u, 11u})
            add_tip(answers, fmt::format("{}, coarser", kLoaded[k].load), kLoaded[k],
                    points,
                    [&](RodCase& rod) {
                        rod.pull({0, -kLoaded[k].load, 0});
                    });
    answers.begin("Cantilever under its own weight, q L³/EI");
    constexpr std::array<Bent, 10> kHeavy = {
        {{0.5, 0.06230577, 0.00222100, 0.08313659},
         {1, 0.12347140, 0.00875360, 0.16511556},
         {1.5696, 0.19046904, 0.02097189, 0.25576549},
         {2, 0.23850658, 0.03310705, 0.32159380},
         {5, 0.49590504, 0.15334282, 0.69700478},
         {10, 0.70019972, 0.34364624, 1.05264312},
         {15.696, 0.79382989, 0.48422102, 1.25280857},
         {20, 0.82988144, 0.55476795, 1.33950154},
         {50, 0.90791712, 0.75498524, 1.52645315},
         {100, 0.93752394, 0.84077662, 1.56410732}}};
    for (const Bent& row : kHeavy)
        add_tip(answers, fmt::format("{}", row.load), row, 35,
                [&](RodCase& rod) {
                    rod.model.gravity = {0, -row.load, 0};
                });
}

void add_moments(Answers& answers)
{
    answers.begin("End moment");
    RodCase rod(straight_case(1.0, 27, slender_section(1.0, 1.0)));
    rod.clamp(rod.begin());
    rod.pull(Vector3d::Zero());
    const auto wind = [&](int from, int to)
    {
        for (int part = from; part <= to; ++part)
        {
            rod.model.loads[0].moment.z() = 2.0 * kPi * part / 8;
            rod.settle();
        }
    };
    answers.add("π EI/L, half a circle: height / L", 2.0 / kPi, 27,
                [&]
                {
                    wind(1, 4);
                    return rod.state.at(rod.end()).place.y();
                });
    answers.add(
        "the same: tip over the clamp, of L", 0.0, 27,
        [&] { return rod.state.at(rod.end()).place.x(); }, 1.0);
    answers.add(
        "2π EI/L, a circle: tip from the clamp, of L", 0.0, 27,
        [&]
        {
            wind(5, 8);
            return rod.state.at(rod.end()).place.norm();
        },
        1.0);
}

void add_cables(Answers& answers)
{
    answers.begin("Cable without stiffness (catenary), by length / span");
    struct Row
    {
        double length, sag, pull;
    };
    for (const Row& row : {Row{1.05, 0.13930421, 0.91963963},
                           {1.1, 0.20030079, 0.65496395},
                           {1.25, 0.33179689, 0.42275235},
                           {1.5, 0.50263326, 0.30823647},
                           {2.0, 0.79638836, 0.22964022},
                           {3.0, 1.33415514, 0.17615270}})
    {
        const auto parabola = [](double sag)
        {
            std::vector<Vector3d> points;
            for (int k = 0; k <= 60; ++k)
                points.emplace_back(k / 60.0, -4.0 * sag * k / 60.0 * (1.0 - k / 60.0),
                                    0.0);
            return spline_through(points, false, 1);
        };
        const double sag =
            bisected(0.0, 3.0,
                     [&](double depth)
                     { return ArcLength(parabola(depth)).total() < row.length; });
        RodCase rod(Rod(parabola(sag),
                        [](double) {
                            return Section{1e7, {1e-7, 1e-7}, 1e-7, 1, 1e-6, 1};
                        },
                        {.rest = RodRest::Straight}));
        rod.model.gravity = {0, -1, 0};
        rod.hold(HoldKind::Point, rod.begin(), Vector3d::UnitZ());
        rod.hold(HoldKind::Point, rod.end(), Vector3d::UnitZ());
        RodNewton newton(rod.model);
        answers.add(fmt::format("{}: sag / span", row.length), row.sag, 63,
                    [&]
                    {
                        newton.solve(rod.state);
                        return -rod.state.at(0.5 * rod.end()).place.y();
                    });
        answers.add(fmt::format("{}: pull / (weight of a span)", row.length), row.pull,
                    63, [&] { return std::abs(newton.multipliers()[0]); });
        answers.add(fmt::format("{}: half its weight", row.length), 0.5 * row.length, 63,
                    [&] { return newton.multipliers()[1]; });
    }
}

void add_buckled(Answers& answers)
{
    answers.begin("Buckled column, clamped below, by its tip's turn [degree]");
    struct Row
    {
        double turn, load, x, w;
    };
    for (const Row& row : {Row{20, 1.015397, 0.969731, 0.219413},
                           {40, 1.063663, 0.881204, 0.422240},
                           {60, 1.151720, 0.741020, 0.593208},
                           {80, 1.293889, 0.559396, 0.719497},
                           {100, 1.518389, 0.348989, 0.791539},
                           {120, 1.884801, 0.123160, 0.803171},
                           {140, 2.542258, -0.106923, 0.750388},
                           {160, 4.030086, -0.340319, 0.624604},
                           {176, 9.116218, -0.577211, 0.421442}})
    {
        constexpr int kPoints = 48;
        RodCase rod(straight_case(1.0, kPoints, slender_section(1.0, 1.0)));
        rod.clamp(rod.begin());
        rod.pull({0, 1.0, 0});
        rod.settle(); // aside first
        rod.model.loads[0].force = {-2.4674011 * row.load, 0.0, 0.0};
        answers.add(
            fmt::format("{}: height / L", row.turn), row.x, kPoints,
            [&]
            {
                rod.settle();
                return rod.state.at(rod.end()).place.x();
            },
            1.0);
        answers.add(
            fmt::format("{}: aside / L", row.turn), row.w, kPoints,
            [&] { return std::abs(rod.state.at(rod.end()).place.y()); }, 1.0);
    }
}

void add_arc(Answers& answers)
{
    answers.begin("Arc of 45°, R = 100, bent out of its plane by a dead load at its tip");
    const double R = 100.0, young = 1e7, inertia = 1.0 / 12.0;
    struct Row
    {
        const char* name;
        double load, polar;
        Vector3d tip;
        int points;
    };
    const double same = 2.0 * inertia; // GJ = EI
    for (const Row& row :
         {Row{"300", 300, same, {22.245289, 58.780248, 40.189388}, 47},
          {"450", 450, same, {18.508749, 52.240039, 48.500107}, 47},
          {"600", 600, same, {15.685356, 47.152150, 53.471763}, 47},
          {"600, coarser", 600, same, {15.685356, 47.152150, 53.471763}, 25},
          {"600, J of a square (exact: with shear)",
           600,
           0.140577,
           {15.5578, 46.8919, 53.6074},
           47}})
    {
        const int count = row.points - 2;
        std::vector<Vector3d> points;
        for (int k = 0; k < count; ++k)
        {
            const double a = 0.25 * kPi * k / (count - 1);
            points.emplace_back(R * (1.0 - std::cos(a)), R * std::sin(a), 0.0);
        }
        RodCase rod(Rod(spline_through(points, false, 1),
                        [&](double)
                        {
                            return Section{young,
                                           {young * inertia, young * inertia},
                                           0.5 * young * row.polar,
                                           1.0,
                                           1e-6,
                                           0.5};
                        },
                        {}));
        rod.clamp(rod.begin());
        rod.pull({0, 0, row.load});
        for (int axis = 0; axis < 3; ++axis)
            answers.add(
                fmt::format("{}: {}", row.name, "xyz"[axis]), row.tip[axis], row.points,
                [&]
                {
                    if (axis == 0)
                        rod.settle();
                    return rod.state.at(rod.end()).place[axis];
                },
                R);
    }
}

void add_jump(Answers& answers)
{
    answers.begin("Both ends dragged: to 0.6 L, 60° turned, 180° twisted");
    for (const int parts : {1, 10})
    {
        RodCase rod(straight_case(1.0, 16, slender_section(1.0, 0.77)));
        rod.clamp(rod.begin());
        rod.clamp(rod.end());
        answers.add(parts == 1 ? "in one jump: Newton iterations (a prototype's)"
                               : "in ten steps: the same, on average",
                    parts == 1 ? 18.0 : 6.0, 16,
                    [&]
                    {
                        int iterations = 0;
                        for (int part = 1; part <= parts; ++part)
                        {
                            const double share = static_cast<double>(part) / parts;
                            const double turn = share * kPi / 3.0, twist = share * kPi;
                            const Vector3d t(std::cos(turn), std::sin(turn), 0.0);
                            const Vector3d n(-std::sin(turn), std::cos(turn), 0.0);
                            rod.model.constraints[3].point = {1.0 - 0.4 * share, 0, 0};
                            rod.model.constraints[4].direction = t;
                            rod.model.constraints[5].direction =
                                std::cos(twist) * n + std::sin(twist) * t.cross(n);
                            iterations += rod.settle().iterations;
                        }
                        return static_cast<double>(iterations) / parts;
                    });
    }
}

} // namespace

void add_statics(Answers& answers)
{
    add_cantilevers(answers);
    add_moments(answers);
    add_cables(answers);
    add_buckled(answers);
    add_arc(answers);
    add_jump(answers);
}

} // namespace cellwarp::core
