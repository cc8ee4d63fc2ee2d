// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/field/field.h"

#include <algorithm>
#include <cmath>

#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "octree/base/point_tree.h"
#include "solver/field/place_lanes.h"

namespace cellwarp::core
{

namespace
{

/// Over how far outside its cell's box a point leaves the RBF for the cells' own rigid
/// motions [edge].
constexpr double kOutside = 1.0;

/// A cell that counts in the box of another is no more than so many faces away.
constexpr int kRingsThatCount = 4;

/// So many points in a box that looking around beforehand always pays.
constexpr std::size_t kManyPoints = std::size_t(1) << 20;

} // namespace

RbfCentres centres_of_all(FieldKind kind, const Cells& cells,
                          std::span<const Constraint> constraints,
                          std::span<const Pose> poses)
{
    if (kind == FieldKind::RbfCentres)
        return cell_centres(cells, constraints, poses);
    return CentreChoice(cells, constraints).centres_of_all(poses);
}

Field::Field(const Cells& cells, FieldParts parts)
    : cells_(cells), parts_(std::move(parts)), closest_(cells),
      maps_(cell_maps(cells, parts_.poses)), regions_(parts_.regions, cells.size())
{
    if (parts_.kind == FieldKind::Closest4)
        closest4_.emplace(cells);
}

void Field::keep_surroundings(std::size_t max_bytes)
{
    kept_ = std::make_unique<KeptSurroundings>(cells_.size(), max_bytes);
}

/// What one thread keeps while it evaluates a field.
class Field::Evaluation
{
public:
    explicit Evaluation(const Field& field) : field_(field), influences_(field.closest_)
    {
    }

    /// All points in the material of one cell, in a box (clamped to the cell's). \p
    /// num_points: so many are expected there.
    void enter(int own, const Eigen::Vector3d& low, const Eigen::Vector3d& high,
               std::size_t num_points)
    {
        look_around(own, low, high, num_points, scratch_around_);
        around_ = &scratch_around_;
    }
    /// Likewise in one octant of the cell.
    void enter(int own, std::size_t octant, std::size_t num_points)
    {
        const Eigen::AlignedBox3d box = part_box(own, octant);
        enter(own, box.min(), box.max(), num_points);
    }
    /// Likewise in an octant, or in the whole box, with what is kept of it; false if that
    /// is nothing.
    bool enter_kept(int own, std::size_t part)
    {
        const Surroundings* const kept = field_.kept_->get(
            own, part,
            [&]
            {
                const Eigen::AlignedBox3d box = part_box(own, part);
                Surroundings made;
                look_around(own, box.min(), box.max(), kManyPoints, made);
                made.cells.shrink();
                return made;
            });
        if (kept)
            around_ = kept;
        return kept != nullptr;
    }

    /// The first \p count of eight places. What it returns is good until the next call.
    const ValueOnPlaces& find(const PlaceVectors& places, int count, bool wants_gradient)
    {
        ValueOnPlaces& out = values_;
        const std::span<const InfluenceOnPlaces> near =
            influences_.find(places, around_->cells, wants_gradient);
        find_base(places, near, wants_gradient, out);
        const bool is_touched = field_.regions_.touches(around_->cells.own());
        for (int l = 0; l < count; ++l)
        {
            if (!is_touched && influences_.are_inside()[l])
                continue;
            single_.clear();
            for (const InfluenceOnPlaces& influence : near)
                if (influence.weight[l] > 0)
                    single_.push_back({influence.cell, influence.weight[l],
                                       influence.gradient.row(l).transpose().matrix()});
            const Eigen::Vector3d x = places.row(l).transpose().matrix();
            FieldValue value = out.at(l);
            field_.regions_.correct(x, single_, around_->nodes, wants_gradient, scratch_,
                                    value);
            out.set(l, value);
        }
        return out;
    }

private:
    Eigen::AlignedBox3d part_box(int own, std::size_t part) const
    {
        const Eigen::Vector3d& centre = field_.closest_.box_centre(own);
        const Eigen::Vector3d half =
            Eigen::Vector3d::Constant(0.5 * field_.closest_.edge(own));
        if (part == kWholeBox)
            return {centre - half, centre + half};
        const Eigen::Vector3d corner =
            centre + half.cwiseProduct(Eigen::Vector3d(
                         part & 1 ? 1 : -1, part & 2 ? 1 : -1, part & 4 ? 1 : -1));
        return {centre.cwiseMin(corner), centre.cwiseMax(corner)};
    }
    void look_around(int own, const Eigen::Vector3d& low, const Eigen::Vector3d& high,
                     std::size_t num_points, Surroundings& out) const
    {
        out.cells.find(field_.closest_, own, low, high);
        out.nodes.enter(Eigen::AlignedBox3d(low, high), num_points);
        if (field_.regions_.touches(own))
            field_.regions_.fades().make_ways(out.cells.cells(), out.nodes);
    }

