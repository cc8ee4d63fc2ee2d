// SPDX-License-Identifier: GPL-3.0-or-later
// Spline curves as values: places, arc length, interpolation, knots in and out.
#pragma once

#include <algorithm>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "solver/rods/spline_basis.h"

namespace cellwarp
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

/// Clamped knots at the means of \p degree successive of these ascending parameters, one
/// a control point.
std::vector<double> averaged_knots(std::span<const double> parameters, int degree);

/// Arc length of a curve at rest, and its inverse.
class ArcLength
{
public:
    explicit ArcLength(const Spline& spline);

    double total() const { return ends_.back(); } ///< [m]
    /// From the begin to \p s.
    double at(double s) const;
    /// The parameter of a share of the length in [0, 1].
    double parameter(double share) const;

private:
    Spline spline_;
    std::vector<double> ends_; ///< of the spans, the first at 0
};

/// How new control points follow from old ones: row i is the few old ones that make new
/// control point i.
struct KnotChange
{
    struct Row
    {
        int first = 0; ///< old control point, modulo their number
        std::vector<double> share;
    };
    std::vector<Row> rows;
};

/// The same curve with one more knot. B-splines alone. [Boehm]
Spline with_knot(const Spline& spline, double s, KnotChange* change = nullptr);

/// The same curve with every span cut in \p parts of the same parameter. B-splines alone.
Spline refined(const Spline& spline, int parts);

/// A curve without knot \p knot of basis.knots(), an inner one, that is closest to it in
/// its control points, and by how much the curve moves at the most. Open B-splines.
struct WithoutKnot
{
    Spline spline;
    double bound = 0.0; ///< [m]
};
WithoutKnot without_knot(const Spline& spline, int knot);

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

} // namespace cellwarp
