// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/prepared_drag.h"

#include "library/session/sample_normals.h"
#include "octree/base/stop_scope.h"

namespace cellwarp::core
{

namespace
{

/// Iterations in new cells before they are looked at again.
constexpr int kSettling = 6;

CellSystem system_of(const DragSource& source, const CellSystemState& state)
{
    CellSystem system(source.body, source.regions, source.system);
    system.set_state(state);
    return system;
}

} // namespace

PreparedDrag prepare_drag(DragSource source)
{
    PreparedDrag made{std::move(source), nullptr, nullptr, {}};
    const DragSource& from = made.source;
    const WorkFrame& work = from.body->rest->frame;
    std::vector<SampleNormal> normals;
    normals.reserve(from.rest->size());
    for (const Eigen::Vector3d& normal : sample_normals(from.model->geometry, *from.rest))
        normals.push_back(
            {static_cast<std::uint32_t>(normals.size()), work.axes * normal});
    DragSettings settings;
    settings.field = from.field;
    made.drag = std::make_unique<Drag>(system_of(from, from.state), settings, normals);
    std::vector<SampleNormal>().swap(normals); // what follows takes memory, too
    made.drag->start_from(from.state);
    made.layout = layout_of(from.model->geometry, made.drag->samples().order());
    made.to_view = view_of_work(work, from.view);
    return made;
}

bool serves_on(const PreparedDrag& made, const DragSource& source)
{
    return made.source.body == source.body && made.source.regions == source.regions &&
           made.source.rest == source.rest && made.source.field == source.field &&
           made.source.stage_fingerprint == source.stage_fingerprint;
}

void start_from(PreparedDrag& made, DragSource source)
{
    made.drag->start_from(source.state);
    made.source = std::move(source);
}

std::optional<PreparedDrag> refined(const DragSource& source,
                                    const CellSystemState& state)
{
    CellRefiner refiner = source.refiner;
    if (!refiner.is_adaptive())
        return std::nullopt;
    CellSystem system = system_of(source, state);
    bool is_changed = false;
    SolveOptions options;
    options.max_iterations = kSettling;
    while (std::optional<CellSystem> next = refiner.finer(system))
    {
        system = std::move(*next);
        system.solve(options);
        check_stop();
        is_changed = true;
    }
    if (!is_changed)
        return std::nullopt;
    DragSource finer = source;
    finer.body = system.shared_body();
    finer.state = system.state();
    return prepare_drag(std::move(finer));
}

} // namespace cellwarp::core
