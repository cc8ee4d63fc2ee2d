// SPDX-License-Identifier: GPL-3.0-or-later
// A carried cell i with rest centre c, at the parameter s of a rod whose frame there is F
// (F0 at rest) and whose place P (P0), has the pose [theory-rods (36)]
//   R_i = F F0^T,   p_i = P + R_i (c - P0),
// then the motion of the rod as a whole. As the rod moves, u = P', t = u / |u|,
//   omega = (t x du) / |u| + t dphi,   v = dP + omega x (p_i - P),
// with the spin dphi of the material at s: twists are linear in the steps dx of control
// points and angles, and so a gradient g by the twist of a cell is one J^T g by them
// (37).
//
// Unknowns. A control point steps in the axes that the frame near it has turned to, as a
// cell steps in its own axes: what was prepared at rest stays a good preconditioner where
// the rod bends.
//
// A step is followed by the one that takes back what it stretches to second order: the
// shorter the spans of a slender rod, the shorter steps would have to be without.
//
// Second derivatives by them are taken as J^T H J, without what the curvature of the
// poses adds: with it Newton's method takes more steps from far, and as many near a
// minimum.
//
// Holds. Places and directions that are held, and the angle where a tangent is held with
// it, are linear in these steps: C dx = 0. Of m independent rows m unknowns are taken,
// those by which the rows change most (elimination with full pivoting), and follow the
// others. Which ones is chosen anew only when other things are held, because the
// preconditioner depends on it.
#include "solver/coupled/rod_unknowns.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/QR>

#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Triplet = Eigen::Triplet<double>;

bool hold_the_same(std::span<const RodConstraint> a, std::span<const RodConstraint> b)
{
    return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                      [](const RodConstraint& one, const RodConstraint& other) {
                          return one.hold == other.hold && one.s == other.s &&
                                 one.control == other.control;
                      });
}

/// Whether so large a step may have passed over a loop, or over a whole turn.
bool is_far(const RodState& from, const RodState& to)
{
    constexpr double kLeastCosine = 0.5; // of the turn of a tangent
    constexpr double kMostStretch = 2.0; // of a length, or its inverse
    constexpr double kMostTwist = 1.5;   // of a span, more than before [rad]
    for (std::size_t e = 0; e < from.rod().spans().size(); ++e)
    {
        if (std::abs(to.twist(e) - from.twist(e)) > kMostTwist)
            return true;
        for (int place = 0; place < from.rod().num_places(); ++place)
        {
            const RodState::Velocity &a = from.velocity(e, place),
                                     &b = to.velocity(e, place);
            if (a.tangent.dot(b.tangent) < kLeastCosine ||
                b.length > kMostStretch * a.length || a.length > kMostStretch * b.length)
                return true;
        }
    }
    return false;
}

} // namespace

RodUnknowns::RodUnknowns(CellState& cells, std::vector<CoupledRod> rods)
    : State(cells.end()), cells_(cells), rods_(std::move(rods)), motions_(rods_.size())
{
    first_.push_back(0);
    for (const CoupledRod& rod : rods_)
    {
        sizes_.push_back(rod.rest->rod().layout().num_unknowns);
        first_.push_back(first_.back() + sizes_.back());
        num_carried_ += static_cast<int>(rod.cells.size());
        parameters_.push_back(parameters_of_controls(rod.rest->rod().basis()));
        now_.push_back(*rod.rest);
        lengths_.emplace_back(rod.rest->rod());
    }
    base_ = now_;
    holds_.resize(rods_.size());
    chosen_rows_.resize(rods_.size());
    taken_.resize(rods_.size());
    leads_.assign(rods_.size(), 0);
    is_taken_.assign(idx(num_unknowns()), 0);
}

void RodUnknowns::set(std::size_t rod, const RodState& state, const Motion& motion,
                      std::span<const RodConstraint> holds)
{
    const bool is_same = hold_the_same(holds_[rod], holds);
    now_[rod] = base_[rod] = state;
    has_steps_ = has_twists_ = false;
    lengths_[rod].forget();
    motions_[rod] = motion;
    holds_[rod].assign(holds.begin(), holds.end());
    if (!is_same)
        choose_taken(rod);
}

void RodUnknowns::lead(std::size_t rod, bool it_leads)
{
    if (leads(rod) == it_leads)
        return;
    leads_[rod] = it_leads;
    mark_taken(rod);
    has_steps_ = false;
}

void RodUnknowns::mark_taken(std::size_t rod)
{
    has_other_bodies_ = true;
    std::fill_n(is_taken_.begin() + first_[rod], sizes_[rod], leads(rod));
    for (const int unknown : taken_[rod])
        is_taken_[idx(first_[rod] + unknown)] = 1;
}

Eigen::VectorXd RodUnknowns::multipliers(std::size_t rod,
                                         const Eigen::VectorXd& gradient) const
{
    const HoldRows own = hold_rows(now_[rod], holds_[rod]);
    if (own.violation.size() == 0)
        return own.violation;
    return own.by_steps.transpose().completeOrthogonalDecomposition().solve(gradient);
}

