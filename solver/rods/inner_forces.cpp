// SPDX-License-Identifier: GPL-3.0-or-later
// With the strains of elasticity.cpp the section carries
//   N = YA eps,   M = sum YI_i (kappa_i - kappa0_i) m_i + GJ (Delta - Delta0) / L t.
// The balance of an element, dM/dS + P' / sigma x n = 0 with P' / sigma = (1 + eps) t,
// leaves the shear of a rod that does not shear:
//   n - (t . n) t = t x dM/dS / (1 + eps).
// Splines that minimise an energy have their best strains at the places of the
// quadrature: stretch as a mean of a span, bending at its inner places, twist and the
// slope of M at its middle. Between these, and to the ends, all is linear by the length
// at rest. Where a force or a couple acts the values go over from one side to the other
// within a span.
#include "solver/rods/inner_forces.h"

#include <algorithm>
#include <array>

#include <Eigen/Geometry>

namespace cellwarp::core
{

using Eigen::Vector3d;

template <class Value>
void InnerForces::Samples<Value>::add(double length, const Value& one)
{
    at.push_back(length);
    value.push_back(one);
}

template <class Value>
Value InnerForces::Samples<Value>::operator()(double length) const
{
    if (at.size() == 1)
        return value.front();
    const auto next = std::upper_bound(at.begin(), at.end(), length);
    const std::size_t k =
        static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(
            next - at.begin(), 1, static_cast<std::ptrdiff_t>(at.size()) - 1)) -
        1;
    const double share = (length - at[k]) / (at[k + 1] - at[k]);
    return value[k] + share * (value[k + 1] - value[k]);
}

InnerForces::InnerForces(const RodState& state) : state_(state)
{
    const Rod& rod = state.rod();
    const RodState rest(rod);
    const bool is_given = rod.settings().rest == RodRest::Given;
    const std::span<const RodSpan> spans = rod.spans();
    Vector3d last_moment = Vector3d::Zero();
    double last_at = 0.0;
    for (std::size_t e = 0; e < spans.size(); ++e)
    {
        const RodSpan& span = spans[e];
        const bool begins =
            e == 0 || rod.basis().smoothness_before(static_cast<int>(e)) < 1;
        if (begins)
            pieces_.emplace_back();
        piece_of_span_.push_back(pieces_.size() - 1);
        Piece& piece = pieces_.back();
        const auto length_at = [&](double s)
        {
            const double ahead = rod.arc_length().at(s);
            // The end of a closed rod is its begin.
            return s == span.end && ahead < rod.arc_length().at(span.begin)
                       ? rod.arc_length().total()
                       : ahead;
        };
        const double h = span.end - span.begin;
        const auto stretch_at = [&](double s)
        {
            const BasisValues values = rod.basis().values_in(static_cast<int>(e), s);
            return state.at(values).first.norm() / rest.at(values).first.norm() - 1.0;
        };
        const std::span<const double> shares = rod.stretch_places(e);
        double tension = 0.0;
        for (std::size_t k = 0; k < shares.size(); ++k)
        {
            const double s = span.begin + shares[k] * h;
            tension +=
                rod.stretch_weights(e)[k] * rod.section_at(s).stretch * stretch_at(s);
        }
        const double middle = span.begin + 0.5 * h;
        piece.tension.add(length_at(middle), tension);
        double stiffness = 0.0;
        for (std::size_t g = 0; g < rod.bending_places().size(); ++g)
        {
            const double s = span.begin + rod.bending_places()[g] * h;
            const BasisValues values = rod.basis().values_in(static_cast<int>(e), s);
            const double sigma = rest.at(values).first.norm();
            const auto curvature = [&](const RodState& of)
            {
                const CurvePoint at = of.at(values);
                const Vector3d K =
                    at.first.cross(at.second) / (at.first.squaredNorm() * sigma);
                return Vector3d(of.frame_in(e, s).transpose() * K);
            };
            Vector3d kappa = curvature(state);
            if (is_given)
                kappa -= curvature(rest);
            const Section section = rod.section_at(s);
            stiffness += rod.bending_weights()[g] * section.twist;
            const Eigen::Matrix3d F = state.frame_in(e, s);
            const Vector3d moment = section.bending[0] * kappa[0] * F.col(0) +
                                    section.bending[1] * kappa[1] * F.col(1);
            const double at = length_at(s);
            // With one place a span the slope is the difference between spans.
            const bool has_slope = g > 0 || (rod.bending_places().size() == 1 && !begins);
            if (has_slope)
                piece.slope.add(0.5 * (at + last_at),
                                (moment - last_moment) / (at - last_at));
            last_moment = moment;
            last_at = at;
            piece.bending.add(at, moment);
        }
        double rest_twist = rod.settings().rest_twist * span.length;
        if (is_given)
            rest_twist += rest.twist(e) - rod.seam_turn(spans.size() - 1) * span.length /
                                              rod.arc_length().total();
        piece.torque.add(length_at(middle),
                         stiffness * (state.twist(e) - rest_twist) / span.length);
    }
    join_at_seam();
    for (Piece& piece : pieces_)
        if (piece.slope.at.empty())
            piece.slope.add(piece.bending.at.front(), Vector3d::Zero());
}

