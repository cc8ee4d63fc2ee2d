// SPDX-License-Identifier: GPL-3.0-or-later
// A person with an open mouth is a closed surface but for one small loop: a lid closes
// it, and the shape stays as it is. A wrap is the last resort, because its ball also
// closes gaps that are narrower than itself: at an eighth of the height of a person it
// glues the legs. So it begins small where triangles keep it outside; samples alone keep
// out only a ball that is larger than the spaces between them.
#include "octree/closed_surface.h"

#include <algorithm>
#include <array>

#include "octree/base/bounding_box.h"
#include "octree/bounding_surface.h"
#include "octree/lids.h"
#include "octree/winding.h"
#include "octree/wrap/wrap.h"

namespace cellwarp::core
{

namespace
{

/// The longest loop of open edges that is a small opening [diagonal]: a mouth, an eye, a
/// neck, a waist; but not the rim of a cup.
constexpr double kSmallOpening = 0.5;

/// With a larger share of open edges triangles do not make a surface.
constexpr double kMostOpenEdges = 0.25;

/// Radii of the balls [diagonal].
constexpr std::array kBallsAroundTriangles = {1.0 / 100.0, 1.0 / 40.0, 1.0 / 16.0};
constexpr std::array kBallsAroundSamples = {1.0 / 40.0, 1.0 / 20.0, 1.0 / 10.0};

/// The distance of a wrap from the samples [diagonal], its least share of the ball's
/// radius, and the least ball where it rolls on samples alone [their spacings].
constexpr double kOffset = 1.0 / 400.0, kOffsetOfBall = 0.05, kSpacings = 3.0;

} // namespace

std::vector<std::function<Shape()>> closed_surfaces(const Shape& shape,
                                                    std::size_t most_triangles)
{
    std::vector<std::function<Shape()>> ways;
    const double diagonal = box_around(shape.samples).diagonal().norm();
    const auto offset = [=](double ball)
    { return std::max(kOffset * diagonal, kOffsetOfBall * ball); };
    const BoundingSurface bounds = bounding_surface(shape);
    // Joined where corners coincide, as at the seams of texture coordinates.
    const auto with_small_lids = [=, samples = shape.samples]() {
        return with_lids(Shape{samples, bounds.triangles}, kSmallOpening * diagonal);
    };
    const bool is_surface = bounds.open_edges <= kMostOpenEdges;
    if (!shape.triangles.empty() && shape.triangles.size() <= most_triangles)
    {
        ways.push_back([&shape] { return shape; });
        if (is_surface)
            ways.push_back(with_small_lids);
    }
    if (is_surface)
        for (const double share : kBallsAroundTriangles)
            ways.push_back(
                [=]
                {
                    const double ball = share * diagonal;
                    return alpha_wrap(with_small_lids(), ball, offset(ball));
                });
    else
        for (const double share : kBallsAroundSamples)
            ways.push_back(
                [=, &shape]
                {
                    const double ball = std::max(
                        share * diagonal, kSpacings * point_spacing(shape.samples));
                    return alpha_wrap(shape.samples, ball, offset(ball));
                });
    return ways;
}

} // namespace cellwarp::core
