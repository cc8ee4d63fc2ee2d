// SPDX-License-Identifier: GPL-3.0-or-later
// Lattices of flesh, and what holds them, for tests and benchmarks.
#pragma once

#include <functional>
#include <random>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Eigenvalues>

#include "solver/flesh/flesh.h"
#include "tests/support/random.h"
#include "tests/support/shapes.h"

namespace cellwarp::core::support
{

/// A bar along x from the origin, its section 1 x 1, in cubes \p across to the section.
inline Lattice bar_lattice(int across, int length = 10)
{
    const Built body = bar(length * across, across, across);
    return octree_lattice(body.octree, body.cells, 1.0 / across);
}

/// Hexahedra in rows along the axes, of any sizes: nodes at all places of the lines.
inline Lattice grid_lattice(const std::array<std::vector<double>, 3>& lines)
{
    const auto count = [&](std::size_t axis)
    { return static_cast<int>(lines[axis].size()); };
    const auto node = [&](int i, int j, int k)
    { return (k * count(1) + j) * count(0) + i; };
    std::vector<Eigen::Vector3d> places;
    for (const double z : lines[2])
        for (const double y : lines[1])
            for (const double x : lines[0])
                places.emplace_back(x, y, z);
    std::vector<CornerNodes> cells;
    for (int k = 0; k + 1 < count(2); ++k)
        for (int j = 0; j + 1 < count(1); ++j)
            for (int i = 0; i + 1 < count(0); ++i)
            {
                CornerNodes& corners = cells.emplace_back();
                for (int a = 0; a < 8; ++a)
                    corners[idx(a)] = node(i + (a & 1), j + (a >> 1 & 1), k + (a >> 2));
            }
    const std::vector<int> material(cells.size(), 0);
    return drawn_lattice(std::move(places), std::move(cells), material);
}

/// Nodes that do not hang, held by motion 0.
inline std::vector<HeldPoint>
held_nodes(const Lattice& lattice,
           const std::function<bool(const Eigen::Vector3d&)>& is_held)
{
    std::vector<HeldPoint> points;
    for (std::size_t n = 0; n < lattice.places.size(); ++n)
        if (lattice.hanging[n].empty() && is_held(lattice.places[n]))
            points.push_back({{{static_cast<int>(n), 1.0}}, lattice.places[n], 0});
    return points;
}

/// Evenly over the side x = \p at of a bar of equal cells: forces of the nodes, which
/// sum to \p force. Their work is force times the side's mean displacement.
inline Eigen::VectorXd load_on_end(const Lattice& lattice, double at,
                                   const Eigen::Vector3d& force)
{
    Eigen::VectorXd load = Eigen::VectorXd::Zero(Eigen::Index(3 * lattice.places.size()));
    double corners = 0.0;
    for (const CornerNodes& cell : lattice.cells)
        for (const int node : cell)
            if (lattice.places[idx(node)].x() > at - 1e-9)
            {
                load.segment<3>(3 * node) += force;
                corners += 1.0;
            }
    return load / corners;
}

inline Eigen::VectorXd random_field(const Lattice& lattice, std::mt19937& rng,
                                    double size)
{
    Eigen::VectorXd u(Eigen::Index(3 * lattice.places.size()));
    for (double& x : u)
        x = random_number(rng, -size, size);
    return u;
}

/// Of all nodes, by a map of space.
inline Eigen::VectorXd
field_of(const Lattice& lattice,
         const std::function<Eigen::Vector3d(const Eigen::Vector3d&)>& displacement)
{
    Eigen::VectorXd u(Eigen::Index(3 * lattice.places.size()));
    for (std::size_t n = 0; n < lattice.places.size(); ++n)
        u.segment<3>(Eigen::Index(3 * n)) = displacement(lattice.places[n]);
    return u;
}

inline int count_zero(const Eigen::VectorXd& values)
{
    return static_cast<int>(
        (values.array().abs() < 1e-9 * values.cwiseAbs().maxCoeff()).count());
}

/// Matrix on the free nodes, the axes of each one after the other.
inline Eigen::MatrixXd reduced(const Flesh& flesh, double mass, double stiffness,
                               double tube)
{
    const Eigen::MatrixXd A = flesh.dense_matrix(mass, stiffness, tube);
    const BoundNodes& nodes = flesh.nodes();
    Eigen::MatrixXd Z =
        Eigen::MatrixXd::Zero(A.rows(), Eigen::Index(3 * nodes.free.size()));
    for (int c = 0; c < 3; ++c)
    {
        for (std::size_t k = 0; k < nodes.free.size(); ++k)
            Z(3 * nodes.free[k] + c, Eigen::Index(3 * k) + c) = 1.0;
        for (std::size_t k = 0; k < nodes.bound.size(); ++k)
            for (const NodeShare& share : nodes.by_free[k])
                Z(3 * nodes.bound[k] + c, 3 * share.node + c) = share.share;
    }
    return Z.transpose() * A * Z;
}

/// Natural motions of the free nodes, of small displacements: columns, and z^2 / dt^2.
using Modes = Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd>;

inline Modes modes_of(const Flesh& flesh)
{
    return Modes(reduced(flesh, 0, 1, 0), reduced(flesh, 1, 0, 0));
}

/// What a step leaves of the energy of a mode alone, as a share.
inline double energy_left(Flesh& flesh, const Modes& modes, int mode, double dt)
{
    const std::vector<Motion> still(1);
    FleshState state = flesh.rest();
    for (std::size_t k = 0; k < flesh.nodes().free.size(); ++k)
        state.u.segment<3>(3 * flesh.nodes().free[k]) =
            modes.eigenvectors().col(mode).segment<3>(Eigen::Index(3 * k));
    const auto now = [&]
    {
        const Flesh::Energies e = flesh.energies(state, still);
        return e.kinetic + e.elastic;
    };
    const double before = now();
    flesh.step(state, dt, still);
    return now() / before;
}

} // namespace cellwarp::core::support
