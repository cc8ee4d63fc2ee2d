// SPDX-License-Identifier: GPL-3.0-or-later
// Nearly everywhere a short way through the glue leads to each cell that counts, so that
// its weight is the plain one (blend.cpp). One such way is looked for beforehand and its
// resistance found for all places at once; a place at which it is too large for some cell
// is done alone.
#include "solver/field/place_lanes.h"

#include <algorithm>
#include <cmath>

#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

/// Cells that may count; where there are more (many small cells around a large one) the
/// places are done one by one.
constexpr std::size_t kMostNear = 64;

/// From one influence to the next [double].
constexpr std::size_t kInfluenceStride = sizeof(InfluenceOnPlaces) / sizeof(double);
static_assert(sizeof(InfluenceOnPlaces) % sizeof(double) == 0);

} // namespace

FieldValue ValueOnPlaces::at(int place) const
{
    FieldValue value;
    value.displacement = displacement.row(place).transpose().matrix();
    for (std::size_t k = 0; k < 3; ++k)
        value.gradient.col(static_cast<Eigen::Index>(k)) =
            slopes[k].row(place).transpose().matrix();
    return value;
}

void ValueOnPlaces::set(int place, const FieldValue& value)
{
    displacement.row(place) = value.displacement.transpose().array();
    for (std::size_t k = 0; k < 3; ++k)
        slopes[k].row(place) =
            value.gradient.col(static_cast<Eigen::Index>(k)).transpose().array();
}

PlaceVectors everywhere(const Eigen::Vector3d& x)
{
    return x.transpose().array().replicate<kPlaces, 1>();
}

void CellsAround::find(const ClosestCells& closest, int own, const Eigen::Vector3d& low,
                       const Eigen::Vector3d& high)
{
    cells_.assign(1, own);
    const double slack = 2.0 * kBoxSlack * closest.edge(own); // rounding again
    const Eigen::Array3d first = low.array() - slack, last = high.array() + slack;
    for (std::size_t next = 0; next < cells_.size(); ++next)
        for (const int other : closest.neighbours_of(cells_[next]))
        {
            const Eigen::Vector3d& centre = closest.box_centre(other);
            const double edge = closest.edge(other);
            const double away = (centre.array() - centre.array().max(first).min(last))
                                    .matrix()
                                    .squaredNorm();
            if (away < edge * edge &&
                std::find(cells_.begin(), cells_.end(), other) == cells_.end())
                cells_.push_back(other);
        }
    std::sort(cells_.begin(), cells_.end());
    own_place_ =
        idx(std::lower_bound(cells_.begin(), cells_.end(), own) - cells_.begin());
    boxes_.clear();
    for (const int cell : cells_)
    {
        const Eigen::Vector3d& centre = closest.box_centre(cell);
        boxes_.push_back({{centre.x(), centre.y(), centre.z()}, closest.edge(cell)});
    }
    if (cells_.size() <= kMostNear)
        find_ways(closest, 0.5 * (low + high));
}

void CellsAround::shrink()
{
    if (cells_.size() <= kMostNear && !has_asked_)
    {
        ways_.clear();
        order_.clear();
    }
    cells_.shrink_to_fit();
    boxes_.shrink_to_fit();
    ways_.shrink_to_fit();
    order_.shrink_to_fit();
}

std::size_t CellsAround::num_bytes() const
{
    return cells_.capacity() * sizeof(int) + boxes_.capacity() * sizeof(CellBox) +
           ways_.capacity() * sizeof(Way) + order_.capacity() * sizeof(int);
}