    /// Without the regions.
    void find_base(const PlaceVectors& places, std::span<const InfluenceOnPlaces> near,
                   bool wants_gradient, ValueOnPlaces& out)
    {
        const FieldParts& parts = field_.parts_;
        if (field_.closest4_)
            find_by_closest4(places, out);
        else if (!parts.local && !parts.global)
            blend(near, field_.maps_, places, wants_gradient, out);
        else
        {
            const PlaceVectors kept = without_far_ones(places);
            if (parts.local)
            {
                parts.local->find_shares(near, wants_gradient, shares_);
                if (LocalRbf::has_blend(shares_))
                    blend(near, field_.maps_, kept, wants_gradient, blended_);
                if (wants_gradient)
                    parts.local->value(kept, shares_, blended_, out);
                else
                    parts.local->displacement(kept, shares_, blended_, out.displacement);
            }
            else
                parts.global->value(kept, out);
            fade_outside(places, near, wants_gradient, out);
        }
    }

    void find_by_closest4(const PlaceVectors& places, ValueOnPlaces& out)
    {
        for (int l = 0; l < kPlaces; ++l)
        {
            const Eigen::Vector3d x = places.row(l).transpose().matrix();
            field_.closest4_->influences(x, single_);
            out.set(l, blended(single_, field_.parts_.poses, field_.cells_, x));
        }
    }

    /// Where the RBF does not count its numbers might not even be finite: such places are
    /// put onto the box.
    PlaceVectors without_far_ones(const PlaceVectors& places) const
    {
        if (influences_.are_inside().all())
            return places;
        const Cell& cell = own_cell();
        PlaceVectors kept = places;
        for (int l = 0; l < kPlaces; ++l)
        {
            const Eigen::Vector3d x = places.row(l).transpose().matrix();
            const Eigen::Vector3d nearest = nearest_in_box(cell.box_centre, cell.edge, x);
            if ((x - nearest).norm() >= kOutside * cell.edge)
                kept.row(l) = nearest.transpose().array();
        }
        return kept;
    }

    /// An RBF grows without bound: beside its material it gives way to the rigid motions
    /// around.
    void fade_outside(const PlaceVectors& places, std::span<const InfluenceOnPlaces> near,
                      bool wants_gradient, ValueOnPlaces& out)
    {
        if (influences_.are_inside().all())
            return;
        const Cell& cell = own_cell();
        const double width = kOutside * cell.edge;
        bool has_outside = false;
        for (int l = 0; l < kPlaces; ++l)
        {
            const Eigen::Vector3d x = places.row(l).transpose().matrix();
            const Eigen::Vector3d beyond =
                x - nearest_in_box(cell.box_centre, cell.edge, x);
            const double distance = beyond.norm();
            if (distance == 0.0)
                continue;
            if (!has_outside)
                blend(near, field_.maps_, places, wants_gradient, outside_);
            has_outside = true;
            if (distance >= width)
            {
                out.set(l, outside_.at(l));
                continue;
            }
            const double u = distance / width;
            const double share = u * u * u * (10.0 + u * (6.0 * u - 15.0));
            const double slope =
                30.0 * u * u * (1.0 - u) * (1.0 - u) / (width * distance);
            FieldValue value = out.at(l);
            const FieldValue rigid = outside_.at(l);
            const Eigen::Vector3d difference = rigid.displacement - value.displacement;
            value.displacement += share * difference;
            value.gradient += share * (rigid.gradient - value.gradient) +
                              difference * (slope * beyond).transpose();
            out.set(l, value);
        }
    }

