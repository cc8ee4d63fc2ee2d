// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/cell_system.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

#include <fmt/format.h>

#include "io/base/error.h"
#include "io/base/number.h"
#include "library/session/border_bending.h"
#include "library/session/contact_rounds.h"
#include "library/session/memory_limit.h"
#include "library/session/region_cells.h"
#include "octree/base/clock.h"
#include "octree/base/index.h"
#include "octree/base/rigid_fit.h"
#include "solver/cells/refinement.h"
#include "solver/field/exact_samples.h"

namespace cellwarp::core
{

namespace
{

/// Steps of all regions that differ by no more are one rigid motion.
constexpr double kSameStep = 1e-12;

/// Places of a rod whose motions the others take part in, at the most.
constexpr int kMostStations = 16;

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
    : body_(std::move(body)), regions_(std::move(regions)),
      has_rigid_steps_(settings.departures.rigid_steps)
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
    const std::vector<BorderGlue> borders =
        departures.measured_borders ? border_glue(*body_, *regions_, region_of_cell_)
                                    : std::vector<BorderGlue>();
    glue_ = build_glue(cells, factors, borders, departures,
                       departures.smooth_borders && departures.glue_in_face
                           ? border_bending(*body_, *regions_, shares_)
                           : std::vector<double>());
    for (const Cell& cell : cells.cells)
        poses_.push_back({Eigen::Matrix3d::Identity(), cell.centre});
    motions_.resize(regions_->size());
    last_motions_ = found_motions_ = motions_;