void RodUnknowns::choose_taken(std::size_t rod)
{
    constexpr double kFollows = 1e-9; // of the largest pivot: a row follows from others
    taken_[rod].clear();
    chosen_rows_[rod].clear();
    Eigen::MatrixXd C = rows_by_unknowns(rod, axes(rod));
    if (C.rows() == 0)
        return mark_taken(rod);
    for (Eigen::Index r = 0; r < C.rows(); ++r)
        C.row(r).normalize();
    Eigen::FullPivLU<Eigen::MatrixXd> lu(C);
    lu.setThreshold(kFollows);
    for (Eigen::Index k = 0; k < lu.rank(); ++k)
        taken_[rod].push_back(static_cast<int>(lu.permutationQ().indices()[k]));
    // P C Q = L U: row r of C has come to the place indices()[r].
    std::vector<int> row_at(idx(static_cast<int>(C.rows())));
    for (Eigen::Index r = 0; r < C.rows(); ++r)
        row_at[idx(lu.permutationP().indices()[r])] = static_cast<int>(r);
    chosen_rows_[rod].assign(row_at.begin(), row_at.begin() + lu.rank());
    mark_taken(rod);
}

/// Axes of the steps of each control point, at the base.
std::vector<Matrix3d> RodUnknowns::axes(std::size_t rod) const
{
    std::vector<Matrix3d> axes;
    for (const double s : parameters_[rod])
        axes.push_back(carried_by(base_[rod], *rods_[rod].rest, s).R);
    return axes;
}

/// Of what holds it, at the base.
Eigen::MatrixXd RodUnknowns::rows_by_unknowns(std::size_t rod,
                                              const std::vector<Matrix3d>& axes) const
{
    Eigen::MatrixXd rows = hold_rows(base_[rod], holds_[rod]).by_steps;
    const RodLayout& layout = base_[rod].rod().layout();
    for (std::size_t k = 0; k < axes.size(); ++k)
        rows.middleCols<3>(layout.control[k]) *= axes[k];
    return rows;
}

const Eigen::SparseMatrix<double>& RodUnknowns::steps() const
{
    if (has_steps_)
        return steps_;
    std::vector<Triplet> entries;
    for (std::size_t rod = 0; rod < size(); ++rod)
    {
        if (leads(rod))
            continue;
        const RodLayout& layout = base_[rod].rod().layout();
        const std::vector<Matrix3d> axes = this->axes(rod);
        std::vector<int> point_of(idx(sizes_[rod]), -1);
        for (std::size_t k = 0; k < axes.size(); ++k)
            std::fill_n(point_of.begin() + layout.control[k], 3, static_cast<int>(k));
        // The step of the unknown \p column where an unknown is \p by.
        const auto add = [&](int unknown, int column, double by)
        {
            const int k = point_of[idx(unknown)], first = first_[rod];
            if (k < 0)
                entries.emplace_back(first + unknown, first + column, by);
            for (int c = 0; k >= 0 && c < 3; ++c)
                entries.emplace_back(
                    first + layout.control[idx(k)] + c, first + column,
                    by * axes[idx(k)](c, unknown - layout.control[idx(k)]));
        };
        const std::vector<int>& taken = taken_[rod];
        Eigen::MatrixXd by_others;
        if (!taken.empty())
        {
            const Eigen::MatrixXd chosen =
                rows_by_unknowns(rod, axes)(chosen_rows_[rod], Eigen::all);
            by_others = -chosen(Eigen::all, taken).partialPivLu().solve(chosen);
        }
        constexpr double kNone = 1e-14;
        for (int column = 0; column < sizes_[rod]; ++column)
        {
            if (is_taken(first_[rod] + column))
                continue;
            add(column, column, 1.0);
            for (Eigen::Index r = 0; r < by_others.rows(); ++r)
                if (std::abs(by_others(r, column)) > kNone)
                    add(taken[static_cast<std::size_t>(r)], column, by_others(r, column));
        }
    }
    steps_.resize(num_unknowns(), num_unknowns());
    steps_.setFromTriplets(entries.begin(), entries.end());
    has_steps_ = true;
    return steps_;
}

const std::vector<CarriedTwist>& RodUnknowns::twists() const
{
    if (has_twists_)
        return twists_;
    twists_.resize(idx(num_carried_));
    std::size_t next = 0;
    for (std::size_t rod = 0; rod < size(); ++rod)
        for (const CarriedCell& cell : rods_[rod].cells)
            find_twist(rod, cell, twists_[next++]);
    has_twists_ = true;
    return twists_;
}

