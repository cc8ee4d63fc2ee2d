// SPDX-License-Identifier: GPL-3.0-or-later
// A law is an energy of the deformation gradient F at a point, with the stress
// P = dW/dF and the second derivatives C = d2W/dF2 [theory-skeleton 4]:
//
// St. Venant-Kirchhoff: e = (F^T F - I) / 2, tau = lambda tr(e) I + 2 mu e,
//   W = tau : e / 2,  P = F tau; of the columns F_j, F_l of F (4.4) C_jl = tau_jl I +
//   lambda F_j F_l^T + mu delta_jl F F^T + mu F_l F_j^T,
// and only the first term can be negative: the filter takes tau's positive part there.
//
// Neo-Hookean, L = lambda + mu, J = det F, cof its derivative:
//   W = mu / 2 (|F|^2 - 3) - mu (J - 1) + L / 2 (J - 1)^2,                          (4.7)
//   P = mu F + p cof,  p = L (J - 1) - mu,  C = mu I + p d2J + L cof cof^T.
// With F = U diag(s) V^T the second derivative of J has eigenvalues s_k on
// U (e_j e_i^T - e_i e_j^T) V^T / sqrt 2, -s_k on the sum of these, and on the stretches
// the matrix with s_k between i and j; cof is s_j s_k on stretch i. The filter clamps the
// eigenvalues of C at 0.
//
// At a point of weight w, with the modes m_i of PartPoints, [SimoArmero92]
//   F = I + sum_c u_c g_c^T + sum_i a_i m_i^T,  V(u) = min over a of sum w W(F).
// The a are found by Newton's method from 0, so V is a function of u alone. They do no
// work at the minimum: dV/du = sum w P g, and d2V is what is left of the second
// derivatives by u and a after a is eliminated. At rest that is stiffness_of(), for both
// laws: small displacements cost the same by all laws, and cells bend without shear.
//   J is that of the point, not its mean over the part: a mean on lambda's share, which
// frees plain cells of volumetric locking, is right for bending by a factor of 1 + nu
// only because shear locks (cantilever 10 x 1 x 1, nu = 0.45: 3,886 of 3,937 with one
// cell, 3,747 with two). With modes nothing is left for it to make up for.
#include "solver/flesh/large_strain.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>

#include "octree/base/index.h"
#include "octree/base/rigid_motion.h"

namespace cellwarp::core
{

namespace
{

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Matrix9 = Eigen::Matrix<double, 9, 9>;
using Vector9 = Eigen::Matrix<double, 9, 1>;
using Slopes = Eigen::Matrix<double, 3, 8>;
using Deformations = std::array<Matrix3d, 8>; ///< F, of the points

/// Newton's method for the modes ends after a step that lowers the energy by less than
/// this, of shear times volume: it is exact to the square of that.
constexpr double kModesFound = 1e-12;
constexpr int kMostRounds = 30, kMostHalvings = 20;
/// A step is halved until the energy falls by this share of what its slope promises.
constexpr double kDescent = 1e-4;
/// In a part that is flat along an axis the mode there is none.
constexpr double kFlat = 1e-12;

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

/// The energy of a point.
struct PointLaw
{
    const FleshMaterial& material;
    StrainLaw law;
    double mu = material.shear(), lambda = material.lambda();

    static Matrix3d green_strain(const Matrix3d& F)
    {
        return 0.5 * (F.transpose() * F - Matrix3d::Identity());
    }
    Matrix3d green_stress(const Matrix3d& e) const
    {
        return lambda * e.trace() * Matrix3d::Identity() + 2.0 * mu * e;
    }
    double pressure(double J) const { return (lambda + mu) * (J - 1.0) - mu; }

    /// W and P [Pa].
    double energy(const Matrix3d& F, Matrix3d& P) const
    {
        if (law == StrainLaw::StVenantKirchhoff)
        {
            const Matrix3d e = green_strain(F), tau = green_stress(e);
            P.noalias() = F * tau;
            return 0.5 * tau.cwiseProduct(e).sum();
        }
        const Matrix3d cof = cofactor(F);
        const double J = F.col(0).dot(cof.col(0));
        P = mu * F + pressure(J) * cof;
        return 0.5 * mu * (F.squaredNorm() - 3.0) - mu * (J - 1.0) +
               0.5 * (lambda + mu) * (J - 1.0) * (J - 1.0);
    }

