// SPDX-License-Identifier: GPL-3.0-or-later
// Triharmonic radial basis functions: the smoothest map that takes every centre
// where it goes.
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>

#include "solver/field/place_lanes.h"
#include "solver/field/rbf_kernel.h"

namespace cellwarp::core
{

/// d(x) = sum_j w_j |x - c_j|^3 + q(x), q quadratic, with sum_j w_j p(c_j) = 0 for
/// every quadratic p. [Botsch05], [Botsch07] Immutable.
class RbfField
{
public:
    static constexpr int kTerms = static_cast<int>(kQuadraticTerms);
    /// What it is made of; a field file keeps just that.
    struct Terms
    {
        Eigen::Vector3d origin = Eigen::Vector3d::Zero();
        /// One column a centre: its place from the origin, then its weight.
        Eigen::Matrix<double, 6, Eigen::Dynamic> centres;
        Eigen::Matrix<double, 3, kTerms> polynomial =
            Eigen::Matrix<double, 3, kTerms>::Zero();
    };

    explicit RbfField(Terms terms) : terms_(std::move(terms)) {}

    /// At eight places; each gets the bits that it would get with any others.
    void displacement(const PlaceVectors& places, PlaceVectors& out) const;
    void value(const PlaceVectors& places, ValueOnPlaces& out) const;
    /// At one.
    FieldValue value(const Eigen::Vector3d& x) const;

    const Terms& terms() const { return terms_; }

private:
    Terms terms_;
};

/// The equations of one set of centres: made and factored once, solved for any
/// displacements. Where the centres do not determine the quadratic (few, coplanar or
/// collinear ones) it keeps the terms that they do, lowest first. Centres that coincide
/// are one. Dense: 4 n^2 bytes (from a thousand on 8 n^2) and n^3 / 3 operations for n
/// centres.
class RbfSystem
{
public:
    /// \pre not empty
    explicit RbfSystem(std::span<const Eigen::Vector3d> centres);

    struct Fit
    {
        RbfField field;
        double residual =
            0.0; ///< largest distance between displacement asked and reached
    };
    /// Of centres that coincide the first one counts. \pre one a centre
    Fit fit(std::span<const Eigen::Vector3d> displacements) const;

    std::size_t num_centres() const { return kept_.size(); }
    /// What it takes of memory.
    std::size_t num_bytes() const;

    /// What building needs, beforehand [byte].
    static double memory_estimate(std::size_t num_centres);

private:
    using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

    void find_polynomial(double extent);
    void factorise();
    void solve(Rows& b) const;
    Rows products(const Rows& weights) const;

    Eigen::Vector3d origin_ = Eigen::Vector3d::Zero(); ///< mean of the centres
    std::vector<std::size_t> kept_;                    ///< of the centres given
    // Rows of one number a centre, padded with zeros.
    Rows centres_;           ///< 3: places from the origin
    Rows Q_;                 ///< kTerms: orthonormal, the undetermined ones 0
    Eigen::MatrixXd R_;      ///< of the terms that are determined
    std::vector<int> terms_; ///< these
    std::vector<double> packed_;
    Eigen::MatrixXd dense_; ///< instead, of a large system
    bool is_factored_ = false;
};

} // namespace cellwarp::core
