// SPDX-License-Identifier: GPL-3.0-or-later
// Pictures for reports, in builds that can draw.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace cellwarp::core
{

class Session;

/// Draws states of one session side by side, from one viewpoint and at one scale.
struct Pictures
{
    /// The model with its samples at other places; also its cells as glass, where they
    /// are.
    std::function<void(const Session&, const std::vector<Eigen::Vector3d>& samples,
                       bool shows_cells)>
        add;
    std::function<std::string()> png; ///< a file's bytes
};
/// Nothing in a build without pictures (no_render.cpp).
std::optional<Pictures> make_pictures();

} // namespace cellwarp::core