    const Cell& own_cell() const
    {
        return field_.cells_.cells[idx(around_->cells.own())];
    }

    const Field& field_;
    PlaceInfluences influences_;
    const Surroundings* around_ = nullptr; ///< of the points entered
    Surroundings scratch_around_;
    LocalRbf::Shares shares_;
    std::vector<Influence> single_;
    MovedRegions::Scratch scratch_;
    ValueOnPlaces values_, outside_, blended_;
};

namespace
{

/// Takes what a field finds, for one point or for several.
template <class One, class OfPlaces>
struct TakeValues : One, OfPlaces
{
    TakeValues(One one, OfPlaces of_places) : One(one), OfPlaces(of_places) {}
    using One::operator();
    using OfPlaces::operator();
};

} // namespace

FieldValue Field::value(const Eigen::Vector3d& x, int own) const
{
    FieldValue value;
    evaluate({&x, 1}, {&own, 1}, true,
             TakeValues([&](std::size_t, const FieldValue& found) { value = found; },
                        [&](std::size_t, const ValueOnPlaces& found, int place)
                        { value = found.at(place); }));
    return value;
}

std::vector<FieldValue> Field::values(std::span<const Eigen::Vector3d> points,
                                      std::span<const int> own) const
{
    std::vector<FieldValue> result(points.size());
    evaluate(points, own, true,
             TakeValues([&](std::size_t i, const FieldValue& value)
                        { result[i] = value; },
                        [&](std::size_t i, const ValueOnPlaces& values, int place)
                        { result[i] = values.at(place); }));
    return result;
}

std::vector<Eigen::Vector3d> Field::displacements(std::span<const Eigen::Vector3d> points,
                                                  std::span<const int> own) const
{
    std::vector<Eigen::Vector3d> result(points.size());
    evaluate(points, own, false,
             TakeValues([&](std::size_t i, const FieldValue& value)
                        { result[i] = value.displacement; },
                        [&](std::size_t i, const ValueOnPlaces& values, int place) {
                            result[i] =
                                values.displacement.row(place).transpose().matrix();
                        }));
    return result;
}

namespace
{

/// Points of one octant of a cell's box that are worth a search of their own.
constexpr std::size_t kOwnSearch = 16;

/// Points that one thread does at once.
constexpr std::size_t kTaskPoints = 512;

/// The points in the order of their cells, and in each of its octants.
struct CellOrder
{
    std::vector<std::uint32_t> points;
    std::vector<std::uint8_t> octants; ///< of each point, as given
    std::vector<std::size_t> ends;     ///< of tasks, each of one cell
};

CellOrder in_cell_order(std::span<const Eigen::Vector3d> points, std::span<const int> own,
                        const ClosestCells& closest, std::size_t num_cells)
{
    CellOrder order;
    order.octants.resize(points.size());
    parallel_ranges(points.size(), 4096,
                    [&](std::size_t begin, std::size_t end)
                    {
                        for (std::size_t i = begin; i < end; ++i)
                        {
                            const Eigen::Array3d d =
                                (points[i] - closest.box_centre(own[i])).array();
                            order.octants[i] = static_cast<std::uint8_t>(
                                (d[0] > 0) + 2 * (d[1] > 0) + 4 * (d[2] > 0));
                        }
                    });
    std::vector<std::uint32_t> first(kOctants * num_cells + 1, 0);
    const auto key = [&](std::size_t i)
    { return kOctants * idx(own[i]) + order.octants[i]; };
    for (std::size_t i = 0; i < points.size(); ++i)
        ++first[key(i) + 1];
    for (std::size_t k = 1; k < first.size(); ++k)
        first[k] += first[k - 1];
    std::vector<std::uint32_t> next(first.begin(), first.end() - 1);
    order.points.resize(points.size());
    for (std::size_t i = 0; i < points.size(); ++i)
        order.points[next[key(i)]++] = static_cast<std::uint32_t>(i);
    for (std::size_t cell = 0; cell < num_cells; ++cell)
        for (std::size_t at = first[kOctants * cell]; at < first[kOctants * (cell + 1)];)
        {
            at = std::min<std::size_t>(first[kOctants * (cell + 1)], at + kTaskPoints);
            order.ends.push_back(at);
        }
    return order;
}

} // namespace

/// Sorted, so that neighbours find the same cells and RBFs, in memory as well.
template <class Take>
void Field::evaluate(std::span<const Eigen::Vector3d> points, std::span<const int> own,
                     bool wants_gradient, const Take& take) const
{
    const bool keeps = kept_ && kept_->expect(points.size());
    const CellOrder order = in_cell_order(points, own, closest_, cells_.size());
    // Few points leave most of eight places empty: worth it only where these cost little.
    const std::size_t least_kept = parts_.local || parts_.global ? kPlaces / 2 : 1;
    const auto run_task = [&](Evaluation& evaluation, std::span<const std::uint32_t> task)
    {
        const int cell = own[task.front()];
        if (parts_.is_idle[idx(cell)])
        {
            for (const std::uint32_t i : task)
                take(i, FieldValue{});
            return;
        }
        if (const MovedRegion* const deep = regions_.deep_region(cell))
        {
            for (const std::uint32_t i : task)
                take(i, moved_by(deep->motion, points[i]));
            return;
        }
        std::vector<std::uint32_t> no_nodes;
        if (regions_.touches(cell))
        {
            for (const std::uint32_t i : task)
                if (const MovedRegion* const region =
                        regions_.region_of_node(points[i], cell))
                    take(i, moved_by(region->motion, points[i]));
                else
                    no_nodes.push_back(i);
            task = no_nodes;
        }
        const Eigen::Vector3d& centre = closest_.box_centre(cell);
        const double half = 0.5 * closest_.edge(cell);
        const auto run = [&](std::span<const std::uint32_t> some)
        {
            for (std::size_t first = 0; first < some.size(); first += kPlaces)
            {
                const std::size_t count =
                    std::min<std::size_t>(kPlaces, some.size() - first);
                PlaceVectors places;
                for (std::size_t l = 0; l < kPlaces; ++l)
                    places.row(static_cast<Eigen::Index>(l)) =
                        points[some[first + std::min(l, count - 1)]].transpose().array();
                const ValueOnPlaces& values =
                    evaluation.find(places, static_cast<int>(count), wants_gradient);
                for (std::size_t l = 0; l < count; ++l)
                    take(some[first + l], values, static_cast<int>(l));
            }
        };
        std::vector<std::uint32_t> few;
        for (std::size_t begin = 0, end = 0; begin < task.size(); begin = end)
        {
            const std::uint8_t octant = order.octants[task[begin]];
            while (end < task.size() && order.octants[task[end]] == octant)
                ++end;
            const auto some = task.subspan(begin, end - begin);
            if (keeps && some.size() >= least_kept && evaluation.enter_kept(cell, octant))
            {
                run(some);
                continue;
            }
            if (some.size() < kOwnSearch)
            {
                few.insert(few.end(), some.begin(), some.end());
                continue;
            }
            evaluation.enter(cell, octant, some.size());
            run(some);
        }
        if (few.empty())
            return;
        if (keeps && evaluation.enter_kept(cell, kWholeBox))
            return run(few);
        Eigen::Vector3d low = centre + Eigen::Vector3d::Constant(half),
                        high = centre - Eigen::Vector3d::Constant(half);
        for (const std::uint32_t i : few)
        {
            const Eigen::Vector3d x = nearest_in_box(centre, 2.0 * half, points[i]);
            low = low.cwiseMin(x);
            high = high.cwiseMax(x);
        }
        evaluation.enter(cell, low, high, few.size());
        run(few);
    };
    parallel_ranges(
        order.ends.size(), 4,
        [&](std::size_t begin, std::size_t end)
        {
            Evaluation evaluation(*this);
            for (std::size_t t = begin; t < end; ++t)
            {
                const std::size_t first = t == 0 ? 0 : order.ends[t - 1];
                run_task(evaluation,
                         std::span(order.points).subspan(first, order.ends[t] - first));
            }
        });
}

FieldFitter::FieldFitter(const FieldChoice& choice, const Cells& cells,
                         std::span<const Constraint> constraints, RbfSystems* systems)
    : kind_(choice.kind), cells_(cells), constraints_(constraints)
{
    if (kind_ == FieldKind::Rbf)
        local_.emplace(cells, constraints, choice.clusters, systems);
}

Field FieldFitter::fit(std::span<const Pose> poses, std::vector<MovedRegion> regions)
{
    FieldParts parts;
    parts.kind = kind_;
    parts.poses.assign(poses.begin(), poses.end());
    parts.is_idle.assign(cells_.size(), false);
    for (std::size_t i = 0; i < constraints_.size(); ++i)
        parts.is_idle[i] = constraints_[i].hold == Hold::Idle;
    if (local_)
    {
        parts.local = local_->fit(poses);
        parts.residual = local_->residual();
        parts.num_centres = local_->num_centres(poses);
    }
    if (is_dense(kind_))
    {
        const RbfCentres centres = centres_of_all(kind_, cells_, constraints_, poses);
        parts.num_centres = centres.points.size();
        // Where nothing is held all cells are idle, and there is no centre.
        RbfSystem::Fit fit = centres.points.empty()
                                 ? RbfSystem::Fit{RbfField(RbfField::Terms()), 0.0}
                                 : RbfSystem(centres.points).fit(centres.displacements);
        parts.global = std::make_shared<const RbfField>(std::move(fit.field));
        parts.residual = fit.residual;
    }
    if (regions.empty())
        return Field(cells_, std::move(parts));
    const auto first_loose = std::find_if(regions.begin(), regions.end(),
                                          [](const MovedRegion& region)
                                          { return !region.leading_cells.empty(); });
    const std::span<MovedRegion> held(regions.begin(), first_loose);
    const Field without(cells_, parts);
    // Cells that are held at a point follow nobody.
    std::vector<std::vector<bool>> follows;
    for (const MovedRegion& region : held)
        follows.push_back(region.bends || region.may_turn
                              ? std::vector<bool>(cells_.size(), false)
                              : followers_of(region.motion, parts));
    find_misses(without, follows, held);
    std::vector<int> regions_near(cells_.size(), 0); // of each cell
    for (const MovedRegion& region : held)
        for (const int cell : region.fade->near_cells())
            ++regions_near[idx(cell)];
    for (std::size_t r = 0; r < held.size(); ++r)
        find_deep_cells(follows[r], regions_near, held[r]);
    parts.regions = std::move(regions);
    Field field(cells_, std::move(parts));
    field.lead_loose_parts();
    return field;
}

namespace
{

/// The share of the miss of a loose part's node that is corrected. \p miss: its length
/// [edge of the cell]. Over the width of a fade a whole edge would fold the material.
double share_of_miss(double miss)
{
    constexpr double kMostCorrected = 0.5, kLeastLeft = 1.0;
    const double t =
        std::clamp((kLeastLeft - miss) / (kLeastLeft - kMostCorrected), 0.0, 1.0);
    return t * t * (3.0 - 2.0 * t);
}

} // namespace

/// Each node of a loose part goes where the field of the part that leads it takes it, as
/// far as that can be: parts that are moved apart are not drawn out to each other.
void Field::lead_loose_parts()
{
    int most = 0;
    for (MovedRegion& region : parts_.regions)
        if (!region.leading_cells.empty())
        {
            region.misses.assign(region.fade->nodes().size(), FieldValue{});
            most = std::max(most, region.rank);
        }
    for (int rank = 1; rank <= most; ++rank)
    {
        std::vector<Eigen::Vector3d> places;
        std::vector<int> leading, own;
        for (const MovedRegion& region : parts_.regions)
            if (region.rank == rank)
            {
                const RegionFade& fade = *region.fade;
                places.insert(places.end(), fade.nodes().begin(), fade.nodes().end());
                leading.insert(leading.end(), region.leading_cells.begin(),
                               region.leading_cells.end());
                own.insert(own.end(), fade.node_cells().begin(), fade.node_cells().end());
            }
        const std::vector<FieldValue> wanted = values(places, leading),
                                      found = values(places, own);
        std::size_t k = 0;
        for (MovedRegion& region : parts_.regions)
            if (region.rank == rank)
                for (FieldValue& miss : region.misses)
                {
                    const Eigen::Vector3d whole =
                        wanted[k].displacement - found[k].displacement;
                    const double share =
                        share_of_miss(whole.norm() / cells_.cells[idx(own[k])].edge);
                    miss.displacement = share * whole;
                    miss.gradient = share * (wanted[k].gradient - found[k].gradient);
                    ++k;
                }
    }
}

void FieldFitter::find_misses(const Field& field,
                              std::span<const std::vector<bool>> follows,
                              std::span<MovedRegion> regions) const
{
    const ClosestCells closest(cells_);
    struct Missed
    {
        std::size_t region, node;
    };
    std::vector<Missed> missed;
    std::vector<Eigen::Vector3d> places;
    std::vector<int> cells;
    for (std::size_t r = 0; r < regions.size(); ++r)
    {
        const std::vector<Eigen::Vector3d>& nodes = regions[r].fade->nodes();
        const std::vector<int>& own = regions[r].fade->node_cells();
        regions[r].misses.assign(nodes.size(), FieldValue{});
        // Most nodes lie deep in their region, and nothing is missed.
        std::vector<char> is_missed(nodes.size(), false);
        parallel_ranges(nodes.size(), 256,
                        [&](std::size_t begin, std::size_t end)
                        {
                            std::vector<Influence> influences;
                            for (std::size_t i = begin; i < end; ++i)
                            {
                                closest.influences(nodes[i], own[i], influences);
                                is_missed[i] = std::any_of(
                                    influences.begin(), influences.end(),
                                    [&](const Influence& influence)
                                    { return !follows[r][idx(influence.cell)]; });
                            }
                        });
        for (std::size_t i = 0; i < nodes.size(); ++i)
            if (is_missed[i])
            {
                missed.push_back({r, i});
                places.push_back(nodes[i]);
                cells.push_back(own[i]);
            }
    }
    const std::vector<FieldValue> found = field.values(places, cells);
    for (std::size_t k = 0; k < missed.size(); ++k)
    {
        MovedRegion& region = regions[missed[k].region];
        FieldValue& miss = region.misses[missed[k].node];
        const Motion& motion =
            region.bends ? region.node_motions[missed[k].node] : region.motion;
        const FieldValue moved = moved_by(motion, places[k]);
        miss.displacement = moved.displacement - found[k].displacement;
        if (!region.bends && !region.may_turn)
            miss.gradient = moved.gradient - found[k].gradient;
    }
}

/// \p regions_near: how many reach each cell.
void FieldFitter::find_deep_cells(const std::vector<bool>& follows,
                                  std::span<const int> regions_near,
                                  MovedRegion& own) const
{
    own.deep_cells.clear();
    std::vector<int> deep;
    std::vector<bool> is_deep(follows.size(), false);
    const std::vector<int>& near = own.fade->near_cells();
    for (std::size_t i = 0; i < follows.size(); ++i)
    {
        if (!follows[i])
            continue;
        const bool is_near =
            std::binary_search(near.begin(), near.end(), static_cast<int>(i));
        if (regions_near[i] - is_near > 0)
            continue;
        deep.push_back(static_cast<int>(i));
        is_deep[i] = true;
    }
    // Cells all around which, as far as they may count in the box, follow the region and
    // are out of reach of others.
    for (int ring = 0; ring < kRingsThatCount; ++ring)
    {
        std::vector<int> left;
        for (const int cell : deep)
        {
            const std::span<const int> around = cells_.neighbours_of(cell);
            if (std::all_of(around.begin(), around.end(),
                            [&](int other) { return is_deep[idx(other)]; }))
                left.push_back(cell);
        }
        for (const int cell : deep)
            is_deep[idx(cell)] = false;
        for (const int cell : left)
            is_deep[idx(cell)] = true;
        deep = std::move(left);
    }
    if (deep.empty())
        return;
    std::vector<Eigen::Vector3d> missed;
    for (std::size_t i = 0; i < own.misses.size(); ++i)
        if (!own.misses[i].displacement.isZero(0) || !own.misses[i].gradient.isZero(0))
            missed.push_back(own.fade->nodes()[i]);
    std::optional<PointTree> tree;
    if (!missed.empty())
        tree.emplace(missed);
    for (const int i : deep)
    {
        const Cell& cell = cells_.cells[idx(i)];
        const double reach = own.fade->reach_of_average(cell.box_centre, cell.edge);
        if (!tree || std::sqrt(tree->nearest(cell.box_centre).distance_squared) > reach)
            own.deep_cells.push_back(i);
    }
}

std::vector<bool> FieldFitter::followers_of(const Motion& motion,
                                            const FieldParts& field) const
{
    std::vector<bool> follows(cells_.size(), false);
    if (kind_ == FieldKind::Closest4 || is_dense(kind_))
        return follows;
    for (std::size_t i = 0; i < constraints_.size(); ++i)
    {
        const Pose wanted = carried(motion, cells_.cells[i].centre);
        follows[i] = constraints_[i].is_of_rigid_region() &&
                     field.poses[i].p == wanted.p && field.poses[i].R == wanted.R;
    }
    if (!field.local)
        return follows;
    const Clusters& clusters = field.local->clusters();
    std::vector<char> is_followed; // of each cluster: by all its cells
    for (const auto& cluster : clusters.clusters)
        is_followed.push_back(std::all_of(cluster.cells.begin(), cluster.cells.end(),
                                          [&](int cell) { return follows[idx(cell)]; }));
    std::vector<bool> by_clusters = follows;
    for (std::size_t i = 0; i < follows.size(); ++i)
        for (const Membership& member : clusters.of_cell(static_cast<int>(i)))
            by_clusters[i] = by_clusters[i] && member.cluster != LocalRbf::kBlended &&
                             is_followed[idx(member.cluster)];
    return by_clusters;
}

Field fit_field(const FieldChoice& choice, const Cells& cells,
                std::span<const Pose> poses, std::span<const Constraint> constraints,
                std::vector<MovedRegion> regions)
{
    return FieldFitter(choice, cells, constraints, nullptr)
        .fit(poses, std::move(regions));
}

} // namespace cellwarp::core
