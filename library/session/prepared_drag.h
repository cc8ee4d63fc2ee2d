// SPDX-License-Identifier: GPL-3.0-or-later
// A drag ready to begin: made in the background from where a solution ended.
#pragma once

#include <memory>
#include <optional>
#include <span>

#include "io/formats/geometry.h"
#include "library/session/cell_refiner.h"
#include "library/session/drag.h"
#include "library/session/shape.h"

namespace cellwarp::core
{

/// All that a drag is made of. A value: the threads share nothing that changes.
struct DragSource
{
    std::shared_ptr<const GeometryFile> model;
    std::shared_ptr<const std::vector<Eigen::Vector3d>>
        rest; ///< of the stage [model unit]
    std::shared_ptr<const Body> body;
    std::shared_ptr<const RegionSet> regions;
    CellSystemState state;
    CellRefiner refiner;
    CellSystemSettings system;
    FieldKind field = FieldKind::Blend;
    WorkFrame view;
    std::uint64_t stage_fingerprint = 0; ///< of the stage
};

struct PreparedDrag
{
    DragSource source; ///< its state is where the drag begins
    std::unique_ptr<Drag> drag;
    std::shared_ptr<const ShapeLayout> layout; ///< of the drag's samples
    Eigen::Matrix4d to_view = Eigen::Matrix4d::Identity();
};

PreparedDrag prepare_drag(DragSource source);

/// Whether a drag needs only to start from another state to be that of \p source.
bool serves_on(const PreparedDrag& made, const DragSource& source);
/// Starts it from there. \pre serves_on()
void start_from(PreparedDrag& made, DragSource source);

/// The same in smaller cells, where the deformation wants them; nothing where it does
/// not. \p state: of the cells of \p source now.
std::optional<PreparedDrag> refined(const DragSource& source,
                                    const CellSystemState& state);

} // namespace cellwarp::core
