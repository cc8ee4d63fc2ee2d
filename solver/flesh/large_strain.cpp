// SPDX-License-Identifier: GPL-3.0-or-later
// With F = I + sum_c u_c g_c^T at a point of weight w [theory-skeleton 4]:
//
// St. Venant-Kirchhoff: e = (F^T F - I) / 2, tau = lambda tr(e) I + 2 mu e,
//   dV/du_c = sum w F tau g_c                                                      (4.3)
//   d2V/du_c du_d = sum w [(g_c . tau g_d) I + lambda (F g_c)(F g_d)^T
//                          + mu (g_c . g_d) F F^T + mu (F g_d)(F g_c)^T]           (4.4)
// and only the first term can be negative: the filter takes tau's positive part there.
//
// Neo-Hookean, L = lambda + mu, J' the mean of det F over the part of volume V:
//   V_e = sum w [mu / 2 (|F|^2 - 3) - mu (J - 1)] + L V (J' - 1)^2 / 2             (4.7)
//   dV/du_c = sum w (mu F + p cof F) g_c,  p = L (J' - 1) - mu
//   d2V = sum w (mu I + p d2J) + (L / V) j j^T,  j_c = sum w cof(F) g_c.
// With F = U diag(s) V^T the second derivative of J has eigenvalues s_k on
// U (e_j e_i^T - e_i e_j^T) V^T / sqrt 2, -s_k on the sum of these, and on the stretches
// the matrix with s_k between i and j: the filter clamps mu plus p times these at 0.
#include "solver/flesh/large_strain.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>

#include "octree/base/index.h"

namespace cellwarp
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Matrix9 = Eigen::Matrix<double, 9, 9>;
using Slopes = Eigen::Matrix<double, 3, 8>;

Matrix3d deformation(const Slopes& g, const PartVector& u)
{
    Matrix3d F = Matrix3d::Identity();
    for (int c = 0; c < 8; ++c)
        F += u.segment<3>(3 * c) * g.col(c).transpose();
    return F;
}

Matrix3d cofactor(const Matrix3d& F)
{
    Matrix3d out;
    out << F.col(1).cross(F.col(2)), F.col(2).cross(F.col(0)), F.col(0).cross(F.col(1));
    return out;
}

Matrix3d green_stress(const Matrix3d& F, const FleshMaterial& material)
{
    const Matrix3d e = 0.5 * (F.transpose() * F - Matrix3d::Identity());
    return material.lambda() * e.trace() * Matrix3d::Identity() +
           2.0 * material.shear() * e;
}

double mean_volume(const PartPoints& points, const PartVector& u, double& volume)
{
    double sum = 0.0;
    volume = 0.0;
    for (int k = 0; k < 8; ++k)
    {
        sum += points.weight[idx(k)] * deformation(points.slopes(k), u).determinant();
        volume += points.weight[idx(k)];
    }
    return sum / volume;
}

/// mu I + p d2J at a point, over the columns of F one after the other.
Matrix9 point_hessian(const Matrix3d& F, double mu, double p, Filter filter)
{
    const Eigen::JacobiSVD<Matrix3d> svd(F, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Matrix3d U = svd.matrixU(), V = svd.matrixV();
    Vector3d s = svd.singularValues();
    if (U.determinant() < 0.0)
    {
        U.col(2) *= -1.0;
        s[2] *= -1.0;
    }
    if (V.determinant() < 0.0)
    {
        V.col(2) *= -1.0;
        s[2] *= -1.0;
    }
    const auto kept = [&](double value)
    { return filter == Filter::Yes ? std::max(0.0, value) : value; };
    const auto direction = [&](int i, int j) -> Eigen::Matrix<double, 9, 1>
    { return (U.col(i) * V.col(j).transpose()).reshaped(); };
    Matrix9 H = Matrix9::Zero();
    for (int k = 0; k < 3; ++k)
    {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        const Eigen::Matrix<double, 9, 1> a = direction(j, i), b = direction(i, j),
                                          turn = (a - b) / std::sqrt(2.0),
                                          sum = (a + b) / std::sqrt(2.0);
        H += kept(mu + p * s[k]) * turn * turn.transpose() +
             kept(mu - p * s[k]) * sum * sum.transpose();
    }
    Matrix3d stretch = mu * Matrix3d::Identity();
    for (int k = 0; k < 3; ++k)
    {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        stretch(i, j) = stretch(j, i) = p * s[k];
    }
    const Eigen::SelfAdjointEigenSolver<Matrix3d> eigen(stretch);
    for (int m = 0; m < 3; ++m)
    {
        Eigen::Matrix<double, 9, 1> way = Eigen::Matrix<double, 9, 1>::Zero();
        for (int i = 0; i < 3; ++i)
            way += eigen.eigenvectors()(i, m) * direction(i, i);
        H += kept(eigen.eigenvalues()[m]) * way * way.transpose();
    }
    return H;
}

} // namespace

