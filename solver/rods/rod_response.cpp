// SPDX-License-Identifier: GPL-3.0-or-later
// Most rows hold a place: they are n b_k for control point k, and the mass is three times
// the same matrix. Then M^-1 L^T is n (M_1^-1 b)_k, and the rows of one place, which
// differ in n alone, share that.
#include "solver/rods/rod_response.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/QR>

namespace cellwarp::core
{

namespace
{

/// n and b of a row n b_k, b by the control points in ascending order of their unknowns.
struct OfPlace
{
    Eigen::Vector3d n;
    Eigen::VectorXd b;
};

std::optional<OfPlace> of_place(const SparseRow& row, const std::vector<int>& first)
{
    constexpr double kSame = 1e-14;
    Eigen::MatrixX3d entries =
        Eigen::MatrixX3d::Zero(static_cast<Eigen::Index>(first.size()), 3);
    for (const auto& [unknown, value] : row)
    {
        const auto next = std::upper_bound(first.begin(), first.end(), unknown);
        const Eigen::Index k = next - first.begin() - 1;
        if (k < 0 || unknown > first[static_cast<std::size_t>(k)] + 2)
            return std::nullopt; // an angle
        entries(k, unknown - first[static_cast<std::size_t>(k)]) = value;
    }
    Eigen::Index largest = 0;
    const double norm = std::sqrt(entries.rowwise().squaredNorm().maxCoeff(&largest));
    if (!(norm > 0.0))
        return std::nullopt;
    OfPlace out;
    out.n = entries.row(largest).transpose() / norm;
    out.b = entries * out.n;
    if ((entries - out.b * out.n.transpose()).cwiseAbs().maxCoeff() > kSame * norm)
        return std::nullopt;
    return out;
}

} // namespace

RodResponse::RodResponse(const RodModel& model, const RodModel::Rows& of, int most_dense)
    : rows_(of.rows), num_unknowns_(model.rod().layout().num_unknowns)
{
    const Eigen::Index k = static_cast<Eigen::Index>(rows_.size());
    const RodLayout& layout = model.rod().layout();
    if (k == 0)
    {
        moved_.setZero(num_unknowns_, 0);
        return;
    }
    if (k > most_dense)
    {
        BandMatrix M(layout.num_unknowns, layout.half_band);
        model.mass().add_to(M, 1.0);
        band_ = std::make_unique<SaddleSolver>();
        if (band_->factorize(M, rows_, of.groups).num_dropped == 0)
            return;
        // Rows that say nothing new are met by least squares together with the others.
        band_.reset();
    }
    find_moved(model);
    Eigen::MatrixXd S(k, k);
    for (Eigen::Index c = 0; c < k; ++c)
        S.col(c) = along(moved_.col(c));
    constexpr double kRedundant = 1e-10;
    factor_.compute(S);
    const Eigen::VectorXd pivots = factor_.vectorD();
    if (pivots.minCoeff() > kRedundant * pivots.maxCoeff())
        return;
    Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> decomposition;
    decomposition.setThreshold(kRedundant);
    decomposition.compute(S);
    is_redundant_ = decomposition.rank() < k;
    inverse_ = decomposition.pseudoInverse();
}

void RodResponse::find_moved(const RodModel& model)
{
    constexpr double kSame = 1e-13;
    const std::vector<int>& first = model.mass().first_unknowns();
    moved_.setZero(num_unknowns_, static_cast<Eigen::Index>(rows_.size()));
    Eigen::VectorXd last, solved;
    for (std::size_t r = 0; r < rows_.size(); ++r)
    {
        const Eigen::Index row = static_cast<Eigen::Index>(r);
        const std::optional<OfPlace> held = of_place(rows_[r], first);
        if (!held)
        {
            Eigen::VectorXd column = Eigen::VectorXd::Zero(num_unknowns_);
            for (const auto& [unknown, value] : rows_[r])
                column[unknown] = value;
            moved_.col(row) = model.mass().solved(column);
            continue;
        }
        if (last.size() == 0 || (last - held->b).cwiseAbs().maxCoeff() >
                                    kSame * held->b.cwiseAbs().maxCoeff())
        {
            last = solved = held->b;
            model.mass().solve_one(solved);
        }
        for (std::size_t k = 0; k < first.size(); ++k)
            moved_.col(row).segment<3>(first[k]) =
                solved[static_cast<Eigen::Index>(k)] * held->n;
    }
}

Eigen::VectorXd RodResponse::along(const Eigen::VectorXd& v) const
{
    Eigen::VectorXd out(static_cast<Eigen::Index>(rows_.size()));
    for (std::size_t r = 0; r < rows_.size(); ++r)
    {
        double sum = 0.0;
        for (const auto& [unknown, value] : rows_[r])
            sum += value * v[unknown];
        out[static_cast<Eigen::Index>(r)] = sum;
    }
    return out;
}

Eigen::VectorXd RodResponse::forces(const Eigen::VectorXd& wanted) const
{
    if (rows_.empty())
        return wanted;
    if (band_)
    {
        Eigen::VectorXd x = Eigen::VectorXd::Zero(num_unknowns_), g = -wanted;
        band_->solve(x, g);
        return g;
    }
    if (inverse_.size() > 0)
        return inverse_ * wanted;
    return factor_.solve(wanted);
}

Eigen::VectorXd RodResponse::change(const Eigen::VectorXd& wanted) const
{
    if (!band_)
        return moved_ * forces(wanted);
    Eigen::VectorXd x = Eigen::VectorXd::Zero(num_unknowns_), g = -wanted;
    band_->solve(x, g);
    return x;
}

} // namespace cellwarp::core
