// SPDX-License-Identifier: GPL-3.0-or-later
// Constraints that move: a point with the speed p', a direction d and the n across it
// turn by w, n' = w x n. At a fixed state a row n . (P - p) changes by
//   n' . (P - p) - n . p',
// and along the motion of both, where all of it goes on evenly, its second derivative has
//   2 n' . (P' - p') + (w x n') . (P - p)
// beside that of the rod alone.
//
// Spin. The angle of a direction d of the world in the frame has no value where the
// tangent comes along d. Where nothing holds the tangent a direction is held that goes
// with it: the shortest turn takes d from the tangent t_0 of the begin of a step to t,
// and carry() goes on from there. Under du it spins by half of turn_of_hop(t_0, t) . du /
// l less than the material does.
//
// Rows of frames. The material frame F = [m_1 m_2 t] turns by
//   omega = (t x du) / l + t dphi
// with u = P' and the spin dphi of elasticity.cpp, the chain of hops ending at s. Two
// frames a and b that must agree, columns x_a ... z_b, b at rest: y_a . z_b = z_a . x_b =
// x_a . y_b = 0, whose derivative is (y_a x z_b) . omega_a, and so on.
#include "solver/rods/rod_constraint.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include <Eigen/Geometry>

#include "octree/base/rigid_motion.h"
#include "solver/rods/slide.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Vector3d;

/// A linear form of the unknowns, gathered in any order; or nothing, where its entries
/// are not asked for.
class Form
{
public:
    explicit Form(bool is_wanted) : is_wanted_(is_wanted) {}
    bool is_wanted() const { return is_wanted_; }
    void add(int unknown, double value)
    {
        if (is_wanted_)
            entries_.emplace_back(unknown, value);
    }
    /// += scale * v . (the derivative of that order of the curve)
    void add(const RodState& state, const BasisValues& values, int order,
             const Vector3d& v)
    {
        if (!is_wanted_)
            return;
        entries_.reserve(entries_.size() + 3 * idx(values.count));
        for (int j = 0; j < values.count; ++j)
        {
            const int first = state.rod().layout().control[idx(values.control[idx(j)])];
            for (int c = 0; c < 3; ++c)
                add(first + c, values.value[idx(order)][idx(j)] * v[c]);
        }
    }
    void add(const Form& other, double scale)
    {
        for (const auto& [unknown, value] : other.entries_)
            add(unknown, scale * value);
    }
    /// \pre called once
    ConstraintRow row(double violation)
    {
        ConstraintRow row{std::move(entries_), violation};
        sort_and_add_up(row.entries);
        std::erase_if(row.entries, [](const auto& entry) { return entry.second == 0.0; });
        return row;
    }

private:
    bool is_wanted_;
    std::vector<std::pair<int, double>> entries_;
};

/// Values at a place of a span, 0 ... num_places - 1.
BasisValues values_of_place(const Rod& rod, std::size_t e, int place)
{
    const RodSpan& span = rod.spans()[e];
    return rod.basis().values_in(static_cast<int>(e),
                                 span.begin + rod.place(place) * (span.end - span.begin));
}

struct Hop
{
    BasisValues a, b;
    Vector3d on_a, on_b;
};

Hop hop_of(const RodState& state, const BasisValues& a, const BasisValues& b)
{
    const Vector3d ua = state.at(a).first, ub = state.at(b).first;
    const double la = ua.norm(), lb = ub.norm();
    const Vector3d ta = ua / la, tb = ub / lb;
    const Vector3d beta = turn_of_hop(ta, tb);
    return {a, b, beta / (2.0 * la), beta / (2.0 * lb)};
}

void add(Form& form, const RodState& state, const Hop& hop, double share)
{
    form.add(state, hop.a, 1, share * hop.on_a);
    form.add(state, hop.b, 1, share * hop.on_b);
}

