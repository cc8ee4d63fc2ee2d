// SPDX-License-Identifier: GPL-3.0-or-later
// Built instead of spline_handle.cpp and pushing_splines.cpp where rods are left out.
#include "library/session/pushing_splines.h"
#include "library/session/spline_handle.h"

#include "io/base/error.h"

namespace cellwarp::core
{

namespace
{

[[noreturn]] void refuse_rods()
{
    throw Error(Fault::Usage, "this build has no rods and curves (CELLWARP_RODS)");
}

} // namespace

std::vector<Eigen::Vector3d> points_for_rod(std::span<const Eigen::Vector3d>, double)
{
    refuse_rods();
}

std::shared_ptr<const SplineHandle>
make_spline_handle(const SplineStatement&, std::span<const Eigen::Vector3d>, bool, double)
{
    refuse_rods();
}

std::unique_ptr<PushingSplines> make_pushing_splines(CellState&, const GlueTerm&,
                                                     std::vector<PushingSpline>)
{
    refuse_rods();
}

} // namespace cellwarp::core
