// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/frame_report.h"

#include <fmt/format.h>

namespace cellwarp::core
{

namespace
{

/// How far samples of a region may end from where its motion puts them [diagonal].
constexpr double kResidual = 1e-9;

} // namespace

bool FrameReport::is_converged() const
{
    return solve.stop == Stop::Converged && handle_residual <= kResidual;
}

std::vector<std::string> convergence_warnings(const FrameReport& report)
{
    std::vector<std::string> warnings;
    if (!(report.handle_residual <= kResidual))
        warnings.push_back(
            fmt::format("frame {}: samples of a region end {:.3g} diagonals from "
                        "where its motion puts them",
                        report.frame, report.handle_residual));
    if (report.solve.stop != Stop::Converged)
        warnings.push_back(fmt::format("frame {} did not converge ({}, gradient {:.3g})",
                                       report.frame, stop_name(report.solve.stop),
                                       report.solve.gradient));
    return warnings;
}

} // namespace cellwarp::core
