// SPDX-License-Identifier: GPL-3.0-or-later
// What the statement of a rod or curve means for one model: its line and its tube.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "library/session/led_rod.h"
#include "library/session/regions.h"

namespace cellwarp::core
{

/// Points of a rod on the centre line of the limb at the samples \p near, or of the whole
/// shape [work]. \p samples [model unit]. Throws Fault::Unsolvable where there is none,
/// Fault::File where its program cannot be started.
std::vector<Eigen::Vector3d> centre_points(const RegionStatement& statement,
                                           const Geometry& geometry,
                                           const std::vector<Eigen::Vector3d>& samples,
                                           const std::vector<std::uint32_t>& near,
                                           const Units& units, const std::string& file);

/// Gives a region the line and the tube of a rod that is led.
void put_led_rod(const LedRod& rod, const Units& units, Region& region);

/// Gives a region its line through \p points [work], and of a rod the tube as its shapes.
/// Throws Fault::Malformed.
void put_spline(const RegionStatement& statement, std::span<const Eigen::Vector3d> points,
                const Units& units, const std::string& file, Region& region);

} // namespace cellwarp::core