    hold_cells();
    set_insets(borders);
    place_stations();
    place_guided();
    steps_.resize(regions_->size() + stations_.size());
    std::vector<Component> components = find_components(cells, constraints_);
    check_memory("equations",
                 RigidMultigrid::memory_estimate(cells.size(), cells.faces.size(),
                                                 rest().flat_axis >= 0),
                 settings);
    rods_ = pushing_splines(components);
    if (settings.loose_follow && regions_->size() > 0)
        loose_ =
            LooseParts(body_, glue_, factors, components, constraints_, has_rigid_steps_);
    if (rest().boundary)
        finder_.emplace(body_, factors, constraints_);
    make_minimizer();
    if (settings.method == Method::GaussNewtonDirect)
        check_memory("factors", minimizer_->factor_bytes(), settings);
    const std::vector<Eigen::Vector3d> middles = region_borders();
    for (Component& component : components)
    {
        Part& part = parts_.emplace_back();
        for (const int cell : component.cells)
            if (constraints_[idx(cell)].hold != Hold::Prescribed)
                part.movable.push_back(cell);
        part.holders = holders_of(component, middles);
        part.from.resize(part.holders.size());
        part.to = part.from;
        part.component = std::move(component);
    }
    warn_of_components();
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
    for (const Constraint& constraint : constraints_)
        leaders.push_back(constraint.leader);
    std::vector<CellContact> in_contact;
    for (const FoundContact& found : contacts_)
        in_contact.push_back(found.contact);
    // Parts that follow are solved for by themselves: nothing here may depend on them.
    std::optional<Glue> other;
    if (!groups_.empty())
        other = with_groups(glue_, cells, leaders);
    if (!loose_.components().empty())
    {
        if (!other)
            other = glue_;
        std::erase_if(other->faces, [&](const GlueFace& face)
                      { return constraints_[idx(face.a)].hold == Hold::Following; });
        other->list_faces_of_cells(cells.size());
    }
    minimizer_ = CellMinimizer(cells, other ? *other : glue_, constraints_,
                               find_components(cells, constraints_), has_rigid_steps_,
                               make_rods, in_contact);
    pushing_ = pushing;
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
    for (std::size_t r = 0; r < regions_->size(); ++r)
        if ((*regions_)[r].turns_freely())
            hold_group(r);
    for (Constraint& constraint : constraints_)
    {
        constraint.held_now = constraint.held_rest;
        constraint.flat_axis = rest().flat_axis;
    }
}

/// Where the regions end within the cells that they hold: the glue of a border is as long
/// as from the free cell's middle to there.
void CellSystem::set_insets(std::span<const BorderGlue> borders)
{
    struct Sums
    {
        std::array<double, 6> area = {}, inset = {};
    };
    std::map<std::size_t, Sums> of_cell;
    for (const BorderGlue& border : borders)
    {
        const Face& face = body_->cells.faces[idx(border.face)];
        const auto [held, loose] =
            border.is_a_rigid ? std::pair(face.a, face.b) : std::pair(face.b, face.a);
        const double inset = border.length - 0.5 * body_->cells.cells[idx(loose)].edge;
        const std::size_t side = side_of(face.axis, border.is_a_rigid);
        of_cell[idx(held)].area[side] += face.area;
        of_cell[idx(held)].inset[side] += face.area * inset;
    }
    for (const auto& [cell, sums] : of_cell)
        for (std::size_t side = 0; side < 6; ++side)
            if (sums.inset[side] > 0.0)
                constraints_[cell].insets[side] = sums.inset[side] / sums.area[side];
}

/// The cells of a pin of several places: one body that turns about their centroid.
void CellSystem::hold_group(std::size_t region)
{
    Group group{region, {}};
    for (std::size_t c = 0; c < region_of_cell_.size(); ++c)
        if (region_of_cell_[c] == static_cast<int>(region))
            group.cells.push_back(static_cast<int>(c));
    if (group.cells.empty())
        return; // of a component without material
    const std::vector<std::uint32_t>& samples = (*regions_)[region].samples;
    Eigen::Vector3d held = Eigen::Vector3d::Zero();
    for (const std::uint32_t i : samples)
        held += (rest().samples[i] - regions_->centre(region)) /
                static_cast<double>(samples.size());
    for (const int cell : group.cells)
    {
        Constraint& constraint = constraints_[idx(cell)];
        constraint.hold = Hold::Grouped;
        constraint.held_rest = regions_->centre(region) + held;
        constraint.leader = group.cells.front();
    }
    groups_.push_back(std::move(group));
}

/// Takes what pins of several places have turned by from their leaders to all their
/// cells.
void CellSystem::settle_groups()
{
    found_motions_ = motions_;
    for (const Group& group : groups_)
    {
        const std::size_t leader = idx(group.cells.front());
        const Eigen::Matrix3d& R = poses_[leader].R;
        Motion& found = found_motions_[group.region];
        found.R = R;
        if (!R.isIdentity(0))
            found.t = constraints_[leader].held_now - R * constraints_[leader].held_rest;
        for (const int cell : group.cells)
            poses_[idx(cell)] = carried(found, body_->cells.cells[idx(cell)].centre);
    }
}

/// About one a cell along each rod.
void CellSystem::place_stations()
{
    first_station_.push_back(0);
    splines_.resize(regions_->size());
    for (std::size_t r = 0; r < regions_->size(); ++r)
    {
        const Region& region = (*regions_)[r];
        if (region.spline)
            splines_[r] = region.spline->rest();
        if (region.is_rod())
        {
            on_rod_.resize(region_of_cell_.size(), 0.0);
            for (std::size_t c = 0; c < region_of_cell_.size(); ++c)
                if (region_of_cell_[c] == static_cast<int>(r))
                    on_rod_[c] = region.spline->nearest(body_->cells.cells[c].centre);
            const double edge = rest().material.grid.shape().edge;
            const int count = static_cast<int>(
                std::clamp(1.0 + std::round(splines_[r]->length() / edge), 2.0,
                           static_cast<double>(kMostStations)));
            for (int k = 0; k < count; ++k)
                stations_.push_back({r, region.spline->parameter_of_share(
                                            static_cast<double>(k) / (count - 1))});
        }
        first_station_.push_back(stations_.size());
    }
    last_splines_ = splines_;
    is_bent_.assign(splines_.size(), 0);
    station_motions_.resize(stations_.size());
    last_station_motions_ = station_motions_;
}

RailPlace CellSystem::GuideRail::at(double s) const
{
    const RailPlace place = now_->at(s);
    return {motion_(place.place) + off_, motion_.R * place.first,
            motion_.R * place.second};
}

/// The one cell that holds the place of each pin on a curve; others are free again.
void CellSystem::place_guided()
{
    for (std::size_t r = 0; r < regions_->size(); ++r)
    {
        const Region& region = (*regions_)[r];
        if (!region.guide)
            continue;
        const std::size_t sample = region.samples.front();
        const Eigen::Vector3d& place = rest().samples[sample];
        const int own = body_->cell_of_sample[sample];
        for (std::size_t c = 0; c < region_of_cell_.size(); ++c)
            if (region_of_cell_[c] == static_cast<int>(r) && static_cast<int>(c) != own)
            {
                region_of_cell_[c] = -1;
                constraints_[c] = Constraint();
            }
        if (const int other = region_of_cell_[idx(own)]; other != static_cast<int>(r))
            throw Error(Fault::Unsolvable,
                        at({regions_->file(), region.line, region.name},
                           (other < 0 ? std::string("no region")
                                      : role_name((*regions_)[idx(other)].role) +
                                            " region " + (*regions_)[idx(other)].name) +
                               " holds the cell of its sample (smaller cells would part "
                               "them: raise --across or --max-depth)"));
        const SplineHandle& spline = *(*regions_)[region.guide->region].spline;
        on_guide_.resize(regions_->size(), 0.0);
        on_guide_[r] = region.guide->at ? spline.parameter_of_share(*region.guide->at)
                                        : spline.nearest(place);
        Constraint& constraint = constraints_[idx(own)];
        constraint.hold = region.guide->at ? Hold::Pinned : Hold::Sliding;
        constraint.held_rest = constraint.held_now = place;
        guided_.push_back(
            {r, own, place - spline.rest()->at(on_guide_[r]).place, nullptr});
    }
    hold_guided();
}

/// Where their curves are now.
void CellSystem::hold_guided()
{
    for (Guided& guided : guided_)
    {
        const std::size_t curve = (*regions_)[guided.region].guide->region;
        if (!guided.rail) // its place stays: constraints and states point there
            guided.rail = std::make_unique<GuideRail>(*(*regions_)[curve].spline);
        guided.rail->set(splines_[curve], motions_[curve], way_left_ * guided.off);
        Constraint& constraint = constraints_[idx(guided.cell)];
        constraint.s = on_guide_[guided.region];
        constraint.rail = constraint.hold == Hold::Sliding ? guided.rail.get() : nullptr;
        constraint.held_now = guided.rail->at(constraint.s).place;
        motions_[guided.region] = {Eigen::Matrix3d::Identity(),
                                   constraint.held_now - constraint.held_rest};
        poses_[idx(guided.cell)] =
            held_at_pin(poses_[idx(guided.cell)], constraint,
                        body_->cells.cells[idx(guided.cell)].centre);
    }
}

double CellSystem::share_on_guide(std::size_t region) const
{
    return (*regions_)[(*regions_)[region].guide->region].spline->share_of_parameter(
        on_guide_[region]);
}

Eigen::Vector3d CellSystem::place_on_guide(std::size_t region) const
{
    return rest().samples[(*regions_)[region].samples.front()] + motions_[region].t;
}

Eigen::Vector3d CellSystem::force_of_guide(std::size_t region) const
{
    Eigen::Vector3d force = Eigen::Vector3d::Zero();
    for (const Guided& guided : guided_)
        if (guided.region == region)
            for (const GlueFace& face : glue_.faces)
                if (face.a == guided.cell || face.b == guided.cell)
                    force += glue_gradient(face, poses_[idx(face.a)], poses_[idx(face.b)])
                                 .segment<3>(face.a == guided.cell ? 3 : 9);
    return force;
}

/// Of the cells: by their regions, on rods by the stations around.
std::vector<Driving> CellSystem::driving() const
{
    std::vector<Driving> driving(region_of_cell_.begin(), region_of_cell_.end());
    for (std::size_t c = 0; c < on_rod_.size(); ++c)
    {
        const int owner = region_of_cell_[c];
        if (owner < 0 || !(*regions_)[idx(owner)].is_rod())
            continue;
        std::size_t k = first_station_[idx(owner)];
        const std::size_t last = first_station_[idx(owner) + 1] - 1;
        while (k + 2 <= last && stations_[k + 1].s <= on_rod_[c])
            ++k;
        const double share = std::clamp((on_rod_[c] - stations_[k].s) /
                                            (stations_[k + 1].s - stations_[k].s),
                                        0.0, 1.0);
        const int first = static_cast<int>(regions_->size() + k);
        driving[c] = {first, first + 1, share};
    }
    return driving;
}

void CellSystem::find_station_motions(std::vector<Motion>& motions) const
{
    for (std::size_t k = 0; k < stations_.size(); ++k)
    {
        const auto& [region, s] = stations_[k];
        motions[k] = motions_[region] * splines_[region]->carry(s);
    }
}

Pose CellSystem::pose_on_rod(std::size_t cell) const
{
    const std::size_t region = idx(region_of_cell_[cell]);
    const Motion bent = splines_[region]->carry(on_rod_[cell]);
    const Eigen::Vector3d& centre = body_->cells.cells[cell].centre;
    if (bent.R.isIdentity(0) && bent.t.isZero(0))
        return carried(motions_[region], centre);
    return carried(motions_[region] * bent, centre);
}

/// Those with cells.
std::vector<PushingSpline>
CellSystem::pushing_splines(const std::vector<Component>& components)
{
    std::vector<int> component_of_cell(region_of_cell_.size());
    std::vector<std::set<int>> holding(components.size()); ///< regions
    for (std::size_t k = 0; k < components.size(); ++k)
        for (const int cell : components[k].cells)
        {
            component_of_cell[idx(cell)] = static_cast<int>(k);
            if (region_of_cell_[idx(cell)] >= 0)
                holding[k].insert(region_of_cell_[idx(cell)]);
        }
    std::vector<PushingSpline> rods;
    for (std::size_t r = 0; r < regions_->size(); ++r)
    {
        const Region& region = (*regions_)[r];
        if (!region.is_rod() || !(region.spline->stiffness() > 0.0))
            continue;
        PushingSpline rod{region.spline, {}, {}, {}};
        for (std::size_t c = 0; c < region_of_cell_.size(); ++c)
        {
            if (region_of_cell_[c] != static_cast<int>(r))
                continue;
            rod.cells.push_back(static_cast<int>(c));
            rod.at.push_back(on_rod_[c]);
            rod.centres.push_back(body_->cells.cells[c].centre);
        }
        if (rod.cells.empty())
            continue;
        rod.is_alone =
            std::all_of(rod.cells.begin(), rod.cells.end(),
                        [&](int cell) {
                            return holding[idx(component_of_cell[idx(cell)])].size() == 1;
                        });
        pushing_regions_.push_back(r);
        rods.push_back(std::move(rod));
    }
    return rods;
}

void CellSystem::place_pushing_rods()
{
    for (std::size_t k = 0; k < pushing_regions_.size(); ++k)
        pushing_->set(k, splines_[pushing_regions_[k]], motions_[pushing_regions_[k]]);
}

void CellSystem::lead_pushing_rods()
{
    for (std::size_t k = 0; k < pushing_regions_.size(); ++k)
        pushing_->lead(k, rods_lead_ && is_bent_[pushing_regions_[k]]);
}

/// Where the last solve has left them.
void CellSystem::take_solved_rods()
{
    for (std::size_t k = 0; k < pushing_regions_.size(); ++k)
        splines_[pushing_regions_[k]] = pushing_->solved(k);
    for (std::size_t c = 0; c < region_of_cell_.size(); ++c)
        if (const int owner = region_of_cell_[c];
            owner >= 0 && (*regions_)[idx(owner)].is_rod())
            poses_[c] = pose_on_rod(c);
    find_station_motions(station_motions_);
    place_pushing_rods();
}

double CellSystem::energy() const
{
    double energy =
        glue_energy(glue_, poses_,
                    [&](const GlueFace& face)
                    { return constraints_[idx(face.a)].hold != Hold::Following; });
    for (const FoundContact& found : contacts_)
        energy += contact_energy(found.contact, poses_[idx(found.contact.a)],
                                 poses_[idx(found.contact.b)]);
    for (const std::size_t region : pushing_regions_)
        energy += splines_[region]->energy();
    return energy;
}

Motion CellSystem::motion_at(std::size_t region, const Eigen::Vector3d& x) const
{
    if (!(*regions_)[region].is_rod())
        return found_motions_[region];
    return motions_[region] *
           splines_[region]->carry((*regions_)[region].spline->nearest(x));
}

/// All cells of a pin of one place are held there: where it turns, no two of them are
/// held apart.
void CellSystem::hold_pins()
{
    for (std::size_t c = 0; c < constraints_.size(); ++c)
    {
        const int owner = region_of_cell_[c];
        if (owner >= 0 && (*regions_)[idx(owner)].is_pin_of_one_place())
            constraints_[c].held_rest =
                rest().samples[(*regions_)[idx(owner)].samples.front()];
    }
}

/// The number of samples in each part.
std::vector<std::size_t> CellSystem::samples_of_parts() const
{
    std::vector<std::size_t> in_cell(body_->cells.size(), 0);
    for (const int cell : body_->cell_of_sample)
        ++in_cell[idx(cell)];
    std::vector<std::size_t> samples;
    for (const Part& part : parts_)
    {
        std::size_t& of_part = samples.emplace_back(0);
        for (const int cell : part.component.cells)
            of_part += in_cell[idx(cell)];
    }
    return samples;
}

PartsByHold CellSystem::parts_by_hold() const
{
    PartsByHold counts;
    const std::vector<std::size_t> samples = samples_of_parts();
    for (std::size_t k = 0; k < parts_.size(); ++k)
    {
        const Hold hold = constraints_[idx(parts_[k].component.cells.front())].hold;
        std::size_t& of = parts_[k].component.is_held ? counts.held
                          : hold == Hold::Following   ? counts.follow
                                                      : counts.stay;
        of += samples[k] > 0;
    }
    return counts;
}

/// Parts are numbered by their first samples.
void CellSystem::warn_of_loose_parts(std::span<const std::size_t> samples)
{
    constexpr std::size_t kMostTold = 6;
    std::vector<std::size_t> part_of_cell(body_->cells.size());
    for (std::size_t k = 0; k < parts_.size(); ++k)
        for (const int cell : parts_[k].component.cells)
            part_of_cell[idx(cell)] = k;
    std::vector<int> number(parts_.size(), -1);
    int count = 0;
    for (const int cell : body_->cell_of_sample)
        if (int& of_part = number[part_of_cell[idx(cell)]]; of_part < 0)
            of_part = count++;
    std::vector<int> goes_with(parts_.size(), -1); // number of a part with samples
    std::vector<std::pair<int, int>> told;
    std::size_t num_samples = 0;
    for (const BridgedComponent& one : loose_.components())
    {
        const std::size_t own = idx(one.component), to = idx(one.to);
        goes_with[own] = number[to] >= 0 ? number[to] : goes_with[to];
        if (number[own] < 0)
            continue;
        told.emplace_back(number[own], goes_with[own]);
        num_samples += samples[own];
    }
    if (told.empty())
        return;
    std::sort(told.begin(), told.end());
    std::string pairs;
    for (std::size_t k = 0; k < std::min(kMostTold, told.size()); ++k)
        pairs += fmt::format("{}{} with {}", k == 0 ? "" : ", ", told[k].first,
                             told[k].second);
    warnings_.push_back(fmt::format(
        "{} of {} parts have no region and go with the part nearest to them: {}{} ({} of "
        "{} samples; --loose stay keeps them at rest)",
        told.size(), count, pairs, told.size() > kMostTold ? ", ..." : "", num_samples,
        body_->cell_of_sample.size()));
}

void CellSystem::warn_of_components()
{
    if (regions_->size() == 0)
        return; // nothing is asked of any
    const std::vector<std::size_t> samples = samples_of_parts();
    std::size_t num_idle = 0, num_samples = 0;
    for (std::size_t k = 0; k < parts_.size(); ++k)
        if (constraints_[idx(parts_[k].component.cells.front())].hold == Hold::Idle)
        {
            ++num_idle;
            num_samples += samples[k];
        }
    // Bits of material without samples stay unseen.
    if (num_samples > 0)
        warnings_.push_back(fmt::format(
            "{} of {} components have no region: they stay at rest ({} of "
            "{} samples)",
            num_idle, parts_.size(), num_samples, body_->cell_of_sample.size()));
    warn_of_loose_parts(samples);
    for (const Part& part : parts_)
        if (part.component.free_rotations > 0)
            warnings_.push_back(fmt::format(
                "a component of {} cells is held by {} alone: {} of its rotations are "
                "free and are kept as they are",
                part.component.cells.size(),
                part.component.free_rotations == 3 || rest().flat_axis >= 0
                    ? "one pin"
                    : "pins in a line",
                part.component.free_rotations));
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
    fades_ = fades_of(exact, body_->cells, constraints_, region_of_cell_, rest().samples,
                      body_->cell_of_sample);
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

/// The next step of the regions begins where they are.
void CellSystem::settle_regions()
{
    last_motions_ = motions_;
    last_splines_ = splines_;
    is_bent_.assign(splines_.size(), 0);
    last_station_motions_ = station_motions_;
}

void CellSystem::set_state(std::span<const Pose> poses, std::span<const Motion> motions)
{
    std::copy(poses.begin(), poses.end(), poses_.begin());
    move_regions(motions);
    settle_regions();
}

void CellSystem::set_state(std::span<const Pose> poses, const CellSystem& other)
{
    on_guide_ = other.on_guide_;
    std::copy(poses.begin(), poses.end(), poses_.begin());
    for (const Group& group : groups_)
        poses_[idx(group.cells.front())].R = other.found_motions_[group.region].R;
    move_regions(other.motions_, other.splines_, other.way_left_);
    settle_regions();
}

void CellSystem::set_state(const CellSystemState& state)
{
    on_guide_ = state.on_guide;
    move_regions(state.motions, state.splines, state.way_left);
    settle_regions();
    poses_ = state.poses; // also of pinned cells, whose places would be found anew
    settle_groups();
    minimizer_->forget(poses_, state.is_refreshed);
}

void CellSystem::move_regions(std::span<const Motion> motions,
                              std::span<const std::shared_ptr<const SplineState>> splines,
                              double way_left)
{
    way_left_ = way_left;
    last_motions_.swap(motions_);
    std::copy(motions.begin(), motions.end(), motions_.begin());
    last_splines_ = splines_;
    std::copy(splines.begin(), splines.end(), splines_.begin());
    for (std::size_t r = 0; r < splines_.size(); ++r)
        is_bent_[r] =
            splines_[r] != last_splines_[r] && !splines_[r]->is_at(*last_splines_[r]);
    last_station_motions_.swap(station_motions_);
    find_station_motions(station_motions_);
    for (std::size_t c = 0; c < constraints_.size(); ++c)
    {
        const int owner = region_of_cell_[c];
        if (owner < 0)
            continue;
        const Motion& motion = motions_[idx(owner)];
        Constraint& constraint = constraints_[c];
        const Eigen::Vector3d& centre = body_->cells.cells[c].centre;
        if (constraint.hold == Hold::Prescribed)
            poses_[c] = (*regions_)[idx(owner)].is_rod() ? pose_on_rod(c)
                                                         : carried(motion, centre);
        else if (constraint.hold == Hold::Pinned || constraint.hold == Hold::Grouped)
        {
            constraint.held_now = constraint.held_rest + motion.t;
            poses_[c] = held_at_pin(poses_[c], constraint, centre);
        }
    }
    hold_guided();
    settle_groups();
    minimizer_->set_held_points(constraints_);
    place_pushing_rods();
}

/// \p borders: of the regions. Nothing where no pin is among what holds a component.
std::vector<CellSystem::Holder>
CellSystem::holders_of(const Component& component,
                       std::span<const Eigen::Vector3d> borders) const
{
    std::vector<Holder> holders;
    std::set<std::size_t> pins, others; // regions
    for (const int cell : component.cells)
    {
        const int owner = region_of_cell_[idx(cell)];
        const Constraint& constraint = constraints_[idx(cell)];
        if (owner >= 0 && constraint.hold == Hold::Prescribed)
            others.insert(idx(owner));
        else if (owner >= 0 && pins.insert(idx(owner)).second)
            holders.push_back({idx(owner), constraint.held_rest, true});
    }
    if (holders.empty())
        return holders;
    for (const std::size_t region : others)
        if (!(*regions_)[region].is_rod())
            holders.push_back({region, borders[region], false});
        else
            for (std::size_t k = first_station_[region]; k < first_station_[region + 1];
                 ++k)
                holders.push_back(
                    {regions_->size() + k,
                     (*regions_)[region].spline->rest()->at(stations_[k].s).place,
                     false});
    return holders;
}

/// From where places were to where they are; in the plane of what is flat.
Motion CellSystem::best_step(std::span<const Eigen::Vector3d> from,
                             std::span<const Eigen::Vector3d> to) const
{
    const int axis = rest().flat_axis;
    return axis < 0 ? rigid_fit(from, to)
                    : rigid_fit_about(Eigen::Vector3d::Unit(axis), from, to);
}

/// The step of each pin of a part: it turns as the part does as a whole.
void CellSystem::turn_pins(Part& part)
{
    const auto motion_of = [&](std::size_t step, const auto& regions,
                               const auto& stations) -> const Motion&
    { return step < regions.size() ? regions[step] : stations[step - regions.size()]; };
    for (std::size_t h = 0; h < part.holders.size(); ++h)
    {
        const Holder& holder = part.holders[h];
        part.from[h] =
            holder.at(motion_of(holder.step, last_motions_, last_station_motions_));
        part.to[h] = holder.at(motion_of(holder.step, motions_, station_motions_));
    }
    const Motion best = best_step(part.from, part.to);
    for (std::size_t h = 0; h < part.holders.size(); ++h)
        if (part.holders[h].is_pin)
            steps_[part.holders[h].step] = {best.R, part.to[h] - best.R * part.from[h]};
}

Motion CellSystem::PinWay::at(double t) const
{
    return {Eigen::Matrix3d::Identity(), around.at(t)(from) + t * left - rest};
}

std::vector<CellSystem::PinWay> CellSystem::pin_ways(std::span<const Motion> from,
                                                     std::span<const Motion> to) const
{
    std::vector<PinWay> ways;
    for (const Part& part : parts_)
    {
        std::vector<Eigen::Vector3d> before, after;
        for (const Holder& holder : part.holders)
            if (holder.step < from.size() && !(*regions_)[holder.step].guide)
            {
                before.push_back(holder.at(from[holder.step]));
                after.push_back(holder.at(to[holder.step]));
            }
        // The targets of rods and curves are found on the way.
        if (before.size() < part.holders.size() || before.empty())
            continue;
        Step best;
        best.kind = Step::Kind::Screw;
        best.motion = best_step(before, after);
        if (best.motion.R.isIdentity(0))
            continue;
        for (std::size_t h = 0; h < part.holders.size(); ++h)
            if (const Holder& holder = part.holders[h];
                holder.is_pin && before[h] != after[h])
                ways.push_back({holder.step, HandleTrajectory({}, {best}), holder.rest,
                                before[h], after[h] - best.motion(before[h])});
    }
    return ways;
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
            if (owner < 0 || (constraints_[c].hold != Hold::Prescribed) != is_pin)
                continue;
            const std::size_t r = idx(owner);
            if (is_bent_[r] && (*regions_)[r].is_rod())
                return std::nullopt; // it has bent
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

void CellSystem::make_guess()
{
    if (!guess_)
        guess_.emplace(body_->cells, glue_, constraints_, driving(),
                       static_cast<int>(steps_.size()));
}

void CellSystem::carry_others()
{
    make_guess();
    for (std::size_t r = 0; r < motions_.size(); ++r)
        steps_[r] = motions_[r] * inverse(last_motions_[r]);
    for (std::size_t k = 0; k < stations_.size(); ++k)
        steps_[motions_.size() + k] =
            station_motions_[k] * inverse(last_station_motions_[k]);
    for (Part& part : parts_)
    {
        if (!part.component.is_held)
            continue;
        if (!part.holders.empty())
            turn_pins(part);
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
            if (constraints_[c].hold == Hold::Pinned ||
                constraints_[c].hold == Hold::Sliding ||
                constraints_[c].hold == Hold::Grouped)
                pose = held_at_pin(pose, constraints_[c], body_->cells.cells[c].centre);
        }
    }
    settle_groups();
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
    take_guided();
    settle_groups();
}

/// Where the last solve has left pins on curves.
void CellSystem::take_guided()
{
    for (const Guided& guided : guided_)
    {
        Constraint& constraint = constraints_[idx(guided.cell)];
        constraint.s = minimizer_->constraint(guided.cell).s;
        constraint.held_now = minimizer_->constraint(guided.cell).held_now;
        on_guide_[guided.region] = constraint.s;
        motions_[guided.region].t = constraint.held_now - constraint.held_rest;
    }
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
    if (pushing_ &&
        (report.iterations > 0 || std::count(is_bent_.begin(), is_bent_.end(), 1) > 0))
        solve_to_holds(options, 1e-3 * ms_since(start), report);
    take_guided();
    settle_groups();
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
        const int a = region_of_cell_[idx(face.a)], b = region_of_cell_[idx(face.b)];
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
