// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/rods/rod_response.h"

#include <Eigen/QR>

namespace cellwarp
{

RodResponse::RodResponse(const RodModel& model, const RodModel::Rows& of, int most_dense)
    : rows_(of.rows), num_unknowns_(model.rod().layout().num_unknowns)
{
    const Eigen::Index k = static_cast<Eigen::Index>(rows_.size());
    const RodLayout& layout = model.rod().layout();
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
    moved_.setZero(layout.num_unknowns, k);
    for (Eigen::Index r = 0; r < k; ++r)
    {
        Eigen::VectorXd column = Eigen::VectorXd::Zero(layout.num_unknowns);
        for (const auto& [unknown, value] : rows_[idx(r)])
            column[unknown] = value;
        moved_.col(r) = model.mass().solved(column);
    }
    Eigen::MatrixXd S(k, k);
    for (Eigen::Index c = 0; c < k; ++c)
        S.col(c) = along(moved_.col(c));
    Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> decomposition;
    decomposition.setThreshold(1e-10);
    decomposition.compute(S);
    is_redundant_ = decomposition.rank() < k;
    inverse_ = decomposition.pseudoInverse();
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

Eigen::VectorXd RodResponse::change(const Eigen::VectorXd& wanted) const
{
    if (!band_)
    {
        const Eigen::VectorXd force = inverse_ * wanted;
        return moved_ * force;
    }
    Eigen::VectorXd x = Eigen::VectorXd::Zero(num_unknowns_), g = -wanted;
    band_->solve(x, g);
    return x;
}

} // namespace cellwarp
