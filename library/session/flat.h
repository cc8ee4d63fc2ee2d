// SPDX-License-Identifier: GPL-3.0-or-later
// Flat models: all samples in one plane, and motions that keep it.
#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "library/session/work_frame.h"
#include "octree/base/rigid_motion.h"

namespace cellwarp::core
{

/// What is no farther from a plane lies in it [diagonal].
inline constexpr double kInPlane = 1e-9;

/// The unit normal of the plane that all samples lie in; exactly an axis where it is
/// along one. Of those that lie on a line, or at one place, the normal of one of their
/// planes. Nothing where they lie in none. \pre not empty
std::optional<Eigen::Vector3d> plane_normal(const std::vector<Eigen::Vector3d>& samples);

/// The same, but nothing also where they lie on a line or at one place: then other planes
/// hold them as well.
std::optional<Eigen::Vector3d> spanned_plane(const std::vector<Eigen::Vector3d>& samples);

/// The samples' box in axes of which the last is \p normal.
WorkFrame frame_along_plane(const std::vector<Eigen::Vector3d>& samples,
                            const Eigen::Vector3d& normal);

/// The largest turn [rad] and shift [diagonal] of a plane with which a motion keeps it:
/// samples that a file stores as floats determine their plane no better.
inline constexpr double kKept = 1e-6;

/// Whether a motion takes a plane through \p place, and what lies in it up to
/// \p diagonal, to itself.
bool keeps_plane(const Motion& motion, const Eigen::Vector3d& normal,
                 const Eigen::Vector3d& place, double diagonal, double kept = kKept);

/// Takes away by what rounding has moved samples along the normal.
void keep_in_plane(const Eigen::Vector3d& normal,
                   const std::vector<Eigen::Vector3d>& rest,
                   std::vector<Eigen::Vector3d>& moved);

} // namespace cellwarp::core
