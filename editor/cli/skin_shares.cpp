// SPDX-License-Identifier: GPL-3.0-or-later
// With d the distance of the nearest bone, which is the radius of a limb where the sample
// is on its skin, a bone at distance e has (1 - (e - d) / d)^2 of it before all are
// scaled to sum to 1: a joint blends over some two radii on both of its sides.
#include "editor/cli/skin_shares.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "library/session/matched_joints.h"
#include "octree/base/index.h"
#include "octree/base/segment.h"

namespace cellwarp::core
{

std::vector<SkinShares> skin_shares(const std::vector<Eigen::Vector3d>& samples,
                                    const std::vector<SkeletonJoint>& joints)
{
    const std::vector<int> parents = parents_of(joints);
    std::vector<SkinShares> out;
    out.reserve(samples.size());
    for (const Eigen::Vector3d& x : samples)
    {
        std::vector<double> away(joints.size(), std::numeric_limits<double>::infinity());
        for (std::size_t k = 0; k < joints.size(); ++k)
        {
            if (parents[k] < 0)
                continue;
            const Eigen::Vector3d &a = joints[idx(parents[k])].at, &b = joints[k].at;
            double& least = away[idx(parents[k])];
            least = std::min(least, (a + nearest_share(a, b, x) * (b - a) - x).norm());
        }
        const auto nearest = static_cast<std::size_t>(
            std::min_element(away.begin(), away.end()) - away.begin());
        std::vector<std::pair<double, std::size_t>> parts; // less for more
        double sum = 0.0;
        for (std::size_t k = 0; k < joints.size(); ++k)
        {
            const bool is_beside =
                k == nearest || parents[nearest] == int(k) || parents[k] == int(nearest);
            if (!is_beside || !(away[k] < 2.0 * away[nearest] || k == nearest))
                continue;
            const double share =
                k == nearest ? 1.0 : std::pow(2.0 - away[k] / away[nearest], 2);
            parts.emplace_back(-share, k);
        }
        std::sort(parts.begin(), parts.end());
        SkinShares of;
        parts.resize(std::min(parts.size(), of.joints.size()));
        for (const auto& [less, joint] : parts)
            sum -= less;
        for (std::size_t k = 0; k < parts.size(); ++k)
        {
            of.joints[k] = static_cast<std::uint16_t>(parts[k].second);
            of.shares[k] = static_cast<float>(-parts[k].first / sum);
        }
        out.push_back(of);
    }
    return out;
}

} // namespace cellwarp::core
