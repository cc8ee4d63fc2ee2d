// SPDX-License-Identifier: GPL-3.0-or-later
// The motion of one skeleton on the joints of another.
#pragma once

#include <string>

#include "io/scene/skeleton_file.h"
#include "io/scene/skeleton_scene.h"

namespace cellwarp::core
{

/// Turns for the joints of \p skeleton, and shifts of its root, that move its bones as
/// those of \p source move at each time that has a key there; instead of its own tracks.
/// Bones that are matched point where those of the source point, whatever they do at
/// rest. The root makes the way of the source in lengths of the own legs: it begins above
/// where it is at rest, and what of the source is lowest in all keys is as high as what
/// of the skeleton is lowest at rest. \p motion: the map, and what messages name. Adds
/// warnings. Throws Fault::Malformed where no joint is matched, and for names of the map
/// that are not there.
void retarget(const SkeletonValues& source, const MotionStatement& motion,
              const std::string& path, SkeletonValues& skeleton);

/// skeleton_of() the scene at \p path, moved by the scene's motion if it has one. Throws
/// what skeleton_of(), read_skeleton() and retarget() throw, and Fault::Malformed for a
/// motion without keys.
SkeletonValues moving_skeleton(const SkeletonScene& scene, const std::string& path);

} // namespace cellwarp::core
