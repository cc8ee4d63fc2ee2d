// SPDX-License-Identifier: GPL-3.0-or-later
// With D = T_a - T_b and a cell's centroid c and second moment S,
//   int_C |D|^2 = V ( |D(c)|^2 + tr(dR S dR^T) ),   dR = R_a - R_b,
// because D is affine. Over both cells, divided by V_a + V_b and with
// S = (V_a S_a + V_b S_b) / (V_a + V_b) = sum_k l_k l_k^T,
//   E = w ( s_a |D(c_a)|^2 + s_b |D(c_b)|^2 + sum_k |R_a l_k - R_b l_k|^2 ).
// So E is a sum of five terms m |d|^2 with
//   d = (r_a + f p_a) - (r_b + f p_b),
// arms r that turn with their cell and f = 1 for the two centres, 0 for the moments.
// A twist changes r by omega x r + 1/2 omega x (omega x r) and p by v + 1/2 omega x v
// (see pose.cpp), hence
//   dE = 2 m d . (omega_a x r_a + f v_a - omega_b x r_b - f v_b),
// the Gauss-Newton matrix is 2 m J^T J, and the curvature of omega_a adds
//   2 m [ (d r^T + r d^T) / 2 - (d . r) I ],   that of omega_b the same with -d;
// with g_v the gradient in v, the blocks of (v, omega) gain [g_v]x / 2.
#include "solver/glue.h"

#include <cmath>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "octree/parallel.h"