Form spin_form(const RodState& state, double s, bool is_wanted)
{
    Form form(is_wanted);
    if (!is_wanted)
        return form;
    const Rod& rod = state.rod();
    const double at = rod.basis().wrapped(s);
    const std::size_t e = idx(rod.basis().span_of(at));
    const RodSpan& span = rod.spans()[e];
    const double x = (at - span.begin) / (span.end - span.begin);
    const int near = rod.layout().angle[idx(span.station[0])],
              far = rod.layout().angle[idx(span.station[1])];
    form.add(near, 1.0 - x);
    form.add(far, x);
    if (x == 0.0 || x == 1.0)
        return form;
    const int last = rod.num_places() - 1;
    const double c0 = rod.cubes_of_steps();
    for (int p = 1; p <= last; ++p)
        add(form, state,
            hop_of(state, values_of_place(rod, e, p - 1), values_of_place(rod, e, p)),
            x / (1.0 - c0));
    add(form, state,
        hop_of(state, values_of_place(rod, e, 0), values_of_place(rod, e, last)),
        -x * c0 / (1.0 - c0));
    BasisValues from = values_of_place(rod, e, 0);
    for (int p = 1; p < last && rod.place(p) < x; ++p)
    {
        const BasisValues to = values_of_place(rod, e, p);
        add(form, state, hop_of(state, from, to), -1.0);
        from = to;
    }
    add(form, state, hop_of(state, from, rod.basis().values_in(static_cast<int>(e), at)),
        -1.0);
    return form;
}

/// axis . omega at s
Form turn_form(const RodState& state, double s, const BasisValues& values,
               const Vector3d& axis, bool is_wanted)
{
    if (!is_wanted)
        return Form(false);
    const Vector3d u = state.at(values).first;
    const double l = u.norm();
    const Vector3d t = u / l;
    Form form(true);
    form.add(state, values, 1, axis.cross(t) / l); // axis . (t x du) = du . (axis x t)
    form.add(spin_form(state, s, true), axis.dot(t));
    return form;
}

/// Rows of the frame at a place, which must be \p wanted.
std::vector<ConstraintRow> frame_rows(const RodState& state, const HeldBasis& basis,
                                      const Eigen::Matrix3d& wanted, bool is_wanted)
{
    const Eigen::Matrix3d now = state.frame(basis.s);
    std::vector<ConstraintRow> rows;
    rows.reserve(3);
    for (int k = 0; k < 3; ++k)
    {
        const Vector3d first = now.col((k + 1) % 3), second = wanted.col((k + 2) % 3);
        rows.push_back(turn_form(state, basis.s, basis.at, first.cross(second), is_wanted)
                           .row(first.dot(second)));
    }
    return rows;
}

/// The constraint after \p time [s].
RodConstraint moved(const RodConstraint& c, double time)
{
    RodConstraint out = c;
    out.point += time * c.point_speed;
    out.spin += time * c.spin_speed;
    if (const double angle = time * c.turning.norm();
        angle != 0.0 && c.hold != HoldKind::Spin)
        out.direction = rotation_about(c.turning.normalized(), angle) * c.direction;
    return out;
}

/// Two unit vectors across \p n.
std::array<Vector3d, 2> across(const Vector3d& n)
{
    const Vector3d unit = n.normalized(), a = any_normal(unit);
    return {a, unit.cross(a)};
}

} // namespace

void carry(RodConstraint& c, const RodState& state)
{
    if (c.hold != HoldKind::Spin)
        return;
    const Vector3d t = state.at(c.s).first.normalized();
    const Vector3d d = transported(c.tangent, t, c.direction);
    c.direction = (d - t.dot(d) * t).normalized();
    c.tangent = t;
}

std::vector<Vector3d> held_directions(const RodConstraint& c)
{
    switch (c.hold)
    {
    case HoldKind::Plane:
        return {c.direction};
    case HoldKind::Axis:
    {
        const std::array<Vector3d, 2> both = across(c.direction);
        return {both[0], both[1]};
    }
    default:
        return {Vector3d::UnitX(), Vector3d::UnitY(), Vector3d::UnitZ()};
    }
}

int num_rows(HoldKind hold)
{
    switch (hold)
    {
    case HoldKind::Plane:
    case HoldKind::TwistAngle:
    case HoldKind::Spin:
        return 1;
    case HoldKind::Axis:
    case HoldKind::Tangent:
    case HoldKind::GeometricCurvature:
        return 2;
    default:
        return 3;
    }
}

int num_rows(const RodConstraint& c, const RodState& state)
{
    const bool is_gone =
        c.slide >= 0 && state.sliding[idx(c.slide)].mode == Sliding::Mode::Gone;
    return c.is_off || is_gone ? 0 : num_rows(c.hold);
}

std::vector<std::pair<int, double>> spin_at(const RodState& state, double s)
{
    return spin_form(state, s, true).row(0.0).entries;
}

