// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/region_driving.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <string>

#include "io/base/error.h"
#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

/// Places of a rod whose motions the others take part in, at the most.
constexpr int kMostStations = 16;

} // namespace

RegionDriving::RegionDriving(std::shared_ptr<const Body> body,
                             std::shared_ptr<const RegionSet> regions,
                             std::vector<int> region_of_cell,
                             std::span<const BorderGlue> borders,
                             std::vector<Pose>& poses)
    : body_(std::move(body)), regions_(std::move(regions)),
      region_of_cell_(std::move(region_of_cell)), now_(regions_->size()),
      is_bent_(regions_->size(), 0), found_motions_(regions_->size())
{
    hold_cells();
    set_insets(borders);
    place_stations();
    last_ = now_;
    place_guided(poses);
}

void RegionDriving::hold_cells()
{
    constraints_.resize(body_->cells.size());
    for (std::size_t c = 0; c < constraints_.size(); ++c)
    {
        const int owner = region_of_cell_[c];
        if (owner < 0)
            continue;
        const Region& region = (*regions_)[idx(owner)];
        constraints_[c].hold = region.role == Role::Pin ? Hold::Pinned : Hold::Prescribed;
        // All cells of a pin of one place are held there: where it turns, no two of them
        // are held apart.
        constraints_[c].held_rest = region.is_pin_of_one_place()
                                        ? rest().samples[region.samples.front()]
                                        : centre_of(c);
    }
    for (std::size_t r = 0; r < regions_->size(); ++r)
        if ((*regions_)[r].turns_freely())
            hold_group(r);
    for (Constraint& constraint : constraints_)
    {
        constraint.held_now = constraint.held_rest;
        constraint.flat_axis = rest().flat_axis;
    }
}

/// The cells of a pin of several places: one body that turns about their centroid.
void RegionDriving::hold_group(std::size_t region)
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

/// Sets where the regions end within the cells that they hold: the glue of a border is as
/// long as from the free cell's middle to there.
void RegionDriving::set_insets(std::span<const BorderGlue> borders)
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

bool RegionDriving::is_on_rod(std::size_t cell) const
{
    const int owner = region_of_cell_[cell];
    return owner >= 0 && (*regions_)[idx(owner)].is_rod();
}

/// About one a cell along each rod.
void RegionDriving::place_stations()
{
    first_station_.push_back(0);
    for (std::size_t r = 0; r < regions_->size(); ++r)
    {
        const Region& region = (*regions_)[r];
        if (region.spline)
            now_[r].spline = region.spline->rest();
        if (region.is_rod())
        {
            on_rod_.resize(region_of_cell_.size(), 0.0);
            for (std::size_t c = 0; c < region_of_cell_.size(); ++c)
                if (region_of_cell_[c] == static_cast<int>(r))
                    on_rod_[c] = region.spline->nearest(centre_of(c));
            const double edge = rest().material.grid.shape().edge;
            const int count = static_cast<int>(
                std::clamp(1.0 + std::round(now_[r].spline->length() / edge), 2.0,
                           static_cast<double>(kMostStations)));
            for (int k = 0; k < count; ++k)
                stations_.push_back({r, region.spline->parameter_of_share(
                                            static_cast<double>(k) / (count - 1))});
        }
        first_station_.push_back(stations_.size());
    }
    station_motions_.resize(stations_.size());
    last_station_motions_ = station_motions_;
}

RailPlace RegionDriving::GuideRail::at(double s) const
{
    const RailPlace place = curve_.spline->at(s);
    return {curve_.motion(place.place) + off_, curve_.motion.R * place.first,
            curve_.motion.R * place.second};
}

/// The one cell that holds the place of each pin on a curve; others are free again.
void RegionDriving::place_guided(std::vector<Pose>& poses)
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
        now_[r].s = region.guide->at ? spline.parameter_of_share(*region.guide->at)
                                     : spline.nearest(place);
        Constraint& constraint = constraints_[idx(own)];
        constraint.hold = region.guide->at ? Hold::Pinned : Hold::Sliding;
        constraint.held_rest = constraint.held_now = place;
        guided_.push_back({r, own, place - spline.rest()->at(now_[r].s).place, nullptr});
    }
    hold_guided(poses);
}

/// Puts the pins onto their curves.
void RegionDriving::hold_guided(std::vector<Pose>& poses)
{
    for (Guided& guided : guided_)
    {
        const std::size_t curve = (*regions_)[guided.region].guide->region;
        if (!guided.rail) // its place stays: constraints and states point there
            guided.rail = std::make_unique<GuideRail>(*(*regions_)[curve].spline);
        guided.rail->set(now_[curve], way_left_ * guided.off);
        Driven& pin = now_[guided.region];
        Constraint& constraint = constraints_[idx(guided.cell)];
        constraint.s = pin.s;
        constraint.rail = constraint.hold == Hold::Sliding ? guided.rail.get() : nullptr;
        constraint.held_now = guided.rail->at(constraint.s).place;
        pin.motion = {Eigen::Matrix3d::Identity(),
                      constraint.held_now - constraint.held_rest};
        poses[idx(guided.cell)] =
            held_at_pin(poses[idx(guided.cell)], constraint, centre_of(idx(guided.cell)));
    }
}

Eigen::Vector3d RegionDriving::rest_of_rod_step(std::size_t step) const
{
    const auto& [region, s] = stations_[step - now_.size()];
    return (*regions_)[region].spline->rest()->at(s).place;
}

