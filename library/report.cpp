// SPDX-License-Identifier: GPL-3.0-or-later
#include <cellwarp/report.h>

#include "library/convert.h"

namespace cellwarp
{

namespace
{

core::Stop to_core(Stop stop)
{
    switch (stop)
    {
    case Stop::NotRun:
        return core::Stop::NotRun;
    case Stop::Converged:
        return core::Stop::Converged;
    case Stop::IterationLimit:
        return core::Stop::IterationLimit;
    case Stop::TimeLimit:
        return core::Stop::TimeLimit;
    case Stop::Stopped:
        return core::Stop::Stopped;
    case Stop::NoDescent:
        return core::Stop::NoDescent;
    case Stop::NotPositiveDefinite:
        return core::Stop::NotPositiveDefinite;
    }
    return core::Stop::NotRun;
}

} // namespace

std::string stop_name(Stop stop)
{
    return core::stop_name(to_core(stop));
}

bool FrameReport::is_converged() const
{
    core::FrameReport report;
    report.solve.stop = to_core(stop);
    report.handle_residual = handle_residual;
    return report.is_converged();
}

Stop from_core(core::Stop stop)
{
    for (const Stop own : {Stop::Converged, Stop::IterationLimit, Stop::TimeLimit,
                           Stop::Stopped, Stop::NoDescent, Stop::NotPositiveDefinite})
        if (to_core(own) == stop)
            return own;
    return Stop::NotRun;
}

std::vector<Vec3> from_eigen(std::span<const Eigen::Vector3d> vectors)
{
    std::vector<Vec3> out;
    out.reserve(vectors.size());
    for (const Eigen::Vector3d& v : vectors)
        out.push_back(from_eigen(v));
    return out;
}

Eigen::Matrix4d to_eigen(const Mat4& matrix)
{
    Eigen::Matrix4d out;
    for (std::size_t row = 0; row < 4; ++row)
        for (std::size_t column = 0; column < 4; ++column)
            out(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(column)) =
                matrix[row][column];
    return out;
}

Mat4 from_eigen(const Eigen::Matrix4d& matrix)
{
    Mat4 out;
    for (std::size_t row = 0; row < 4; ++row)
        for (std::size_t column = 0; column < 4; ++column)
            out[row][column] =
                matrix(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(column));
    return out;
}

FrameReport from_core(const core::FrameReport& report)
{
    FrameReport out;
    out.frame = report.frame;
    out.stop = from_core(report.solve.stop);
    out.iterations = report.solve.iterations;
    out.energy_before = report.solve.energy_before;
    out.energy_after = report.solve.energy_after;
    out.gradient = report.solve.gradient;
    out.steps = report.steps;
    out.refinements = report.refinements;
    out.cells = report.cells;
    out.cells_at_depth_limit = report.cells_at_limit;
    out.handle_residual = report.handle_residual;
    out.max_pair_gap = report.max_pair_gap;
    for (const core::PinReport& pin : report.pins)
        out.pins.push_back({pin.name, from_eigen(pin.motion), pin.degrees});
    if (report.contacts)
    {
        out.contact_points = report.contacts->points;
        out.deepest_contact = report.contacts->deepest;
    }
    out.cells_ms = report.cells_ms;
    out.solve_ms = report.solve_ms;
    out.field_fit_ms = report.fit_ms;
    out.field_apply_ms = report.apply_ms;
    return out;
}

std::vector<RodReport> from_core(std::span<const core::RodReport> rods)
{
    std::vector<RodReport> out;
    for (const core::RodReport& rod : rods)
        out.push_back({rod.name, rod.is_rod, rod.cells, rod.length, rod.radius,
                       rod.stiffness, rod.energy, from_eigen(rod.points),
                       from_eigen(rod.forces), from_eigen(rod.line)});
    return out;
}

} // namespace cellwarp
