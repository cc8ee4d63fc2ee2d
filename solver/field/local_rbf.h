// SPDX-License-Identifier: GPL-3.0-or-later
// The release field: small RBFs, one for each group of cells that are near through the
// glue, joined by a partition of unity. As smooth as one RBF through all cells, but
// linear in their number, and parts that only lie side by side don't pull at each other.
// Where a notch opens, cells are near through the glue and in space, and yet go different
// ways: an RBF through both sides would swing between them. There the blend of the
// closest cells, which knows the sides, takes the place of the group's RBF.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "solver/cells/clusters.h"
#include "solver/field/blend.h"
#include "solver/field/centres.h"
#include "solver/field/rbf.h"
#include "solver/field/rbf_systems.h"

namespace cellwarp::core
{

/// F(x) = sum_c W_c phi_c / sum_c W_c with phi_c the RBF of cluster c and
/// W_c(x) = sum_j b_j(x) w_c(j): b_j the influences of the closest cells, w_c(j) how much
/// cell j belongs to the cluster. The cluster kBlended has no RBF: there phi is the blend
/// of the cells. Immutable.
class LocalRbf
{
public:
    using Fits = std::vector<std::shared_ptr<const RbfField>>;

    static constexpr int kBlended = -1;

    /// \p fits: one a cluster, but for kBlended.
    LocalRbf(std::shared_ptr<const Clusters> clusters, Fits fits)
        : clusters_(std::move(clusters)), fits_(std::move(fits))
    {
    }

    /// How much the clusters count at eight places; a scratch object.
    struct Share
    {
        int cluster = 0;
        PlaceNumbers weight = PlaceNumbers::Zero();
        PlaceVectors gradient = PlaceVectors::Zero();
    };
    using Shares = std::vector<Share>;

    /// Of the clusters at places with these influences, of cells that are in clusters.
    /// Ascending by cluster.
    void find_shares(std::span<const InfluenceOnPlaces> influences, bool wants_gradient,
                     Shares& out) const;
    /// Whether the blend is among them.
    static bool has_blend(const Shares& shares)
    {
        return !shares.empty() && shares.front().cluster == kBlended;
    }

    /// \p blended: the blend at the places, if the shares have it.
    void value(const PlaceVectors& places, const Shares& shares,
               const ValueOnPlaces& blended, ValueOnPlaces& out) const;
    /// The displacement alone, to the same bits: faster. The shares need no gradients.
    void displacement(const PlaceVectors& places, const Shares& shares,
                      const ValueOnPlaces& blended, PlaceVectors& out) const;

    const Clusters& clusters() const { return *clusters_; }
    const Fits& fits() const { return fits_; }

private:
    std::shared_ptr<const Clusters> clusters_;
    Fits fits_;
};

/// Pairs of cells side by side that are not glued to each other: pieces of one leaf, and
/// of leaves that have a side, or a part of one, in common. Ascending.
std::vector<std::array<int, 2>> unglued_pairs(const Cells& cells);

/// Fits the RBFs of one set of cells, frame after frame: while the cells stay only
/// displacements change, and a cluster whose own do not keeps its fit.
class LocalRbfFitter
{
public:
    /// Keeps references to \p cells, \p constraints and \p systems: there factors are
    /// found and kept, which is worth it for a second fit, of these cells or of others.
    /// Null: none are.
    LocalRbfFitter(const Cells& cells, std::span<const Constraint> constraints,
                   const ClusterSize& size, RbfSystems* systems);

    /// In parallel over the clusters.
    LocalRbf fit(std::span<const Pose> poses);

    /// Largest distance between a displacement given and the one reached, of the last
    /// fit.
    double residual() const;
    /// How many centres all clusters have, each counted once.
    std::size_t num_centres(std::span<const Pose> poses) const
    {
        return choice_.centres_of_all(poses).points.size();
    }
    /// Clusters that the last fit solved for, and those it factored.
    std::size_t num_solved() const;
    std::size_t num_factored() const;

private:
    struct ClusterFit
    {
        RbfCentres centres;                      ///< fitted last
        std::shared_ptr<const RbfSystem> system; ///< null: not kept
        std::shared_ptr<const RbfField> field;
        double residual = 0.0;
        bool was_solved = false, was_factored = false; ///< in the last fit
    };
    void fit_one(std::size_t cluster, std::span<const Pose> poses);
    /// The clusters, those that are torn having given way to the blend.
    std::shared_ptr<const Clusters> without_torn(std::span<const Pose> poses) const;

    const Cells& cells_;
    CentreChoice choice_;
    std::vector<std::array<int, 2>> unglued_;
    std::vector<std::vector<int>> clusters_of_; ///< of cells in unglued pairs
    RbfSystems* systems_;
    std::shared_ptr<const Clusters> clusters_;
    std::vector<ClusterFit> fits_;
};

} // namespace cellwarp::core
