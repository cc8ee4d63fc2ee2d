// SPDX-License-Identifier: GPL-3.0-or-later
// A rod is solved with YI = GJ = 1 and YA L^2 = 1e4 YI [theory-rods (35)]: as long as it
// only leads, nothing but these ratios counts. Its energy and forces are scaled to those
// of a round rod of the tube's radius R, YI = 2 pi R^4 / 4, afterwards.
//
// A curve bends only as told: through given points it is the spline of least integral of
// |P''|^2 over the parameters of its rest. That is linear in the places, so the rest and
// one matrix tell all of it; by control points the matrix is the identity.
#include "library/session/spline_handle.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <stdexcept>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "library/session/line_curve.h"
#include "library/session/spline_holds.h"
#include "octree/base/index.h"
#include "octree/base/segment.h"
#include "solver/coupled/rod_motion.h"
#include "solver/dynamics/implicit_stepper.h"
#include "solver/rods/elasticity.h"
#include "solver/rods/rod_model.h"
#include "solver/rods/rod_newton.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// YA L^2 / YI.
constexpr double kSlender = 1e4;

/// Straight pieces of a span.
constexpr int kPieces = 8;

/// A twist that is held where the tangent is not is told again for the line that came
/// out, so often, until it is off by no more [rad].
constexpr int kRounds = 20;
constexpr double kSameTurn = 1e-11;

/// Newton's steps of a rod.
constexpr int kIterations = 200;

/// How control points follow places: those of points on the curve, the others by the
/// least integral of |P''|^2.
Eigen::MatrixXd controls_by_points(const Spline& spline, std::span<const double> at)
{
    const int n = spline.basis.num_controls(), m = static_cast<int>(at.size());
    Eigen::MatrixXd system = Eigen::MatrixXd::Zero(n + m, n + m);
    for (std::size_t e = 0; e < spline.basis.spans().size(); ++e)
    {
        const SplineSpan& span = spline.basis.spans()[e];
        // P'' is linear in a span: two Gauss points are exact.
        for (const double place :
             {0.5 - 0.5 / std::sqrt(3.0), 0.5 + 0.5 / std::sqrt(3.0)})
        {
            const BasisValues values = spline.basis.values_in(
                static_cast<int>(e), span.begin + place * span.length());
            for (int i = 0; i < values.count; ++i)
                for (int j = 0; j < values.count; ++j)
                    system(values.control[idx(i)], values.control[idx(j)]) +=
                        0.5 * span.length() * values.value[2][idx(i)] *
                        values.value[2][idx(j)];
        }
    }
    const double scale = system.topLeftCorner(n, n).diagonal().maxCoeff();
    for (int k = 0; k < m; ++k)
    {
        const BasisValues values = spline.basis.values(at[idx(k)]);
        for (int i = 0; i < values.count; ++i)
            system(n + k, values.control[idx(i)]) =
                system(values.control[idx(i)], n + k) = scale * values.value[0][idx(i)];
    }
    Eigen::MatrixXd right = Eigen::MatrixXd::Zero(n + m, m);
    right.bottomRows(m) = scale * Eigen::MatrixXd::Identity(m, m);
    return Eigen::FullPivLU<Eigen::MatrixXd>(system).solve(right).topRows(n);
}

} // namespace

class SplineHandle::State final : public SplineState
{
public:
    /// \p lead: of a rod that pushes back, where it would be if it only led.
    State(const SplineHandle& of, RodState state, SplineHolds holds, bool is_rest,
          double energy, std::vector<Vector3d> forces,
          std::optional<RodState> lead = std::nullopt)
        : of_(of), state_(std::move(state)), holds_(std::move(holds)), is_rest_(is_rest),
          energy_(energy), forces_(std::move(forces)), lead_(std::move(lead))
    {
    }

