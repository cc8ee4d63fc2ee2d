// SPDX-License-Identifier: GPL-3.0-or-later
// With A_ij = |c_i - c_j|^3 and the columns of Q an orthonormal basis of the
// polynomials at the centres, the weights lie in the complement of Q, where A is
// positive definite (|r|^3 is conditionally so of order 2). With Z = I - Q Q^T,
//   (Z A Z + t Q Q^T) w = Z f
// is therefore symmetric positive definite for t > 0 and keeps w in that
// complement; Z A Z is A plus products of rank at most 10. The polynomial takes
// what is left, Q^T (f - A w).
#include "solver/field/rbf.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

#include <Eigen/Cholesky>
#include <lapacke.h>

#include "octree/parallel.h"
#include "solver/linear_solver.h"

namespace cellwarp
{

namespace
{

/// A polynomial term that adds less than this to the ones before it, relative to
/// its size at the centres, is one that the centres do not determine.
constexpr double kMinShare = 1e-8;

/// The size that a term has at least, relative to the extent of the centres to its
/// degree: in a row of cells y z is nothing but rounding, however much of itself that is.
constexpr double kMinSize = 1e-4;

/// From this many centres on the library's blocked kernels win. They work in a buffer
/// of 128 MB for each thread, which small fits in parallel should not take.
constexpr Eigen::Index kLapackFrom = 1000;

/// Centres closer than this, relative to their extent, are one.
constexpr double kSameCentre = 1e-9;

double cube_of_distance(const Eigen::Vector3d& d)
{
    const double squared = d.squaredNorm();
    return squared * std::sqrt(squared);
}

/// The factor of a symmetric positive definite matrix, in its place.
class Cholesky
{
public:
    explicit Cholesky(Eigen::MatrixXd& A) : A_(A)
    {
        const lapack_int n = static_cast<lapack_int>(A.rows());
        if (n < kLapackFrom)
        {
            is_done_ =
                Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>>(A).info() == Eigen::Success;
            return;
        }
        prepare_dense_kernels();
        is_done_ = LAPACKE_dpotrf(LAPACK_COL_MAJOR, 'L', n, A.data(), n) == 0;
    }
    bool is_done() const { return is_done_; }
    /// Replaces \p b, of three columns.
    void solve(Eigen::MatrixXd& b) const
    {
        const auto lower = A_.triangularView<Eigen::Lower>();
        lower.solveInPlace(b);
        lower.transpose().solveInPlace(b);
    }

private:
    const Eigen::MatrixXd& A_;
    bool is_done_ = false;
};

const RbfKernels& widest_kernels()
{
    static const RbfKernels kernels = rbf_kernels(instruction_sets().back());
    return kernels;
}

/// The first centre of every group of coincident ones.
std::vector<std::size_t> distinct(std::span<const Eigen::Vector3d> centres, double same)
{
    std::vector<std::size_t> order(centres.size());
    std::iota(order.begin(), order.end(), std::size_t(0));
    std::sort(order.begin(), order.end(),
              [&](std::size_t a, std::size_t b)
              { return std::tuple(centres[a].x(), a) < std::tuple(centres[b].x(), b); });
    std::vector<bool> is_copy(centres.size(), false);
    for (std::size_t i = 0; i < order.size(); ++i)
        for (std::size_t j = i + 1;
             j < order.size() && centres[order[j]].x() - centres[order[i]].x() <= same;
             ++j)
            if (!is_copy[order[i]] &&
                (centres[order[j]] - centres[order[i]]).norm() <= same)
                is_copy[std::max(order[i], order[j])] = true;
    std::vector<std::size_t> kept;
    for (std::size_t i = 0; i < centres.size(); ++i)
        if (!is_copy[i])
            kept.push_back(i);
    return kept;
}

} // namespace

RbfField::Basis RbfField::basis(const Eigen::Vector3d& x)
{
    Basis b;
    b << 1, x.x(), x.y(), x.z(), x.x() * x.x(), x.y() * x.y(), x.z() * x.z(),
        x.x() * x.y(), x.y() * x.z(), x.z() * x.x();
    return b;
}

double RbfField::memory_estimate(std::size_t num_centres)
{
    const double n = static_cast<double>(num_centres);
    return 8.0 * n * (n + 40.0);
}

RbfField::RbfField(std::span<const Eigen::Vector3d> centres,
                   std::span<const Eigen::Vector3d> displacements)
{
    origin_.setZero();
    for (const Eigen::Vector3d& c : centres)
        origin_ += c / static_cast<double>(centres.size());
    double extent = 0.0;
    for (const Eigen::Vector3d& c : centres)
        extent = std::max(extent, (c - origin_).norm());
    const std::vector<std::size_t> kept = distinct(centres, kSameCentre * extent);
    const Eigen::Index n = static_cast<Eigen::Index>(kept.size());
    num_centres_ = n;
    Eigen::Matrix3Xd centred(3, n);
    Eigen::MatrixXd f(n, 3), P(n, kTerms);
    for (Eigen::Index i = 0; i < n; ++i)
    {
        const std::size_t at = kept[static_cast<std::size_t>(i)];
        centred.col(i) = centres[at] - origin_;
        f.row(i) = displacements[at].transpose();
        P.row(i) = basis(centred.col(i)).transpose();
    }

    // Q R = the terms of P that are determined, in their order; Gram-Schmidt twice.
    Eigen::MatrixXd Q(n, kTerms), R = Eigen::MatrixXd::Zero(kTerms, kTerms);
    std::vector<int> terms;
    for (int k = 0; k < kTerms && static_cast<Eigen::Index>(terms.size()) < n; ++k)
    {
        Eigen::VectorXd column = P.col(k);
        const int degree = k == 0 ? 0 : k < 4 ? 1 : 2;
        const double size =
            std::max(column.norm(), kMinSize * std::sqrt(n) * std::pow(extent, degree));
        const Eigen::Index rank = static_cast<Eigen::Index>(terms.size());
        Eigen::VectorXd along = Eigen::VectorXd::Zero(rank);
        for (int pass = 0; pass < 2; ++pass)
        {
            const Eigen::VectorXd part = Q.leftCols(rank).transpose() * column;
            column -= Q.leftCols(rank) * part;
            along += part;
        }
        if (!(column.norm() > kMinShare * size))
            continue;
        R.col(rank).head(rank) = along;
        R(rank, rank) = column.norm();
        Q.col(rank) = column / column.norm();
        terms.push_back(k);
    }
    const Eigen::Index rank = static_cast<Eigen::Index>(terms.size());
    Q.conservativeResize(n, rank);
    R.conservativeResize(rank, rank);

    Eigen::MatrixXd A(n, n);
    parallel_for(n,
                 [&](Eigen::Index j)
                 {
                     for (Eigen::Index i = 0; i < n; ++i)
                         A(i, j) = cube_of_distance(centred.col(i) - centred.col(j));
                 });
    const Eigen::MatrixXd B = A * Q;
    const double t = n > 1 ? A.cwiseAbs().sum() / static_cast<double>(n) : 1.0;
    const Eigen::MatrixXd middle =
        Q.transpose() * B + t * Eigen::MatrixXd::Identity(rank, rank);
    const Eigen::MatrixXd left = Q * middle - B;
    parallel_for(n, [&](Eigen::Index j)
                 { A.col(j) += left * Q.row(j).transpose() - Q * B.row(j).transpose(); });
    const Cholesky cholesky(A);
    // Solved, and mended once: close centres cost digits that the second pass finds.
    Eigen::MatrixXd w = Eigen::MatrixXd::Zero(n, 3), Aw = w;
    for (int pass = 0; pass < 2 && cholesky.is_done(); ++pass)
    {
        const Eigen::MatrixXd missing = f - Aw;
        Eigen::MatrixXd step = missing - Q * (Q.transpose() * missing);
        cholesky.solve(step);
        w += step - Q * (Q.transpose() * step);
        // The factor stands where A was: its entries once more.
        parallel_for(n,
                     [&](Eigen::Index i)
                     {
                         Eigen::Vector3d sum = Eigen::Vector3d::Zero();
                         for (Eigen::Index j = 0; j < n; ++j)
                             sum += cube_of_distance(centred.col(i) - centred.col(j)) *
                                    w.row(j).transpose();
                         Aw.row(i) = sum.transpose();
                     });
    }
    constexpr Eigen::Index kPad = static_cast<Eigen::Index>(kCentreLanes);
    rows_.setZero(6, (n + kPad - 1) / kPad * kPad);
    rows_.topLeftCorner(3, n) = centred;
    rows_.bottomLeftCorner(3, n) = w.transpose();
    const Eigen::MatrixXd coefficients =
        R.triangularView<Eigen::Upper>().solve(Q.transpose() * (f - Aw));
    polynomial_.setZero();
    for (Eigen::Index k = 0; k < rank; ++k)
        polynomial_.col(terms[static_cast<std::size_t>(k)]) =
            coefficients.row(k).transpose();
    for (Eigen::Index i = 0; i < n; ++i)
    {
        const Eigen::Vector3d reached =
            Aw.row(i).transpose() + polynomial_ * basis(centred.col(i));
        residual_ = std::max(residual_, (reached - f.row(i).transpose()).norm());
    }
}

RbfRun RbfField::run_at(const Eigen::Vector3d& u) const
{
    RbfRun run;
    run.rows = rows_.data();
    run.num_padded = static_cast<std::size_t>(rows_.cols());
    Eigen::Map<Eigen::Vector3d>(run.place) = u;
    return run;
}

Eigen::Vector3d RbfField::displacement(const Eigen::Vector3d& x) const
{
    const Eigen::Vector3d u = x - origin_;
    RbfRun run = run_at(u);
    widest_kernels().displacement(run);
    return polynomial_ * basis(u) + Eigen::Map<const Eigen::Vector3d>(run.displacement);
}

FieldValue RbfField::value(const Eigen::Vector3d& x) const
{
    const Eigen::Vector3d u = x - origin_;
    RbfRun run = run_at(u);
    widest_kernels().value(run);
    FieldValue value;
    value.displacement =
        polynomial_ * basis(u) + Eigen::Map<const Eigen::Vector3d>(run.displacement);
    value.gradient = Eigen::Map<const Eigen::Matrix3d>(run.slopes);
    Eigen::Matrix<double, kTerms, 3> slope = Eigen::Matrix<double, kTerms, 3>::Zero();
    slope(1, 0) = slope(2, 1) = slope(3, 2) = 1.0;
    slope(4, 0) = 2 * u.x();
    slope(5, 1) = 2 * u.y();
    slope(6, 2) = 2 * u.z();
    slope.row(7) << u.y(), u.x(), 0;
    slope.row(8) << 0, u.z(), u.y();
    slope.row(9) << u.z(), 0, u.x();
    value.gradient += polynomial_ * slope;
    return value;
}

} // namespace cellwarp
