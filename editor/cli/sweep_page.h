// SPDX-License-Identifier: GPL-3.0-or-later
// A sweep as a page: one HTML file with plots and pictures in it. It needs no script and
// no network.
#pragma once

#include <string>

#include "editor/cli/sweep_report.h"

namespace cellwarp::core
{

/// Pictures of a sweep: one PNG file's bytes, and what stands in it from left to right.
struct SweepPictures
{
    std::string png; ///< empty: there are none
    std::string caption;
};

std::string sweep_page(const SweepReport& report, const SweepPictures& pictures);

} // namespace cellwarp::core
