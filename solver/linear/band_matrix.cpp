// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/linear/band_matrix.h"

#include <algorithm>
#include <cmath>

namespace cellwarp::core
{

namespace
{

/// A pivot that cancellation has made so small a share of what it is made of tells
/// nothing.
constexpr double kRedundant = 1e-10;

/// Takes a pivot column from those behind it. With the width known the compiler keeps it
/// in registers.
template <int kHalfBand>
void eliminate(double* pivot_column)
{
    const double inverse = 1.0 / pivot_column[0];
    double kept[kHalfBand + 1];
    for (int i = 0; i <= kHalfBand; ++i)
        kept[i] = pivot_column[i];
    double* target = pivot_column;
    for (int k = 1; k <= kHalfBand; ++k)
    {
        target += kHalfBand + 1;
        const double factor = kept[k] * inverse;
        for (int i = 0; i <= kHalfBand - k; ++i)
            target[i] -= factor * kept[i + k];
    }
    pivot_column[0] = inverse;
    for (int k = 1; k <= kHalfBand; ++k)
        pivot_column[k] = kept[k] * inverse;
}

/// The half-band of a cubic rod.
constexpr int kUsual = 15;

} // namespace

BandMatrix::BandMatrix(int rows, int half_band)
    : rows_(rows), half_band_(half_band), values_(idx(rows) * idx(half_band + 1), 0.0)
{
}

void BandMatrix::set_zero()
{
    std::fill(values_.begin(), values_.end(), 0.0);
}

void BandMatrix::multiply(const Eigen::VectorXd& x, Eigen::VectorXd& y) const
{
    y.setZero(rows_);
    for (int j = 0; j < rows_; ++j)
    {
        const double* const values = &values_[idx(j) * idx(half_band_ + 1)];
        const int count = std::min(half_band_, rows_ - 1 - j);
        double sum = values[0] * x[j];
        for (int i = 1; i <= count; ++i)
        {
            sum += values[i] * x[j + i];
            y[j + i] += values[i] * x[j];
        }
        y[j] += sum;
    }
}

BandFactor::Report BandFactor::factorize(const BandMatrix& A,
                                         std::span<const char> is_multiplier)
{
    rows_ = A.rows();
    half_band_ = A.half_band();
    const std::size_t width = idx(half_band_ + 1);
    values_.resize(idx(rows_) * width);
    made_of_.resize(idx(rows_));
    for (int j = 0; j < rows_; ++j)
    {
        const std::span<const double> column = A.column(j);
        std::copy(column.begin(), column.end(),
                  values_.begin() + static_cast<std::ptrdiff_t>(idx(j) * width));
        made_of_[idx(j)] = std::abs(column[0]);
    }
    Report report;
    int num_negative = 0, num_rows = 0;
    for (int j = 0; j < rows_; ++j)
    {
        double* const pivot_column = &values_[idx(j) * width];
        const double pivot = pivot_column[0];
        const int count = std::min(half_band_, rows_ - 1 - j);
        if (!std::isfinite(pivot))
        {
            report.is_finite = false;
            return report;
        }
        const bool is_row = !is_multiplier.empty() && is_multiplier[idx(j)] != 0;
        if (is_row ? std::abs(pivot) <= kRedundant * made_of_[idx(j)] : pivot == 0.0)
        {
            // Nothing is learnt from it: its unknown is 0.
            report.num_dropped += is_row;
            num_negative += !is_row;
            std::fill(pivot_column, pivot_column + count + 1, 0.0);
            continue;
        }
        num_negative += pivot < 0.0;
        num_rows += is_row;
        if (half_band_ == kUsual && count == kUsual && is_multiplier.empty())
        {
            eliminate<kUsual>(pivot_column);
            continue;
        }
        const double inverse = 1.0 / pivot;
        for (int k = 1; k <= count; ++k)
        {
            const double a = pivot_column[k];
            if (a == 0.0)
                continue;
            const double factor = a * inverse;
            double* const target = &values_[idx(j + k) * width];
            const double* const source = pivot_column + k;
            for (int i = 0; i <= count - k; ++i)
                target[i] -= factor * source[i];
            made_of_[idx(j + k)] += std::abs(factor * a);
        }
        pivot_column[0] = inverse;
        for (int k = 1; k <= count; ++k)
            pivot_column[k] *= inverse;
    }
    report.num_negative = std::max(0, num_negative - num_rows);
    return report;
}

void BandFactor::solve(Eigen::Ref<Eigen::VectorXd> b) const
{
    const std::size_t width = idx(half_band_ + 1);
    for (int j = 0; j < rows_; ++j)
    {
        const double* const column = &values_[idx(j) * width];
        const int count = std::min(half_band_, rows_ - 1 - j);
        const double x = b[j];
        for (int k = 1; k <= count; ++k)
            b[j + k] -= column[k] * x;
    }
    for (int j = rows_ - 1; j >= 0; --j)
    {
        const double* const column = &values_[idx(j) * width];
        const int count = std::min(half_band_, rows_ - 1 - j);
        double x = b[j] * column[0];
        for (int k = 1; k <= count; ++k)
            x -= column[k] * b[j + k];
        b[j] = x;
    }
}

void BandFactor::solve(Eigen::MatrixX3d& b) const
{
    const std::size_t width = idx(half_band_ + 1);
    double *const x = b.col(0).data(), *const y = b.col(1).data(),
                  *const z = b.col(2).data();
    for (int j = 0; j < rows_; ++j)
    {
        const double* const column = &values_[idx(j) * width];
        const int count = std::min(half_band_, rows_ - 1 - j);
        for (int k = 1; k <= count; ++k)
        {
            x[j + k] -= column[k] * x[j];
            y[j + k] -= column[k] * y[j];
            z[j + k] -= column[k] * z[j];
        }
    }
    for (int j = rows_ - 1; j >= 0; --j)
    {
        const double* const column = &values_[idx(j) * width];
        const int count = std::min(half_band_, rows_ - 1 - j);
        double sum[3] = {x[j] * column[0], y[j] * column[0], z[j] * column[0]};
        for (int k = 1; k <= count; ++k)
        {
            sum[0] -= column[k] * x[j + k];
            sum[1] -= column[k] * y[j + k];
            sum[2] -= column[k] * z[j + k];
        }
        x[j] = sum[0];
        y[j] = sum[1];
        z[j] = sum[2];
    }
}

} // namespace cellwarp::core
