// SPDX-License-Identifier: GPL-3.0-or-later
// One level of a multigrid of rigid bodies, in single precision: its matrix, its
// smoother, and the way to the next level.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "solver/cells/grouping.h"
#include "solver/cells/rigid_rows.h"
#include "solver/cells/wide_blocks.h"
#include "solver/linear/block_matrix.h"
#include "solver/linear/cholesky.h"

namespace cellwarp::core
{

/// How a row follows the body above, in the scaled unknowns of both.
struct LevelTransfer
{
    FourFloats arm = {}; ///< shift += turn of the body x arm
    float turn = 1.0f, shift = 1.0f;
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
    std::vector<WideGlue> glue;
    /// What the blocks are beside their glue; no rows where nothing is.
    Links rest_links;
    WideBlocks rest;
    WideBlocks inverse; ///< of the diagonal of each smoothed body
    // To the next level.
    Grouping grouping;
    std::vector<LevelTransfer> transfer;
    /// Bodies on rods: where others are smoothed, these are solved for.
    std::optional<ExactBodies> rods;
    // Scratch of a cycle.
    std::vector<WideVector> right, x, d;
    /// What rods are solved for with, and what bodies would do without; empty: no rods.
    std::vector<WideVector> on_rods, without_rods;

    /// \p is_waiting(body): neighbours of bodies that do not wait are smoothed as well,
    /// and bodies on rods.
    SmoothedLevel(const RigidRows& A, std::span<const char> is_on_rod,
                  const std::function<bool(std::size_t)>& is_waiting);
    int count() const { return links.count(); }

    /// A times a vector, one row. \pre that is 0 where bodies are not smoothed, if the
    /// row is empty
    WideVector row_product(std::size_t i, const std::vector<WideVector>& of) const
    {
        WideVector sum;
        const WideVector* const at = of.data();
        const int* const column = links.column.data();
        for (std::size_t k = links.begin(i), end = links.end(i); k < end; ++k)
            glue[k].add_product(at[column[k]], sum);
        if (rest_links.count() > 0)
            for (std::size_t k = rest_links.begin(i); k < rest_links.end(i); ++k)
                sum += rest.product(k, of[idx(rest_links.column[k])]);
        return sum;
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
    /// Takes the correction of the bodies above, and smooths again; of the right-hand
    /// side is left what that does not reach.
    void after(const SmoothedLevel& next);

private:
    void list_rests(const RigidRows& A);
};

} // namespace cellwarp::core
