// SPDX-License-Identifier: GPL-3.0-or-later
// The frames of a handle file as the motion of a skeleton in time.
#pragma once

#include "io/formats/geometry.h"
#include "io/scene/handle_file.h"
#include "io/scene/scene_file.h"

namespace cellwarp::core
{

/// The skeleton of \p scene and what moves it: its keys or the motion of its file; or, if
/// \p handles has frames that do not stand for keys, the poses that these frames make of
/// it. Frame N is at N times skeleton.every (without it the time between frames of the
/// film). In between joints turn, and a joint that two frames hold at one place stays
/// there. \p geometry: the model. Throws what moving_skeleton() throws, and
/// Fault::Malformed with line and field for statements that cannot be played: regions,
/// rods, joints of the handle file and commits. \pre scene.has_flesh()
SkeletonValues played_skeleton(const SceneFile& scene, const HandleFile& handles,
                               const Geometry& geometry);

} // namespace cellwarp::core