    /// C over the columns of F, one after the other [Pa].
    Matrix9 hessian(const Matrix3d& F, Filter filter) const
    {
        if (law == StrainLaw::StVenantKirchhoff)
            return green_hessian(F, filter);
        return filter == Filter::Yes ? filtered_neo_hookean(F) : neo_hookean(F);
    }

private:
    Matrix9 green_hessian(const Matrix3d& F, Filter filter) const
    {
        Matrix3d tau = green_stress(green_strain(F));
        if (filter == Filter::Yes)
        {
            const Eigen::SelfAdjointEigenSolver<Matrix3d> eigen(tau);
            tau = eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).asDiagonal() *
                  eigen.eigenvectors().transpose();
        }
        const Matrix3d FF = mu * F * F.transpose();
        Matrix9 C;
        for (int j = 0; j < 3; ++j)
            for (int l = 0; l < 3; ++l)
            {
                auto block = C.block<3, 3>(3 * j, 3 * l);
                block = lambda * F.col(j) * F.col(l).transpose() +
                        mu * F.col(l) * F.col(j).transpose();
                block.diagonal().array() += tau(j, l);
                if (j == l)
                    block += FF;
            }
        return C;
    }

    Matrix9 neo_hookean(const Matrix3d& F) const
    {
        const Matrix3d cof = cofactor(F);
        const double p = pressure(F.col(0).dot(cof.col(0)));
        const Vector9 c = cof.reshaped();
        Matrix9 C = (lambda + mu) * c * c.transpose();
        C.diagonal().array() += mu;
        for (int k = 0; k < 3; ++k)
        {
            const int i = (k + 1) % 3, j = (k + 2) % 3;
            const Matrix3d turned = p * cross_matrix(F.col(k));
            C.block<3, 3>(3 * i, 3 * j) -= turned;
            C.block<3, 3>(3 * j, 3 * i) += turned;
        }
        return C;
    }

    Matrix9 filtered_neo_hookean(const Matrix3d& F) const
    {
        const Eigen::JacobiSVD<Matrix3d> svd(F,
                                             Eigen::ComputeFullU | Eigen::ComputeFullV);
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
        const double p = pressure(s.prod());
        const auto direction = [&](int i, int j) -> Vector9
        { return (U.col(i) * V.col(j).transpose()).reshaped(); };
        Matrix9 H = Matrix9::Zero();
        Matrix3d stretch = mu * Matrix3d::Identity();
        Vector3d cof;
        for (int k = 0; k < 3; ++k)
        {
            const int i = (k + 1) % 3, j = (k + 2) % 3;
            const Vector9 a = direction(j, i), b = direction(i, j),
                          turn = (a - b) / std::sqrt(2.0), sum = (a + b) / std::sqrt(2.0);
            H += std::max(0.0, mu + p * s[k]) * turn * turn.transpose() +
                 std::max(0.0, mu - p * s[k]) * sum * sum.transpose();
            stretch(i, j) = stretch(j, i) = p * s[k];
            cof[k] = s[i] * s[j];
        }
        stretch += (lambda + mu) * cof * cof.transpose();
        const Eigen::SelfAdjointEigenSolver<Matrix3d> eigen(stretch);
        for (int m = 0; m < 3; ++m)
        {
            Vector9 way = Vector9::Zero();
            for (int i = 0; i < 3; ++i)
                way += eigen.eigenvectors()(i, m) * direction(i, i);
            H += std::max(0.0, eigen.eigenvalues()[m]) * way * way.transpose();
        }
        return H;
    }
};

/// A part at displacements of its corners: its modes, and F with them.
class ModedPart
{
public:
    ModedPart(const PartPoints& points, const PointLaw& law, const PartVector& u)
        : points_(points), law_(law)
    {
        for (int k = 0; k < 8; ++k)
        {
            slopes_[idx(k)] = points.slopes(k);
            plain_[idx(k)] = deformation(slopes_[idx(k)], u);
            volume_ += points.weight[idx(k)];
        }
        find_modes();
    }

