// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/pass_through.h"

#include <fmt/format.h>

#include "io/formats/face_triangles.h"
#include "library/session/work_frame.h"

namespace cellwarp::core
{

PassThrough pass_through(const Geometry& geometry,
                         const std::vector<Eigen::Vector3d>& deformed,
                         const PassThroughOptions& options)
{
    PassThrough result;
    const std::vector<Triangle> triangles = triangles_of(geometry);
    if (triangles.empty())
        return result;
    const IntersectionCounter counter(triangles, geometry.samples);
    result.now = counter.count(deformed);
    if (result.now && result.now->first_fresh)
    {
        const std::int64_t fresh = result.now->fresh;
        Eigen::Vector3d first = Eigen::Vector3d::Zero();
        for (const std::uint32_t corner : triangles[*result.now->first_fresh])
            first += deformed[corner] / 3.0;
        result.warning = fmt::format(
            "{} {} that {} not at rest, the first at {}: parts pass through each "
            "other{}{}",
            fresh,
            fresh == 1 ? "pair of triangles intersects" : "pairs of triangles intersect",
            fresh == 1 ? "does" : "do",
            place_text(first, bounding_box(geometry.samples).size().norm()),
            options.has_contact ? ", or the surface folds (contact does not act between "
                                  "neighbouring parts of the material)"
                                : "",
            options.is_shell ? " (a thicker shell folds less: --thickness)" : "");
    }
    if (options.counts_rest)
        result.rest = counter.count(geometry.samples);
    return result;
}

} // namespace cellwarp::core
