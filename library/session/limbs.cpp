// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/limbs.h"

#include <system_error>

#include "io/base/error.h"
#include "io/formats/face_triangles.h"
#include "library/session/body.h"
#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

/// What holds more of the samples is no limb: half of a tube, a body without a head.
constexpr double kMostOfAll = 0.25;

} // namespace

std::vector<LimbJoint> limbs_of(const std::string& path, const Geometry& geometry,
                                const LimbOptions& options)
{
    Shape shape;
    shape.samples = geometry.samples;
    shape.triangles = triangles_of(geometry);
    std::vector<LimbJoint> joints;
    try
    {
        joints = limb_tree(shape, options);
    }
    catch (const std::system_error& error)
    {
        if (error.code() == std::errc::resource_unavailable_try_again)
            throw; // no thread, and no file
        throw Error(Fault::File, error.what());
    }
    if (joints.size() < 2)
        throw Error(Fault::Unsolvable,
                    at({path, 0, ""},
                       "the shape has no centre line (this needs a closed surface, "
                       "or samples that one can be wrapped around, and a build with "
                       "CGAL)"));
    return joints;
}

std::vector<LimbEnd> limb_ends(const std::vector<LimbJoint>& joints,
                               const Geometry& geometry)
{
    std::vector<char> is_end(joints.size(), 1);
    for (const LimbJoint& joint : joints)
        if (joint.parent >= 0)
            is_end[idx(joint.parent)] = 0;
    std::vector<LimbEnd> of_joints(joints.size());
    for (const Eigen::Vector3d& x : geometry.samples)
    {
        std::size_t nearest = 0;
        for (std::size_t k = 1; k < joints.size(); ++k)
            if ((x - joints[k].at).squaredNorm() < (x - joints[nearest].at).squaredNorm())
                nearest = k;
        of_joints[nearest].box.extend(x);
        ++of_joints[nearest].num_samples;
    }
    const ModelBox model = bounding_box(geometry.samples);
    // A flat model has only places at 0 across.
    const Eigen::Array3d size =
        (model.size().array() > 0).select(model.size().array(), 1.0);
    std::vector<LimbEnd> ends;
    for (std::size_t k = 0; k < joints.size(); ++k)
    {
        LimbEnd& end = of_joints[k];
        if (!is_end[k] || end.num_samples == 0 ||
            static_cast<double>(end.num_samples) >
                kMostOfAll * static_cast<double>(geometry.samples.size()))
            continue;
        const auto hundredths = [&](const Eigen::Vector3d& x) -> Eigen::Array3d
        { return 100.0 * ((x - model.low).array() / size); };
        end.box = Eigen::AlignedBox3d(
            (hundredths(end.box.min()).floor() / 100.0).matrix().eval(),
            (hundredths(end.box.max()).ceil() / 100.0).matrix().eval());
        ends.push_back(end);
    }
    return ends;
}

} // namespace cellwarp::core
