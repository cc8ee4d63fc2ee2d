// SPDX-License-Identifier: GPL-3.0-or-later
// Where keys bring something at a time.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "io/scene/rod_scene.h"
#include "octree/base/rigid_motion.h"

namespace cellwarp::core
{

inline Eigen::Vector3d vector_of(const Triple& t)
{
    return {t[0], t[1], t[2]};
}

/// Of a key, about a place.
Motion motion_of(const RodKey& key, const Eigen::Vector3d& about);

/// Where keys have a place at a time: straight and evenly between two of them; \p share:
/// of what they say.
Motion motion_at(std::vector<RodKey> keys, double time, const Eigen::Vector3d& about,
                 double share);

/// The share of something that acts at a time.
double size_at(const SizeInTime& of, double time);

/// How far keys turn between two times, there and back added up [degree].
double turned(const std::vector<RodKey>& keys, double begin, double end);

} // namespace cellwarp::core
