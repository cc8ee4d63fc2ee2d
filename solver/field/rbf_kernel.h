// SPDX-License-Identifier: GPL-3.0-or-later
// The inner loops of triharmonic RBFs, to build and to evaluate them, for each
// instruction set. All make the same sums in the same order, so their results are the
// same to the bit.
#pragma once

#include <cstddef>

#include "octree/base/instruction_set.h"

namespace cellwarp::core
{

/// Where centres are lanes their count is padded to a multiple of this.
constexpr std::size_t kCentreLanes = 8;

/// Terms of a quadratic in three variables.
constexpr std::size_t kQuadraticTerms = 10;

/// Where places are lanes, there are so many.
constexpr std::size_t kPlaceLanes = 8;

/// Sums over all centres at some places, each summed in the order of the centres.
struct RbfPlaces
{
    const double* centres = nullptr; ///< six numbers each: its place, then its weight
    std::size_t num_centres = 0;
    const double* places = nullptr; ///< rows x, y, z of kPlaceLanes
    double* displacement = nullptr; ///< out, rows: sum w_j |r_j|^3, r_j = place - c_j
    double* slopes = nullptr; ///< out, nine rows: sum w_j 3 |r_j| r_j, axis by axis of r
};

/// Sums over all centres at some of them: rows of out = A w, A_ij = |c_i - c_j|^3.
struct RbfProducts
{
    const double* centres = nullptr; ///< three rows
    std::size_t num_centres = 0, num_padded = 0;
    const double* weights = nullptr; ///< rows of num_padded: three, or kQuadraticTerms
    double* out = nullptr;           ///< as many rows
    std::size_t first = 0, end = 0;  ///< which centres; multiples of kCentreLanes
};

/// Columns of A + L R^T + R L^T, all rows from \p first on.
struct RbfColumns
{
    const double* centres = nullptr; ///< three rows
    std::size_t num_padded = 0;
    const double *left = nullptr, *right = nullptr; ///< kQuadraticTerms rows each
    std::size_t first = 0, end = 0; ///< columns; \p first a multiple of kCentreLanes
    double* out = nullptr;          ///< the entry (first, first)
    std::size_t stride = 0;         ///< from column to column
};

/// A symmetric matrix in blocks of kCentreLanes columns, each from its block's first row
/// down; its size is a multiple of kCentreLanes. Where column \p k would begin:
constexpr std::size_t packed_column(std::size_t size, std::size_t k)
{
    const std::size_t first = k / kCentreLanes * kCentreLanes;
    return first * size - first * (first - kCentreLanes) / 2 +
           (k - first) * (size - first) - first;
}
constexpr std::size_t packed_entries(std::size_t size)
{
    return size * (size + kCentreLanes) / 2;
}

struct RbfKernels
{
    void (*displacement)(const RbfPlaces&);
    void (*value)(
        const RbfPlaces&); ///< slopes as well; the displacement has the same bits
    void (*products)(const RbfProducts&, std::size_t num_columns);
    void (*columns)(const RbfColumns&);
    /// Cholesky of a packed matrix, in its place. False, and the entries spoilt, if it is
    /// not positive definite.
    bool (*factorise)(double* entries, std::size_t size);
    /// Solves for three right-hand sides, rows of \p size, in their place.
    void (*solve)(const double* factor, std::size_t size, double* rows);
};

/// \pre \p set is one of instruction_sets()
RbfKernels rbf_kernels(InstructionSet set);

} // namespace cellwarp::core
