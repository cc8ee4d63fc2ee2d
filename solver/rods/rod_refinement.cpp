// SPDX-License-Identifier: GPL-3.0-or-later
// A knot that comes in is one of the same curve: control points, also those of
// velocities, follow by the matrix A of KnotChange, q^ = A q, and M = A^T M^ A. One that
// goes takes the control points to the least squares of q^ - A q. Velocities then are
// those of the same momenta, v = M^-1 A^T M^ v^: as the rows of A sum to 1, nothing of
// the momentum is lost, and as v is the projection of v^ in the norm of M^, kinetic
// energy only falls. Angles do likewise, with a station between two others as their mean.
#include "solver/rods/rod_refinement.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

/// By which a span's share of a twist may change [rad].
constexpr double kTwist = 0.01;
/// Of the rest curve, of its length.
constexpr double kSameRest = 1e-12;
/// A cut this near to a knot is at it, of the span.
constexpr double kAtKnot = 1e-9;

std::vector<Vector3d> controls_of(const RodLayout& layout, const Eigen::VectorXd& x)
{
    std::vector<Vector3d> out;
    for (const int first : layout.control)
        out.push_back(x.segment<3>(first));
    return out;
}

/// Of a station that has come or is to go, the share of the far one of its neighbours.
struct Between
{
    int near, here, far;
    double share, by_length; ///< of parameter, as velocities are linear, and of length
};

/// \p span: the first of the two that meet there.
Between between(const Rod& rod, std::size_t span)
{
    const RodSpan &first = rod.spans()[span], &second = rod.spans()[span + 1];
    return {first.station[0], first.station[1], second.station[1],
            (first.end - first.begin) / (second.end - first.begin),
            first.length / (first.length + second.length)};
}

} // namespace

void insert_knot(const MovingRod& of, double s)
{
    const RodChange change = of.rod.insert_knot(s);
    const std::vector<Vector3d> q = controls_of(change.before, of.state.x()),
                                v = controls_of(change.before, of.velocity);
    const int n = of.rod.num_controls();
    std::vector<Vector3d> controls(idx(n));
    Eigen::VectorXd velocity = Eigen::VectorXd::Zero(of.rod.layout().num_unknowns);
    for (int i = 0; i < n; ++i)
    {
        const KnotChange::Row row = change.knot.row(i);
        const auto mixed = [&row](const std::vector<Vector3d>& p) -> Vector3d
        {
            return row.share[1] == 0.0 ? p[idx(row.coarse[0])]
                                       : Vector3d(row.share[0] * p[idx(row.coarse[0])] +
                                                  row.share[1] * p[idx(row.coarse[1])]);
        };
        controls[idx(i)] = mixed(q);
        velocity.segment<3>(of.rod.layout().control[idx(i)]) = mixed(v);
    }
    const std::vector<int>& angle = of.rod.layout().angle;
    for (std::size_t k = 0; k < angle.size(); ++k)
        if (const int from = change.station_from[k]; from >= 0)
            velocity[angle[k]] = of.velocity[change.before.angle[idx(from)]];
    if (change.span >= 0)
    {
        const Between at = between(of.rod, idx(change.span));
        velocity[angle[idx(at.here)]] = (1.0 - at.share) * velocity[angle[idx(at.near)]] +
                                        at.share * velocity[angle[idx(at.far)]];
    }
    of.state.follow(change, controls);
    of.velocity = std::move(velocity);
    of.model.follow(change);
}

