// SPDX-License-Identifier: GPL-3.0-or-later
// Spline curves as values: places, arc length, interpolation, knots in and out.
#pragma once

#include <algorithm>
#include <array>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "solver/rods/spline_basis.h"

namespace cellwarp::core
{

/// P, P' = dP/ds and P'' at one parameter.
struct CurvePoint
{
    Eigen::Vector3d place, first, second;
};

/// P(s) = sum b_k(s) q_k. [m]
struct Spline
{
    SplineBasis basis;
    std::vector<Eigen::Vector3d> controls;

    CurvePoint at(double s) const { return combined(basis.values(s)); }
    CurvePoint at(int span, double s) const { return combined(basis.values_in(span, s)); }
    CurvePoint combined(const BasisValues& values) const;
};

/// The cubic through \p points with natural ends (P'' = 0), C2, parameters by chord
/// length, with \p spans of equal parameter in each gap between two points; of other
/// degrees with knots at means of parameters. \p parameters, if given, gets those of the
/// points. Throws std::invalid_argument for fewer than two points, or two successive
/// ones at the same place.
Spline spline_through(std::span<const Eigen::Vector3d> points, bool is_closed, int spans,
                      int degree = 3, std::vector<double>* parameters = nullptr);

/// As few of \p line, ends included, as that the cubic through them (see
/// spline_through()) passes all of them no farther off than \p tolerance: each time the
/// one that it misses by most.
std::vector<Eigen::Vector3d> few_points(std::span<const Eigen::Vector3d> line,
                                        double tolerance);

/// The spline of these control points, knots at means of the parameters of their own
/// chord; closed: uniform knots. Throws std::invalid_argument for fewer than degree + 1.
Spline spline_by_controls(std::vector<Eigen::Vector3d> controls, bool is_closed,
                          int degree = 3);

/// Through \p points, with the tangent at each along the way from the one before it to
/// the one behind, at ends along the way to the neighbour [Catmull74]: C1, spans of
/// length 1, two knots at each point. Throws std::invalid_argument for fewer than four.
Spline catmull_rom(std::span<const Eigen::Vector3d> points, bool is_closed);

/// Cubic Bezier pieces between every third of \p points; or one piece of a higher degree,
/// or a lower one, of up to kMaxOrder points. Pieces whose handles are in line, to 1e-6
/// rad, join C1, their parameters in the ratio of the handles; others kink. Throws
/// std::invalid_argument for other counts.
Spline bezier(std::span<const Eigen::Vector3d> points);

/// Clamped knots at the means of \p degree successive of these ascending parameters, one
/// a control point.
std::vector<double> averaged_knots(std::span<const double> parameters, int degree);

/// Arc length of a curve at rest, and its inverse.
class ArcLength
{
public:
    explicit ArcLength(const Spline& spline);
    /// Where spans are still what they were in \p before, their length is: \p span_from
    /// has their numbers there, -1: others.
    ArcLength(const Spline& spline, const ArcLength& before,
              std::span<const int> span_from);

    double total() const { return ends_.back(); } ///< [m]
    /// Of one span [m].
    double length_of(std::size_t span) const { return ends_[span + 1] - ends_[span]; }
    /// From the begin to \p s.
    double at(double s) const;
    /// The parameter of a share of the length in [0, 1].
    double parameter(double share) const;

private:
    Spline spline_;
    std::vector<double> ends_; ///< of the spans, the first at 0
};

/// How the control points of a finer basis, with one knot more, follow from those of the
/// coarser one: q^_i = a_i q_i + (1 - a_i) q_{i-1}. All but a few are the same. [Boehm]
class KnotChange
{
public:
    /// \p coarse gets a knot at \p s.
    KnotChange(const SplineBasis& coarse, double s);

    struct Row
    {
        std::array<int, 2> coarse; ///< control points, q_i and q_{i-1}
        std::array<double, 2> share;
    };
    Row row(int fine) const;
    /// The control point of the coarse basis whose function is the same; -1: none.
    int same(int fine) const;
    /// The first control points that are not: degree + 2 fine ones, degree + 1 coarse
    /// ones, modulo their numbers.
    int first_fine() const { return (knot_ - degree_) % (num_coarse_ + 1); }
    int first_coarse() const { return (knot_ - degree_) % num_coarse_; }
    int degree() const { return degree_; }
    int num_coarse() const { return num_coarse_; }
    const SplineBasis& fine() const { return fine_; }

private:
    KnotChange(const SplineBasis& coarse, double s, int knot);
    /// Of a closed curve, so that a turn begins with what changes.
    int unwrapped(int fine) const;

    SplineBasis fine_;
    int degree_, num_coarse_, knot_; ///< k of U_k <= s < U_{k+1}
    bool is_closed_;
    std::array<double, kMaxOrder> share_ = {}; ///< a_i from k - degree + 1 on
};

/// The same curve with one more knot. B-splines alone.
Spline with_knot(const Spline& spline, double s);

/// The same curve with every span cut in \p parts of the same parameter. B-splines alone.
Spline refined(const Spline& spline, int parts);

/// What takes a knot out of a basis: curves become those without it that are closest in
/// their control points, of which only a few change.
class KnotRemoval
{
public:
    /// The knot where span \p span begins, an inner one; nothing: it cannot go.
    static std::optional<KnotRemoval> at(const SplineBasis& basis, int span);

    const SplineBasis& coarse() const { return coarse_; }
    const KnotChange& change() const { return change_; } ///< the way back
    /// \p out: control points without the knot. Returns by how much the curve moves, at
    /// the most. [m]
    double apply(std::span<const Eigen::Vector3d> fine,
                 std::vector<Eigen::Vector3d>& out) const;

private:
    KnotRemoval(SplineBasis coarse, KnotChange change);

    SplineBasis coarse_;
    KnotChange change_;
    Eigen::MatrixXd fine_from_coarse_, coarse_from_fine_; ///< of those that change
};

/// A unit vector across \p tangent: the direction of least component, made orthogonal.
Eigen::Vector3d any_normal(const Eigen::Vector3d& tangent);

/// 1 + a . b of two unit vectors; a = -b, which has no shortest turn, is kept from 0.
inline double hop_scale(const Eigen::Vector3d& a, const Eigen::Vector3d& b)
{
    return std::max(1.0 + a.dot(b), 1e-12);
}

/// Takes a vector across the unit vector \p a to one across \p b by the shortest turn, a
/// hop. \p v must be orthogonal to a; where there is no shortest turn it comes back.
/// [Bergou08]
inline Eigen::Vector3d transported(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                                   const Eigen::Vector3d& v)
{
    const double scale = hop_scale(a, b);
    return scale > 1e-12 ? Eigen::Vector3d(v - b.dot(v) / scale * (a + b)) : v;
}

/// 2 a x b / (1 + a . b): half of it, times the move of a or of b, is the angle by which
/// what the hop carries turns about b.
inline Eigen::Vector3d turn_of_hop(const Eigen::Vector3d& a, const Eigen::Vector3d& b)
{
    return 2.0 / hop_scale(a, b) * a.cross(b);
}

} // namespace cellwarp::core