std::vector<Driving> RegionDriving::driving() const
{
    std::vector<Driving> driving(region_of_cell_.begin(), region_of_cell_.end());
    for (std::size_t c = 0; c < on_rod_.size(); ++c)
    {
        if (!is_on_rod(c))
            continue;
        const std::size_t owner = idx(region_of_cell_[c]);
        std::size_t k = first_station_[owner];
        const std::size_t last = first_station_[owner + 1] - 1;
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

void RegionDriving::find_station_motions()
{
    for (std::size_t k = 0; k < stations_.size(); ++k)
    {
        const auto& [region, s] = stations_[k];
        station_motions_[k] = now_[region].motion * now_[region].spline->carry(s);
    }
}

Pose RegionDriving::pose_on_rod(std::size_t cell) const
{
    const Driven& rod = now_[idx(region_of_cell_[cell])];
    const Motion bent = rod.spline->carry(on_rod_[cell]);
    if (bent.R.isIdentity(0) && bent.t.isZero(0))
        return carried(rod.motion, centre_of(cell));
    return carried(rod.motion * bent, centre_of(cell));
}

Motion RegionDriving::motion_at(std::size_t region, const Eigen::Vector3d& x) const
{
    if (!(*regions_)[region].is_rod())
        return found_motions_[region];
    return now_[region].motion *
           now_[region].spline->carry((*regions_)[region].spline->nearest(x));
}

bool RegionDriving::has_bent() const
{
    return std::count(is_bent_.begin(), is_bent_.end(), 1) > 0;
}

void RegionDriving::move(std::span<const Motion> motions,
                         std::span<const std::shared_ptr<const SplineState>> splines,
                         double way_left, std::vector<Pose>& poses)
{
    way_left_ = way_left;
    last_ = now_;
    for (std::size_t r = 0; r < now_.size(); ++r)
    {
        now_[r].motion = motions[r];
        if (!splines.empty())
            now_[r].spline = splines[r];
        is_bent_[r] =
            now_[r].spline != last_[r].spline && !now_[r].spline->is_at(*last_[r].spline);
    }
    last_station_motions_ = station_motions_;
    place_cells(poses);
}

void RegionDriving::start_from(std::span<const Driven> regions, double way_left,
                               std::vector<Pose>& poses)
{
    way_left_ = way_left;
    std::copy(regions.begin(), regions.end(), now_.begin());
    place_cells(poses);
    last_ = now_;
    is_bent_.assign(is_bent_.size(), 0);
    last_station_motions_ = station_motions_;
}

/// Puts the cells of the regions where these are now.
void RegionDriving::place_cells(std::vector<Pose>& poses)
{
    find_station_motions();
    for (std::size_t c = 0; c < constraints_.size(); ++c)
    {
        const int owner = region_of_cell_[c];
        if (owner < 0)
            continue;
        const Motion& motion = now_[idx(owner)].motion;
        Constraint& constraint = constraints_[c];
        if (constraint.hold == Hold::Prescribed)
            poses[c] = is_on_rod(c) ? pose_on_rod(c) : carried(motion, centre_of(c));
        else if (constraint.hold == Hold::Pinned || constraint.hold == Hold::Grouped)
        {
            constraint.held_now = constraint.held_rest + motion.t;
            poses[c] = held_at_pin(poses[c], constraint, centre_of(c));
        }
    }
    hold_guided(poses);
    settle_groups(poses);
}

void RegionDriving::settle_groups(std::vector<Pose>& poses)
{
    for (std::size_t r = 0; r < now_.size(); ++r)
        found_motions_[r] = now_[r].motion;
    for (const Group& group : groups_)
    {
        const std::size_t leader = idx(group.cells.front());
        const Eigen::Matrix3d& R = poses[leader].R;
        Motion& found = found_motions_[group.region];
        found.R = R;
        if (!R.isIdentity(0))
            found.t = constraints_[leader].held_now - R * constraints_[leader].held_rest;
        for (const int cell : group.cells)
            poses[idx(cell)] = carried(found, centre_of(idx(cell)));
    }
}

void RegionDriving::turn_groups(std::span<const Motion> found_motions,
                                std::vector<Pose>& poses) const
{
    for (const Group& group : groups_)
        poses[idx(group.cells.front())].R = found_motions[group.region].R;
}

void RegionDriving::take_pins(const CellMinimizer& solved)
{
    for (const Guided& guided : guided_)
    {
        Constraint& constraint = constraints_[idx(guided.cell)];
        constraint.s = solved.constraint(guided.cell).s;
        constraint.held_now = solved.constraint(guided.cell).held_now;
        now_[guided.region].s = constraint.s;
        now_[guided.region].motion.t = constraint.held_now - constraint.held_rest;
    }
}

void RegionDriving::place_rods(std::vector<Pose>& poses)
{
    for (std::size_t c = 0; c < region_of_cell_.size(); ++c)
        if (is_on_rod(c))
            poses[c] = pose_on_rod(c);
    find_station_motions();
}

std::vector<PushingSpline>
RegionDriving::pushing_splines(std::span<const Component> components) const
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
        PushingSpline rod{region.spline, {}, {}, {}, false, r};
        for (std::size_t c = 0; c < region_of_cell_.size(); ++c)
        {
            if (region_of_cell_[c] != static_cast<int>(r))
                continue;
            rod.cells.push_back(static_cast<int>(c));
            rod.at.push_back(on_rod_[c]);
            rod.centres.push_back(centre_of(c));
        }
        if (rod.cells.empty())
            continue;
        rod.is_alone =
            std::all_of(rod.cells.begin(), rod.cells.end(),
                        [&](int cell) {
                            return holding[idx(component_of_cell[idx(cell)])].size() == 1;
                        });
        rods.push_back(std::move(rod));
    }
    return rods;
}

} // namespace cellwarp::core
