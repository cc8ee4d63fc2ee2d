// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/dynamics/saddle.h"

#include <algorithm>
#include <cmath>

#include <Eigen/QR>

namespace cellwarp::core
{

namespace
{

/// Rows that reach over more bands than this are no part of it.
constexpr int kFar = 3;

} // namespace

void sort_and_add_up(SparseRow& row)
{
    const auto is_before = [](const auto& a, const auto& b) { return a.first < b.first; };
    if (!std::is_sorted(row.begin(), row.end(), is_before))
        std::stable_sort(row.begin(), row.end(), is_before);
    std::size_t count = 0;
    for (const auto& [unknown, value] : row)
    {
        if (count > 0 && row[count - 1].first == unknown)
            row[count - 1].second += value;
        else
            row[count++] = {unknown, value};
    }
    row.resize(count);
}

void SaddleSolver::arrange(const BandMatrix& A, std::span<const SparseRow> rows,
                           std::span<const int> groups,
                           std::span<const SingleUnknown> singles)
{
    const int in_band = A.rows();
    far_rows_.clear();
    // Behind which unknown of the band each single unknown and each row stands, the
    // unknowns first.
    struct Behind
    {
        int unknown;
        bool is_row;
        int number;
        auto operator<=>(const Behind&) const = default;
    };
    std::vector<Behind> behind;
    for (std::size_t k = 0; k < singles.size(); ++k)
        behind.push_back({singles[k].behind, false, in_band + static_cast<int>(k)});
    std::size_t first = 0;
    for (const int count : groups)
    {
        int low = num_unknowns_, high = 0;
        for (std::size_t r = first; r < first + idx(count); ++r)
            for (const auto& [unknown, value] : rows[r])
            {
                const bool is_single = unknown >= in_band;
                low = std::min(low, is_single ? singles[idx(unknown - in_band)].from
                                              : unknown);
                high = std::max(high, is_single ? singles[idx(unknown - in_band)].behind
                                                : unknown);
            }
        for (std::size_t r = first; r < first + idx(count); ++r)
        {
            if (rows[r].empty() || high - low > kFar * A.half_band())
                far_rows_.push_back(static_cast<int>(r));
            else
                behind.push_back({high, true, static_cast<int>(r)});
        }
        first += idx(count);
    }
    std::sort(behind.begin(), behind.end());
    place_of_unknown_.resize(idx(num_unknowns_));
    is_row_.clear();
    std::size_t next = 0;
    for (int u = 0; u < in_band; ++u)
    {
        place_of_unknown_[idx(u)] = static_cast<int>(is_row_.size());
        is_row_.push_back(0);
        for (; next < behind.size() && behind[next].unknown == u; ++next)
        {
            const auto& [unknown, is_row, number] = behind[next];
            (is_row ? place_of_row_ : place_of_unknown_)[idx(number)] =
                static_cast<int>(is_row_.size());
            is_row_.push_back(is_row);
        }
    }
    int half_band = 0;
    const auto reach = [&](int place, int other)
    { half_band = std::max(half_band, std::abs(place - other)); };
    for (int u = 0; u < in_band; ++u)
        reach(place_of_unknown_[idx(u)],
              place_of_unknown_[idx(std::min(u + A.half_band(), in_band - 1))]);
    for (std::size_t k = 0; k < singles.size(); ++k)
        for (const auto& [unknown, value] : singles[k].column)
            reach(place_of_unknown_[idx(in_band) + k], place_of_unknown_[idx(unknown)]);
    // A row couples what it touches, too.
    for (std::size_t r = 0; r < rows.size(); ++r)
        if (place_of_row_[r] >= 0)
            for (const auto& [unknown, value] : rows[r])
                reach(place_of_row_[r], place_of_unknown_[idx(unknown)]);
    const int count = static_cast<int>(is_row_.size());
    if (matrix_.rows() != count || matrix_.half_band() != half_band)
        matrix_ = BandMatrix(count, half_band);
    else
        matrix_.set_zero();
}

SaddleSolver::Report SaddleSolver::factorize(const BandMatrix& A,
                                             std::span<const SparseRow> rows,
                                             std::span<const int> groups,
                                             std::span<const SingleUnknown> singles)
{
    const int in_band = A.rows();
    place_of_row_.assign(rows.size(), -1);
    far_.clear();
    num_unknowns_ = in_band + static_cast<int>(singles.size());
    is_plain_ = rows.empty() && singles.empty();
    if (is_plain_)
    {
        const BandFactor::Report told = factor_.factorize(A);
        return {told.is_finite, told.num_negative, told.num_dropped};
    }
    arrange(A, rows, groups, singles);
    for (int j = 0; j < in_band; ++j)
    {
        const std::span<const double> column = A.column(j);
        const int at = place_of_unknown_[idx(j)];
        const int count = std::min(A.half_band(), in_band - 1 - j);
        for (int i = 0; i <= count; ++i)
            matrix_.lower(place_of_unknown_[idx(j + i)], at) = column[idx(i)];
    }
    for (std::size_t k = 0; k < singles.size(); ++k)
    {
        const int at = place_of_unknown_[idx(in_band) + k];
        matrix_.lower(at, at) = singles[k].diagonal;
        for (const auto& [unknown, value] : singles[k].column)
            matrix_.add(at, place_of_unknown_[idx(unknown)], value);
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
            if (unknown >= in_band)
                continue;
            stiffness = std::max(stiffness, std::abs(A.lower(unknown, unknown)));
            largest = std::max(largest, std::abs(value));
        }
        rho_[r] = largest > 0.0 ? stiffness / (largest * largest) : 0.0;
    }
    for (std::size_t r = 0; r < rows.size(); ++r)
        for (std::size_t i = 0; i < near_[r].size(); ++i)
            for (std::size_t j = 0; j <= i; ++j)
                matrix_.add(near_[r][i].first, near_[r][j].first,
                            rho_[r] * near_[r][i].second * near_[r][j].second);
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
    if (is_plain_)
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

} // namespace cellwarp::core
