// SPDX-License-Identifier: GPL-3.0-or-later
// A unit current flows into a node and out at the ground; the node's potential x is the
// resistance. With conductances g_ab the potentials solve
//   sum_b g_ab (x_a - x_b) = 1 at the node, 0 at the others, x = 0 at the ground.
// Conductances differ by many powers of ten. So nodes are eliminated one by one as a star
// of resistors is replaced by a mesh: of node k, joined to others by g_ka, remains
//   g_ab += g_ka g_kb / s_k,   s_k = sum_a g_ka.
// Only positive numbers are added: every potential is exact but for rounding, relative to
// itself.
//
// The derivative of the resistance by that of one joint is the square of its current.
#include "solver/field/glue_network.h"

#include <algorithm>
#include <numeric>

namespace cellwarp::core
{

namespace
{

/// Added to each joint's resistance, in units of the largest that matters (1): a joint
/// without any would be no number.
constexpr double kLeast = 1e-12;

} // namespace

GlueNetwork::GlueNetwork(std::span<const double> resistances)
    : resistances_(resistances.begin(), resistances.end())
{
}

void GlueNetwork::join(std::size_t a, std::size_t b)
{
    joints_.push_back({a, b, 1.0 / (0.5 * (resistances_[a] + resistances_[b]) + kLeast)});
}

void GlueNetwork::solve_for(std::size_t ground)
{
    const std::size_t n = size();
    // Nodes of few joints first: they make few new ones. The ground is the last.
    std::vector<std::size_t> num_joints(n, 0);
    for (const Joint& joint : joints_)
    {
        ++num_joints[joint.a];
        ++num_joints[joint.b];
    }
    num_joints[ground] = joints_.size() + 1;
    order_.resize(n);
    std::iota(order_.begin(), order_.end(), std::size_t(0));
    std::stable_sort(order_.begin(), order_.end(),
                     [&](std::size_t a, std::size_t b)
                     { return num_joints[a] < num_joints[b]; });
    place_.resize(n);
    for (std::size_t i = 0; i < n; ++i)
        place_[order_[i]] = i;
    factors_.assign(n * n, 0.0);
    for (const Joint& joint : joints_)
    {
        at(place_[joint.a], place_[joint.b]) += joint.conductance;
        at(place_[joint.b], place_[joint.a]) += joint.conductance;
    }
    pivots_.assign(n, 0.0);
    for (std::size_t k = 0; k + 1 < n; ++k)
    {
        for (std::size_t a = k + 1; a < n; ++a)
            pivots_[k] += at(k, a);
        // The row becomes the shares of the star's rays.
        for (std::size_t a = k + 1; a < n; ++a)
            at(k, a) /= pivots_[k];
        for (std::size_t a = k + 1; a < n; ++a)
        {
            const double ray = at(a, k);
            if (ray == 0.0)
                continue;
            for (std::size_t b = k + 1; b < n; ++b)
                if (b != a)
                    at(a, b) += ray * at(k, b);
        }
    }
}

double GlueNetwork::resistance_to(std::size_t node)
{
    const std::size_t last = size() - 1;
    potentials_.assign(size(), 0.0);
    potentials_[place_[node]] = place_[node] == last ? 0.0 : 1.0;
    for (std::size_t k = 0; k < last; ++k)
        for (std::size_t a = k + 1; a < last; ++a)
            potentials_[a] += at(k, a) * potentials_[k];
    for (std::size_t k = last; k-- > 0;)
    {
        potentials_[k] /= pivots_[k];
        for (std::size_t a = k + 1; a < last; ++a)
            potentials_[k] += at(k, a) * potentials_[a];
    }
    slopes_.assign(size(), 0.0);
    for (const Joint& joint : joints_)
    {
        const double current = joint.conductance * (potentials_[place_[joint.a]] -
                                                    potentials_[place_[joint.b]]);
        slopes_[joint.a] += 0.5 * current * current;
        slopes_[joint.b] += 0.5 * current * current;
    }
    return potentials_[place_[node]];
}

} // namespace cellwarp::core
