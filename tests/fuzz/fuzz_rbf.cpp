// SPDX-License-Identifier: GPL-3.0-or-later
// Arbitrary bytes as centres with displacements: on lines, in planes, coincident or
// nearly so. What is fitted is finite everywhere, misses no centre by more than the
// residual that it reports, and nearly nothing where the centres are apart.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "solver/field/rbf.h"

using namespace cellwarp::core;

namespace
{

void require(bool condition)
{
    if (!condition)
        std::abort();
}

/// Centres nearer than this, of their extent, lose digits of what is asked of them.
constexpr double kApart = 1e-2;
/// What may be missed where they are apart, of the largest displacement.
constexpr double kMissed = 1e-8;

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
    constexpr std::size_t kHead = 2, kEach = 6, kMost = 64;
    if (size < kHead + kEach)
        return 0;
    static constexpr double scales[] = {1.0, 1e-3, 1e-9, 1e-12, 1e3};
    // Some axes shrink, so that the centres are nearly in a plane or on a line.
    const Eigen::Vector3d scale(1.0, scales[data[0] % 5], scales[data[0] / 5 % 5]);
    const double length = data[1] % 8 == 0 ? 1e-6 : data[1] % 8 == 1 ? 1e6 : 1.0;
    const std::size_t count = std::min((size - kHead) / kEach, kMost);
    std::vector<Eigen::Vector3d> centres, displacements;
    double largest = 0.0;
    for (std::size_t i = 0; i < count; ++i)
    {
        const std::uint8_t* const at = data + kHead + kEach * i;
        centres.push_back(Eigen::Vector3d(at[0], at[1], at[2]).cwiseProduct(scale) /
                          255.0);
        displacements.push_back(length * (Eigen::Vector3d(at[3], at[4], at[5]) / 127.5 -
                                          Eigen::Vector3d::Ones()));
        largest = std::max(largest, displacements.back().norm());
    }
    const RbfSystem system(centres);
    require(system.num_centres() >= 1 && system.num_centres() <= count);
    const RbfSystem::Fit fit = system.fit(displacements);
    require(std::isfinite(fit.residual) && fit.residual >= 0);

    double extent = 0.0, nearest = INFINITY;
    for (std::size_t i = 0; i < count; ++i)
        for (std::size_t j = 0; j < i; ++j)
        {
            const double distance = (centres[i] - centres[j]).norm();
            extent = std::max(extent, distance);
            nearest = std::min(nearest, distance);
        }
    if (system.num_centres() == count)
        for (std::size_t i = 0; i < count; ++i)
        {
            const FieldValue value = fit.field.value(centres[i]);
            require(value.displacement.allFinite() && value.gradient.allFinite());
            require((value.displacement - displacements[i]).norm() <=
                    1.01 * fit.residual + 1e-9 * largest);
        }
    // Flat ones: as far apart along the axes that have not shrunk.
    if (count == 1 || (nearest >= kApart * extent && scale.minCoeff() == 1.0))
        require(fit.residual <= kMissed * largest);
    for (const double far : {-1e3, -1.0, 0.5, 2.0, 1e3})
    {
        const FieldValue value = fit.field.value(far * Eigen::Vector3d(1, 0.7, -0.3));
        require(value.displacement.allFinite() && value.gradient.allFinite());
    }
    return 0;
}