/// Continues forces that end at the seam of a closed rod at its begin.
void InnerForces::join_at_seam()
{
    const Rod& rod = state_.rod();
    if (!rod.basis().is_closed() || rod.basis().smoothness_before(0) < 1)
        return;
    Piece &front = pieces_.front(), &back = pieces_.back();
    const double turn = rod.arc_length().total();
    const auto join = [&](auto& first, auto& last)
    {
        if (first.at.empty() || last.at.empty())
            return;
        const double before = last.at.back() - turn, behind = first.at.front() + turn;
        const auto of_before = last.value.back(), of_behind = first.value.front();
        last.add(behind, of_behind);
        first.at.insert(first.at.begin(), before);
        first.value.insert(first.value.begin(), of_before);
    };
    join(front.tension, back.tension);
    join(front.torque, back.torque);
    join(front.bending, back.bending);
    join(front.slope, back.slope);
    if (rod.bending_places().size() > 1 || front.slope.at.empty())
        return;
    // With one place a span the slope at the seam is the difference across it.
    const double at = 0.5 * (front.bending.at[0] + front.bending.at[1]);
    const Vector3d slope = (front.bending.value[1] - front.bending.value[0]) /
                           (front.bending.at[1] - front.bending.at[0]);
    back.slope.at.insert(back.slope.at.end() - 1, at + turn);
    back.slope.value.insert(back.slope.value.end() - 1, slope);
    front.slope.at.insert(front.slope.at.begin() + 1, at);
    front.slope.value.insert(front.slope.value.begin() + 1, slope);
}

SectionForces InnerForces::in(std::size_t span, double s) const
{
    const Rod& rod = state_.rod();
    const Piece& piece = pieces_[piece_of_span_[span]];
    const RodSpan& of = rod.spans()[span];
    const double at =
        rod.arc_length().at(of.begin) +
        (s == of.end ? of.length
                     : rod.arc_length().at(s) - rod.arc_length().at(of.begin));
    const Vector3d t = state_.frame_in(span, s).col(2);
    SectionForces out;
    out.tension = piece.tension(at);
    out.torque = piece.torque(at);
    const Vector3d bending = piece.bending(at);
    out.moment = bending - t.dot(bending) * t + out.torque * t;
    const BasisValues values = rod.basis().values_in(static_cast<int>(span), s);
    const CurvePoint now = state_.at(values);
    const double sigma = rod.rest().combined(values).first.norm(), l = now.first.norm();
    // The torque's part of the slope across the tangent.
    const Vector3d turning = (now.second - t.dot(now.second) * t) / (l * sigma);
    out.shear = t.cross(piece.slope(at) + out.torque * turning) * (sigma / l);
    return out;
}

} // namespace cellwarp::core
