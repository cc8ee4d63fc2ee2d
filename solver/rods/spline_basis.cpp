// SPDX-License-Identifier: GPL-3.0-or-later
// B-splines by the recurrence of Cox and de Boor:
//   b_{i,p} = (s - U_i) / (U_{i+p} - U_i) b_{i,p-1}
//           + (U_{i+p+1} - s) / (U_{i+p+1} - U_{i+1}) b_{i+1,p-1},      0 / 0 = 0
//   b'_{i,p} = p [b_{i,p-1} / (U_{i+p} - U_i) - b_{i+1,p-1} / (U_{i+p+1} - U_{i+1})]
// In a span only the degree + 1 functions i = k - degree ... k are not zero, k its knot.
#include "solver/rods/spline_basis.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "octree/base/index.h"

namespace cellwarp::core
{

SplineBasis SplineBasis::open(int degree, std::vector<double> knots)
{
    SplineBasis basis;
    basis.degree_ = degree;
    basis.num_controls_ = static_cast<int>(knots.size()) - degree - 1;
    if (degree < 1 || degree >= kMaxOrder || basis.num_controls_ < degree + 1 ||
        !std::is_sorted(knots.begin(), knots.end()))
        throw std::invalid_argument("no knots of a spline of this degree");
    basis.knots_ = std::move(knots);
    basis.find_spans();
    return basis;
}

SplineBasis SplineBasis::closed(int degree, std::span<const double> knots)
{
    SplineBasis basis;
    basis.degree_ = degree;
    basis.is_closed_ = true;
    const int n = basis.num_controls_ = static_cast<int>(knots.size()) - 1;
    if (degree < 1 || degree >= kMaxOrder || n < degree + 1 ||
        !std::is_sorted(knots.begin(), knots.end()))
        throw std::invalid_argument("no knots of a closed spline of this degree");
    const double period = knots.back() - knots.front();
    for (int i = -degree; i <= n + degree; ++i)
    {
        const int turn = i < 0 ? -1 : i / n;
        basis.knots_.push_back(knots[idx(i - turn * n)] + turn * period);
    }
    basis.find_spans();
    return basis;
}

std::vector<double> SplineBasis::clamped_knots(int degree, int num_controls)
{
    std::vector<double> knots;
    for (int i = 0; i <= num_controls + degree; ++i)
        knots.push_back(std::clamp(i - degree, 0, num_controls - degree));
    return knots;
}

std::vector<double> SplineBasis::uniform_knots(int degree, int num_controls)
{
    std::vector<double> knots;
    for (int i = 0; i <= num_controls + degree; ++i)
        knots.push_back(i - degree);
    return knots;
}

void SplineBasis::find_spans()
{
    const int last = static_cast<int>(knots_.size()) - 1 - degree_;
    for (int k = degree_; k < last; ++k)
        if (knots_[idx(k)] < knots_[idx(k + 1)])
        {
            spans_.push_back({knots_[idx(k)], knots_[idx(k + 1)]});
            knot_of_span_.push_back(k);
        }
    if (spans_.empty())
        throw std::invalid_argument("a spline without a span");
}

int SplineBasis::smoothness_before(int span) const
{
    if (span == 0 && !is_closed_)
        return -1;
    const double knot = spans_[idx(span)].begin;
    int multiplicity = 0;
    for (int k = knot_of_span_[idx(span)]; k >= 0 && knots_[idx(k)] == knot; --k)
        ++multiplicity;
    return degree_ - multiplicity;
}

double SplineBasis::wrapped(double s) const
{
    if (!is_closed_)
        return std::clamp(s, begin(), end());
    const double period = end() - begin();
    const double turned = s - period * std::floor((s - begin()) / period);
    return std::clamp(turned, begin(), end());
}

int SplineBasis::span_of(double s) const
{
    const double at = wrapped(s);
    const auto next = std::upper_bound(spans_.begin(), spans_.end(), at,
                                       [](double value, const SplineSpan& span)
                                       { return value < span.begin; });
    return std::max(0, static_cast<int>(next - spans_.begin()) - 1);
}

BasisValues SplineBasis::values(double s) const
{
    const double at = wrapped(s);
    return values_in(span_of(at), at);
}

BasisValues SplineBasis::values_in(int span, double s) const
{
    BasisValues out;
    out.count = degree_ + 1;
    const int n = num_controls_;
    const int p = degree_, k = knot_of_span_[idx(span)];
    // Values of all degrees up to p: of degree r at [r][0 ... r], from function k - r on.
    double b[kMaxOrder][kMaxOrder] = {};
    b[0][0] = 1.0;
    const auto knot = [&](int i) { return knots_[idx(i)]; };
    for (int r = 1; r <= p; ++r)
        for (int j = 0; j <= r; ++j)
        {
            const int i = k - r + j;
            double sum = 0.0;
            if (j > 0 && knot(i + r) > knot(i))
                sum += (s - knot(i)) / (knot(i + r) - knot(i)) * b[r - 1][j - 1];
            if (j < r && knot(i + r + 1) > knot(i + 1))
                sum +=
                    (knot(i + r + 1) - s) / (knot(i + r + 1) - knot(i + 1)) * b[r - 1][j];
            b[r][j] = sum;
        }
    // Derivatives of degree r from the values, or derivatives, of degree r - 1.
    const auto derived = [&](int r, const double* lower, double* upper)
    {
        for (int j = 0; j <= r; ++j)
        {
            const int i = k - r + j;
            double sum = 0.0;
            if (j > 0 && knot(i + r) > knot(i))
                sum += lower[j - 1] / (knot(i + r) - knot(i));
            if (j < r && knot(i + r + 1) > knot(i + 1))
                sum -= lower[j] / (knot(i + r + 1) - knot(i + 1));
            upper[j] = r * sum;
        }
    };
    for (int j = 0; j <= p; ++j)
    {
        out.value[0][idx(j)] = b[p][j];
        const int control = k - p + j;
        out.control[idx(j)] = is_closed_ ? control % n : control;
    }
    derived(p, b[p - 1], out.value[1].data());
    if (p >= 2)
    {
        double first[kMaxOrder] = {};
        derived(p - 1, b[p - 2], first);
        derived(p, first, out.value[2].data());
    }
    return out;
}

} // namespace cellwarp::core
