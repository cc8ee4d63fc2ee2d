// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/session/drag.h"

#include <cassert>
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

Rig rig_of(const DragRequest& request)
{
    // Regions of a drag come from the screen, not from a file.
    return {request.body, request.regions, request.rig};
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
                     SampleSet{body.rest->samples, body.cell_of_sample, normals},
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
    assert(motions.size() == rig_->regions().size());
    DragReport report;
    Clock::time_point start = Clock::now();
    rig_->move_regions(motions);
    rig_->carry_others();
    SolveOptions options;
    options.max_iterations = settings_.max_iterations;
    options.gradient_tolerance = settings_.gradient_tolerance;
    options.time_budget = settings_.time_budget;
    options.may_refresh = false; // that would allocate
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
}

void DragDesk::choose(DragRequest request)
{
    assert(request.body.get() == &drag_->rig().body());
    if (next_.valid())
        waiting_ = std::move(request);
    else
        start(std::move(request));
}

void DragDesk::start(DragRequest request)
{
    next_ = std::async(std::launch::async, [request = std::move(request)]
                       { return Drag(rig_of(request), request.drag, request.normals); });
}

bool DragDesk::is_next_ready()
{
    if (!next_.valid() ||
        next_.wait_for(std::chrono::seconds(0)) != std::future_status::ready)
        return false;
    if (!waiting_)
        return true;
    start(std::move(*waiting_)); // what was made for nothing goes, its errors too
    waiting_.reset();
    return false;
}

void DragDesk::wait()
{
    while (next_.valid() && !is_next_ready())
        next_.wait();
}

bool DragDesk::take_next(std::span<const Motion> motions)
{
    if (!is_next_ready())
        return false;
    Drag made = next_.get();
    made.start_from(drag_->rig().poses(), motions);
    drag_.emplace(std::move(made));
    return true;
}

} // namespace cellwarp
