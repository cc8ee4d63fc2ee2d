// SPDX-License-Identifier: GPL-3.0-or-later
// Nearly everywhere a short way through the glue leads to each cell that counts, so that
// its weight is the plain one (blend.cpp). One such way is looked for beforehand and its
// resistance found for all places at once; a place at which it is too large for some cell
// is done alone.
#include "solver/field/place_lanes.h"

#include <algorithm>
#include <cmath>

#include "octree/base/index.h"

namespace cellwarp
{

namespace
{

/// Cells that may count; where there are more (many small cells around a large one) the
/// places are done one by one.
constexpr std::size_t kMostNear = 64;

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

void PlaceInfluences::enter(int own, const Eigen::Vector3d& low,
                            const Eigen::Vector3d& high)
{
    own_ = own;
    near_.assign(1, own);
    const double slack = 2.0 * kBoxSlack * closest_.edge(own); // rounding again
    const Eigen::Array3d first = low.array() - slack, last = high.array() + slack;
    for (std::size_t next = 0; next < near_.size(); ++next)
        for (const int other : closest_.neighbours_of(near_[next]))
        {
            const Eigen::Vector3d& centre = closest_.box_centre(other);
            const double edge = closest_.edge(other);
            const double away = (centre.array() - centre.array().max(first).min(last))
                                    .matrix()
                                    .squaredNorm();
            if (away < edge * edge &&
                std::find(near_.begin(), near_.end(), other) == near_.end())
                near_.push_back(other);
        }
    std::sort(near_.begin(), near_.end());
    if (near_.size() <= kMostNear)
        find_ways(0.5 * (low + high));
}

/// The lead of a cell is, of those that are one glued face nearer to the own cell, the
/// one that counts most at \p middle.
void PlaceInfluences::find_ways(const Eigen::Vector3d& middle)
{
    const auto place_of = [&](int cell)
    {
        const auto found = std::lower_bound(near_.begin(), near_.end(), cell);
        return found != near_.end() && *found == cell
                   ? static_cast<int>(found - near_.begin())
                   : -1;
    };
    away_.clear();
    for (const int cell : near_)
        away_.push_back((middle - closest_.box_centre(cell)).squaredNorm() /
                        (closest_.edge(cell) * closest_.edge(cell)));
    hops_.assign(near_.size(), -1);
    lead_.assign(near_.size(), -1);
    order_.assign(1, place_of(own_));
    hops_[idx(order_.front())] = 0;
    for (std::size_t next = 0; next < order_.size(); ++next)
    {
        const std::size_t i = idx(order_[next]);
        for (const int cell : closest_.neighbours_of(near_[i]))
        {
            const int other = place_of(cell);
            if (other < 0)
                continue;
            const std::size_t o = idx(other);
            if (hops_[o] < 0)
            {
                hops_[o] = hops_[i] + 1;
                order_.push_back(other);
            }
            if (hops_[o] == hops_[i] - 1 &&
                (lead_[i] < 0 || away_[o] < away_[idx(lead_[i])]))
                lead_[i] = other;
        }
    }
    ask_for_ways();
}

/// A way through a regular grid that is as short as can be needs no question.
void PlaceInfluences::ask_for_ways()
{
    const Eigen::Array3d origin = closest_.box_centre(own_).array();
    const double edge = closest_.edge(own_), hair = 1e-6 * edge;
    is_regular_.assign(near_.size(), false);
    is_asked_.assign(near_.size(), false);
    is_regular_[idx(order_.front())] = true;
    has_asked_ = false;
    for (std::size_t next = 1; next < order_.size(); ++next)
    {
        const std::size_t i = idx(order_[next]);
        std::size_t lead = idx(lead_[i]);
        const Eigen::Array3d at = closest_.box_centre(near_[i]).array() - origin;
        const Eigen::Array3d step =
            closest_.box_centre(near_[lead]).array() - origin - at;
        is_regular_[i] = is_regular_[lead] && closest_.edge(near_[i]) == edge &&
                         (at.abs() < edge + hair).all() &&
                         (at.abs() > hair).count() == hops_[i] &&
                         (step.abs() > hair).count() == 1;
        if (hops_[i] < 2 || is_regular_[i])
            continue;
        has_asked_ = true;
        is_asked_[i] = true;
        for (; hops_[lead] > 0; lead = idx(lead_[lead]))
            is_asked_[lead] = true;
    }
}

/// Places that have no short way to some cell that counts. \p rests: of each near cell
/// 1 - d/s, or 0.
PlaceInfluences::PlaceMarks
PlaceInfluences::narrow_places(const PlaceVectors& inside,
                               std::span<const PlaceNumbers> rests) const
{
    PlaceNumbers behind[kMostNear]; // the resistance of the way to behind a cell
    PlaceMarks is_narrow = PlaceMarks::Constant(false);
    for (const int place : order_)
    {
        const std::size_t i = idx(place);
        if (!is_asked_[i])
            continue;
        const PlaceNumbers& rest = rests[i];
        const Eigen::Vector3d& centre = closest_.box_centre(near_[i]);
        const double edge = closest_.edge(near_[i]);
        PlaceNumbers beyond_squared = PlaceNumbers::Zero();
        for (int k = 0; k < 3; ++k)
            beyond_squared +=
                ((inside.col(k) - centre[k]).abs() - 0.5 * edge).max(0.0).square();
        const PlaceNumbers resistance =
            (rest > 0.0).select(passing_resistance(beyond_squared, edge, rest), INFINITY);
        behind[i] = resistance;
        if (hops_[i] < 2)
            continue;
        const PlaceNumbers& to = behind[lead_[i]];
        behind[i] += to;
        is_narrow = is_narrow ||
                    (rest > 0.0 && !((to + 0.5 * resistance) * rest.square() <= 1.0));
    }
    return is_narrow;
}

/// As ClosestCells has it.
void PlaceInfluences::find_alone(const PlaceVectors& places, int place)
{
    for (InfluenceOnPlaces& influence : found_)
    {
        influence.weight[place] = 0.0;
        influence.gradient.row(place).setZero();
    }
    closest_.influences(places.row(place).transpose().matrix(), own_, single_);
    for (const Influence& influence : single_)
    {
        const auto at = std::lower_bound(near_.begin(), near_.end(), influence.cell);
        InfluenceOnPlaces& of_cell = found_[idx(at - near_.begin())];
        of_cell.weight[place] = influence.weight;
        of_cell.gradient.row(place) = influence.gradient.transpose().array();
    }
}

std::span<const InfluenceOnPlaces> PlaceInfluences::find(const PlaceVectors& places,
                                                         bool wants_gradient)
{
    found_.resize(near_.size());
    for (std::size_t i = 0; i < near_.size(); ++i)
        found_[i].cell = near_[i];
    PlaceMarks is_alone = PlaceMarks::Constant(true);
    if (near_.size() <= kMostNear)
        is_alone = find_plain(places, wants_gradient);
    for (int l = 0; l < kPlaces; ++l)
        if (is_alone[l])
            find_alone(places, l);
    return found_;
}

/// As ClosestCells::influences(), for all places at once, but for those that are marked.
PlaceInfluences::PlaceMarks PlaceInfluences::find_plain(const PlaceVectors& places,
                                                        bool wants_gradient)
{
    PlaceVectors inside, is_within;
    for (int l = 0; l < kPlaces; ++l)
    {
        const Eigen::Vector3d x = places.row(l).transpose().matrix();
        const Eigen::Vector3d place =
            nearest_in_box(closest_.box_centre(own_), closest_.edge(own_), x);
        inside.row(l) = place.transpose().array();
        is_within.row(l) = (place.array() == x.array()).cast<double>().transpose();
    }
    PlaceNumbers rests[kMostNear];
    PlaceNumbers sum = PlaceNumbers::Zero();
    PlaceVectors sum_gradient = PlaceVectors::Zero();
    for (std::size_t i = 0; i < near_.size(); ++i)
    {
        InfluenceOnPlaces& influence = found_[i];
        const Eigen::Vector3d& centre = closest_.box_centre(near_[i]);
        const double edge = closest_.edge(near_[i]);
        const PlaceNumbers x = inside.col(0) - centre.x(), y = inside.col(1) - centre.y(),
                           z = inside.col(2) - centre.z();
        const PlaceNumbers distance = (x * x + y * y + z * z).sqrt();
        const PlaceNumbers rest = (1.0 - distance / edge).max(0.0);
        rests[i] = rest;
        influence.weight = rest * rest;
        sum += influence.weight;
        if (!wants_gradient)
            continue;
        const PlaceNumbers gain =
            (distance > 0.0).select(-2.0 * rest / (edge * distance.max(1e-300)), 0.0);
        for (int k = 0; k < 3; ++k)
            influence.gradient.col(k) =
                gain * (inside.col(k) - centre[k]) * is_within.col(k);
        sum_gradient += influence.gradient;
    }
    for (InfluenceOnPlaces& influence : found_)
    {
        influence.weight /= sum;
        if (wants_gradient)
            for (int k = 0; k < 3; ++k)
                influence.gradient.col(k) =
                    (influence.gradient.col(k) - influence.weight * sum_gradient.col(k)) /
                    sum;
    }
    return has_asked_ ? narrow_places(inside, std::span(rests, near_.size()))
                      : PlaceMarks::Constant(false);
}

void blend(std::span<const InfluenceOnPlaces> influences, std::span<const Pose> poses,
           const Cells& cells, const PlaceVectors& places, bool wants_gradient,
           ValueOnPlaces& out)
{
    out = {};
    for (const InfluenceOnPlaces& influence : influences)
    {
        if ((influence.weight == 0.0).all())
            continue;
        const std::size_t c = idx(influence.cell);
        const Eigen::Vector3d& centre = cells.cells[c].centre;
        const Eigen::Matrix3d turn = poses[c].R - Eigen::Matrix3d::Identity();
        const Eigen::Vector3d shift = poses[c].p - centre;
        const PlaceVectors arm = places.rowwise() - centre.transpose().array();
        for (int k = 0; k < 3; ++k)
        {
            const PlaceNumbers moved = turn(k, 0) * arm.col(0) + turn(k, 1) * arm.col(1) +
                                       turn(k, 2) * arm.col(2) + shift[k];
            out.displacement.col(k) += influence.weight * moved;
            for (int axis = 0; axis < 3 && wants_gradient; ++axis)
                out.slopes[idx(axis)].col(k) += influence.weight * turn(k, axis) +
                                                moved * influence.gradient.col(axis);
        }
    }
}

} // namespace cellwarp
