// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/rod_report.h"

#include <algorithm>

namespace cellwarp::core
{

namespace
{

/// Places of RodReport::line.
constexpr int kPlacesOfLine = 129;

RodReport report_of(const CellSystem& system, std::size_t r, const SplineHolds& holds)
{
    const Region& region = system.regions()[r];
    const SplineState& now = *system.spline(r);
    const Motion& motion = system.motions()[r];
    const WorkFrame& frame = system.rest().frame;
    const double unit = frame.length_to_model(1.0);
    RodReport report;
    report.name = region.name;
    report.is_rod = region.is_rod();
    report.cells = static_cast<std::size_t>(std::count(system.region_of_cell().begin(),
                                                       system.region_of_cell().end(),
                                                       static_cast<int>(r)));
    report.length = frame.length_to_model(now.length());
    report.radius = frame.length_to_model(region.spline->radius());
    if (region.told->stiffness)
        report.stiffness = *region.told->stiffness;
    report.energy = now.energy() * unit * unit * unit;
    for (const Eigen::Vector3d& point : now.points())
        report.points.push_back(frame.to_model(motion(point)));
    const std::vector<Eigen::Vector3d> forces = now.forces();
    for (std::size_t k = 0; k < holds.size(); ++k)
    {
        report.holds.push_back(holds[k].parts);
        report.forces.push_back(unit * frame.vector_to_model(motion.R * forces[k]));
    }
    for (int k = 0; k < kPlacesOfLine; ++k)
    {
        const double s = region.spline->parameter_of_share(k / (kPlacesOfLine - 1.0));
        report.line.push_back(frame.to_model(motion(now.at(s).place)));
    }
    for (std::size_t p = 0; p < system.regions().size(); ++p)
        if (const std::optional<Region::Guide>& guide = system.regions()[p].guide;
            guide && guide->region == r)
        {
            const Driven& pin = system.driving().now()[p];
            const std::uint32_t sample = system.regions()[p].samples.front();
            report.pins.push_back(
                {system.regions()[p].name,
                 frame.to_model(system.rest().samples[sample] + pin.motion.t),
                 region.spline->share_of_parameter(pin.s), !guide->at,
                 unit * frame.vector_to_model(system.force_of_guide(p))});
        }
    return report;
}

} // namespace

std::vector<RodReport> rod_reports(const CellSystem& system,
                                   std::span<const RegionAim> aims)
{
    std::vector<RodReport> reports;
    for (std::size_t r = 0; r < system.regions().size(); ++r)
        if (const SplineHandle* const spline = system.regions()[r].spline.get();
            spline && !system.regions()[r].is_led())
            reports.push_back(report_of(
                system, r, aims[r].holds.empty() ? spline->rest_holds() : aims[r].holds));
    return reports;
}

} // namespace cellwarp::core
