// SPDX-License-Identifier: GPL-3.0-or-later
// Triharmonic radial basis functions: the smoothest map that takes every centre
// where it goes.
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "solver/field/blend.h"
#include "solver/field/rbf_kernel.h"

namespace cellwarp
{

/// d(x) = sum_j w_j |x - c_j|^3 + q(x), q quadratic, with sum_j w_j p(c_j) = 0 for
/// every quadratic p. [Botsch05], [Botsch07] Where the centres do not determine q
/// (few, coplanar or collinear ones) it keeps the terms that they do, lowest first.
/// Immutable. Dense: 8 n^2 bytes and n^3 / 3 operations to build for n centres.
class RbfField
{
public:
    /// Centres that coincide must have one displacement; they are merged.
    /// \pre equal, positive counts
    RbfField(std::span<const Eigen::Vector3d> centres,
             std::span<const Eigen::Vector3d> displacements);

    FieldValue value(const Eigen::Vector3d& x) const;
    /// The displacement alone: faster.
    Eigen::Vector3d displacement(const Eigen::Vector3d& x) const;

    std::size_t num_centres() const { return static_cast<std::size_t>(num_centres_); }
    /// Largest distance between a displacement given and the one reached.
    double residual() const { return residual_; }

    /// What building needs, beforehand [bytes].
    static double memory_estimate(std::size_t num_centres);

private:
    static constexpr int kTerms = 10;
    using Basis = Eigen::Matrix<double, kTerms, 1>;
    static Basis basis(const Eigen::Vector3d& x);
    RbfRun run_at(const Eigen::Vector3d& u) const;

    Eigen::Index num_centres_ = 0;
    Eigen::Vector3d origin_; ///< mean of the centres
    /// Centres and weights as RbfRun wants them, padded.
    Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::RowMajor> rows_;
    Eigen::Matrix<double, 3, kTerms> polynomial_;
    double residual_ = 0.0;
};

} // namespace cellwarp
