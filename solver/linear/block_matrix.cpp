// SPDX-License-Identifier: GPL-3.0-or-later
#include "solver/linear/block_matrix.h"

#include <algorithm>
#include <cassert>
#include <numeric>

#include "octree/base/index.h"

namespace cellwarp::core
{

BlockMatrix::BlockMatrix(std::span<const int> sizes,
                         std::vector<std::pair<int, int>> pairs)
{
    first_.resize(sizes.size() + 1, 0);
    std::partial_sum(sizes.begin(), sizes.end(), first_.begin() + 1);
    for (const auto& [row, column] : pairs)
    {
        assert(row > column);
        blocks_.emplace_back(column, row);
    }
    for (int b = 0; b < num_blocks(); ++b)
        blocks_.emplace_back(b, b);
    std::sort(blocks_.begin(), blocks_.end());
    row_offset_.resize(blocks_.size());
    column_starts_.push_back(0);
    for (std::size_t begin = 0; begin < blocks_.size();)
    {
        const int column = blocks_[begin].first;
        std::vector<std::int32_t> rows;
        std::size_t end = begin;
        for (; end < blocks_.size() && blocks_[end].first == column; ++end)
        {
            row_offset_[end] = static_cast<int>(rows.size());
            const int block_row = blocks_[end].second;
            for (int r = 0; r < size(block_row); ++r)
                rows.push_back(first(block_row) + r);
        }
        for (int c = 0; c < size(column); ++c)
        {
            row_indices_.insert(row_indices_.end(), rows.begin(), rows.end());
            column_starts_.push_back(static_cast<std::int32_t>(row_indices_.size()));
        }
        begin = end;
    }
    values_.assign(row_indices_.size(), 0.0);
}

int BlockMatrix::find(int row, int column) const
{
    const auto found =
        std::lower_bound(blocks_.begin(), blocks_.end(), std::pair(column, row));
    assert(found != blocks_.end() && *found == std::pair(column, row));
    return static_cast<int>(found - blocks_.begin());
}

BlockMatrix::Block BlockMatrix::diagonal(int block)
{
    return this->block(find(block, block));
}

BlockMatrix::Block BlockMatrix::block(int found)
{
    const auto [column, row] = blocks_[idx(found)];
    const std::size_t c = idx(first(column));
    const std::int32_t height = column_starts_[c + 1] - column_starts_[c];
    double* start = values_.data() + column_starts_[c] + at(row_offset_, found);
    return Block(start, size(row), size(column), Eigen::OuterStride<>(height));
}

void BlockMatrix::set_zero()
{
    std::fill(values_.begin(), values_.end(), 0.0);
}

Eigen::VectorXd BlockMatrix::multiply(const Eigen::VectorXd& x) const
{
    Eigen::VectorXd y = Eigen::VectorXd::Zero(x.size());
    for (int c = 0; c < rows(); ++c)
        for (std::int32_t k = column_starts_[idx(c)]; k < column_starts_[idx(c) + 1]; ++k)
        {
            const int r = row_indices_[idx(k)];
            const double value = values_[idx(k)];
            if (r < c)
                continue;
            y[r] += value * x[c];
            if (r > c)
                y[c] += value * x[r];
        }
    return y;
}

double BlockMatrix::norm() const
{
    Eigen::VectorXd sums = Eigen::VectorXd::Zero(rows());
    for (int c = 0; c < rows(); ++c)
        for (std::int32_t k = column_starts_[idx(c)]; k < column_starts_[idx(c) + 1]; ++k)
        {
            const int r = row_indices_[idx(k)];
            const double value = std::abs(values_[idx(k)]);
            if (r < c)
                continue;
            sums[r] += value;
            if (r > c)
                sums[c] += value;
        }
    return rows() > 0 ? sums.maxCoeff() : 0.0;
}

} // namespace cellwarp::core
