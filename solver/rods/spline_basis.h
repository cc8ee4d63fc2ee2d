// SPDX-License-Identifier: GPL-3.0-or-later
// Bases of spline curves P(s) = sum b_k(s) q_k: which functions act at a parameter, and
// their derivatives. [Lenoir04]
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

namespace cellwarp::core
{

/// Most control points that act at one parameter.
inline constexpr int kMaxOrder = 8;

/// The functions that act at one parameter, with two derivatives by it.
struct BasisValues
{
    int count = 0; ///< how many act
    std::array<int, kMaxOrder> control = {};
    /// Of derivative order 0, 1, 2.
    std::array<std::array<double, kMaxOrder>, 3> value = {};
};

/// One span between two different knots.
struct SplineSpan
{
    double begin = 0.0, end = 0.0;
    double length() const { return end - begin; }
};

class SplineBasis
{
public:
    /// B-splines of \p degree with these knots, ascending, control points + degree + 1 of
    /// them. Throws std::invalid_argument.
    static SplineBasis open(int degree, std::vector<double> knots);
    /// Periodic: \p knots of one turn, ascending, with both ends of it, one more than
    /// control points.
    static SplineBasis closed(int degree, std::span<const double> knots);

    /// Knots 0, 1, 2, ... that are clamped at both ends, or not.
    static std::vector<double> clamped_knots(int degree, int num_controls);
    static std::vector<double> uniform_knots(int degree, int num_controls);

    int degree() const { return degree_; }
    int num_controls() const { return num_controls_; }
    bool is_closed() const { return is_closed_; }
    double begin() const { return spans_.front().begin; }
    double end() const { return spans_.back().end; }
    const std::vector<SplineSpan>& spans() const { return spans_; }
    /// All knots, with those beyond the ends.
    const std::vector<double>& knots() const { return knots_; }
    /// How often the curve can be derived across the knot where span \p e begins, up to
    /// the degree: -1 a gap, 0 a kink. At open ends -1.
    int smoothness_before(int span) const;

    /// The span of a parameter; one before or behind the ends is brought to them, of a
    /// closed curve around it.
    int span_of(double s) const;
    /// \p s within the span, both ends included: at a knot this tells of which side.
    BasisValues values_in(int span, double s) const;
    BasisValues values(double s) const;
    /// Of a closed curve around; of an open one brought to its ends.
    double wrapped(double s) const;

private:
    SplineBasis() = default;
    void find_spans();

    int degree_ = 3, num_controls_ = 0;
    bool is_closed_ = false;
    std::vector<double> knots_;
    std::vector<SplineSpan> spans_;
    std::vector<int> knot_of_span_; ///< the last knot that is not beyond its begin
};

} // namespace cellwarp::core
