// SPDX-License-Identifier: GPL-3.0-or-later
// Loads at which a rod leaves its shape: the largest for which no step that the holds
// leave free lowers the energy.
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

enum class End
{
    Free,
    Pinned,
    Clamped
};

/// A straight rod along x whose ends may slide along it.
void hold_ends(RodCase& rod, End near, End far)
{
    const Vector3d x = Vector3d::UnitX(), y = Vector3d::UnitY();
    rod.hold(HoldKind::Point, rod.begin(), x);
    rod.hold(HoldKind::TwistAngle, rod.begin(), y);
    if (near == End::Clamped)
        rod.hold(HoldKind::Tangent, rod.begin(), x);
    if (far == End::Free)
        return;
    rod.hold(HoldKind::Axis, rod.end(), x);
    if (far == End::Clamped)
        rod.hold(HoldKind::Tangent, rod.end(), x);
}

void add_columns(Answers& answers)
{
    answers.begin("Straight rods: where they buckle");
    constexpr int kPoints = 24;
    struct Row
    {
        const char* name;
        End near, far;
        double exact;
    };
    for (const Row& row :
         {Row{"clamped and free: P L²/EI", End::Clamped, End::Free, 2.4674011},
          {"pinned twice", End::Pinned, End::Pinned, 9.8696044},
          {"clamped and pinned", End::Clamped, End::Pinned, 20.1907286},
          {"clamped twice", End::Clamped, End::Clamped, 39.4784176}})
        answers.add(row.name, row.exact, kPoints,
                    [&]
                    {
                        return bisected(0.5 * row.exact, 2.0 * row.exact,
                                        [&](double load)
                                        {
                                            RodCase rod(straight_case(
                                                1.0, kPoints, slender_section(1.0, 1.0)));
                                            hold_ends(rod, row.near, row.far);
                                            rod.pull({-load, 0, 0});
                                            rod.settle();
                                            return rod.is_stable();
                                        });
                    });
    answers.add("under its own weight, clamped below: q L³/EI", 7.8373474, kPoints,
                [&]
                {
                    return bisected(4.0, 12.0,
                                    [&](double weight)
                                    {
                                        RodCase rod(straight_case(
                                            1.0, kPoints, slender_section(1.0, 1.0)));
                                        hold_ends(rod, End::Clamped, End::Free);
                                        rod.model.gravity = {-weight, 0, 0};
                                        rod.settle();
                                        return rod.is_stable();
                                    });
                });
    answers.add("deep cantilever, tip load, sideways: P L²/√(EI GJ)", 4.0125993, kPoints,
                [&]
                {
                    return bisected(2.0, 6.0,
                                    [&](double load)
                                    {
                                        Section section = slender_section(1.0, 1.0);
                                        section.bending = {1.0, 1e6};
                                        RodCase rod(straight_case(1.0, kPoints, section));
                                        hold_ends(rod, End::Clamped, End::Free);
                                        rod.pull({0, -load, 0});
                                        rod.settle();
                                        return rod.is_stable();
                                    });
                });
    const auto under_torque =
        [](double length, int points, double tension, double moment, End ends)
    {
        RodCase rod(straight_case(length, points, slender_section(1.0, 0.77),
                                  {.rest_twist = -moment / 0.77}));
        hold_ends(rod, ends, ends);
        rod.hold(HoldKind::TwistAngle, rod.end(), Vector3d::UnitY());
        rod.pull({tension, 0, 0});
        rod.settle();
        return rod.is_stable();
    };
    answers.add("torque alone, clamped twice: M L/EI", 8.9868189, kPoints,
                [&]
                {
                    return bisected(4.0, 14.0,
                                    [&](double moment) {
                                        return under_torque(1.0, kPoints, 0.0, moment,
                                                            End::Clamped);
                                    });
                });
    answers.add("torque and tension T, L √(T/EI) = 200: M / √(EI T)", 2.0, 400,
                [&]
                {
                    return bisected(
                        1.0, 3.0,
                        [&](double moment)
                        { return under_torque(200.0, 400, 1.0, moment, End::Clamped); });
                });
}

/// A ring that is straight at rest, with turns put in.
bool ring_is_stable(int points, double ratio, double turns)
{
    RodCase rod(ring_case(points, Section{1e6, {ratio, ratio}, 1.0, 1.0, 1e-6, 0.01},
                          {.rest = RodRest::Straight, .link = turns}));
    rod.hold(HoldKind::Point, rod.begin(), Vector3d::UnitZ());
    rod.settle();
    // Six rigid motions, and its spin, cost nothing: a little weight on the diagonal
    // brings them to the other side of 0.
    BandMatrix H;
    rod.model.hessian(rod.state, RodHessian::Exact, H);
    for (int k = 0; k < H.rows(); ++k)
        H.lower(k, k) += 1e-5;
    return BandFactor().factorize(H).num_negative == 0;
}

void add_rings(Answers& answers)
{
    answers.begin("Twisted ring, straight at rest: the twist [rad] at which it jumps");
    for (const double nu : {0.0, 0.25, 0.3, 0.5})
        for (const int points : {12, 16, 24, 32})
            if (nu == 0.3 || points == 24)
                answers.add(fmt::format("ν = {}", nu),
                            2.0 * kPi * std::sqrt(3.0) * (1.0 + nu), points,
                            [&]
                            {
                                return 2.0 * kPi *
                                       bisected(1.5, 3.0,
                                                [&](double turns) {
                                                    return ring_is_stable(
                                                        points, 1.0 + nu, turns);
                                                });
                            });
}

} // namespace

void add_stability(Answers& answers)
{
    add_columns(answers);
    add_rings(answers);
}

} // namespace cellwarp::core
