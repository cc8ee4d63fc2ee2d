// SPDX-License-Identifier: GPL-3.0-or-later
// What flesh is made of behind flesh.h: for the files of this room alone.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "solver/flesh/flesh.h"
#include "solver/flesh/flesh_forces.h"
#include "solver/flesh/level_preconditioner.h"
#include "solver/flesh/step_rows.h"
#include "solver/linear/conjugate_gradients.h"

namespace cellwarp::core
{

struct Flesh::Parts
{
    Lattice lattice;
    std::vector<FleshMaterial> materials;
    std::vector<HeldPoint> points;
    BoundNodes nodes;
    FleshSettings settings;
    FleshForces forces;
    Eigen::VectorXd weight, loads;           ///< of all nodes [N]
    std::vector<FleshRegionShares> carrying; ///< see Flesh::carry_weight()
    /// Forces that cancel the weight, at the motions of the last find_carried() [N].
    Eigen::VectorXd carried;
    double edge = 0.0, size = 0.0; ///< of the smallest cell, and of all [m]

    /// For one length of the step.
    double prepared_dt = -1.0;
    std::optional<LevelPreconditioner> preconditioner;
    ConjugateGradients cg;
    // Scratch: vectors of all nodes, and of the free ones.
    Eigen::VectorXd predicted, velocity, change, force, image, free_b, free_step;
    Eigen::VectorXd rows; ///< c, of the points

    FleshSurface surface;
    FreeShares free_shares;
    std::optional<BlendedRegions> regions;
    Eigen::VectorXd by_mass; ///< of the regions: of each free node, 1 / its mass [1/kg]

    Parts(Lattice of, std::vector<FleshMaterial> of_what, std::vector<HeldPoint> held,
          std::vector<TubePart> of_tubes, FleshSettings how,
          std::vector<FleshRegionShares> of_regions);

    Eigen::VectorXd all_nodes() const
    {
        return Eigen::VectorXd::Zero(Eigen::Index(3 * lattice.places.size()));
    }
    bool is_of_large_strain() const
    {
        return settings.law == FleshLaw::StVenantKirchhoff ||
               settings.law == FleshLaw::NeoHookean;
    }

    /// Free nodes as given, bound ones by them and the points' \p c, if any.
    void expand(const Eigen::VectorXd& free, const Eigen::VectorXd* c,
                Eigen::VectorXd& all) const;
    /// Forces on free nodes, with what those on bound ones come to.
    void reduce(const Eigen::VectorXd& all, Eigen::VectorXd& free) const;

    Eigen::VectorXd weight_in(const Eigen::Vector3d& gravity) const; ///< of all nodes [N]
    FleshFactors factors(double dt) const
    {
        return {1.0 + dt * settings.alpha, dt * dt + dt * settings.beta, dt * dt};
    }
    void prepare(double dt);
    /// \pre weight is that of the step
    void find_carried(std::span<const Motion> motions);
    Eigen::VectorXd outer_forces() const { return weight + loads + carried; } ///< [N]

    static Eigen::Vector3d displacement_of(const HeldPoint& point,
                                           std::span<const Motion> motions)
    {
        return motions[idx(point.motion)](point.place) - point.place;
    }
    /// Changes of the held points' velocities, such that they end where they should.
    void find_rows(const FleshState& state, double dt, std::span<const Motion> motions);

    // To the velocities after the step.
    FleshReport step_by_rounds(const FleshState& state, double dt,
                               std::span<const Motion> motions,
                               const FleshSurroundings& around);
    FleshReport step_by_regions(const FleshState& state, double dt,
                                std::span<const Motion> motions,
                                const FleshSurroundings& around);
    /// What is left of forces and inertia, times the step, at velocities \p v after it.
    void impulse(const Eigen::VectorXd& u, const Eigen::VectorXd& v0,
                 const Eigen::VectorXd& v, double dt, std::span<const Motion> motions);
};

} // namespace cellwarp::core
