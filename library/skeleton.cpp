// SPDX-License-Identifier: GPL-3.0-or-later
#include <cellwarp/skeleton.h>

#include "library/access.h"
#include "library/calls.h"
#include "library/convert.h"
#include "library/session/limbs.h"
#include "octree/base/index.h"
#include "octree/limb_names.h"

namespace cellwarp
{

core::SkeletonJoint to_core(const Joint& joint)
{
    core::SkeletonJoint out;
    out.name = joint.name;
    out.parent = joint.parent;
    out.at = to_eigen(joint.at);
    if (joint.hinge)
        out.hinge = to_eigen(*joint.hinge);
    out.twist = joint.twist;
    out.swing = joint.swing;
    out.radius = joint.radius;
    return out;
}

std::vector<Joint> from_core(std::span<const core::SkeletonJoint> joints)
{
    std::vector<Joint> out;
    for (const core::SkeletonJoint& joint : joints)
    {
        Joint& own = out.emplace_back();
        own.name = joint.name;
        own.parent = joint.parent;
        own.at = from_eigen(joint.at);
        if (joint.hinge)
            own.hinge = from_eigen(*joint.hinge);
        own.twist = joint.twist;
        own.swing = joint.swing;
        own.radius = joint.radius;
    }
    return out;
}

std::vector<PosedJoint> from_core(std::span<const core::PosedJoint> joints)
{
    std::vector<PosedJoint> out;
    for (const core::PosedJoint& joint : joints)
        out.push_back({joint.name, from_eigen(joint.place)});
    return out;
}

std::vector<Joint> read_joints(const std::string& path, double scale, char up)
{
    return run_call(
        [&]
        {
            constexpr double kLeast = 1e-100, kMost = 1e100;
            if (!(scale >= kLeast && scale <= kMost))
                throw wrong_argument("scale", "need 1e-100 to 1e100");
            if (up != 'x' && up != 'y' && up != 'z')
                throw wrong_argument("up", "need x, y or z");
            core::SkeletonPlacement placement;
            placement.scale = scale;
            placement.up = up;
            return from_core(core::read_skeleton(path, placement).joints);
        });
}

std::vector<Joint> joints_of(const Model& model, const Control& control)
{
    return run_call(control, 0,
                    [&](Watcher& watcher)
                    {
                        watcher.begin("cells", 0.0);
                        const std::vector<core::LimbJoint> found =
                            core::limbs_of(model.path(), Access::geometry(model));
                        const std::vector<std::string> names = limb_names(found);
                        std::vector<Joint> out;
                        for (std::size_t k = 0; k < found.size(); ++k)
                        {
                            Joint& joint = out.emplace_back();
                            joint.name = names[k];
                            if (found[k].parent >= 0)
                                joint.parent = names[core::idx(found[k].parent)];
                            joint.at = from_eigen(found[k].at);
                        }
                        return out;
                    });
}

} // namespace cellwarp
