// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/coupled/rod_motion.h"

#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include <Eigen/Geometry>
#include <Eigen/QR>

#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kTurn = 2.0 * std::numbers::pi;

} // namespace

std::vector<double> parameters_of_controls(const SplineBasis& basis)
{
    std::vector<double> parameters(idx(basis.num_controls()), basis.begin());
    std::vector<double> most(parameters.size(), -1.0);
    for (std::size_t e = 0; e < basis.spans().size(); ++e)
        for (const double x : {0.0, 0.5, 1.0})
        {
            const SplineSpan& span = basis.spans()[e];
            const double s = span.begin + x * span.length();
            const BasisValues values = basis.values_in(static_cast<int>(e), s);
            for (int k = 0; k < values.count; ++k)
            {
                const std::size_t control = idx(values.control[idx(k)]);
                if (values.value[0][idx(k)] > most[control] + 1e-9)
                {
                    most[control] = values.value[0][idx(k)];
                    parameters[control] = s;
                }
            }
        }
    return parameters;
}

Motion carried_by(const RodState& now, const RodState& rest, double s)
{
    const Matrix3d turn = now.frame(s) * rest.frame(s).transpose();
    Motion motion;
    motion.R = Eigen::Quaterniond(turn).normalized().toRotationMatrix();
    motion.t = now.at(s).place - motion.R * rest.at(s).place;
    return motion;
}

HoldRows hold_rows(const RodState& state, std::span<const RodConstraint> holds)
{
    std::vector<ConstraintRow> all;
    for (const RodConstraint& hold : holds)
        for (ConstraintRow& row :
             rows_of(hold, state, HeldBasis(hold, state.rod().basis())))
            all.push_back(std::move(row));
    const Eigen::Index count = static_cast<Eigen::Index>(all.size());
    HoldRows out{Eigen::MatrixXd::Zero(count, state.rod().layout().num_unknowns),
                 Eigen::VectorXd(count)};
    for (Eigen::Index r = 0; r < count; ++r)
    {
        for (const auto& [unknown, value] : all[idx(static_cast<int>(r))].entries)
            out.by_steps(r, unknown) = value;
        out.violation[r] = all[idx(static_cast<int>(r))].violation;
    }
    return out;
}

void bring_to(RodState& state, std::span<const RodConstraint> holds)
{
    constexpr int kMost = 20;
    constexpr double kRounding = 1e-15; // of the rod's size
    const double size = state.rod().arc_length().total();
    for (int k = 0; k < kMost && !holds.empty(); ++k)
    {
        const HoldRows rows = hold_rows(state, holds);
        if (rows.violation.lpNorm<Eigen::Infinity>() <= kRounding * size)
            return;
        state.move(
            -rows.by_steps.completeOrthogonalDecomposition().solve(rows.violation));
    }
}

RodState moved_along(const RodState& state, const RodState& from, const RodState& to,
                     const RodState& rest)
{
    const auto motion_at = [&](double s)
    { return carried_by(to, rest, s) * inverse(carried_by(from, rest, s)); };
    RodState moved = state;
    const Rod& rod = state.rod();
    const std::vector<double> parameters = parameters_of_controls(rod.basis());
    Eigen::VectorXd x = moved.x();
    for (int k = 0; k < rod.num_controls(); ++k)
        x.segment<3>(rod.layout().control[idx(k)]) =
            motion_at(parameters[idx(k)])(state.control(k));
    std::vector<Vector3d> across(idx(rod.num_stations()));
    for (const RodSpan& span : rod.spans())
        for (const auto& [station, s] : {std::pair(span.station[0], span.begin),
                                         std::pair(span.station[1], span.end)})
            across[idx(station)] = motion_at(s).R * state.frame(s).col(0);
    moved.move_to(x);
    for (const RodSpan& span : rod.spans())
        for (const auto& [station, s] : {std::pair(span.station[0], span.begin),
                                         std::pair(span.station[1], span.end)})
        {
            const Matrix3d frame = moved.frame(s);
            const Vector3d& wanted = across[idx(station)];
            x[rod.layout().angle[idx(station)]] =
                moved.angle(station) +
                std::atan2(frame.col(1).dot(wanted), frame.col(0).dot(wanted));
        }
    moved.move_to(x);
    // These angles are known up to whole turns; what the spans are twisted by tells.
    double turns = 0.0;
    for (std::size_t e = 0; e < rod.spans().size(); ++e)
    {
        const std::array<int, 2>& station = rod.spans()[e].station;
        if (station[1] < station[0])
            continue; // the seam of a closed one
        const double wanted = state.twist(e) + to.twist(e) - from.twist(e);
        turns += kTurn * std::round((wanted - moved.twist(e)) / kTurn);
        x[rod.layout().angle[idx(station[1])]] += turns;
    }
    moved.move_to(x);
    return moved;
}

} // namespace cellwarp::core
