// SPDX-License-Identifier: GPL-3.0-or-later
// Rows are first scaled to a largest entry of 1. An exchange brings a row up, which then
// reaches as far beyond the band as that reaches below the diagonal.
#include "solver/linear/band_lu.h"

#include <cmath>
#include <utility>

namespace cellwarp::core
{

BandLu::BandLu(int rows, int below, int above)
    : rows_(rows), below_(below), width_(2 * below + above + 1),
      numbers_(idx(rows) * idx(width_), 0.0), scale_(idx(rows)), pivot_(idx(rows))
{
}

bool BandLu::factorize()
{
    constexpr double kSingular = 1e-14; // of a row's largest entry
    for (int i = 0; i < rows_; ++i)
    {
        double* const row = &numbers_[idx(i) * idx(width_)];
        double largest = 0.0;
        for (int k = 0; k < width_; ++k)
            largest = std::max(largest, std::abs(row[k]));
        scale_[idx(i)] = largest > 0.0 ? 1.0 / largest : 1.0;
        for (int k = 0; k < width_; ++k)
            row[k] *= scale_[idx(i)];
    }
    for (int k = 0; k < rows_; ++k)
    {
        const int last = std::min(rows_ - 1, k + below_), end = end_of(k);
        int best = k;
        for (int i = k + 1; i <= last; ++i)
            if (std::abs(at(i, k)) > std::abs(at(best, k)))
                best = i;
        pivot_[idx(k)] = best;
        if (!(std::abs(at(best, k)) > kSingular))
            return false;
        for (int j = k; best != k && j < end; ++j)
            std::swap(at(k, j), at(best, j));
        for (int i = k + 1; i <= last; ++i)
        {
            const double share = at(i, k) /= at(k, k);
            for (int j = k + 1; share != 0.0 && j < end; ++j)
                at(i, j) -= share * at(k, j);
        }
    }
    return true;
}

void BandLu::solve(Eigen::VectorXd& x) const
{
    for (int k = 0; k < rows_; ++k)
        x[k] *= scale_[idx(k)];
    for (int k = 0; k < rows_; ++k)
    {
        std::swap(x[k], x[pivot_[idx(k)]]);
        for (int i = k + 1; i <= std::min(rows_ - 1, k + below_); ++i)
            x[i] -= at(i, k) * x[k];
    }
    for (int k = rows_; k-- > 0;)
    {
        for (int j = k + 1; j < end_of(k); ++j)
            x[k] -= at(k, j) * x[j];
        x[k] /= at(k, k);
    }
}

} // namespace cellwarp::core
