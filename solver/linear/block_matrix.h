// SPDX-License-Identifier: GPL-3.0-or-later
// A symmetric sparse matrix of dense blocks of any size. The structure is fixed
// once; assembly writes into known places.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "octree/base/index.h"

namespace cellwarp::core
{

/// Lower block triangle in compressed columns. The columns of one block column
/// have the same rows, so a block is a strided dense matrix inside the values.
/// Diagonal blocks are stored whole; what stands above the diagonal is ignored.
class BlockMatrix
{
public:
    using Block = Eigen::Map<Eigen::MatrixXd, 0, Eigen::OuterStride<>>;

    BlockMatrix() = default;
    /// \p sizes of the diagonal blocks; \p pairs (row, column) of the off-diagonal
    /// ones, row > column, no pair twice.
    BlockMatrix(std::span<const int> sizes, std::vector<std::pair<int, int>> pairs);

    int rows() const { return first_.empty() ? 0 : first_.back(); }
    int num_blocks() const { return static_cast<int>(first_.size()) - 1; }
    int size(int block) const { return at(first_, block + 1) - at(first_, block); }
    int first(int block) const { return at(first_, block); }

    /// Number of an off-diagonal block for block().
    int find(int row, int column) const;
    Block diagonal(int block);
    Block block(int found);
    void set_zero();

    // Compressed columns, as a sparse solver takes them.
    const std::vector<std::int32_t>& column_starts() const { return column_starts_; }
    const std::vector<std::int32_t>& row_indices() const { return row_indices_; }
    const std::vector<double>& values() const { return values_; }

    bool operator==(const BlockMatrix& other) const = default;

    /// y = A x with the symmetric whole.
    Eigen::VectorXd multiply(const Eigen::VectorXd& x) const;
    /// Largest absolute row sum, an upper bound of the spectral norm.
    double norm() const;

private:
    static int at(const std::vector<int>& v, int i) { return v[idx(i)]; }

    std::vector<int> first_; ///< scalar row of each block, blocks + 1
    std::vector<std::pair<int, int>>
        blocks_;                  ///< (column, row), sorted, diagonal included
    std::vector<int> row_offset_; ///< of each block inside its column
    std::vector<std::int32_t> column_starts_, row_indices_;
    std::vector<double> values_;
};

} // namespace cellwarp::core
