// SPDX-License-Identifier: GPL-3.0-or-later
// Linear systems with constraints by multipliers,
//   [ A  -L^T ] [ x      ]   [ r ]
//   [ -L   0  ] [ lambda ] = [ g ],   that is A x - L^T lambda = r, L x = -g,
// where A is a band. A row of L whose entries are near each other joins the band, right
// behind the last unknown that it touches; there the factor L D L^T exists wherever A is
// definite on what the rows leave free, also where A alone is singular. Rows that reach
// farther are eliminated by a dense system.
//
// Where A without a row is singular, the last pivot before the row is 0 but for rounding,
// and what follows is lost in it. So A + rho L^T L, r - rho L^T g take the places of A
// and r, with rho L_u^2 as large as the A_uu that the row touches: the solution is the
// same.
//
// Single unknowns beside the band, such as the parameter at which a rod slides, join it
// right behind the last of the others that they are coupled to.
#pragma once

#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "solver/linear/band_matrix.h"

namespace cellwarp::core
{

/// A row of L: (unknown, value), ascending.
using SparseRow = std::vector<std::pair<int, double>>;

/// Brings entries that were gathered in any order into theirs; what is of one unknown is
/// added up.
void sort_and_add_up(SparseRow& row);

/// An unknown beside those of a band; number k of them is unknown rows + k.
struct SingleUnknown
{
    int from = 0, behind = 0; ///< the first and last unknowns that it may be coupled to
    SparseRow column;         ///< what couples it, ascending, between the two
    double diagonal = 1.0;
};

class SaddleSolver
{
public:
    /// What the factorisation told.
    struct Report
    {
        bool is_finite = true;
        int num_negative = 0; ///< directions in which A is not definite
        int num_dropped = 0;  ///< rows that say nothing new
    };

    /// \p rows are looked at group by group, \p groups of successive ones: those of one
    /// group stand side by side.
    Report factorize(const BandMatrix& A, std::span<const SparseRow> rows,
                     std::span<const int> groups,
                     std::span<const SingleUnknown> singles = {});
    /// r becomes x; \p g becomes lambda.
    void solve(Eigen::VectorXd& r, Eigen::VectorXd& g) const;

private:
    void arrange(const BandMatrix& A, std::span<const SparseRow> rows,
                 std::span<const int> groups, std::span<const SingleUnknown> singles);

    int num_unknowns_ = 0;                             ///< with the single ones
    bool is_plain_ = true;                             ///< the band alone
    std::vector<int> place_of_unknown_, place_of_row_; ///< in the band; -1: a far row
    std::vector<char> is_row_;
    std::vector<SparseRow> near_; ///< in places of the band; empty: a far row
    std::vector<double> rho_;     ///< of each row
    std::vector<SparseRow> far_;  ///< in places of the band
    std::vector<int> far_rows_;   ///< their numbers
    BandMatrix matrix_;
    BandFactor factor_;
    Eigen::MatrixXd far_solved_; ///< A^-1 L^T of the far rows
    Eigen::MatrixXd far_inverse_;
    mutable Eigen::VectorXd all_;
};

} // namespace cellwarp::core