void RodUnknowns::find_twist(std::size_t rod, const CarriedCell& cell,
                             CarriedTwist& out) const
{
    const RodState& state = now_[rod];
    const RodLayout& layout = state.rod().layout();
    const Matrix3d& R = motions_[rod].R;
    const BasisValues values = state.rod().basis().values(cell.s);
    const CurvePoint at = state.at(values);
    const double l = at.first.norm();
    const Vector3d t = at.first / l;
    const Vector3d arm =
        carried_by(state, *rods_[rod].rest, cell.s)(cell.centre) - at.place;
    out.steps.clear();
    out.by_steps.setZero(6, CarriedTwist::kMost);
    const auto add = [&](int unknown, const Vector3d& omega, const Vector3d& v)
    {
        const int step = first_[rod] + unknown;
        auto found = std::find(out.steps.begin(), out.steps.end(), step);
        if (found == out.steps.end())
            found = out.steps.insert(found, step);
        auto column = out.by_steps.col(found - out.steps.begin());
        column.head<3>() += R * omega;
        column.tail<3>() += R * (v + omega.cross(arm));
    };
    for (int k = 0; k < values.count; ++k)
        for (int axis = 0; axis < 3; ++axis)
            add(layout.control[idx(values.control[idx(k)])] + axis,
                values.value[1][idx(k)] / l * t.cross(Vector3d::Unit(axis)),
                values.value[0][idx(k)] * Vector3d::Unit(axis));
    for (const auto& [unknown, value] : spin_at(state, cell.s))
        add(unknown, value * t, Vector3d::Zero());
    out.by_steps.conservativeResize(6, static_cast<Eigen::Index>(out.steps.size()));
}

void RodUnknowns::add_bodies(std::span<const GridPlace> places,
                             std::vector<UnknownBody>& out) const
{
    has_other_bodies_ = false;
    for (std::size_t rod = 0; rod < size(); ++rod)
    {
        const RodState& state = now_[rod];
        const RodLayout& layout = state.rod().layout();
        const auto add = [&](int unknown, double s) -> UnknownBody&
        {
            UnknownBody& body = out.emplace_back();
            body.block = begin().block + static_cast<int>(rod);
            body.first = unknown;
            body.is_on_rod = true;
            const CarriedCell* nearest = nullptr;
            for (const CarriedCell& cell : rods_[rod].cells)
                if (!nearest || std::abs(cell.s - s) < std::abs(nearest->s - s))
                    nearest = &cell;
            body.grid = places[idx(nearest->cell)];
            return body;
        };
        const std::size_t first_body = out.size();
        for (std::size_t k = 0; k < layout.control.size(); ++k)
        {
            const double s = parameters_[rod][k];
            UnknownBody& body = add(layout.control[k], s);
            body.shifts = 3;
            body.centre = motions_[rod](state.control(static_cast<int>(k)));
            const Matrix3d axes =
                motions_[rod].R * carried_by(state, *rods_[rod].rest, s).R;
            for (int axis = 0; axis < 3; ++axis)
                if (!is_taken(first_[rod] + layout.control[k] + axis))
                    body.shift.col(axis) = axes.col(axis);
        }
        const std::span<const RodSpan> spans = state.rod().spans();
        std::vector<double> at(layout.angle.size());
        for (const RodSpan& span : spans)
        {
            at[idx(span.station[1])] = span.end;
            at[idx(span.station[0])] = span.begin;
        }
        for (std::size_t e = 0; e < layout.angle.size(); ++e)
        {
            UnknownBody& body = add(layout.angle[e], at[e]);
            body.turns = 1;
            const CurvePoint point = state.at(at[e]);
            body.centre = motions_[rod](point.place);
            if (!is_taken(first_[rod] + layout.angle[e]))
                body.turn.col(0) = motions_[rod].R * point.first.normalized();
        }
        std::sort(out.begin() + static_cast<std::ptrdiff_t>(first_body), out.end(),
                  [](const UnknownBody& a, const UnknownBody& b)
                  { return a.first < b.first; });
    }
}

void RodUnknowns::move(const Eigen::VectorXd& step, double length)
{
    moved_.noalias() = steps() * step.segment(begin().unknown, num_unknowns());
    is_too_far_ = has_twists_ = false;
    for (std::size_t rod = 0; rod < size(); ++rod)
    {
        now_[rod] = base_[rod];
        part_ = length * moved_.segment(first_[rod], sizes_[rod]);
        now_[rod].move(part_);
        if (!leads(rod) && !part_.isZero(0.0))
            lengths_[rod].correct(base_[rod], holds_[rod], part_, now_[rod]);
        is_too_far_ |= is_far(base_[rod], now_[rod]);
        for (const CarriedCell& cell : rods_[rod].cells)
            cells_.place(
                cell.cell,
                carried(motions_[rod] * carried_by(now_[rod], *rods_[rod].rest, cell.s),
                        cell.centre));
    }
}

void RodUnknowns::settle()
{
    base_ = now_;
    has_steps_ = false;
    for (LengthCorrection& length : lengths_)
        length.forget();
}

/// The cells that the rods carry are bodies of the cells' state.
double RodUnknowns::largest_move() const
{
    double largest = 0.0;
    for (std::size_t r = 0; r < now_.size(); ++r)
        for (int k = 0; k < now_[r].rod().basis().num_controls(); ++k)
            largest =
                std::max(largest, (now_[r].control(k) - base_[r].control(k)).norm());
    return largest;
}

} // namespace cellwarp::core