StrainEnergy strain_energy(const PartPoints& points, const FleshMaterial& material,
                           StrainLaw law, const PartVector& u)
{
    StrainEnergy out;
    const double mu = material.shear(), L = material.lambda() + mu;
    double volume = 0.0;
    const double J = mean_volume(points, u, volume);
    if (law == StrainLaw::NeoHookean)
        out.energy += 0.5 * L * volume * (J - 1.0) * (J - 1.0);
    for (int k = 0; k < 8; ++k)
    {
        const double w = points.weight[idx(k)];
        const Slopes g = points.slopes(k);
        const Matrix3d F = deformation(g, u);
        const double det = F.determinant();
        out.least_volume = std::min(out.least_volume, det);
        Matrix3d P; // first Piola-Kirchhoff stress
        if (law == StrainLaw::StVenantKirchhoff)
        {
            const Matrix3d tau = green_stress(F, material);
            const Matrix3d e = 0.5 * (F.transpose() * F - Matrix3d::Identity());
            out.energy += 0.5 * w * (tau.array() * e.array()).sum();
            P = F * tau;
        }
        else
        {
            out.energy += w * (0.5 * mu * (F.squaredNorm() - 3.0) - mu * (det - 1.0));
            P = mu * F + (L * (J - 1.0) - mu) * cofactor(F);
        }
        for (int c = 0; c < 8; ++c)
            out.gradient.segment<3>(3 * c) += w * P * g.col(c);
    }
    return out;
}

PartMatrix strain_hessian(const PartPoints& points, const FleshMaterial& material,
                          StrainLaw law, const PartVector& u, Filter filter)
{
    PartMatrix H = PartMatrix::Zero();
    const double mu = material.shear(), lambda = material.lambda(), L = lambda + mu;
    double volume = 0.0;
    const double p = L * (mean_volume(points, u, volume) - 1.0) - mu;
    PartVector j = PartVector::Zero();
    for (int k = 0; k < 8; ++k)
    {
        const double w = points.weight[idx(k)];
        const Slopes g = points.slopes(k);
        const Matrix3d F = deformation(g, u);
        if (law == StrainLaw::StVenantKirchhoff)
        {
            Matrix3d tau = green_stress(F, material);
            if (filter == Filter::Yes)
            {
                const Eigen::SelfAdjointEigenSolver<Matrix3d> eigen(tau);
                tau = eigen.eigenvectors() *
                      eigen.eigenvalues().cwiseMax(0.0).asDiagonal() *
                      eigen.eigenvectors().transpose();
            }
            const Matrix3d FF = F * F.transpose();
            const Slopes Fg = F * g;
            for (int c = 0; c < 8; ++c)
                for (int d = 0; d < 8; ++d)
                    H.block<3, 3>(3 * c, 3 * d) +=
                        w * (g.col(c).dot(tau * g.col(d)) * Matrix3d::Identity() +
                             lambda * Fg.col(c) * Fg.col(d).transpose() +
                             mu * g.col(c).dot(g.col(d)) * FF +
                             mu * Fg.col(d) * Fg.col(c).transpose());
            continue;
        }
        const Matrix9 at_point = point_hessian(F, mu, p, filter);
        // d F = sum_c u_c g_c^T: entry (i, j) of F is number i + 3 j.
        Eigen::Matrix<double, 9, 24> dF = Eigen::Matrix<double, 9, 24>::Zero();
        const Matrix3d cof = cofactor(F);
        for (int c = 0; c < 8; ++c)
        {
            for (int axis = 0; axis < 3; ++axis)
                dF.block<3, 3>(3 * axis, 3 * c) = g(axis, c) * Matrix3d::Identity();
            j.segment<3>(3 * c) += w * cof * g.col(c);
        }
        H += w * dF.transpose() * at_point * dF;
    }
    if (law == StrainLaw::NeoHookean)
        H += L / volume * j * j.transpose();
    return H;
}

} // namespace cellwarp
