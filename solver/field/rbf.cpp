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
#include <array>
#include <cmath>
#include <numeric>
#include <tuple>

#include <lapacke.h>

#include "octree/base/index.h"
#include "octree/base/parallel.h"
#include "solver/linear/dense_kernels.h"

namespace cellwarp::core
{

namespace
{

constexpr int kTerms = RbfField::kTerms;

/// A polynomial term that adds less than this to the ones before it, relative to
/// its size at the centres, is one that the centres do not determine.
constexpr double kMinShare = 1e-8;

/// The same of the quadratic ones, without which the system still has a solution: what
/// the centres hardly determine grows without bound between them and the surface. In a
/// bar two cells thick y y - z z is such a term: all centres lie near its diagonals.
constexpr double kMinQuadraticShare = 1e-2;

/// The size that a term has at least, relative to the extent of the centres to its
/// degree: in a row of cells y z is nothing but rounding, however much of itself that is.
constexpr double kMinSize = 1e-4;

/// From this many centres on the library's blocked kernels win, and work on all threads.
constexpr std::size_t kLapackFrom = 1000;

/// Solutions that miss by no more than this, relative to the largest displacement, need
/// no other pass; and how many passes there are at the most.
constexpr double kMended = 1e-12;
constexpr int kPasses = 4;

/// Centres closer than this, relative to their extent, are one.
constexpr double kSameCentre = 1e-9;

const RbfKernels& widest_kernels()
{
    static const RbfKernels kernels = rbf_kernels(instruction_sets().back());
    return kernels;
}

Eigen::Matrix<double, kTerms, 1> basis(const Eigen::Vector3d& x)
{
    Eigen::Matrix<double, kTerms, 1> b;
    b << 1, x.x(), x.y(), x.z(), x.x() * x.x(), x.y() * x.y(), x.z() * x.z(),
        x.x() * x.y(), x.y() * x.z(), x.z() * x.x();
    return b;
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

std::size_t padded(std::size_t count)
{
    return (count + kCentreLanes - 1) / kCentreLanes * kCentreLanes;
}

} // namespace

double RbfSystem::memory_estimate(std::size_t num_centres)
{
    const double n = static_cast<double>(num_centres);
    return 8.0 * n * (n + 40.0);
}

std::size_t RbfSystem::num_bytes() const
{
    const Eigen::Index numbers = centres_.size() + Q_.size() + R_.size() + dense_.size();
    return sizeof(*this) + sizeof(double) * (idx(numbers) + packed_.size()) +
           sizeof(std::size_t) * kept_.size() + sizeof(int) * terms_.size();
}

RbfSystem::RbfSystem(std::span<const Eigen::Vector3d> centres)
{
    for (const Eigen::Vector3d& c : centres)
        origin_ += c / static_cast<double>(centres.size());
    double extent = 0.0;
    for (const Eigen::Vector3d& c : centres)
        extent = std::max(extent, (c - origin_).norm());
    kept_ = distinct(centres, kSameCentre * extent);
    centres_.setZero(3, static_cast<Eigen::Index>(padded(kept_.size())));
    for (std::size_t i = 0; i < kept_.size(); ++i)
        centres_.col(static_cast<Eigen::Index>(i)) = centres[kept_[i]] - origin_;
    find_polynomial(extent);
    factorise();
}

/// Q R = the terms that are determined, in their order; Gram-Schmidt twice.
void RbfSystem::find_polynomial(double extent)
{
    const Eigen::Index n = static_cast<Eigen::Index>(kept_.size());
    Rows P(kTerms, n);
    for (Eigen::Index i = 0; i < n; ++i)
        P.col(i) = basis(centres_.col(i));
    Q_.setZero(kTerms, centres_.cols());
    R_ = Eigen::MatrixXd::Zero(kTerms, kTerms);
    for (int k = 0; k < kTerms && static_cast<Eigen::Index>(terms_.size()) < n; ++k)
    {
        Eigen::RowVectorXd row = P.row(k);
        const int degree = k == 0 ? 0 : k < 4 ? 1 : 2;
        const double size =
            std::max(row.norm(), kMinSize * std::sqrt(n) * std::pow(extent, degree));
        const Eigen::Index rank = static_cast<Eigen::Index>(terms_.size());
        const auto Q = Q_.topLeftCorner(rank, n);
        Eigen::VectorXd along = Eigen::VectorXd::Zero(rank);
        for (int pass = 0; pass < 2; ++pass)
        {
            const Eigen::VectorXd part = Q * row.transpose();
            row -= part.transpose() * Q;
            along += part;
        }
        if (!(row.norm() > (degree == 2 ? kMinQuadraticShare : kMinShare) * size))
            continue;
        R_.col(rank).head(rank) = along;
        R_(rank, rank) = row.norm();
        Q_.row(rank).head(n) = row / row.norm();
        terms_.push_back(k);
    }
}

RbfSystem::Rows RbfSystem::products(const Rows& weights) const
{
    Rows out(weights.rows(), weights.cols());
    RbfProducts all;
    all.centres = centres_.data();
    all.num_centres = kept_.size();
    all.num_padded = idx(centres_.cols());
    all.weights = weights.data();
    all.out = out.data();
    parallel_ranges(all.num_padded / kCentreLanes, 64,
                    [&](std::size_t begin, std::size_t end)
                    {
                        RbfProducts some = all;
                        some.first = begin * kCentreLanes;
                        some.end = end * kCentreLanes;
                        widest_kernels().products(some, idx(weights.rows()));
                    });
    out.rightCols(out.cols() - static_cast<Eigen::Index>(kept_.size())).setZero();
    return out;
}

/// The padding gets ones on the diagonal.
void RbfSystem::factorise()
{
    const std::size_t n = kept_.size(), size = padded(n);
    const Rows B = products(Q_);
    // A's sum, from A times the first term, which is constant.
    const double t = n > 1 ? B.row(0).sum() / std::sqrt(static_cast<double>(n)) : 1.0;
    // Z A Z + t Q Q^T = A + L Q^T + Q L^T.
    const Eigen::MatrixXd middle =
        0.5 * (Q_ * B.transpose() + t * Eigen::MatrixXd::Identity(kTerms, kTerms));
    const Rows left = 0.5 * (middle + middle.transpose()) * Q_ - B;
    RbfColumns columns;
    columns.centres = centres_.data();
    columns.num_padded = size;
    columns.left = left.data();
    columns.right = Q_.data();
    if (n >= kLapackFrom)
    {
        dense_.setZero(static_cast<Eigen::Index>(size), static_cast<Eigen::Index>(size));
        parallel_for(size / kCentreLanes,
                     [&](std::size_t block)
                     {
                         RbfColumns some = columns;
                         some.first = block * kCentreLanes;
                         some.end = std::min(n, some.first + kCentreLanes);
                         some.stride = size;
                         some.out = dense_.data() + some.first * (size + 1);
                         widest_kernels().columns(some);
                     });
        const OneDenseThread one_thread;
        const lapack_int order = static_cast<lapack_int>(n);
        is_factored_ = LAPACKE_dpotrf(LAPACK_COL_MAJOR, 'L', order, dense_.data(),
                                      static_cast<lapack_int>(size)) == 0;
        return;
    }
    packed_.resize(packed_entries(size));
    for (std::size_t first = 0; first < size; first += kCentreLanes)
    {
        columns.first = first;
        columns.end = first + kCentreLanes;
        columns.stride = size - first;
        columns.out = packed_.data() + packed_column(size, first) + first;
        widest_kernels().columns(columns);
        for (std::size_t c = first; c < columns.end; ++c)
        {
            double* const column = packed_.data() + packed_column(size, c);
            std::fill(column + (c < n ? std::max(n, first) : first), column + size, 0.0);
            if (c >= n)
                column[c] = 1.0;
        }
    }
    is_factored_ = widest_kernels().factorise(packed_.data(), size);
}

void RbfSystem::solve(Rows& b) const
{
    if (dense_.size() == 0)
    {
        widest_kernels().solve(packed_.data(), idx(b.cols()), b.data());
        return;
    }
    const Eigen::Index n = static_cast<Eigen::Index>(kept_.size());
    const auto lower = dense_.topLeftCorner(n, n).triangularView<Eigen::Lower>();
    Eigen::MatrixXd columns = b.leftCols(n).transpose();
    lower.solveInPlace(columns);
    lower.transpose().solveInPlace(columns);
    b.leftCols(n) = columns.transpose();
}

RbfSystem::Fit RbfSystem::fit(std::span<const Eigen::Vector3d> displacements) const
{
    const Eigen::Index n = static_cast<Eigen::Index>(kept_.size());
    Rows f = Rows::Zero(3, centres_.cols());
    for (Eigen::Index i = 0; i < n; ++i)
        f.col(i) = displacements[kept_[idx(i)]];
    // Solved and mended: close centres cost digits that the next passes find.
    Rows w = Rows::Zero(3, centres_.cols()), Aw = w;
    for (int pass = 0; pass < kPasses && is_factored_; ++pass)
    {
        const Rows missing = f - Aw;
        Rows step = missing - (missing * Q_.transpose()) * Q_;
        if (pass > 0 && step.cwiseAbs().maxCoeff() <= kMended * f.cwiseAbs().maxCoeff())
            break;
        solve(step);
        w += step - (step * Q_.transpose()) * Q_;
        Aw = products(w);
    }
    RbfField::Terms terms;
    terms.origin = origin_;
    terms.centres.resize(6, n);
    terms.centres << centres_.leftCols(n), w.leftCols(n);
    const Eigen::Index rank = static_cast<Eigen::Index>(terms_.size());
    const Eigen::MatrixXd coefficients =
        R_.topLeftCorner(rank, rank)
            .triangularView<Eigen::Upper>()
            .solve(Q_.topRows(rank) * (f - Aw).transpose());
    terms.polynomial.setZero();
    for (Eigen::Index k = 0; k < rank; ++k)
        terms.polynomial.col(terms_[idx(k)]) = coefficients.row(k).transpose();
    double residual = 0.0;
    for (Eigen::Index i = 0; i < n; ++i)
        residual = std::max(
            residual,
            (Aw.col(i) + terms.polynomial * basis(centres_.col(i)) - f.col(i)).norm());
    return {RbfField(std::move(terms)), residual};
}

namespace
{

/// The terms of a quadratic at each place.
std::array<PlaceNumbers, kTerms> bases(const PlaceVectors& u)
{
    const PlaceNumbers x = u.col(0), y = u.col(1), z = u.col(2);
    return {PlaceNumbers::Ones(), x, y, z, x * x, y * y, z * z, x * y, y * z, z * x};
}

/// Their derivatives along each axis.
std::array<std::array<PlaceNumbers, kTerms>, 3> base_slopes(const PlaceVectors& u)
{
    const PlaceNumbers x = u.col(0), y = u.col(1), z = u.col(2),
                       zero = PlaceNumbers::Zero(), one = PlaceNumbers::Ones();
    return {{{zero, one, zero, zero, 2 * x, zero, zero, y, zero, z},
             {zero, zero, one, zero, zero, 2 * y, zero, x, z, zero},
             {zero, zero, zero, one, zero, zero, 2 * z, zero, y, x}}};
}

void add_polynomial(const Eigen::Matrix<double, 3, kTerms>& coefficients,
                    const std::array<PlaceNumbers, kTerms>& bases, PlaceVectors& out)
{
    for (int k = 0; k < 3; ++k)
        for (int term = 0; term < kTerms; ++term)
            out.col(k) += coefficients(k, term) * bases[idx(term)];
}

} // namespace

void RbfField::displacement(const PlaceVectors& places, PlaceVectors& out) const
{
    const PlaceVectors u = places.rowwise() - terms_.origin.transpose().array();
    widest_kernels().displacement({terms_.centres.data(), idx(terms_.centres.cols()),
                                   u.data(), out.data(), nullptr});
    add_polynomial(terms_.polynomial, bases(u), out);
}

void RbfField::value(const PlaceVectors& places, ValueOnPlaces& out) const
{
    const PlaceVectors u = places.rowwise() - terms_.origin.transpose().array();
    Eigen::Array<double, kPlaces, 9> slopes;
    widest_kernels().value({terms_.centres.data(), idx(terms_.centres.cols()), u.data(),
                            out.displacement.data(), slopes.data()});
    add_polynomial(terms_.polynomial, bases(u), out.displacement);
    const auto more = base_slopes(u);
    for (int axis = 0; axis < 3; ++axis)
    {
        PlaceVectors& along = out.slopes[idx(axis)];
        along = slopes.middleCols<3>(3 * axis);
        add_polynomial(terms_.polynomial, more[idx(axis)], along);
    }
}

FieldValue RbfField::value(const Eigen::Vector3d& x) const
{
    ValueOnPlaces all;
    value(everywhere(x), all);
    return all.at(0);
}

} // namespace cellwarp::core