std::vector<std::pair<int, double>> turn_at(const RodState& state, double s,
                                            const Vector3d& axis)
{
    return turn_form(state, s, state.rod().basis().values(s), axis, true)
        .row(0.0)
        .entries;
}

HeldBasis::HeldBasis(const RodConstraint& constraint, const SplineBasis& basis)
    : s(constraint.s), control(constraint.control), at(basis.values(s))
{
    if (constraint.control < 0)
        return;
    at = BasisValues();
    at.count = 1;
    at.control[0] = constraint.control;
    at.value[0][0] = 1.0;
}

std::vector<ConstraintRow> rows_of(const RodConstraint& c, const RodState& state,
                                   const HeldBasis& basis, bool with_entries)
{
    const BasisValues& values = basis.at;
    const CurvePoint at = state.at(values);
    std::vector<ConstraintRow> rows;
    rows.reserve(3);
    const Sliding* const sliding = c.slide < 0 ? nullptr : &state.sliding[idx(c.slide)];
    if (num_rows(c, state) == 0)
        return rows;
    const auto linear = [&](int order, const Vector3d& n, double violation, double rate)
    {
        Form form(with_entries);
        form.add(state, values, order, n);
        if (sliding && sliding->is_free())
            form.add(state.rod().layout().num_unknowns + c.slide, n.dot(at.first));
        rows.push_back(form.row(violation));
        rows.back().rate = rate;
    };
    const auto vector = [&](int order, const Vector3d& violation, const Vector3d& rate)
    {
        for (int k = 0; k < 3; ++k)
            linear(order, Vector3d::Unit(k), violation[k], rate[k]);
    };
    const auto of_place = [&](const Vector3d& n)
    {
        const Vector3d off = at.place - c.point;
        linear(0, n, n.dot(off), c.turning.cross(n).dot(off) - n.dot(c.point_speed));
    };
    switch (c.hold)
    {
    case HoldKind::Point:
        vector(0, at.place - c.point, -c.point_speed);
        break;
    case HoldKind::Plane:
        of_place(c.direction);
        break;
    case HoldKind::Axis:
        for (const Vector3d& n : across(c.direction))
            of_place(n);
        break;
    case HoldKind::Tangent:
        for (const Vector3d& n : across(c.direction))
            linear(1, n, n.dot(at.first), c.turning.cross(n).dot(at.first));
        break;
    case HoldKind::CurvatureVector:
        vector(2, at.second - c.direction, -c.turning.cross(c.direction));
        break;
    case HoldKind::GeometricCurvature:
    {
        const double l = at.first.norm();
        const double sigma = state.rod().rest().combined(values).first.norm();
        const double f = 1.0 / (l * l * sigma);
        const Vector3d K = f * at.first.cross(at.second), t = at.first / l;
        for (const Vector3d& n : across(t))
        {
            Form form(with_entries);
            form.add(state, values, 1, -f * n.cross(at.second) - 2.0 * K.dot(n) / l * t);
            form.add(state, values, 2, f * n.cross(at.first));
            rows.push_back(form.row(n.dot(K - c.direction)));
            rows.back().rate = -n.dot(c.turning.cross(c.direction));
        }
        break;
    }
    case HoldKind::TwistAngle:
    {
        const Eigen::Matrix3d F = state.frame(c.s);
        const Vector3d wanted =
            (c.direction - F.col(2).dot(c.direction) * F.col(2)).normalized();
        Form form = spin_form(state, c.s, with_entries);
        // The angle of the wanted direction in the frame; it moves with the tangent, too.
        const double angle = std::atan2(F.col(1).dot(wanted), F.col(0).dot(wanted));
        const Vector3d& d = c.direction;
        const Vector3d t = F.col(2);
        const double l = at.first.norm();
        const double in_plane = (d - t.dot(d) * t).squaredNorm();
        // d(angle of d's part across t) = -(t . d) (t x d) . dt / |d across t|^2, dt
        // across t.
        form.add(state, values, 1, (t.dot(d) / (in_plane * l)) * t.cross(d));
        rows.push_back(form.row(-angle));
        rows.back().rate = -t.cross(d).dot(c.turning.cross(d)) / in_plane;
        break;
    }
    case HoldKind::Spin:
    {
        const Eigen::Matrix3d F = state.frame(c.s);
        const Vector3d t = F.col(2), wanted = transported(c.tangent, t, c.direction);
        Form form = spin_form(state, c.s, with_entries);
        form.add(state, values, 1, turn_of_hop(c.tangent, t) / (2.0 * at.first.norm()));
        const double angle = std::atan2(F.col(1).dot(wanted), F.col(0).dot(wanted));
        rows.push_back(form.row(std::remainder(-angle - c.spin, 2.0 * std::numbers::pi)));
        rows.back().rate = -c.spin_speed;
        break;
    }
    case HoldKind::Frame:
        return frame_rows(state, basis, c.frame, with_entries);
    }
    return rows;
}

