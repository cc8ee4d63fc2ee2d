// SPDX-License-Identifier: GPL-3.0-or-later
// The release field: small RBFs, one for each group of cells that are near through the
// glue, joined by a partition of unity. As smooth as one RBF through all cells, but
// linear in their number, and parts that only lie side by side don't pull at each other.
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "solver/clusters.h"
#include "solver/field/blend.h"
#include "solver/field/centres.h"
#include "solver/field/rbf.h"

namespace cellwarp
{

/// F(x) = sum_c W_c phi_c / sum_c W_c with phi_c the RBF of cluster c and
/// W_c(x) = sum_j b_j(x) w_c(j): b_j the influences of the closest cells, w_c(j) how much
/// cell j belongs to the cluster. Immutable.
class LocalRbf
{
public:
    /// \p choice and \p clusters are used here only.
    LocalRbf(const CentreChoice& choice, Clusters clusters);

    /// \p influences: of ClosestCells at \p x, of cells that are in clusters.
    FieldValue value(const Eigen::Vector3d& x,
                     std::span<const Influence> influences) const;
    /// The displacement alone: faster.
    Eigen::Vector3d displacement(const Eigen::Vector3d& x,
                                 std::span<const Influence> influences) const;

    const Clusters& clusters() const { return clusters_; }
    /// Largest distance between a displacement given and the one reached.
    double residual() const { return residual_; }

private:
    struct Share
    {
        int cluster = 0;
        double weight = 0.0;
        Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    };
    std::vector<Share> shares(std::span<const Influence> influences) const;

    Clusters clusters_;
    std::vector<RbfField> fits_; ///< one a cluster
    double residual_ = 0.0;
};

} // namespace cellwarp
