// SPDX-License-Identifier: GPL-3.0-or-later
// Flesh by regions of small strain: each sees the body from a frame that turns with its
// bone, in which its matrix never changes; the regions' steps are blended. [Capell02]
// blended_regions.cpp has the formulas.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/base/rigid_motion.h"
#include "solver/flesh/bone_tube.h"
#include "solver/flesh/bound_nodes.h"
#include "solver/flesh/lattice.h"

namespace cellwarp::core
{

/// Which part each node has in a region.
struct FleshRegionShares
{
    int motion = 0; ///< that the region's frame turns with
    /// Of nodes that do not hang; > 0. Over all regions those of a node sum to 1.
    NodeShares shares;
};

/// A region a bone: shares fall with what a node is farther from a bone than from the
/// nearest one, (1 - (D_i - min D) / reach)^2 as long as that is positive, normalised.
/// \p distances: of each bone, from it to every node [m]; \p motions: of the bones;
/// \p reach [m]. [theory-skeleton 7]
std::vector<FleshRegionShares>
shares_by_distance(const Lattice& lattice, std::span<const std::vector<double>> distances,
                   std::span<const int> motions, double reach);

/// Factorises a matrix for each region once for a length of the step.
class BlendedRegions
{
public:
    /// \p nodes must outlive it. Throws std::invalid_argument where the shares
    /// of a node do not sum to 1.
    BlendedRegions(const Lattice& lattice, const BoundNodes& nodes,
                   std::span<const FleshMaterial> materials,
                   std::span<const TubePart> tubes,
                   std::vector<FleshRegionShares> regions, double alpha, double beta);
    ~BlendedRegions();
    BlendedRegions(BlendedRegions&&) noexcept;

    bool is_prepared(double dt) const { return dt == dt_; }
    /// Factorises where \p dt [s] is another than before. False: a matrix has no factor.
    [[nodiscard]] bool prepare(double dt);

    /// Factors of the same flesh in another lattice, which is not used any more: those of
    /// regions that the change has not touched need not be made again by prepare().
    void take_factors(BlendedRegions& of);
    std::size_t num_taken() const; ///< regions whose factor was

    /// What happens outside of the material in a step, of all nodes.
    struct Outside
    {
        const Eigen::VectorXd& loads; ///< [N]
        Eigen::Vector3d gravity;      ///< [m/s^2]
        std::span<const Motion> motions;
        const Eigen::VectorXd& held; ///< changes of the held points' velocities
    };
    /// The change of the velocities of the free nodes in the step, blended. \p predicted:
    /// displacements u + h v; \p v: velocities.
    void step(const Eigen::VectorXd& predicted, const Eigen::VectorXd& v,
              const Outside& outside, Eigen::VectorXd& free_change) const;

    std::size_t size() const;
    /// Of all factors: memory is 8 bytes each.
    double factor_numbers() const;

private:
    struct Region;
    const BoundNodes& nodes_;
    double alpha_, beta_, dt_ = -1.0;
    std::vector<std::unique_ptr<Region>> regions_, spares_;
};

} // namespace cellwarp::core
