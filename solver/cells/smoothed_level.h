// SPDX-License-Identifier: GPL-3.0-or-later
// One level of a multigrid of rigid bodies, in single precision: its matrix, its
// smoother, and the way to the next level.
#pragma once

#include <array>
#include <cstddef>
#include <cstring>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "solver/cells/grouping.h"
#include "solver/cells/rigid_rows.h"
#include "solver/linear/block_matrix.h"
#include "solver/linear/cholesky.h"

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
    explicit WideBlocks(std::size_t count = 0) : numbers_(36 * count + (kWide - 6), 0.0f)
    {
    }

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

/// Some bodies of a level, solved for exactly, in double precision.
class ExactBodies
{
public:
    /// What rounding made indefinite is held a little.
    ExactBodies(const RigidRows& A, std::vector<int> bodies);

    std::span<const int> bodies() const { return bodies_; }
    /// x of these bodies, for the right-hand sides \p right with all others at 0.
    void solve(const std::vector<WideVector>& right, std::vector<WideVector>& x);
    double factor_numbers() const { return solver_.factor_numbers(); }

private:
    std::vector<int> bodies_;
    BlockMatrix matrix_;
    SparseCholesky solver_;
    bool is_solved_ = false;
    Eigen::VectorXd right_, solution_;
};

struct SmoothedLevel
{
    /// Ascending; the others are at rest until the correction of the next level.
    std::vector<int> smoothed;
    // Rows; empty where no smoothed body has a part.
    Links links;
    WideBlocks block;
    WideBlocks inverse; ///< of the diagonal of each smoothed body
    // To the next level.
    Grouping grouping;
    std::vector<LevelTransfer> transfer;
    /// Bodies on rods: where others are smoothed, these are solved for.
    std::optional<ExactBodies> rods;
    // Scratch of a cycle.
    std::vector<WideVector> right, x, r, d, d2;
    std::vector<WideVector> on_rods; ///< empty: no rods

    /// \p is_waiting(body): neighbours of bodies that do not wait are smoothed as well,
    /// and bodies on rods.
    SmoothedLevel(const RigidRows& A, std::span<const char> is_on_rod,
                  const std::function<bool(std::size_t)>& is_waiting);
    int count() const { return links.count(); }

    /// sum -= A x, one row. \pre x is 0 where bodies are not smoothed, if the row is
    /// empty
    void subtract_row(std::size_t i, const std::vector<WideVector>& at,
                      WideVector& sum) const
    {
        for (std::size_t k = links.begin(i); k < links.end(i); ++k)
            block.subtract_product(k, at[idx(links.column[k])], sum);
    }
    /// \p body(place in smoothed, body)
    template <class Body>
    void for_each_smoothed(Body&& body) const
    {
        for_each_body(static_cast<int>(smoothed.size()),
                      [&](std::size_t k) { body(k, idx(smoothed[k])); });
    }
    /// \p use(body, its part of the solution) for all bodies on rods.
    template <class Use>
    void for_rods(const std::vector<WideVector>& of, Use&& use)
    {
        if (!rods)
            return;
        rods->solve(of, on_rods);
        for (const int body : rods->bodies())
            use(idx(body), on_rods[idx(body)]);
    }
    /// From x = 0: smooths, and sends what is left to the bodies above.
    void before(SmoothedLevel& next);
    /// Takes the correction of the bodies above, and smooths again.
    void after(const SmoothedLevel& next);
};

} // namespace cellwarp
