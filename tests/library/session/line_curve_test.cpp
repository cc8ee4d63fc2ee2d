// SPDX-License-Identifier: GPL-3.0-or-later
#include "library/session/line_curve.h"

#include <stdexcept>

#include <gtest/gtest.h>

namespace cellwarp::core
{

using Eigen::Vector3d;

namespace
{

const std::vector<Vector3d> kPoints = {{0, 0, 0}, {1, 1, 0}, {2, 0, 1}, {4, 0, 0}};

SplineLine by_controls(const std::string& knots)
{
    SplineLine line;
    line.form = SplineLine::Form::Points;
    line.knots = knots;
    return line;
}

} // namespace

TEST(LineCurve, goes_through_points_at_the_parameters_that_it_returns)
{
    SplineLine line;
    line.spans = 2;
    std::vector<double> parameters;
    const Spline curve = curve_of(line, kPoints, &parameters);
    EXPECT_EQ(curve.basis.spans().size(), 6u);
    ASSERT_EQ(parameters.size(), kPoints.size());
    for (std::size_t k = 0; k < kPoints.size(); ++k)
        EXPECT_LT((curve.at(parameters[k]).place - kPoints[k]).norm(), 1e-12) << k;
}

TEST(LineCurve, is_by_control_points_with_the_knots_that_are_stated)
{
    for (const std::string knots : {"nonuniform", "bezier"})
    {
        SCOPED_TRACE(knots);
        const Spline curve = curve_of(by_controls(knots), kPoints);
        EXPECT_EQ(curve.controls, kPoints);
        EXPECT_LT((curve.at(curve.basis.begin()).place - kPoints.front()).norm(), 1e-12);
        EXPECT_LT((curve.at(curve.basis.end()).place - kPoints.back()).norm(), 1e-12);
    }
    // With uniform knots it begins beside the points, where a cubic has these shares.
    const Spline uniform = curve_of(by_controls("uniform"), kPoints);
    EXPECT_EQ(uniform.controls, kPoints);
    EXPECT_LT((uniform.at(uniform.basis.begin()).place -
               (kPoints[0] + 4.0 * kPoints[1] + kPoints[2]) / 6.0)
                  .norm(),
              1e-12);
    // Through all of them.
    const Spline curve = curve_of(by_controls("catmull-rom"), kPoints);
    EXPECT_LT((curve.at(1.0).place - kPoints[1]).norm(), 1e-12);
}

TEST(LineCurve, bezier_pieces_are_open)
{
    SplineLine line = by_controls("bezier");
    line.is_closed = true;
    EXPECT_THROW(curve_of(line, kPoints), std::invalid_argument);
}

} // namespace cellwarp::core
