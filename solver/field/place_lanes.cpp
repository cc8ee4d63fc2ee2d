// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/field/place_lanes.h"

#include <algorithm>
#include <bit>

namespace cellwarp
{

namespace
{

/// Cells that may count and have a bit each; where there are more (many small cells
/// around a large one) the places are done one by one.
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
    for (std::size_t next = 0; next < near_.size(); ++next)
        for (const int other : closest_.neighbours_of(near_[next]))
        {
            const Eigen::Vector3d& centre = closest_.box_centre(other);
            const double edge = closest_.edge(other);
            const double away =
                (centre - centre.cwiseMax(low).cwiseMin(high)).squaredNorm();
            if (away < edge * edge &&
                std::find(near_.begin(), near_.end(), other) == near_.end())
                near_.push_back(other);
        }
    std::sort(near_.begin(), near_.end());
    glued_.assign(near_.size(), 0);
    if (near_.size() > kMostNear)
        return;
    for (std::size_t i = 0; i < near_.size(); ++i)
    {
        for (const int other : closest_.neighbours_of(near_[i]))
        {
            const auto found = std::lower_bound(near_.begin(), near_.end(), other);
            if (found != near_.end() && *found == other)
                glued_[i] |= std::uint64_t(1) << (found - near_.begin());
        }
        if (near_[i] == own)
            own_bit_ = std::uint64_t(1) << i;
    }
    last_counting_ = last_reached_ = 0;
}

std::uint64_t PlaceInfluences::reached(std::uint64_t counting)
{
    if (counting == last_counting_)
        return last_reached_;
    std::uint64_t known = own_bit_ & counting, fresh = known;
    while (fresh != 0)
    {
        std::uint64_t around = 0;
        for (std::uint64_t rest = fresh; rest != 0; rest &= rest - 1)
            around |= glued_[static_cast<std::size_t>(std::countr_zero(rest))];
        fresh = around & counting & ~known;
        known |= fresh;
    }
    last_counting_ = counting;
    last_reached_ = known;
    return known;
}

void PlaceInfluences::find_one_by_one(const PlaceVectors& places)
{
    found_.clear();
    for (const int cell : near_)
        found_.emplace_back().cell = cell;
    for (int l = 0; l < kPlaces; ++l)
    {
        closest_.influences(places.row(l).transpose().matrix(), own_, single_);
        for (const Influence& influence : single_)
        {
            const auto found =
                std::lower_bound(near_.begin(), near_.end(), influence.cell);
            InfluenceOnPlaces& of_cell =
                found_[static_cast<std::size_t>(found - near_.begin())];
            of_cell.weight[l] = influence.weight;
            of_cell.gradient.row(l) = influence.gradient.transpose().array();
        }
    }
}

std::span<const InfluenceOnPlaces> PlaceInfluences::find(const PlaceVectors& places,
                                                         bool wants_gradient)
{
    if (near_.size() > kMostNear)
    {
        find_one_by_one(places);
        return found_;
    }
    // As ClosestCells::influences(), for all places at once.
    PlaceVectors inside, is_within;
    for (int l = 0; l < kPlaces; ++l)
    {
        const Eigen::Vector3d x = places.row(l).transpose().matrix();
        const Eigen::Vector3d place =
            nearest_in_box(closest_.box_centre(own_), closest_.edge(own_), x);
        inside.row(l) = place.transpose().array();
        is_within.row(l) = (place.array() == x.array()).cast<double>().transpose();
    }
    found_.resize(near_.size());
    std::uint64_t counting[kPlaces] = {};
    PlaceNumbers rest_of[kMostNear], distance_of[kMostNear];
    for (std::size_t i = 0; i < near_.size(); ++i)
    {
        const Eigen::Vector3d& centre = closest_.box_centre(near_[i]);
        const PlaceNumbers x = inside.col(0) - centre.x(), y = inside.col(1) - centre.y(),
                           z = inside.col(2) - centre.z();
        distance_of[i] = (x * x + y * y + z * z).sqrt();
        rest_of[i] = 1.0 - distance_of[i] / closest_.edge(near_[i]);
        for (int l = 0; l < kPlaces; ++l)
            counting[l] |= std::uint64_t(rest_of[i][l] > 0.0) << i;
    }
    std::uint64_t counts[kPlaces];
    for (int l = 0; l < kPlaces; ++l)
        counts[l] = reached(counting[l]);
    PlaceNumbers sum = PlaceNumbers::Zero();
    PlaceVectors sum_gradient = PlaceVectors::Zero();
    for (std::size_t i = 0; i < near_.size(); ++i)
    {
        InfluenceOnPlaces& influence = found_[i];
        influence.cell = near_[i];
        PlaceNumbers& rest = rest_of[i];
        for (int l = 0; l < kPlaces; ++l)
            rest[l] = (counts[l] >> i & 1) != 0 ? rest[l] : 0.0;
        influence.weight = rest * rest;
        sum += influence.weight;
        if (!wants_gradient)
            continue;
        const Eigen::Vector3d& centre = closest_.box_centre(near_[i]);
        const double edge = closest_.edge(near_[i]);
        const PlaceNumbers gain =
            (distance_of[i] > 0.0)
                .select(-2.0 * rest / (edge * distance_of[i].max(1e-300)), 0.0);
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
    return found_;
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
        const std::size_t c = static_cast<std::size_t>(influence.cell);
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
                out.slopes[static_cast<std::size_t>(axis)].col(k) +=
                    influence.weight * turn(k, axis) +
                    moved * influence.gradient.col(axis);
        }
    }
}

} // namespace cellwarp