bool remove_knot(const MovingRod& of, std::size_t span, double tolerance)
{
    const auto removal = KnotRemoval::at(of.rod.basis(), static_cast<int>(span));
    if (!removal || of.rod.basis().smoothness_before(static_cast<int>(span)) <
                        of.rod.basis().degree() - 1)
        return false;
    const Between at = between(of.rod, span - 1);
    const double first = of.state.twist(span - 1), second = of.state.twist(span);
    if (std::abs(first - at.by_length * (first + second)) > kTwist)
        return false;
    std::vector<Vector3d> controls, rest;
    if (removal->apply(controls_of(of.rod.layout(), of.state.x()), controls) >
            tolerance ||
        removal->apply(of.rod.rest().controls, rest) >
            kSameRest * of.rod.arc_length().total())
        return false;
    const Eigen::VectorXd momentum = of.model.mass().times(of.velocity);
    const RodChange change = of.rod.remove_knot(*removal);
    const RodLayout& layout = of.rod.layout();
    Eigen::VectorXd kept = Eigen::VectorXd::Zero(layout.num_unknowns);
    for (int i = 0; i <= of.rod.num_controls(); ++i)
    {
        const auto [coarse, share] = change.knot.row(i);
        for (const std::size_t j : {0u, 1u})
            kept.segment<3>(layout.control[idx(coarse[j])]) +=
                share[j] * momentum.segment<3>(change.before.control[idx(i)]);
    }
    for (std::size_t k = 0; k < layout.angle.size(); ++k)
        kept[layout.angle[k]] =
            momentum[change.before.angle[idx(change.station_from[k])]];
    const auto& [near, far] = of.rod.spans()[idx(change.span)].station;
    const double gone = momentum[change.before.angle[idx(at.here)]];
    kept[layout.angle[idx(near)]] += (1.0 - at.share) * gone;
    kept[layout.angle[idx(far)]] += at.share * gone;
    of.state.follow(change, controls);
    of.model.follow(change);
    of.velocity = of.model.mass().solved(kept);
    return true;
}

void cut(const MovingRod& of, double s)
{
    const SplineBasis& basis = of.rod.basis();
    double at = basis.wrapped(s);
    const SplineSpan& span = basis.spans()[idx(basis.span_of(at))];
    if (at - span.begin <= kAtKnot * span.length())
        at = span.begin;
    else if (span.end - at <= kAtKnot * span.length())
        at = basis.wrapped(span.end);
    if (!basis.is_closed() && (at <= basis.begin() || at >= basis.end()))
        throw std::invalid_argument("a rod has no more to cut at its ends");
    const auto is_cut = [&]
    {
        const int next = of.rod.basis().span_of(at);
        return of.rod.spans()[idx(next)].begin == at &&
               of.rod.basis().smoothness_before(next) < 0;
    };
    while (!is_cut())
        insert_knot(of, at);
    const double period = basis.is_closed() ? basis.end() - basis.begin() : 0.0;
    for (std::size_t k = 0; k < of.model.slides.size(); ++k)
    {
        RodSlide& slide = of.model.slides[k];
        const double now = of.state.sliding[k].s;
        // Of a closed rod the cut is met again a turn further.
        const double turns = period > 0.0 ? std::floor((now - at) / period) : 0.0;
        const double before = at + turns * period;
        const bool is_behind = now >= before;
        if (is_behind && before > slide.begin)
        {
            slide.begin = before;
            slide.has_cut_behind = true;
        }
        // At the cut itself the other piece begins.
        const SplineSpan& last =
            of.rod.basis().spans()[idx(of.rod.basis().span_of(at - kAtKnot))];
        const double end =
            (is_behind ? before + period : before) - kAtKnot * last.length();
        if ((!is_behind || period > 0.0) && end < slide.end)
        {
            slide.end = end;
            slide.has_cut_ahead = true;
        }
        slide.is_endless = false;
    }
}