/// The lead of a cell is, of those that are one glued face nearer to the own cell, the
/// one that counts most at \p middle.
void CellsAround::find_ways(const ClosestCells& closest, const Eigen::Vector3d& middle)
{
    const auto place_of = [&](int cell)
    {
        const auto found = std::lower_bound(cells_.begin(), cells_.end(), cell);
        return found != cells_.end() && *found == cell
                   ? static_cast<int>(found - cells_.begin())
                   : -1;
    };
    ways_.assign(cells_.size(), Way());
    for (std::size_t i = 0; i < cells_.size(); ++i)
        ways_[i].away = (middle - closest.box_centre(cells_[i])).squaredNorm() /
                        (boxes_[i].edge * boxes_[i].edge);
    order_.assign(1, static_cast<int>(own_place_));
    ways_[own_place_].hops = 0;
    for (std::size_t next = 0; next < order_.size(); ++next)
    {
        const std::size_t i = idx(order_[next]);
        for (const int cell : closest.neighbours_of(cells_[i]))
        {
            const int other = place_of(cell);
            if (other < 0)
                continue;
            Way& way = ways_[idx(other)];
            if (way.hops < 0)
            {
                way.hops = ways_[i].hops + 1;
                order_.push_back(other);
            }
            const int lead = ways_[i].lead;
            if (way.hops == ways_[i].hops - 1 &&
                (lead < 0 || way.away < ways_[idx(lead)].away))
                ways_[i].lead = other;
        }
    }
    ask_for_ways();
}

/// A way through a regular grid that is as short as can be needs no question.
void CellsAround::ask_for_ways()
{
    const auto centre = [&](std::size_t i)
    { return Eigen::Map<const Eigen::Array3d>(boxes_[i].centre); };
    const Eigen::Array3d origin = centre(own_place_);
    const double edge = boxes_[own_place_].edge, hair = 1e-6 * edge;
    ways_[own_place_].is_regular = true;
    has_asked_ = false;
    for (std::size_t next = 1; next < order_.size(); ++next)
    {
        const std::size_t i = idx(order_[next]);
        Way& way = ways_[i];
        std::size_t lead = idx(way.lead);
        const Eigen::Array3d at = centre(i) - origin;
        const Eigen::Array3d step = centre(lead) - origin - at;
        way.is_regular = ways_[lead].is_regular && boxes_[i].edge == edge &&
                         (at.abs() < edge + hair).all() &&
                         (at.abs() > hair).count() == way.hops &&
                         (step.abs() > hair).count() == 1;
        if (way.hops < 2 || way.is_regular)
            continue;
        has_asked_ = true;
        way.is_asked = true;
        for (; ways_[lead].hops > 0; lead = idx(ways_[lead].lead))
            ways_[lead].is_asked = true;
    }
}

/// Places that have no short way to some cell that counts. \p rests: of each cell around
/// 1 - d/s, or 0.
PlaceInfluences::PlaceMarks
PlaceInfluences::narrow_places(const CellsAround& around, const PlaceVectors& inside,
                               std::span<const PlaceNumbers> rests) const
{
    PlaceNumbers behind[kMostNear]; // the resistance of the way to behind a cell
    PlaceMarks is_narrow = PlaceMarks::Constant(false);
    for (const int place : around.order_)
    {
        const std::size_t i = idx(place);
        const CellsAround::Way& way = around.ways_[i];
        if (!way.is_asked)
            continue;
        const PlaceNumbers& rest = rests[i];
        const CellBox& box = around.boxes_[i];
        PlaceNumbers beyond_squared = PlaceNumbers::Zero();
        for (int k = 0; k < 3; ++k)
            beyond_squared += ((inside.col(k) - box.centre[k]).abs() - 0.5 * box.edge)
                                  .max(0.0)
                                  .square();
        const PlaceNumbers resistance =
            (rest > 0.0)
                .select(passing_resistance(beyond_squared, box.edge, rest), INFINITY);
        behind[i] = resistance;
        if (way.hops < 2)
            continue;
        const PlaceNumbers& to = behind[way.lead];
        behind[i] += to;
        is_narrow = is_narrow ||
                    (rest > 0.0 && !((to + 0.5 * resistance) * rest.square() <= 1.0));
    }
    return is_narrow;
}

