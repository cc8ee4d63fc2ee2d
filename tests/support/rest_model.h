// SPDX-License-Identifier: GPL-3.0-or-later
// A model with its regions at rest: what a stage of a session begins with.
#pragma once

#include <memory>
#include <string>

#include "io/formats/geometry_file.h"
#include "library/session/region_set.h"
#include "tests/support/shapes.h"

namespace cellwarp::core::support
{

struct RestModel
{
    Geometry geometry;
    CellSettings settings;
    std::shared_ptr<const RestShape> rest;
    std::shared_ptr<const RegionSet> regions;

    /// \p statements: those of the regions, line by line.
    RestModel(const Shape& shape, const std::string& statements, CellSettings cells)
        : geometry(scan_geometry("model.obj", obj_text(shape)).geometry),
          settings(std::move(cells)),
          rest(build_rest_shape(geometry, geometry.samples, settings))
    {
        const HandleFile file =
            parse_handles("h.handles", "cellwarp-handles 1\n" + statements + "frame 1\n");
        const Units units{rest->frame, file.is_relative, bounding_box(geometry.samples)};
        regions = std::make_shared<const RegionSet>(
            rest,
            resolve_regions(file.stages[0].regions, geometry, geometry.samples, units,
                            file),
            file.path);
    }
};

} // namespace cellwarp::core::support
