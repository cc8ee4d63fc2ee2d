// SPDX-License-Identifier: GPL-3.0-or-later
// Each row that says nothing new is a sum of others, L_j = sum c_i L_i: what e_j - c
// takes of the violations stays. Rows are sorted by where they begin, so that L L^T of
// rows along a rod is a band.
#include "solver/dynamics/contradiction.h"

#include <algorithm>
#include <numeric>
#include <vector>

#include <Eigen/Cholesky>

#include "solver/linear/band_matrix.h"

namespace cellwarp::core
{

Eigen::VectorXd contradiction(std::span<const SparseRow> rows,
                              const Eigen::VectorXd& violation)
{
    const int k = static_cast<int>(rows.size());
    Eigen::VectorXd r = violation;
    if (!(r.cwiseAbs().maxCoeff() > 0.0))
        return r;
    std::vector<int> order(rows.size());
    std::iota(order.begin(), order.end(), 0);
    const auto first = [&](int row)
    { return rows[idx(row)].empty() ? 0 : rows[idx(row)].front().first; };
    std::stable_sort(order.begin(), order.end(),
                     [&](int a, int b) { return first(a) < first(b); });
    // Rows that share no unknown share no entry.
    int half_band = 0;
    for (int i = 0; i < k; ++i)
    {
        const SparseRow& row = rows[idx(order[idx(i)])];
        int end = i;
        while (!row.empty() && end + 1 < k &&
               first(order[idx(end + 1)]) <= row.back().first)
            ++end;
        half_band = std::max(half_band, end - i);
    }
    BandMatrix S(k, half_band);
    for (int j = 0; j < k; ++j)
        for (int i = j; i <= std::min(j + half_band, k - 1); ++i)
        {
            const SparseRow &a = rows[idx(order[idx(i)])], &b = rows[idx(order[idx(j)])];
            for (auto p = a.begin(), q = b.begin(); p != a.end() && q != b.end();)
            {
                if (p->first == q->first)
                    S.lower(i, j) += p++->second * q++->second;
                else if (p->first < q->first)
                    ++p;
                else
                    ++q;
            }
        }
    BandFactor factor;
    factor.factorize(S, std::vector<char>(rows.size(), 1));
    std::vector<Eigen::VectorXd> idle;
    for (int j = 0; j < k; ++j)
    {
        if (!factor.is_left_out(j))
            continue;
        const Eigen::VectorXd one = Eigen::VectorXd::Unit(k, j);
        Eigen::VectorXd entries, sum;
        S.multiply(one, entries);
        factor.solve(entries);
        // Once more with what rounding has left.
        S.multiply(one - entries, sum);
        factor.solve(sum);
        idle.push_back(one - entries - sum);
    }
    if (idle.empty())
        return Eigen::VectorXd::Zero(k);
    Eigen::VectorXd sorted(k);
    for (int i = 0; i < k; ++i)
        sorted[i] = r[order[idx(i)]];
    const Eigen::Index m = static_cast<Eigen::Index>(idle.size());
    Eigen::MatrixXd N(k, m);
    for (Eigen::Index c = 0; c < m; ++c)
        N.col(c) = idle[static_cast<std::size_t>(c)];
    sorted = N * (N.transpose() * N).ldlt().solve(N.transpose() * sorted);
    for (int i = 0; i < k; ++i)
        r[order[idx(i)]] = sorted[i];
    return r;
}

} // namespace cellwarp::core
