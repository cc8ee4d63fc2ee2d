// SPDX-License-Identifier: GPL-3.0-or-later
// Equations on nodes that come and go from step to step: contacts, and points that are
// pulled. node_rows.cpp says how systems with them are solved.
#pragma once

#include <span>
#include <vector>

#include <Eigen/Core>
#include <Eigen/SparseCholesky>

#include "solver/flesh/sparse_rows.h"
#include "solver/linear/conjugate_gradients.h"
#include "solver/linear/linear_operator.h"

namespace cellwarp::core
{

/// direction . sum share x_node = value, x three numbers for each free node.
struct NodeRow
{
    NodeShares shares;         ///< of free nodes, by their places among those
    Eigen::Vector3d direction; ///< a unit vector
    double value = 0.0;
};

/// What brakes a point along a surface: the force factor P (x_point + base) against its
/// way, P what is across the normal.
struct NodeBrake
{
    NodeShares shares;      ///< of free nodes
    Eigen::Vector3d normal; ///< a unit vector
    Eigen::Vector3d base;
    double factor = 0.0; ///< >= 0

    /// Of a point that goes by \p x.
    Eigen::Vector3d force(const Eigen::VectorXd& x) const;
};

/// A with brakes.
class BrakedOperator final : public LinearOperator
{
public:
    BrakedOperator(const LinearOperator& A, std::span<const NodeBrake> brakes)
        : A_(A), brakes_(brakes)
    {
    }
    void multiply(const Eigen::VectorXd& x, Eigen::VectorXd& y) const override;

private:
    const LinearOperator& A_;
    std::span<const NodeBrake> brakes_;
};

/// A x = b + J^T l, J x = values: rows that others tell nearly are met by both together.
class NodeRows
{
public:
    /// \p scale: of each free node, what its three numbers move for a force, roughly: the
    /// inverse of A's diagonal. Each row needs a free node.
    NodeRows(std::vector<NodeRow> rows, const Eigen::VectorXd& scale);

    const std::vector<NodeRow>& rows() const { return rows_; }

    /// Solves, with \p B a preconditioner of A; \p l: a row each.
    LinearReport solve(const LinearOperator& A, Preconditioner& B,
                       const Eigen::VectorXd& b, const LinearLimits& limits,
                       ConjugateGradients& cg, Eigen::VectorXd& x, Eigen::VectorXd& l);

    /// The least change of x, each node weighed by the inverse of its scale, by which all
    /// rows are met.
    void correct(Eigen::VectorXd& x) const;

    Eigen::VectorXd times(const Eigen::VectorXd& x) const; ///< J x
    /// y += J^T l, and each node by its scale where \p scaled.
    void add_transposed(const Eigen::VectorXd& l, bool scaled, Eigen::VectorXd& y) const;
    Eigen::VectorXd values() const;
    /// W^-1 y, W = J N J^T.
    Eigen::VectorXd weighed(const Eigen::VectorXd& y) const;
    /// J N r: what the rows see of forces.
    Eigen::VectorXd felt(const Eigen::VectorXd& r) const;

private:
    std::vector<NodeRow> rows_;
    const Eigen::VectorXd& scale_;
    Eigen::SparseMatrix<double> seen_; ///< W, its lower half
    Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor_;
};

} // namespace cellwarp::core
