// SPDX-License-Identifier: GPL-3.0-or-later
// Symmetric matrices whose entries lie near the diagonal, and their factor L D L^T
// without pivoting: time and memory grow with the rows alone.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "octree/base/index.h"

namespace cellwarp::core
{

class BandMatrix
{
public:
    BandMatrix() = default;
    /// Zero. Entries with |row - column| > \p half_band are none.
    BandMatrix(int rows, int half_band);

    int rows() const { return rows_; }
    int half_band() const { return half_band_; }

    /// An entry of the lower triangle. \pre 0 <= row - column <= half_band()
    double& lower(int row, int column)
    {
        return values_[idx(column) * idx(half_band_ + 1) + idx(row - column)];
    }
    double lower(int row, int column) const
    {
        return values_[idx(column) * idx(half_band_ + 1) + idx(row - column)];
    }
    /// Adds to an entry of either triangle, and to its mirror image.
    void add(int row, int column, double value)
    {
        (row >= column ? lower(row, column) : lower(column, row)) += value;
    }
    void set_zero();

    /// y = A x with the symmetric whole.
    void multiply(const Eigen::VectorXd& x, Eigen::VectorXd& y) const;

    /// Column j: entry (j, j), then those below it in column j.
    std::span<const double> column(int j) const
    {
        return {&values_[idx(j) * idx(half_band_ + 1)], idx(half_band_ + 1)};
    }

private:
    int rows_ = 0, half_band_ = 0;
    std::vector<double> values_; ///< by columns, half_band + 1 each
};

/// A = L D L^T. D may have negative entries: a saddle point matrix has as many as it has
/// multiplier rows where the rest is positive definite on what the rows leave free, and
/// more elsewhere (Sylvester's law). Keeps its memory from one factorisation to the next.
class BandFactor
{
public:
    /// What the pivots told.
    struct Report
    {
        bool is_finite = true;
        int num_negative = 0; ///< beyond one for every multiplier that is not left out
        int num_dropped = 0;  ///< multipliers left out as redundant
    };

    /// \p is_multiplier: a flag a row, or empty: none is. A multiplier whose pivot is
    /// less than 1e-10 of what it is made of is redundant: it is left out, and comes out
    /// as 0.
    Report factorize(const BandMatrix& A, std::span<const char> is_multiplier = {});

    /// b becomes A^-1 b.
    void solve(Eigen::Ref<Eigen::VectorXd> b) const;
    /// The same for three right sides at once.
    void solve(Eigen::MatrixX3d& b) const;

    int rows() const { return rows_; }
    /// Whether row \p j was redundant, or nothing stood in it.
    bool is_left_out(int j) const { return values_[idx(j) * idx(half_band_ + 1)] == 0.0; }

private:
    int rows_ = 0, half_band_ = 0;
    std::vector<double> values_; ///< L below the diagonal, 1 / D on it
    std::vector<double> made_of_;
};

} // namespace cellwarp::core
