// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/cell_system.h"

#include <algorithm>

#include <fmt/format.h>

#include "io/base/error.h"
#include "io/base/number.h"
#include "library/session/border_bending.h"
#include "library/session/contact_rounds.h"
#include "library/session/memory_limit.h"
#include "library/session/region_cells.h"
#include "octree/base/clock.h"
#include "octree/base/index.h"
#include "solver/cells/refinement.h"
#include "solver/field/exact_samples.h"

namespace cellwarp::core
{

CellSystem::CellSystem(std::shared_ptr<const Body> body,
                       std::shared_ptr<const RegionSet> regions,
                       const CellSystemSettings& settings)
    : body_(std::move(body)), regions_(std::move(regions)),
      has_rigid_steps_(settings.departures.rigid_steps)
{
    const Cells& cells = body_->cells;
    shares_ = regions_->shares(*body_);
    std::vector<int> region_of_cell = prescribing_regions(*regions_, shares_, cells);
    const std::vector<double> factors = cell_factors(*regions_, shares_, cells.size());
    const Departures& departures = settings.departures;
    const std::vector<BorderGlue> borders =
        departures.measured_borders ? border_glue(*body_, *regions_, region_of_cell)
                                    : std::vector<BorderGlue>();
    glue_ = build_glue(cells, factors, borders, departures,
                       departures.smooth_borders && departures.glue_in_face
                           ? border_bending(*body_, *regions_, shares_)
                           : std::vector<double>());
    for (const Cell& cell : cells.cells)
        poses_.push_back({Eigen::Matrix3d::Identity(), cell.centre});
    driving_.emplace(body_, regions_, std::move(region_of_cell), borders, poses_);
    std::vector<Component> components = find_components(cells, driving_->constraints());
    check_memory("equations",
                 RigidMultigrid::memory_estimate(cells.size(), cells.faces.size(),
                                                 rest().flat_axis >= 0),
                 settings);
    rods_ = driving_->pushing_splines(components);
    if (settings.loose_follow && regions_->size() > 0)
        loose_ = LooseParts(body_, glue_, factors, components, driving_->constraints(),
                            has_rigid_steps_);
    if (rest().boundary)
        finder_.emplace(body_, factors, constraints());
    make_minimizer();
    if (settings.method == Method::GaussNewtonDirect)
        check_memory("factors", minimizer_->factor_bytes(), settings);
    parts_.emplace(body_, regions_, *driving_, std::move(components), region_borders());
}

/// For what is held and in contact.
void CellSystem::make_minimizer()
{
    const Cells& cells = body_->cells;
    PushingSplines* pushing = nullptr;
    MakeCompanion make_rods;
    if (!rods_.empty())
        make_rods = [&](CellState& state, const GlueTerm& glue)
        {
            auto made = std::make_unique<PushingSplines>(state, glue, rods_);
            pushing = made.get();
            return made;
        };
    std::vector<int> leaders;
    for (const Constraint& constraint : constraints())
        leaders.push_back(constraint.leader);
    std::vector<CellContact> in_contact;
    for (const FoundContact& found : contacts_)
        in_contact.push_back(found.contact);
    // Parts that follow are solved for by themselves: nothing here may depend on them.
    std::optional<Glue> other;
    if (driving_->has_groups())
        other = with_groups(glue_, cells, leaders);
    if (!loose_.components().empty())
    {
        if (!other)
            other = glue_;
        std::erase_if(other->faces, [&](const GlueFace& face)
                      { return constraints()[idx(face.a)].hold == Hold::Following; });
        other->list_faces_of_cells(cells.size());
    }
    minimizer_ = CellMinimizer(cells, other ? *other : glue_, constraints(),
                               find_components(cells, driving_->constraints()),
                               has_rigid_steps_, make_rods, in_contact);
    pushing_ = pushing;
}

std::vector<std::shared_ptr<const SplineState>> CellSystem::splines() const
{
    std::vector<std::shared_ptr<const SplineState>> splines;
    for (const Driven& region : driving_->now())
        splines.push_back(region.spline);
    return splines;
}

Eigen::Vector3d CellSystem::force_of_guide(std::size_t region) const
{
    const int cell = body_->cell_of_sample[(*regions_)[region].samples.front()];
    Eigen::Vector3d force = Eigen::Vector3d::Zero();
    for (const GlueFace& face : glue_.faces)
        if (face.a == cell || face.b == cell)
            force += glue_gradient(face, poses_[idx(face.a)], poses_[idx(face.b)])
                         .segment<3>(face.a == cell ? 3 : 9);
    return force;
}

void CellSystem::place_pushing_rods()
{
    for (std::size_t k = 0; k < rods_.size(); ++k)
    {
        const Driven& rod = driving_->now()[rods_[k].region];
        pushing_->set(k, rod.spline, rod.motion);
    }
}

void CellSystem::lead_pushing_rods()
{
    for (std::size_t k = 0; k < rods_.size(); ++k)
        pushing_->lead(k, rods_lead_ && driving_->is_bent(rods_[k].region));
}

/// Takes over where the last solve has left them.
void CellSystem::take_solved_rods()
{
    for (std::size_t k = 0; k < rods_.size(); ++k)
        driving_->take_rod(rods_[k].region, pushing_->solved(k));
    driving_->place_rods(poses_);
    place_pushing_rods();
}

double CellSystem::energy() const
{
    double energy =
        glue_energy(glue_, poses_,
                    [&](const GlueFace& face)
                    { return constraints()[idx(face.a)].hold != Hold::Following; });
    for (const FoundContact& found : contacts_)
        energy += contact_energy(found.contact, poses_[idx(found.contact.a)],
                                 poses_[idx(found.contact.b)]);
    for (const PushingSpline& rod : rods_)
        energy += spline(rod.region)->energy();
    return energy;
}

void CellSystem::place_fades()
{
    if (!fades_.empty())
        return;
    std::vector<ExactSamples> exact;
    for (const Region& region : regions_->regions())
    {
        ExactSamples& of_region = exact.emplace_back();
        of_region.is_rigid = region.moves_as_one();
        if (region.moves_as_one() || region.is_exact)
            of_region.samples = region.samples;
    }
    fades_ = fades_of(exact, body_->cells, constraints(), region_of_cell(),
                      rest().samples, body_->cell_of_sample);
}

const std::vector<TouchingSamples>& CellSystem::touching_samples()
{
    if (!touching_)
        touching_ = loose_.touching();
    return *touching_;
}

void CellSystem::check_memory(const char* what, double bytes,
                              const CellSystemSettings& settings) const
{
    bytes = memory_with(bytes, settings.max_memory);
    if (settings.max_memory > 0 && bytes > settings.max_memory)
        throw Error(Fault::Budget,
                    fmt::format("the {} of {} cells need about {} (limit {}): a "
                                "smaller --across or --max-depth needs less",
                                what, body_->cells.size(), in_bytes(bytes),
                                in_bytes(settings.max_memory)));
}

/// After the regions have moved.
void CellSystem::hold_driven()
{
    minimizer_->set_held_points(constraints());
    place_pushing_rods();
}

void CellSystem::set_state(std::span<const Pose> poses, const CellSystem& other)
{
    std::copy(poses.begin(), poses.end(), poses_.begin());
    driving_->turn_groups(other.motions(), poses_);
    driving_->start_from(other.driving_->now(), other.driving_->way_left(), poses_);
    hold_driven();
}

void CellSystem::set_state(const CellSystemState& state)
{
    driving_->start_from(state.regions, state.way_left, poses_);
    hold_driven();
    poses_ = state.poses; // also of pinned cells, whose places would be found anew
    driving_->settle_groups(poses_);
    minimizer_->forget(poses_, state.is_refreshed);
}

void CellSystem::move_regions(std::span<const Motion> motions,
                              std::span<const std::shared_ptr<const SplineState>> splines,
                              double way_left)
{
    driving_->move(motions, splines, way_left, poses_);
    hold_driven();
}

void CellSystem::carry_others()
{
    make_guess();
    parts_->carry(*driving_, poses_);
    driving_->settle_groups(poses_);
}

Residual CellSystem::residual()
{
    return minimizer_->residual(poses_);
}

/// Holds of rods that push back are kept to first order in a solve: it is solved again
/// from where they hold exactly, which is near. \p used: of the time budget [s].
void CellSystem::solve_to_holds(const SolveOptions& options, double used,
                                SolveReport& report)
{
    constexpr int kRounds = 10;
    const Clock::time_point start = Clock::now();
    for (int round = 0; pushing_->bring_back(); ++round)
    {
        take_solved_rods();
        if (report.stop != Stop::Converged)
            return;
        if (round == kRounds)
        {
            report.stop = Stop::IterationLimit;
            return;
        }
        SolveOptions rest = options;
        rest.max_iterations = std::max(0, options.max_iterations - report.iterations);
        if (options.time_budget > 0)
            rest.time_budget =
                std::max(1e-9, options.time_budget - used - 1e-3 * ms_since(start));
        SolveReport next = minimizer_->minimize(poses_, rest);
        next.add_earlier(report);
        next.energy_before = report.energy_before;
        report = next;
    }
    take_solved_rods();
}

void CellSystem::forget_way()
{
    const bool is_refreshed = minimizer_->is_refreshed();
    if (!contacts_.empty())
    {
        contacts_.clear();
        take_contacts();
    }
    minimizer_->forget(poses_, is_refreshed);
}

/// After they have changed.
void CellSystem::take_contacts()
{
    make_minimizer();
    place_pushing_rods();
    lead_pushing_rods();
    if (!contacts_.empty())
        minimizer_->forget(poses_, true); // at rest they do not touch
}

std::vector<FoundContact> CellSystem::contacts() const
{
    std::vector<FoundContact> found;
    if (finder_)
        found = finder_->find(poses_);
    const std::vector<FoundContact> of_loose = loose_.contacts(poses_);
    found.insert(found.end(), of_loose.begin(), of_loose.end());
    std::erase_if(found, [](const FoundContact& one) { return !(one.depth > 0.0); });
    return found;
}

/// From the minimizer, that another one can go on from there.
void CellSystem::take_solved()
{
    if (pushing_)
        take_solved_rods();
    driving_->take_pins(*minimizer_);
    driving_->settle_groups(poses_);
}

SolveReport CellSystem::solve(const SolveOptions& options, bool rods_lead)
{
    rods_lead_ = rods_lead;
    lead_pushing_rods();
    const Clock::time_point start = Clock::now();
    SolveReport report;
    if (!finder_)
        report = minimizer_->minimize(poses_, options);
    else
        report = solve_in_contact({*finder_, rest().material.grid.shape().voxel(), poses_,
                                   contacts_, [&] { take_contacts(); },
                                   [&](const SolveOptions& now)
                                   {
                                       const SolveReport solved =
                                           minimizer_->minimize(poses_, now);
                                       take_solved();
                                       return solved;
                                   }},
                                  options);
    if (pushing_ && (report.iterations > 0 || driving_->has_bent()))
        solve_to_holds(options, 1e-3 * ms_since(start), report);
    driving_->take_pins(*minimizer_);
    driving_->settle_groups(poses_);
    SolveOptions rest_of = options;
    if (options.time_budget > 0)
        rest_of.time_budget =
            std::max(1e-9, options.time_budget - 1e-3 * ms_since(start));
    const Stop of_loose = loose_.follow(poses_, rest_of).stop;
    if (report.stop == Stop::Converged)
        report.stop = of_loose;
    return report;
}

std::vector<Eigen::Vector3d> CellSystem::region_borders() const
{
    std::vector<double> areas(regions_->size(), 0.0);
    std::vector<Eigen::Vector3d> sums(regions_->size(), Eigen::Vector3d::Zero());
    for (const Face& face : body_->cells.faces)
    {
        const int a = region_of_cell()[idx(face.a)], b = region_of_cell()[idx(face.b)];
        if ((a < 0) == (b < 0))
            continue;
        const std::size_t region = idx(std::max(a, b));
        areas[region] += face.area;
        sums[region] += face.area * face.centre;
    }
    std::vector<Eigen::Vector3d> borders;
    for (std::size_t r = 0; r < areas.size(); ++r)
        borders.push_back(areas[r] > 0 ? Eigen::Vector3d(sums[r] / areas[r])
                                       : regions_->centre(r));
    return borders;
}

double CellSystem::largest_gap() const
{
    const std::vector<double> gaps = pair_gaps(body_->cells, glue_, poses_);
    return gaps.empty()
               ? 0.0
               : *std::max_element(gaps.begin(), gaps.end()) / rest().frame.diagonal();
}

} // namespace cellwarp::core
