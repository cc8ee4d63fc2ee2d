// SPDX-License-Identifier: GPL-3.0-or-later
// The as-rigid-as-possible energy of tetrahedra and its minimum: the volumetric peer that
// cellwarp's results are compared with. It shares no code with the solver of the cells.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <Eigen/CholmodSupport>
#include <Eigen/Core>
#include <Eigen/SparseCore>

#include "tests/bench/tet_mesh.h"

namespace cellwarp::core::bench
{

/// A place where the energy is sampled.
struct TetSample
{
    std::size_t tet = 0;
    double weight = 0.0; ///< volume that it stands for
    /// Of the shape functions of the tetrahedron's nodes, one a column.
    Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, 10> gradients;
};

/// Linear elements (order 1) have a node in every corner, quadratic ones (order 2) also
/// in the middle of every edge.
struct TetElements
{
    TetElements(const TetMesh& mesh, int order);

    int order;
    std::size_t nodes_per_tet;
    Eigen::Matrix3Xd rest;           ///< of the nodes, one a column
    std::vector<int> region_of_node; ///< the region that prescribes it; -1: none
    std::vector<int> nodes;          ///< nodes_per_tet of each tetrahedron
    std::vector<TetSample> samples;

    std::size_t num_nodes() const { return region_of_node.size(); }
    const int* nodes_of(std::size_t tet) const { return &nodes[tet * nodes_per_tet]; }
    /// The place with these barycentric weights in a tetrahedron of nodes at \p x;
    /// outside, straight on from where weights that are not negative are nearest.
    Eigen::Vector3d place(const TetFinder::Found& at, const Eigen::Matrix3Xd& x) const;
};

/// E = int |F - R|^2, with F the gradient of the deformation and R the rotation nearest
/// to it. One motion is evaluated at a time.
class TetArap
{
public:
    explicit TetArap(const TetElements& elements);

    /// Moves to nodes at \p x and gives the energy there.
    double move_to(const Eigen::Matrix3Xd& x);
    /// Of the energy, by the nodes; that of prescribed nodes as well.
    Eigen::Matrix3Xd gradient() const;
    /// The second derivative, the exact one, times \p p.
    Eigen::Matrix3Xd hessian_times(const Eigen::Matrix3Xd& p) const;

private:
    Eigen::Matrix3d gradient_of(std::size_t sample, const Eigen::Matrix3Xd& x) const;
    void add_to(std::size_t sample, const Eigen::Matrix3d& P,
                Eigen::Matrix3Xd& sum) const;

    /// F = R S at a sample.
    struct Split
    {
        Eigen::Matrix3d R = Eigen::Matrix3d::Identity(), F = R;
        Eigen::Matrix3d inverse; ///< of tr(S) I - S
    };
    static void split(Split& at);

    const TetElements& elements_;
    std::vector<Split> splits_;
};

struct TetSolveOptions
{
    double diagonal = 1.0;   ///< what movements are relative to
    double tolerance = 1e-6; ///< stop when a whole Newton step moves no node farther
    int local_global = 10;   ///< iterations before Newton's method
    int max_newton = 200;
};

struct TetSolveReport
{
    std::string stop; ///< "converged", "iteration limit" or "no descent"
    double energy = 0.0;
    /// The largest movement of the last Newton step, and of the local/global iteration
    /// that could follow it [diagonal].
    double newton_movement = 0.0, local_global_movement = 0.0;
    int newton = 0, cg_steps = 0;
    bool is_saddle = false; ///< whether the curvature was negative in the last step
};

/// Local/global iterations bring nodes that the regions have moved to where Newton's
/// method with conjugate gradients, preconditioned by the factor of those, can finish.
class TetSolver
{
public:
    explicit TetSolver(const TetElements& elements);

    /// Lowers the energy of the nodes that no region prescribes, from \p x.
    TetSolveReport solve(Eigen::Matrix3Xd& x, const TetSolveOptions& options);

private:
    using Free = Eigen::MatrixX3d; ///< of the nodes that no region prescribes, one a row

    Free free_rows(const Eigen::Matrix3Xd& all) const;
    Eigen::Matrix3Xd all_columns(const Free& rows) const;
    struct Direction
    {
        Free step;
        int cg_steps = 0;
        bool is_saddle = false;
    };
    Direction newton_direction(const Free& gradient, double accuracy) const;
    /// How far it went; 0 where the energy does not fall.
    double descend(Eigen::Matrix3Xd& x, const Free& gradient, const Free& step,
                   double& energy);

    TetArap energy_;
    std::vector<int> row_of_node_; ///< -1: prescribed
    std::vector<int> node_of_row_;
    Eigen::CholmodSupernodalLLT<Eigen::SparseMatrix<double>> factor_;
};

} // namespace cellwarp::core::bench
