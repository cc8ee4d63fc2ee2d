// SPDX-License-Identifier: GPL-3.0-or-later
// Where keys bring something at a time.
#pragma once

#include <Eigen/Core>

#include "io/scene/rod_scene.h"
#include "octree/base/rigid_motion.h"
#include "octree/base/rigid_move.h"

namespace cellwarp::core
{

inline Eigen::Vector3d vector_of(const Triple& t)
{
    return {t[0], t[1], t[2]};
}

/// About a place, whatever its pivot.
Motion motion_of(const RigidMove& move, const Eigen::Vector3d& about);

/// Where keys have something at rest at \p about at a time: straight and evenly between
/// two of them; \p share: of what they say.
Motion motion_at(const MoveKeys& keys, double time,
                 const Eigen::Vector3d& about = Eigen::Vector3d::Zero(),
                 double share = 1.0);

/// The share of something that acts at a time.
double size_at(const SizeInTime& of, double time);

/// How far keys turn between two times, there and back added up [degree].
double turned(const MoveKeys& keys, double begin, double end);

} // namespace cellwarp::core
