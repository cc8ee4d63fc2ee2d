// SPDX-License-Identifier: GPL-3.0-or-later
// What touches is found in rounds. A point that would end inside an obstacle is held at
// its surface: n . J dv = (o - n . (x + u + h v)) / h, with n . x = o the plane that
// touches the obstacle there; it is let go when its impulse l pulls. While it is held, it
// sticks: two rows more take its velocity along the surface to the obstacle's. Where
// their impulse is above mu l, it slips, and is braked instead: by mu l / |s| times its
// velocity s along the surface, l and |s| of the round before. That takes energy in any
// case; the impulse mu l by itself, in the direction of the round before, could add some,
// and grew without limit. The first round begins with what would be inside with the
// velocities as they were. A point that is inside at the step's beginning, as one that
// another point of its node has hidden may be, stays as deep, less a part.
#include "solver/flesh/step_rows.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

#include <Eigen/Geometry>

#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr int kMostContactRounds = 8;

/// In later rounds nothing is let go any more: it could come back for ever.
constexpr int kLastRelease = 4;

/// A point is inside when it is deeper than this [size].
constexpr double kInside = 1e-9;

/// What is inside already comes out by this share of its depth in a step, but for a depth
/// that does not show, and by no more than that: at once would throw it out [1], [size].
constexpr double kOut = 0.2, kUnseen = 2e-4, kMostOut = 1e-3;

/// Points of which free nodes have less are where bones have them.
constexpr double kBound = 0.05;

/// Forces of friction that are off by less are found.
constexpr double kSameRub = 0.03;

/// What slips by less than this in a step does not [size].
constexpr double kNoSlip = 1e-9;

std::array<Vector3d, 2> along_surface(const Vector3d& n)
{
    const Vector3d first = n.unitOrthogonal();
    return {first, n.cross(first)};
}

auto key(const FleshSurface::Candidate& candidate)
{
    return std::tuple(candidate.obstacle, candidate.node);
}

} // namespace

FreeShares::FreeShares(const BoundNodes& nodes, std::size_t num_nodes)
    : nodes_(nodes), place_(num_nodes)
{
    for (std::size_t k = 0; k < nodes.free.size(); ++k)
        place_[idx(nodes.free[k])] = static_cast<int>(k);
    for (std::size_t k = 0; k < nodes.bound.size(); ++k)
        place_[idx(nodes.bound[k])] = -1 - static_cast<int>(k);
}

FreeShares::Shares FreeShares::of(std::span<const NodeShare> shares) const
{
    Shares out;
    for (const NodeShare& share : shares)
    {
        const int place = place_[idx(share.node)];
        if (place >= 0)
        {
            out.free.push_back({place, share.share});
            continue;
        }
        const std::size_t bound = idx(-1 - place);
        for (const NodeShare& by : nodes_.by_free[bound])
            out.free.push_back({by.node, share.share * by.share});
        for (const NodeShare& by : nodes_.by_points[bound])
            out.points.push_back({by.node, share.share * by.share});
    }
    out.free = gathered(std::move(out.free));
    double left = 0.0;
    for (const NodeShare& share : out.free)
        left += std::abs(share.share);
    if (left < kBound)
        out.free.clear();
    return out;
}

StepRows::StepRows(const FreeShares& shares, const FleshSurface& surface,
                   const FleshSurroundings& around, double dt, double size)
    : shares_(shares), surface_(surface), around_(around), dt_(dt), size_(size)
{
}

/// \p u: at the step's beginning; \p v: velocities so far. False: its node touches this
/// obstacle already, or the point is no deeper than it may be.
bool StepRows::take(const FleshSurface::Candidate& candidate, const VectorXd& u,
                    const VectorXd& v)
{
    const FleshPoint& point = surface_[candidate.point];
    const FleshObstacle& obstacle = around_.obstacles[candidate.obstacle];
    Touch touch{candidate};
    // The obstacle stood back by its way in the step.
    const Vector3d before =
        point.place + at_point(point.shares, u) + dt_ * obstacle.velocity;
    touch.depth = std::min(0.0, obstacle.gap(before).gap);
    touch.depth +=
        std::clamp(-kOut * (touch.depth + kUnseen * size_), 0.0, kMostOut * size_);
    if (candidate.gap >= touch.depth - kInside * size_ ||
        shares_.of(point.shares).free.empty())
        return false;
    const Vector3d way = at_point(point.shares, v) - obstacle.velocity;
    touch.speed = (way - candidate.normal.dot(way) * candidate.normal).norm();
    const auto at = std::lower_bound(touches_.begin(), touches_.end(), touch,
                                     [](const Touch& a, const Touch& b)
                                     { return key(a.at) < key(b.at); });
    if (at != touches_.end() && key(at->at) == key(candidate))
        return false;
    touches_.insert(at, touch);
    return true;
}

/// \p v: velocities after the step.
StepRows::Change StepRows::look_at_forces(const VectorXd& v, const VectorXd& l,
                                          std::span<const int> first_of_touch,
                                          bool may_release)
{
    Change change = Change::None;
    std::vector<Touch> kept;
    for (std::size_t t = 0; t < touches_.size(); ++t)
    {
        Touch touch = touches_[t];
        const FleshObstacle& obstacle = around_.obstacles[touch.at.obstacle];
        const Eigen::Index first = first_of_touch[t];
        const double pressed = l[first];
        if (pressed < 0.0 && may_release)
        {
            change = Change::Touches;
            continue;
        }
        if (obstacle.friction > 0.0 &&
            find_rub(touch, obstacle, v, l, first, may_release))
            change = std::max(change, Change::Friction);
        kept.push_back(touch);
    }
    touches_ = std::move(kept);
    return change;
}

