// SPDX-License-Identifier: GPL-3.0-or-later
// How [Capell02] integrates over a cell: by tetrahedra, and by integrals that are taken
// once. The program does neither; they stand beside what it does. [theory-skeleton 3, 4]
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include "solver/flesh/lattice.h"
#include "solver/flesh/part_points.h"

namespace cellwarp::core::support
{

struct CellMatrices
{
    PartMatrix stiffness = PartMatrix::Zero();
    Eigen::Matrix<double, 8, 8> mass = Eigen::Matrix<double, 8, 8>::Zero();
};

/// Of a box in 2^\p halvings parts along each axis, each as 24 tetrahedra of its middle,
/// the middle of a side, and an edge of that side, on which functions are linear.
inline CellMatrices tetrahedral(const Lattice& lattice, int cell,
                                const FleshMaterial& material, int halvings)
{
    using Eigen::Vector3d;
    CellMatrices out;
    const int parts = 1 << halvings;
    const double edge = lattice.edge(cell) / parts;
    const auto add = [&](const std::array<Vector3d, 4>& local)
    {
        Eigen::Matrix3d ways;
        std::array<std::array<double, 8>, 4> shares;
        for (std::size_t k = 0; k < 4; ++k)
        {
            shares[k] = corner_shares(local[k] / parts);
            if (k > 0)
                ways.col(Eigen::Index(k) - 1) = edge * (local[k] - local[0]);
        }
        const double volume = std::abs(ways.determinant()) / 6.0;
        const Eigen::Matrix3d slopes = ways.inverse().transpose();
        Eigen::Matrix<double, 3, 8> g = Eigen::Matrix<double, 3, 8>::Zero();
        for (Eigen::Index a = 0; a < 8; ++a)
            for (std::size_t k = 1; k < 4; ++k)
                g.col(a) += (shares[k][std::size_t(a)] - shares[0][std::size_t(a)]) *
                            slopes.col(Eigen::Index(k) - 1);
        const double lambda = material.lambda(), mu = material.shear();
        for (Eigen::Index a = 0; a < 8; ++a)
            for (Eigen::Index b = 0; b < 8; ++b)
            {
                out.stiffness.block<3, 3>(3 * a, 3 * b) +=
                    volume * (lambda * g.col(a) * g.col(b).transpose() +
                              mu * g.col(a).dot(g.col(b)) * Eigen::Matrix3d::Identity() +
                              mu * g.col(b) * g.col(a).transpose());
                for (std::size_t i = 0; i < 4; ++i)
                    for (std::size_t j = 0; j < 4; ++j)
                        out.mass(a, b) +=
                            material.density * volume / 20.0 * (i == j ? 2.0 : 1.0) *
                            shares[i][std::size_t(a)] * shares[j][std::size_t(b)];
            }
    };
    for (int part = 0; part < parts * parts * parts; ++part)
    {
        const Vector3d first(part % parts, part / parts % parts, part / (parts * parts));
        const Vector3d middle = first + Vector3d::Constant(0.5);
        for (int axis = 0; axis < 3; ++axis)
            for (const double side : {-0.5, 0.5})
            {
                const Vector3d face = middle + side * Vector3d::Unit(axis);
                const Vector3d u = 0.5 * Vector3d::Unit((axis + 1) % 3),
                               v = 0.5 * Vector3d::Unit((axis + 2) % 3);
                const std::array<Vector3d, 4> corners = {face - u - v, face + u - v,
                                                         face + u + v, face - u + v};
                for (std::size_t k = 0; k < 4; ++k)
                    add({middle, face, corners[k], corners[(k + 1) % 4]});
            }
    }
    return out;
}

/// Of the slopes g_a of a box's corner functions: A^ab = int g_a g_b^T,
/// C^abc = int g_a (g_b . g_c), D^abcd = int (g_a . g_b)(g_c . g_d); B^ab = tr A^ab. By
/// Gauss's rule of three points along each axis, which is exact.
struct PrecomputedIntegrals
{
    std::vector<Eigen::Matrix3d> A;                  ///< 64
    std::vector<Eigen::Vector3d> C;                  ///< 512
    std::vector<double> D;                           ///< 4096
    std::vector<Eigen::Matrix<double, 3, 8>> slopes; ///< at the points
    std::vector<double> weights;

    explicit PrecomputedIntegrals(double edge, int points = 3)
        : A(64, Eigen::Matrix3d::Zero()), C(512, Eigen::Vector3d::Zero()), D(4096, 0.0)
    {
        const double far = points == 3 ? std::sqrt(0.15) : 0.5 / std::sqrt(3.0);
        for (int p = 0; p < points * points * points; ++p)
        {
            double weight = edge * edge * edge;
            Eigen::Vector3d local;
            for (int axis = 0, rest = p; axis < 3; ++axis, rest /= points)
            {
                const int k = rest % points;
                local[axis] = 0.5 + (points == 3 ? (k - 1) * far : (2 * k - 1) * far);
                weight *= points == 2 ? 0.5 : k == 1 ? 4.0 / 9.0 : 5.0 / 18.0;
            }
            Eigen::Matrix<double, 3, 8> g;
            for (int a = 0; a < 8; ++a)
                for (int i = 0; i < 3; ++i)
                {
                    double slope = 1.0;
                    for (int axis = 0; axis < 3; ++axis)
                    {
                        const bool is_far = a >> axis & 1;
                        slope *= axis == i ? (is_far ? 1.0 : -1.0) / edge
                                 : is_far  ? local[axis]
                                           : 1.0 - local[axis];
                    }
                    g(i, a) = slope;
                }
            const Eigen::Matrix<double, 8, 8> dots = g.transpose() * g;
            for (int a = 0; a < 8; ++a)
                for (int b = 0; b < 8; ++b)
                {
                    A[std::size_t(8 * a + b)] += weight * g.col(a) * g.col(b).transpose();
                    for (int c = 0; c < 8; ++c)
                    {
                        C[std::size_t(64 * a + 8 * b + c)] +=
                            weight * dots(b, c) * g.col(a);
                        for (int d = 0; d < 8; ++d)
                            D[std::size_t(512 * a + 64 * b + 8 * c + d)] +=
                                weight * dots(a, b) * dots(c, d);
                    }
                }
            slopes.push_back(g);
            weights.push_back(weight);
        }
    }

    const Eigen::Matrix3d& of_two(int a, int b) const
    {
        return A[std::size_t(8 * a + b)];
    }
    const Eigen::Vector3d& of_three(int a, int b, int c) const
    {
        return C[std::size_t(64 * a + 8 * b + c)];
    }
    double of_four(int a, int b, int c, int d) const
    {
        return D[std::size_t(512 * a + 64 * b + 8 * c + d)];
    }
};

} // namespace cellwarp::core::support
