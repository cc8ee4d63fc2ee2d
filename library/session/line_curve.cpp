// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/line_curve.h"

#include <stdexcept>
#include <utility>

namespace cellwarp::core
{

Spline curve_of(const SplineLine& line, std::vector<Eigen::Vector3d> points,
                std::vector<double>* parameters)
{
    const int n = static_cast<int>(points.size()), degree = static_cast<int>(line.degree);
    if (line.form != SplineLine::Form::Points)
        return spline_through(points, line.is_closed, static_cast<int>(line.spans),
                              degree, parameters);
    if (line.knots == "bezier" && line.is_closed)
        throw std::invalid_argument("Bezier pieces are open");
    if (line.knots == "bezier")
        return bezier(points);
    if (line.knots == "catmull-rom")
        return catmull_rom(points, line.is_closed);
    if (line.knots == "uniform" && !line.is_closed && n > degree)
        return {SplineBasis::open(degree, SplineBasis::uniform_knots(degree, n)),
                std::move(points)};
    return spline_by_controls(std::move(points), line.is_closed, degree);
}

} // namespace cellwarp::core
