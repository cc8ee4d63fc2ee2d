// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/carried_parts.h"

#include <algorithm>
#include <set>

#include "octree/base/index.h"
#include "octree/base/rigid_fit.h"

namespace cellwarp::core
{

namespace
{

/// Steps of all regions that differ by no more are one rigid motion.
constexpr double kSameStep = 1e-12;

bool agree(const Motion& a, const Motion& b, double scale)
{
    return (a.R - b.R).norm() <= kSameStep && (a.t - b.t).norm() <= kSameStep * scale;
}

} // namespace

CarriedParts::CarriedParts(std::shared_ptr<const Body> body,
                           std::shared_ptr<const RegionSet> regions,
                           const RegionDriving& driving,
                           std::vector<Component> components,
                           std::span<const Eigen::Vector3d> borders)
    : body_(std::move(body)), regions_(std::move(regions)),
      components_(std::move(components)), steps_(driving.num_steps())
{
    for (const Component& component : components_)
    {
        Part& part = parts_.emplace_back();
        for (const int cell : component.cells)
            if (driving.constraints()[idx(cell)].hold != Hold::Prescribed)
                part.movable.push_back(cell);
        part.holders = holders_of(component, driving, borders);
        part.from.resize(part.holders.size());
        part.to = part.from;
    }
}

/// \p borders: of the regions. Nothing where no pin is among what holds a component.
std::vector<CarriedParts::Holder>
CarriedParts::holders_of(const Component& component, const RegionDriving& driving,
                         std::span<const Eigen::Vector3d> borders) const
{
    std::vector<Holder> holders;
    std::set<std::size_t> pins, others; // regions
    for (const int cell : component.cells)
    {
        const int owner = driving.region_of_cell()[idx(cell)];
        const Constraint& constraint = driving.constraints()[idx(cell)];
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
            for (auto [step, end] = driving.steps_of_rod(region); step < end; ++step)
                holders.push_back({step, driving.rest_of_rod_step(step), false});
    return holders;
}

/// From where places were to where they are; in the plane of what is flat.
Motion CarriedParts::best_step(std::span<const Eigen::Vector3d> from,
                               std::span<const Eigen::Vector3d> to) const
{
    const int axis = body_->rest->flat_axis;
    return axis < 0 ? rigid_fit(from, to)
                    : rigid_fit_about(Eigen::Vector3d::Unit(axis), from, to);
}

/// The step of each pin of a part: it turns as the part does as a whole.
void CarriedParts::turn_pins(Part& part, const RegionDriving& driving)
{
    for (std::size_t h = 0; h < part.holders.size(); ++h)
    {
        const Holder& holder = part.holders[h];
        part.from[h] = holder.at(driving.before_step(holder.step));
        part.to[h] = holder.at(driving.after_step(holder.step));
    }
    const Motion best = best_step(part.from, part.to);
    for (std::size_t h = 0; h < part.holders.size(); ++h)
        if (part.holders[h].is_pin)
            steps_[part.holders[h].step] = {best.R, part.to[h] - best.R * part.from[h]};
}

Motion PinWay::at(double t) const
{
    return {Eigen::Matrix3d::Identity(), around.at(t)(from) + t * left - rest};
}

std::vector<PinWay> CarriedParts::pin_ways(std::span<const Motion> from,
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
        const Motion best = best_step(before, after);
        if (best.R.isIdentity(0))
            continue;
        for (std::size_t h = 0; h < part.holders.size(); ++h)
            if (const Holder& holder = part.holders[h];
                holder.is_pin && before[h] != after[h])
                ways.push_back({holder.step, HandleTrajectory({}, {best}), holder.rest,
                                before[h], after[h] - best(before[h])});
    }
    return ways;
}

/// The one rigid step that all regions of a component make, if they do. A pin takes part
/// if the step takes its held points where they must be.
std::optional<Motion> CarriedParts::rigid_step_of(const Component& component,
                                                  const RegionDriving& driving) const
{
    std::optional<Motion> step;
    for (const bool is_pin : {false, true})
        for (const int cell : component.cells)
        {
            const int owner = driving.region_of_cell()[idx(cell)];
            const Constraint& constraint = driving.constraints()[idx(cell)];
            if (owner < 0 || (constraint.hold != Hold::Prescribed) != is_pin)
                continue;
            const std::size_t r = idx(owner);
            if (driving.is_bent(r) && (*regions_)[r].is_rod())
                return std::nullopt; // it has bent
            if (!step)
                step = steps_[r];
            const double scale = std::max(1.0, steps_[r].t.norm());
            const bool agrees =
                is_pin ? ((*step)(constraint.held_rest + driving.before_step(r).t) -
                          constraint.held_now)
                                 .norm() <= kSameStep * scale
                       : agree(*step, steps_[r], scale);
            if (!agrees)
                return std::nullopt;
        }
    return step;
}

void CarriedParts::make_guess(const Glue& glue, const RegionDriving& driving)
{
    if (!guess_)
        guess_.emplace(body_->cells, glue, driving.constraints(), driving.driving(),
                       static_cast<int>(steps_.size()));
}

void CarriedParts::carry(const RegionDriving& driving, std::vector<Pose>& poses)
{
    for (std::size_t k = 0; k < steps_.size(); ++k)
        steps_[k] = driving.after_step(k) * inverse(driving.before_step(k));
    for (std::size_t p = 0; p < parts_.size(); ++p)
    {
        if (!components_[p].is_held)
            continue;
        Part& part = parts_[p];
        if (!part.holders.empty())
            turn_pins(part, driving);
        const std::optional<Motion> rigid = rigid_step_of(components_[p], driving);
        if (rigid && rigid->R.isIdentity(0) && rigid->t.isZero(0))
            continue;
        if (!rigid)
            guess_->carry(steps_, part.movable, poses);
        for (const int cell : part.movable)
        {
            const Constraint& constraint = driving.constraints()[idx(cell)];
            Pose& pose = poses[idx(cell)];
            if (rigid)
                pose = {rigid->R * pose.R, (*rigid)(pose.p)};
            if (constraint.hold == Hold::Pinned || constraint.hold == Hold::Sliding ||
                constraint.hold == Hold::Grouped)
                pose =
                    held_at_pin(pose, constraint, body_->cells.cells[idx(cell)].centre);
        }
    }
}

} // namespace cellwarp::core