namespace cellwarp
{

namespace
{

struct Term
{
    double weight;
    bool has_position;
    Eigen::Vector3d d, arm_a, arm_b;
};

std::array<Term, 5> terms(const GlueFace& face, const Pose& a, const Pose& b)
{
    std::array<Term, 5> t;
    const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
    const Eigen::Vector3d gap = a.p - b.p;
    // At c_a the arm of a is 0 and that of b is R_b (c_a - c_b); at c_b in turn.
    t[0] = {face.stiffness * face.share_a, true, gap + b.R * face.offset, zero,
            -(b.R * face.offset)};
    t[1] = {face.stiffness * face.share_b, true, gap + a.R * face.offset,
            a.R * face.offset, zero};
    for (int k = 0; k < 3; ++k)
    {
        Term& term = t[static_cast<std::size_t>(2 + k)];
        term.weight = face.stiffness;
        term.has_position = false;
        term.arm_a = a.R * face.moment_root.col(k);
        term.arm_b = b.R * face.moment_root.col(k);
        term.d = term.arm_a - term.arm_b;
    }
    return t;
}

/// [ (d r^T + r d^T) / 2 - (d . r) I ]
Eigen::Matrix3d arm_curvature(const Eigen::Vector3d& d, const Eigen::Vector3d& r)
{
    return 0.5 * (d * r.transpose() + r * d.transpose()) -
           d.dot(r) * Eigen::Matrix3d::Identity();
}

Eigen::Matrix3d square_root(const Eigen::Matrix3d& S)
{
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(S);
    return eigen.eigenvectors() *
           eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
}

} // namespace

Glue build_glue(const Cells& cells, std::span<const double> cell_factors)
{
    Glue glue;
    std::vector<std::vector<int>> of_cell(cells.size());
    glue.faces.resize(cells.faces.size());
    for (std::size_t f = 0; f < cells.faces.size(); ++f)
    {
        const Face& face = cells.faces[f];
        const Cell& a = cells.cells[static_cast<std::size_t>(face.a)];
        const Cell& b = cells.cells[static_cast<std::size_t>(face.b)];
        double factor = 1.0;
        if (!cell_factors.empty())
        {
            const double fa = cell_factors[static_cast<std::size_t>(face.a)];
            const double fb = cell_factors[static_cast<std::size_t>(face.b)];
            if (fa != 1.0 && fb != 1.0)
                factor = fa == fb ? fa : std::sqrt(fa) * std::sqrt(fb);
        }
        GlueFace& out = glue.faces[f];
        out.a = face.a;
        out.b = face.b;
        out.stiffness = factor * face.area / (face.distance_a + face.distance_b);
        out.offset = b.centre - a.centre;
        out.share_a = a.volume / (a.volume + b.volume);
        out.share_b = b.volume / (a.volume + b.volume);
        out.moment_root =
            square_root(out.share_a * a.second_moment + out.share_b * b.second_moment);
        of_cell[static_cast<std::size_t>(face.a)].push_back(static_cast<int>(f));
        of_cell[static_cast<std::size_t>(face.b)].push_back(static_cast<int>(f));
    }
    glue.first_face.push_back(0);
    for (const std::vector<int>& faces : of_cell)
    {
        glue.faces_of_cell.insert(glue.faces_of_cell.end(), faces.begin(), faces.end());
        glue.first_face.push_back(static_cast<int>(glue.faces_of_cell.size()));
    }
    return glue;
}

double glue_energy(const GlueFace& face, const Pose& a, const Pose& b)
{
    double energy = 0.0;
    for (const Term& term : terms(face, a, b))
        energy += term.weight * term.d.squaredNorm();
    return energy;
}

Eigen::Matrix<double, 12, 1> glue_gradient(const GlueFace& face, const Pose& a,
                                           const Pose& b)
{
    Eigen::Matrix<double, 12, 1> gradient = Eigen::Matrix<double, 12, 1>::Zero();
    for (const Term& term : terms(face, a, b))
    {
        const Eigen::Vector3d force = 2.0 * term.weight * term.d;
        gradient.segment<3>(0) += term.arm_a.cross(force);
        gradient.segment<3>(6) -= term.arm_b.cross(force);
        if (term.has_position)
        {
            gradient.segment<3>(3) += force;
            gradient.segment<3>(9) -= force;
        }
    }
    return gradient;
}

GlueBlock glue_block(const GlueFace& face, const Pose& a, const Pose& b,
                     Curvature curvature)
{
    GlueBlock block;
    block.gradient = glue_gradient(face, a, b);
    for (const Term& term : terms(face, a, b))
    {
        block.energy += term.weight * term.d.squaredNorm();
        Eigen::Matrix<double, 3, 12> J = Eigen::Matrix<double, 3, 12>::Zero();
        J.block<3, 3>(0, 0) = -cross_matrix(term.arm_a);
        J.block<3, 3>(0, 6) = cross_matrix(term.arm_b);
        if (term.has_position)
        {
            J.block<3, 3>(0, 3).setIdentity();
            J.block<3, 3>(0, 9) = -Eigen::Matrix3d::Identity();
        }
        block.hessian.noalias() += 2.0 * term.weight * (J.transpose() * J);
        if (curvature.share > 0)
        {
            block.hessian.block<3, 3>(0, 0) +=
                2.0 * curvature.share * term.weight * arm_curvature(term.d, term.arm_a);
            block.hessian.block<3, 3>(6, 6) -=
                2.0 * curvature.share * term.weight * arm_curvature(term.d, term.arm_b);
        }
    }
    if (curvature.share > 0)
        for (const int at : {0, 6})
        {
            const Eigen::Matrix3d half =
                0.5 * curvature.share * cross_matrix(block.gradient.segment<3>(at + 3));
            block.hessian.block<3, 3>(at + 3, at) += half;
            block.hessian.block<3, 3>(at, at + 3) += half.transpose();
        }
    return block;
}

double glue_energy(const Glue& glue, std::span<const Pose> poses)
{
    std::vector<double> energies(glue.faces.size());
    parallel_for(glue.faces.size(),
                 [&](std::size_t f)
                 {
                     const GlueFace& face = glue.faces[f];
                     energies[f] =
                         glue_energy(face, poses[static_cast<std::size_t>(face.a)],
                                     poses[static_cast<std::size_t>(face.b)]);
                 });
    double sum = 0.0;
    for (const double energy : energies)
        sum += energy;
    return sum;
}

} // namespace cellwarp
