// SPDX-License-Identifier: GPL-3.0-or-later
// Built instead of skeleton_handle.cpp where skeletons are left out.
#include "library/session/retargeted_motion.h"
#include "library/session/skeleton_handle.h"

#include "io/base/error.h"

namespace cellwarp::core
{

namespace
{

[[noreturn]] void refuse_skeletons()
{
    throw Error(Fault::Usage, "this build has no skeletons (CELLWARP_SKELETON)");
}

} // namespace

bool SkeletonAim::is_at(const SkeletonAim&) const
{
    return true;
}

std::shared_ptr<const SkeletonHandle>
make_skeleton_handle(const std::vector<SkeletonJoint>&, const Units&, const std::string&)
{
    refuse_skeletons();
}

KeyedJoints::KeyedJoints(const SkeletonValues&)
{
    refuse_skeletons();
}

std::vector<Move> KeyedJoints::moves_at(double) const
{
    refuse_skeletons();
}

std::vector<JointMotion> KeyedJoints::motions_at(double) const
{
    refuse_skeletons();
}

std::vector<std::string> KeyedJoints::warnings(const std::string&) const
{
    refuse_skeletons();
}

std::vector<double> key_times(const SkeletonValues&)
{
    refuse_skeletons();
}

SkeletonValues moving_skeleton(const SkeletonScene&, const std::string&)
{
    refuse_skeletons();
}

std::vector<FrameStatement> posed_frames(const SkeletonValues&, std::optional<double>,
                                         const std::string&, std::vector<std::string>&)
{
    refuse_skeletons();
}

} // namespace cellwarp::core
