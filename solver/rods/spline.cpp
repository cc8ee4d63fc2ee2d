// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/rods/spline.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include <Eigen/SparseCore>

#include "octree/base/index.h"
#include "octree/base/segment.h"
#include "solver/linear/band_lu.h"
#include "solver/rods/gauss.h"

namespace cellwarp::core
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

/// Control points with sum A_ik q_k = x_i. Of a closed curve rows and unknowns are folded
/// around: 0, n - 1, 1, n - 2, ..., so that they are a band as well.
std::vector<Eigen::Vector3d> solved(int n, bool is_closed, const Triplets& entries,
                                    const Eigen::MatrixX3d& right)
{
    const auto folded = [&](int k) {
        return !is_closed ? k : 2 * k < n ? 2 * k : 2 * (n - k) - 1;
    };
    int below = 0, above = 0;
    for (const Eigen::Triplet<double>& one : entries)
    {
        const int by = folded(one.col()) - folded(one.row());
        below = std::max(below, -by);
        above = std::max(above, by);
    }
    BandLu A(n, below, above);
    for (const Eigen::Triplet<double>& one : entries)
        A.entry(folded(one.row()), folded(one.col())) += one.value();
    if (!A.factorize())
        throw std::invalid_argument("no curve goes through these points");
    std::vector<Eigen::Vector3d> controls(idx(n));
    Eigen::VectorXd x(n);
    for (int c = 0; c < 3; ++c)
    {
        for (int k = 0; k < n; ++k)
            x[folded(k)] = right(k, c);
        A.solve(x);
        for (int k = 0; k < n; ++k)
            controls[idx(k)][c] = x[folded(k)];
    }
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
        return {basis, solved(n, is_closed, entries, right)};
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
        return {basis, solved(n + 2, false, entries, right)};
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

namespace
{

/// Of a point from straight pieces.
double distance_of(std::span<const Eigen::Vector3d> pieces, const Eigen::Vector3d& x)
{
    double least = INFINITY;
    for (std::size_t k = 0; k + 1 < pieces.size(); ++k)
    {
        const double t = nearest_share(pieces[k], pieces[k + 1], x);
        least = std::min(least, (x - pieces[k] - t * (pieces[k + 1] - pieces[k])).norm());
    }
    return least;
}

} // namespace

std::vector<Eigen::Vector3d> few_points(std::span<const Eigen::Vector3d> line,
                                        double tolerance)
{
    std::vector<std::size_t> chosen = {0, line.size() - 1};
    const auto points = [&]
    {
        std::vector<Eigen::Vector3d> out;
        for (const std::size_t k : chosen)
            out.push_back(line[k]);
        return out;
    };
    while (chosen.size() < line.size())
    {
        std::vector<double> at;
        const Spline spline = spline_through(points(), false, 1, 3, &at);
        double worst = tolerance;
        std::size_t missed = 0;
        for (std::size_t gap = 0; gap + 1 < chosen.size(); ++gap)
        {
            constexpr int kPieces = 32;
            std::vector<Eigen::Vector3d> pieces;
            for (int t = 0; t <= kPieces; ++t)
                pieces.push_back(
                    spline.at(at[gap] + (at[gap + 1] - at[gap]) * t / kPieces).place);
            for (std::size_t k = chosen[gap] + 1; k < chosen[gap + 1]; ++k)
                if (const double away = distance_of(pieces, line[k]); away > worst)
                {
                    worst = away;
                    missed = k;
                }
        }
        if (missed == 0)
            break;
        chosen.insert(std::lower_bound(chosen.begin(), chosen.end(), missed), missed);
    }
    return points();
}

Spline spline_by_controls(std::vector<Eigen::Vector3d> controls, bool is_closed,
                          int degree)
{
    const int n = static_cast<int>(controls.size());
    if (n < degree + 1)
        throw std::invalid_argument("needs at least degree + 1 = " +
                                    std::to_string(degree + 1) + " control points");
    std::vector<double> s = {0.0};
    if (is_closed)
    {
        for (int i = 1; i <= n; ++i)
            s.push_back(i);
        return {SplineBasis::closed(degree, s), std::move(controls)};
    }
    for (int i = 1; i < n; ++i)
        s.push_back(s.back() + (controls[idx(i)] - controls[idx(i - 1)]).norm());
    return {SplineBasis::open(degree, averaged_knots(s, degree)), std::move(controls)};
}

Spline catmull_rom(std::span<const Eigen::Vector3d> points, bool is_closed)
{
    const int n = static_cast<int>(points.size()), count = is_closed ? n : n - 1;
    if (n < 4)
        throw std::invalid_argument("a Catmull-Rom curve needs four control points");
    const auto point = [&](int k) { return points[idx((k + n) % n)]; };
    // A third of the tangent. What lies beyond an end is mirrored there.
    const auto third = [&](int k)
    {
        const int before = is_closed ? k - 1 : std::max(k - 1, 0),
                  behind = is_closed ? k + 1 : std::min(k + 1, n - 1);
        const double span = behind - before;
        return Eigen::Vector3d((point(behind) - point(before)) / (3.0 * span));
    };
    std::vector<double> knots;
    std::vector<Eigen::Vector3d> controls;
    for (int e = 0; e < count; ++e)
    {
        knots.insert(knots.end(), 2, double(e));
        controls.push_back(point(e) + third(e));
        controls.push_back(point(e + 1) - third(e + 1));
    }
    if (is_closed)
    {
        knots.push_back(double(count));
        // The first function ends in the first span.
        std::rotate(controls.rbegin(), controls.rbegin() + 2, controls.rend());
        return {SplineBasis::closed(3, knots), std::move(controls)};
    }
    knots.insert(knots.begin(), 2, 0.0);
    knots.insert(knots.end(), 4, double(count));
    controls.insert(controls.begin(), points.front());
    controls.push_back(points.back());
    return {SplineBasis::open(3, std::move(knots)), std::move(controls)};
}

Spline bezier(std::span<const Eigen::Vector3d> points)
{
    constexpr double kInLine = 1e-6; // sine of the angle
    const int n = static_cast<int>(points.size());
    const bool is_piecewise = n % 3 == 1 && n > 3;
    if (!is_piecewise && (n > kMaxOrder || n < 3))
        throw std::invalid_argument("Bezier pieces need 4, 7, 10, ... control points, or "
                                    "3 to 8 of one piece");
    const int degree = is_piecewise ? 3 : n - 1;
    std::vector<double> knots(idx(degree + 1), 0.0);
    std::vector<Eigen::Vector3d> controls(points.begin(), points.begin() + degree);
    double end = 1.0, length = 1.0;
    for (int k = degree; k + 1 < n; k += 3)
    {
        const Eigen::Vector3d in = points[idx(k)] - points[idx(k - 1)],
                              out = points[idx(k + 1)] - points[idx(k)];
        const double both = in.norm() * out.norm();
        const bool is_in_line =
            both > 0.0 && in.dot(out) > 0.0 && in.cross(out).norm() <= kInLine * both;
        knots.insert(knots.end(), is_in_line ? 2 : 3, end);
        // C1 joins follow from the points beside them.
        if (!is_in_line)
            controls.push_back(points[idx(k)]);
        controls.insert(controls.end(), {points[idx(k + 1)], points[idx(k + 2)]});
        length = is_in_line ? length * out.norm() / in.norm() : 1.0;
        // Beyond this, rounding of the parameter would move a place of the piece.
        constexpr double kMostRatio = 1e6;
        if (!(length < kMostRatio * end && length * kMostRatio > end))
            throw std::invalid_argument(
                "Bezier pieces that join smoothly need handles of "
                "lengths nearer to each other");
        end += length;
    }
    controls.push_back(points.back());
    knots.insert(knots.end(), idx(degree + 1), end);
    return {SplineBasis::open(degree, std::move(knots)), std::move(controls)};
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

ArcLength::ArcLength(const Spline& spline, const ArcLength& before,
                     std::span<const int> span_from)
    : spline_(spline)
{
    ends_.push_back(0.0);
    for (std::size_t e = 0; e < span_from.size(); ++e)
        ends_.push_back(ends_.back() + (span_from[e] >= 0
                                            ? before.length_of(idx(span_from[e]))
                                            : length_in(spline, static_cast<int>(e),
                                                        spline.basis.spans()[e].end)));
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
// k - d + 1 on see it once. Functions k - d ... k + 1 of the new basis have the knot
// among their own.

namespace
{

/// k of U_k <= s < U_{k+1}.
int knot_before(const SplineBasis& basis, double s)
{
    const std::vector<double>& U = basis.knots();
    const int d = basis.degree();
    return static_cast<int>(
               std::upper_bound(U.begin() + d, U.end() - d - 1, basis.wrapped(s)) -
               U.begin()) -
           1;
}

/// \p s behind knot \p k of the knots of one turn.
SplineBasis with_knot_behind(const SplineBasis& basis, int k, double s)
{
    const int d = basis.degree();
    const std::vector<double>& U = basis.knots();
    if (!basis.is_closed())
    {
        std::vector<double> knots = U;
        knots.insert(knots.begin() + k + 1, s);
        return SplineBasis::open(d, std::move(knots));
    }
    std::vector<double> turn(U.begin() + d, U.end() - d);
    turn.insert(turn.begin() + (k + 1 - d), s);
    return SplineBasis::closed(d, turn);
}

} // namespace

KnotChange::KnotChange(const SplineBasis& coarse, double s)
    : KnotChange(coarse, coarse.wrapped(s), knot_before(coarse, s))
{
}

KnotChange::KnotChange(const SplineBasis& coarse, double s, int knot)
    : fine_(with_knot_behind(coarse, knot, s)), degree_(coarse.degree()),
      num_coarse_(coarse.num_controls()), knot_(knot), is_closed_(coarse.is_closed())
{
    const std::vector<double>& U = coarse.knots();
    for (int j = 0; j < degree_; ++j)
    {
        const int i = knot - degree_ + 1 + j;
        share_[idx(j)] = (s - U[idx(i)]) / (U[idx(i + degree_)] - U[idx(i)]);
    }
}

int KnotChange::unwrapped(int fine) const
{
    return is_closed_ && fine < knot_ - degree_ + 1 ? fine + num_coarse_ + 1 : fine;
}

KnotChange::Row KnotChange::row(int fine) const
{
    const int i = unwrapped(fine), first = knot_ - degree_ + 1;
    const double a = i < first ? 1.0 : i > knot_ ? 0.0 : share_[idx(i - first)];
    const int n = num_coarse_;
    return {{i % n, (i - 1 + n) % n}, {a, 1.0 - a}};
}

int KnotChange::same(int fine) const
{
    const int i = unwrapped(fine);
    if (!is_closed_)
        return i < knot_ - degree_ ? i : i > knot_ + 1 ? i - 1 : -1;
    return i > knot_ + 1 && i <= knot_ - degree_ + num_coarse_ ? (i - 1) % num_coarse_
                                                               : -1;
}

Spline with_knot(const Spline& spline, double s)
{
    const KnotChange change(spline.basis, s);
    Spline out{change.fine(), {}};
    for (int i = 0; i <= change.num_coarse(); ++i)
    {
        const KnotChange::Row row = change.row(i);
        out.controls.push_back(row.share[0] * spline.controls[idx(row.coarse[0])] +
                               row.share[1] * spline.controls[idx(row.coarse[1])]);
    }
    return out;
}

// Each new control point is the blossom of its span's polynomial at the degree knots that
// follow its own: de Boor's scheme with another argument in each round.
Spline refined(const Spline& spline, int parts)
{
    const SplineBasis& basis = spline.basis;
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
    const std::size_t count =
        idx(n + (parts - 1) * static_cast<int>(basis.spans().size()));
    const std::vector<double> turn(knots.begin() + static_cast<std::ptrdiff_t>(begin),
                                   knots.begin() +
                                       static_cast<std::ptrdiff_t>(begin + count + 1));
    for (std::size_t i = 0; i < count; ++i)
        out.controls.push_back(blossom(begin - idx(d) + i));
    out.basis = SplineBasis::closed(d, turn);
    return out;
}

// |P - P_c| <= sum b_i |(q - A q_c)_i| <= the largest of them, the functions being
// positive with sum 1. Coarse points k - d ... k make fine ones k - d ... k + 1, and each
// of the others is one of the others: least squares are of these few alone.
std::optional<KnotRemoval> KnotRemoval::at(const SplineBasis& basis, int span)
{
    const int d = basis.degree();
    const bool is_end = span == 0 && !basis.is_closed();
    if (is_end || basis.num_controls() <= d + 1)
        return std::nullopt;
    const double s = basis.spans()[idx(span)].begin;
    std::vector<double> knots = basis.knots();
    if (basis.is_closed())
    {
        // The first knot of a turn is where the curve begins.
        if (span == 0)
            return std::nullopt;
        knots.assign(basis.knots().begin() + d, basis.knots().end() - d);
    }
    knots.erase(std::find(knots.begin() + (basis.is_closed() ? 0 : d), knots.end(), s));
    SplineBasis coarse = basis.is_closed() ? SplineBasis::closed(d, knots)
                                           : SplineBasis::open(d, std::move(knots));
    KnotChange change(coarse, s);
    return KnotRemoval(std::move(coarse), std::move(change));
}

KnotRemoval::KnotRemoval(SplineBasis coarse, KnotChange change)
    : coarse_(std::move(coarse)), change_(std::move(change))
{
    const int d = change_.degree(), n = change_.num_coarse();
    fine_from_coarse_.setZero(d + 2, d + 1);
    for (int i = 0; i < d + 2; ++i)
    {
        const KnotChange::Row row = change_.row((change_.first_fine() + i) % (n + 1));
        for (const std::size_t j : {0u, 1u})
            if (row.share[j] != 0.0)
                fine_from_coarse_(i, (row.coarse[j] - change_.first_coarse() + n) % n) +=
                    row.share[j];
    }
    const Eigen::MatrixXd& A = fine_from_coarse_;
    coarse_from_fine_ = (A.transpose() * A).ldlt().solve(A.transpose());
}

double KnotRemoval::apply(std::span<const Eigen::Vector3d> fine,
                          std::vector<Eigen::Vector3d>& out) const
{
    const int d = change_.degree(), n = change_.num_coarse();
    out.resize(idx(n));
    for (int i = 0; i <= n; ++i)
        if (const int same = change_.same(i); same >= 0)
            out[idx(same)] = fine[idx(i)];
    Eigen::MatrixX3d q(d + 2, 3);
    for (int i = 0; i < d + 2; ++i)
        q.row(i) = fine[idx((change_.first_fine() + i) % (n + 1))];
    const Eigen::MatrixX3d found = coarse_from_fine_ * q;
    for (int i = 0; i < d + 1; ++i)
        out[idx((change_.first_coarse() + i) % n)] = found.row(i);
    return (q - fine_from_coarse_ * found).rowwise().norm().maxCoeff();
}

Eigen::Vector3d any_normal(const Eigen::Vector3d& tangent)
{
    Eigen::Index least = 0;
    tangent.cwiseAbs().minCoeff(&least);
    const Eigen::Vector3d axis = Eigen::Vector3d::Unit(least);
    return (axis - tangent.dot(axis) * tangent).normalized();
}

} // namespace cellwarp::core