    const RodState* rod() const override { return &state_; }
    bool is_at(const SplineState& other) const override
    {
        return state_.x() == static_cast<const State&>(other).state_.x();
    }
    const RodState& lead() const { return lead_ ? *lead_ : state_; }
    const SplineHolds& holds() const { return holds_; }
    RailPlace at(double s) const override
    {
        const CurvePoint point = state_.at(s);
        return {point.place, point.first, point.second};
    }
    Motion carry(double s) const override;
    double energy() const override { return energy_; }
    double length() const override { return ArcLength(state_.curve()).total(); }
    std::vector<Vector3d> forces() const override { return forces_; }
    std::vector<Vector3d> points() const override;
    Matrix3d frame_at_point(std::size_t point) const override;
    double turn_at_point(std::size_t point) const override;

private:
    const SplineHandle& of_;
    RodState state_;
    SplineHolds holds_;
    bool is_rest_;
    double energy_;
    std::vector<Vector3d> forces_;
    std::optional<RodState> lead_;
};

SplineHandle::SplineHandle(const SplineStatement& statement,
                           std::span<const Vector3d> points, bool is_rod, double radius)
    : is_rod_(is_rod), by_controls_(statement.form == SplineStatement::Form::Points),
      radius_(radius), points_(points.begin(), points.end()),
      rod_(curve_of(statement, points_, &at_points_),
           section_of(curve_of(statement, points_)), {}),
      rest_(rod_)
{
    const Spline& spline = rod_.rest();
    if (by_controls_)
        for (std::size_t k = 0; k < points_.size(); ++k)
            at_points_.push_back(nearest_on_curve(points_[k]));
    if (by_controls_ && !is_closed())
    {
        at_points_.front() = begin();
        at_points_.back() = end();
    }
    if (!is_rod && !by_controls_)
        follow_ = controls_by_points(spline, at_points_);
    // As a round rod of the tube's radius, [theory-rods (35)].
    scale_ = 0.5 * std::numbers::pi * std::pow(radius_, 4);
    if (statement.stiffness)
    {
        scale_ *= *statement.stiffness;
        stiffness_ = scale_;
    }
    start();
}

SplineHandle::SplineHandle(const Spline& rest, double radius)
    : is_rod_(true), by_controls_(true), radius_(radius),
      rod_(rest, section_of(rest), {}), rest_(rod_)
{
    start();
}

std::function<Section(double)> SplineHandle::section_of(const Spline& spline) const
{
    const double length = ArcLength(spline).total();
    Section section;
    section.stretch = kSlender / (length * length);
    section.bending = {1.0, 1.0};
    section.twist = 1.0;
    section.mass = 1.0 / length;
    section.radius = radius_;
    return [section](double) { return section; };
}

/// What follows from the rest.
void SplineHandle::start()
{
    for (const SplineSpan& span : rod_.basis().spans())
        for (int piece = 0; piece < kPieces; ++piece)
            add_place(span.begin + piece * span.length() / kPieces);
    add_place(end());
    rest_state_ = std::make_shared<const State>(
        *this, rest_, rest_holds(), true, 0.0,
        std::vector<Vector3d>(num_points(), Vector3d::Zero()));
}

void SplineHandle::add_place(double s)
{
    const CurvePoint at = rod_.rest().at(s);
    polyline_.push_back(at.place);
    stations_.push_back({s, rod_.arc_length().at(s), at.first.normalized()});
}

Motion SplineHandle::State::carry(double s) const
{
    if (is_rest_)
        return {};
    return carried_by(state_, of_.rest_, s);
}

std::vector<Vector3d> SplineHandle::State::points() const
{
    if (is_rest_)
        return of_.points_;
    std::vector<Vector3d> points;
    for (std::size_t k = 0; k < of_.num_points(); ++k)
        points.push_back(of_.by_controls_ ? state_.control(static_cast<int>(k))
                                          : state_.at(of_.parameter_of_point(k)).place);
    return points;
}

Matrix3d SplineHandle::State::frame_at_point(std::size_t point) const
{
    return state_.frame(of_.parameter_of_point(point));
}

double SplineHandle::State::turn_at_point(std::size_t point) const
{
    return of_.turn_at(state_, point, frame_anchor(of_, holds_));
}

