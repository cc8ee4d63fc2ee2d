// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "io/formats/geometry.h"

namespace cellwarp::core
{

/// What a closed mesh encloses.
struct Volume
{
    double before = 0.0, after = 0.0; ///< [model unit^3]
};

/// At rest and with these samples; nothing unless every edge has exactly two, opposite
/// faces.
std::optional<Volume> enclosed_volumes(const Geometry& geometry,
                                       const std::vector<Eigen::Vector3d>& samples);

} // namespace cellwarp::core
