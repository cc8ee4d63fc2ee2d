// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/rods/spline.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <utility>

#include <Eigen/SparseCholesky>
#include <Eigen/SparseLU>

#include "octree/base/index.h"
#include "solver/rods/gauss.h"

namespace cellwarp
{

namespace
{

constexpr int kLengthPlaces = 5; ///< a span

/// Length of the part of a span from its begin to \p s.
double length_in(const Spline& spline, int span, double s)
{
    const double begin = spline.basis.spans()[idx(span)].begin;
    double sum = 0.0;
    for (std::size_t k = 0; k < kLengthPlaces; ++k)
        sum += gauss_weights(kLengthPlaces)[k] *
               spline.at(span, begin + gauss_places(kLengthPlaces)[k] * (s - begin))
                   .first.norm();
    return sum * (s - begin);
}

using Triplets = std::vector<Eigen::Triplet<double>>;

void add_row(const BasisValues& values, int order, int row, Triplets& out)
{
    for (int j = 0; j < values.count; ++j)
        out.emplace_back(row, values.control[idx(j)], values.value[idx(order)][idx(j)]);
}

/// Control points with sum A_ik q_k = x_i.
std::vector<Eigen::Vector3d> solved(int n, const Triplets& entries,
                                    const Eigen::MatrixX3d& right)
{
    Eigen::SparseMatrix<double> A(n, n);
    A.setFromTriplets(entries.begin(), entries.end());
    Eigen::SparseLU<Eigen::SparseMatrix<double>> factor(A);
    if (factor.info() != Eigen::Success)
        throw std::invalid_argument("no curve goes through these points");
    const Eigen::MatrixX3d q = factor.solve(right);
    std::vector<Eigen::Vector3d> controls;
    for (int k = 0; k < n; ++k)
        controls.push_back(q.row(k).transpose());
    return controls;
}

} // namespace

CurvePoint Spline::combined(const BasisValues& values) const
{
    std::array<Eigen::Vector3d, 3> sums;
    sums.fill(Eigen::Vector3d::Zero());
    for (int j = 0; j < values.count; ++j)
        for (std::size_t order = 0; order < 3; ++order)
            sums[order] +=
                values.value[order][idx(j)] * controls[idx(values.control[idx(j)])];
    return {sums[0], sums[1], sums[2]};
}

Spline spline_through(std::span<const Eigen::Vector3d> points, bool is_closed, int spans,
                      int degree, std::vector<double>* parameters)
{
    const int n = static_cast<int>(points.size());
    if (n < 2 || (is_closed && n < degree + 1) || spans < 1)
        throw std::invalid_argument("too few points for a curve");
    std::vector<double> s = {0.0};
    for (int i = 1; i < n + is_closed; ++i)
    {
        const double gap = (points[idx(i % n)] - points[idx(i - 1)]).norm();
        if (!(gap > 0.0))
            throw std::invalid_argument("two points of a curve at the same place");
        s.push_back(s.back() + gap);
    }
    // As many control points as points, one row each.
    const auto by_points = [&](SplineBasis basis) -> Spline
    {
        Triplets entries;
        Eigen::MatrixX3d right(n, 3);
        for (int i = 0; i < n; ++i)
        {
            add_row(basis.values(s[idx(i)]), 0, i, entries);
            right.row(i) = points[idx(i)].transpose();
        }
        return {basis, solved(n, entries, right)};
    };
    const auto closed = [&]
    {
        // Of even degree the knots stand between the points: at them there is no curve
        // through an even number of points.
        std::vector<double> turn = s;
        for (std::size_t i = 0; degree % 2 == 0 && i < s.size(); ++i)
            turn[i] = 0.5 * (s[i] + (i > 0 ? s[i - 1] : s[s.size() - 2] - s.back()));
        return by_points(SplineBasis::closed(degree, turn));
    };
    const auto natural = [&]() -> Spline
    {
        Triplets entries;
        std::vector<double> knots(3, s.front());
        knots.insert(knots.end(), s.begin(), s.end());
        knots.insert(knots.end(), 3, s.back());
        SplineBasis basis = SplineBasis::open(3, std::move(knots));
        Eigen::MatrixX3d right = Eigen::MatrixX3d::Zero(n + 2, 3);
        add_row(basis.values_in(0, s.front()), 0, 0, entries);
        add_row(basis.values_in(0, s.front()), 2, 1, entries);
        right.row(0) = points.front().transpose();
        for (int i = 1; i + 1 < n; ++i)
        {
            add_row(basis.values_in(i, s[idx(i)]), 0, i + 1, entries);
            right.row(i + 1) = points[idx(i)].transpose();
        }
        add_row(basis.values_in(n - 2, s.back()), 2, n, entries);
        add_row(basis.values_in(n - 2, s.back()), 0, n + 1, entries);
        right.row(n + 1) = points.back().transpose();
        return {basis, solved(n + 2, entries, right)};
    };
    if (!is_closed && degree != 3 && n < degree + 1)
        throw std::invalid_argument("too few points for a curve of this degree");
    const Spline coarse =
        is_closed     ? closed()
        : degree == 3 ? natural()
                      : by_points(SplineBasis::open(degree, averaged_knots(s, degree)));
    if (parameters)
        *parameters = s;
    return refined(coarse, spans);
}

std::vector<double> averaged_knots(std::span<const double> parameters, int degree)
{
    std::vector<double> knots(idx(degree + 1), parameters.front());
    for (std::size_t j = 1; j + idx(degree) < parameters.size(); ++j)
    {
        double sum = 0.0;
        for (const double s : parameters.subspan(j, idx(degree)))
            sum += s;
        knots.push_back(sum / degree);
    }
    knots.insert(knots.end(), idx(degree + 1), parameters.back());
    return knots;
}

ArcLength::ArcLength(const Spline& spline) : spline_(spline)
{
    ends_.push_back(0.0);
    const std::vector<SplineSpan>& spans = spline.basis.spans();
    for (std::size_t e = 0; e < spans.size(); ++e)
        ends_.push_back(ends_.back() +
                        length_in(spline, static_cast<int>(e), spans[e].end));
}

double ArcLength::at(double s) const
{
    const double wrapped = spline_.basis.wrapped(s);
    const int span = spline_.basis.span_of(wrapped);
    return ends_[idx(span)] + length_in(spline_, span, wrapped);
}

double ArcLength::parameter(double share) const
{
    const double wanted = std::clamp(share, 0.0, 1.0) * total();
    const auto next = std::upper_bound(ends_.begin() + 1, ends_.end() - 1, wanted);
    const int span = static_cast<int>(next - ends_.begin()) - 1;
    const SplineSpan& within = spline_.basis.spans()[idx(span)];
    double low = within.begin, high = within.end;
    const double length = ends_[idx(span) + 1] - ends_[idx(span)];
    double s =
        length > 0.0 ? low + (wanted - ends_[idx(span)]) / length * (high - low) : low;
    for (int iteration = 0; iteration < 60; ++iteration)
    {
        const double error = ends_[idx(span)] + length_in(spline_, span, s) - wanted;
        (error > 0.0 ? high : low) = s;
        const double speed = spline_.at(span, s).first.norm();
        double next_s = speed > 0.0 ? s - error / speed : 0.5 * (low + high);
        if (!(next_s >= low && next_s <= high))
            next_s = 0.5 * (low + high);
        if (std::abs(next_s - s) <= 4e-16 * std::max(std::abs(s), within.length()))
            return next_s;
        s = next_s;
    }
    return s;
}

// With a knot s in [U_k, U_k+1), new control point i is [Boehm]
//   a_i q_i + (1 - a_i) q_{i-1},   a_i = 1 up to k - d, 0 beyond k,
//   else (s - U_i) / (U_{i+d} - U_i).
// Around a closed curve the knot comes again after each turn: the n + 1 new ones from
// k - d + 1 on see it once.
Spline with_knot(const Spline& spline, double s, KnotChange* change)
{
    const SplineBasis& basis = spline.basis;
    if (basis.is_catmull_rom())
        throw std::invalid_argument("Catmull-Rom curves have no knots");
    const int d = basis.degree(), n = basis.num_controls();
    const double at = basis.wrapped(s);
    const std::vector<double>& U = basis.knots();
    const int k = static_cast<int>(std::upper_bound(U.begin() + d, U.end() - d - 1, at) -
                                   U.begin()) -
                  1;
    const int first = basis.is_closed() ? k - d + 1 : 0;
    std::vector<Eigen::Vector3d> controls(idx(n + 1));
    KnotChange made;
    made.rows.resize(idx(n + 1));
    for (int i = first; i <= first + n; ++i)
    {
        const double a = i <= k - d ? 1.0
                         : i > k    ? 0.0
                                    : (at - U[idx(i)]) / (U[idx(i + d)] - U[idx(i)]);
        KnotChange::Row row;
        row.first = (a == 1.0 ? i : i - 1) % n;
        row.share = a == 0.0 || a == 1.0 ? std::vector{1.0} : std::vector{1.0 - a, a};
        Eigen::Vector3d& control = controls[idx(i % (n + 1))];
        control.setZero();
        for (std::size_t j = 0; j < row.share.size(); ++j)
            control += row.share[j] * spline.controls[(idx(row.first) + j) % idx(n)];
        made.rows[idx(i % (n + 1))] = std::move(row);
    }
    if (change)
        *change = std::move(made);
    if (!basis.is_closed())
    {
        std::vector<double> knots = U;
        knots.insert(knots.begin() + k + 1, at);
        return {SplineBasis::open(d, std::move(knots)), std::move(controls)};
    }
    std::vector<double> turn(U.begin() + d, U.end() - d);
    turn.insert(turn.begin() + (k + 1 - d), at);
    return {SplineBasis::closed(d, turn), std::move(controls)};
}

// Each new control point is the blossom of its span's polynomial at the degree knots that
// follow its own: de Boor's scheme with another argument in each round.
Spline refined(const Spline& spline, int parts)
{
    const SplineBasis& basis = spline.basis;
    if (basis.is_catmull_rom())
        throw std::invalid_argument("Catmull-Rom curves have no knots");
    const int d = basis.degree(), n = basis.num_controls();
    const std::vector<double>& U = basis.knots();
    if (parts < 2)
        return spline;
    // The new knots, those of the old ones that lie beyond the ends too, and for each new
    // span the old one.
    std::vector<double> knots;
    for (std::size_t k = 0; k < U.size(); ++k)
    {
        knots.push_back(U[k]);
        const bool is_beyond = static_cast<int>(k) < d || k + 1 + idx(d) >= U.size();
        for (int part = 1; part < parts && (!is_beyond || basis.is_closed()) &&
                           k + 1 < U.size() && U[k] < U[k + 1];
             ++part)
            knots.push_back(U[k] + (U[k + 1] - U[k]) * part / parts);
    }
    const auto blossom = [&](std::size_t first)
    {
        // An inner span of the new function's support, and the old span that holds it.
        std::size_t inner = first;
        while (inner < first + idx(d) && !(knots[inner] < knots[inner + 1]))
            ++inner;
        const int k = static_cast<int>(
                          std::upper_bound(U.begin() + d, U.end() - d - 1, knots[inner]) -
                          U.begin()) -
                      1;
        std::array<Eigen::Vector3d, kMaxOrder> q;
        for (int j = 0; j <= d; ++j)
            q[idx(j)] = spline.controls[idx(((k - d + j) % n + n) % n)];
        for (int round = 1; round <= d; ++round)
        {
            const double t = knots[first + idx(round)];
            for (int j = d; j >= round; --j)
            {
                const int i = k - d + j;
                const double low = U[idx(i)], high = U[idx(i + d + 1 - round)];
                const double a = (t - low) / (high - low);
                q[idx(j)] = (1.0 - a) * q[idx(j - 1)] + a * q[idx(j)];
            }
        }
        return q[idx(d)];
    };
    Spline out{basis, {}};
    if (!basis.is_closed())
    {
        for (std::size_t i = 0; i + idx(d) + 1 < knots.size(); ++i)
            out.controls.push_back(blossom(i));
        out.basis = SplineBasis::open(d, std::move(knots));
        return out;
    }
    // One turn, from the begin on; its first functions reach back before it.
    const std::size_t begin =
        idx(std::find(knots.begin(), knots.end(), basis.begin()) - knots.begin());
    const std::size_t count = idx(n * parts);
    const std::vector<double> turn(knots.begin() + static_cast<std::ptrdiff_t>(begin),
                                   knots.begin() +
                                       static_cast<std::ptrdiff_t>(begin + count + 1));
    for (std::size_t i = 0; i < count; ++i)
        out.controls.push_back(blossom(begin - idx(d) + i));
    out.basis = SplineBasis::closed(d, turn);
    return out;
}

// |P - P_c| <= sum b_i |(q - A q_c)_i| <= the largest of them, the functions being
// positive with sum 1.
WithoutKnot without_knot(const Spline& spline, int knot)
{
    const SplineBasis& basis = spline.basis;
    const int d = basis.degree();
    std::vector<double> knots = basis.knots();
    if (basis.is_catmull_rom() || basis.is_closed() || knot <= d ||
        knot >= static_cast<int>(knots.size()) - d - 1)
        throw std::invalid_argument("only inner knots of an open spline can go");
    const double s = knots[idx(knot)];
    knots.erase(knots.begin() + knot);
    Spline coarse{SplineBasis::open(d, std::move(knots)),
                  std::vector<Eigen::Vector3d>(spline.controls.size() - 1,
                                               Eigen::Vector3d::Zero())};
    KnotChange change;
    with_knot(coarse, s, &change);
    const int n = static_cast<int>(spline.controls.size());
    Triplets entries;
    Eigen::MatrixX3d q(n, 3);
    for (int i = 0; i < n; ++i)
    {
        const KnotChange::Row& row = change.rows[idx(i)];
        for (std::size_t j = 0; j < row.share.size(); ++j)
            entries.emplace_back(i, row.first + static_cast<int>(j), row.share[j]);
        q.row(i) = spline.controls[idx(i)].transpose();
    }
    Eigen::SparseMatrix<double> A(n, n - 1);
    A.setFromTriplets(entries.begin(), entries.end());
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor(A.transpose() * A);
    const Eigen::MatrixX3d found = factor.solve(A.transpose() * q);
    for (int i = 0; i + 1 < n; ++i)
        coarse.controls[idx(i)] = found.row(i).transpose();
    return {std::move(coarse), (q - A * found).rowwise().norm().maxCoeff()};
}

Eigen::Vector3d any_normal(const Eigen::Vector3d& tangent)
{
    Eigen::Index least = 0;
    tangent.cwiseAbs().minCoeff(&least);
    const Eigen::Vector3d axis = Eigen::Vector3d::Unit(least);
    return (axis - tangent.dot(axis) * tangent).normalized();
}

} // namespace cellwarp