/// As ClosestCells has it.
void PlaceInfluences::find_alone(const PlaceVectors& places, const CellsAround& around,
                                 int place)
{
    for (InfluenceOnPlaces& influence : std::span(found_).first(around.cells_.size()))
    {
        influence.weight[place] = 0.0;
        influence.gradient.row(place).setZero();
    }
    closest_.influences(places.row(place).transpose().matrix(), around.own(), single_);
    const std::span<const int> cells = around.cells();
    for (const Influence& influence : single_)
    {
        const auto at = std::lower_bound(cells.begin(), cells.end(), influence.cell);
        InfluenceOnPlaces& of_cell = found_[idx(at - cells.begin())];
        of_cell.weight[place] = influence.weight;
        of_cell.gradient.row(place) = influence.gradient.transpose().array();
    }
}

std::span<const InfluenceOnPlaces> PlaceInfluences::find(const PlaceVectors& places,
                                                         const CellsAround& around,
                                                         bool wants_gradient)
{
    // Never made smaller: new ones would be set to zero each time.
    const std::size_t count = around.cells_.size();
    if (found_.size() < count)
        found_.resize(count);
    const std::span<InfluenceOnPlaces> found = std::span(found_).first(count);
    for (std::size_t i = 0; i < count; ++i)
        found[i].cell = around.cells_[i];
    PlaceMarks is_alone = PlaceMarks::Constant(true);
    if (count <= kMostNear)
        is_alone = find_plain(places, around, wants_gradient);
    else
        for (int l = 0; l < kPlaces; ++l)
        {
            const Eigen::Vector3d x = places.row(l).transpose().matrix();
            are_inside_[l] = nearest_in_box(closest_.box_centre(around.own()),
                                            closest_.edge(around.own()), x) == x;
        }
    if (is_alone.any())
        for (int l = 0; l < kPlaces; ++l)
            if (is_alone[l])
                find_alone(places, around, l);
    return found;
}

/// As ClosestCells::influences(), for all places at once, but for those that are marked.
PlaceInfluences::PlaceMarks PlaceInfluences::find_plain(const PlaceVectors& places,
                                                        const CellsAround& around,
                                                        bool wants_gradient)
{
    PlaceVectors inside, is_within;
    const std::size_t count = around.cells_.size();
    PlaceNumbers rests[kMostNear];
    InfluenceOnPlaces& first = found_.front();
    widest_influence_kernels().weights(
        {around.boxes_.data(), count, around.own_place_, kBoxSlack, places.data(),
         inside.data(), is_within.data(), rests[0].data(), first.weight.data(),
         wants_gradient ? first.gradient.data() : nullptr, kInfluenceStride});
    are_inside_ = is_within.rowwise().minCoeff() > 0.0;
    return around.has_asked_ ? narrow_places(around, inside, std::span(rests, count))
                             : PlaceMarks::Constant(false);
}

std::vector<CellMap> cell_maps(const Cells& cells, std::span<const Pose> poses)
{
    std::vector<CellMap> maps(cells.size());
    for (std::size_t c = 0; c < cells.size(); ++c)
    {
        const Eigen::Vector3d& centre = cells.cells[c].centre;
        Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(maps[c].turn) =
            poses[c].R - Eigen::Matrix3d::Identity();
        Eigen::Map<Eigen::Vector3d>(maps[c].shift) = poses[c].p - centre;
        Eigen::Map<Eigen::Vector3d>(maps[c].centre) = centre;
    }
    return maps;
}

void blend(std::span<const InfluenceOnPlaces> influences, std::span<const CellMap> maps,
           const PlaceVectors& places, bool wants_gradient, ValueOnPlaces& out)
{
    const InfluenceOnPlaces& first = influences.front();
    widest_influence_kernels().blend(
        {maps.data(), &first.cell, first.weight.data(),
         wants_gradient ? first.gradient.data() : nullptr, influences.size(),
         kInfluenceStride, sizeof(InfluenceOnPlaces) / sizeof(int), places.data(),
         out.displacement.data(), out.slopes.front().data()});
}

} // namespace cellwarp::core
