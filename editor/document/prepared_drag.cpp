// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/document/prepared_drag.h"

namespace cellwarp
{

namespace
{

/// Iterations in new cells before they are looked at again.
constexpr int kSettling = 6;

Rig rig_of(const DragSource& source, const RigState& state)
{
    Rig rig(source.body, source.regions, source.rig);
    rig.set_state(state);
    return rig;
}

} // namespace

PreparedDrag prepare_drag(DragSource source)
{
    PreparedDrag made{std::move(source), nullptr, nullptr, {}};
    const DragSource& from = made.source;
    const WorkFrame& work = from.body->rest->frame;
    std::vector<SampleNormal> normals;
    for (const Eigen::Vector3d& normal : sample_normals(from.model->geometry, *from.rest))
        normals.push_back(
            {static_cast<std::uint32_t>(normals.size()), work.axes * normal});
    DragSettings settings;
    settings.field = from.field;
    made.drag = std::make_unique<Drag>(rig_of(from, from.state), settings, normals);
    made.drag->start_from(from.state.poses, from.state.motions);
    made.layout = layout_of(from.model->geometry, made.drag->samples().order());
    made.to_view = view_of_work(work, from.view);
    return made;
}

std::optional<PreparedDrag> refined(const DragSource& source, const RigState& state,
                                    std::stop_token stop)
{
    Recutting recutting = source.recutting;
    if (!recutting.is_adaptive())
        return std::nullopt;
    Rig rig = rig_of(source, state);
    bool is_changed = false;
    SolveOptions options;
    options.max_iterations = kSettling;
    options.stop = stop;
    while (std::optional<Rig> next = recutting.finer(rig))
    {
        if (stop.stop_requested())
            return std::nullopt;
        rig = std::move(*next);
        rig.solve(options);
        is_changed = true;
    }
    if (!is_changed || stop.stop_requested())
        return std::nullopt;
    DragSource finer = source;
    finer.body = rig.shared_body();
    finer.state = rig.state();
    return prepare_drag(std::move(finer));
}

} // namespace cellwarp
