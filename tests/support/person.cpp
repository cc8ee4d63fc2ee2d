// SPDX-License-Identifier: GPL-3.0-or-later
#include "tests/support/person.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "octree/base/segment.h"
#include "tests/support/pot.h"

namespace cellwarp::core::support
{

namespace
{

using Eigen::Vector3d;

/// A capsule whose radius goes from \p ra at \p a to \p rb at \p b.
double cone(const Vector3d& x, const Vector3d& a, const Vector3d& b, double ra, double rb)
{
    const double t = nearest_share(a, b, x);
    return (x - a - t * (b - a)).norm() - ra - t * (rb - ra);
}

} // namespace

Person person(double arms, unsigned seed)
{
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> share(0.95, 1.05);
    Person out;
    const double leg = 0.8 * share(random), arm = 0.55 * share(random);
    const double down = arms * std::numbers::pi / 180.0;
    const Vector3d along(-std::cos(down), -std::sin(down), 0.0);
    out.ankle = {-0.11, 0.07, 0};
    out.hip = out.ankle + Vector3d(0, leg, 0);
    out.knee = 0.5 * (out.hip + out.ankle);
    out.toe = out.ankle + Vector3d(0, -0.02, 0.16);
    out.pelvis = {0, out.hip.y() + 0.07, 0};
    out.chest = out.pelvis + Vector3d(0, 0.45 * share(random), 0);
    out.head = out.chest + Vector3d(0, 0.28, 0);
    out.mouth = out.head + Vector3d(0, -0.03, 0.1);
    out.shoulder = out.chest + Vector3d(-0.18, 0, 0);
    out.hand = out.shoulder + arm * along;
    out.elbow = 0.5 * (out.shoulder + out.hand);
    const auto distance = [&](const Vector3d& at)
    {
        const Vector3d x(-std::abs(at.x()), at.y(), at.z());
        const Vector3d mirrored(-x.x(), x.y(), x.z());
        double least = cone(x, out.pelvis, out.chest, 0.14, 0.13);
        for (const Vector3d& side : {x, mirrored})
        {
            least = std::min(least, cone(side, out.chest, out.shoulder, 0.1, 0.07));
            least = std::min(least, cone(side, out.shoulder, out.hand, 0.055, 0.035));
            least = std::min(least, cone(side, out.pelvis, out.hip, 0.1, 0.085));
            least = std::min(least, cone(side, out.hip, out.ankle, 0.08, 0.05));
            least = std::min(least, cone(side, out.ankle, out.toe, 0.05, 0.04));
        }
        least = std::min(least, cone(x, out.chest, out.head, 0.06, 0.06));
        return std::min(least, cone(x, out.head, out.head, 0.1, 0.1));
    };
    out.shape = level_set(distance, {-1.0, -0.1, -0.3}, {1.0, 2.1, 0.4}, 0.02);
    return out;
}

} // namespace cellwarp::core::support
