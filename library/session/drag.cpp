// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/drag.h"

#include <cassert>

#include "octree/base/clock.h"

namespace cellwarp::core
{

Drag::Drag(CellSystem system, const DragSettings& settings,
           std::span<const SampleNormal> normals)
    : settings_(settings), system_(std::make_unique<CellSystem>(std::move(system)))
{
    system_->make_guess();
    system_->place_fades();
    std::vector<FadedRegion> faded;
    for (std::size_t r = 0; r < system_->regions().size(); ++r)
    {
        if (!system_->fade(r) || system_->regions()[r].is_rod())
            continue; // exact samples of rods are so on release
        FadedRegion& region = faded.emplace_back();
        region.fade = system_->fade(r);
        region.may_turn = system_->regions()[r].is_pin_of_one_place();
        for (std::size_t c = 0; c < system_->region_of_cell().size(); ++c)
            if (system_->region_of_cell()[c] == static_cast<int>(r) &&
                system_->constraints()[c].is_of_rigid_region())
                region.cells.push_back(static_cast<int>(c));
        faded_regions_.push_back(r);
    }
    faded_motions_.resize(faded.size());
    const Body& body = system_->body();
    samples_.emplace(settings.field, body.cells,
                     SampleSet{body.rest->samples, body.cell_of_sample, normals},
                     system_->constraints(), faded);
}

void Drag::blend()
{
    for (std::size_t k = 0; k < faded_regions_.size(); ++k)
        faded_motions_[k] = system_->motions()[faded_regions_[k]];
    samples_->apply(system_->poses(), faded_motions_);
}

DragReport Drag::frame(std::span<const Motion> motions,
                       std::span<const std::shared_ptr<const SplineState>> splines)
{
    assert(motions.size() == system_->regions().size());
    DragReport report;
    Clock::time_point start = Clock::now();
    system_->move_regions(motions, splines);
    system_->carry_others();
    SolveOptions options;
    options.max_iterations = settings_.max_iterations;
    options.gradient_tolerance = settings_.gradient_tolerance;
    options.time_budget = settings_.time_budget;
    options.may_refresh = false; // that would allocate
    report.solve = system_->solve(options);
    report.solve_ms = ms_since(start);
    start = Clock::now();
    blend();
    report.blend_ms = ms_since(start);
    return report;
}

void Drag::start_from(const CellSystemState& state)
{
    system_->set_state(state);
    blend();
}

} // namespace cellwarp::core
