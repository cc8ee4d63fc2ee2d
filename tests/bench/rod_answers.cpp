// SPDX-License-Identifier: GPL-3.0-or-later
// Prints the tables of docs/rods-answers.md.
#include "tests/bench/rod_answers.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <numbers>
#include <stdexcept>

#include <fmt/format.h>

#include "octree/base/clock.h"

namespace cellwarp::core
{

void Answers::begin(const std::string& title)
{
    tables_.push_back({title, {}});
}

void Answers::add(const std::string& what, double exact, int points,
                  const std::function<double()>& run, double of)
{
    const Clock::time_point start = Clock::now();
    const double ours = run();
    const double scale = of > 0.0 ? of : std::abs(exact);
    tables_.back().rows.push_back(
        {what, exact, ours, (ours - exact) / scale, points, seconds_since(start)});
}

void Answers::print() const
{
    for (const Table& table : tables_)
    {
        fmt::print("\n## {}\n\n| | exact | ours | error | points | s |\n"
                   "|---|---|---|---|---|---|\n",
                   table.title);
        for (const Row& row : table.rows)
            fmt::print("| {} | {:.8g} | {:.8g} | {:.1e} | {} | {:.2g} |\n", row.what,
                       row.exact, row.ours, row.error, row.points, row.seconds);
    }
}

void RodCase::hold(HoldKind what, double s, const Eigen::Vector3d& direction)
{
    RodConstraint constraint;
    constraint.hold = what;
    constraint.s = s;
    constraint.point = state.at(s).place;
    constraint.direction = direction;
    model.constraints.push_back(constraint);
}

void RodCase::clamp(double s)
{
    const Eigen::Matrix3d frame = state.frame(s);
    hold(HoldKind::Point, s, frame.col(2));
    hold(HoldKind::Tangent, s, frame.col(2));
    hold(HoldKind::TwistAngle, s, frame.col(0));
}

MotionReport RodCase::settle()
{
    RodNewton newton(model);
    const MotionReport report = newton.solve(state);
    if (report.stop != MotionStop::Converged)
        throw std::runtime_error(std::string("an equilibrium was not found: ") +
                                 stop_name(report.stop));
    return report;
}

bool RodCase::is_stable()
{
    BandMatrix H;
    model.hessian(state, RodHessian::Exact, H);
    const RodModel::Rows rows = model.rows(state);
    SaddleSolver saddle;
    return saddle.factorize(H, rows.rows, rows.groups).num_negative == 0;
}

double bisected(double low, double high, const std::function<bool(double)>& is_stable)
{
    for (int k = 0; k < 40; ++k)
    {
        const double middle = 0.5 * (low + high);
        (is_stable(middle) ? low : high) = middle;
    }
    return low;
}

Section slender_section(double bending, double twist)
{
    return {kSlender * bending, {bending, bending}, twist, 1.0, 1e-6, 0.01};
}

Rod straight_case(double length, int points, const Section& section,
                  const RodSettings& settings)
{
    const std::vector<Eigen::Vector3d> ends = {{0, 0, 0}, {length, 0, 0}};
    return Rod(
        spline_through(ends, false, points - 3), [section](double) { return section; },
        settings);
}

Rod ring_case(int points, const Section& section, const RodSettings& settings)
{
    std::vector<Eigen::Vector3d> on;
    for (int k = 0; k < points; ++k)
    {
        const double a = 2.0 * std::numbers::pi * k / points;
        on.emplace_back(std::cos(a), std::sin(a), 0.0);
    }
    return Rod(
        spline_through(on, true, 1), [section](double) { return section; }, settings);
}

} // namespace cellwarp::core

int main()
{
    try
    {
        cellwarp::core::Answers answers;
        cellwarp::core::add_statics(answers);
        cellwarp::core::add_stability(answers);
        cellwarp::core::add_vibrations(answers);
        cellwarp::core::add_motion(answers);
        cellwarp::core::add_sliding(answers);
        fmt::print("# Rods against exact numbers\n\nMade by `scripts/bench answers`; "
                   "the last three tables by what `simulate` reports. Errors are shares "
                   "of the exact number, or of what the row names; "
                   "points are control points of a cubic; seconds are of one core.\n");
        answers.print();
    }
    catch (const std::exception& error)
    {
        fmt::print(stderr, "rod_answers: {}\n", error.what());
        return 1;
    }
    return 0;
}
