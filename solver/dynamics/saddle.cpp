// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/dynamics/saddle.h"

#include <algorithm>
#include <cmath>

#include <Eigen/QR>

namespace cellwarp
{

namespace
{

/// Rows that reach over more bands than this are no part of it.
constexpr int kFar = 3;

} // namespace

void SaddleSolver::arrange(const BandMatrix& A, std::span<const SparseRow> rows,
                           std::span<const int> groups)
{
    far_rows_.clear();
    // Behind which unknown each row stands.
    std::vector<std::pair<int, int>> behind;
    std::size_t first = 0;
    for (const int count : groups)
    {
        int low = num_unknowns_, high = 0;
        for (std::size_t r = first; r < first + idx(count); ++r)
            if (!rows[r].empty())
            {
                low = std::min(low, rows[r].front().first);
                high = std::max(high, rows[r].back().first);
            }
        for (std::size_t r = first; r < first + idx(count); ++r)
        {
            if (rows[r].empty() || high - low > kFar * A.half_band())
                far_rows_.push_back(static_cast<int>(r));
            else
                behind.emplace_back(high, static_cast<int>(r));
        }
        first += idx(count);
    }
    std::sort(behind.begin(), behind.end());
    place_of_unknown_.resize(idx(num_unknowns_));
    is_row_.clear();
    std::size_t next = 0;
    for (int u = 0; u < num_unknowns_; ++u)
    {
        place_of_unknown_[idx(u)] = static_cast<int>(is_row_.size());
        is_row_.push_back(0);
        for (; next < behind.size() && behind[next].first == u; ++next)
        {
            place_of_row_[idx(behind[next].second)] = static_cast<int>(is_row_.size());
            is_row_.push_back(1);
        }
    }
    int half_band = 0;
    for (int u = 0; u < num_unknowns_; ++u)
        half_band = std::max(
            half_band,
            place_of_unknown_[idx(std::min(u + A.half_band(), num_unknowns_ - 1))] -
                place_of_unknown_[idx(u)]);
    for (std::size_t r = 0; r < rows.size(); ++r)
        if (place_of_row_[r] >= 0)
            half_band =
                std::max(half_band, place_of_row_[r] -
                                        place_of_unknown_[idx(rows[r].front().first)]);
    const int count = static_cast<int>(is_row_.size());
    if (matrix_.rows() != count || matrix_.half_band() != half_band)
        matrix_ = BandMatrix(count, half_band);
    else
        matrix_.set_zero();
}

SaddleSolver::Report SaddleSolver::factorize(const BandMatrix& A,
                                             std::span<const SparseRow> rows,
                                             std::span<const int> groups)
{
    place_of_row_.assign(rows.size(), -1);
    far_.clear();
    num_unknowns_ = A.rows();
    if (rows.empty())
    {
        const BandFactor::Report told = factor_.factorize(A);
        return {told.is_finite, told.num_negative, told.num_dropped};
    }
    arrange(A, rows, groups);
    for (int j = 0; j < num_unknowns_; ++j)
    {
        const std::span<const double> column = A.column(j);
        const int at = place_of_unknown_[idx(j)];
        const int count = std::min(A.half_band(), num_unknowns_ - 1 - j);
        for (int i = 0; i <= count; ++i)
            matrix_.lower(place_of_unknown_[idx(j + i)], at) = column[idx(i)];
    }
    near_.assign(rows.size(), {});
    rho_.assign(rows.size(), 0.0);
    for (std::size_t r = 0; r < rows.size(); ++r)
    {
        if (place_of_row_[r] < 0)
            continue;
        double stiffness = 0.0, largest = 0.0;
        for (const auto& [unknown, value] : rows[r])
        {
            near_[r].emplace_back(place_of_unknown_[idx(unknown)], value);
            matrix_.add(place_of_row_[r], near_[r].back().first, -value);
            stiffness = std::max(stiffness, std::abs(A.lower(unknown, unknown)));
            largest = std::max(largest, std::abs(value));
        }
        rho_[r] = largest > 0.0 ? stiffness / (largest * largest) : 0.0;
    }
    for (std::size_t r = 0; r < rows.size(); ++r)
        for (std::size_t i = 0; i < near_[r].size(); ++i)
            for (std::size_t j = 0; j <= i; ++j)
                matrix_.lower(near_[r][i].first, near_[r][j].first) +=
                    rho_[r] * near_[r][i].second * near_[r][j].second;
    const BandFactor::Report told = factor_.factorize(matrix_, is_row_);
    Report report{told.is_finite, told.num_negative, told.num_dropped};
    if (far_rows_.empty() || !report.is_finite)
        return report;
    // [K -F^T; -F 0]: F K^-1 F^T mu = - g - F K^-1 r
    const int num_far = static_cast<int>(far_rows_.size());
    far_solved_.setZero(matrix_.rows(), num_far);
    for (int k = 0; k < num_far; ++k)
    {
        SparseRow row;
        for (const auto& [unknown, value] : rows[idx(far_rows_[idx(k)])])
        {
            row.emplace_back(place_of_unknown_[idx(unknown)], value);
            far_solved_(row.back().first, k) = value;
        }
        far_.push_back(std::move(row));
        factor_.solve(far_solved_.col(k));
    }
    Eigen::MatrixXd S(num_far, num_far);
    for (int i = 0; i < num_far; ++i)
        for (int j = 0; j < num_far; ++j)
        {
            double sum = 0.0;
            for (const auto& [place, value] : far_[idx(i)])
                sum += value * far_solved_(place, j);
            S(i, j) = sum;
        }
    // Redundant rows share what there is: the least multipliers.
    Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> decomposition;
    decomposition.setThreshold(1e-10);
    decomposition.compute(S);
    report.num_dropped += num_far - static_cast<int>(decomposition.rank());
    far_inverse_ = decomposition.pseudoInverse();
    return report;
}

void SaddleSolver::solve(Eigen::VectorXd& r, Eigen::VectorXd& g) const
{
    if (place_of_row_.empty())
    {
        factor_.solve(r);
        return;
    }
    all_.setZero(matrix_.rows());
    for (int u = 0; u < num_unknowns_; ++u)
        all_[place_of_unknown_[idx(u)]] = r[u];
    for (std::size_t k = 0; k < place_of_row_.size(); ++k)
        if (place_of_row_[k] >= 0)
        {
            const double violation = g[static_cast<Eigen::Index>(k)];
            all_[place_of_row_[k]] = violation;
            for (const auto& [place, value] : near_[k])
                all_[place] -= rho_[k] * value * violation;
        }
    factor_.solve(all_);
    if (!far_.empty())
    {
        Eigen::VectorXd right(static_cast<Eigen::Index>(far_.size()));
        for (std::size_t k = 0; k < far_.size(); ++k)
        {
            double sum = -g[far_rows_[k]];
            for (const auto& [place, value] : far_[k])
                sum -= value * all_[place];
            right[static_cast<Eigen::Index>(k)] = sum;
        }
        const Eigen::VectorXd mu = far_inverse_ * right;
        all_ += far_solved_ * mu;
        for (std::size_t k = 0; k < far_.size(); ++k)
            g[far_rows_[k]] = mu[static_cast<Eigen::Index>(k)];
    }
    for (int u = 0; u < num_unknowns_; ++u)
        r[u] = all_[place_of_unknown_[idx(u)]];
    for (std::size_t k = 0; k < place_of_row_.size(); ++k)
        if (place_of_row_[k] >= 0)
            g[static_cast<Eigen::Index>(k)] = all_[place_of_row_[k]];
}

} // namespace cellwarp