double SplineHandle::polished(double s, double reach, const Vector3d& x) const
{
    constexpr int kMost = 20;
    for (int k = 0; k < kMost; ++k)
    {
        const CurvePoint at = rod_.rest().at(s);
        const Vector3d away = at.place - x;
        const double slope = at.first.squaredNorm();
        const double step =
            -away.dot(at.first) / (slope + std::max(away.dot(at.second), -0.5 * slope));
        const double wanted = s + std::clamp(step, -reach, reach);
        const double next = is_closed() ? rod_.basis().wrapped(wanted)
                                        : std::clamp(wanted, begin(), end());
        if (std::abs(next - s) <= 1e-14 * (end() - begin()))
            return next;
        s = next;
    }
    return s;
}

double SplineHandle::nearest(const Vector3d& x) const
{
    double least = std::numeric_limits<double>::infinity(), best = begin(), reach = 0.0;
    for (std::size_t k = 0; k + 1 < polyline_.size(); ++k)
    {
        const double t = nearest_share(polyline_[k], polyline_[k + 1], x);
        const double away =
            (polyline_[k] + t * (polyline_[k + 1] - polyline_[k]) - x).squaredNorm();
        if (away < least)
        {
            least = away;
            reach = stations_[k + 1].parameter - stations_[k].parameter;
            best = stations_[k].parameter + t * reach;
        }
    }
    return polished(best, reach, x);
}

/// Before the polyline is there.
double SplineHandle::nearest_on_curve(const Vector3d& x) const
{
    constexpr int kTries = 1000;
    double least = std::numeric_limits<double>::infinity(), best = begin();
    for (int k = 0; k <= kTries; ++k)
    {
        const double s = begin() + (end() - begin()) * k / kTries;
        const double away = (rod_.rest().at(s).place - x).squaredNorm();
        if (away < least)
        {
            least = away;
            best = s;
        }
    }
    return polished(best, (end() - begin()) / kTries, x);
}

SplineHolds SplineHandle::rest_holds() const
{
    SplineHolds holds(num_points());
    for (std::size_t k = 0; k < holds.size(); ++k)
    {
        const bool is_end = k == 0 || (!is_closed() && k + 1 == holds.size());
        if (!is_rod_)
            holds[k].parts = {true, false, false};
        else if (is_end)
            holds[k].parts = {true, true, true};
        holds[k].place = points_[k];
        holds[k].tangent = rest_.at(at_points_[k]).first.normalized();
    }
    return holds;
}

/// How far the frame at a point of \p now is turned about its tangent: at \p anchor
/// against the shortest way from rest, from there on by what the spans are twisted.
double SplineHandle::turn_at(const RodState& now, std::size_t point,
                             std::size_t anchor) const
{
    const double from = at_points_[anchor], to = at_points_[point];
    const Matrix3d frame = now.frame(from), rest = rest_.frame(from);
    const Vector3d carried =
        shortest_turn(rest.col(2), frame.col(2), rest.col(0)) * rest.col(0);
    double turn = std::atan2(frame.col(2).dot(carried.cross(frame.col(0))),
                             carried.dot(frame.col(0)));
    const double low = std::min(from, to), high = std::max(from, to);
    const std::span<const RodSpan> spans = rod_.spans();
    for (std::size_t e = 0; e < spans.size(); ++e)
        if (const double middle = 0.5 * (spans[e].begin + spans[e].end);
            middle > low && middle < high)
            turn += (from < to ? 1.0 : -1.0) * (now.twist(e) - rest_.twist(e));
    return turn;
}

std::vector<RodConstraint> SplineHandle::constraints(const SplineState& state,
                                                     const RodState& now,
                                                     bool is_alone) const
{
    const SplineHolds& holds = static_cast<const State&>(state).holds();
    std::vector<RodConstraint> out = constraints(now, holds);
    if (is_alone)
        hold_what_is_free(now, holds, out);
    return out;
}

