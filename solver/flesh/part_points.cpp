// SPDX-License-Identifier: GPL-3.0-or-later
// For small displacements u, with g_a the slope of corner a's function at a point of
// weight w, [theory-skeleton 4]:
//   K_ab = sum w [lambda g_a g_b^T + mu ((g_a . g_b) I + g_b g_a^T)].
// A mode is a gradient a_i m^T that belongs to no displacement of the corners. Its cost
// is the same form with m in place of g; the a_i that cost least are eliminated:
//   K - B A^-1 B^T,  B_(b,i) = sum w [lambda g_b m_i^T + mu ((g_b . m_i) I + m_i g_b^T)].
//
// Modes are the gradients of 1 - xi_i^2 along the cell's own axes, less their mean over
// the part: m_i = (x - c)_i e_i in a box. They must not be the gradient of anything
// trilinear. Along the principal axes of the part they would be: in axes p, q that lie at
// 45 degrees to x, y the function x y is (p^2 - q^2) / 2, so that it cost nothing, and
// cells that the surface cuts warped freely. (theory-skeleton 4.2 has the principal axes;
// an arm that bends at E = 3e4 Pa, dt = 1/960 s tore its own skin.)
#include "solver/flesh/part_points.h"

#include <cmath>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "octree/base/index.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// The block of gradients a g^T and b h^T: their energy is a^T (block) b.
Matrix3d stiffness_block(const Vector3d& g, const Vector3d& h,
                         const FleshMaterial& material)
{
    return material.lambda() * g * h.transpose() +
           material.shear() * (g.dot(h) * Matrix3d::Identity() + h * g.transpose());
}

Vector3d mode_at(const PartPoints& points, int k, int i)
{
    return points.modes[idx(k)].col(i);
}

PartPoints box_points(const Lattice& lattice, const LatticePart& part)
{
    PartPoints out;
    const Eigen::SelfAdjointEigenSolver<Matrix3d> axes(part.second_moment);
    const double edge = lattice.edge(part.cell);
    const Vector3d low = lattice.places[idx(lattice.cells[idx(part.cell)][0])];
    const Vector3d spread = axes.eigenvalues().cwiseMax(0.0).cwiseSqrt();
    for (int k = 0; k < 8; ++k)
    {
        Vector3d x = part.centre - low;
        for (int i = 0; i < 3; ++i)
            x += sign_of(k, i) * spread[i] * axes.eigenvectors().col(i);
        out.local[idx(k)] = x / edge;
        out.modes[idx(k)] = ((x - (part.centre - low)) / edge).asDiagonal();
        out.inverse[idx(k)] = Matrix3d::Identity() / edge;
        out.weight[idx(k)] = part.volume / 8.0;
    }
    return out;
}

/// The mode of 1 - xi^2 has the gradient -2 xi, with the slopes of the cell's middle, so
/// that even strain costs nothing of it.
PartPoints gauss_points(const Lattice& lattice, const LatticePart& part)
{
    PartPoints out;
    const double at = 1.0 / std::sqrt(3.0);
    const Vector3d middle = Vector3d::Constant(0.5);
    const Matrix3d J0 = cell_slopes(lattice, part.cell, middle);
    const Matrix3d middle_modes = -4.0 * at * J0.inverse().transpose();
    for (int k = 0; k < 8; ++k)
    {
        Vector3d& local = out.local[idx(k)];
        for (int i = 0; i < 3; ++i)
            local[i] = 0.5 * (1.0 + sign_of(k, i) * at);
        const Matrix3d J = cell_slopes(lattice, part.cell, local);
        out.inverse[idx(k)] = J.inverse();
        out.weight[idx(k)] = J.determinant() / 8.0;
        for (int i = 0; i < 3; ++i)
            out.modes[idx(k)].col(i) =
                J0.determinant() / J.determinant() * sign_of(k, i) * middle_modes.col(i);
    }
    return out;
}

} // namespace

Eigen::Matrix<double, 3, 8> PartPoints::slopes(int k) const
{
    Eigen::Matrix<double, 3, 8> out;
    const Vector3d& at = local[idx(k)];
    for (int a = 0; a < 8; ++a)
    {
        Vector3d value, slope;
        for (int i = 0; i < 3; ++i)
        {
            slope[i] = sign_of(a, i);
            value[i] = slope[i] > 0 ? at[i] : 1.0 - at[i];
        }
        out.col(a) << slope.x() * value.y() * value.z(),
            value.x() * slope.y() * value.z(), value.x() * value.y() * slope.z();
    }
    return inverse[idx(k)].transpose() * out;
}

PartPoints points_of(const Lattice& lattice, const LatticePart& part)
{
    return lattice.has_boxes ? box_points(lattice, part) : gauss_points(lattice, part);
}

Eigen::Matrix<double, 9, 9> mode_solve(const PartPoints& points,
                                       const FleshMaterial& material)
{
    // In a part that is flat along an axis the mode there is none.
    constexpr double kFlat = 1e-12;
    Eigen::Matrix<double, 9, 9> A = Eigen::Matrix<double, 9, 9>::Zero();
    for (int k = 0; k < 8; ++k)
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j)
                A.block<3, 3>(3 * i, 3 * j) +=
                    points.weight[idx(k)] * stiffness_block(mode_at(points, k, i),
                                                            mode_at(points, k, j),
                                                            material);
    A.diagonal().array() += kFlat * A.trace();
    const Eigen::Matrix<double, 9, 9> inverse = A.inverse();
    return 0.5 * (inverse + inverse.transpose());
}

PartMatrix stiffness_of(const PartPoints& points, const FleshMaterial& material,
                        bool has_modes)
{
    PartMatrix K = PartMatrix::Zero();
    Eigen::Matrix<double, 24, 9> B = Eigen::Matrix<double, 24, 9>::Zero();
    for (int k = 0; k < 8; ++k)
    {
        const double w = points.weight[idx(k)];
        const Eigen::Matrix<double, 3, 8> g = points.slopes(k);
        for (int a = 0; a < 8; ++a)
        {
            for (int b = 0; b < 8; ++b)
                K.block<3, 3>(3 * a, 3 * b) +=
                    w * stiffness_block(g.col(a), g.col(b), material);
            for (int i = 0; i < 3; ++i)
                B.block<3, 3>(3 * a, 3 * i) +=
                    w * stiffness_block(g.col(a), mode_at(points, k, i), material);
        }
    }
    if (has_modes)
        K -= B * mode_solve(points, material) * B.transpose();
    return K;
}

Eigen::Matrix<double, 8, 8> mass_of(const PartPoints& points, double density)
{
    Eigen::Matrix<double, 8, 8> M = Eigen::Matrix<double, 8, 8>::Zero();
    for (std::size_t k = 0; k < 8; ++k)
    {
        const std::array<double, 8> shares = corner_shares(points.local[k]);
        const Eigen::Map<const Eigen::Matrix<double, 8, 1>> phi(shares.data());
        M += density * points.weight[k] * phi * phi.transpose();
    }
    return M;
}

} // namespace cellwarp::core
