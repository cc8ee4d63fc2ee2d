// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/flesh/flesh_parts.h"

#include <algorithm>
#include <cmath>

#include "octree/base/bounding_box.h"
#include "octree/base/parallel.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr std::size_t kNodeGrain = 2048; ///< nodes

/// Below this h^2 E / (density edge^2) the mass is most of the matrix, and its diagonal
/// a better preconditioner than all levels [theory-skeleton 10].
constexpr double kHeavy = 3.0;

} // namespace

Flesh::Parts::Parts(Lattice of, std::vector<FleshMaterial> of_what,
                    std::vector<HeldPoint> held, std::vector<TubePart> of_tubes,
                    FleshSettings how, std::vector<FleshRegionShares> of_regions)
    : lattice(std::move(of)), materials(std::move(of_what)), points(std::move(held)),
      nodes(bind_nodes(lattice.hanging, points)), settings(how),
      forces(lattice, materials, std::move(of_tubes)),
      free_shares(nodes, lattice.places.size())
{
    if (settings.law == FleshLaw::Regions)
        regions.emplace(lattice, nodes, materials, forces.tubes(), std::move(of_regions),
                        settings.alpha, settings.beta);
    size = lattice.places.empty() ? 0.0 : box_around(lattice.places).diagonal().norm();
    edge = size;
    for (const LatticePart& part : lattice.parts)
    {
        const CornerNodes& corners = lattice.cells[idx(part.cell)];
        edge = std::min(
            edge,
            (lattice.places[idx(corners[1])] - lattice.places[idx(corners[0])]).norm());
    }
    weight = weight_in(settings.gravity);
    loads = carried = all_nodes();
    if (settings.law == FleshLaw::StVenantKirchhoff)
        forces.take_law(StrainLaw::StVenantKirchhoff);
    if (settings.law == FleshLaw::NeoHookean)
        forces.take_law(StrainLaw::NeoHookean);
}

VectorXd Flesh::Parts::weight_in(const Vector3d& gravity) const
{
    VectorXd of_nodes, g = all_nodes();
    for (Eigen::Index n = 0; n < g.size(); n += 3)
        g.segment<3>(n) = gravity;
    forces.multiply(g, {1.0, 0.0, 0.0}, of_nodes);
    return of_nodes;
}

void Flesh::Parts::expand(const VectorXd& free, const VectorXd* c, VectorXd& all) const
{
    all.resize(Eigen::Index(3 * lattice.places.size()));
    parallel_for(nodes.free.size(), kNodeGrain,
                 [&](std::size_t k) {
                     all.segment<3>(3 * nodes.free[k]) =
                         free.segment<3>(Eigen::Index(3 * k));
                 });
    parallel_for(nodes.bound.size(), kNodeGrain,
                 [&](std::size_t k)
                 {
                     Vector3d sum = Vector3d::Zero();
                     for (const NodeShare& share : nodes.by_free[k])
                         sum += share.share * free.segment<3>(3 * share.node);
                     if (c)
                         for (const NodeShare& share : nodes.by_points[k])
                             sum += share.share * c->segment<3>(3 * share.node);
                     all.segment<3>(3 * nodes.bound[k]) = sum;
                 });
}
void Flesh::Parts::reduce(const VectorXd& all, VectorXd& free) const
{
    free.resize(Eigen::Index(3 * nodes.free.size()));
    parallel_for(nodes.free.size(), kNodeGrain,
                 [&](std::size_t k)
                 {
                     Vector3d sum = all.segment<3>(3 * nodes.free[k]);
                     for (const NodeShare& share : nodes.free_of[k])
                         sum += share.share *
                                all.segment<3>(3 * nodes.bound[idx(share.node)]);
                     free.segment<3>(Eigen::Index(3 * k)) = sum;
                 });
}

void Flesh::Parts::prepare(double dt)
{
    if (dt == prepared_dt)
        return;
    double stiffest = 0.0; // z^2
    for (const FleshMaterial& material : materials)
        stiffest = std::max(stiffest,
                            dt * dt * material.young / (material.density * edge * edge));
    preconditioner.emplace(lattice, nodes, forces.mean_blocks(factors(dt)),
                           settings.has_levels && !regions && stiffest >= kHeavy);
    cg = ConjugateGradients(Eigen::Index(3 * nodes.free.size()));
    prepared_dt = dt;
}

void Flesh::Parts::find_carried(std::span<const Motion> motions)
{
    carried.setZero();
    if (carrying.empty())
        return;
    // Counted from the identity, so that nothing is left of the weight at rest.
    std::vector<Matrix3d> turns(lattice.places.size(), Matrix3d::Zero());
    std::vector<char> has_share(turns.size(), 0);
    const auto add = [&](int node, double share, const Matrix3d& turn)
    {
        turns[idx(node)] += share * turn;
        has_share[idx(node)] = 1;
    };
    for (const FleshRegionShares& bone : carrying)
        for (const NodeShare& share : bone.shares)
            add(share.node, share.share,
                motions[idx(bone.motion)].R - Matrix3d::Identity());
    for (std::size_t n = 0; n < turns.size(); ++n)
        for (const NodeShare& share : lattice.hanging[n])
            if (has_share[idx(share.node)])
                add(static_cast<int>(n), share.share, turns[idx(share.node)]);
    for (std::size_t n = 0; n < turns.size(); ++n)
    {
        const auto k = Eigen::Index(3 * n);
        if (has_share[n])
            carried.segment<3>(k) =
                -(weight.segment<3>(k) + turns[n] * weight.segment<3>(k));
    }
}

void Flesh::Parts::find_rows(const FleshState& state, double dt,
                             std::span<const Motion> motions)
{
    rows.resize(Eigen::Index(3 * points.size()));
    for (std::size_t k = 0; k < points.size(); ++k)
        rows.segment<3>(Eigen::Index(3 * k)) =
            (displacement_of(points[k], motions) - at_point(points[k].shares, state.u)) /
                dt -
            at_point(points[k].shares, velocity);
}

void Flesh::Parts::impulse(const VectorXd& u, const VectorXd& v0, const VectorXd& v,
                           double dt, std::span<const Motion> motions)
{
    predicted = u + dt * v;
    if (settings.law != FleshLaw::Linear)
        forces.follow(predicted);
    forces.forces(predicted, motions, force);
    force += outer_forces();
    if (settings.alpha > 0.0 || settings.beta > 0.0)
    {
        forces.multiply(v, {settings.alpha, settings.beta, 0.0}, image);
        force -= image;
    }
    force *= dt;
    change = v - v0;
    if (!change.isZero(0.0))
    {
        forces.multiply(change, {1.0, 0.0, 0.0}, image);
        force -= image;
    }
}

} // namespace cellwarp::core