/// What \p holds ask for; of a twist without a tangent, as seen from \p now.
std::vector<RodConstraint> SplineHandle::constraints(const RodState& now,
                                                     const SplineHolds& holds) const
{
    std::vector<RodConstraint> out;
    const std::size_t anchor = frame_anchor(*this, holds);
    for (std::size_t k = 0; k < holds.size(); ++k)
    {
        const SplineHold& hold = holds[k];
        RodConstraint constraint;
        constraint.s = at_points_[k];
        if (hold.parts.place)
        {
            constraint.hold = HoldKind::Point;
            constraint.point = hold.place;
            // Clamped ends of an open spline are its outer control points.
            if (by_controls_)
                constraint.control = static_cast<int>(k);
            out.push_back(constraint);
            constraint.control = -1;
        }
        if (!hold.parts.tangent && !hold.parts.twist)
            continue;
        if (hold.parts.tangent && hold.parts.twist)
        {
            constraint.hold = HoldKind::Frame;
            constraint.frame = rotation_about(hold.tangent, hold.turn) * hold.carried *
                               rest_.frame(constraint.s);
        }
        else if (hold.parts.tangent)
        {
            constraint.hold = HoldKind::Tangent;
            constraint.direction = hold.tangent;
        }
        else
        {
            const Matrix3d frame = now.frame(constraint.s);
            constraint.hold = HoldKind::TwistAngle;
            constraint.direction =
                rotation_about(frame.col(2), hold.turn - turn_at(now, k, anchor)) *
                frame.col(0);
        }
        out.push_back(constraint);
    }
    return out;
}

/// Motions that \p holds leave free, of the rod as a whole or of a straight one about its
/// own line, cost nothing, and the equations would not say where it stays: as it is at
/// \p now. Nothing pulls at what this adds.
void SplineHandle::hold_what_is_free(const RodState& now, const SplineHolds& holds,
                                     std::vector<RodConstraint>& out) const
{
    int places = 0;
    bool has_tangent = false, has_twist = false;
    std::size_t at = 0;
    for (std::size_t k = holds.size(); k-- > 0;)
    {
        const HoldParts& parts = holds[k].parts;
        places += parts.place;
        has_tangent |= parts.tangent;
        has_twist |= parts.twist;
        if (parts.place && has_frame_at(k))
            at = k;
    }
    RodConstraint constraint;
    constraint.s = has_frame_at(at) ? at_points_[at] : begin();
    const Matrix3d frame = now.frame(constraint.s);
    if (places == 0)
    {
        constraint.hold = HoldKind::Point;
        constraint.point = now.at(constraint.s).place;
        out.push_back(constraint);
    }
    if (places <= 1 && !has_tangent)
    {
        constraint.hold = HoldKind::Tangent;
        constraint.direction = frame.col(2);
        out.push_back(constraint);
    }
    // Cells that a rod pushes back on do not let it turn about a line that is not
    // straight.
    const bool may_spin = stiffness_ > 0.0 ? places <= 1 || (places == 2 && !has_tangent)
                                           : places <= 2 || rod_.is_straight();
    if (!has_twist && may_spin)
    {
        constraint.hold = HoldKind::TwistAngle;
        constraint.direction = frame.col(0);
        out.push_back(constraint);
    }
}

/// Where Newton's method alone does not get there: by damped steps in time, as if it were
/// as heavy as needed, and then once more for the last digits.
bool SplineHandle::finds_rest(RodModel& model, const RodState& before,
                              RodState& state) const
{
    state = before;
    Eigen::VectorXd velocity = Eigen::VectorXd::Zero(model.num_unknowns());
    RodObject object(model);
    object.bind(state, velocity);
    ImplicitStepper stepper({&object});
    return is_solved(stepper.settle().stop);
}

/// A curve, where its points are.
std::shared_ptr<const SplineState> SplineHandle::led(const SplineHolds& holds) const
{
    Eigen::MatrixX3d shift(holds.size(), 3);
    for (std::size_t k = 0; k < holds.size(); ++k)
        shift.row(static_cast<Eigen::Index>(k)) =
            (holds[k].place - points_[k]).transpose();
    const Eigen::MatrixX3d moved = by_controls_ ? shift : follow_ * shift;
    Eigen::VectorXd x = rest_.x();
    for (int k = 0; k < rod_.num_controls(); ++k)
        x.segment<3>(rod_.layout().control[idx(k)]) += moved.row(k).transpose();
    RodState state = rest_;
    state.move_to(x);
    return std::make_shared<const State>(
        *this, std::move(state), holds, shift.isZero(0), 0.0,
        std::vector<Vector3d>(holds.size(), Vector3d::Zero()));
}