/// \p first: row of the touch.
bool StepRows::find_rub(Touch& touch, const FleshObstacle& obstacle, const VectorXd& v,
                        const VectorXd& l, Eigen::Index first, bool may_stick) const
{
    const double most = obstacle.friction * std::max(l[first], 0.0);
    const Vector3d& n = touch.at.normal;
    const Vector3d way = at_point(surface_[touch.at.point].shares, v) - obstacle.velocity;
    const double speed = (way - n.dot(way) * n).norm();
    const double least = kNoSlip * size_ / dt_;
    double gives = 0.0; // speed an impulse, at least
    for (const NodeShare& share : shares_.of(surface_[touch.at.point].shares).free)
        gives += share.share * share.share * scale_[share.node];
    if (!touch.slips)
    {
        const double rubbed = std::hypot(l[first + 1], l[first + 2]);
        if (rubbed <= most)
            return false;
        // It slips as it did before, or by some of what its rows have held back.
        touch.slips = true;
        touch.brake = most / std::max({touch.speed, (rubbed - most) * gives, least});
        return true;
    }
    if (may_stick && touch.brake * speed + speed / gives <= most)
    {
        touch.slips = false;
        touch.brake = 0.0;
        return true;
    }
    const double rubbed = touch.brake * speed;
    touch.brake = most / std::max(speed, least);
    return std::abs(rubbed - most) > kSameRub * most;
}

FleshContacts StepRows::solve(const VectorXd& u, const VectorXd& v, const VectorXd& held,
                              const VectorXd& b, const VectorXd& scale,
                              const Solve& solve, const VectorXd& change)
{
    scale_ = scale;
    if (!has_begun_)
        for (const FleshSurface::Candidate& candidate :
             surface_.candidates(u + dt_ * v, 0.0, around_.obstacles))
            take(candidate, u, v);
    has_begun_ = true;
    FleshContacts out;
    out.is_settled = false;
    bool is_done = false;
    VectorXd l, right, x;
    while (!is_done && out.rounds < kMostContactRounds)
    {
        ++out.rounds;
        std::vector<NodeRow> rows;
        std::vector<NodeBrake> brakes;
        right = b;
        const auto add_row =
            [&](const FreeShares::Shares& shares, const Vector3d& n, double value)
        {
            for (const NodeShare& point : shares.points)
                value -= point.share * n.dot(held.segment<3>(3 * point.node));
            rows.push_back({shares.free, n, value});
        };
        for (const PulledPoint& pulled : around_.pulled)
        {
            const FreeShares::Shares shares = shares_.of(pulled.point.shares);
            if (shares.free.empty())
                continue; // a bone has it
            const Vector3d wanted =
                (pulled.goal - pulled.point.place - at_point(pulled.point.shares, u)) /
                    dt_ -
                at_point(pulled.point.shares, v);
            if (pulled.normal)
                add_row(shares, *pulled.normal, pulled.normal->dot(wanted));
            else
                for (int c = 0; c < 3; ++c)
                    add_row(shares, Vector3d::Unit(c), wanted[c]);
        }
        const std::size_t num_pulled = rows.size();
        std::vector<int> first_of_touch;
        for (const Touch& touch : touches_)
        {
            first_of_touch.push_back(static_cast<int>(rows.size()));
            const FleshPoint& point = surface_[touch.at.point];
            const FleshObstacle& obstacle = around_.obstacles[touch.at.obstacle];
            const FreeShares::Shares shares = shares_.of(point.shares);
            const Vector3d speed = at_point(point.shares, v);
            const Vector3d& n = touch.at.normal;
            const Vector3d now = point.place + at_point(point.shares, u) + dt_ * speed;
            const double offset = obstacle.normal
                                      ? obstacle.offset
                                      : n.dot(obstacle.centre) + obstacle.radius;
            add_row(shares, n, (offset + touch.depth - n.dot(now)) / dt_);
            if (touch.slips)
            {
                NodeBrake& brake = brakes.emplace_back();
                brake.shares = shares.free;
                brake.normal = n;
                brake.base = speed - obstacle.velocity;
                for (const NodeShare& held_point : shares.points)
                    brake.base += held_point.share * held.segment<3>(3 * held_point.node);
                brake.factor = touch.brake;
                const Vector3d force = brake.force(VectorXd::Zero(b.size()));
                for (const NodeShare& share : shares.free)
                    right.segment<3>(3 * share.node) += share.share * force;
                continue;
            }
            if (obstacle.friction <= 0.0)
                continue;
            for (const Vector3d& t : along_surface(n))
                add_row(shares, t, t.dot(obstacle.velocity - speed));
        }
        NodeRows met(std::move(rows), scale);
        solve(met, brakes, right, x, l);
        if (!change.allFinite())
            return out;
        Change found = Change::None;
        out.count = touches_.size();
        out.force = out.pull = Vector3d::Zero();
        for (std::size_t k = 0; k < met.rows().size(); ++k)
            (k < num_pulled ? out.pull : out.force) +=
                l[Eigen::Index(k)] / dt_ * met.rows()[k].direction;
        for (const NodeBrake& brake : brakes)
            out.force += brake.force(x) / dt_;
        if (!touches_.empty())
            found =
                look_at_forces(v + change, l, first_of_touch, out.rounds <= kLastRelease);
        // What is a little too deep in the last round comes out in the next step.
        bool is_too_deep = false;
        for (const FleshSurface::Candidate& candidate : surface_.candidates(
                 u + dt_ * (v + change), -kInside * size_, around_.obstacles))
            if (take(candidate, u, v + change))
            {
                found = Change::Touches;
                is_too_deep = is_too_deep || candidate.gap < -kMostOut * size_;
            }
        is_done = found == Change::None;
        out.is_settled = !is_too_deep;
    }
    return out;
}

} // namespace cellwarp::core
