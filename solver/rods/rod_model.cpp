// SPDX-License-Identifier: GPL-3.0-or-later
// Loads. A force f at s pulls control point k with b_k f. A couple c turns the tangent,
// so it does the work c . (t x dt) + (c . t) dphi: control point k gets b'_k (c x t) / l,
// and the spin gets c . t. A couple of fixed direction has no potential; Newton's method
// takes the symmetric part of its derivative.
#include "solver/rods/rod_model.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <Eigen/Geometry>

#include "octree/base/rigid_motion.h"

namespace cellwarp::core
{

RodModel::RodModel(const Rod& rod) : rod_(&rod), mass_(rod) {}

void RodModel::follow(const RodChange& change)
{
    mass_.find();
    for (const std::unique_ptr<RodTerm>& term : terms)
        term->follow(change);
    held_.clear();
    pushed.resize(0);
    ++revision_;
}

/// out += scale * (weight and forces of the loads)
void RodModel::add_constant_force(double scale, Eigen::VectorXd& out) const
{
    const RodLayout& layout = rod_->layout();
    if (!gravity.isZero(0.0))
        for (int k = 0; k < rod_->num_controls(); ++k)
            out.segment<3>(layout.control[idx(k)]) +=
                scale * mass_.weights()[k] * gravity;
    for (const RodLoad& load : loads)
    {
        const BasisValues values = rod_->basis().values(load.s);
        for (int j = 0; j < values.count; ++j)
            out.segment<3>(layout.control[idx(values.control[idx(j)])]) +=
                scale * values.value[0][idx(j)] * load.force;
    }
}

bool RodModel::is_free() const
{
    return gaps.empty() &&
           std::all_of(constraints.begin(), constraints.end(),
                       [](const RodConstraint& one) { return one.is_off; });
}

bool RodModel::has_couples() const
{
    return std::any_of(loads.begin(), loads.end(),
                       [](const RodLoad& load) { return !load.moment.isZero(0.0); });
}

double RodModel::elastic_energy(const RodState& state) const
{
    double sum = 0.0;
    for (const std::unique_ptr<RodTerm>& term : terms)
        sum += term->value(state);
    return sum;
}

double RodModel::gravity_energy(const RodState& state) const
{
    double sum = 0.0;
    for (int k = 0; k < rod_->num_controls(); ++k)
        sum -= mass_.weights()[k] * gravity.dot(state.control(k));
    return sum;
}

double RodModel::potential(const RodState& state) const
{
    return potential(state, elastic_energy(state));
}

double RodModel::step_potential(const RodState& state) const
{
    double sum = 0.0;
    for (const std::unique_ptr<RodTerm>& term : terms)
        sum += term->step_value(state);
    return potential(state, sum);
}

void RodModel::damp(const RodState& begin, double gain)
{
    for (const std::unique_ptr<RodTerm>& term : terms)
        term->damp(begin, gain);
}

void RodModel::add_damping_forces(const RodState& state, const Eigen::VectorXd& velocity,
                                  Eigen::VectorXd& out) const
{
    if (damping > 0.0)
        for (const std::unique_ptr<RodTerm>& term : terms)
            term->add_damping_forces(state, velocity, damping, out);
}

double RodModel::potential(const RodState& state, double elastic) const
{
    double sum = elastic;
    if (!gravity.isZero(0.0))
        sum += gravity_energy(state);
    for (const RodLoad& load : loads)
        sum -= load.force.dot(state.at(load.s).place);
    return sum;
}

void RodModel::gradient(const RodState& state, Eigen::VectorXd& out) const
{
    out.setZero(rod_->layout().num_unknowns);
    add_constant_force(-1.0, out);
    for (const std::unique_ptr<RodTerm>& term : terms)
        term->add_gradient(state, out);
    if (has_couples())
        out -= couples(state);
    if (pushed.size() > 0)
        out -= pushed;
}

Eigen::VectorXd RodModel::couples(const RodState& state) const
{
    Eigen::VectorXd out = Eigen::VectorXd::Zero(state.x().size());
    for (const RodLoad& load : loads)
    {
        if (load.moment.isZero(0.0))
            continue;
        const BasisValues values = rod_->basis().values(load.s);
        const Eigen::Vector3d u = state.at(values).first;
        const double l = u.norm();
        const Eigen::Vector3d pull = load.moment.cross(u) / (l * l);
        for (int j = 0; j < values.count; ++j)
            out.segment<3>(rod_->layout().control[idx(values.control[idx(j)])]) +=
                values.value[1][idx(j)] * pull;
        for (const auto& [unknown, value] : spin_at(state, load.s))
            out[unknown] += value * load.moment.dot(u) / l;
    }
    return out;
}

void RodModel::hessian(const RodState& state, RodHessian how, BandMatrix& out) const
{
    const RodLayout& layout = rod_->layout();
    if (out.rows() != layout.num_unknowns || out.half_band() != layout.half_band)
        out = BandMatrix(layout.num_unknowns, layout.half_band);
    else
        out.set_zero();
    for (const std::unique_ptr<RodTerm>& term : terms)
        term->add_hessian(state, how, out);
    if (how == RodHessian::Definite)
        return;
    for (const RodLoad& load : loads)
    {
        if (load.moment.isZero(0.0))
            continue;
        // -d/du [(c x u) / l^2], the symmetric part: c x (the rest is antisymmetric).
        const BasisValues values = rod_->basis().values(load.s);
        const Eigen::Vector3d u = state.at(values).first;
        const double l2 = u.squaredNorm();
        const Eigen::Vector3d across = load.moment.cross(u);
        const Eigen::Matrix3d B =
            (across * u.transpose() + u * across.transpose()) / (l2 * l2);
        for (int i = 0; i < values.count; ++i)
            for (int j = 0; j < values.count; ++j)
            {
                const int row = layout.control[idx(values.control[idx(i)])],
                          column = layout.control[idx(values.control[idx(j)])];
                const double share = values.value[1][idx(i)] * values.value[1][idx(j)];
                for (int a = 0; a < 3; ++a)
                    for (int b = 0; b < 3; ++b)
                        if (row + a >= column + b)
                            out.lower(row + a, column + b) += share * B(a, b);
            }
    }
}

void RodModel::add_drag_forces(const Eigen::VectorXd& velocity,
                               Eigen::VectorXd& out) const
{
    for (const RodDrag& drag : drags)
    {
        const BasisValues values = rod_->basis().values(drag.s);
        const auto unknown = [&](int j)
        { return rod_->layout().control[idx(values.control[idx(j)])]; };
        Eigen::Vector3d v = Eigen::Vector3d::Zero();
        for (int j = 0; j < values.count; ++j)
            v += values.value[0][idx(j)] * velocity.segment<3>(unknown(j));
        for (int j = 0; j < values.count; ++j)
            out.segment<3>(unknown(j)) += drag.damping * values.value[0][idx(j)] * v;
    }
}

void RodModel::add_drags(double scale, BandMatrix& out) const
{
    for (const RodDrag& drag : drags)
    {
        const BasisValues values = rod_->basis().values(drag.s);
        const auto unknown = [&](int j)
        { return rod_->layout().control[idx(values.control[idx(j)])]; };
        for (int i = 0; i < values.count; ++i)
            for (int j = 0; j < values.count; ++j)
                for (int c = 0; unknown(i) >= unknown(j) && c < 3; ++c)
                    out.lower(unknown(i) + c, unknown(j) + c) += scale * drag.damping *
                                                                 values.value[0][idx(i)] *
                                                                 values.value[0][idx(j)];
    }
}

void RodModel::lead(std::function<void(double share)> hold, double duration,
                    std::function<void(double share)> set_loads)
{
    set_loads_ = std::move(set_loads);
    hold_ = std::move(hold);
    duration_ = duration;
    lead_to(0.0);
}

void RodModel::stop_leading()
{
    hold_ = nullptr;
    set_loads_ = nullptr;
    duration_ = time_led_ = 0.0;
    for (RodConstraint& constraint : constraints)
    {
        constraint.point_speed.setZero();
        constraint.turning.setZero();
        constraint.spin_speed = 0.0;
    }
}

void RodModel::carry(const RodState& state)
{
    for (RodConstraint& constraint : constraints)
        cellwarp::core::carry(constraint, state);
}

void RodModel::lead_to(double time)
{
    if (!hold_)
        return;
    time_led_ = time;
    hold_(std::min(time / duration_, 1.0));
    load_as_at(time);
}

void RodModel::load_as_at(double time)
{
    if (set_loads_)
        set_loads_(std::min(time / duration_, 1.0));
}

bool RodModel::is_led() const
{
    constexpr double kOver = 1.0 - 1e-9; // of the duration
    return hold_ && time_led_ < kOver * duration_ &&
           std::any_of(constraints.begin(), constraints.end(),
                       [](const RodConstraint& one)
                       {
                           return !one.is_off &&
                                  (!one.point_speed.isZero(0.0) ||
                                   !one.turning.isZero(0.0) || one.spin_speed != 0.0);
                       });
}

/// Constraints may be changed from outside at any time.
const HeldBasis& RodModel::held(std::size_t k) const
{
    const RodConstraint& now = constraints[k];
    while (held_.size() <= k)
        held_.emplace_back(constraints[held_.size()], rod_->basis());
    if (held_[k].s != now.s || held_[k].control != now.control)
        held_[k] = HeldBasis(now, rod_->basis());
    return held_[k];
}

std::vector<ConstraintRow> RodModel::rows_of_constraint(std::size_t k,
                                                        const RodState& state,
                                                        bool with_entries) const
{
    const RodConstraint& now = constraints[k];
    if (now.slide < 0)
        return rows_of(now, state, held(k), with_entries);
    const HeldBasis basis(sliding_values(rod_->basis(), state.sliding[idx(now.slide)].s));
    return rows_of(now, state, basis, with_entries);
}

RodModel::Rows RodModel::rows(const RodState& state) const
{
    Rows out;
    std::vector<double> violations, rates;
    for (std::size_t k = 0; k < constraints.size(); ++k)
    {
        std::vector<ConstraintRow> rows = rows_of_constraint(k, state, true);
        out.groups.push_back(static_cast<int>(rows.size()));
        for (ConstraintRow& row : rows)
        {
            out.rows.push_back(std::move(row.entries));
            violations.push_back(row.violation);
            rates.push_back(row.rate);
        }
    }
    for (std::size_t k = 0; k < gaps.size(); ++k)
    {
        const auto both = ends(state, gaps[k]);
        if (!state.touches[k] || !both)
            continue;
        SparseRow row;
        for (const int slide : {both->first, both->second})
            if (const Sliding& now = state.sliding[idx(slide)]; now.is_free())
            {
                const double speed = rod_->rest()
                                         .combined(sliding_values(rod_->basis(), now.s))
                                         .first.norm();
                row.emplace_back(rod_->layout().num_unknowns + slide,
                                 slide == both->first ? -speed : speed);
            }
        std::sort(row.begin(), row.end());
        out.rows.push_back(std::move(row));
        out.groups.push_back(1);
        violations.push_back(room(state, gaps[k]));
        rates.push_back(0.0);
    }
    out.violation = Eigen::Map<const Eigen::VectorXd>(
        violations.data(), static_cast<Eigen::Index>(violations.size()));
    out.rate = Eigen::Map<const Eigen::VectorXd>(rates.data(),
                                                 static_cast<Eigen::Index>(rates.size()));
    return out;
}

Eigen::VectorXd RodModel::violations(const RodState& state) const
{
    int count = 0;
    for (std::size_t k = 0; k < gaps.size(); ++k)
        count += state.touches[k] && ends(state, gaps[k]);
    for (const RodConstraint& constraint : constraints)
        count += num_rows(constraint, state);
    Eigen::VectorXd out(count);
    Eigen::Index next = 0;
    for (std::size_t k = 0; k < constraints.size(); ++k)
        for (const ConstraintRow& row : rows_of_constraint(k, state, false))
            out[next++] = row.violation;
    for (std::size_t k = 0; k < gaps.size(); ++k)
        if (state.touches[k] && ends(state, gaps[k]))
            out[next++] = room(state, gaps[k]);
    return out;
}

std::optional<std::pair<int, int>> RodModel::ends(const RodState& state,
                                                  const RodGap& gap) const
{
    const auto is_gone = [&](int slide)
    { return state.sliding[idx(slide)].mode == Sliding::Mode::Gone; };
    if (is_gone(gap.first))
        return std::nullopt;
    int second = gap.second;
    for (std::size_t tries = 0; is_gone(second) && tries < gaps.size(); ++tries)
    {
        const auto next =
            std::find_if(gaps.begin(), gaps.end(),
                         [&](const RodGap& other) { return other.first == second; });
        if (next == gaps.end())
            return std::nullopt;
        second = next->second;
    }
    if (is_gone(second) || second == gap.first)
        return std::nullopt;
    return std::pair(gap.first, second);
}

double RodModel::room(const RodState& state, const RodGap& gap) const
{
    const auto both = ends(state, gap);
    if (!both)
        return std::numeric_limits<double>::infinity();
    const ArcLength& length = rod_->arc_length();
    const SplineBasis& basis = rod_->basis();
    const auto along = [&](int slide)
    {
        const double s = state.sliding[idx(slide)].s;
        const double period = basis.end() - basis.begin();
        const double turns =
            basis.is_closed() ? std::floor((s - basis.begin()) / period) : 0.0;
        return turns * length.total() + length.at(basis.wrapped(s));
    };
    // The seam of a closed rod may be passed by the one that has taken a place, too.
    const bool is_around =
        gap.is_around || (both->second != gap.second && both->second < both->first);
    return along(both->second) - along(both->first) - gap.least +
           (is_around ? length.total() : 0.0);
}

double RodModel::sliding_energy(const RodState& state) const
{
    double sum = 0.0;
    for (const Sliding& sliding : state.sliding)
        sum += cellwarp::core::sliding_energy(sliding);
    return sum;
}

std::vector<SlidePress> RodModel::pressed(const RodState& state,
                                          const Eigen::VectorXd& multipliers) const
{
    std::vector<SlidePress> out(slides.size());
    for (const RodConstraint& constraint : constraints)
        if (constraint.slide >= 0)
            out[idx(constraint.slide)].held.setZero();
    Eigen::Index next = 0;
    for (const RodConstraint& constraint : constraints)
    {
        const int count = num_rows(constraint, state);
        if (constraint.slide >= 0 && count > 0)
        {
            const std::vector<Eigen::Vector3d> n = held_directions(constraint);
            SlidePress& press = out[idx(constraint.slide)];
            for (int k = 0; k < count; ++k)
            {
                press.force += multipliers[next + k] * n[idx(k)];
                press.held += n[idx(k)] * n[idx(k)].transpose();
            }
        }
        next += count;
    }
    return out;
}

/// The work of a row under a rigid motion: a force on a control point acts there, one on
/// an angle is a couple about the tangent of its station.
std::vector<Wrench> RodModel::reactions(const RodState& state,
                                        const Eigen::VectorXd& multipliers) const
{
    const RodLayout& layout = rod_->layout();
    std::vector<int> control(idx(layout.num_unknowns), -1);
    std::vector<Eigen::Vector3d> axis(idx(layout.num_unknowns), Eigen::Vector3d::Zero());
    for (std::size_t k = 0; k < layout.control.size(); ++k)
        std::fill_n(control.begin() + layout.control[k], 3, static_cast<int>(k));
    const int last = rod_->num_places() - 1;
    for (std::size_t e = 0; e < rod_->spans().size(); ++e)
        for (const int end : {0, 1})
            axis[idx(layout.angle[idx(rod_->spans()[e].station[idx(end)])])] =
                state.velocity(e, end == 0 ? 0 : last).tangent;
    std::vector<Wrench> out(constraints.size());
    Eigen::Index next = 0;
    for (std::size_t k = 0; k < constraints.size(); ++k)
    {
        const std::vector<ConstraintRow> rows = rows_of_constraint(k, state, true);
        if (next + static_cast<Eigen::Index>(rows.size()) > multipliers.size())
            break;
        const RodConstraint& of = constraints[k];
        const Eigen::Vector3d at =
            state
                .at(of.slide < 0
                        ? held(k).at
                        : sliding_values(rod_->basis(), state.sliding[idx(of.slide)].s))
                .place;
        for (const ConstraintRow& row : rows)
        {
            const double lambda = multipliers[next++];
            for (const auto& [unknown, value] : row.entries)
            {
                if (unknown >= layout.num_unknowns)
                    continue; // of what slides
                const int q = control[idx(unknown)];
                if (q < 0)
                {
                    out[k].couple += lambda * value * axis[idx(unknown)];
                    continue;
                }
                Eigen::Vector3d force = Eigen::Vector3d::Zero();
                force[unknown - layout.control[idx(q)]] = lambda * value;
                out[k].force += force;
                out[k].couple += (state.control(q) - at).cross(force);
            }
        }
    }
    return out;
}

void add_forces(const std::vector<SparseRow>& rows, const Eigen::VectorXd& lambda,
                double scale, Eigen::VectorXd& out)
{
    for (std::size_t r = 0; r < rows.size(); ++r)
        for (const auto& [unknown, value] : rows[r])
            out[unknown] += scale * lambda[static_cast<Eigen::Index>(r)] * value;
}

} // namespace cellwarp::core
