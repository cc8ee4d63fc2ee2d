// SPDX-License-Identifier: GPL-3.0-or-later
// What the rods and curves of a session have come to.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "library/session/cell_system.h"
#include "library/session/frame_plan.h"

namespace cellwarp::core
{

/// A rod or curve in the last frame. Lengths [model unit].
struct RodReport
{
    std::string name;
    bool is_rod = true;
    std::size_t cells = 0; ///< that it carries
    double length = 0.0, radius = 0.0;
    double stiffness = 0.0; ///< with which it pushes back; 0: it only leads
    double energy = 0.0;    ///< of its stiffness, or of stiffness 1 [model unit^3]
    std::vector<Eigen::Vector3d> points; ///< of its statement
    std::vector<HoldParts> holds;        ///< of each point, what is held
    std::vector<Eigen::Vector3d> forces; ///< that hold them [model unit^2]
    std::vector<Eigen::Vector3d> line;   ///< places at equal shares of its length
    /// A pin that stays on it.
    struct Pin
    {
        std::string name;
        Eigen::Vector3d place; ///< where it is
        double at = 0.0;       ///< share of its rest length
        bool slides = false;   ///< else it is held there
        Eigen::Vector3d force; ///< of the curve on the pin [model unit^2]
    };
    std::vector<Pin> pins;
};

/// In the order of their statements. \p aims: a region.
std::vector<RodReport> rod_reports(const CellSystem& system,
                                   std::span<const RegionAim> aims);

} // namespace cellwarp::core
