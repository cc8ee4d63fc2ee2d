// SPDX-License-Identifier: GPL-3.0-or-later
#include "editor/session/cell_system.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>

#include "editor/session/region_cells.h"
#include "io/error.h"
#include "io/number.h"
#include "octree/base/index.h"
#include "solver/cells/refinement.h"

namespace cellwarp
{

namespace
{

/// Steps of all regions that differ by no more are one rigid motion.
constexpr double kSameStep = 1e-12;

/// Regions whose stiffness differs by more than this get a warning.
constexpr double kExtremeContrast = 1e12;

bool agree(const Motion& a, const Motion& b, double scale)
{
    return (a.R - b.R).norm() <= kSameStep && (a.t - b.t).norm() <= kSameStep * scale;
}

} // namespace

CellSystem::CellSystem(std::shared_ptr<const Body> body,
                       std::shared_ptr<const RegionSet> regions,
                       const CellSystemSettings& settings)
    : body_(std::move(body)), regions_(std::move(regions))
{
    const Cells& cells = body_->cells;
    shares_ = regions_->shares(*body_);
    region_of_cell_ = prescribing_regions(*regions_, shares_, cells);
    const std::vector<double> factors = cell_factors(*regions_, shares_, cells.size());
    const auto [softest, stiffest] = std::minmax_element(factors.begin(), factors.end());
    if (!factors.empty() && *stiffest > kExtremeContrast * *softest)
        warnings_.push_back(
            fmt::format("stiffness differs by a factor of {:.1g}: the soft "
                        "parts keep few digits",
                        *stiffest / *softest));
    const Departures& departures = settings.departures;
    glue_ = build_glue(cells, factors,
                       departures.measured_borders
                           ? border_glue(*body_, *regions_, region_of_cell_)
                           : std::vector<BorderGlue>(),
                       departures);
    for (const Cell& cell : cells.cells)
        poses_.push_back({Eigen::Matrix3d::Identity(), cell.centre});
    motions_.resize(regions_->size());
    last_motions_ = steps_ = motions_;

    hold_cells();
    std::vector<Component> components = find_components(cells, constraints_);
    check_memory("equations",
                 RigidMultigrid::memory_estimate(cells.size(), cells.faces.size()),
                 settings);
    minimizer_.emplace(cells, glue_, constraints_, components, departures.rigid_steps);
    if (settings.method == Method::GaussNewtonDirect)
        check_memory("factors", minimizer_->factor_bytes(), settings);
    guess_.emplace(cells, glue_, constraints_, region_of_cell_,
                   static_cast<int>(regions_->size()));
    for (Component& component : components)
    {
        Part& part = parts_.emplace_back();
        for (const int cell : component.cells)
            if (constraints_[idx(cell)].hold != Hold::Prescribed)
                part.movable.push_back(cell);
        part.component = std::move(component);
    }
    warn_of_components();
    place_fades();
}

void CellSystem::hold_cells()
{
    constraints_.resize(body_->cells.size());
    for (std::size_t c = 0; c < constraints_.size(); ++c)
    {
        const int owner = region_of_cell_[c];
        if (owner < 0)
            continue;
        const Region& region = (*regions_)[idx(owner)];
        constraints_[c].hold = region.role == Role::Pin ? Hold::Pinned : Hold::Prescribed;
        constraints_[c].held_rest = body_->cells.cells[c].centre;
    }
    hold_pins();
    for (Constraint& constraint : constraints_)
        constraint.held_now = constraint.held_rest;
}

/// A pinned cell is held at the mean of the pin's samples in it. One without any is held
/// at its centre if most of it is the pin's, else, being a neighbour of a small pin,
/// where the pin's nearest sample is.
void CellSystem::hold_pins()
{
    const std::vector<Eigen::Vector3d>& samples = rest().samples;
    for (std::size_t r = 0; r < regions_->size(); ++r)
    {
        const Region& region = (*regions_)[r];
        if (region.role != Role::Pin || region.samples.empty())
            continue;
        std::map<int, std::pair<Eigen::Vector3d, int>> sums;
        for (const std::uint32_t i : region.samples)
        {
            auto [found, is_new] =
                sums.try_emplace(body_->cell_of_sample[i], Eigen::Vector3d::Zero(), 0);
            found->second.first += samples[i] - regions_->box(r).low;
            ++found->second.second;
        }
        for (const auto& [cell, share] : shares_[r].cells)
        {
            const std::size_t c = idx(cell);
            if (region_of_cell_[c] != static_cast<int>(r))
                continue;
            Eigen::Vector3d& held = constraints_[c].held_rest;
            const auto found = sums.find(cell);
            if (found != sums.end())
                held = regions_->box(r).low + found->second.first / found->second.second;
            else if (share < 0.5)
                held = samples[*std::min_element(
                    region.samples.begin(), region.samples.end(),
                    [&](std::uint32_t a, std::uint32_t b) {
                        return (samples[a] - held).squaredNorm() <
                               (samples[b] - held).squaredNorm();
                    })];
        }
    }
}

void CellSystem::warn_of_components()
{
    if (regions_->size() == 0)
        return; // nothing is asked of any
    const std::size_t num_idle =
        idx(std::count_if(parts_.begin(), parts_.end(),
                          [](const Part& part) { return !part.component.is_held; }));
    if (num_idle > 0)
        warnings_.push_back(
            fmt::format("{} of {} components have no region: they stay at rest", num_idle,
                        parts_.size()));
    for (const Part& part : parts_)
        if (part.component.free_rotations > 0)
            warnings_.push_back(fmt::format(
                "a component of {} cells is held by {} alone: {} of its rotations are "
                "free and are kept as they are",
                part.component.cells.size(),
                part.component.free_rotations == 3 ? "one pin" : "pins in a line",
                part.component.free_rotations));
}

/// Around the samples of the regions, and around the borders of their cells, where the
/// field knows the motion too. Without these what lies just outside would depend on how
/// near the last sample of the region happens to be.
void CellSystem::place_fades()
{
    const std::vector<std::vector<Eigen::Vector3d>> borders =
        border_points(body_->cells, constraints_);
    for (std::size_t r = 0; r < regions_->size(); ++r)
    {
        const Region& region = (*regions_)[r];
        std::optional<RegionFade>& fade = fades_.emplace_back();
        if (!region.prescribes() || region.samples.empty())
            continue;
        std::vector<RegionFade::Node> samples, further;
        for (const std::uint32_t i : region.samples)
            samples.push_back({rest().samples[i], body_->cell_of_sample[i]});
        for (std::size_t c = 0; c < constraints_.size(); ++c)
            if (region_of_cell_[c] == static_cast<int>(r) &&
                constraints_[c].hold == Hold::Prescribed)
                for (const Eigen::Vector3d& point : borders[c])
                    further.push_back({point, static_cast<int>(c)});
        fade.emplace(body_->cells, samples, further);
    }
}

void CellSystem::check_memory(const char* what, double bytes,
                              const CellSystemSettings& settings) const
{
    if (settings.max_memory > 0 && bytes > settings.max_memory)
        throw Error(Fault::Budget,
                    fmt::format("the {} of {} cells need about {} (limit {}): a "
                                "smaller --across or --max-depth needs less",
                                what, body_->cells.size(), in_bytes(bytes),
                                in_bytes(settings.max_memory)));
}

void CellSystem::set_state(std::span<const Pose> poses, std::span<const Motion> motions)
{
    std::copy(poses.begin(), poses.end(), poses_.begin());
    move_regions(motions);
    last_motions_ = motions_;
}

void CellSystem::set_state(const CellSystemState& state)
{
    move_regions(state.motions);
    last_motions_ = motions_;
    poses_ = state.poses; // also of pinned cells, whose places would be found anew
    minimizer_->forget(poses_, state.is_refreshed);
}

void CellSystem::move_regions(std::span<const Motion> motions)
{
    last_motions_.swap(motions_);
    std::copy(motions.begin(), motions.end(), motions_.begin());
    for (std::size_t c = 0; c < constraints_.size(); ++c)
    {
        const int owner = region_of_cell_[c];
        if (owner < 0)
            continue;
        const Motion& motion = motions_[idx(owner)];
        Constraint& constraint = constraints_[c];
        const Eigen::Vector3d& centre = body_->cells.cells[c].centre;
        if (constraint.hold == Hold::Prescribed)
            poses_[c] = carried(motion, centre);
        else if (constraint.hold == Hold::Pinned)
        {
            constraint.held_now = constraint.held_rest + motion.t;
            poses_[c] = held_at_pin(poses_[c], constraint, centre);
        }
    }
    minimizer_->set_held_points(constraints_);
}

/// The one rigid step that all regions of a component make, if they do. A pin takes part
/// if the step takes its held points where they must be.
std::optional<Motion> CellSystem::rigid_step_of(const Component& component) const
{
    std::optional<Motion> step;
    for (const bool is_pin : {false, true})
        for (const int cell : component.cells)
        {
            const std::size_t c = idx(cell);
            const int owner = region_of_cell_[c];
            if (owner < 0 || (constraints_[c].hold == Hold::Pinned) != is_pin)
                continue;
            const std::size_t r = idx(owner);
            if (!step)
                step = steps_[r];
            const double scale = std::max(1.0, steps_[r].t.norm());
            const bool agrees =
                is_pin ? ((*step)(constraints_[c].held_rest + last_motions_[r].t) -
                          constraints_[c].held_now)
                                 .norm() <= kSameStep * scale
                       : agree(*step, steps_[r], scale);
            if (!agrees)
                return std::nullopt;
        }
    return step;
}

void CellSystem::carry_others()
{
    for (std::size_t r = 0; r < steps_.size(); ++r)
        steps_[r] = motions_[r] * inverse(last_motions_[r]);
    for (const Part& part : parts_)
    {
        if (!part.component.is_held)
            continue;
        const std::optional<Motion> rigid = rigid_step_of(part.component);
        if (rigid && rigid->R.isIdentity(0) && rigid->t.isZero(0))
            continue;
        if (!rigid)
            guess_->carry(steps_, part.movable, poses_);
        for (const int cell : part.movable)
        {
            const std::size_t c = idx(cell);
            Pose& pose = poses_[c];
            if (rigid)
                pose = {rigid->R * pose.R, (*rigid)(pose.p)};
            if (constraints_[c].hold == Hold::Pinned)
                pose = held_at_pin(pose, constraints_[c], body_->cells.cells[c].centre);
        }
    }
}

Residual CellSystem::residual()
{
    return minimizer_->residual(poses_);
}

SolveReport CellSystem::solve(const SolveOptions& options)
{
    return minimizer_->minimize(poses_, options);
}

double CellSystem::largest_gap() const
{
    const std::vector<double> gaps = pair_gaps(body_->cells, glue_, poses_);
    return gaps.empty()
               ? 0.0
               : *std::max_element(gaps.begin(), gaps.end()) / rest().frame.diagonal();
}

} // namespace cellwarp