std::vector<double> convective(const RodConstraint& c, const RodState& state,
                               const Eigen::VectorXd& velocity)
{
    std::vector<double> out(idx(num_rows(c, state)), 0.0);
    const Sliding* const sliding = c.slide < 0 ? nullptr : &state.sliding[idx(c.slide)];
    if (out.empty())
        return out;
    const auto speed_of = [&](const BasisValues& values, int order)
    {
        Vector3d sum = Vector3d::Zero();
        for (int j = 0; j < values.count; ++j)
            sum += values.value[idx(order)][idx(j)] *
                   velocity.segment<3>(
                       state.rod().layout().control[idx(values.control[idx(j)])]);
        return sum;
    };
    switch (c.hold)
    {
    case HoldKind::Point:
    case HoldKind::Plane:
    case HoldKind::Axis:
    {
        if (!sliding && (c.hold == HoldKind::Point || c.turning.isZero(0.0)))
            return out; // linear
        const BasisValues values = sliding
                                       ? sliding_values(state.rod().basis(), sliding->s)
                                       : HeldBasis(c, state.rod().basis()).at;
        const CurvePoint at = state.at(values);
        // The second derivative of P(s(t), t) has 2 s' V' + s'^2 P'', V the curve's
        // speed.
        const double s_speed = sliding && sliding->is_free() ? sliding->speed : 0.0;
        const Vector3d whole =
            2.0 * s_speed * speed_of(values, 1) + s_speed * s_speed * at.second;
        const Vector3d passing = speed_of(values, 0) + s_speed * at.first - c.point_speed;
        const std::vector<Vector3d> n = held_directions(c);
        for (std::size_t k = 0; k < out.size(); ++k)
        {
            const Vector3d turned = c.hold == HoldKind::Point
                                        ? Vector3d(Vector3d::Zero())
                                        : Vector3d(c.turning.cross(n[k]));
            out[k] = n[k].dot(whole) + 2.0 * turned.dot(passing) +
                     c.turning.cross(turned).dot(at.place - c.point);
        }
        return out;
    }
    case HoldKind::Tangent:
    {
        if (c.turning.isZero(0.0))
            return out;
        const BasisValues values = state.rod().basis().values(c.s);
        const std::array<Vector3d, 2> n = across(c.direction);
        for (const std::size_t k : {0u, 1u})
        {
            const Vector3d turned = c.turning.cross(n[k]);
            out[k] = 2.0 * turned.dot(speed_of(values, 1)) +
                     c.turning.cross(turned).dot(state.at(values).first);
        }
        return out;
    }
    case HoldKind::CurvatureVector:
        for (int k = 0; k < 3; ++k)
            out[idx(k)] = -c.turning.cross(Vector3d(c.turning.cross(c.direction)))[k];
        return out;
    default:
        break;
    }
    const double speed = std::max(
        velocity.cwiseAbs().maxCoeff(),
        std::max(c.point_speed.norm(),
                 c.turning.norm() * std::min(1.0, state.rod().arc_length().total())));
    if (!(speed > 0.0))
        return out;
    // A step small beside the rod, but not so small that rounding shows.
    const double step = 1e-4 * std::min(1.0, state.rod().arc_length().total()) / speed;
    RodState ahead = state, behind = state;
    ahead.move(velocity, step);
    behind.move(velocity, -step);
    const HeldBasis basis(c, state.rod().basis());
    const std::vector<ConstraintRow> a = rows_of(moved(c, step), ahead, basis),
                                     b = rows_of(moved(c, -step), behind, basis);
    for (std::size_t k = 0; k < out.size(); ++k)
    {
        // L' v and its rate: the change of L v + g_t along v.
        const auto along = [&](const ConstraintRow& row)
        {
            double sum = row.rate;
            for (const auto& [unknown, value] : row.entries)
                sum += value * velocity[unknown];
            return sum;
        };
        out[k] = (along(a[k]) - along(b[k])) / (2.0 * step);
    }
    return out;
}

} // namespace cellwarp::core
