// SPDX-License-Identifier: GPL-3.0-or-later
// Whether a bent surface passes through itself where it did not at rest.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "io/formats/geometry.h"
#include "octree/self_intersections.h"

namespace cellwarp::core
{

struct PassThrough
{
    /// Nothing for a cloud, in a build without CGAL, and where triangles are too crammed.
    std::optional<SelfIntersections> now, rest;
    std::string warning; ///< empty: nothing is new
};

struct PassThroughOptions
{
    bool counts_rest = false; ///< else PassThrough::rest stays empty
    bool has_contact = false; ///< contact was asked for
    bool is_shell = false;    ///< a sheet was bent as a shell
};

/// Looks at the samples of \p geometry at \p deformed [model unit].
PassThrough pass_through(const Geometry& geometry,
                         const std::vector<Eigen::Vector3d>& deformed,
                         const PassThroughOptions& options);

} // namespace cellwarp::core
