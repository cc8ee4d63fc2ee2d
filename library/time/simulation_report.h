// SPDX-License-Identifier: GPL-3.0-or-later
// Measures of a scene in time: the same of rods, bodies, nets and sheets, of flesh, and
// of all together.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "library/session/frame_report.h"

namespace cellwarp::core
{

/// Measures of flesh alone.
struct FleshMeasures
{
    double kinetic = 0.0, elastic = 0.0; ///< [J]; tubes are elastic
    double largest_strain = 0.0; ///< Frobenius norm of Green's mean strain of a cell
    std::size_t inverted = 0;    ///< see Flesh::num_inverted()
    std::int64_t cg_steps = 0;   ///< of the solution of linear systems
    std::int64_t factors = 0;    ///< of regions that were made
    double step_ms = 0.0;        ///< all steps together
    std::size_t split = 0, merged = 0; ///< cells that became smaller, and larger again
    double detail_ms = 0.0;            ///< of new lattices
    int limited = 0;                   ///< turns of joints that were cut to their limits
    std::size_t contacts = 0;          ///< points that touch
    /// Forces of obstacles, and of what pulls, on the flesh [N].
    Eigen::Vector3d support = Eigen::Vector3d::Zero(), pull = Eigen::Vector3d::Zero();
};

/// A moment, and the steps since the last report.
struct SimulationReport
{
    double time = 0.0;                                          ///< [s]
    double kinetic = 0.0, elastic = 0.0, gravity = 0.0;         ///< [J]
    Eigen::Vector3d momentum = Eigen::Vector3d::Zero();         ///< [kg m/s]
    Eigen::Vector3d angular_momentum = Eigen::Vector3d::Zero(); ///< [kg m^2/s]
    double violation = 0.0;      ///< largest of the constraints and held points [m, rad]
    std::int64_t iterations = 0; ///< of flesh: linear systems
    std::string stop = "converged"; ///< the first that was not
    std::string stopped;            ///< the object with that stop: the first of a group
    bool is_converged = true;
    std::vector<std::string> problems; ///< of all that did not converge, as sentences
    bool has_contacts = false;         ///< contacts of rods are looked for
    int contacts = 0;                  ///< pairs of places that touch
    double touching = 0.0;             ///< energy of their pressure [J]
    std::optional<double> nearest;     ///< distance of what is near, of its thickness
    /// Steps that were not cut since those before them had failed in all their parts.
    std::int64_t at_once = 0;
    std::optional<FleshMeasures> flesh;
    std::optional<FrameReport> cells; ///< of the model that rods carry
};

/// The sum of both: energies and momenta, the larger violation; the stop of the first one
/// that did not converge.
SimulationReport together(SimulationReport objects, const SimulationReport& flesh);

} // namespace cellwarp::core
