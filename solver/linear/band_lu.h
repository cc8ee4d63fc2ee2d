// SPDX-License-Identifier: GPL-3.0-or-later
// Square matrices of a band, and their factors by Gauss's elimination.
#pragma once

#include <algorithm>
#include <vector>

#include <Eigen/Core>

#include "octree/base/index.h"

namespace cellwarp::core
{

class BandLu
{
public:
    /// All zeros; entries up to \p below the diagonal and up to \p above it.
    BandLu(int rows, int below, int above);

    /// An entry in the band, before factorize().
    double& entry(int row, int column) { return at(row, column); }
    /// Rows are exchanged for the largest pivot. False: a pivot is nothing but rounding.
    bool factorize();
    /// x = A^-1 x. \pre factorize() was true
    void solve(Eigen::VectorXd& x) const;

private:
    double& at(int row, int column)
    {
        return numbers_[idx(row) * idx(width_) + idx(column - row + below_)];
    }
    double at(int row, int column) const
    {
        return numbers_[idx(row) * idx(width_) + idx(column - row + below_)];
    }
    /// The columns behind one that its row may have numbers in.
    int end_of(int column) const { return std::min(rows_, column + width_ - below_); }

    int rows_, below_, width_;
    std::vector<double> numbers_, scale_; ///< of rows
    std::vector<int> pivot_;              ///< row that came to the place of each
};

} // namespace cellwarp::core
