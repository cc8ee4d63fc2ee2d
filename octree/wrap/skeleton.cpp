// SPDX-License-Identifier: GPL-3.0-or-later
// The library runs in a program of its own: skeleton_main.cpp tells why.
#include "octree/wrap/skeleton.h"

#include <new>

#include "octree/base/helper.h"
#include "octree/wrap/skeleton_bytes.h"

namespace cellwarp::core
{

bool has_curve_skeleton()
{
    return true;
}

CurveSkeleton curve_skeleton(const Shape& surface)
{
    const HelperEnd end = run_helper("cellwarp-skeleton", {}, bytes_of(surface));
    if (end.code == kSkeletonWithoutMemory)
        throw std::bad_alloc();
    CurveSkeleton skeleton;
    if (end.code != 0 || !read_bytes(end.out, skeleton))
        return {}; // the library gave up
    return skeleton;
}

} // namespace cellwarp::core
