// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/session/drag.h"

#include <chrono>

namespace cellwarp
{

namespace
{

using Clock = std::chrono::steady_clock;

double ms_since(Clock::time_point start)
{
    return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

template <class Value>
bool is_ready(const std::future<Value>& value)
{
    return value.wait_for(std::chrono::seconds(0)) == std::future_status::ready;
}

Rig rig_of(const DragRequest& request)
{
    // Regions of a drag come from the screen, not from a file.
    return {request.body, request.regions, request.rig, ""};
}

} // namespace

Drag::Drag(Rig rig, const DragSettings& settings, std::span<const SampleNormal> normals)
    : settings_(settings), rig_(std::make_unique<Rig>(std::move(rig)))
{
    std::vector<FadedRegion> faded;
    for (std::size_t r = 0; r < rig_->regions().size(); ++r)
    {
        if (!rig_->fade(r))
            continue;
        FadedRegion& region = faded.emplace_back();
        region.fade = rig_->fade(r);
        region.may_turn = rig_->regions()[r].role == Role::Pin;
        for (std::size_t c = 0; c < rig_->region_of_cell().size(); ++c)
            if (rig_->region_of_cell()[c] == static_cast<int>(r) &&
                rig_->constraints()[c].hold == Hold::Prescribed)
                region.cells.push_back(static_cast<int>(c));
        faded_regions_.push_back(r);
    }
    faded_motions_.resize(faded.size());
    const Body& body = rig_->body();
    samples_.emplace(settings.field, body.cells,
                     SampleSet{body.samples, body.cell_of_sample, normals},
                     rig_->constraints(), faded);
}

void Drag::blend(std::span<const Motion> motions)
{
    for (std::size_t k = 0; k < faded_regions_.size(); ++k)
        faded_motions_[k] = motions[faded_regions_[k]];
    samples_->apply(rig_->poses(), faded_motions_);
}

DragReport Drag::frame(std::span<const Motion> motions)
{
    DragReport report;
    Clock::time_point start = Clock::now();
    rig_->move_regions(motions);
    rig_->carry_others();
    SolveOptions options;
    options.max_iterations = settings_.max_iterations;
    options.gradient_tolerance = settings_.gradient_tolerance;
    options.time_budget = settings_.time_budget;
    report.solve = rig_->solve(options);
    report.solve_ms = ms_since(start);
    start = Clock::now();
    blend(motions);
    report.blend_ms = ms_since(start);
    return report;
}

void Drag::start_from(std::span<const Pose> poses, std::span<const Motion> motions)
{
    rig_->set_state(poses, motions);
    blend(motions);
}

DragDesk::DragDesk(const DragRequest& first)
    : drag_(std::in_place, rig_of(first), first.drag, first.normals)
{
    drag_->start_from(drag_->rig().poses(), first.motions);
}

void DragDesk::choose(DragRequest request)
{
    std::erase_if(given_up_, is_ready<Made>);
    if (next_.valid())
        given_up_.push_back(std::move(next_));
    next_ = std::async(std::launch::async,
                       [request = std::move(request)]() -> Made {
                           return {Drag(rig_of(request), request.drag, request.normals),
                                   request.motions};
                       });
}

bool DragDesk::take_next()
{
    if (!next_.valid() || !is_ready(next_))
        return false;
    Made made = next_.get();
    made.drag.start_from(drag_->rig().poses(), made.motions);
    drag_.emplace(std::move(made.drag));
    return true;
}

} // namespace cellwarp