    double energy() const { return energy_; } ///< [J]
    PartVector gradient() const
    {
        PartVector out = PartVector::Zero();
        for (std::size_t k = 0; k < 8; ++k)
            for (int c = 0; c < 8; ++c)
                out.segment<3>(3 * c) +=
                    points_.weight[k] * (stress_[k] * slopes_[k].col(c));
        return out;
    }
    PartMatrix hessian(Filter filter) const
    {
        PartMatrix H = PartMatrix::Zero();
        Matrix9 A = Matrix9::Zero();
        Eigen::Matrix<double, 24, 9> B = Eigen::Matrix<double, 24, 9>::Zero();
        for (std::size_t k = 0; k < 8; ++k)
        {
            const Matrix9 C = points_.weight[k] * law_.hessian(deformed_[k], filter);
            // d F = sum_c u_c g_c^T: entry (i, j) of F is number i + 3 j.
            Eigen::Matrix<double, 9, 24> dF = Eigen::Matrix<double, 9, 24>::Zero();
            for (int c = 0; c < 8; ++c)
                for (int axis = 0; axis < 3; ++axis)
                    dF.block<3, 3>(3 * axis, 3 * c)
                        .diagonal()
                        .setConstant(slopes_[k](axis, c));
            const Eigen::Matrix<double, 9, 24> CdF = C * dF;
            H.noalias() += dF.transpose() * CdF;
            for (int i = 0; i < 3; ++i)
                for (int j = 0; j < 3; ++j)
                    if (const double m = points_.modes[k](j, i); m != 0.0)
                        B.middleCols<3>(3 * i) +=
                            m * CdF.middleRows<3>(3 * j).transpose();
            add_modes(C, k, A);
        }
        A.diagonal().array() += kFlat * A.trace();
        H -= B * A.ldlt().solve(B.transpose());
        return 0.5 * (H + H.transpose());
    }

private:
    /// Adds the block of the modes; \p C: times the weight of point \p k.
    void add_modes(const Matrix9& C, std::size_t k, Matrix9& A) const
    {
        const Matrix3d& modes = points_.modes[k];
        for (int i = 0; i < 3; ++i)
            for (int l = 0; l < 3; ++l)
                for (int j = 0; j < 3; ++j)
                    for (int n = 0; n < 3; ++n)
                        if (const double m = modes(j, i) * modes(n, l); m != 0.0)
                            A.block<3, 3>(3 * i, 3 * l) +=
                                m * C.block<3, 3>(3 * j, 3 * n);
    }

    /// To the deformations with modes \p a, and their energy.
    double go_to(const Vector9& a)
    {
        const Eigen::Map<const Matrix3d> columns(a.data());
        double energy = 0.0;
        for (std::size_t k = 0; k < 8; ++k)
        {
            deformed_[k] = plain_[k] + columns * points_.modes[k].transpose();
            energy += points_.weight[k] * law_.energy(deformed_[k], stress_[k]);
        }
        return energy;
    }

    void find_modes()
    {
        Vector9 a = Vector9::Zero();
        energy_ = go_to(a);
        const double found = kModesFound * law_.mu * volume_;
        for (int round = 0; round < kMostRounds; ++round)
        {
            Eigen::Matrix3d force = Eigen::Matrix3d::Zero(); // a column a mode
            for (std::size_t k = 0; k < 8; ++k)
                force -= points_.weight[k] * (stress_[k] * points_.modes[k]);
            const Vector9 b = force.reshaped();
            Vector9 step = solved(b, Filter::No);
            double promise = b.dot(step);
            if (!(promise >= 0.0)) // it does not descend there
            {
                step = solved(b, Filter::Yes);
                promise = b.dot(step);
            }
            if (!(promise > 0.0))
                return;
            double length = 1.0, energy = go_to(a + step);
            for (int half = 0; half < kMostHalvings && promise > found &&
                               !(energy <= energy_ - kDescent * length * promise);
                 ++half)
            {
                length *= 0.5;
                energy = go_to(a + length * step);
            }
            a += length * step;
            energy_ = energy;
            if (promise <= found)
                return;
        }
    }

    /// By the second derivatives of the modes; not finite where they are not positive.
    Vector9 solved(const Vector9& b, Filter filter) const
    {
        Matrix9 A = Matrix9::Zero();
        for (std::size_t k = 0; k < 8; ++k)
            add_modes(points_.weight[k] * law_.hessian(deformed_[k], filter), k, A);
        A.diagonal().array() += kFlat * A.trace();
        const Eigen::LLT<Matrix9> factor(A);
        if (factor.info() != Eigen::Success)
            return Vector9::Constant(std::nan(""));
        return factor.solve(b);
    }

    const PartPoints& points_;
    const PointLaw& law_;
    std::array<Slopes, 8> slopes_;
    Deformations plain_, deformed_; ///< without the modes, and with them
    Deformations stress_;           ///< P
    double volume_ = 0.0, energy_ = 0.0;
};

} // namespace

double least_volume(const PartPoints& points, const PartVector& u)
{
    double least = INFINITY;
    for (int k = 0; k < 8; ++k)
        least = std::min(least, deformation(points.slopes(k), u).determinant());
    return least;
}

StrainEnergy strain_energy(const PartPoints& points, const FleshMaterial& material,
                           StrainLaw law, const PartVector& u)
{
    const PointLaw of_point{material, law};
    const ModedPart part(points, of_point, u);
    return {part.energy(), part.gradient()};
}

PartMatrix strain_hessian(const PartPoints& points, const FleshMaterial& material,
                          StrainLaw law, const PartVector& u, Filter filter)
{
    const PointLaw of_point{material, law};
    return ModedPart(points, of_point, u).hessian(filter);
}

} // namespace cellwarp::core