double turn_of(const RodState& state, std::size_t span)
{
    const Rod& rod = state.rod();
    const double h = rod.spans()[span].end - rod.spans()[span].begin;
    double sum = 0.0, by_tangents = 0.0;
    // A fold within the span may lie between the places of bending.
    for (int p = 1; p < rod.num_places(); ++p)
    {
        const Vector3d &a = state.velocity(span, p - 1).tangent,
                       &b = state.velocity(span, p).tangent;
        by_tangents += std::atan2(a.cross(b).norm(), a.dot(b));
    }
    for (std::size_t g = 0; g < rod.bending_places().size(); ++g)
    {
        const int place = static_cast<int>(g) + 1;
        const RodState::Velocity& u = state.velocity(span, place);
        Vector3d w = Vector3d::Zero();
        for (int j = 0; j < rod.order(); ++j)
            w += rod.second(span, place)[j] * state.control(rod.controls(span)[j]);
        sum += rod.bending_weights()[g] * h * u.tangent.cross(w).norm() / u.length;
    }
    return std::max(sum, by_tangents);
}

int RodRefinement::refine(const MovingRod& of, std::span<const double> used)
{
    const auto is_used = [&](double begin, double end)
    {
        const auto next = std::lower_bound(used.begin(), used.end(), begin);
        return next != used.end() && *next <= end;
    };
    std::vector<double> to_insert;
    for (std::size_t e = 0; e < of.rod.spans().size(); ++e)
    {
        const RodSpan& span = of.rod.spans()[e];
        const double middle = 0.5 * (span.begin + span.end);
        const double shortest = settings_.shortest > 0.0
                                    ? settings_.shortest
                                    : of.rod.section_at(middle).radius;
        if (span.length > shortest && turn_of(of.state, e) > settings_.insert)
            to_insert.push_back(middle);
    }
    for (const double s : to_insert)
    {
        insert_knot(of, s);
        calm_[s] = 0;
    }
    int changes = static_cast<int>(to_insert.size());
    double changed_to = of.rod.basis().begin(); // nothing twice in a step
    for (auto knot = calm_.begin(); knot != calm_.end();)
    {
        const std::size_t e = idx(of.rod.basis().span_of(knot->first));
        const RodSpan &first = of.rod.spans()[e - 1], &second = of.rod.spans()[e];
        const bool is_calm =
            second.station[0] == first.station[1] &&
            turn_of(of.state, e - 1) + turn_of(of.state, e) < settings_.remove &&
            !is_used(first.begin, second.end);
        knot->second = is_calm ? knot->second + 1 : 0;
        if (knot->second > settings_.calm && first.begin >= changed_to)
        {
            const double end = second.end;
            if (remove_knot(of, e, settings_.tolerance * (first.length + second.length)))
            {
                changed_to = end;
                ++changes;
                knot = calm_.erase(knot);
                continue;
            }
            knot->second = 0;
        }
        ++knot;
    }
    return changes;
}

std::optional<double> breaking_place(const RodState& state, const BreakingLimits& limits)
{
    const Rod& rod = state.rod();
    double most = 1.0;
    std::optional<double> found;
    for (std::size_t e = 0; e < rod.spans().size(); ++e)
    {
        const RodSpan& span = rod.spans()[e];
        for (std::size_t g = 0; g < rod.bending_places().size(); ++g)
        {
            const double x = rod.bending_places()[g],
                         s = span.begin + x * (span.end - span.begin);
            const CurvePoint at = state.at(rod.basis().values_in(static_cast<int>(e), s));
            const double length = at.first.norm(),
                         sigma = rod.rest().at(static_cast<int>(e), s).first.norm();
            double share = 0.0;
            if (limits.curvature)
                share = at.first.cross(at.second).norm() / (length * length * sigma) /
                        *limits.curvature;
            if (limits.force)
                share = std::max(share, rod.section_at(s).stretch *
                                            (length / sigma - 1.0) / *limits.force);
            const double knot = x < 0.5 ? span.begin : rod.basis().wrapped(span.end);
            // Nor where it is cut already.
            const bool is_end =
                (!rod.basis().is_closed() &&
                 (knot == rod.basis().begin() || knot == rod.basis().end())) ||
                rod.basis().smoothness_before(rod.basis().span_of(knot)) < 0;
            if (share > most && !is_end)
            {
                most = share;
                found = knot;
            }
        }
    }
    return found;
}

} // namespace cellwarp::core
