// SPDX-License-Identifier: GPL-3.0-or-later
// One level of a multigrid of rigid bodies, in single precision: its matrix, its
// smoother, and the way to the next level.
#pragma once

#include <array>
#include <cstddef>
#include <cstring>
#include <vector>

#include <Eigen/Core>

#include "solver/cells/grouping.h"
#include "solver/cells/rigid_rows.h"

namespace cellwarp
{

constexpr std::size_t kBlockBytes = 36 * sizeof(float);

/// Six numbers in one register's width. What stands in the last two lanes means nothing.
constexpr int kWide = 8;
using WideVector = float __attribute__((vector_size(kWide * sizeof(float))));

/// 6 x 6 blocks in a row, by columns. A column is loaded in full width: its last lanes
/// are the next column's first numbers, which are finite and go nowhere.
class WideBlocks
{
public:
    explicit WideBlocks(std::size_t count) : numbers_(36 * count + (kWide - 6), 0.0f) {}

    std::size_t size() const { return numbers_.size() / 36; }
    void set(std::size_t at, const Matrix6& A)
    {
        Eigen::Map<Eigen::Matrix<float, 6, 6>>(numbers_.data() + 36 * at) =
            A.cast<float>();
    }
    /// y += A x
    void add_product(std::size_t at, const WideVector& x, WideVector& y) const
    {
        for (int k = 0; k < 6; ++k)
        {
            WideVector own;
            std::memcpy(&own, column(at, k), sizeof own);
            y += own * x[k];
        }
    }
    /// y -= A x
    void subtract_product(std::size_t at, const WideVector& x, WideVector& y) const
    {
        for (int k = 0; k < 6; ++k)
        {
            WideVector own;
            std::memcpy(&own, column(at, k), sizeof own);
            y -= own * x[k];
        }
    }

private:
    const float* column(std::size_t at, int k) const
    {
        return numbers_.data() + 36 * at + 6 * k;
    }

    std::vector<float> numbers_;
};

/// How a row follows the body above, in the scaled unknowns of both.
struct LevelTransfer
{
    float turn = 1.0f, shift = 1.0f;
    std::array<float, 3> arm = {}; ///< shift += turn of the body x arm
};

struct SmoothedLevel
{
    // Rows without the diagonal.
    Links links;
    WideBlocks block, diagonal, inverse;
    // To the next level.
    Grouping grouping;
    std::vector<LevelTransfer> transfer;
    // Scratch of a cycle.
    std::vector<WideVector> right, x, r, d, d2;

    explicit SmoothedLevel(const RigidRows& A);
    int count() const { return links.count(); }

    /// sum -= A x, one row
    void subtract_row(std::size_t i, const std::vector<WideVector>& at,
                      WideVector& sum) const
    {
        diagonal.subtract_product(i, at[i], sum);
        for (std::size_t k = links.begin(i); k < links.end(i); ++k)
            block.subtract_product(k, at[idx(links.column[k])], sum);
    }
    /// From x = 0: smooths, and sends what is left to the bodies above.
    void before(SmoothedLevel& next);
    /// Takes the correction of the bodies above, and smooths again.
    void after(const SmoothedLevel& next);
};

} // namespace cellwarp