std::shared_ptr<const SplineState> SplineHandle::moved(const SplineState& from,
                                                       const SplineHolds& holds,
                                                       bool tries_all) const
{
    if (!is_rod_)
        return led(holds);
    const State& start = static_cast<const State&>(from);
    if (stiffness_ > 0.0 && is_kept(*start.rod(), holds))
        return std::make_shared<const State>(*this, *start.rod(), holds, false,
                                             start.energy(), start.forces(),
                                             start.lead());
    if (holds == rest_holds())
        return stiffness_ > 0.0 ? pushed(start, rest_, holds) : rest_state_;
    RodModel model(rod_);
    model.terms.push_back(exact_elasticity(rod_));
    RodState state = start.lead();
    RodNewton newton(model);
    MotionOptions options;
    options.max_iterations = kIterations;
    const std::size_t anchor = frame_anchor(*this, holds);
    for (int round = 0; round < kRounds; ++round)
    {
        const RodState before = state;
        model.constraints = constraints(before, holds);
        hold_what_is_free(before, holds, model.constraints);
        const MotionReport report = newton.solve(state, options);
        if (!is_solved(report.stop) && (!tries_all || !finds_rest(model, before, state)))
            return nullptr;
        double off = 0.0;
        for (std::size_t k = 0; k < holds.size(); ++k)
            if (holds[k].parts.twist && !holds[k].parts.tangent)
                off = std::max(off, std::abs(turn_at(state, k, anchor) - holds[k].turn));
        if (off <= kSameTurn)
            break;
    }
    if (stiffness_ > 0.0)
        return pushed(start, state, holds);
    const double energy = energy_of(state);
    return std::make_shared<const State>(*this, std::move(state), holds, false, energy,
                                         forces(holds, scale_ * newton.multipliers()));
}

/// Whether a rod is already as \p holds have it: they only let go.
bool SplineHandle::is_kept(const RodState& now, const SplineHolds& holds) const
{
    constexpr double kMet = 1e-10; // [work], [rad]
    const Eigen::VectorXd violation = hold_rows(now, constraints(now, holds)).violation;
    return violation.size() == 0 || violation.lpNorm<Eigen::Infinity>() <= kMet;
}

/// Those at the places of the holds.
std::vector<Vector3d> SplineHandle::forces(const SplineHolds& holds,
                                           const Eigen::VectorXd& multipliers) const
{
    std::vector<Vector3d> forces(holds.size(), Vector3d::Zero());
    Eigen::Index row = 0;
    for (std::size_t k = 0; k < holds.size(); ++k)
    {
        const auto& [place, tangent, twist] = holds[k].parts;
        if (place && row + 3 <= multipliers.size())
            forces[k] = multipliers.segment<3>(row);
        row += 3 * place + 2 * tangent + twist;
    }
    return forces;
}

double SplineHandle::energy_of(const RodState& state) const
{
    RodModel model(rod_);
    model.terms.push_back(exact_elasticity(rod_));
    return scale_ * model.elastic_energy(state);
}

/// Where a rod that pushes back is taken to for a start: with the motions that it would
/// make if it only led, to \p lead.
std::shared_ptr<const SplineState> SplineHandle::pushed(const State& from,
                                                        const RodState& lead,
                                                        const SplineHolds& holds) const
{
    RodState state = moved_along(*from.rod(), from.lead(), lead, rest_);
    bring_to(state, constraints(state, holds));
    const double energy = energy_of(state);
    return std::make_shared<const State>(
        *this, std::move(state), holds, false, energy,
        std::vector<Vector3d>(holds.size(), Vector3d::Zero()), lead);
}

std::shared_ptr<const SplineState>
SplineHandle::solved(const SplineState& from, const RodState& now,
                     const Eigen::VectorXd& multipliers) const
{
    const State& start = static_cast<const State&>(from);
    return std::make_shared<const State>(*this, now, start.holds(), false, energy_of(now),
                                         forces(start.holds(), multipliers),
                                         start.lead());
}

} // namespace cellwarp::core
